"""``arm-velocity``: the joint velocities of a mechanism from its encoders, any that MuJoCo can load (thesis D.6).

The metric is the mass matrix of the observer's model; the plant may carry a load that the observer does not know.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, ClassVar

import mujoco
import numpy as np
from annotated_types import Interval

from mathnavi.interfaces.bounds import FINITE, FINITE_NUMBERS, configuration
from mathnavi.interfaces.field_table import NumberList
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import MechanismPlace, build_model, place_of
from mathnavi.models.mechanism.system import MechanismSystem, heavier
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.missions import MechanismRecord
from mathnavi.sim.scenarios.assembler import Assembler
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.lagrangian import (
    TICK,
    LagrangianCase,
    LagrangianFields,
    checked_speed,
    given_start,
    observed_loop,
    recorded_as,
    velocity_errors,
)
from mathnavi.sim.scenarios.task import Inputs

VEHICLE = "mechanism"


@configuration
class ArmVelocityConfig(LagrangianFields):
    """Fields of the scenario."""

    kernels: ClassVar[str] = "mathnavi.models.mechanism.forces"  # compiled before the first run

    reading: PositionQuality = PositionQuality(resolution=14)
    """errors of the encoders"""
    settled: float = 1.0
    """time from which errors count [s]"""
    mechanism: MechanismPlace = "two-link"
    """mechanism: rigid-body, cart-pendulum, two-link, seven-joint, servo-six, servo-seven, servo-gripper, swimmer,
    quadruped, dm_control:NAME of its suite, menagerie:NAME of MuJoCo Menagerie, or the path of an MJCF file"""
    load: Annotated[float, Interval(ge=0.01, le=100.0), FINITE] = 1.0
    """factor of the last link's true mass over the mass in the observer's model"""
    start: Annotated[NumberList, FINITE_NUMBERS] = ()
    """initial position and velocity, in the order of the state; the first keyframe or qpos0, at rest, if not given"""


class ArmVelocity:
    """The joint velocities of a mechanism from its encoders."""

    Config = ArmVelocityConfig
    name = "arm-velocity"
    drawing = "mathnavi.renders.lagrangian.drawing"
    controller = "joint_tracking"
    estimator = "riemannian_observer"

    @staticmethod
    def build(
        config: ArmVelocityConfig, seed: int, controller: PluginSpec | None = None, estimator: PluginSpec | None = None
    ) -> ClosedLoop:
        """The closed loop of one seed. Raises ValueError unless its joints are slides, hinges, balls."""
        parts = Assembler.for_scenario(ArmVelocity, config, seed, controller, estimator)
        model, real = _models(config)
        mission, truth = (
            LagrangianMission(MechanismSystem(each), config.reading, config.period, config.speed_max)
            for each in (model, real)
        )
        stack = parts.stack(mission)
        start = checked_speed(_start(config, mission), mission)
        plant = MujocoPlant(real, {VEHICLE: VehicleSetup(start, stack.sensors)}, parts.streams.root)
        placed = replace(config, mechanism=place_of(config.mechanism))
        record = MechanismRecord(**recorded_as(truth, config), mechanism=placed.mechanism)
        bounds = np.where(real.actuator_ctrllimited[:, None], real.actuator_ctrlrange, (-np.inf, np.inf))
        inputs = Inputs(tuple(mission.system.inputs), *bounds.T)
        case = LagrangianCase(VEHICLE, plant, stack, mission, truth, record, inputs=inputs, resolved=placed)
        return observed_loop(parts, case)

    @staticmethod
    def errors(config: ArmVelocityConfig, x: Array, truth: Array) -> dict[str, Array]:
        """Errors of estimates (n, nx), named with their units."""
        return velocity_errors(believed(config), x, truth)


def believed(config: ArmVelocityConfig) -> LagrangianMission:
    """Mission of the observer, which does not know the load."""
    return LagrangianMission(MechanismSystem(_models(config)[0]), config.reading, config.period, config.speed_max)


def _models(config: ArmVelocityConfig) -> tuple[mujoco.MjModel, mujoco.MjModel]:
    """Model of the observer, and the true model."""
    own_file = Path(config.mechanism).is_file()  # which may have changed since
    return (_built.__wrapped__ if own_file else _built)(config.mechanism, config.load)


@lru_cache(maxsize=4)
def _built(mechanism: str, load: float) -> tuple[mujoco.MjModel, mujoco.MjModel]:
    model = build_model(mechanism, name=VEHICLE)
    model.opt.timestep = TICK
    return model, heavier(model, load)


def _start(config: ArmVelocityConfig, mission: LagrangianMission) -> Array:
    """Initial state (nx,)."""
    manifold = mission.system.manifold
    if not config.start:
        return np.concatenate([manifold.origin, np.zeros(manifold.vector_size)])
    return given_start(config.start, mission)
