"""The accelerations that the rotors have the moments for."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.controllers.quadrotor.bound import greatest_acceleration, turning_peak
from mathnavi.controllers.quadrotor.tracker import ReferenceFilter, TrackerConfig
from mathnavi.models.quadrotor.dynamics import NOMINAL
from tests.quadrotor import PERIOD, plan_of

CONFIG = TrackerConfig()
LOOP = CONFIG.attitude_bandwidth, CONFIG.attitude_damping, NOMINAL.motor_lag + 0.5 * PERIOD


@pytest.mark.parametrize(("omega", "preview"), [(6.0, 0.0), (6.0, 0.37), (9.0, 0.25)])
def test_the_peak_is_that_of_the_loop_behind_the_reference_filter(omega: float, preview: float) -> None:
    """Integrated step by step, with the reference that the tracker flies."""
    k_R, damping, lag = LOOP[0] ** 2, LOOP[1], LOOP[2]
    k_Omega, dt = 2.0 * damping * LOOP[0], 1e-3
    plan = plan_of([((0.0, 0.0, 0.0), 2.0), ((1.0, 0.0, 0.0), 3.0)])
    reference = ReferenceFilter(omega, preview, 10.0)
    theta = theta_dot = tau = greatest = 0.0
    for t in np.arange(0.0, 4.5, dt):
        z = reference.at(plan, float(t))
        tau_dot = (-k_R * (theta - z[2, 0]) - k_Omega * (theta_dot - z[3, 0]) - tau) / lag
        theta, theta_dot, tau = theta + dt * theta_dot, theta_dot + dt * tau, tau + dt * tau_dot
        greatest = max(greatest, abs(tau))
    assert turning_peak(omega, preview, *LOOP) == pytest.approx(greatest, rel=0.03)


def test_what_is_foreseen_asks_for_less() -> None:
    assert turning_peak(6.0, 0.37, *LOOP) < 0.3 * turning_peak(6.0, 0.0, *LOOP)


def test_slower_references_longer_arms_and_lighter_bodies_leave_more() -> None:
    plain = greatest_acceleration(CONFIG, NOMINAL, PERIOD)
    assert 2.0 < plain < 3.0
    slower = dataclasses.replace(CONFIG, reference_bandwidth=4.0)
    assert greatest_acceleration(slower, NOMINAL, PERIOD) > plain
    assert greatest_acceleration(CONFIG, dataclasses.replace(NOMINAL, arm=0.25), PERIOD) > plain
    heavy = dataclasses.replace(NOMINAL, inertia=(0.023, 0.023, 0.04))
    assert greatest_acceleration(CONFIG, heavy, PERIOD) < plain
    weak = dataclasses.replace(NOMINAL, thrust_max=4.0)  # with little room upwards
    assert greatest_acceleration(CONFIG, weak, PERIOD) < plain
