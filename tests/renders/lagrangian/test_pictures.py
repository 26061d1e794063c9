"""Pictures of what moves show it and where it is believed to be; stills and videos are written whole."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.interfaces.signals import Array
from mathnavi.renders.film import Frame
from mathnavi.renders.lagrangian.drawing import drawing, overlay
from mathnavi.renders.lagrangian.panel import VelocityPanel
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.video import write_still
from tests.renders.drawn import differing, drawn, needs_opengl, video_pictures

POINTS = ("sphere", "hyperbolic-plane")


@pytest.fixture(scope="session")
def pictures(folders: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Array]:
    """Pictures with and without what they show."""
    named = [folders[name] for name in ("body", "arm", "tracking")]
    return drawn("mechanisms", tmp_path_factory.mktemp("pictures"), *named)


def changed(one: Array, other: Array, at: Array, radius: float) -> int:
    """How many pixels near places (m, 3) differ between two pictures."""
    rows, columns = differing(one, other)
    distance = np.hypot(columns[:, None] - at[:, 0], rows[:, None] - at[:, 1])
    return int(np.count_nonzero(distance.min(axis=1) < radius))


@needs_opengl
@pytest.mark.parametrize("name", ["body", "arm", "tracking"])
def test_what_moves_and_its_ghost_are_in_sight_where_they_should_be(name: str, pictures: Mapping[str, Array]) -> None:
    shown = pictures[f"{name}.with"]
    assert shown.std() > 15.0
    truth, estimate = pictures[f"{name}.truth"], pictures[f"{name}.estimate"]
    for places in (truth, estimate, pictures.get(f"{name}.reference", truth)):
        column, row, depth = places.T
        assert (depth > 0.0).all()
        assert ((column > 0.0) & (column < 480.0) & (row > 0.0) & (row < 270.0)).all()
    assert changed(shown, pictures[f"{name}.without.estimate"], estimate, 12.0) > 150
    assert changed(pictures[f"{name}.without.estimate"], pictures[f"{name}.without.both"], truth, 12.0) > 150


@needs_opengl
def test_only_what_has_a_reference_shows_it(pictures: Mapping[str, Array]) -> None:
    assert {name.partition(".")[0] for name in pictures if name.endswith(".reference")} == {"tracking"}
    shown, without = pictures["tracking.with"], pictures["tracking.without.reference"]
    assert changed(shown, without, pictures["tracking.reference"], 12.0) > 100


@pytest.mark.parametrize("name", POINTS)
def test_a_point_is_drawn_without_opengl(name: str, runs: dict[str, LagrangianRun]) -> None:
    with drawing.painter(runs[name], 640, 360, 0) as artist:
        early, late, again = (artist.paint(Frame(t, "scene", 0.0, 1.0)) for t in (0.05, 1.0, 0.05))
    assert early.shape == (360, 640, 3)
    assert early.std() > 10.0
    np.testing.assert_array_equal(early, again)
    coloured = [(np.ptp(picture.astype(int), axis=2) > 90).sum() for picture in (early, late)]
    assert coloured[0] < coloured[1]


@pytest.mark.parametrize("name", POINTS)
def test_the_geodesic_to_an_estimate_that_is_off_is_drawn(name: str, runs: dict[str, LagrangianRun]) -> None:
    def magenta(t: float) -> int:
        with drawing.painter(runs[name], 640, 360, 0) as artist:
            picture = artist.paint(Frame(t, "scene", 0.0, 1.0)).astype(int)
        return int(((picture[..., 0] - picture[..., 1] > 80) & (picture[..., 2] - picture[..., 1] > 80)).sum())

    worst = float(runs[name].t_estimate[np.argmax(runs[name].errors.position)])
    assert magenta(worst) > 10 + magenta(1.2)


@pytest.mark.parametrize("name", ["body", "arm", "silent", "sphere"])
def test_curves_of_the_panel_grow_with_time(name: str, runs: dict[str, LagrangianRun]) -> None:
    panel = VelocityPanel(runs[name], 360, 540)
    early, late = (panel.picture(t) for t in (0.1, 1.2))
    assert early.shape == (540, 360, 3)
    dark = [(picture.max(axis=2) < 120).sum() for picture in (early, late)]
    assert dark[0] < dark[1]


@needs_opengl
def test_a_still_is_not_blank(folders: dict[str, Path], tmp_path: Path) -> None:
    path = write_still(folders["cart"], None, tmp_path / "panel.png", width=480, height=270)
    picture = np.asarray(Image.open(path)).astype(float)
    assert picture.shape == (270, 480, 3)
    assert picture[:, :300].std() > 20.0
    assert picture[:, 300:].std() > 10.0


@needs_opengl
def test_a_video_is_of_the_right_length_and_shows_something(folders: dict[str, Path]) -> None:
    count, _ = video_pictures(folders["hyperbolic-plane"])
    assert 8 <= count <= 20


def test_the_caption_says_what_is_known(runs: dict[str, LagrangianRun]) -> None:
    def caption(name: str, t: float) -> tuple[str, str, str]:
        said = overlay(runs[name], Frame(t, "panel", 0.0, 0.0))
        return said.numbers[1][0], said.numbers[1][1], said.state

    assert caption("body", 0.0)[0] == "VELOCITY OFF BY [rad/s]"
    assert caption("body", 0.04)[2] == "finding the velocity"
    assert caption("body", 1.2)[2] == "velocity known"
    assert caption("sphere", 0.0)[0] == "VELOCITY OFF BY [1/s]"
    assert caption("cart", 0.0)[0] == "VELOCITY OFF BY [m/s, rad/s]"
    assert caption("silent", 1.0)[1:] == ("–", "waiting for a reading")


def test_the_legend_names_what_there_is_to_see(runs: dict[str, LagrangianRun]) -> None:
    legends = {name: set(overlay(run, Frame(0.5, "panel", 0.0, 0.0)).legend) for name, run in runs.items()}
    assert legends["sphere"] == {SceneElement.TRUE_PATH, SceneElement.ESTIMATE, SceneElement.GEODESIC}
    assert legends["tracking"] - legends["body"] == {SceneElement.REFERENCE}
    assert legends["body"] - legends["arm"] == {SceneElement.GEODESIC}
    alone = overlay(runs["body"], Frame(0.5, "scene", 0.0, 0.0)).legend
    assert legends["body"] - set(alone) == {SceneElement.GEODESIC}  # the globe is in the panel
