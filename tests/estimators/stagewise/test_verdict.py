"""A smoothed run is never sure and wrong where a sensor fails: what the filter leaves out is left out, and residuals
that contradict the run are said.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import pytest
from annotated_types import Le

import mathnavi as mn
from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.estimators.ranging.pose_filter import PoseFilterConfig, RangeEkf
from mathnavi.estimators.stagewise.flight import FlightModel
from mathnavi.estimators.stagewise.recorded_smoother import RecordedSmoother, SmootherConfig, Smoothing
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.models.unicycle.quality import KnownStart
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from mathnavi.studies.ranging.integrity import FIRST_SEED
from mathnavi.studies.ranging.pose_integrity import END, FAULTS, ONSET, PERIOD, _mission, _updates, driven
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


@pytest.mark.parametrize("fault", ["none", "a ray times 1.1", "odometry times 1.1", "ranges 50 ms late"])
def test_a_robot_is_never_sure_and_wrong_of_where_it_was(fault: str) -> None:
    """Without the verdict it is wrong for 29 to 48 % of the time by the last two."""
    rng = np.random.default_rng(FIRST_SEED + 1)
    drive = driven(rng)
    FAULTS[fault](drive, slice(round(ONSET / PERIOD), round(END / PERIOD)), rng)
    x, y, heading = drive.fine[0].tolist()
    mission = _mission(KnownStart((x, y, heading), (0.05, 0.05, 0.05)))
    smoother = Smoothing(RangeEkf, PoseFilterConfig()).build(SmootherConfig(), mission)
    updates = list(_updates(drive))
    smoother.smooth(updates)
    estimates = [smoother.update(t, (), u) for t, _, u in updates]
    difference = np.array([each.x for each in estimates]) - drive.truth
    difference[:, 2] = wrapped(difference[:, 2])
    ok = np.array([each.status is Status.OK for each in estimates])
    t, P = np.array([each[0] for each in updates]), np.array([each.covariance for each in estimates])
    assert not sure_and_wrong(t, ok, difference, P).any()
    assert ok.all() if fault == "none" else not ok.all()
    assert ok[t > 28.0].any() or fault == "odometry times 1.1"


@configuration
class Impatient:
    """Fields of a filter that is never patient."""

    timeout: Annotated[float, Le(1.0)] = 0.5


class Failing:
    """A filter of somebody else's whose update fails."""

    Config = Impatient
    period = PERIOD

    build = staticmethod(lambda config, mission: Failing())
    sensors = staticmethod(lambda config, mission: Kalman.sensors(CONFIG, mission))
    quality = staticmethod(lambda config, mission: Kalman.quality(CONFIG, mission))
    stagewise_model = staticmethod(lambda config, mission: FlightModel.from_config(CONFIG, mission))

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        raise RuntimeError("no such sensor")


def test_a_filter_that_fails_is_named() -> None:
    mission = FlightMission(
        HeightField(np.zeros((3, 3)), 3000.0), (0.0, 0.0, 100.0), (5000.0, 5000.0, 500.0), control_period=PERIOD
    )
    log = mn.SensorLog(PERIOD * np.arange(50), {"position": np.zeros((50, 3))}, np.zeros((50, 3)))
    with pytest.raises(ValueError, match=r"its filter failed over the log:.*no such sensor"):
        mn.estimate(mn.smoother(Failing), mission, log)
