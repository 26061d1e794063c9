"""A video shows the whole flight, forwards, in 15 to 25 seconds."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.signals import Event
from mathnavi.renders.flight.drawing import annotations_of, drawing, shot_list
from mathnavi.renders.flight.run_data import FlightRun


def with_log(run: FlightRun, **changes: Any) -> FlightRun:
    """The run with other records in its log."""
    return replace(run, log=replace(run.log, **changes))


@pytest.mark.parametrize("direction", ["tour", "chase", "overview", "top"])
def test_shots_follow_each_other_without_a_gap_over_the_whole_flight(direction: str, run: FlightRun) -> None:
    film = shot_list(run, direction)
    assert film[0].begin == 0.0
    assert film[-1].end == run.duration
    for before, after in pairwise(film):
        assert before.end == after.begin
        assert before.end >= before.begin
    assert 15.0 <= sum(shot.length for shot in film) <= 25.0


def test_tour_uses_every_camera_and_a_forced_camera_no_other(run: FlightRun) -> None:
    assert {frame.camera for frame in drawing.frames(run)} == {"chase", "overview", "top"}
    assert {frame.camera for frame in drawing.frames(run, "top")} == {"top"}


@pytest.mark.parametrize("fps", [1, 5, 24])
def test_frames_run_forwards_and_show_every_event_once(fps: int, run: FlightRun) -> None:
    frames = drawing.frames(run, fps=fps)
    times = np.array([frame.t for frame in frames])
    assert (np.diff(times) >= 0.0).all()
    assert times[-1] == run.duration
    texts = [frame.annotation for frame in frames]
    changes = [b for a, b in zip(["", *texts], texts, strict=False) if b and b != a]
    assert len(changes) == len(set(changes)) <= len(annotations_of(run))
    assert "arrived" in changes


def test_what_only_a_developer_cares_about_is_not_announced_and_jumps_are_announced_once(run: FlightRun) -> None:
    trivia = ("iteration-limit", "solver-failed", "low-clearance", "fallback-plan", "deadline", "late", "plan-rejected")
    kinds = [*trivia, "position-jump", "rebased", "tracking-breach"] * 20
    events = tuple(Event(0.1 * k, "vehicle", kind, "why") for k, kind in enumerate(kinds))
    texts = [text for _, text in annotations_of(with_log(run, events=events))]
    assert sorted(texts) == ["arrived", "position jump", "radar on", "tracking bound exceeded"]


@pytest.mark.parametrize("arrived", [True, False])
def test_the_last_second_says_whether_the_vehicle_arrived(arrived: bool, run: FlightRun) -> None:
    frames = drawing.frames(with_log(run, summary=dict(run.summary) | {"arrived": arrived}))
    assert {frame.annotation for frame in frames[-24:]} == {"arrived" if arrived else "did not arrive"}


def test_a_notice_lasts_two_seconds_at_most_and_ends_with_its_shot(run: FlightRun) -> None:
    events = tuple(Event(float(t), "vehicle", "ground-contact", "") for t in run.t[:: len(run.t) // 40])
    for shift in (0, 14, 35):
        noticed = with_log(run, events=events[shift:])
        film, frames = shot_list(noticed), drawing.frames(noticed)
        shot_of = np.repeat(np.arange(len(film)), [round(shot.length * 24) for shot in film])
        seen = [k for k, frame in enumerate(frames) if "ground contact" in frame.annotation]
        assert len(seen) <= 2 * 24
        assert len(set(shot_of[seen])) <= 1
        assert all(frames[k].t >= events[shift].t - 1e-6 for k in seen)


def test_the_way_around_a_radar_gets_more_than_a_third_of_the_tour(run: FlightRun) -> None:
    track = run.mission.radars[0]
    radar = track.radar
    passed = run.t[np.argmin(np.hypot(run.x[:, 0] - radar.x, run.x[:, 1] - radar.y))]
    frames = drawing.frames(run)
    assert sum(track.time <= frame.t <= passed for frame in frames) > len(frames) / 3


def test_unknown_camera_and_frame_rate_are_refused(run: FlightRun) -> None:
    with pytest.raises(ValueError, match="submarine"):
        drawing.frames(run, "submarine")
    with pytest.raises(ValueError, match="fps"):
        drawing.frames(run, fps=0)
