"""Robots of MuJoCo Menagerie, by the package ``mujoco-menagerie`` (extra ``robots``), which fetches one on first use.

It keeps them in its cache; ``MENAGERIE_CACHE_DIR`` and ``MENAGERIE_ROOT`` are its environment variables.
"""

from __future__ import annotations

import importlib
from pathlib import Path

from mathnavi.interfaces.errors import FieldError

PREFIX = "menagerie:"


def menagerie_file(mechanism: str) -> Path:
    """MJCF file of ``menagerie:NAME``, the robot alone, or of ``menagerie:NAME/ENTRY``, another file of its folder.

    Raises FieldError without the package, for a name or an entry that it does not know, and where the robot can be
    neither found nor fetched.
    """
    name, _, entry = mechanism.removeprefix(PREFIX).partition("/")
    try:
        package = importlib.import_module("mujoco_menagerie")
    except ImportError:
        raise FieldError(
            f"mechanism = {mechanism!r}; allowed with the package mujoco-menagerie: pip install 'mathnavi[robots]'"
        ) from None
    try:
        robot = package.get(name)
        return Path(robot.xml(entry or robot.default_model))
    except (package.MenagerieError, OSError) as error:
        reason = " ".join(str(error).split())
        raise FieldError(
            f"mechanism = {mechanism!r}; allowed: {PREFIX}NAME of a robot of MuJoCo Menagerie that is in the cache or "
            f"can be fetched ({reason})"
        ) from None
