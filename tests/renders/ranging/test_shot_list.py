"""The video of a robot that finds itself shows the whole run, slowly while it is decided, and shows what happens."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from mathnavi.interfaces.signals import Event
from mathnavi.renders.ranging.drawing import (
    AFTERWARDS,
    CAMERAS,
    LATEST,
    annotations_of,
    begun,
    decided,
    drawing,
    highlight,
    shot_list,
    verdict,
)
from mathnavi.renders.ranging.run_data import RangingRun
from tests.renders.ranging.believers import LOSS, LOWEST, SILENT


@pytest.mark.parametrize("direction", ["tour", *CAMERAS])
def test_shots_cover_the_whole_run_in_12_to_20_seconds(direction: str, bank_run: RangingRun) -> None:
    film = shot_list(bank_run, direction)
    assert film[0].begin == 0.0
    assert film[-1].end == bank_run.duration
    assert all(before.end == after.begin for before, after in pairwise(film))
    assert 12.0 <= sum(shot.length for shot in film) <= 20.0
    cameras = {frame.camera for frame in drawing.frames(bank_run, direction)}
    assert cameras == (set(CAMERAS) if direction == "tour" else {direction})


def test_it_is_slow_until_it_is_decided(bank_run: RangingRun) -> None:
    quick = replace(bank_run.beliefs, scores=np.where(bank_run.beliefs.t[:, None] < 0.4, 0.0, [0.0, *3 * [np.nan]]))
    run = replace(bank_run, beliefs=quick)
    assert decided(run) == pytest.approx(0.4)
    film = shot_list(run)
    assert film[0].end == pytest.approx(AFTERWARDS * 0.4)
    assert film[0].rate < 0.7 * min(shot.rate for shot in film[1:-1])


def test_it_is_decided_at_some_time_whatever_the_estimator_says(
    bank_run: RangingRun, observer_run: RangingRun, silent_run: RangingRun
) -> None:
    assert begun(bank_run) == pytest.approx(SILENT)
    assert decided(bank_run) == pytest.approx(LATEST * bank_run.duration)  # it takes longer than that
    assert decided(observer_run) == observer_run.found
    assert begun(silent_run) == decided(silent_run) == silent_run.duration
    for run in (bank_run, observer_run, silent_run):
        begin, end = highlight(run)
        assert 0.0 <= begin <= end <= run.duration
        assert shot_list(run)[-1].end == run.duration


def test_hypotheses_and_the_end_are_announced(bank_run: RangingRun, silent_run: RangingRun) -> None:
    annotated = {text: t for t, text in annotations_of(bank_run)}
    assert annotated["4 poses explain what it sees"] == pytest.approx(0.0)
    assert annotated["one is left, and its image"] == pytest.approx(LOWEST / -LOSS.min(), abs=0.02)
    assert annotated[verdict(bank_run)] == bank_run.duration
    assert verdict(bank_run).startswith("found itself: ")
    assert verdict(silent_run) == "did not find itself"
    assert [text for _, text in annotations_of(silent_run)] == ["did not find itself"]


def test_lost_sensors_and_restarts_are_announced(observer_run: RangingRun) -> None:
    names = ("initialising", "ok", "lost", "ok", "initialising", "ok")
    events = tuple(Event(0.1 * k, "robot", "estimator-status", f"{name}: why") for k, name in enumerate(names))
    run = replace(observer_run, log=replace(observer_run.log, events=events))
    annotated = [(round(t, 1), text) for t, text in annotations_of(run) if t < 0.45]
    assert annotated == [
        (0.2, "nothing to see: going by the wheels"),
        (0.3, "it sees again"),
        (0.4, "does not believe it: starts again"),
    ]


def test_unknown_cameras_are_refused(bank_run: RangingRun) -> None:
    with pytest.raises(ValueError, match=r"camera = 'side'; allowed: top, chase"):
        drawing.frames(bank_run, "side")
