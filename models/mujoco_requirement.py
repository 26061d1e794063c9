"""MuJoCo, checked where it is first imported: a processor that can run it, and a version that computes rightly."""

from __future__ import annotations

import importlib
import os
import re
import sys
from typing import Any

# 4.0.0: sixty random trees of 10 to 39 hinges with 2 to 11 connections between bodies, 100 iterations at most. Sparse
# and dense Jacobian give accelerations that differ by up to 3 %, after 100 iterations and 2; in 3.17.0 by 1.4e-13. Its
# authors name the fault in the notes of 4.0.1, which repairs it: rows of different descendants share a supernode.
REFUSED = {"4.0.0": "its Newton solver factorises sparse Hessians wrongly"}
"""versions of MuJoCo that compute wrongly, with the fault"""
PROCESSORS = "/proc/cpuinfo"
FIRST_PROCESSOR = 8192  # bytes, and Linux makes no more than it is asked for


class UnusableMujocoError(ImportError):
    """MuJoCo cannot be used here; the message has the fault, and what is allowed."""


def usable_mujoco() -> Any:
    """Import MuJoCo and return it.

    Raises UnusableMujocoError if it cannot be imported, if this version computes wrongly, or if the processor lacks
    what MuJoCo's library is compiled for, which would end the process by a signal.
    """
    if "mujoco" not in sys.modules:
        require_processor()
    try:
        mujoco: Any = importlib.import_module("mujoco")
    except ImportError as error:
        require_version(_installed())  # 4.0.0 alone, without its parts, does not get as far as to say what it is
        reason = " ".join(str(error).split())
        raise UnusableMujocoError(f"MuJoCo cannot be imported: {reason}; allowed: {_allowed()}") from error
    require_version(mujoco.__version__)
    return mujoco


def require_processor() -> None:
    """Raise UnusableMujocoError if this is an x86-64 processor without AVX; other systems than Linux are not asked."""
    try:
        descriptor = os.open(PROCESSORS, os.O_RDONLY)
    except OSError:
        return
    try:
        listed = os.read(descriptor, FIRST_PROCESSOR)
    finally:
        os.close(descriptor)
    flags = re.search(rb"^flags\s*:(.*)$", listed, re.MULTILINE)  # no such line on ARM
    if flags is not None and b"avx" not in flags[1].split():
        raise UnusableMujocoError(
            "this processor has no AVX, without which MuJoCo's library cannot run (flags in "
            f"{PROCESSORS}); allowed: x86-64 with AVX. A virtual machine may hide it: give it its host's processor"
        )


def require_version(version: str) -> None:
    """Raise UnusableMujocoError if a version of MuJoCo computes wrongly."""
    if version in REFUSED:
        raise UnusableMujocoError(f"MuJoCo {version} is installed: {REFUSED[version]}; allowed: {_allowed()}")


def _installed() -> str:
    """Return the version of MuJoCo that is installed, empty if absent."""
    from importlib.metadata import PackageNotFoundError, version  # takes as long to import as the command line

    try:
        return version("mujoco")
    except PackageNotFoundError:
        return ""


def _allowed() -> str:
    """Return the requirement that mathnavi has for MuJoCo."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        listed = requires("mathnavi") or []
    except PackageNotFoundError:  # mathnavi runs from its sources
        listed = []
    return next((each for each in listed if re.match(r"mujoco(?![\w.-])", each)), "the versions in pyproject.toml")
