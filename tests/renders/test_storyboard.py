"""A video shows the whole flight, forwards, in 15 to 25 seconds."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from renders.run_data import RunData
from renders.storyboard import Direction, notices, shots, storyboard
from sim.signals import Event


@pytest.mark.parametrize("direction", ["tour", "chase", "overview", "top"])
def test_shots_follow_each_other_without_a_gap_over_the_whole_flight(direction: Direction, run: RunData) -> None:
    film = shots(run, direction)
    assert film[0].begin == 0.0
    assert film[-1].end == run.duration
    for before, after in pairwise(film):
        assert before.end == after.begin
        assert before.end >= before.begin
    assert 15.0 <= sum(shot.length for shot in film) <= 25.0


def test_tour_uses_every_camera_and_a_forced_camera_no_other(run: RunData) -> None:
    assert {frame.camera for frame in storyboard(run)} == {"chase", "overview", "top"}
    assert {frame.camera for frame in storyboard(run, "top")} == {"top"}


@pytest.mark.parametrize("fps", [1, 5, 24])
def test_frames_run_forwards_and_show_every_event_once(fps: int, run: RunData) -> None:
    frames = storyboard(run, fps=fps)
    times = np.array([frame.t for frame in frames])
    assert (np.diff(times) >= 0.0).all()
    assert times[-1] == run.duration
    texts = [frame.notice for frame in frames]
    changes = [b for a, b in zip(["", *texts], texts, strict=False) if b and b != a]
    assert len(changes) == len(set(changes)) <= len(notices(run))
    assert "arrived" in changes


def test_a_kind_of_event_that_happens_all_the_time_is_told_once(run: RunData) -> None:
    jumps = tuple(Event(0.1 * k, "vehicle", "position-jump", f"by {k} m") for k in range(40))
    told = [text for _, text in notices(replace(run, events=run.events + jumps))]
    assert [text for text in told if "jump" in text] == ["position jump, 40 times in this flight"]
    assert {text for _, text in notices(run)} <= set(told)


def test_unknown_camera_and_frame_rate_are_refused(run: RunData) -> None:
    with pytest.raises(ValueError, match="submarine"):
        storyboard(run, "submarine")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="fps"):
        storyboard(run, fps=0)
