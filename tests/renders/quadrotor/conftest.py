"""One short flight of a quadrotor, shared by all tests of its pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from mathnavi.renders.quadrotor.run_data import QuadrotorRun, load_run
from mathnavi.sim.scenarios.quadrotor_canyon import QuadrotorCanyon
from mathnavi.sim.scenarios.quadrotor_fields import QuadrotorCanyonConfig

START, TARGET = (300.0, 275.0, 1232.0), (246.0, 288.0, 1246.0)  # onto a spur of canyon 0


@pytest.fixture(scope="session")
def quadrotor_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("quadrotor") / "run"
    QuadrotorCanyon.build(QuadrotorCanyonConfig(start=START, target=TARGET), 0).run().write(folder)
    return folder


@pytest.fixture(scope="session")
def quadrotor_run(quadrotor_dir: Path) -> QuadrotorRun:
    return load_run(quadrotor_dir)
