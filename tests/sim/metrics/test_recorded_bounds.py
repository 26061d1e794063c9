"""The bound of recorded runs: it exists where it should, and why it does not is said where it should not."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array, Estimate
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.manifold.systems import RigidBody
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.models.missile.coordinates import PLANAR
from mathnavi.models.missile.mission import CASES, GustStrength, MissileMission, StateNoise, Target
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.metrics.flight import flight_bound
from mathnavi.sim.metrics.lagrangian import lagrangian_bound
from mathnavi.sim.metrics.missile import missile_bound
from mathnavi.sim.metrics.posterior_bound import PosteriorBound, estimates_at
from mathnavi.sim.metrics.ranging import ranging_bound
from tests.unicycle import STANDARD

NOISY = RangeQuality(0.02, 0.01)


def recording(truth: Array, readings: dict[str, Array], inputs: int, period: float) -> Recording:
    """A run with these true states (n, nx) and readings, and inputs of zero."""
    n = len(truth)
    agent = AgentRecorder("it", [], np.zeros((n, inputs)), readings)
    return Recording(np.arange(n) * period, {"it": truth}, {"it": agent}, [], {"it": ()}, n)


def ranging(mission: RangingMission, n: int = 60, read: bool = True) -> PosteriorBound:
    """A robot that drives a bow."""
    pose, truth = np.array([0.6, -0.3, 0.8]), []
    for _ in range(n):
        truth.append(pose)
        pose = mission.flow(pose, np.array([0.5, 0.7]), mission.period)
    ranges = np.full((n, mission.sensors), 1.0 if read else np.nan)
    return ranging_bound(recording(np.array(truth), {"ranges": ranges}, 2, mission.period), "it", mission)


FOUR = RangingMission(STANDARD, (0.0, 1.5, 3.0, 4.5), NOISY, OdometryQuality((0.05, 0.05), 0.02))


def test_the_newest_estimate_is_taken_and_one_of_another_size_is_none() -> None:
    run = recording(np.zeros((5, 2)), {}, 1, 1.0)
    run.agents["it"].estimates += [Estimate(t, np.array([t, -t])) for t in (1.0, 2.0, 3.5)]
    expected = [[math.nan] * 2, [1.0, -1.0], [2.0, -2.0], [2.0, -2.0], [3.5, -3.5]]
    np.testing.assert_array_equal(estimates_at(run, "it", 2), expected)
    for size in (1, 3, 4, 6):
        assert np.isnan(estimates_at(run, "it", size)).all()


def test_ranges_bound_a_start_of_which_nothing_is_known() -> None:
    found = ranging(FOUR)
    assert found.reason == ""
    assert np.isfinite(found.deviation[5:]).all()
    assert (found.deviation[-1] < found.deviation[5]).all()


def test_a_known_start_can_only_help_and_one_more_sensor_too() -> None:
    known = dataclasses.replace(FOUR, start=KnownStart((0.6, -0.3, 0.8), (0.05, 0.05, 0.05)))
    fewer = dataclasses.replace(FOUR, angles=FOUR.angles[:3])
    assert (ranging(known).deviation[10:] <= ranging(FOUR).deviation[10:] + 1e-12).all()
    assert (ranging(FOUR).deviation[-1] < ranging(fewer).deviation[-1]).all()


def test_outliers_and_more_noise_raise_it() -> None:
    least, spoilt = ranging(FOUR).deviation[-1], RangeQuality(0.02, 0.01, outliers=0.3)
    assert (least < ranging(dataclasses.replace(FOUR, ranging=RangeQuality(0.04, 0.02))).deviation[-1]).all()
    assert (least < ranging(dataclasses.replace(FOUR, ranging=spoilt)).deviation[-1]).all()


@pytest.mark.parametrize(
    ("mission", "read", "reason"),
    [
        (dataclasses.replace(FOUR, ranging=RangeQuality()), True, "declared exact"),
        (FOUR, False, "never determine the whole state"),
    ],
)
def test_where_there_is_none_for_ranges_it_says_why(mission: RangingMission, read: bool, reason: str) -> None:
    found = ranging(mission, read=read)
    assert reason in found.reason
    assert np.isnan(found.deviation).all()


def flight(gust: float, noise: float) -> PosteriorBound:
    """100 fixes, one a sample."""
    mission = FlightMission(
        HeightField(np.zeros((3, 3)), 500.0), (0.0, 0.0, 100.0), (9.0, 9.0, 100.0), position_noise=noise,
        gust=DeclaredGusts(gust),
    )  # fmt: skip
    return flight_bound(recording(np.zeros((100, 6)), {"position": np.zeros((100, 3))}, 3, 0.1), "it", mission)


def test_a_flight_starts_exactly_and_its_bound_settles_below_a_fix() -> None:
    deviation = flight(1.0, 2.0).deviation
    np.testing.assert_array_equal(deviation[0], 0.0)
    assert 0.0 < deviation[-1, 0] < 2.0
    np.testing.assert_allclose(deviation[-1], deviation[-20], rtol=0.05)


def test_a_flight_without_noise_or_without_gusts_has_none() -> None:
    assert "fixes are declared exact" in flight(1.0, 0.0).reason
    assert "the bound is zero" in flight(0.0, 2.0).reason


def missile(gust: GustStrength) -> PosteriorBound:
    start = np.zeros(PLANAR.state_size)
    start[PLANAR.index("u")], start[PLANAR.index("z_e")] = 120.0, -300.0
    noise = StateNoise(0.5, 0.2, 0.005, 0.005)
    mission = MissileMission(tuple(start), Target((700.0, 0.0, 0.0)), CASES["SM"], PLANAR, noise=noise, gust=gust)
    truth = np.tile(PLANAR.to_joints(start), (50, 1))
    return missile_bound(recording(truth, {"full_state": np.zeros((50, len(start)))}, 3, 0.016), "it", mission)


def test_the_bound_of_a_missile_is_below_a_reading_and_needs_gusts() -> None:
    deviation = missile(GustStrength(200.0, 10.0)).deviation
    assert (deviation[-1] <= StateNoise(0.5, 0.2, 0.005, 0.005).deviations(PLANAR)).all()
    assert (deviation[-1] > 0.0).all()
    assert "the bound is zero" in missile(GustStrength()).reason


def test_readings_of_an_attitude_bound_its_rate() -> None:
    mission = LagrangianMission(RigidBody(0.05), PositionQuality(0.001), 0.01)
    x, truth = np.array([1.0, 0.0, 0.0, 0.0, 1.0, -2.0, 0.5]), []
    for _ in range(60):
        truth.append(x)
        x = mission.flow(x, np.zeros(3), mission.period)
    found = lagrangian_bound(recording(np.array(truth), {"position": np.zeros((60, 4))}, 3, 0.01), "it", mission)
    assert np.isnan(found.deviation[0]).all(), "one attitude says nothing of the rate"
    assert (found.deviation[-1, 3:] < found.deviation[5, 3:]).all()


@pytest.mark.parametrize(
    ("reading", "reason"),
    [
        (PositionQuality(), "without noise"),
        (PositionQuality(resolution=10), "rounded and without noise"),
        (PositionQuality(1e-5, resolution=10), "more than twice their noise"),
    ],
)
def test_a_velocity_has_none_where_its_readings_are_exact_or_rounded_more_than_noisy(
    reading: PositionQuality, reason: str
) -> None:
    mission = LagrangianMission(MechanismSystem(build_model("two-link", name="arm")), reading, 0.01)
    found = lagrangian_bound(recording(np.zeros((9, 4)), {"position": np.zeros((9, 2))}, 2, 0.01), "it", mission)
    assert reason in found.reason
