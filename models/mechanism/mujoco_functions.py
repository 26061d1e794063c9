"""MuJoCo's functions, called from compiled code: in a tenth of a microsecond where its Python bindings take three.

They are the functions of the library that the bindings load, on the memory of the same ``mujoco.MjModel`` and
``mujoco.MjData``; an argument that is a pointer in C is an address here.
"""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import mujoco
from numba import types
from numba.core.types import ExternalFunction

ADDRESS, INTEGER, NUMBER = types.intp, types.intc, types.float64


def _library() -> ctypes.CDLL:
    folder = Path(mujoco.__file__).parent
    found = [file for kind in ("libmujoco*.so*", "libmujoco*.dylib", "mujoco.dll") for file in folder.glob(kind)]
    if len(found) != 1:
        raise ImportError(f"MuJoCo's library in {folder}: {[file.name for file in found]}; allowed: exactly one")
    return ctypes.CDLL(str(found[0]), ctypes.RTLD_GLOBAL)  # global: that is where compiled code looks for names


_LIBRARY = _library()


def function(name: str, *arguments: Any) -> Any:
    """MuJoCo's function of that name, which returns nothing, for compiled code; ImportError if it does not exist."""
    if not hasattr(_LIBRARY, name):
        raise ImportError(f"MuJoCo {mujoco.__version__} has no function {name}; allowed: a version that has")
    return ExternalFunction(name, types.void(*arguments))
