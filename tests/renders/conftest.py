"""One made-up run, shared by all tests of pictures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from mathnavi.renders.flight.run_data import FlightRun, load_run
from tests.renders.synthetic import ridges, write_synthetic_run


@pytest.fixture(scope="session")
def run_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a flight over ridges; its terrain lies beside it as a file."""
    folder = tmp_path_factory.mktemp("renders")
    terrain = ridges()
    meta = json.dumps({"spacing_m": terrain.spacing, "name": terrain.name, "source": terrain.source})
    np.savez(folder / "ridges.npz", z=terrain.z.astype(np.float32), meta=meta)
    from mathnavi.models.terrain.library import load_terrain

    return write_synthetic_run(folder / "run", load_terrain(folder / "ridges.npz"), str(folder / "ridges.npz"))


@pytest.fixture(scope="session")
def run(run_dir: Path) -> FlightRun:
    return load_run(run_dir)
