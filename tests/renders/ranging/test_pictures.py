"""Pictures of a robot that finds itself show it and where it is believed to be; stills and videos are written whole."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mathnavi.interfaces.signals import Array
from mathnavi.renders.film import Frame
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.ranging.drawing import CAMERAS, overlay
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.renders.video import write_still
from tests.renders.drawn import differing, drawn, needs_opengl, video_pictures


@pytest.fixture(scope="session")
def pictures(bank_dir: Path, observer_dir: Path, tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Array]:
    """Pictures with and without what they show."""
    return drawn("ranging", tmp_path_factory.mktemp("pictures"), bank_dir, observer_dir)


def changed(one: Array, other: Array, at: Array, radius: float) -> int:
    """How many pixels around a place (column, row, ...) differ between two pictures."""
    rows, columns = differing(one, other)
    return int(np.count_nonzero(np.hypot(columns - at[0], rows - at[1]) < radius))


def magenta(picture: Array, at: Array) -> float:
    """How much of the hypotheses' colour there is around a place."""
    column, row = round(float(at[0])), round(float(at[1]))
    patch = picture[row - 8 : row + 9, column - 8 : column + 9].astype(float)
    return float(np.mean(np.minimum(patch[..., 0], patch[..., 2]) - patch[..., 1]))


@needs_opengl
@pytest.mark.parametrize("camera", CAMERAS)
def test_robot_and_estimate_are_in_sight_where_they_should_be(camera: str, pictures: Mapping[str, Array]) -> None:
    shown = pictures[f"{camera}.with"]
    assert shown.std() > 15.0
    for what in ("robot", "estimate"):
        column, row, depth = pictures[f"{camera}.{what}"]
        assert depth > 0.0
        assert 0 < column < 480
        assert 0 < row < 270
    robot, estimate = (pictures[f"{camera}.{what}"] for what in ("robot", "estimate"))
    assert changed(shown, pictures[f"{camera}.without.estimate"], estimate, 14.0) > 120
    assert changed(pictures[f"{camera}.without.estimate"], pictures[f"{camera}.without.both"], robot, 14.0) > 60
    assert pictures[f"{camera}.labels"].tolist() == ["robot", "estimate"]


@needs_opengl
def test_hypotheses_fade_and_vanish(pictures: Mapping[str, Array]) -> None:
    strengths = np.array(
        [[magenta(pictures[f"hypotheses.{t}"], at) for at in pictures["hypotheses.at"]] for t in (0.2, 0.5, 1.9)]
    )
    assert (strengths[0] > 15.0).all()
    assert (strengths[1, :2] < strengths[0, :2]).all()
    assert (np.diff(strengths[0]) < 0.0).all()  # the faster one loses, the paler it is
    assert strengths[1, :2].min() > 5.0
    assert strengths[2, 0] > 5.0
    assert strengths[2, 1:].max() < 2.0  # dropped
    assert strengths[1, 2] > 2.0


@needs_opengl
def test_what_looks_the_same_to_the_robot_is_outlined(pictures: Mapping[str, Array]) -> None:
    column, row = (round(float(value)) for value in pictures["image.at"][:2])
    patch = pictures["hypotheses.1.9"][row - 14 : row + 15, column - 14 : column + 15].astype(float).mean(axis=-1)
    assert np.count_nonzero(patch < 200.0) > 20


@needs_opengl
def test_an_observer_shows_where_it_believes_that_rays_end(pictures: Mapping[str, Array]) -> None:
    assert pictures["observer.chase"].std() > 15.0
    for at in pictures["ends.at"]:
        assert changed(pictures["observer.ends"], pictures["observer.without.ends"], at, 8.0) >= 3


@needs_opengl
def test_a_still_is_not_blank(bank_dir: Path, tmp_path: Path) -> None:
    path = write_still(bank_dir, None, tmp_path / "top.png", width=320, height=180)
    picture = np.asarray(Image.open(path))
    assert picture.shape == (180, 320, 3)
    assert picture.astype(float).std() > 20.0


@needs_opengl
def test_a_video_is_of_the_right_length_and_moves(bank_dir: Path) -> None:
    count, pictures = video_pictures(bank_dir)
    assert 12 <= count <= 20
    assert all((a != b).any() for a, b in pairwise(pictures))


def test_the_caption_says_what_is_believed(
    bank_run: RangingRun, observer_run: RangingRun, silent_run: RangingRun
) -> None:
    def caption(run: RangingRun, t: float) -> tuple[str, str, str, str]:
        said = overlay(run, Frame(t, "top", 0.0, 0.0))
        (_, _, _), (_, place, note), (_, heading, _) = said.numbers
        return place, note, heading, said.state

    assert caption(bank_run, 0.02) == ("–", "", "–", "not knowing where it is")
    place, note, heading, state = caption(bank_run, 3.8)
    assert place.endswith("mm")
    assert note == "3σ 3.0 cm"
    assert heading == "0.0°"
    assert state == "1 hypothesis left"
    assert caption(bank_run, 0.5)[3] == "4 hypotheses left"
    assert caption(observer_run, 0.5)[1] == ""
    assert caption(observer_run, 0.5)[3] == "estimating"
    assert caption(silent_run, 0.5)[0] == "–"


def test_the_legend_names_what_there_is_to_see(bank_run: RangingRun, observer_run: RangingRun) -> None:
    bank, observer = (set(overlay(run, Frame(0.5, "top", 0.0, 0.0)).legend) for run in (bank_run, observer_run))
    assert bank - observer == {SceneElement.HYPOTHESIS, SceneElement.SPREAD}
    assert observer - bank == {SceneElement.BELIEVED}
    assert {
        SceneElement.DRIVEN,
        SceneElement.ESTIMATE,
        SceneElement.RAY,
        SceneElement.LOST_RAY,
        SceneElement.IMAGE,
    } <= bank & observer
