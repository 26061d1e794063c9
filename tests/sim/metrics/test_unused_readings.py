"""Readings that the estimators of a run did not use are figures of its summary, and what one of them waits for."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.interfaces.reading_counts import COUNTS, ReadingCounts, Unused
from mathnavi.interfaces.signals import Estimate, Status
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.metrics.unused_readings import unused_figures
from mathnavi.sim.sweep.trial import trial


def recording(*last: Estimate, carried: tuple[str, ...] = ()) -> Recording:
    names = [f"v{k}" for k in range(len(last))]
    agents = {
        name: AgentRecorder(name, [], np.zeros((1, 1)), {each: np.zeros((1, 1)) for each in carried}, [estimate])
        for name, estimate in zip(names, last, strict=True)
    }
    return Recording(np.zeros(1), {}, agents, [], {})


def counted(**counts: int) -> Estimate:
    unused = ReadingCounts()
    for name, count in counts.items():
        unused.add(Unused[name], count)
    return Estimate(0.0, np.zeros(1), extra=unused.extra)


def test_the_figures_are_those_of_all_vehicles_and_there_are_none_of_estimators_that_do_not_count() -> None:
    figures = unused_figures(recording(counted(OUTLIER=2, LATE=1), counted(OUTLIER=1), Estimate(0.0, np.zeros(1))), {})
    assert figures == {"unused_readings": 4, "unused_reasons": "3 outlier, 1 late"}
    assert unused_figures(recording(counted()), {}) == {"unused_readings": 0}
    assert unused_figures(recording(Estimate(0.0, np.zeros(1))), {}) == {}


def test_a_sensor_that_a_vehicle_carries_for_others_is_not_one_that_its_estimator_should_know() -> None:
    one, asked = counted(UNKNOWN_SENSOR=5), {"v0": ("fix",)}
    assert unused_figures(recording(one, carried=("fix", "camera")), asked) == {"unused_readings": 0}
    assert unused_figures(recording(one, carried=("fix",)), asked)["unused_reasons"] == "5 unknown sensor"


def test_what_an_estimator_waits_for_in_the_end_is_a_figure_and_a_detail_of_its_event() -> None:
    waiting = Estimate(0.0, np.zeros(1), status=Status.INITIALISING, message="waits for a fix")
    assert unused_figures(recording(waiting), {}) == {"waits_for": "waits for a fix"}
    recorder = AgentRecorder("v", [], np.zeros((1, 1)), {})
    recorder.estimate(waiting)
    assert recorder.events[0].message == f"initialising: {Status.INITIALISING.value}; it waits for a fix"


def test_a_run_says_how_many_rays_were_outliers() -> None:
    fields = {"duration": 1.0, "noise.outliers": 0.2}
    run = trial("range-localisation", 1, estimator="range_iekf", fields=fields).flown()
    assert run.summary["unused_readings"] > 10
    assert "outlier" in run.summary["unused_reasons"]
    total = run[f"estimate.{COUNTS}"][-1].sum()
    assert run.summary["unused_readings"] == pytest.approx(total)
