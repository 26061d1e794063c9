"""A missile's plans stay above the ground, at the nodes and between them, and end where they say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.missile.optimiser import MissileTrajectory, flown, lowest_height
from mathnavi.controllers.missile.problem import ALLOWANCE
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL
from mathnavi.models.missile.mission import MissileMission, Target
from tests.controllers.missile.flights import built, first_plan, miss, mission


def heights(plan: Plan, guidance: MissileMission) -> Array:
    """(n,) [m] along a plan, between its nodes too."""
    times = np.linspace(plan.t_start, plan.t_end, 800)
    return -guidance.coordinates.place(guidance.coordinates.state_at(plan, times))[:, 2]


@pytest.mark.parametrize("distance", [4000.0, 6000.0, 20_000.0])
def test_a_plan_to_a_target_far_away_stays_above_the_ground(distance: float) -> None:
    guidance = mission(case="SM", target=Target((distance, 0.0, 0.0)))
    plan = first_plan(guidance)
    height = heights(plan, guidance)
    assert height.min() >= -ALLOWANCE
    assert height[: len(height) // 2].min() > 2.0
    assert miss(plan, guidance) < 0.1


@pytest.mark.parametrize(
    ("coordinates", "fields"), [(PLANAR, {"grid": "arclength"}), (PLANAR, {"nodes": 8}), (SPATIAL, {}),
                                (SPATIAL, {"spatial": "joint"})],
)  # fmt: skip
def test_whatever_the_nodes_and_the_planner(coordinates: Coordinates, fields: dict[str, Any]) -> None:
    guidance = mission(coordinates, "SM", target=Target((4000.0, 0.0, 0.0)))
    assert heights(first_plan(guidance, **fields), guidance).min() >= -ALLOWANCE


def test_a_start_below_the_clearance_climbs_to_it_and_one_below_the_ground_is_refused() -> None:
    target = Target((4000.0, 0.0, 0.0))
    low = tuple(0.5 if name == "z_e" else value for name, value in zip(PLANAR.states, mission().start, strict=True))
    on_ground = tuple(0.0 if name == "z_e" else value for name, value in zip(PLANAR.states, low, strict=True))
    guidance = mission(case="SM", start=on_ground, target=target)
    plan = first_plan(guidance)
    assert heights(plan, guidance).min() >= -ALLOWANCE
    assert heights(plan, guidance)[200:400].min() > 4.0
    refused = built(mission(start=low))[0].plan(PlanRequest(0.0, 0.0, Estimate(0.0, np.array(low)), None))
    assert refused.status is Status.INFEASIBLE
    assert "0.5 m below the ground" in refused.message


def test_the_lowest_height_is_found_between_the_nodes() -> None:
    start, t = np.array([100.0, 20.0, 0.0, 0.0, 0.0, -10.0]), np.array([0.0, 2.0])
    u = np.array([[0.0, -NOMINAL.mass * (NOMINAL.gravity + 20.0), 0.0]])  # -10 + 20 t - 10 t^2: touches 0 at 1 s
    trajectory = MissileTrajectory(t, flown(start, t, u, PLANAR, NOMINAL), u, 0.0)
    assert -PLANAR.place(trajectory.x)[:, 2].min() == pytest.approx(10.0)
    assert lowest_height(trajectory, PLANAR, NOMINAL) == pytest.approx(0.0, abs=1e-6)


def test_a_target_behind_is_met_by_a_loop() -> None:
    guidance = mission(target=Target((-700.0, 0.0, 0.0)))
    plan = first_plan(guidance)
    assert miss(plan, guidance) < 0.1
    assert plan.x[-1, 3] == pytest.approx(1.5 * np.pi, abs=1e-2)
    assert heights(plan, guidance).min() >= -ALLOWANCE
