"""One small fleet's run, shared by all tests of its pictures."""

from __future__ import annotations

from pathlib import Path

import pytest

from mathnavi.renders.fleet.run_data import FleetRun, load_run
from mathnavi.sim.scenarios.fleet_fields import SimultaneousArrivalConfig
from mathnavi.sim.scenarios.simultaneous_arrival import SimultaneousArrival
from tests import flight


@pytest.fixture(scope="session")
def fleet_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of three vehicles' run over a small map, which lies beside it as a file."""
    folder = tmp_path_factory.mktemp("fleet")
    terrain = flight.save(flight.mountains(), folder / "mountains.npz")
    config = SimultaneousArrivalConfig(terrain=terrain, vehicles=3, slot_spacing=800.0, separation=150.0)
    SimultaneousArrival.build(config, 0).run().write(folder / "run")
    return folder / "run"


@pytest.fixture(scope="session")
def fleet_run(fleet_dir: Path) -> FleetRun:
    return load_run(fleet_dir)
