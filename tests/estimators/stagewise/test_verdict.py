"""A smoothed run is never sure and wrong where a sensor fails: what the filter leaves out is left out, and residuals
that contradict the run are said.
"""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.estimators.stagewise.flight import FlightModel
from mathnavi.estimators.stagewise.recorded_smoother import RecordedSmoother, SmootherConfig, Smoothing
from mathnavi.interfaces.signals import Array, Status
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from tests.estimators.beacons.flights import FOUR, SIX, Flown, flight

CONFIG = KalmanConfig()
PLUGIN = Smoothing(Kalman, CONFIG)


def smoothed(run: Flown, smoother: RecordedSmoother) -> tuple[Array, Array, Array, float]:
    """Errors of the position (n, 3), where it is OK (n,), channels left out (n, l), and its time sure and wrong."""
    smoother.smooth(run.samples)
    estimates = [smoother.update(t, (), u) for t, _, u in run.samples]
    truth = np.array([each.x[:3] for each in run.estimates]) - run.error
    e = np.array([each.x[:3] for each in estimates]) - truth
    P = np.array([each.covariance for each in estimates])[:, :3, :3]
    ok = np.array([each.status is Status.OK for each in estimates])
    out = np.array([each.extra.get("left_out", np.zeros(0)) for each in estimates])
    return e, ok, out, float(sure_and_wrong(run.t, ok, e, P, (slice(0, 3),)).mean())


def test_as_declared_it_is_ok_and_nearer_than_the_filter() -> None:
    run = flight(SIX, 1)
    model = FlightModel.from_config(CONFIG, run.mission)
    for smoother in (
        PLUGIN.build(SmootherConfig(), run.mission),
        RecordedSmoother(SmootherConfig(), model, run.mission.control_period, 1.0),
    ):
        e, ok, out, wrong = smoothed(run, smoother)
        assert ok.all()
        assert not out.any()
        assert wrong == 0.0
        assert np.square(e).sum() < 0.8 * np.square(run.error).sum()


@pytest.mark.parametrize(
    ("places", "failing"), [(SIX, (1, 10.0)), (SIX, (0, None)), (FOUR, (1, None)), (FOUR, (2, 30.0))]
)
def test_what_the_filter_leaves_out_it_leaves_out_since_before_the_alarm(
    places: tuple[tuple[float, float, float], ...], failing: tuple[int, float | None]
) -> None:
    run = flight(places, 3, failing=failing)
    e, ok, out, wrong = smoothed(run, PLUGIN.build(SmootherConfig(), run.mission))
    assert wrong == 0.0
    assert out[run.t >= 15.0, failing[0]].all()
    assert not ok[run.t > 25.0].any()
    assert np.square(e).sum() < np.square(run.error).sum()


@pytest.mark.parametrize("failing", [(1, 10.0), (0, None), (2, 4.0)])
def test_without_the_filter_its_residuals_tell(failing: tuple[int, float | None]) -> None:
    run = flight(SIX, 3, failing=failing)
    model = FlightModel.from_config(CONFIG, run.mission)
    e, ok, _, wrong = smoothed(run, RecordedSmoother(SmootherConfig(), model, run.mission.control_period, 1.0))
    assert np.linalg.norm(e, axis=1).max() > 1.0, "the fault is not harmless"
    assert wrong == 0.0
    assert not ok[run.t > 16.0].any()
