"""The tracker in MuJoCo: hover, steps, circles, turns, a vehicle upside down, winds, and what it refuses."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.controllers.quadrotor.kernels import attitude_of, rates_of
from mathnavi.controllers.quadrotor.tracker import GeometricTracker, TrackerConfig
from mathnavi.interfaces.signals import Array, Estimate
from mathnavi.models.quadrotor.dynamics import ATTITUDE, NOMINAL, RATE, VELOCITY, Quadrotor, at_rest
from mathnavi.models.quadrotor.entity import tilt
from mathnavi.models.quaternion import rotation
from mathnavi.sim.engine.faults import ConstantWrench
from tests.quadrotor import ANY_BOUND, HIGH, PERIOD, estimate_of, flown, hovering, plan_of, turning


def tracker(**fields: float) -> GeometricTracker:
    return GeometricTracker(PERIOD, TrackerConfig(**fields), NOMINAL, ANY_BOUND)


def test_in_hover_each_rotor_carries_a_quarter() -> None:
    _, deviation, asked = flown(hovering(), 1.0)
    assert np.abs(deviation).max() < 1e-9
    np.testing.assert_allclose(asked, NOMINAL.hover_thrust, atol=1e-9)


def test_a_step_is_made_up_for() -> None:
    """From 0.8 m beside the plan, with an overshoot of less than a fifth."""
    start = at_rest(HIGH + np.array([0.8, 0.0, 0.0]))
    _, deviation, _ = flown(hovering(), 4.0, start=start)
    assert np.linalg.norm(deviation[-1]) < 5e-3
    assert deviation[:, 0].min() > -0.16
    assert np.abs(deviation[:, 2]).max() < 0.03


def test_a_circle_is_flown_with_the_nose_ahead() -> None:
    """8 m/s on a radius of 16 m: 4 m/s^2, in arcs of 0.25 s."""
    rate, h = 0.5, 0.25
    run_up = [((4.0, 0.0, 0.0), 2.0)]
    turns = [((-4.0 * math.sin(rate * (k + 0.5) * h), 4.0 * math.cos(rate * (k + 0.5) * h), 0.0), h) for k in range(48)]
    states, deviation, _ = flown(plan_of([*run_up, *turns]), 13.0)
    assert np.linalg.norm(deviation[:, :2], axis=1).max() < 0.13
    assert np.abs(deviation[:, 2]).max() < 0.05
    for x in states[600:]:
        nose, v = rotation(x[ATTITUDE])[:2, 0], x[VELOCITY][:2]
        assert nose @ v > math.cos(0.35) * np.linalg.norm(nose) * np.linalg.norm(v)


def test_turns_at_full_acceleration_are_followed_closely() -> None:
    _, deviation, asked = flown(turning(np.random.default_rng(1), 4.5, 10.0), 8.0)
    assert np.linalg.norm(deviation[:, :2], axis=1).max() < 0.16
    assert np.abs(deviation[:, 2]).max() < 0.09
    assert ((asked >= 0.0) & (asked <= NOMINAL.thrust_max)).all()


@pytest.mark.parametrize(
    "true",
    [
        dataclasses.replace(NOMINAL, mass=1.32),
        dataclasses.replace(NOMINAL, motor_lag=0.045),
        dataclasses.replace(NOMINAL, drag=(0.5, 0.5, 0.2)),
    ],
    ids=["mass", "lag", "drag"],
)
def test_a_vehicle_that_is_not_the_believed_one_is_held_too(true: Quadrotor) -> None:
    _, deviation, _ = flown(turning(np.random.default_rng(2), 3.5, 9.0), 8.0, true=true)
    assert np.linalg.norm(deviation[:, :2], axis=1).max() < 0.2
    assert np.abs(deviation[:, 2]).max() < 0.12


def test_a_steady_wind_leaves_no_deviation() -> None:
    wind = ConstantWrench((1.5, -1.0, 0.8), (0.0, 0.0, 0.0))
    _, deviation, _ = flown(hovering(), 5.0, disturbance=wind)
    assert 0.02 < np.linalg.norm(deviation[:, :3], axis=1).max() < 0.2
    assert np.linalg.norm(deviation[-1]) < 2e-3


def test_the_unknown_force_that_is_made_up_for_has_a_limit() -> None:
    wind = ConstantWrench((2.4, 0.0, 0.0), (0.0, 0.0, 0.0))  # 2 m/s^2
    _, deviation, _ = flown(hovering(), 6.0, disturbance=wind, config=TrackerConfig(disturbance_max=0.5))
    assert deviation[-1, 0] == pytest.approx(1.5 / 9.0, rel=0.05)  # what is left, over omega_p^2


@pytest.mark.parametrize("angle", [math.pi, 3.0, -2.4])
def test_it_recovers_from_upside_down(angle: float) -> None:
    start = at_rest(HIGH)
    start[ATTITUDE] = math.cos(0.5 * angle), math.sin(0.5 * angle), 0.0, 0.0
    states, deviation, _ = flown(hovering(), 6.0, start=start)
    tilts = np.array([tilt(x[ATTITUDE]) for x in states])
    assert tilts[0] > 2.3
    assert (tilts[round(0.9 / PERIOD) :] < 1.2).all()
    assert states[:, 2].min() > HIGH[2] - 4.0
    assert np.linalg.norm(deviation[-1]) < 0.05


def test_a_spin_is_stopped() -> None:
    start = at_rest(HIGH)
    start[RATE] = 10.0, -8.0, 3.0
    states, deviation, _ = flown(hovering(), 5.0, start=start)
    assert np.linalg.norm(states[-1, RATE]) < 0.05
    assert np.linalg.norm(deviation[-1, :3]) < 0.05


triples = st.tuples(*[st.floats(-5.0, 5.0)] * 3).map(np.array)


@given(f=triples, f_dot=triples, heading=st.floats(-3.0, 3.0), turn=st.floats(-1.5, 1.5))
def test_the_rates_are_those_of_the_attitude(f: Array, f_dot: Array, heading: float, turn: float) -> None:
    """Against differences."""
    f = f + 9.0 * np.eye(3)[2]
    step = 1e-5
    R = attitude_of(f, heading)
    after, before = (attitude_of(f + s * f_dot, heading + s * turn) for s in (step, -step))
    spin = R.T @ (after - before) / (2.0 * step)
    omega = rates_of(R, f, f_dot, heading, turn)
    np.testing.assert_allclose(omega, [spin[2, 1], spin[0, 2], spin[1, 0]], rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("what", "estimate"),
    [
        ("state", Estimate(0.0, np.zeros(13), extra={"attitude": np.eye(4)[0], "rate": np.zeros(3)})),
        ("attitude is missing", Estimate(0.0, np.zeros(6))),
        ("rate is missing", Estimate(0.0, np.zeros(6), extra={"attitude": np.eye(4)[0]})),
        ("attitude", Estimate(0.0, np.zeros(6), extra={"attitude": np.zeros(4), "rate": np.zeros(3)})),
        ("rate", Estimate(0.0, np.zeros(6), extra={"attitude": np.eye(4)[0], "rate": np.full(3, np.nan)})),
    ],
)
def test_an_estimate_of_something_else_is_refused(what: str, estimate: Estimate) -> None:
    with pytest.raises(ValueError, match=rf"the estimate's {what}.*allowed"):
        tracker().command(0.0, estimate, hovering())


def test_the_same_estimates_give_the_same_thrusts() -> None:
    start = at_rest(HIGH + np.array([0.5, -0.3, 0.2]))
    np.testing.assert_array_equal(flown(hovering(), 0.5, start=start)[2], flown(hovering(), 0.5, start=start)[2])


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("position_bandwidth", 0.0), ("position_bandwidth", 8.0), ("attitude_damping", -1.0), ("preview", -0.1),
        ("preview", math.nan), ("tilt_max", 90.0), ("disturbance_max", 0.0), ("mass_tolerance", -0.1),
        ("turn_max", math.inf), ("reference_bandwidth", 5e-324), ("yaw_bandwidth", 1e308),
    ],
)  # fmt: skip
def test_gains_that_cannot_be_are_refused(field: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{field} = .*; allowed"):
        TrackerConfig(**{field: value})


def test_gains_too_fast_for_the_period_are_refused() -> None:
    with pytest.raises(ValueError, match=r"attitude_bandwidth = 14\.0; allowed: .* at a control_rate of 60 Hz"):
        GeometricTracker(1.0 / 60.0, TrackerConfig(), NOMINAL, ANY_BOUND)


def test_a_command_is_the_callers_own() -> None:
    flyer, estimate = tracker(), estimate_of(at_rest(HIGH))
    flyer.command(0.0, estimate, hovering())[:] = np.nan
    assert np.isfinite(flyer.command(PERIOD, estimate_of(at_rest(HIGH), PERIOD), hovering())).all()
