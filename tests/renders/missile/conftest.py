"""Two flights of the missile, shared by all tests of its pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from mathnavi.renders.missile.run_data import MissileRun, load_run
from tests.missile import fly


@pytest.fixture(scope="session")
def missile_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a dive in the pitch plane on a target that turns back."""
    folder = tmp_path_factory.mktemp("missile")
    fly(target_velocity=(15.0, 0.0, 0.0), target_change=((3.0, -15.0, 0.0, 0.0),)).write(folder)
    return folder


@pytest.fixture(scope="session")
def missile_run(missile_dir: Path) -> MissileRun:
    return load_run(missile_dir)


@pytest.fixture(scope="session")
def spatial_run(tmp_path_factory: pytest.TempPathFactory) -> MissileRun:
    folder = tmp_path_factory.mktemp("spatial")
    fly(dimension="spatial", start=(0.0, 40.0, 10.0), start_heading=-10.0).write(folder)
    return load_run(folder)
