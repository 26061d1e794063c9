"""``attitude-tracking``: a rigid body follows a reference attitude without a gyro (thesis, further research).

The observer of Paper D finds the rates from attitudes alone, and intrinsic tracking closes the loop on S^3.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np

from mathnavi.controllers.intrinsic.references import AttitudeReference, AttitudeTrackingConfig
from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import FINITE_NUMBERS, configuration
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import NumberList
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.attitude import Attitude
from mathnavi.models.manifold.constant_curvature import sphere
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.manifold.system import LagrangianSystem
from mathnavi.models.manifold.systems import RigidBody
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.metrics.lagrangian import tracking_figures
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.missions import SpaceRecord
from mathnavi.sim.scenarios.assembler import Assembler
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.lagrangian import (
    LagrangianCase,
    LagrangianFields,
    checked_speed,
    observed_loop,
    period_of,
    recorded_as,
    velocity_errors,
)
from mathnavi.sim.scenarios.requirements import Requirement
from mathnavi.sim.scenarios.sphere_observer import Inertia, SphereObserverConfig, rigid_body, rigid_body_plant
from mathnavi.sim.scenarios.task import Sample, StageCost

VEHICLE = "body"


@configuration
class AttitudeTrackingFields(LagrangianFields):
    """Fields of the scenario."""

    kernels: ClassVar[str] = "mathnavi.estimators.velocity.attitudes_ahead"  # compiled before the first run

    reading: PositionQuality = PositionQuality(noise=0.005)
    """errors of the attitude readings"""
    rate: float = 500.0
    """rate of readings, estimates and commands [Hz]"""
    settled: float = 5.0
    """time from which errors count [s]"""
    tolerance: float = 0.5
    """largest root mean square error of the rate, after settled, that counts as converged [rad/s]"""
    speed: Annotated[float, Radians(0.0, 100.0, unit="rad/s")] = 0.0
    """initial rate of rotation [rad/s]; attitude and axis are drawn"""
    inertia: Inertia = SphereObserverConfig.inertia
    """moment of inertia of the body about every axis [kg m^2]"""
    principal_inertia: Annotated[NumberList, FINITE_NUMBERS] = ()
    """moments of inertia about the three axes [kg m^2], in place of inertia; none greater than the sum of the others"""
    attitude_tolerance: Annotated[float, Radians(0.0, math.pi, open_low=True)] = 0.1
    """largest root mean square angle to the reference after settled [rad]"""

    def __post_init__(self) -> None:
        LagrangianFields.__post_init__(self)
        moments = self.principal_inertia
        for value in moments:
            check(value, "principal_inertia", 1e-6, 1e6)
        if moments and (len(moments) != 3 or 2.0 * max(moments) > sum(moments)):
            raise FieldError(
                f"principal_inertia = {moments!r}; allowed: three moments, none greater than the sum of the others"
            )

    @property
    def moments(self) -> float | tuple[float, ...]:
        """Inertia [kg m^2] about every axis, or about each."""
        return tuple(self.principal_inertia) or self.inertia


class AttitudeTrackingScenario:
    """A rigid body follows a reference attitude without a gyro."""

    Config = AttitudeTrackingFields
    name = "attitude-tracking"
    drawing = "mathnavi.renders.lagrangian.drawing"
    controller = "attitude_tracking"
    estimator = "riemannian_observer"
    streams = ("draws", "sensing")

    @staticmethod
    def build(
        config: AttitudeTrackingFields,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """Closed loop of one seed, from an attitude drawn uniformly."""
        parts = Assembler.for_scenario(AttitudeTrackingScenario, config, seed, controller, estimator)
        mission = _mission(config)
        start = checked_speed(_drawn_start(config, parts.streams["draws"]), mission)
        stack = parts.stack(mission)
        plant = rigid_body_plant(VEHICLE, start, stack.sensors, config.moments, parts.streams["sensing"])
        record = SpaceRecord(**recorded_as(mission, config), space="body")
        requirement = Requirement("attitude_rms_rad", most=config.attitude_tolerance)
        cost = _angle_to_reference(parts.controller, mission)
        return observed_loop(
            parts,
            LagrangianCase(
                VEHICLE,
                plant,
                stack,
                mission,
                mission,
                record,
                tracking_figures,
                (requirement,),
                cost=cost,
                cost_max=math.pi**2,
            ),
        )

    @staticmethod
    def errors(config: AttitudeTrackingFields, x: Array, truth: Array) -> dict[str, Array]:
        """Errors of estimates (n, nx), named with their units."""
        return velocity_errors(_mission(config), x, truth)


def _angle_to_reference(controller: PluginSpec, mission: LagrangianMission) -> StageCost | None:
    """Stage cost L = theta^2 at the end of a step, theta [rad] the angle to the reference; None without a reference."""
    tracking, manifold = controller.config, Attitude()
    if not isinstance(tracking, AttitudeTrackingConfig):
        return None
    reference = AttitudeReference(tracking.rate, tracking.frequency, mission.period)

    def cost(begin: Sample, end: Sample, commands: Mapping[str, Array]) -> float:
        wanted = reference.state(round(end.t / mission.period))
        angle = 2.0 * manifold.distance(end.truths[VEHICLE][: manifold.size], wanted[: manifold.size])
        return float(angle * angle) * (end.t - begin.t)

    return cost


def _drawn_start(config: AttitudeTrackingFields, rng: np.random.Generator) -> Array:
    """Initial state (7,): an attitude drawn uniformly, and the given rate about an axis drawn uniformly."""
    axis = rng.standard_normal(3)
    return np.concatenate([sphere(3).draw(rng), config.speed * axis / np.linalg.norm(axis)])


def _mission(config: AttitudeTrackingFields) -> LagrangianMission:
    system: LagrangianSystem = RigidBody(config.inertia)
    if config.principal_inertia:
        system = MechanismSystem(rigid_body(VEHICLE, config.moments))
    return LagrangianMission(system, config.reading, period_of(config), config.speed_max)
