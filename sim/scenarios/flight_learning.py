"""A flight as a learning task: outcomes, the cost-to-go Psi as a potential, and observations of the way ahead."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mathnavi.controllers.flight.cost_to_go import FactoredCost, factored_cost
from mathnavi.interfaces.signals import Array, Estimate
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.flight_view import components, flight_views
from mathnavi.sim.scenarios.task import Outcome

HOLD = 0.5
"""time for which a learner's acceleration is held [s]"""
_GRID = 65, 9  # nodes along the longer side, layers: those of the planner


@dataclass(frozen=True, eq=False)
class FlightTerms:
    """``LearningTerms`` of one aerial vehicle or a fleet, over the true ground."""

    missions: Mapping[str, FlightMission]  # by vehicle, as known at the start
    ground: HeightField  # the true one
    body: MujocoPlant
    arrived: Callable[[float, Mapping[str, Array]], bool]
    cost_max: float  # [m^2/s^4]
    deadline: float  # [s]
    hold: float | None = None  # [s]
    velocity: int = 3  # where the velocity (3,) begins in a true state
    seen: tuple[str, ...] = ()  # of an estimate's ``extra``
    reported: tuple[tuple[float, Point], ...] = ()  # (t [s], place [m]) of the target's reported places
    at_deadline: Outcome = Outcome.LATE

    def outcome(self, t: float, truths: Mapping[str, Array]) -> Outcome | None:
        """Outcome of the flight at t [s], None while it goes on; divergence, the map's edge and contact precede
        arrival.
        """
        states = [truths[name] for name in self.missions]
        if not all(np.isfinite(x).all() for x in states):
            return Outcome.DIVERGED
        if not all(self.ground.contains(x[0], x[1]) for x in states):
            return Outcome.OFF_MAP
        if any(self.body.contacts(name) > 0 for name in self.missions):
            return Outcome.CRASHED
        return Outcome.ARRIVED if self.arrived(t, truths) else None

    def potential(self, t: float, truths: Mapping[str, Array]) -> float:
        """Potential Psi(p) / Psi(p_0), p_0 the start, averaged over the vehicles, with Psi as known at the start."""
        shares = []
        for name, mission in self.missions.items():
            cost, p = cost_to_go(mission), truths[name][np.newaxis, :3]
            shares.append(cost(p)[0] / cost_at_start(cost, mission.start) if np.isfinite(p).all() else 0.0)
        return float(np.mean(shares))

    def violated(self, t: float, truths: Mapping[str, Array]) -> bool:
        """True if a vehicle is lower than h_min above the ground below it, or faster than v_max."""
        for name, mission in self.missions.items():
            x = truths[name]
            height = x[2] - self.ground.height(x[0], x[1])
            if not (
                height >= mission.clearance_min
                and np.linalg.norm(x[self.velocity : self.velocity + 3]) <= mission.speed_max
            ):
                return True
        return False

    def clearance(self, t: float, truths: Mapping[str, Array]) -> float:
        """Least height [m] of a vehicle above the ground below it; NaN off the map."""
        heights = [truths[name][2] - self.ground.height(truths[name][0], truths[name][1]) for name in self.missions]
        return float(min(heights))

    def view(self, t: float, name: str, estimate: Estimate) -> dict[str, Array]:
        """Observations by ``mathnavi.sim.scenarios.flight_view``, and the arrays that commanding it requires."""
        mission = self.missions[name]
        target = next((place for since, place in reversed(self.reported) if since <= t), mission.target)
        rows = flight_views(mission.terrain, mission.speed_max, estimate.x[np.newaxis], np.array([target]))
        return components(rows[0]) | {part: np.array(estimate.extra[part]) for part in self.seen}


def cost_to_go(mission: FlightMission) -> FactoredCost:
    """Cost-to-go Psi of a mission without its factor, over the charted ground."""
    return _built(mission.terrain, mission.target, mission.radars)


@lru_cache(maxsize=1024)
def cost_at_start(cost: FactoredCost, start: Point) -> float:
    """Cost-to-go Psi(p_0) > 0 of a start p_0 [m]."""
    return max(float(cost(np.array([start]))[0]), math.ulp(1.0))


@lru_cache(maxsize=512)
def _built(terrain: HeightField, target: Point, radars: tuple[Radar, ...]) -> FactoredCost:
    return factored_cost(terrain, np.array(target), radars, *_GRID)
