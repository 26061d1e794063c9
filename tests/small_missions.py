"""A small map and a short mission over it, for what is tested through the command line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mathnavi.models.terrain.dem import write_npz
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.plugin import code_version as code
from mathnavi.sim.records import computing_environment


@pytest.fixture(scope="session")
def hills(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """12 km of gentle hills between 300 and 700 m."""
    x, y = np.meshgrid(np.arange(121) * 100.0, np.arange(121) * 100.0)
    path = tmp_path_factory.mktemp("map") / "hills.npz"
    write_npz(HeightField(500.0 + 200.0 * np.sin(x / 1500.0) * np.cos(y / 1700.0), 100.0, "hills"), path)
    return path


@pytest.fixture(scope="session")
def mission(hills: Path) -> tuple[str, ...]:
    """A mission of 4 km that is flown in about a second."""
    ends = ["--start", "3000", "3000", "800", "--target", "7000", "3000", "800"]
    return ("safe-flight", "--terrain", str(hills), *ends)


_read_anew: Callable[[str], str] = code._stranger.__wrapped__


@pytest.fixture(scope="module", autouse=True)
def sources_as_they_are() -> Callable[[str], str]:
    """Tests may run while somebody writes: what a module sweeps is of the sources as they are when it begins.

    Reading all of them takes as long as a small test, so not every test does. Returned are the sources of plug-ins that
    stand in the tests.
    """
    code._own.cache_clear()
    return cache(_read_anew)


@pytest.fixture(autouse=True)
def strangers_as_they_are(monkeypatch: pytest.MonkeyPatch, sources_as_they_are: Callable[[str], str]) -> None:
    """Tests write packages, some of one name: each is read anew."""
    read = cache(lambda name: (sources_as_they_are if name == "tests" else _read_anew)(name))
    monkeypatch.setattr(code, "_stranger", read)


@pytest.fixture
def elsewhere(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """A function after which this process computes with another version of NumPy, as it seems."""
    here = computing_environment.versions()

    def move(version: str) -> None:
        monkeypatch.setattr(computing_environment, "versions", lambda: {**here, "numpy": version})
        computing_environment.environment.cache_clear()

    yield move
    computing_environment.environment.cache_clear()
