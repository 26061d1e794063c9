"""Pictures, videos and reports of textbook systems."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.film import Frame
from mathnavi.renders.report import write_report
from mathnavi.renders.textbook.drawing import annotations_of, drawing
from mathnavi.renders.textbook.panel import shown
from mathnavi.renders.textbook.run_data import TextbookRun, load_run
from mathnavi.renders.video import write_still
from mathnavi.sim.scenarios.textbook import TextbookConfig, TextbookObserver
from tests.renders.drawn import needs_opengl

SYSTEMS = ("example-2-1", "camera-and-flags", "kazantzis-kravaris")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A run of some systems that are drawn differently: one escapes, one has a plane, one no inputs."""
    folder = tmp_path_factory.mktemp("textbook")
    for name in SYSTEMS:
        TextbookObserver.build(TextbookConfig(name, duration=2.0), 0).run().write(folder / name)  # type: ignore[arg-type]
    return {name: folder / name for name in SYSTEMS}


def pixels(run: TextbookRun, t: float, annotation: str = "") -> np.ndarray:
    with drawing.painter(run, 640, 360, 0) as artist:
        return artist.paint(Frame(t, "board", 0.0, 1.0, annotation)).astype(int)


@pytest.mark.usefixtures("laid_out")
@pytest.mark.parametrize("name", SYSTEMS)
def test_a_run_is_drawn_by_its_own_drawing(name: str, runs: dict[str, Path], tmp_path: Path) -> None:
    assert drawing_of(runs[name]).cameras == ("board",)
    write_report(runs[name])
    page = (runs[name] / "report.html").read_text(encoding="utf-8")
    assert "Truth and estimate" in page
    assert ("the solution escaped" in page) == (name == "example-2-1")


@needs_opengl
def test_a_still_is_a_picture(runs: dict[str, Path], tmp_path: Path) -> None:
    path = write_still(runs["camera-and-flags"], path=tmp_path / "still.png", width=640, height=360)
    with Image.open(path) as picture:
        assert picture.size == (640, 360)
        assert np.asarray(picture.convert("L")).std() > 10.0
    with pytest.raises(ValueError, match="camera = 'chase'; allowed: board"):
        write_still(runs["camera-and-flags"], "chase")


def test_curves_grow_with_time(runs: dict[str, Path]) -> None:
    run = load_run(runs["camera-and-flags"])
    coloured = [(np.ptp(pixels(run, t), axis=2) > 60).sum() for t in (0.1, 1.0, 2.0)]
    assert coloured[0] < coloured[1] < coloured[2]


def test_a_painter_draws_each_frame_by_itself(runs: dict[str, Path]) -> None:
    run = load_run(runs["camera-and-flags"])
    with drawing.painter(run, 320, 180, 0) as artist:
        early, late, again = (artist.paint(Frame(t, "board", 0.0, 1.0)) for t in (0.3, 2.0, 0.3))
    np.testing.assert_array_equal(early, again)
    assert (early != late).any()


def test_a_notice_is_in_the_picture(runs: dict[str, Path]) -> None:
    run = load_run(runs["kazantzis-kravaris"])
    assert (pixels(run, 1.0) != pixels(run, 1.0, "something happened")).any()


def test_a_video_shows_all_of_the_run_and_tells_of_its_end(runs: dict[str, Path]) -> None:
    run = load_run(runs["example-2-1"])
    frames = drawing.frames(run, "tour", 10)
    assert frames[0].t == 0.0
    assert frames[-1].t == pytest.approx(run.duration)
    assert annotations_of(run)[0][1] == "the solution escapes"
    assert any("the solution escapes" in frame.annotation for frame in frames)
    with pytest.raises(ValueError, match="allowed: board"):
        drawing.frames(run, "side")


def test_a_broken_run_is_refused(runs: dict[str, Path], tmp_path: Path) -> None:
    for file in runs["kazantzis-kravaris"].iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    config = json.loads((tmp_path / "config.json").read_text())
    (tmp_path / "config.json").write_text(json.dumps({**config, "mission": {"states": ["x_1"]}}))
    with pytest.raises(ValueError, match="does not hold the run of a textbook system"):
        load_run(tmp_path)


def test_names_are_written_as_in_the_thesis() -> None:
    assert [shown(name) for name in ("x_1 [-]", "phi [rad]", "d_0 [m]")] == ["$x_1$", r"$\phi$ [rad]", "$d_0$ [m]"]
