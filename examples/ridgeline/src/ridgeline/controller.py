"""The plug-in ``roadmap``: fly along the cheapest way over a lattice, its corners rounded, as fast as is safe.

The first plan leads all the way to the target, and is kept until a message changes the radars, the target or the map.
Then the way is planned again from a point on the plan being flown. A plan that cuts a corner too near to the
ground is slowed down until mathnavi's certificate accepts it; the scenario holds it to the same certificate once more.
"""

from __future__ import annotations

import dataclasses
import math
import time
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mathnavi.controllers.flight.certificate import Certificate, remainder
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.interfaces.bounds import NonNegative, Positive, Within, configuration
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.knowledge import Knowledge
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightStatus
from ridgeline.blending import SLOWER, fitting, flight
from ridgeline.roadmap import Air, Routes, lattice

ATTEMPTS = 40  # at slowing down


@configuration
class RoadmapConfig:
    """Fields of ``--planner``."""

    columns: Annotated[int, Within(Interval(ge=2, le=201), allowed="2 to 201")] = 41
    """number of columns of the lattice, along the longer side of the map"""
    layers: Annotated[int, Within(Interval(ge=2, le=51), allowed="2 to 51")] = 12
    """number of layers of the lattice"""
    margin: NonNegative = 15.0
    """clearance of a leg above h_min [m]"""
    period: Positive = 2.5
    """time between two checks for changes [s]"""
    bandwidth: Positive = 0.8
    """bandwidth of the tracker [rad/s]"""


class RoadmapPlanner:
    """Answers with a flight along the roadmap, or with what is left of the plan being flown."""

    def __init__(self, config: RoadmapConfig, certificate: Certificate, knowledge: Knowledge) -> None:
        self.period = config.period
        self._config, self._certificate, self._knowledge = config, certificate, knowledge
        self._routes: Routes | None = None  # with what is known now
        self._settled = False  # whether the plan being flown was made with it

    def plan(self, request: PlanRequest) -> Plan:
        known = self._knowledge.updated_with(request.messages)
        if known is not self._knowledge:
            self._certificate = self._certificate.updated_with(request.messages)
            self._knowledge, self._routes, self._settled = known, None, False
        current = request.current
        if current is not None and self._settled:
            return remainder(current, request.t_start)
        began = time.thread_time()
        start = request.estimate.x if current is None else state_at(current, request.t_start)
        plan = self._along_the_roadmap(request.t_start, start)
        self._settled = plan.ok
        return dataclasses.replace(plan, solve_ms=1e3 * (time.thread_time() - began))

    def _along_the_roadmap(self, t: float, x: Array) -> Plan:
        c = self._certificate
        speed = float(np.linalg.norm(x[3:]))
        moving = speed > 1e-3
        ahead = x[:3] + ((speed + c.speed_max) / (2.0 * c.acceleration_max)) * x[3:]  # room for any turn
        corners = self._found().route(ahead)
        if corners is None:
            return Plan.failure(Status.INFEASIBLE, f"no way leads from {np.round(ahead).tolist()} m to the target")
        if moving:
            corners = np.vstack([x[:3], corners])
        speeds = np.full(len(corners) - 1, c.speed_max)
        if moving:
            speeds[0] = speed
        for _ in range(ATTEMPTS):
            speeds = fitting(corners, speeds, c.acceleration_max, moving)
            plan = flight(t, x, corners, speeds, c.acceleration_max, moving).plan(cost=math.nan, solve_ms=math.nan)
            refusal = c.check(plan)
            if refusal is None:
                return dataclasses.replace(plan, cost=plan.t_end - t)
            if refusal.status is not FlightStatus.LOW_CLEARANCE:
                break
            speeds[int(moving) :] *= SLOWER
        return Plan.failure(refusal.status, refusal.message)

    def _found(self) -> Routes:
        if self._routes is None:
            c, config = self._certificate, self._config
            still = Air(c.terrain, (), c.clearance_min, config.margin)
            air = dataclasses.replace(still, radars=self._knowledge.radars)
            grid = lattice(still, config.columns, config.layers)
            self._routes = Routes(air, grid, np.array(self._knowledge.target))
        return self._routes


class Roadmap:
    """Flies along the cheapest way over a lattice of clear legs, its corners rounded."""

    Config = RoadmapConfig

    @staticmethod
    def build(config: RoadmapConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        bound = tracking_bound(config.bandwidth, mission)
        planner = RoadmapPlanner(config, Certificate.for_mission(mission, bound), mission.knowledge)
        return planner, CriticallyDamped(mission.control_period, config.bandwidth, bound)
