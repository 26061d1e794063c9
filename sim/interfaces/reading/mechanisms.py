"""MJCF files: the ones of this package, and those of a stranger."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import mujoco

from mathnavi.sim.interfaces.reading.files import MEBIBYTE, Refusal, read_bytes

MOST_MJCF = 16 * MEBIBYTE
_DECLARATION = re.compile(rb"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)


def read_spec(path: Path, error: Refusal) -> Any:
    """The ``mujoco.MjSpec`` of an MJCF file; ``error`` for one that MuJoCo cannot read.

    A document type is refused: MJCF has none, and entities expand without end.
    """
    if _DECLARATION.search(read_bytes(path, error, MOST_MJCF)):
        raise error(f"{path}: it declares a document type or entities; allowed: MJCF, which has neither")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, mujoco.FatalError) as fault:
        raise error(f"{path}: MuJoCo cannot read it ({fault})") from None
