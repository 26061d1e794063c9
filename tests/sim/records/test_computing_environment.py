"""The environment of a result distinguishes versions and processors, and nothing else."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version

import pytest

from mathnavi.sim.records.computing_environment import (
    difference,
    environment,
    environment_digest,
    in_environment,
    machine,
    versions,
)

PRINTED = "from mathnavi.sim.records.computing_environment import *; print(environment_digest(), machine()['blas'])"


def printed(**variables: str) -> str:
    """The environment's digest and BLAS in a process of its own."""
    command = [sys.executable, "-c", PRINTED]
    return subprocess.run(command, env={**os.environ, **variables}, text=True, capture_output=True, check=True).stdout


def test_versions_and_processor_are_named() -> None:
    assert versions()["numpy"] == version("numpy")
    assert {"python", "numpy", "scipy", "mujoco", "casadi", "numba", "dm-control"} <= versions().keys()
    assert {"system", "architecture", "instructions", "blas"} == machine().keys()
    assert environment() == {**versions(), **machine()}


def test_every_entry_counts() -> None:
    here = dict(environment())
    changed = [{**here, name: f"{value}?"} for name, value in here.items()]
    assert len({environment_digest(each) for each in (here, *changed)}) == len(here) + 1
    assert environment_digest() == environment_digest(dict(reversed(here.items())))
    assert len({in_environment("content", environment_digest(each)) for each in (here, *changed)}) == len(here) + 1


def test_the_difference_is_put_into_words(elsewhere: Callable[[str], None]) -> None:
    before = dict(environment())
    assert difference(before) == ""
    elsewhere("9.9")
    assert difference(before) == f"numpy {version('numpy')} (here 9.9)"
    assert difference({}) == "not recorded"


@pytest.mark.skipif("openblas" not in machine()["blas"], reason="NumPy has another BLAS")
def test_another_kernel_of_the_same_library_is_another_environment() -> None:
    core = "Nehalem" if not machine()["blas"].endswith("Nehalem") else "Sandybridge"
    assert printed() == f"{environment_digest()} {machine()['blas']}\n"
    other = printed(OPENBLAS_CORETYPE=core)
    assert other.endswith(f"{core}\n")
    assert not other.startswith(environment_digest())
