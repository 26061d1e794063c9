"""Shared by the missile's tests: a controller that needs no solver, and short ways to fly it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import OPTIMISED, Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.missile.mission import MissileMission, Target
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.missile_fields import MissileGuidanceConfig
from mathnavi.sim.scenarios.missile_guidance import MissileGuidance

ARC = 0.02  # [s] of a plan
SOONEST = 0.4  # [s] before the end a plan still makes sense


@dataclass(frozen=True)
class GlideConfig:
    """Fields of the command line."""

    period: float = 0.5  # [s] of the planner
    omega: float = 8.0  # [rad/s] of the autopilot; 0: no feedback
    reach: float = 1e9  # [m] beyond which it finds no plan


class Glide:
    """Cubic paths with the nose along the velocity, flown by feedback linearisation."""

    Config = GlideConfig

    @staticmethod
    def build(config: GlideConfig, mission: MissileMission) -> tuple[GlidePlanner, GlideTracker]:
        return GlidePlanner(config, mission), GlideTracker(config, mission)


class GlidePlanner:
    """From the plan being flown to where the target will be, as far as it has been announced."""

    def __init__(self, config: GlideConfig, mission: MissileMission) -> None:
        self.period = config.period
        self._mission, self._target, self._reach = mission, mission.target, config.reach
        self._end = 0.0  # [s]

    def plan(self, request: PlanRequest) -> Plan:
        coordinates, speed = self._mission.coordinates, self._mission.case.speed
        for message in request.messages:
            if message.topic == "target" and isinstance(message.payload, Target):
                self._target = message.payload
        x = coordinates.state_at(request.current, request.t_start) if request.current else request.estimate.x
        if request.current is None:
            distance = float(np.linalg.norm(self._target.at(request.t_start) - coordinates.place(x)))
            if distance > self._reach:
                return Plan.failure(Status.INFEASIBLE, f"{distance:.0f} m is too far")
            self._end = request.t_start + round(1.3 * distance / speed / ARC) * ARC
        left = self._end - request.t_start
        if left < SOONEST:
            return Plan.failure(Status.INFEASIBLE, f"{left:.2f} s before the end is too late")
        edges = np.linspace(0.0, left, max(2, round(left / ARC)) + 1)
        states, _ = self._path(x, request.t_start, left, edges)
        middles, accelerations = self._path(x, request.t_start, left, 0.5 * (edges[:-1] + edges[1:]))
        states[0] = x
        u = coordinates.inverse_dynamics(middles, accelerations)
        phase = np.full(len(u), OPTIMISED)
        return Plan(request.t_start + edges, states, u, phase, cost=left, solve_ms=0.1)

    def _path(self, x: Array, t: float, left: float, s: Array) -> tuple[Array, Array]:
        """States (n, nx) and joint accelerations (n, nj) at times s (n,) after t."""
        coordinates = self._mission.coordinates
        p0, v0 = coordinates.place(x), coordinates.velocity(x)
        p1 = self._target.at(t + left)
        v1 = self._mission.case.speed * self._mission.final_direction
        step = 1e-4 * left

        def joints(at: Array) -> Array:
            z = (at / left)[:, None]
            path = (
                p0 * (1 - 3 * z**2 + 2 * z**3) + left * v0 * (z - 2 * z**2 + z**3)
                + p1 * (3 * z**2 - 2 * z**3) + left * v1 * (z**3 - z**2)
            )  # fmt: skip
            pace = 6.0 / left * (p1 - p0) * (z - z**2) + v0 * (1 - 4 * z + 3 * z**2) + v1 * (3 * z**2 - 2 * z)
            theta = np.arctan2(-pace[:, 2], pace[:, 0])
            psi = np.arctan2(pace[:, 1], np.hypot(pace[:, 0], pace[:, 2]))
            every = {"x": path[:, 0], "y": -path[:, 1], "z": -path[:, 2], "theta": theta, "psi": psi}
            return np.column_stack([every[name] for name in coordinates.joints])

        before, now, after = joints(s - step), joints(s), joints(s + step)
        rates = (after - before) / (2.0 * step)
        accelerations: Array = (after - 2.0 * now + before) / step**2
        return coordinates.from_joints(np.hstack([now, rates])), accelerations


class GlideTracker:
    """Joint accelerations of the plan, and what brings the missile back to it."""

    def __init__(self, config: GlideConfig, mission: MissileMission) -> None:
        self.period = mission.control_period
        self._coordinates, self._omega = mission.coordinates, config.omega

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        coordinates, omega = self._coordinates, self._omega
        u = coordinates.input_at(plan, t + 0.5 * self.period)
        if omega == 0.0:
            return u
        x = coordinates.state_at(plan, t)
        wanted, there = coordinates.to_joints(x), coordinates.to_joints(estimate.x)
        q, v = np.split(wanted - there, 2)
        a = coordinates.joint_acceleration(x, u) + 2.0 * omega * v + omega**2 * q
        return coordinates.inverse_dynamics(estimate.x, a)


def glide(**fields: Any) -> PluginSpec:
    """The controller as a part of a scenario."""
    return PluginSpec.with_fields(Glide, **fields)


def fly(
    seed: int = 0, controller: PluginSpec | None = None, estimator: PluginSpec | None = None, **fields: Any
) -> RunData:
    """A mission flown by ``Glide`` unless another controller is given."""
    config = MissileGuidanceConfig(**fields)
    return MissileGuidance.build(config, seed, controller or glide(), estimator).run()
