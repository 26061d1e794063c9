"""The modules of docs/_ext, which are no package: the documentation's build puts their folder on its path."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "_ext"


def load(name: str) -> ModuleType:
    """Return a module of docs/_ext; the modules that it imports have to be loaded before it."""
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # where its dataclasses look
        spec.loader.exec_module(module)
    assert str(sys.modules[name].__file__) == str(FOLDER / f"{name}.py")
    return sys.modules[name]
