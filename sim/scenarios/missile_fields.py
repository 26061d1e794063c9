"""The fields of ``missile-guidance``. Points and vectors are in the frame of the world: x ahead, y left, z up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.missile.dynamics import TICK
from mathnavi.sim.engine.faults import ConstantWrench, Disturbance, Gusts
from mathnavi.sim.interfaces.checks import check, check_rate
from mathnavi.sim.interfaces.errors import FieldError, MissionError
from mathnavi.sim.scenarios.fault_fields import EveryFlightFaults, Fault, LostReadings

Point = tuple[float, float, float]

_LARGEST = 1e6  # of any field in SI units


@dataclass(frozen=True)
class MissileMismatch:
    """The true missile over the declared one."""

    mass: float = 1.0
    """factor of the mass"""
    inertia: float = 1.0
    """factor of the moments of inertia"""
    force: float = 1.0
    """factor of what the thrusters give as a force"""
    moment: float = 1.0
    """factor of what they give as a moment"""

    def __post_init__(self) -> None:
        for name in ("mass", "inertia", "force", "moment"):
            check(getattr(self, name), f"mismatch.{name}", 0.1, 10.0)


@dataclass(frozen=True)
class MissileGust(Fault):
    """Forces and torques on the missile beside its thrusters, in the frame of the world."""

    stream: ClassVar[str] = "gusts"

    force: Point = (0.0, 0.0, 0.0)
    """constant force [N]"""
    torque: Point = (0.0, 0.0, 0.0)
    """constant torque [N m]; one about y turns the nose down"""
    force_rms: float = 0.0
    """of the random force on each axis [N]"""
    torque_rms: float = 0.0
    """of the random torque about each axis [N m]"""
    time_constant: float = 1.0
    """of both random ones' first-order model [s]"""
    force_limit: float = 2000.0
    """largest random force [N]"""
    torque_limit: float = 200.0
    """largest random torque [N m]"""

    def check_fields(self) -> None:
        for name in ("force", "torque"):
            _check_point(getattr(self, name), f"gust.{name}")
        for name in ("force_rms", "torque_rms"):
            check(getattr(self, name), f"gust.{name}", 0.0, _LARGEST)
        check(self.time_constant, "gust.time_constant", TICK, _LARGEST)
        for name in ("force_limit", "torque_limit"):
            check(getattr(self, name), f"gust.{name}", 0.0, _LARGEST, open_low=True)

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        """The constant ones and the random ones, where there are any, whatever the mass."""
        acting: list[Disturbance] = []
        if any(self.force) or any(self.torque):
            acting.append(ConstantWrench(self.force, self.torque))
        if self.force_rms > 0.0 or self.torque_rms > 0.0:
            strength = (self.force_rms, self.time_constant, self.force_limit)
            acting.append(Gusts(*strength, rng, moment_rms=self.torque_rms, moment_limit=self.torque_limit))
        return acting


@dataclass(frozen=True)
class Thrusters:
    """Limits of the thrusters, known to the controller, and how late they are, which is not."""

    axial: float = 20_000.0
    """largest force along the missile [N]"""
    normal: float = 60_000.0
    """largest force on each axis across it [N]"""
    moment: float = 3_000.0
    """largest moment about each axis across it [N m]"""
    delay: float = 0.0
    """from a command to what the thrusters do [s], whole milliseconds"""

    def __post_init__(self) -> None:
        for name in ("axial", "normal", "moment"):
            check(getattr(self, name), f"actuator.{name}", 0.0, 1e9, open_low=True)
        check(self.delay, "actuator.delay", 0.0, 1.0)
        if abs(self.delay / TICK - round(self.delay / TICK)) > 1e-6:
            raise ValueError(f"actuator.delay = {self.delay!r}; allowed: a whole number of physics ticks of {TICK:g} s")

    def limits(self, coordinates: Coordinates) -> tuple[float, ...]:
        """(nu,) on the magnitude of each input."""
        by_input = {"F_x": self.axial, "F_y": self.normal, "F_z": self.normal, "M": self.moment, "N": self.moment}
        return tuple(by_input[name] for name in coordinates.inputs)


@dataclass(frozen=True)
class ReadingErrors:
    """Standard deviations on each axis of the readings of the state."""

    position: float = 0.0
    """[m]"""
    velocity: float = 0.0
    """[m/s], along the axes of the body"""
    angle: float = 0.0
    """[deg]"""
    rate: float = 0.0
    """of the angular velocity [deg/s]"""


@dataclass(frozen=True)
class MissileNoise(LostReadings, ReadingErrors):
    """Errors of the readings of the state: standard deviations on each axis, and losses."""

    group: ClassVar[str] = "noise"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("position", "velocity", "angle", "rate"):
            check(getattr(self, name), f"noise.{name}", 0.0, _LARGEST)


@dataclass(frozen=True)
class MissileFaults(EveryFlightFaults):
    """Faults of a missile."""

    largest: ClassVar[float] = _LARGEST

    late_plan_latency: float = 1.0
    """simulated time that a late answer takes [s]"""


@dataclass(frozen=True)
class MissileGuidanceConfig:
    """Fields of the scenario."""

    case: Literal["SM", "SM2", "SM3", "FAST"] = "SM"
    """the problem that is optimised: speed at the start and weights of the cost"""
    dimension: Literal["planar", "spatial"] = "planar"
    """the pitch plane, as the thesis has it, or space"""
    start: Point = (0.0, 0.0, 10.0)
    """x, y, z [m]"""
    start_heading: float = 0.0
    """of the level start, from x to the left [deg]"""
    target: Point = (700.0, 0.0, 0.0)
    """x, y, z [m]"""
    target_velocity: Point = (0.0, 0.0, 0.0)
    """[m/s]"""
    target_change: tuple[tuple[float, float, float, float], ...] = ()
    """TIME VX VY VZ [s, m/s]: a velocity that the target takes up later; may be given several times"""
    target_told: float = 0.0
    """how long after the target has taken up a velocity the planner is informed of it [s]"""
    aspect_angle: float = -90.0
    """of the nose and the velocity at the target over the horizontal [deg]"""
    miss_allowed: float = 1.0
    """how near to the target counts as a hit [m]"""
    aspect_allowed: float = 2.0
    """largest angle between the nose and the aspect angle then [deg]"""
    control_rate: float = 250.0
    """of estimator, autopilot and log [Hz]; the physics runs at 1 kHz"""
    mismatch: MissileMismatch = field(default_factory=MissileMismatch)
    gust: MissileGust = field(default_factory=MissileGust)
    actuator: Thrusters = field(default_factory=Thrusters)
    noise: MissileNoise = field(default_factory=MissileNoise)
    faults: MissileFaults = field(default_factory=MissileFaults)

    def __post_init__(self) -> None:
        for name in ("start", "target", "target_velocity"):
            _check_point(getattr(self, name), name)
        for change in self.target_change:
            _check_point(change[1:], "target_change")
            check(change[0], "target_change", 0.0, _LARGEST, open_low=True)
        for name in ("start", "target"):
            check(getattr(self, name)[2], f"{name}: its height z", 0.0, _LARGEST)
        if math.dist(self.start, self.target) <= self.miss_allowed:
            raise MissionError(f"target = {self.target!r} is where the missile starts; allowed: another place")
        check(self.start_heading, "start_heading", -80.0, 80.0)
        check(self.aspect_angle, "aspect_angle", -90.0, 90.0)
        check(self.target_told, "target_told", 0.0, _LARGEST)
        for name in ("miss_allowed", "aspect_allowed"):
            check(getattr(self, name), name, 0.0, _LARGEST, open_low=True)
        check_rate(self.control_rate, "control_rate", TICK)
        if self.dimension == "planar":
            self._check_plane()

    def _check_plane(self) -> None:
        """Raise MissionError for what leads out of the plane, which would be lost without a word."""
        across = {
            "start: its y": self.start[1],
            "target: its y": self.target[1],
            "start_heading": self.start_heading,
            "target_velocity: its y": self.target_velocity[1],
            "target_change: its y": next((change[2] for change in self.target_change if change[2] != 0.0), 0.0),
            "gust.force: its y": self.gust.force[1],
            "gust.torque: its x or z": self.gust.torque[0] or self.gust.torque[2],
        }
        for name, value in across.items():
            if value != 0.0:
                raise MissionError(
                    f"{name} = {value!r} leads out of the pitch plane; allowed: 0, or dimension = spatial"
                )


def _check_point(point: tuple[float, ...], name: str) -> None:
    if not all(math.isfinite(c) and abs(c) <= _LARGEST for c in point):
        raise FieldError(f"{name} = {point!r}; allowed: three finite numbers, at most {_LARGEST:g}")
