"""Shared by the tests of the unicycle: a robot in a plant of its own, and its readings without physics."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve, ellipse
from mathnavi.models.unicycle.beacons import BeaconMission
from mathnavi.models.unicycle.entity import FLOOR, DriveName, build_model
from mathnavi.models.unicycle.kernels import rays_at
from mathnavi.models.unicycle.mission import DifferentialDrive, IdealDrive, RangingMission, wheel_rates
from mathnavi.sim.engine.plant import MujocoPlant, VehicleSetup

STANDARD = ellipse(3.763, math.sqrt(2.0))


def plant_of(
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    drive: DriveName = "ideal",
    friction: float = 1.0,
    *,
    curve: Curve = STANDARD,
    angles: tuple[float, ...] = (0.0,),
    sensors: tuple[Sensor, ...] = (),
    seed: int = 0,
) -> MujocoPlant:
    """A robot called "robot" at a pose [m, m, rad], at rest."""
    model = _model(curve, angles, drive, friction)
    state = np.zeros(2 * model.nq)
    state[:3] = start
    ideal = drive == "ideal"
    setup = VehicleSetup(
        state, sensors, drive=IdealDrive() if ideal else DifferentialDrive(), ignored_contacts=() if ideal else (FLOOR,)
    )
    return MujocoPlant(model, {"robot": setup}, np.random.default_rng(seed))


@cache
def _model(curve: Curve, angles: tuple[float, ...], drive: DriveName, friction: float) -> Any:
    return build_model(curve, rays_at(angles), drive, friction)


@dataclass
class Imagined:
    """A ``mathnavi.interfaces.protocols.StateView`` of a unicycle: what its sensors would see, without physics."""

    mission: RangingMission | BeaconMission
    x: Array  # (3,) pose
    acceleration: Array = field(default_factory=lambda: np.zeros(3))
    wheels: Array = field(default_factory=lambda: np.zeros(2))  # [rad] left and right

    def moved(self, u: Array, dt: float) -> Imagined:
        """After an input (2,) was held for dt [s]."""
        x = self.mission.flow(self.x, u, dt)
        return Imagined(self.mission, x, self.acceleration, self.wheels + wheel_rates(u) * dt)

    def sensed(self, name: str) -> Array:
        if name.startswith("range_"):
            rho = self.mission.ranges(self.x)
            i = int(name.removeprefix("range_"))
            return rho[i : i + 1]
        return self.wheels[["wheel_left", "wheel_right"].index(name), None]
