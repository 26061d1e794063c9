"""One made-up run, shared by all tests of pictures, and pictures that are drawn without another process."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from mathnavi.renders import clip, video
from mathnavi.renders.flight.run_data import FlightRun, load_run
from tests.renders.drawn import draw_here
from tests.renders.synthetic import ridges, write_synthetic_run

DRAWN_APART = video.draw


@pytest.fixture(scope="package", autouse=True)
def drawing_here() -> Iterator[None]:
    """Stills, videos and clips are drawn in this process; ``drawing_apart`` has them drawn as a user does."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(video, "draw", draw_here)
        patch.setattr(clip, "draw", draw_here)
        yield


@pytest.fixture
def drawing_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures are drawn by processes of their own."""
    monkeypatch.setattr(video, "draw", DRAWN_APART)


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
