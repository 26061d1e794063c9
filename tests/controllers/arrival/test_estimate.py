"""(A.12) and its alternatives: no later than true for v_max, exact for a plan that meets its target."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.arrival.coordinator import ArrivalEstimate
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.aerial.plan_status import FlightPhase

TARGET = np.array([1000.0, 0.0, 100.0])


def straight(points: Array) -> Array:
    """[m] to the target."""
    return np.linalg.norm(points - TARGET, axis=1)


def planned(pushes: list[tuple[float, float, FlightPhase]], t: float = 5.0) -> Plan:
    """Arcs (a_x, duration, phase) from rest at the origin."""
    x, times = [np.array([0.0, 0.0, 100.0, 0.0, 0.0, 0.0])], [t]
    for push, duration, _ in pushes:
        x.append(flow(x[-1], np.array([push, 0.0, 0.0]), duration))
        times.append(times[-1] + duration)
    u = np.array([[push, 0.0, 0.0] for push, _, _ in pushes])
    return Plan(np.array(times), np.array(x), u, np.array([phase for _, _, phase in pushes], np.int64))


TO_100_M_S = [(10.0, 10.0, FlightPhase.OPTIMISED), (-50.0, 2.0, FlightPhase.MANOEUVRE)]  # 500 m, then it stops


def least_time(plan: Plan, t: float, **fields: Any) -> float:
    return ArrivalEstimate(straight, TARGET, 200.0, **fields)(plan, t)


def test_beyond_the_horizon_the_rest_of_the_way_is_flown_at_v_max() -> None:
    plan = planned(TO_100_M_S)
    assert least_time(plan, 5.0) == pytest.approx(15.0 + 500.0 / 200.0)
    assert least_time(plan, 12.0) == pytest.approx(15.0 + 500.0 / 200.0)
    assert least_time(plan, 15.0 + 1.0) == pytest.approx(16.0 + (500.0 - 75.0) / 200.0)  # braking


def test_other_speeds_are_those_of_the_nodes() -> None:
    plan = planned(
        [(10.0, 5.0, FlightPhase.OPTIMISED), (10.0, 5.0, FlightPhase.OPTIMISED), (-50.0, 2.0, FlightPhase.MANOEUVRE)]
    )
    assert least_time(plan, 5.0, speed="mean") == pytest.approx(15.0 + 500.0 / 25.0)
    assert least_time(plan, 5.0, speed="largest") == pytest.approx(15.0 + 500.0 / 50.0)
    assert least_time(planned([(0.0, 5.0, FlightPhase.HOVER)]), 5.0, speed="mean") == math.inf


def test_a_plan_that_meets_its_target_is_as_good_as_it_says() -> None:
    plan = planned(
        [(20.0, 10.0, FlightPhase.OPTIMISED), (0.0, 5.0, FlightPhase.OPTIMISED), (-40.0, 5.0, FlightPhase.MANOEUVRE)]
    )
    assert plan.x[1, 0] == pytest.approx(1000.0)
    for speed in ("max", "mean", "largest"):
        assert least_time(plan, 6.0, speed=speed) == pytest.approx(15.0)


def test_what_is_no_speed_is_refused() -> None:
    with pytest.raises(ValueError, match="speed = 'typical'; allowed: max, mean, largest"):
        least_time(planned(TO_100_M_S), 0.0, speed="typical")
    with pytest.raises(ValueError, match=r"speed_max = 0\.0"):
        ArrivalEstimate(straight, TARGET, 0.0)
