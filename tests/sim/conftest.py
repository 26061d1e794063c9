"""A small map and a short mission over it, for what is tested through the command line."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
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


@pytest.fixture(autouse=True)
def sources_as_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests may run while somebody writes: a sweep that begins now is of the sources as they are now.

    They are read again where the time or the size of one has changed.
    """
    monkeypatch.setattr(code, "_own", cache(lambda: _own_version(_times())))
    code._stranger.cache_clear()


_own = code._own.__wrapped__


@cache
def _own_version(times: tuple[tuple[str, int, int], ...]) -> str:
    return _own()


def _times() -> tuple[tuple[str, int, int], ...]:
    """Path, time of the last change [ns] and size [bytes] of every file that the version of the code is made of."""
    folders = [folder for name in code.FOLDERS for folder in import_module(f"{code.PACKAGE}.{name}").__path__]
    return tuple(sorted(entry for folder in folders for entry in _below(folder)))


def _below(folder: str) -> Iterator[tuple[str, int, int]]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(".") or entry.name == "__pycache__":
                continue
            if entry.is_dir():
                yield from _below(entry.path)
            else:
                yield entry.path, entry.stat().st_mtime_ns, entry.stat().st_size


@pytest.fixture
def elsewhere(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """A function after which this process computes with another version of NumPy, as it seems."""
    here = computing_environment.versions()

    def move(version: str) -> None:
        monkeypatch.setattr(computing_environment, "versions", lambda: {**here, "numpy": version})
        computing_environment.environment.cache_clear()

    yield move
    computing_environment.environment.cache_clear()
