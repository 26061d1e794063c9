"""The video of a dive shows the whole flight, slows down at its end, and shows what happens."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from mathnavi.interfaces.signals import Event
from mathnavi.renders.missile.drawing import CAMERAS, annotations_of, closing, drawing, shot_list, verdict
from mathnavi.renders.missile.run_data import MissileRun


@pytest.mark.parametrize("direction", ["tour", *CAMERAS])
def test_shots_cover_the_whole_flight_in_12_to_20_seconds(direction: str, missile_run: MissileRun) -> None:
    film = shot_list(missile_run, direction)
    assert film[0].begin == 0.0
    assert film[-1].end == missile_run.duration
    assert all(before.end == after.begin for before, after in pairwise(film))
    assert 12.0 <= sum(shot.length for shot in film) <= 20.0
    cameras = {frame.camera for frame in drawing.frames(missile_run, direction)}
    assert cameras == (set(CAMERAS) if direction == "tour" else {direction})


def test_the_end_is_slow_motion(missile_run: MissileRun) -> None:
    film = shot_list(missile_run)
    assert film[-2].begin == closing(missile_run)
    assert film[-2].rate < 0.35
    assert film[-2].rate < 0.5 * min(shot.rate for shot in film[:-2])


def test_turns_of_the_target_limits_and_the_end_are_announced(missile_run: MissileRun) -> None:
    texts = [text for _, text in annotations_of(missile_run)]
    assert texts == ["the target changes its course", verdict(missile_run)]
    assert verdict(missile_run).startswith("hit, ")
    clipped = (Event(1.0, "missile", "input-clipped"), Event(2.0, "missile", "input-clipped"))
    late = Event(3.5, "missile", "message", "target from target watch")
    log = replace(missile_run.log, events=(*clipped, late))
    texts = [text for _, text in annotations_of(replace(missile_run, log=log))]
    assert texts[:3] == ["thrusters at their limit", "the target changes its course", "the planner is updated"]
    assert verdict(replace(missile_run, miss_allowed=1e-9)).startswith("missed by ")


def test_unknown_cameras_are_refused(missile_run: MissileRun) -> None:
    with pytest.raises(ValueError, match=r"camera = 'overview'; allowed: chase, side, target"):
        drawing.frames(missile_run, "overview")
