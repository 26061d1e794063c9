"""A video shows all of a run, in slow motion while the velocity is found, and shows what happened."""

from __future__ import annotations

from itertools import pairwise

import pytest

from mathnavi.renders.lagrangian.drawing import annotations_of, drawing, highlight, shot_list, verdict
from mathnavi.renders.lagrangian.run_data import LagrangianRun


@pytest.mark.parametrize("name", ["body", "tracking", "arm", "silent"])
@pytest.mark.parametrize("direction", ["tour", "scene"])
def test_shots_cover_the_run(name: str, direction: str, runs: dict[str, LagrangianRun]) -> None:
    run = runs[name]
    film = shot_list(run, direction)
    assert film[0].begin == 0.0
    assert all(a.end == b.begin for a, b in pairwise(film))
    assert film[-1].end == run.duration
    assert {shot.camera for shot in film} == {"panel" if direction == "tour" else "scene"}
    low, high = highlight(run)
    assert 0.0 <= low <= high <= run.duration


def test_what_is_wrong_at_first_is_seen_in_slow_motion(runs: dict[str, LagrangianRun]) -> None:
    slow, *_ = shot_list(runs["body"])
    assert slow.rate < 0.3
    assert slow.end < 0.5 * runs["body"].duration
    assert len(shot_list(runs["arm"])) == len(shot_list(runs["body"])) - 1


def test_an_unknown_camera_is_refused(runs: dict[str, LagrangianRun]) -> None:
    with pytest.raises(ValueError, match="camera = 'chase'; allowed: panel, scene"):
        drawing.frames(runs["body"], "chase")


def test_events_are_announced_to_the_viewer(runs: dict[str, LagrangianRun]) -> None:
    annotated = annotations_of(runs["body"])
    assert annotated == sorted(annotated)
    assert [text for _, text in annotated] == ["velocity found to one percent", verdict(runs["body"])]
    assert verdict(runs["body"]).startswith("velocity found: 0.0")
    assert verdict(runs["body"]).endswith("rad/s off")
    assert [text for _, text in annotations_of(runs["silent"])] == ["no usable reading yet", verdict(runs["silent"])]
    assert verdict(runs["silent"]).startswith("velocity not found")
    frames = drawing.frames(runs["body"], "tour", 10)
    assert verdict(runs["body"]) in frames[-1].annotation
