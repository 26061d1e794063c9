"""``sphere-observer``: the velocity of a motion on a curved space, from its position alone (D.5).

body               a rigid body on a ball joint in MuJoCo: attitudes, S^3
sphere             a point on S^3 as an ODE, under the force of the example in D.5 or a potential
hyperbolic-plane   a point on H^2 as an ODE, in a bowl
"""

from __future__ import annotations

from functools import lru_cache
from typing import Annotated, ClassVar, Literal

import mujoco
import numpy as np
from annotated_types import Interval, Le

from mathnavi.interfaces.bounds import FINITE, FINITE_NUMBERS, NonNegative, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import NumberList
from mathnavi.interfaces.protocols import Plant, Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import hyperbolic_space, sphere
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.manifold.systems import PointSystem, RigidBody, linear, printed
from mathnavi.models.mechanism.entity import build_spec
from mathnavi.sim.engine.ode_plant import OdePlant, OdeVehicle
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.missions import SpaceRecord
from mathnavi.sim.scenarios.assembler import Assembler
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.lagrangian import (
    TICK,
    LagrangianCase,
    LagrangianFields,
    checked_speed,
    given_start,
    observed_loop,
    period_of,
    recorded_as,
    velocity_errors,
)

VEHICLE = "body"
SpaceName = Literal["body", "sphere", "hyperbolic-plane"]
ForceName = Literal["by-space", "none", "linear", "printed"]

_FASTEST = 100.0  # [rad/s, 1/s]
_STRONGEST = 1e4  # [1/s^2]
Inertia = Annotated[float, Interval(ge=1e-6, le=1e6), FINITE]


@configuration
class SphereObserverConfig(LagrangianFields):
    """Fields of the scenario."""

    kernels: ClassVar[str] = "mathnavi.estimators.velocity.attitudes_ahead"  # compiled before the first run

    reading: PositionQuality = PositionQuality(noise=0.01)
    """errors of the position readings"""
    space: SpaceName = "body"
    """system: a rigid body in MuJoCo, a point on S^3 (sphere), or a point on the hyperbolic plane"""
    force: ForceName = "by-space"
    """force on a point: none, that of the potential c p_0 (linear), or that of the example in D.5 (printed); by-space:
    linear on the hyperbolic plane, where a free point escapes, and otherwise none"""
    strength: Annotated[float, Interval(ge=-_STRONGEST, le=_STRONGEST), FINITE] = 1.0
    """strength c of the linear potential [1/s^2]"""
    speed: Annotated[NonNegative, Le(_FASTEST)] = 6.0
    """initial speed, |omega| [rad/s] of a body or |v| [1/s] of a point; position and direction are drawn"""
    start: Annotated[NumberList, FINITE_NUMBERS] = ()
    """initial position and velocity, in the order of the state; drawn if not given"""
    inertia: Inertia = 0.05
    """moment of inertia of the body about every axis [kg m^2]"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.force == "printed" and self.space != "sphere":
            raise FieldError(f"force = 'printed' with space = {self.space!r}; allowed: with space = sphere")
        if self.force not in ("by-space", "none") and self.space == "body":
            raise FieldError(f"force = {self.force!r} with space = 'body'; allowed: none, its torques are its input")


class SphereObserver:
    """The velocity of a motion on a curved space, from its position alone."""

    Config = SphereObserverConfig
    name = "sphere-observer"
    drawing = "mathnavi.renders.lagrangian.drawing"
    controller = "input_signal"
    estimator = "riemannian_observer"
    streams = ("draws", "sensing")

    @staticmethod
    def build(
        config: SphereObserverConfig,
        seed: int,
        controller: PluginSpec | None = None,
        estimator: PluginSpec | None = None,
    ) -> ClosedLoop:
        """Closed loop of one seed. Raises ValueError for a start off the space."""
        parts = Assembler.for_scenario(SphereObserver, config, seed, controller, estimator)
        mission = config_mission(config)
        stack, noise = parts.stack(mission), parts.streams["sensing"]
        start = checked_speed(_start(config, mission, parts.streams["draws"]), mission)
        plant: Plant
        if isinstance(mission.system, PointSystem):
            plant = OdePlant({VEHICLE: OdeVehicle(mission.system, start, stack.sensors)}, TICK, noise)
        else:
            plant = rigid_body_plant(VEHICLE, start, stack.sensors, config.inertia, noise)
        record = SpaceRecord(**recorded_as(mission, config), space=config.space)
        return observed_loop(parts, LagrangianCase(VEHICLE, plant, stack, mission, mission, record))

    @staticmethod
    def errors(config: SphereObserverConfig, x: Array, truth: Array) -> dict[str, Array]:
        """Errors of estimates (n, nx), named with their units."""
        return velocity_errors(config_mission(config), x, truth)


def config_mission(config: SphereObserverConfig) -> LagrangianMission:
    """Mission of the observer."""
    if config.space == "body":
        system: PointSystem | RigidBody = RigidBody(config.inertia)
    else:
        space = sphere(3) if config.space == "sphere" else hyperbolic_space(2)
        potentials = {"none": linear(0.0, 0), "linear": linear(config.strength, 0), "printed": printed}
        usual = "linear" if config.space == "hyperbolic-plane" else "none"
        system = PointSystem(space, potentials[usual if config.force == "by-space" else config.force])
    return LagrangianMission(system, config.reading, period_of(config), config.speed_max)


def _start(config: SphereObserverConfig, mission: LagrangianMission, rng: np.random.Generator) -> Array:
    """Initial state (nx,); if it is not given, position and direction of the velocity are drawn."""
    system = mission.system
    if config.start:
        return given_start(config.start, mission)
    if isinstance(system, PointSystem):
        position = system.manifold.draw(rng)
        return system.state(position, config.speed * system.manifold.draw_vector(rng, position))
    position, axis = sphere(3).draw(rng), rng.standard_normal(3)
    return np.concatenate([position, config.speed * axis / np.linalg.norm(axis)])


def rigid_body_plant(
    name: str,
    start: Array,
    sensors: tuple[Sensor, ...],
    inertia: float | tuple[float, ...],
    rng: np.random.Generator,
) -> MujocoPlant:
    """Plant of the rigid body in MuJoCo, with the inertia [kg m^2] about every axis, or about each of its three."""
    return MujocoPlant(rigid_body(name, inertia), {name: VehicleSetup(start, sensors)}, rng)


@lru_cache(maxsize=4)
def rigid_body(name: str, inertia: float | tuple[float, ...]) -> mujoco.MjModel:
    """MuJoCo model of the rigid body, with the inertia [kg m^2] about every axis, or about each of its three."""
    spec = build_spec("rigid-body", name=name)
    spec.body(f"{name}/body").inertia = inertia if isinstance(inertia, tuple) else (inertia, inertia, inertia)
    return spec.compile()
