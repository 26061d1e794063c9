"""Computing environment of a result: versions, and the kind of processor as far as sums depend on it.

The same code with the same seed gives the same numbers, bit for bit, in the same environment. In another one a sum may
be rounded differently: NumPy and OpenBLAS choose their kernels by the processor, and libraries change from version to
version. So an environment is part of the key of a stored result, and every record names it.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("numpy", "scipy", "mujoco", "casadi", "numba", "llvmlite", "daqp", "dm-control", "filterpy")
"""packages that compute, without those that draw and print"""
UNKNOWN = ""
"""digest of the environment of a record that names none, because an earlier version wrote it"""
_CORE_NAMES = ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename", "openblas_get_corename")


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that results depend on, by name."""
    return {"python": platform.python_version(), **{name: version(name) for name in PACKAGES}}


def machine() -> dict[str, str]:
    """Return operating system, C library, architecture, and the kernels that NumPy and its BLAS chose for this
    processor.
    """
    import numpy as np  # as long to import as everything else here

    built = np.show_config(mode="dicts")
    assert built is not None  # numpy's stub allows for the other mode
    blas = built["Build Dependencies"]["blas"]
    instructions = built["SIMD Extensions"]
    return {
        "system": " ".join(filter(None, (platform.system(), *platform.libc_ver()))),
        "architecture": platform.machine(),
        "instructions": " ".join([*instructions.get("baseline", ()), *instructions.get("found", ())]),
        "blas": " ".join(filter(None, (blas.get("name"), blas.get("version"), _blas_core()))),
    }


@cache
def environment() -> Mapping[str, str]:
    """Return the environment of this process: ``versions`` and ``machine`` together."""
    return {**versions(), **machine()}


def environment_digest(described: Mapping[str, str] | None = None) -> str:
    """Return the digest of an environment; that of this process if not given."""
    return _digest(tuple(sorted((environment() if described is None else described).items())))


@cache
def _digest(items: tuple[tuple[str, str], ...]) -> str:
    return hashlib.sha256(json.dumps(items).encode()).hexdigest()[:16]


def in_environment(content: str, digest: str | None = None) -> str:
    """Return the key of a result: the hash of the computation and of the environment, that of this process if not
    given.
    """
    return hashlib.sha256(f"{content} {environment_digest() if digest is None else digest}".encode()).hexdigest()


def difference(other: Mapping[str, str]) -> str:
    """Return the difference of another environment from that of this process, "numpy 2.3.1 (here 2.4.0), ..."; "" if
    none.

    Without a description of the other one it is "not recorded".
    """
    if not other:
        return "not recorded"
    here = environment()
    return ", ".join(
        f"{name} {other.get(name, 'unknown')} (here {here.get(name, 'unknown')})"
        for name in dict.fromkeys([*here, *other])
        if other.get(name) != here.get(name)
    )


def _blas_core() -> str:
    """Return the name of the kernels that NumPy's own OpenBLAS has chosen, "SkylakeX"; "" for another BLAS."""
    spec = find_spec("numpy")
    assert spec is not None
    assert spec.origin is not None
    package = Path(spec.origin).parent
    for folder in (package.with_name("numpy.libs"), package / ".dylibs"):
        for path in sorted(folder.glob("*openblas*")):
            library = ctypes.CDLL(str(path))
            for name in _CORE_NAMES:
                if hasattr(library, name):
                    core = getattr(library, name)
                    core.restype = ctypes.c_char_p
                    return str(core().decode())
    return ""
