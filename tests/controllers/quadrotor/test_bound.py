"""The tracking bound: the linear loop is that of the flight, and what it says of gusts, mass and lag is kept."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.quadrotor.bound import AxisLoop, tracking_bound
from mathnavi.controllers.quadrotor.tracker import GeometricTracker, TrackerConfig
from mathnavi.interfaces.signals import OPTIMISED, Array
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.quadrotor.dynamics import NOMINAL, at_rest
from mathnavi.models.quadrotor.entity import RotorDrive
from mathnavi.sim.engine.faults import ConstantWrench, Gusts
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from tests.quadrotor import PERIOD, TICKS, built, estimate_of, flight_mission, flown, hovering, plain, turning

CONFIG = TrackerConfig()
GUSTS = DeclaredGusts(0.7, 2.0, 1.5)


def mission(**fields: object) -> FlightMission:
    return flight_mission(plain(), (50.0, 50.0), (350.0, 350.0), **fields)


@pytest.mark.parametrize(("axis", "share"), [(0, 0.1), (2, 0.15)])
def test_a_step_of_force_is_answered_as_the_linear_loop_answers(axis: int, share: float) -> None:
    loop = (AxisLoop.along if axis == 2 else AxisLoop.across)(CONFIG, NOMINAL, PERIOD)
    _, steps = loop.peak_gains
    _, deviation, _ = flown(hovering(), 2.5, disturbance=ConstantWrench(NOMINAL.mass * np.eye(3)[axis], np.zeros(3)))
    assert np.abs(deviation[:, axis]).max() == pytest.approx(steps[0], rel=share)
    assert np.abs(deviation[:, 3 + axis]).max() == pytest.approx(steps[1], rel=share)


def test_the_spread_under_gusts_is_that_of_flights() -> None:
    """The standard deviation of 25 s in gusts that no limit clips."""
    gust = DeclaredGusts(0.4, 1.0, 9.0)
    expected = AxisLoop.across(CONFIG, NOMINAL, PERIOD).deviations(mission(gust=gust))[0]
    m = NOMINAL.mass
    gusts = Gusts(m * gust.rms, gust.time_constant, m * gust.limit, np.random.default_rng(1))
    _, deviation, _ = flown(hovering(), 25.0, disturbance=gusts)
    assert deviation[:, :2].std() == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("seed", range(3))
def test_the_bound_is_kept_in_gusts_by_another_mass_lag_and_drag(seed: int) -> None:
    """On plans that turn every half second with all that the bound leaves them."""
    drag = tuple(1.25 * d for d in NOMINAL.drag)
    true = dataclasses.replace(NOMINAL, mass=1.1 * NOMINAL.mass, motor_lag=0.04, drag=drag)
    flight = mission(gust=GUSTS)
    bound = tracking_bound(CONFIG, NOMINAL, flight)
    rng = np.random.default_rng(seed)
    plan = turning(rng, flight.acceleration_max - bound.feedback, flight.speed_max - bound.speed)
    # A force per mass of the believed vehicle: the heavier one feels less of it, so it is given its own.
    gusts = Gusts(true.mass * GUSTS.rms, GUSTS.time_constant, true.mass * GUSTS.limit, rng)
    _, deviation, _ = flown(plan, 9.0, true=true, disturbance=gusts)
    assert 0.02 < np.hypot(deviation[:, 0], deviation[:, 1]).max() <= bound.horizontal
    assert np.abs(deviation[:, 2]).max() <= bound.vertical
    assert np.linalg.norm(deviation[:, 3:], axis=1).max() <= bound.speed


@pytest.mark.parametrize("rough", [False, True])
def test_the_bound_is_kept_by_plans_that_take_over_unforeseen(rough: bool) -> None:
    """Every half second another plan, of turns drawn anew with all that the bound leaves of a_max, however large."""
    flight = mission(acceleration_max=5.0, gust=GUSTS if rough else DeclaredGusts())
    bound = tracking_bound(CONFIG, NOMINAL, flight)
    left = flight.acceleration_max - bound.feedback
    assert 1.5 < left < 3.0  # at more the rotors have not the moments
    rng, high = np.random.default_rng(0), np.array([200.0, 200.0, 900.0])
    true = dataclasses.replace(NOMINAL, mass=1.1 * NOMINAL.mass, motor_lag=1.15 * NOMINAL.motor_lag)
    true = true if rough else NOMINAL
    setups = {"quad": VehicleSetup(at_rest(high), drive=RotorDrive(true))}
    plant = MujocoPlant(built(plain(), true), setups, np.random.default_rng(0))
    gusts = Gusts(true.mass * GUSTS.rms, GUSTS.time_constant, true.mass * GUSTS.limit, rng)
    tracker = GeometricTracker(PERIOD, CONFIG, NOMINAL, bound)
    t, x, deviation = 0.0, np.array([*high, 0.0, 0.0, 0.0]), []
    for _ in range(40):
        arcs = ArcList.begin(t, x)
        while len(arcs.u) < 4:
            direction = rng.standard_normal(3)
            u = left * direction / np.linalg.norm(direction)
            if np.linalg.norm(arcs.x[-1][3:] + 0.5 * u) <= flight.speed_max - bound.speed:
                arcs.add(u, 0.5, OPTIMISED)
        plan = arcs.plan(0.0, 0.0)
        for _ in range(round(0.5 / PERIOD)):
            estimate = estimate_of(plant.state("quad"), plant.t)
            deviation.append(estimate.x - state_at(plan, plant.t))
            if rough:
                gusts.act(plant, TICKS)
            plant.step({"quad": tracker.command(plant.t, estimate, plan)}, TICKS)
        t += 0.5
        x = state_at(plan, t)
    error = np.array(deviation)
    assert 0.05 < np.hypot(error[:, 0], error[:, 1]).max() <= bound.horizontal
    assert np.abs(error[:, 2]).max() <= bound.vertical


def test_more_to_allow_for_is_a_wider_bound() -> None:
    def bound_of(config: TrackerConfig = CONFIG, **fields: object) -> Array:
        bound = tracking_bound(config, NOMINAL, mission(acceleration_max=2.0, **fields))  # so that none is yielded
        assert bound.feedback == 0.0
        return np.array([bound.horizontal, bound.vertical, bound.speed])

    still = bound_of()
    assert (bound_of(gust=DeclaredGusts(0.2, 2.0, 1.5)) > still).all()
    assert (bound_of(gust=DeclaredGusts(0.4, 2.0, 1.5)) > bound_of(gust=DeclaredGusts(0.2, 2.0, 1.5))).all()
    assert (bound_of(position_noise=0.02) > still).all()
    less = dataclasses.replace(CONFIG, mass_tolerance=0.0, drag_tolerance=0.0)
    assert (bound_of(less) < still).all()


def test_what_gusts_take_of_the_rotors_is_taken_from_the_plans() -> None:
    calm, stormy = (tracking_bound(CONFIG, NOMINAL, mission(gust=gust)) for gust in (DeclaredGusts(), GUSTS))
    assert 0.0 <= calm.feedback < stormy.feedback < 5.0
    with pytest.raises(ValueError, match=r"gust rms = 3\.0.*more than the rotors have"):
        tracking_bound(CONFIG, NOMINAL, mission(gust=DeclaredGusts(3.0, 2.0, 6.0)))


def test_gains_that_the_rotors_cannot_follow_are_refused() -> None:
    slow = dataclasses.replace(NOMINAL, motor_lag=0.2)
    with pytest.raises(ValueError, match=r"motor_lag = 0\.2 s grows by .*; allowed: slower ones"):
        tracking_bound(CONFIG, slow, mission())
