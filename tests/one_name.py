"""The folders that are imported as ``mathnavi.FOLDER``, and modules that are named as if they were packages alone."""

from __future__ import annotations

from collections.abc import Iterable

FOLDERS = ("controllers", "estimators", "interfaces", "models", "renders", "sim", "studies")


def bare(modules: Iterable[str]) -> list[str]:
    """Those of the modules whose names begin with a folder instead of mathnavi."""
    return sorted(name for name in modules if name.partition(".")[0] in FOLDERS)
