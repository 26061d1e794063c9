"""The fields of ``missile-guidance``. Points and vectors are in the frame of the world: x ahead, y left, z up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field
from typing import Annotated, ClassVar, Literal

import numpy as np
from annotated_types import Interval, Le

from mathnavi.interfaces.angles import Degrees
from mathnavi.interfaces.bounds import (
    ANEW,
    FINITE,
    Each,
    Fraction,
    NonNegative,
    Positive,
    TickRate,
    Within,
    configuration,
    whole_ticks,
)
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import FieldError, MissionError
from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.missile.dynamics import TICK
from mathnavi.sim.engine.faults import ConstantWrench, Disturbance, Gusts
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.fault_fields import CommonFlightFaults, Factor, Fault, LostReadings
from mathnavi.sim.scenarios.redraw import ChanceFields

_LARGEST = 1e6  # of any field in SI units

_WITHIN = Interval(ge=-_LARGEST, le=_LARGEST)
Vector = Annotated[Point, Each(_WITHIN, allowed=f"three finite numbers, at most {_LARGEST:g}")]
Magnitude = Annotated[NonNegative, Le(_LARGEST)]
PositiveMagnitude = Annotated[Positive, Le(_LARGEST)]
Delay = Annotated[Fraction, Within(whole_ticks(TICK), allowed=f"a whole number of physics ticks of {TICK:g} s")]


@configuration(prefix="mismatch.")
class MissileMismatch:
    """Mismatch of the true missile to the declared one, as factors."""

    mass: Factor = 1.0
    """factor of the mass"""
    inertia: Factor = 1.0
    """factor of the moments of inertia"""
    force: Factor = 1.0
    """factor of the thrusters' force"""
    moment: Factor = 1.0
    """factor of the thrusters' moment"""


@configuration(prefix="gust.")
class MissileGust(Fault):
    """Disturbing forces and torques on the missile, in the frame of the world."""

    stream: ClassVar[str] = "gusts"

    force: Vector = (0.0, 0.0, 0.0)
    """constant force [N]"""
    torque: Vector = (0.0, 0.0, 0.0)
    """constant torque [N m]; one about y turns the nose down"""
    force_rms: Magnitude = 0.0
    """rms of the random force on each axis [N]"""
    torque_rms: Magnitude = 0.0
    """rms of the random torque about each axis [N m]"""
    time_constant: Annotated[float, Interval(ge=TICK, le=_LARGEST), FINITE] = 1.0
    """time constant of the first-order model of random forces and torques [s]"""
    force_limit: PositiveMagnitude = 2000.0
    """largest random force [N]"""
    torque_limit: PositiveMagnitude = 200.0
    """largest random torque [N m]"""

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        """Constant and random forces and torques, as far as there are any, independent of the mass."""
        acting: list[Disturbance] = []
        if any(self.force) or any(self.torque):
            acting.append(ConstantWrench(self.force, self.torque))
        if self.force_rms > 0.0 or self.torque_rms > 0.0:
            strength = (self.force_rms, self.time_constant, self.force_limit)
            acting.append(Gusts(*strength, rng, moment_rms=self.torque_rms, moment_limit=self.torque_limit))
        return acting


@configuration(prefix="actuator.")
class Thrusters:
    """Limits of the thrusters, which the controller knows, and their delay, of which it knows the declared value."""

    axial: Annotated[Positive, Le(1e9)] = 20_000.0
    """largest force along the missile [N]"""
    normal: Annotated[Positive, Le(1e9)] = 60_000.0
    """largest force on each axis across it [N]"""
    moment: Annotated[Positive, Le(1e9)] = 3_000.0
    """largest moment about each axis across it [N m]"""
    delay: Delay = 0.0
    """delay from a command to the thrusters' response [s], in whole milliseconds"""
    declared_delay: Delay | None = None
    """delay that controller and estimator assume [s]; the true one if not given"""

    @property
    def known_delay(self) -> float:
        """Declared delay [s]; the true one if none is declared."""
        return self.delay if self.declared_delay is None else self.declared_delay

    def limits(self, coordinates: Coordinates) -> tuple[float, ...]:
        """Limits (nu,) [N, N m] of the magnitude of each input."""
        by_input = {"F_x": self.axial, "F_y": self.normal, "F_z": self.normal, "M": self.moment, "N": self.moment}
        return tuple(by_input[name] for name in coordinates.inputs)


@configuration(prefix="noise.")
class ReadingErrors:
    """Standard deviations on each axis of the readings of the state."""

    position: Magnitude = 0.0
    """standard deviation of the position [m]"""
    velocity: Magnitude = 0.0
    """standard deviation of the velocity along the axes of the body [m/s]"""
    angle: Annotated[float, Degrees(0.0, 90.0)] = 0.0
    """standard deviation of the attitude angles [deg]"""
    rate: Magnitude = 0.0
    """standard deviation of the angular velocity [deg/s]"""


@configuration(prefix="noise.")
class MissileNoise(LostReadings, ReadingErrors):
    """Errors of the readings of the state: standard deviations on each axis, and losses."""


@configuration(prefix="faults.")
class MissileFaults(CommonFlightFaults):
    """Faults of a missile."""

    late_plan_latency: Annotated[Magnitude, ANEW] = 1.0
    """simulated time that a late answer takes [s]"""


@configuration
class MissileGuidanceConfig(ChanceFields):
    """Fields of the scenario."""

    case: Literal["SM", "SM2", "SM3", "FAST"] = "SM"
    """case of the thesis: initial speed and weights of the cost"""
    dimension: Literal["planar", "spatial"] = "planar"
    """motion in the pitch plane (planar), as in the thesis, or in space (spatial)"""
    start: Vector = (0.0, 0.0, 10.0)
    """start x, y, z [m]"""
    start_heading: Annotated[float, Degrees(-180.0, 180.0)] = 0.0
    """heading of the level start, from x to the left [deg]"""
    target: Vector = (700.0, 0.0, 0.0)
    """initial place x, y, z of the target [m]"""
    target_velocity: Vector = (0.0, 0.0, 0.0)
    """initial velocity x, y, z of the target [m/s]"""
    target_change: tuple[tuple[float, float, float, float], ...] = ()
    """change TIME VX VY VZ [s, m/s] of the target's velocity; may be given several times"""
    target_announcement_delay: Magnitude = 0.0
    """delay after which the planner is informed of a change of the target's velocity [s]"""
    aspect_angle: Annotated[float, Degrees(-90.0, 90.0)] = -90.0
    """angle of the nose and of the velocity above the horizontal at the target [deg]"""
    miss_allowed: PositiveMagnitude = 1.0
    """distance from the target that counts as a hit [m]"""
    aspect_allowed: Annotated[float, Degrees(0.0, 180.0, open_low=True)] = 2.0
    """largest angle between the nose and the aspect angle at a hit [deg]"""
    control_rate: Annotated[float, TickRate(TICK)] = 250.0
    """rate of estimator, autopilot and log [Hz]; the physics runs at 1 kHz"""
    mismatch: MissileMismatch = field(default_factory=MissileMismatch)
    gust: MissileGust = field(default_factory=MissileGust)
    actuator: Thrusters = field(default_factory=Thrusters)
    noise: MissileNoise = field(default_factory=MissileNoise)
    faults: MissileFaults = field(default_factory=MissileFaults)

    def __post_init__(self) -> None:
        for change in self.target_change:
            _check_point(change[1:], "target_change")
            check(change[0], "target_change", 0.0, _LARGEST, open_low=True)
        for name in ("start", "target"):
            check(getattr(self, name)[2], f"{name}: its height z", 0.0, _LARGEST)
        if math.dist(self.start, self.target) <= self.miss_allowed:
            raise MissionError(f"target = {self.target!r} is where the missile starts; allowed: another place")
        if self.dimension == "planar":
            self._check_plane()

    def _check_plane(self) -> None:
        """Raise MissionError for components out of the plane, which would be ignored silently."""
        across = {
            "start: its y": self.start[1],
            "target: its y": self.target[1],
            "start_heading": 0.0 if abs(self.start_heading) == 180.0 else self.start_heading,
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
