"""Signals that are applied whatever the estimate says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.textbook.input_signal import InputSignal, InputSignalConfig
from mathnavi.interfaces.signals import Estimate, Plan, PlanRequest
from mathnavi.models.textbook.library import EXAMPLE_2_1, KAZANTZIS_KRAVARIS, SYSTEMS
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.textbook.system import System


def mission(system: System) -> TextbookMission:
    return TextbookMission(system, system.start, (0.1,) * len(system.states))


CAMERA = SYSTEMS["camera-and-flags"]


def plan_at(config: InputSignalConfig, system: System, t: float, t_start: float) -> Plan:
    planner, _ = InputSignal.build(config, mission(system))
    plan = planner.plan(PlanRequest(t, t_start, Estimate(t, np.array(system.start)), None))
    assert plan.ok
    return plan


def test_the_signal_is_the_one_asked_for() -> None:
    config = InputSignalConfig(constant=(0.5, -0.1), amplitude=(0.0, 0.3), frequency=2.0)
    plan = plan_at(config, CAMERA, 3.0, 4.0)
    assert plan.t_start == pytest.approx(4.0)
    middles = 0.5 * (plan.t[:-1] + plan.t[1:])
    np.testing.assert_allclose(plan.u[:, 0], 0.5)
    np.testing.assert_allclose(plan.u[:, 1], -0.1 + 0.3 * np.sin(2.0 * middles))


def test_a_plan_tells_where_the_signal_leads() -> None:
    plan = plan_at(InputSignalConfig(), CAMERA, 0.0, 1.0)
    x = np.array(CAMERA.start)
    for k in range(100):
        u = np.array([0.4, 0.6 * math.sin(0.01 * k + 0.005)])
        x = CAMERA.flow(x, u, 0.01)
    np.testing.assert_allclose(plan.x[0], x, atol=1e-9)
    np.testing.assert_allclose(plan.x[1], CAMERA.flow(plan.x[0], plan.u[0], 0.01), atol=1e-12)


def test_the_tracker_holds_each_value_for_its_period() -> None:
    _, tracker = InputSignal.build(InputSignalConfig(), mission(CAMERA))
    plan = plan_at(InputSignalConfig(), CAMERA, 0.0, 0.0)
    estimate = Estimate(0.0, np.zeros(3))
    for t, arc in ((0.0, 0), (0.01, 1), (0.013, 1), (0.5, 50), (99.0, len(plan.u) - 1)):
        np.testing.assert_array_equal(tracker.command(t, estimate, plan), plan.u[arc])


def test_a_system_without_inputs_gets_none() -> None:
    assert plan_at(InputSignalConfig(), KAZANTZIS_KRAVARIS, 0.0, 0.0).u.shape[1] == 0
    with pytest.raises(ValueError, match="one number for each of no inputs"):
        InputSignal.build(InputSignalConfig(constant=(1.0,)), mission(KAZANTZIS_KRAVARIS))


def test_the_plan_of_a_solution_that_escapes_is_finite() -> None:
    plan = plan_at(InputSignalConfig(), EXAMPLE_2_1, 1.5, 1.5)
    assert np.isfinite(plan.x).all()


def test_a_signal_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"amplitude = \(1.0, 2.0\); allowed: one number for each of u \[1/s\]"):
        InputSignal.build(InputSignalConfig(amplitude=(1.0, 2.0)), mission(EXAMPLE_2_1))
    with pytest.raises(ValueError, match=r"frequency = 0.0; allowed"):
        InputSignalConfig(frequency=0.0)
