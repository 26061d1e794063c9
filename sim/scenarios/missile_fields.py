"""The fields of ``missile-guidance``. Points and vectors are in the frame of the world: x ahead, y left, z up."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.missile.dynamics import TICK
from mathnavi.sim.interfaces.checks import check, check_rate

Point = tuple[float, float, float]

_LARGEST = 1e6  # of any field in SI units


@dataclass(frozen=True)
class Mismatch:
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
class Gust:
    """What acts on the missile beside its thrusters, in the frame of the world."""

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

    def __post_init__(self) -> None:
        for name in ("force", "torque"):
            _check_point(getattr(self, name), f"gust.{name}")
        for name in ("force_rms", "torque_rms"):
            check(getattr(self, name), f"gust.{name}", 0.0, _LARGEST)
        check(self.time_constant, "gust.time_constant", TICK, _LARGEST)
        for name in ("force_limit", "torque_limit"):
            check(getattr(self, name), f"gust.{name}", 0.0, _LARGEST, open_low=True)


@dataclass(frozen=True)
class Actuator:
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
class Noise:
    """How the readings of the state err: standard deviations on each axis."""

    position: float = 0.0
    """[m]"""
    velocity: float = 0.0
    """[m/s], along the axes of the body"""
    angle: float = 0.0
    """[deg]"""
    rate: float = 0.0
    """of the angular velocity [deg/s]"""
    dropout_rate: float = 0.0
    """fraction of the readings that are lost"""

    def __post_init__(self) -> None:
        for name in ("position", "velocity", "angle", "rate"):
            check(getattr(self, name), f"noise.{name}", 0.0, _LARGEST)
        check(self.dropout_rate, "noise.dropout_rate", 0.0, 1.0)


@dataclass(frozen=True)
class Faults:
    """What goes wrong with the planner on purpose."""

    solver_failure_rate: float = 0.0
    """fraction of the requests on which the solver gives up"""
    late_plan_rate: float = 0.0
    """fraction of the requests answered too late to be of use"""
    late_plan_latency: float = 1.0
    """simulated time that a late answer takes [s]"""

    def __post_init__(self) -> None:
        for name in ("solver_failure_rate", "late_plan_rate"):
            check(getattr(self, name), f"faults.{name}", 0.0, 1.0)
        check(self.late_plan_latency, "faults.late_plan_latency", 0.0, _LARGEST)


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
    """how long after the target has taken up a velocity the planner is told of it [s]"""
    aspect_angle: float = -90.0
    """of the nose and the velocity at the target over the horizontal [deg]"""
    miss_allowed: float = 1.0
    """how near to the target counts as a hit [m]"""
    aspect_allowed: float = 2.0
    """how far the nose may then be off the aspect angle [deg]"""
    control_rate: float = 250.0
    """of estimator, autopilot and log [Hz]; the physics runs at 1 kHz"""
    mismatch: Mismatch = field(default_factory=Mismatch)
    gust: Gust = field(default_factory=Gust)
    actuator: Actuator = field(default_factory=Actuator)
    noise: Noise = field(default_factory=Noise)
    faults: Faults = field(default_factory=Faults)

    def __post_init__(self) -> None:
        for name in ("start", "target", "target_velocity"):
            _check_point(getattr(self, name), name)
        for change in self.target_change:
            _check_point(change[1:], "target_change")
            check(change[0], "target_change", 0.0, _LARGEST, open_low=True)
        for name in ("start", "target"):
            check(getattr(self, name)[2], f"{name}: its height z", 0.0, _LARGEST)
        if math.dist(self.start, self.target) <= self.miss_allowed:
            raise ValueError(f"target = {self.target!r} is where the missile starts; allowed: another place")
        check(self.start_heading, "start_heading", -80.0, 80.0)
        check(self.aspect_angle, "aspect_angle", -90.0, 90.0)
        check(self.target_told, "target_told", 0.0, _LARGEST)
        for name in ("miss_allowed", "aspect_allowed"):
            check(getattr(self, name), name, 0.0, _LARGEST, open_low=True)
        check_rate(self.control_rate, "control_rate", TICK)
        if self.dimension == "planar":
            self._check_plane()

    def _check_plane(self) -> None:
        """What leads out of the plane would be lost without a word."""
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
                raise ValueError(f"{name} = {value!r} leads out of the pitch plane; allowed: 0, or dimension = spatial")


def _check_point(point: tuple[float, ...], name: str) -> None:
    if not all(math.isfinite(c) and abs(c) <= _LARGEST for c in point):
        raise ValueError(f"{name} = {point!r}; allowed: three finite numbers, at most {_LARGEST:g}")
