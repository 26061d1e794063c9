"""The receding-horizon planner on stretched grids: what it plans, and that it arrives."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.controllers.flight.certificate import Certificate, pass_time
from mathnavi.controllers.flight.cost_to_go import REFERENCE_SPEED
from mathnavi.controllers.flight.planner import RecedingHorizon
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Estimate, Plan, PlanRequest
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.plan_status import FlightPhase
from tests import flight

MISSION = flight.mission()
CERTIFICATE = Certificate.for_mission(MISSION, tracking_bound(0.8, MISSION))
CONFIGS = {
    "uniform": FlightConfig(),
    "stretched": FlightConfig(horizon=40.0, stretch=1.2),
    "stretched, replanned within the first arc": FlightConfig(nodes=9, horizon=25.0, stretch=1.2, period=0.5),
    "stretched, replanned after several arcs": FlightConfig(horizon=30.0, stretch=1.3, period=3.0),
    "shrinking": FlightConfig(nodes=9, horizon=15.0, stretch=0.9, period=1.0),
}


def following(planner: Planner, current: Plan | None, t: float) -> Plan:
    """The answer to a request at ``t``, the vehicle where its plan says."""
    if current is None:
        return planner.plan(PlanRequest(t, t, Estimate(t, flight.at_rest(MISSION.start)), None))
    return planner.plan(PlanRequest(t, t + planner.period, Estimate(t, state_at(current, t)), current))


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)
def test_a_plan_has_the_arcs_of_the_grid_is_certified_and_costs_effort_time_and_cost_to_go(
    config: FlightConfig,
) -> None:
    planner, _ = FlightController.build(config, MISSION)
    assert isinstance(planner, RecedingHorizon)
    plan = following(planner, None, 0.0)
    optimised = plan.phase == FlightPhase.OPTIMISED
    np.testing.assert_allclose(np.diff(plan.t)[optimised], config.lengths, rtol=1e-9)
    flight.assert_well_formed(plan)
    assert CERTIFICATE.check(plan) is None
    n = config.nodes - 1
    effort = np.diff(plan.t)[:n] @ (plan.u[:n] ** 2).sum(axis=1)
    to_go = config.beta / REFERENCE_SPEED * float(planner._environment.cost(plan.x[n, :3])[0])
    assert plan.cost == pytest.approx(effort + config.beta * config.duration + to_go)


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)
def test_a_target_within_the_horizon_is_met_at_a_node_and_the_time_of_that_is_kept(config: FlightConfig) -> None:
    planner, _ = FlightController.build(config, MISSION)
    current, t = following(planner, None, 0.0), 0.0
    arrivals: list[float] = []
    while t + 2.0 * planner.period < (arrivals[-1] if arrivals else 100.0):
        t += planner.period
        plan = following(planner, current, t)
        if plan.ok and CERTIFICATE.check(plan) is None:
            current = plan
            arrival = pass_time(plan, CERTIFICATE.target, t)
            if arrival < t + planner.period + config.duration + config.lengths[0]:
                arrivals.append(arrival)
    assert len(arrivals) > 1
    np.testing.assert_allclose(arrivals, arrivals[0], rtol=1e-9)
