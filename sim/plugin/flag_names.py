"""The names of the fields of dataclasses on the command line."""

from __future__ import annotations


def joined(prefix: str, field: str) -> str:
    """The dotted name of a field below a prefix: "noise.rate"; a word that Python keeps for itself ends in "_"."""
    return f"{prefix}.{field.rstrip('_')}".strip(".")


def flag_of(name: str) -> str:
    """The flag of a dotted name: --planner.grid-nodes for planner.grid_nodes."""
    return f"--{name.replace('_', '-')}"


def negation(flag: str) -> str:
    """The flag that sets a truth value to false: --planner.no-warm for --planner.warm."""
    above, dot, name = flag.removeprefix("--").rpartition(".")
    return f"--{above}{dot}no-{name}"
