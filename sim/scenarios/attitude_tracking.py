"""``attitude-tracking``: a rigid body follows a reference attitude without a gyro (thesis, further research).

The observer of Paper D tells the rates from attitudes alone, and intrinsic tracking closes the loop on S^3.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Annotated

import numpy as np
from annotated_types import Interval, Le

from mathnavi.controllers.intrinsic.attitude import AttitudeReference, AttitudeTrackingConfig
from mathnavi.models.manifold.constant_curvature import sphere
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.sensors import PositionQuality
from mathnavi.models.manifold.systems import RigidBody
from mathnavi.sim.interfaces.bounds import FINITE, NonNegative, Positive, configuration
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.lagrangian import tracking_figures
from mathnavi.sim.plugin.registry import PluginSpec, checked_sensors, load
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.lagrangian import LagrangianFields, Loop, checked_speed, velocity_errors
from mathnavi.sim.scenarios.requirements import Requirement
from mathnavi.sim.scenarios.sphere_observer import rigid_body_plant
from mathnavi.sim.scenarios.task import Look, StageCost

VEHICLE = "body"


@configuration
class AttitudeTrackingFields(LagrangianFields):
    """Fields of the scenario."""

    reading: PositionQuality = field(default_factory=lambda: PositionQuality(noise=0.005))
    """how the attitude errs"""
    rate: float = 500.0
    """readings, estimates and commands a second [Hz]"""
    settled: float = 5.0
    """from when on errors count [s]"""
    tolerance: float = 0.5
    """root mean square of the rate's error after that [rad/s]"""
    speed: Annotated[NonNegative, Le(100.0)] = 0.0
    """at the start [rad/s]; attitude and axis are drawn"""
    inertia: Annotated[float, Interval(ge=1e-6, le=1e6), FINITE] = 0.05
    """of the body [kg m^2]"""
    attitude_tolerance: Annotated[Positive, Le(10.0)] = 0.1
    """root mean square of the angle to the reference after that [rad]"""


class AttitudeTrackingScenario:
    """A rigid body follows a reference attitude without a gyro."""

    Config = AttitudeTrackingFields
    controller = "attitude_tracking"
    estimator = "riemannian_observer"

    @staticmethod
    def build(
        config: AttitudeTrackingFields,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """The closed loop of one seed, from an attitude that is uniform among all."""
        controller = controller or PluginSpec.of(load("controllers", AttitudeTrackingScenario.controller))
        estimator = estimator or PluginSpec.of(load("estimators", AttitudeTrackingScenario.estimator))
        mission = _mission(config)
        draws, noise = np.random.default_rng(seed).spawn(2)
        axis = draws.standard_normal(3)
        start = np.concatenate([sphere(3).draw(draws), config.speed * axis / np.linalg.norm(axis)])
        start = checked_speed(start, mission)
        plant = rigid_body_plant(VEHICLE, start, checked_sensors(estimator, mission), config.inertia, noise)
        requirement = Requirement("attitude_rms_rad", most=config.attitude_tolerance)
        loop = Loop(
            "attitude-tracking", VEHICLE, plant, mission, mission, {"space": "body"}, tracking_figures, (requirement,),
            cost=_angle_to_reference(controller, mission),
        )  # fmt: skip
        return loop.closed_loop(config, seed, controller, estimator)

    @staticmethod
    def errors(config: AttitudeTrackingFields, x: Array, truth: Array) -> dict[str, Array]:
        """The errors of estimates (n, nx), named with their units."""
        return velocity_errors(_mission(config), x, truth)


def _angle_to_reference(controller: PluginSpec, mission: LagrangianMission) -> StageCost | None:
    """L = theta^2 at the end of a step, theta [rad] the angle to the reference; None where the controller has none."""
    tracking, manifold = controller.config, mission.system.manifold
    if not isinstance(tracking, AttitudeTrackingConfig):
        return None
    reference = AttitudeReference(tracking.rate, tracking.frequency, mission.period)

    def cost(begin: Look, end: Look, commands: Mapping[str, Array]) -> float:
        wanted = reference.state(round(end.t / mission.period))
        angle = 2.0 * manifold.distance(end.truths[VEHICLE][: manifold.size], wanted[: manifold.size])
        return float(angle * angle) * (end.t - begin.t)

    return cost


def _mission(config: AttitudeTrackingFields) -> LagrangianMission:
    return LagrangianMission(RigidBody(config.inertia), config.reading, config.period, config.speed_max)
