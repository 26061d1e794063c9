"""Names of states and inputs in figures."""

from __future__ import annotations

import re

_BODY = re.compile(r"(?:body_rate|attitude|torque)_([wxyz])$")
_NUMBERED = re.compile(r"(?:velocity|position|force)_(\d)$")
_LETTER = {"body_rate": r"\omega", "attitude": "q", "torque": r"\tau", "velocity": "v", "position": "p", "force": "F"}


def symbol(name: str) -> tuple[str, str]:
    """ "body_rate_x [rad/s]" as "$\\omega_x$" and "rad/s"; a joint by its own name."""
    bare, _, unit = name.partition(" [")
    stem, _, index = bare.rpartition("_")
    if _BODY.match(bare) or _NUMBERED.match(bare):
        return f"${_LETTER[stem]}_{{{index}}}$", unit.rstrip("]")
    return bare.removeprefix("velocity_").removeprefix("position_").replace("_", " "), unit.rstrip("]")


def with_unit(name: str) -> str:
    """Return the symbol with its unit in brackets, if it has one."""
    letters, unit = symbol(name)
    return letters if unit in ("", "-") else f"{letters} [{unit}]"
