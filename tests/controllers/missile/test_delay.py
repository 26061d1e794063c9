"""Thrusters that are late: the autopilot acts on the state at which its command will act."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.signals import Estimate, PlanRequest
from mathnavi.models.missile.input_history import InputHistory
from mathnavi.models.missile.mission import MissileMission
from tests.controllers.missile.flights import built, mission
from tests.controllers.missile.test_closed_loop import ROUGH, summary


def test_inputs_act_a_delay_after_they_were_commanded() -> None:
    history = InputHistory(0.1, 1)
    for t in (0.0, 0.04, 0.08):
        history.note(t, np.array([100.0 * t]))
    history.note(0.12, np.array([np.nan]))  # is not carried out
    acting = [(round(duration, 9), float(u[0])) for duration, u in history.acting(0.05, 0.2)]
    assert acting == [(0.05, 0.0), (0.04, 0.0), (0.04, 4.0), (0.02, 8.0)]
    assert [(round(duration, 9), float(u[0])) for duration, u in history.acting(0.2, 0.3)] == [(0.1, 8.0)]


@pytest.mark.parametrize("fields", [
    {"actuator__delay": 0.3, "planner__autopilot": "tvlqr"},
    {"actuator__delay": 0.15, "actuator__declared_delay": 0.12, **ROUGH},
])  # fmt: skip
def test_a_missile_with_late_thrusters_hits(fields: dict[str, Any]) -> None:
    found = summary(**fields)
    assert found["hit"], found
    assert found["saturated_s"] == 0.0


def test_a_delay_that_is_not_declared_is_an_honest_miss() -> None:
    found = summary(actuator__delay=0.15, actuator__declared_delay=0.0, planner__replan_period=0.5)
    assert not found["hit"]
    assert found["miss_m"] > 10.0


def test_a_plan_begins_with_what_is_on_its_way() -> None:
    guidance: MissileMission = mission(input_delay=0.2)
    planner, _ = built(guidance)
    plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, guidance.start_state), None))
    np.testing.assert_array_equal(plan.u[0], 0.0)
    assert plan.t[1] == pytest.approx(0.2)
    later = planner.plan(PlanRequest(1.0, 1.1, Estimate(1.0, guidance.coordinates.state_at(plan, 1.0)), plan))
    for t in (1.1, 1.2, 1.29):
        np.testing.assert_array_equal(guidance.coordinates.input_at(later, t), guidance.coordinates.input_at(plan, t))
