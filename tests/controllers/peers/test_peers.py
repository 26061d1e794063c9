"""Gatekeeper, FASTER's rule and the barrier filter: each keeps the property that its method is about."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.flight import spline
from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.plugin import planner
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.controllers.peers.barrier import BarrierConfig, BarrierFlight, cover, funnel_slope
from mathnavi.controllers.peers.barrier_kernels import BarrierShape, barrier, filtered
from mathnavi.controllers.peers.commitment import least_effort, refusal
from mathnavi.controllers.peers.faster import Faster, FasterConfig
from mathnavi.controllers.peers.gatekeeper import Gatekeeper, GatekeeperConfig
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import flow, state_at
from mathnavi.models.aerial.plan_status import FlightPhase
from tests import flight

MISSION = flight.mission()
BOUND = tracking_bound(0.8, MISSION)
CERTIFICATE = Certificate.for_mission(MISSION, BOUND)


@njit
def surface(c: Array, u: float, v: float) -> tuple[float, float, float]:
    return spline.surface(c, u, v)


class Straight:
    """A nominal planner that flies level through whatever stands in its way; a failure once ``answers`` are given."""

    period = 1.0

    def __init__(self, speed: float, answers: int = 1000) -> None:
        self._speed, self._answers = speed, answers

    def plan(self, request: PlanRequest) -> Plan:
        self._answers -= 1
        if self._answers < 0:
            return Plan.failure(Status.SOLVER_FAILED, "no more")
        x = request.estimate.x if request.current is None else state_at(request.current, request.t_start)
        way = np.append(np.subtract(MISSION.target, x[:3])[:2], 0.0)
        change = self._speed * way / np.linalg.norm(way) - x[3:]
        pushed = max(1, int(np.ceil(np.linalg.norm(change) / 35.0)))
        u = np.zeros((30, 3))
        u[:pushed] = change / pushed
        states = [x]
        for held in u:
            states.append(flow(states[-1], held, 1.0))
        return Plan(request.t_start + np.arange(31.0), np.array(states), u, np.zeros(30, np.int64))


def flown(peer: Planner, periods: int) -> list[Plan]:
    """Plans that are flown one after the other, without a fault."""
    current: Plan | None = None
    plans: list[Plan] = []
    for k in range(periods):
        t = k * peer.period
        x = MISSION.start_state if current is None else state_at(current, t)
        plan = peer.plan(PlanRequest(t, t if current is None else t + peer.period, Estimate(t, x), current))
        if plan.ok:
            current = plan
            plans.append(plan)
    return plans


@pytest.mark.parametrize("kind", ["gatekeeper", "faster"])
def test_whatever_the_nominal_planner_proposes_the_committed_trajectory_is_safe_for_ever(kind: str) -> None:
    nominal = Straight(280.0)
    peer: Any = (
        Gatekeeper(GatekeeperConfig(), nominal, CERTIFICATE)
        if kind == "gatekeeper"
        else Faster(FasterConfig(), nominal, CERTIFICATE)
    )
    plans = flown(peer, 40)
    assert len(plans) > 5
    assert all(refusal(CERTIFICATE, plan) is None for plan in plans)
    end = plans[-1].x[-1, :3]
    assert np.linalg.norm(end - np.array(MISSION.target)) > 1000.0, (
        "the ridge stands in between, and it waits before it"
    )


def test_gatekeeper_takes_the_greatest_switching_time_that_is_valid() -> None:
    nominal = Straight(200.0)
    plan = flown(Gatekeeper(GatekeeperConfig(), nominal, CERTIFICATE), 1)[0]
    backup = plan.t[np.flatnonzero(plan.phase != FlightPhase.OPTIMISED)[0]]
    longer = Gatekeeper(GatekeeperConfig(), nominal, dataclasses.replace(CERTIFICATE, clearance_min=-1e4))
    whole = flown(longer, 1)[0]
    assert backup < 30.0
    assert whole.t[np.flatnonzero(whole.phase != FlightPhase.OPTIMISED)[0]] == pytest.approx(30.0)
    later = Gatekeeper(GatekeeperConfig(), nominal, CERTIFICATE)
    proposed = nominal.plan(PlanRequest(0.0, 0.0, Estimate(0.0, MISSION.start_state), None))
    assert refusal(CERTIFICATE, later._candidate(proposed, 30, float(backup))) is None
    assert refusal(CERTIFICATE, later._candidate(proposed, 30, float(backup) + 0.5)) is not None


def test_faster_leaves_room_to_stop_before_the_end_of_what_it_has_seen() -> None:
    config = FasterConfig()
    whole = planner(config, MISSION, BOUND)
    plan = flown(Faster(config, whole, CERTIFICATE), 3)[-1]
    r = plan.x[np.flatnonzero(plan.phase != FlightPhase.OPTIMISED)[0]]
    assert np.linalg.norm(r[3:]) > 50.0
    assert plan.t[np.flatnonzero(plan.phase != FlightPhase.OPTIMISED)[0]] < plan.t_start + config.duration


def test_faster_commits_to_all_of_a_whole_trajectory_that_reaches_the_target_in_free_space() -> None:
    high = dataclasses.replace(CERTIFICATE, clearance_min=-1e4)
    start = Estimate(0.0, np.array([*MISSION.start, 0.0, 0.0, 0.0]))
    whole = Straight(200.0).plan(PlanRequest(0.0, 0.0, start, None))
    for target, until in ((whole.x[-1, :3], 30.0), (whole.x[-1, :3] + 1000.0, 30.0 - 2.0 * 200.0 / 80.0)):
        faster = Faster(FasterConfig(), Straight(200.0), dataclasses.replace(high, target=target))
        assert faster._until_r(whole, 30) == pytest.approx(until, abs=1.0)
    assert faster._until_r(whole, 0) == 0.0


def test_least_effort_reaches_its_end_and_nothing_else_costs_less() -> None:
    start, end = np.array([0.0, 0.0, 100.0, 30.0, -5.0, 2.0]), np.array([80.0, 10.0, 120.0, 0.0, 0.0, 0.0])
    a = least_effort(start, end, 5, 6.0)

    def reached(inputs: Array) -> Array:
        x = start
        for u in inputs:
            x = flow(x, u, 6.0 / 5)
        return x

    np.testing.assert_allclose(reached(a), end, atol=1e-9)
    other = a + np.outer([1.0, -3.0, 3.0, -1.0, 0.0], [1.0, 0.0, 0.0])  # moves neither end
    np.testing.assert_allclose(reached(other), end, atol=1e-9)
    assert (other**2).sum() > (a**2).sum()


def test_the_cover_lies_nowhere_below_the_ground() -> None:
    terrain = MISSION.terrain
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.0, terrain.width, (2, 2000))
    for smoothing in (0.0, 400.0):
        c = cover(terrain, smoothing)
        above = [surface(c, v / terrain.spacing, u / terrain.spacing)[0] for u, v in zip(x, y, strict=True)]
        assert (np.array(above) >= terrain.height(x, y) - 1e-9).all()


def test_the_funnel_clears_the_ground_and_ends_near_the_target() -> None:
    terrain, target = CERTIFICATE.terrain, CERTIFICATE.target
    level, lift = target[2] - CERTIFICATE.clearance_min, 20.0
    slope = funnel_slope(terrain, target, level, lift)
    rng = np.random.default_rng(2)
    x, y = rng.uniform(0.0, terrain.width, (2, 4000))
    r = np.hypot(x - target[0], y - target[1])
    floor = level + lift + slope * (np.hypot(r, 10.0) - 10.0)
    assert (floor >= terrain.height(x, y) - 2.0).all()  # m: the ground near the target is sampled


def test_the_barriers_derivatives_are_those_of_its_value() -> None:
    terrain = MISSION.terrain
    c, funnel = cover(terrain, 200.0), np.array([9000.0, 9000.0, 300.0, 0.4, 10.0])
    shape = BarrierShape(c, terrain.spacing, 50.0, funnel)
    v, dt = np.array([120.0, -60.0, 30.0]), 1e-3
    used = set()
    for p in ([4000.0, 5000.0, 2300.0], [8600.0, 9300.0, 2300.0]):
        h, rate, gradient, second_derivative = barrier(shape, np.array(p), v)
        before, after = (barrier(shape, p + s * dt * v, v)[0] for s in (-1.0, 1.0))
        assert rate == pytest.approx((after - before) / (2.0 * dt), rel=1e-4)
        assert second_derivative == pytest.approx((after - 2.0 * h + before) / dt**2, rel=1e-2, abs=1e-2)
        assert rate == pytest.approx(gradient @ v)
        used.add(h == pytest.approx(p[2] - surface(c, p[1] / terrain.spacing, p[0] / terrain.spacing)[0] - 50.0))
    assert used == {True, False}, "both barriers were tried"


def test_the_filtered_input_is_the_nearest_that_is_allowed() -> None:
    rng = np.random.default_rng(3)
    tried = 0
    for _ in range(300):
        nominal, g, q = rng.normal(0.0, 30.0, 3), rng.normal(0.0, 1.0, 3), rng.normal(0.0, 1.0, 3)
        b, c, bound = float(rng.normal(0.0, 20.0)), float(rng.normal(-10.0, 10.0)), 40.0
        u = filtered(nominal, g, b, q, c, bound)
        assert np.linalg.norm(u) <= bound + 1e-9
        others = rng.normal(0.0, 1.0, (4000, 3))
        others *= bound * rng.uniform(0.0, 1.0, (4000, 1)) ** (1 / 3) / np.linalg.norm(others, axis=1)[:, None]
        allowed = others[(others @ g >= b) & (others @ q >= c)]
        if not len(allowed):
            continue
        tried += 1
        assert g @ u >= b - 1e-6
        assert q @ u >= c - 1e-6
        assert np.linalg.norm(u - nominal) <= np.linalg.norm(allowed - nominal, axis=1).min() + 1e-6
    assert tried > 100


def test_where_nothing_is_allowed_the_barrier_comes_first() -> None:
    up = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(filtered(np.zeros(3), up, 100.0, np.array([1.0, 0.0, 0.0]), -5.0, 40.0), 40.0 * up)


def test_the_barrier_filter_climbs_over_a_ridge_and_brakes_towards_the_target_as_late_as_it_is_set() -> None:
    target, speeds = np.array(MISSION.target), []
    ridge = MISSION.terrain.height(*np.linspace(MISSION.start[:2], MISSION.target[:2], 200).T).max()
    assert ridge > max(MISSION.start[2], MISSION.target[2])  # which its law alone would hit
    for approach in (0.25, 0.5):
        filter_, _ = BarrierFlight.build(BarrierConfig(horizon=120.0, approach=approach), MISSION)
        plan = filter_.plan(PlanRequest(0.0, 0.0, Estimate(0.0, MISSION.start_state), None))
        near = np.linalg.norm(plan.x[:, :3] - target, axis=1) <= 600.0
        speeds.append(float(np.linalg.norm(plan.x[near][0, 3:])))
        x = state_at(plan, np.arange(0.0, plan.t_end, 0.1))
        assert np.linalg.norm(x[-1, :3] - target) <= MISSION.arrival_radius
        assert (x[:, 2] - MISSION.terrain.height(x[:, 0], x[:, 1])).min() >= MISSION.clearance_min
    assert speeds[1] > 1.2 * speeds[0]
