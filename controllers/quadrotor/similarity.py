"""The flight planner on a small map: the same problem in other units.

The planner was made for mountains: its cost-to-go has layers up to 2400 m above the ground and a length of 50 m about
the target, its speeds are some hundred metres a second. The double integrator, the terrain and all bounds keep their
form when lengths are multiplied by lambda and times by mu, velocities then by lambda / mu and accelerations by lambda /
mu^2. So a planner that gets a small map magnified flies over it as it does over mountains, and its plans, shrunk
again, are plans over the small map. Here mu = 10/3, so that arcs of 5/3 s become half a second, and lambda is such that
the mission's v_max becomes the 300 m/s of the thesis.
"""

from __future__ import annotations

import dataclasses
from functools import lru_cache
from typing import Any

import numpy as np

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.planner import ARRIVAL
from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest
from mathnavi.models.aerial.knowledge import RADARS, TARGET, TERRAIN, place_in
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HIGHEST, WALL, HeightField
from mathnavi.models.terrain.visibility import Radar

_TIME = 10.0 / 3.0  # mu
_SPEED = 300.0  # [m/s] of the thesis


@configuration
class Similarity:
    """Lengths times ``length``, times times ``time``; ``magnified`` leads to the planner, ``shrunk`` back."""

    length: Positive  # lambda
    time: Positive  # mu

    @staticmethod
    def for_mission(mission: FlightMission) -> Similarity:
        """Similarity that makes arcs of half a second and the mission's greatest speed those of the thesis."""
        return Similarity(_TIME * _SPEED / mission.speed_max, _TIME)

    @property
    def scales(self) -> tuple[float, float]:
        """Scales of velocities and of accelerations."""
        return self.length / self.time, self.length / self.time**2

    def inverse(self) -> Similarity:
        """Inverse similarity."""
        return Similarity(1.0 / self.length, 1.0 / self.time)

    def state(self, x: Array) -> Array:
        """Scale states x (..., 6) [m, m/s] of the quadrotor's point mass."""
        scaled: Array = x * np.repeat([self.length, self.scales[0]], 3)
        return scaled

    def radar(self, radar: Radar) -> Radar:
        """Scale a radar."""
        return dataclasses.replace(
            radar, x=radar.x * self.length, y=radar.y * self.length, radius=radar.radius * self.length
        )

    def bound(self, bound: TrackingBound) -> TrackingBound:
        """Scale a tracking bound."""
        speed, acceleration = self.scales
        return TrackingBound(
            bound.horizontal * self.length,
            bound.vertical * self.length,
            bound.speed * speed,
            bound.feedback * acceleration,
        )

    def mission(self, mission: FlightMission) -> FlightMission:
        """Mission as the planner knows it: places, bounds, terrain and radars. The tracking bound covers noise and
        gusts.
        """
        speed, acceleration = self.scales
        (x, y, z), (x_f, y_f, z_f) = mission.start, mission.target
        return dataclasses.replace(
            mission,
            terrain=_magnified(mission.terrain, self.length),
            start=(x * self.length, y * self.length, z * self.length),
            target=(x_f * self.length, y_f * self.length, z_f * self.length),
            clearance_min=mission.clearance_min * self.length,
            speed_max=mission.speed_max * speed,
            acceleration_max=mission.acceleration_max * acceleration,
            arrival_radius=mission.arrival_radius * self.length,
            control_period=mission.control_period * self.time,
            reach=mission.reach * self.length,
            radars=tuple(self.radar(radar) for radar in mission.radars),
        )

    def plan(self, plan: Plan) -> Plan:
        """Scale a plan."""
        if not plan.ok:
            return dataclasses.replace(plan, ready=plan.ready * self.time)
        return dataclasses.replace(
            plan,
            t=plan.t * self.time,
            x=self.state(plan.x),
            u=plan.u * self.scales[1],
            ready=plan.ready * self.time,
        )

    def request(self, request: PlanRequest) -> PlanRequest:
        """Scale a planning request."""
        estimate = Estimate(
            request.estimate.t * self.time, self.state(request.estimate.x), None, request.estimate.status
        )
        current = None if request.current is None else self.plan(request.current)
        messages = tuple(
            Message(message.t * self.time, message.sender, message.topic, self._payload(message))
            for message in request.messages
        )
        return PlanRequest(request.t * self.time, request.t_start * self.time, estimate, current, messages)

    def _payload(self, message: Message) -> Any:
        """Payload of a message, magnified if it can be: the planner ignores what it cannot use."""
        payload = message.payload
        if message.topic == ARRIVAL and isinstance(payload, float):
            return payload * self.time
        if message.topic == TERRAIN and isinstance(payload, HeightField):
            return _magnified(payload, self.length)
        if message.topic == RADARS and isinstance(payload, tuple):
            return tuple(self.radar(each) if isinstance(each, Radar) else each for each in payload)
        if message.topic == TARGET and (place := place_in(payload)) is not None:
            return tuple(each * self.length for each in place)
        return payload


@lru_cache(maxsize=4)
def _magnified(terrain: HeightField, length: float) -> HeightField:
    """Highest ground of a terrain magnified by ``length``, one object for all planners over it, so that they build on
    it only once. Walls, where no height is known, are as high as they can be.
    """
    z = terrain.highest.z
    return HeightField(np.where(z >= WALL, HIGHEST, z * length), terrain.spacing * length, name=terrain.name)


class SimilarPlanner:
    """A planner of the magnified problem whose requests and plans are in the units of the mission."""

    def __init__(self, planner: Planner, similarity: Similarity) -> None:
        self.period = planner.period / similarity.time
        self._planner, self._magnified, self._shrunk = planner, similarity, similarity.inverse()

    def plan(self, request: PlanRequest) -> Plan:
        """Plan the magnified problem and scale the plan back."""
        plan = self._shrunk.plan(self._planner.plan(self._magnified.request(request)))
        if plan.ok:
            # Rounding must not part it from its time, nor from where it is to start.
            plan.t[0] = request.t_start
            if request.current is None:
                plan.x[0] = request.estimate.x
        return plan
