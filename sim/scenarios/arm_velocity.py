"""``arm-velocity``: the joint velocities of a mechanism from its encoders, any that MuJoCo can load (thesis D.6).

The metric is the mass matrix of the observer's model; the plant may carry a load that the observer does not know.

Both are stepped by the timestep that the mechanism's file states, or by the longest whole fraction of it of which the
period of the readings is a whole number: never coarser, for a stiff servo may be stable at no other timestep. The first
keyframe of the file sets the start, the default command, and the initial activations and mocap bodies.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, ClassVar

import mujoco
import numpy as np
from annotated_types import Interval

from mathnavi.interfaces.bounds import ANEW, FINITE, FINITE_NUMBERS, configuration
from mathnavi.interfaces.errors import FieldError
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
_FINEST = 100  # whole fractions of a timestep that may be the tick
_SIX_DIGITS = 5e-6  # relative, by which a rate of six digits may be off


@configuration
class ArmVelocityConfig(LagrangianFields):
    """Fields of the scenario."""

    kernels: ClassVar[str] = "mathnavi.estimators.velocity.encoders_ahead"  # compiled before the first run

    tick: ClassVar[float | None] = None

    reading: PositionQuality = PositionQuality(resolution=14)
    """errors of the encoders"""
    rate: Annotated[float, ANEW, Interval(gt=0.0, le=1e5), FINITE] = 1000.0
    """rate of readings, estimates and commands [Hz], to six digits; its period has to be a whole number of timesteps of
    the mechanism's file, or of a whole fraction of it, down to a hundredth"""
    settled: float = 1.0
    """time from which errors count [s]"""
    mechanism: MechanismPlace = "two-link"
    """mechanism: rigid-body, cart-pendulum, two-link, seven-joint, servo-six, servo-seven, servo-gripper, swimmer,
    quadruped, dm_control:NAME of its suite, menagerie:NAME of MuJoCo Menagerie, or the path of an MJCF file"""
    load: Annotated[float, Interval(ge=0.01, le=100.0), FINITE] = 1.0
    """factor of the last link's true mass over the mass in the observer's model"""
    start: Annotated[NumberList, FINITE_NUMBERS] = ()
    """initial position and velocity, in the order of the state, (w, x, y, z) of a quaternion; those of the first
    keyframe, or qpos0 at rest, if not given"""


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
        model, real, period = _models(config)
        mission, truth = (_mission(config, each, period) for each in (model, real))
        stack = parts.stack(mission)
        start = checked_speed(_start(config, mission, model), mission)
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
    model, _, period = _models(config)
    return _mission(config, model, period)


def _mission(config: ArmVelocityConfig, model: mujoco.MjModel, period: float) -> LagrangianMission:
    return LagrangianMission(MechanismSystem(model), config.reading, period, config.speed_max)


def _models(config: ArmVelocityConfig) -> tuple[mujoco.MjModel, mujoco.MjModel, float]:
    """Model of the observer, the true model, and the time [s] between readings."""
    own_file = Path(config.mechanism).is_file()  # which may have changed since
    return (_built.__wrapped__ if own_file else _built)(config.mechanism, config.load, config.rate)


@lru_cache(maxsize=4)
def _built(mechanism: str, load: float, rate: float) -> tuple[mujoco.MjModel, mujoco.MjModel, float]:
    model = build_model(mechanism, name=VEHICLE)
    model.opt.timestep, period = clock(model.opt.timestep, rate)
    return model, heavier(model, load), period


def clock(timestep: float, rate: float) -> tuple[float, float]:
    """Tick [s] of the physics and period [s] of readings at a ``rate`` [Hz], a whole number of ticks.

    The tick is the ``timestep`` [s] of a file, or the longest whole fraction of it that allows this rate. Raises
    FieldError for a rate that none allows, down to a hundredth of the timestep.
    """
    for parts in range(1, _FINEST + 1):
        tick = timestep / parts
        count = round(1.0 / (rate * tick))
        if count >= 1 and abs(count * tick * rate - 1.0) <= _SIX_DIGITS:
            return tick, count * tick
    steps = rate * timestep  # readings in one of the file's timesteps
    near = min(_FINEST, round(steps)) / timestep if steps > 1.0 else 1.0 / (round(1.0 / steps) * timestep)
    raise FieldError(
        f"rate = {rate!r}; allowed: one whose period is a whole number of timesteps of the mechanism's file, "
        f"{timestep:g} s, or of a whole fraction of it, down to a hundredth; the nearest is {near:.6g} Hz"
    )


def _start(config: ArmVelocityConfig, mission: LagrangianMission, model: mujoco.MjModel) -> Array:
    """Initial state (nx,)."""
    if config.start:
        return given_start(config.start, mission)
    return np.concatenate([mission.system.manifold.origin, model.key_qvel[0] if model.nkey else np.zeros(model.nv)])
