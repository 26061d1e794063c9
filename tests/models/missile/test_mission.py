"""The task, its target, and what reads the missile's state."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from mathnavi.controllers.ocp.problems.missile import missile
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import COORDINATES, PLANAR, SPATIAL, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL, Body
from mathnavi.models.missile.mission import (
    CASES,
    GustStrength,
    MissileMission,
    MissileStateSensor,
    StateNoise,
    Target,
    TargetMotion,
    running_cost,
)
from tests.models.missile.test_dynamics import drawn

MISSION = MissileMission((120.0, 0.0, 0.0, 0.0, 0.0, -10.0), Target((700.0, 0.0, 0.0)), CASES["SM"])


@dataclass
class Moving:
    """A ``mathnavi.interfaces.protocols.StateView``."""

    x: Array
    acceleration: Array


def test_a_mission_may_be_a_key() -> None:
    assert hash(MISSION) == hash(replace(MISSION))
    assert replace(MISSION) == MISSION


def test_the_cost_is_the_printed_one() -> None:
    x, u = np.array([100.0, 5.0, 0.2, 0.1, 0.0, 0.0]), np.array([1000.0, -3000.0, 50.0])
    weight, case = 204.02 * 9.8, CASES["SM2"]
    expected = 1 + 0.2 * (1000 / weight) ** 2 + 0.05 * (3000 / weight) ** 2 + 0.1 * (50 / 247.437) ** 2 + 20 * 0.05**2
    assert case.running_cost(PLANAR, x, u) == pytest.approx(expected, rel=1e-14)
    in_space = case.running_cost(SPATIAL, PLANAR.in_space(x), PLANAR.input_in_space(u))
    assert in_space == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("body", [NOMINAL, Body(150.0, 180.0, 2.0, 9.0)], ids=["nominal", "other"])
@pytest.mark.parametrize("name", CASES)
def test_the_cost_of_arrays_and_of_the_benchmark_is_the_one_statement(name: str, body: Body) -> None:
    case, rng = CASES[name], np.random.default_rng(1)
    x, u = rng.uniform(1.0, 100.0, (20, 10)), rng.uniform(-3000.0, 3000.0, (20, 5))
    weights = (case.a_x, case.a_z, case.b, case.k)
    stated = running_cost(weights, body, x[:, :3].T, u[:, :3].T, (u[:, 3:] ** 2).sum(axis=1))
    np.testing.assert_allclose(case.running_cost(SPATIAL, x, u, body), stated, rtol=1e-14)
    in_plane, given = x[:, [0, 2, 3, 5, 7, 9]], u[:, [0, 2, 3]]
    none = np.zeros(20)
    stated = running_cost(weights, NOMINAL, (x[:, 0], none, x[:, 2]), (u[:, 0], none, u[:, 2]), given[:, 2] ** 2)
    solved = [float(missile(name).running_cost(a, b, 0.0, [])) for a, b in zip(in_plane, given, strict=True)]
    np.testing.assert_allclose(solved, stated, rtol=1e-14)


def test_sizes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match=r"start has 5 numbers; allowed: 6 in planar flight"):
        replace(MISSION, start=(0.0,) * 5)
    with pytest.raises(ValueError, match="input_max has 2"):
        replace(MISSION, input_max=(1.0, 2.0))
    assert MISSION.input_max == (math.inf,) * 3


def test_a_target_goes_on_as_it_was_seen() -> None:
    np.testing.assert_array_equal(Target((100.0, 2.0, 0.0), (10.0, -1.0, 0.0), 3.0).at(5.0), [120.0, 0.0, 0.0])


def test_a_target_that_turns_stays_where_it_is() -> None:
    motion = TargetMotion.along((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), [(4.0, (0.0, 5.0, 0.0)), (2.0, (-10.0, 0.0, 0.0))])
    assert [leg.t for leg in motion.legs] == [0.0, 2.0, 4.0]
    times = np.linspace(0.0, 6.0, 1201)
    places = motion.at(times)
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 10.0 * 0.0051
    np.testing.assert_allclose(places[-1], [0.0, 10.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(motion.velocity(3.0), [-10.0, 0.0, 0.0])


@pytest.mark.parametrize("coordinates", COORDINATES.values(), ids=COORDINATES)
def test_a_reading_without_noise_is_the_state(coordinates: Coordinates) -> None:
    x = drawn(coordinates, 1, 1)[0][0]
    motion = Moving(coordinates.to_joints(x), np.zeros(len(coordinates.joints)))
    reading = MissileStateSensor(coordinates).read(motion, np.random.default_rng(0))
    np.testing.assert_allclose(reading, x, rtol=1e-12, atol=1e-10)


def test_readings_scatter_as_declared() -> None:
    noise = StateNoise(position=2.0, velocity=0.5, angle=0.01, rate=0.02)
    sensor, rng = MissileStateSensor(SPATIAL, noise), np.random.default_rng(0)
    motion = Moving(np.zeros(10), np.zeros(5))
    spread = np.std([sensor.read(motion, rng) for _ in range(4000)], axis=0)
    np.testing.assert_allclose(spread, noise.deviations(SPATIAL), rtol=0.06)
    with pytest.raises(ValueError, match=r"angle = nan; allowed"):
        StateNoise(angle=math.nan)


def test_a_reading_that_grows_old_is_worth_less() -> None:
    mission = replace(MISSION, noise=StateNoise(1.0, 0.5, 0.01, 0.01), gust=GustStrength(400.0, 20.0))
    fresh, old = (np.diag(mission.full_state_covariance(age)) for age in (0.0, 0.2))
    np.testing.assert_allclose(fresh, mission.noise.deviations(PLANAR) ** 2)
    assert (old > fresh).all()
    still = replace(mission, gust=GustStrength())
    np.testing.assert_array_equal(still.full_state_covariance(0.2), still.full_state_covariance(0.0))


def test_the_declared_motion_keeps_the_declared_limits() -> None:
    bounded = replace(MISSION, input_max=(100.0, 3000.0, 50.0))
    x, u = MISSION.start_state, np.array([500.0, -9000.0, 80.0])
    np.testing.assert_array_equal(bounded.flow(x, u, 0.1), PLANAR.flow(x, np.array([100.0, -3000.0, 50.0]), 0.1))
