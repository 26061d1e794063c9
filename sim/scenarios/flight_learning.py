"""A flight as a learner's task: outcomes, the cost-to-go Psi as a potential, and what is seen of the way ahead."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mathnavi.controllers.flight.cost_to_go import FactoredCost, factored_cost
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.interfaces.signals import Array, Estimate
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.flight_view import components, flight_views
from mathnavi.sim.scenarios.task import Outcome

HOLD = 0.5
"""[s] for which a learner's acceleration is held"""
_GRID = 65, 9  # nodes along the longer side, layers: those of the planner


@dataclass(frozen=True, eq=False)
class FlightTerms:
    """``LearningTerms`` of one aerial vehicle or a fleet, over the ground as it is."""

    missions: Mapping[str, FlightMission]  # by vehicle, as they are known at the start
    ground: HeightField  # as it is
    body: MujocoPlant
    arrived: Callable[[float, Mapping[str, Array]], bool]
    cost_max: float  # [m^2/s^4]
    deadline: float  # [s]
    hold: float | None = None  # [s]
    velocity: int = 3  # where the velocity (3,) begins in a true state
    seen: tuple[str, ...] = ()  # of an estimate's ``extra``
    reported: tuple[tuple[float, Point], ...] = ()  # (t [s], place [m]) of the target where it is known to be elsewhere
    at_deadline: Outcome = Outcome.LATE

    def outcome(self, t: float, truths: Mapping[str, Array]) -> Outcome | None:
        """A state that is not finite, the edge of the map and contact come before arrival."""
        states = [truths[name] for name in self.missions]
        if not all(np.isfinite(x).all() for x in states):
            return Outcome.DIVERGED
        if not all(self.ground.contains(x[0], x[1]) for x in states):
            return Outcome.OFF_MAP
        if any(self.body.contacts(name) > 0 for name in self.missions):
            return Outcome.CRASHED
        return Outcome.ARRIVED if self.arrived(t, truths) else None

    def potential(self, t: float, truths: Mapping[str, Array]) -> float:
        """Psi(p) / Psi(p_0), p_0 the start, in the mean over the vehicles; Psi as known at the start."""
        shares = []
        for name, mission in self.missions.items():
            cost, p = cost_to_go(mission), truths[name][np.newaxis, :3]
            shares.append(cost(p)[0] / cost_at_start(cost, mission.start) if np.isfinite(p).all() else 0.0)
        return float(np.mean(shares))

    def violated(self, t: float, truths: Mapping[str, Array]) -> bool:
        """True where a vehicle is nearer to the ground below it than h_min, or faster than v_max."""
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
        """``mathnavi.sim.scenarios.flight_view``, and what else the vehicle cannot be commanded without."""
        mission = self.missions[name]
        target = next((place for since, place in reversed(self.reported) if since <= t), mission.target)
        rows = flight_views(mission.terrain, mission.speed_max, estimate.x[np.newaxis], np.array([target]))
        return components(rows[0]) | {part: np.array(estimate.extra[part]) for part in self.seen}


def cost_to_go(mission: FlightMission) -> FactoredCost:
    """Psi of a mission without its factor, over the ground as it is charted."""
    return _built(mission.terrain, mission.target, mission.radars)


@lru_cache(maxsize=1024)
def cost_at_start(cost: FactoredCost, start: Point) -> float:
    """Psi(p_0) > 0 of a start p_0 [m]."""
    return max(float(cost(np.array([start]))[0]), math.ulp(1.0))


@lru_cache(maxsize=512)
def _built(terrain: HeightField, target: Point, radars: tuple[Radar, ...]) -> FactoredCost:
    return factored_cost(terrain, np.array(target), radars, *_GRID)
