"""One vehicle and a consensus that is made up, as in the simulations of A.8.4: is one planning step enough?

The vehicle is on its way on plans of its own. At some step k it is given eta_d, which deviates from its eta_k, (A.12),
by a share drawn uniformly; its next plan is to satisfy (A.13),

    T_p + L(p_N) / v_max + h = eta_d,

L the length to go. It has done so in one step if a certified plan's (A.12) is what (A.13) asks for to ``TOLERANCE``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mathnavi.controllers.arrival.outlier import is_outlier
from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.planner import RecedingHorizon
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.flight.problem import LengthToGo, Problem
from mathnavi.controllers.flight.sqp import CondensedSqp
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.sim.scenarios.flight_parts import drawn_point
from mathnavi.sim.studies.framework.study import TerrainReference

DEVIATIONS = (0.03, 0.1, 0.3)  # the thesis' is the last
NODES = 7  # N
TOLERANCE = 0.1  # [s]
_STEPS = (5, 25)  # between which one is drawn at which the vehicle is asked
_DRAWS = 50
_FARTHEST = 0.6  # of the map's side, least distance of start and target
_HEIGHTS = (50.0, 450.0)  # [m] above h_min


@dataclass(frozen=True)
class ArrivalChange:
    """A change of the time of arrival that one vehicle is asked for, on its way."""

    place: TerrainReference
    share: float
    seed: int


@dataclass(frozen=True)
class ArrivalStep:
    """Result of one planning step after a change of the time of arrival."""

    share: float
    later: bool  # whether a later time was asked for
    done: bool
    outlier: bool  # by (A.14)


def one_step(change: ArrivalChange) -> ArrivalStep | None:
    """Fly one vehicle until it is asked once, and plan one step.

    None where it has no mission, or has come too near to its target before.
    """
    rng = np.random.default_rng(change.seed)
    mission = _drawn(change.place.ground, rng)
    flight = FlightConfig(nodes=NODES)
    planner, _ = FlightController.build(flight, mission)
    assert isinstance(planner, RecedingHorizon)
    certificate = Certificate.for_mission(mission, tracking_bound(flight.bandwidth, mission))
    current: Plan | None = None
    t, x = 0.0, np.array([*mission.start, 0.0, 0.0, 0.0])
    count = int(rng.integers(*_STEPS))
    deviation = float(rng.uniform(-change.share, change.share))
    for _ in range(count):
        start = t if current is None else t + planner.period
        plan = planner.plan(PlanRequest(t, start, Estimate(t, x), current))
        current = plan if plan.ok else current
        if current is None:
            return None
        t += planner.period
        x = state_at(current, t)
    return _complied(planner, certificate, x, change.share, deviation)


def _complied(
    planner: RecedingHorizon, certificate: Certificate, x: Array, share: float, deviation: float
) -> ArrivalStep | None:
    parameters, environment = planner.parameters, planner.environment
    free = CondensedSqp().solve(Problem(parameters, environment, x), np.zeros(3 * parameters.arcs + 1))
    if isinstance(free, str):
        return None
    h, horizon, speed = parameters.h, parameters.horizon, certificate.speed_max

    def eta(accelerations: Array, start: Array) -> float:
        s = parameters.matrices
        end = start[:3] + s.base[-2] * start[3:] + s.weights[-2] @ accelerations
        return float(horizon + environment.cost(end)[0] / speed)

    own = eta(free.accelerations, x)
    if own < 2.0 * horizon:
        return None
    agreed = own * (1.0 + deviation)
    first = free.accelerations[0]
    following = np.concatenate([x[:3] + h * x[3:] + 0.5 * h * h * first, x[3:] + h * first])
    length = speed * (agreed - h - horizon)
    problem = replace(Problem(parameters, environment, following), length_to_go=LengthToGo(length))
    found = CondensedSqp(iteration_limit=50).solve(problem, free.unknowns)
    done = not isinstance(found, str) and abs(eta(found.accelerations, following) + h - agreed) <= TOLERANCE
    return ArrivalStep(share, deviation > 0.0, done, is_outlier(agreed, own, h))


def _drawn(terrain: HeightField, rng: np.random.Generator) -> FlightMission:
    side = max(terrain.width, terrain.depth)
    blank = FlightMission(terrain=terrain, start=(0.0, 0.0, 0.0), target=(0.0, 0.0, 0.0))
    for _ in range(_DRAWS):
        start, target = (drawn_point(blank, _HEIGHTS, rng) for _ in range(2))
        if np.linalg.norm(np.subtract(start, target)) >= _FARTHEST * side:
            break
    return replace(blank, start=start, target=target)
