"""The task of a unicycle robot with range sensors: to localise itself within a known wall (thesis C.4).

A mission is the common knowledge of all parts: the wall, the directions and the quality of the sensors, the limits of
the wheels, and the known start. It holds no truth of a run. A pose is x = (x_1, x_2, phi) [m, m, rad], an input u =
(u_1, u_2), the speed [m/s] and the turn rate [rad/s].

**Sensors of the unicycle**: MuJoCo's rangefinders and wheel encoders with the errors that a mission declares.

**Drives**: they turn the inputs of a unicycle, u = (u_1 [m/s], u_2 [rad/s]), into the motion of its two driven wheels.

With the wheels' radius r and their distance b apart, a wheel that does not slip turns at

    omega_l = (u_1 - u_2 b / 2) / r,    omega_r = (u_1 + u_2 b / 2) / r.

Both drives are ``mathnavi.interfaces.protocols.ActuatorModel``. The joints of either robot are led by x_1, x_2 and
phi and end with the left and the right wheel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from itertools import combinations
from typing import Annotated, ClassVar

import numpy as np

from mathnavi.interfaces.bounds import FINITE_NUMBERS, Condition, Each, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.field.wall import Wall
from mathnavi.models.unicycle.kernels import integrate, rays_at
from mathnavi.models.unicycle.motion import UnicycleMotion
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality


class DrivePhase(IntEnum):
    """Phase of an arc of a robot's plan: inputs for exploration, a turn on the spot or back, a path that is tracked."""

    OPTIMISED = 0
    MANOEUVRE = 1
    CRUISE = 4


WHEEL_RADIUS = 0.05  # [m] r
TRACK = 0.22  # [m] b
RIM_ACCELERATION = 4.0  # [m/s^2] at which a servo takes a wheel to another speed

_RATES = np.array([[1.0, -0.5 * TRACK], [1.0, 0.5 * TRACK]]) / WHEEL_RADIUS  # u -> (omega_l, omega_r)
_INPUTS = np.linalg.inv(_RATES)


def wheel_rates(u: Array) -> Array:
    """Rates (omega_l, omega_r) (2,) [rad/s] of the wheels under an input u (2,) [m/s, rad/s]."""
    rates: Array = _RATES @ u
    return rates


def inputs_of(rates: Array) -> Array:
    """Input u (2,) [m/s, rad/s] of wheels that turn at rates (omega_l, omega_r) (2,) [rad/s] and do not slip."""
    u: Array = _INPUTS @ rates
    return u


@dataclass(frozen=True)
class IdealDrive:
    """Kinematic drive: over a tick the robot moves along the exact arc of its input, and the wheels turn with it."""

    input_size: int = 2

    def act(self, u: Array, q: Array, v: Array, control: Array, dt: float) -> None:
        """Set the joint rates v (5,) so that over dt [s] the robot moves along the exact arc of u (2,) [m/s, rad/s]."""
        v[:3] = (integrate(q[:3], float(u[0]), float(u[1]), dt) - q[:3]) / dt
        v[3:] = wheel_rates(u)


@dataclass(frozen=True)
class DifferentialDrive:
    """Drive with a velocity servo on each wheel; friction then moves the robot.

    A servo changes its speed at a limited rate, so that a step of the input alone does not make the wheels spin.
    """

    input_size: int = 2

    def act(self, u: Array, q: Array, v: Array, control: Array, dt: float) -> None:
        """Move the servos' set rates in ``control`` (2,) [rad/s] towards those of u (2,) [m/s, rad/s] for dt [s]."""
        step = RIM_ACCELERATION / WHEEL_RADIUS * dt
        control += np.clip(wheel_rates(u) - control, -step, step)


@dataclass(frozen=True)
class RangeSensor:
    """Ranges (l,) [m] of the rangefinders ``range_0``, ..., NaN where a ray was lost, met nothing or was too long.

    Each errs by a Gaussian of variance (relative rho)^2 + absolute^2; a fraction ``outliers`` is uniform between zero
    and ``longest`` instead, and a fraction ``dropout`` is lost. The random numbers drawn do not depend on the size of
    the errors, so runs that differ in them only see the same noise.
    """

    size: int  # l
    quality: RangeQuality
    longest: float  # [m] longest range in sight
    rate: float | None  # [Hz]; None: every control step
    name: str = "ranges"
    partial: ClassVar[bool] = True  # single values of a reading may be NaN

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the ranges (l,) [m] of ``motion``; ``rng`` draws noise, outliers and losses."""
        quality = self.quality
        rho = np.array([motion.sensed(f"range_{i}")[0] for i in range(self.size)])
        rho[rho < 0.0] = np.nan  # MuJoCo's value for a ray that meets nothing
        if quality.maximum is not None:
            rho[rho >= quality.maximum] = np.nan
        deviation = np.hypot(quality.relative * rho, quality.absolute)
        reading = rho + deviation * rng.standard_normal(self.size)
        chance, any_value = rng.random(self.size), rng.random(self.size)
        reading = np.where(chance < quality.outliers, self.longest * any_value, reading)
        if quality.maximum is not None:  # by its noise
            reading[reading >= quality.maximum] = np.nan
        return np.where(rng.random(self.size) < quality.dropout, np.nan, reading)

    @property
    def too_long(self) -> float:
        """Least range [m] that is no reading: without an echo, or beyond the longest in sight with its noise."""
        quality = self.quality
        noise = _DEVIATIONS * math.hypot(quality.relative * self.longest, quality.absolute)
        possible = self.longest + max(noise, _OTHER_WALL * self.longest)
        return possible if quality.maximum is None else min(possible, quality.maximum)


@dataclass
class WheelOdometry:
    """Sensor of the mean input (u_1, u_2) (2,) [m/s, rad/s] over the last period, by wheels that do not slip.

    A reading is (1 + bias) u + noise, the sign of the bias drawn once a run. The first one only notes where the wheels
    are, so there is none. It remembers the wheels: it belongs to one vehicle and one run.
    """

    quality: OdometryQuality
    rate: float  # [Hz]
    name: str = "odometry"
    size: int = 2
    _before: Array | None = field(default=None, init=False, repr=False)  # (2,) [rad] of the wheels at the last reading
    _bias: float = field(default=0.0, init=False, repr=False)

    def read(self, motion: StateView, rng: np.random.Generator) -> Array | None:
        """Read the mean input (2,) [m/s, rad/s] of ``motion`` since the last reading; None for the first."""
        wheels = np.concatenate([motion.sensed("wheel_left"), motion.sensed("wheel_right")])
        before, self._before = self._before, wheels
        if before is None:
            self._bias = self.quality.bias * float(rng.choice((-1.0, 1.0)))
            return None
        u = (1.0 + self._bias) * inputs_of((wheels - before) * self.rate)
        noisy: Array = u + np.array(self.quality.noise) * rng.standard_normal(2)
        return noisy


TICK = 0.01
"""tick [s] of the ideal robot; its motion under inputs that are held is exact at any tick"""

LEAST_NOISE = 1e-4  # [m] least noise that an estimator assumes of a range, however small the declared one is
_SAME = 1e-9  # [rad, m]
_DEVIATIONS, _OTHER_WALL = 8.0, 0.25  # of the noise, and share of the longest range by which a wall may be another

MapDeviation = Annotated[tuple[float, float], Condition(lambda each: min(each) >= 0.0, "0 or more"), FINITE_NUMBERS]
SensorPlaces = Annotated[
    tuple[tuple[float, float], ...],
    Each(Condition(lambda place: all(map(math.isfinite, place)), "two finite numbers")),
]
SensorAngles = Annotated[
    tuple[float, ...], Condition(lambda angles: len(angles) > 0, "one sensor or more"), FINITE_NUMBERS
]


@configuration
class RangingMission(UnicycleMotion):
    """A robot within ``curve`` with range sensors at ``angles`` (l,) [rad] off its heading.

    Raises MissionError without sensors, with two at the same angle and place, with places that are neither one nor one
    for each, or with a known start that is not within the wall.
    """

    curve: Wall
    angles: SensorAngles  # (l,) [rad] alpha_i, counter-clockwise from the heading
    ranging: RangeQuality = field(default_factory=RangeQuality)
    odometry: OdometryQuality = field(default_factory=OdometryQuality)
    start: KnownStart | None = None  # None: anywhere within the wall
    speed_max: float = 1.0  # [m/s]
    turn_rate_max: float = 2.0  # [rad/s]
    margin: float = 0.3  # [m] that the robot shall keep from the wall
    period: float = TICK  # [s] of sensors, estimator and tracker
    map_deviation: MapDeviation = (0.0, 0.0)
    """standard deviations of place [m], along either axis, and direction [rad] of the walls around the robot: common to
    all ranges, so that no reading tells them, and part of the covariance of a pose"""
    mounting: SensorPlaces = ()
    """place [m, m] of the sensors, ahead of the middle of the axle and to its left: one for all, or one for each of
    ``angles``; () at the middle of the axle, whose pose all estimates are"""

    def __post_init__(self) -> None:
        object.__setattr__(self, "angles", tuple(map(float, self.angles)))  # lists and arrays cannot be hashed
        object.__setattr__(self, "mounting", tuple((float(x), float(y)) for x, y in self.mounting))
        if len(self.mounting) not in {0, 1, len(self.angles)}:
            raise MissionError(
                f"mounting = {self.mounting!r} for {len(self.angles)} sensors; allowed: one place, or one for each"
            )
        if any(_same(one, other) for one, other in combinations(self.rays, 2)):
            place = " from one place" if self.mounting else ""
            raise MissionError(
                f"angles = {self.angles!r} holds one direction{place} twice; allowed: different directions{place}"
            )
        if self.start is not None and not self.curve.contains(np.array(self.start.pose)):
            raise MissionError(f"start = {self.start.pose!r} is outside the {self.curve.name}; allowed: within it")

    def check_exact(self, name: str) -> None:
        """Raise MissionError if walls may be off, or rays do not begin at the axle, for a part ``name``.

        Its theorem needs the true place of the walls, and rays from the middle of the axle.
        """
        if self.is_mounted:
            raise MissionError(f"mounting = {self.mounting!r} with {name}; allowed: (), at the middle of the axle")
        if any(self.map_deviation):
            raise MissionError(f"map_deviation = {self.map_deviation!r} with {name}; allowed: (0.0, 0.0)")

    @property
    def input_size(self) -> int:
        """Number 2 of inputs: speed and turn rate."""
        return 2

    @property
    def sensors(self) -> int:
        """Number l of range sensors."""
        return len(self.angles)

    def sensors_carried(self) -> tuple[RangeSensor, WheelOdometry]:
        """Make the sensors of one run, of readings "ranges" (l,) [m] and "odometry" (2,) [m/s, rad/s]."""
        rate = 1.0 / self.period
        return RangeSensor(self.sensors, self.ranging, self.curve.longest, rate), WheelOdometry(self.odometry, rate)

    @property
    def alpha(self) -> Array:
        """Angles (l,) [rad] of the sensors off the heading."""
        return np.array(self.angles)

    @property
    def is_mounted(self) -> bool:
        """True if a ray begins elsewhere than at the middle of the axle."""
        return any(any(place) for place in self.mounting)

    @property
    def rays(self) -> Array:
        """Rays (l, 3) [rad, m, m]: angle off the heading, and place ahead of the middle of the axle and to its left."""
        return rays_at(self.angles, self.mounting)

    def origins(self, pose: Array) -> Array:
        """Origins (l, 2) [m] of the rays at a pose (3,)."""
        c, s = math.cos(pose[2]), math.sin(pose[2])
        begin: Array = pose[:2] + self.rays[:, 1:] @ np.array([[c, s], [-s, c]])
        return begin

    def ranges(self, pose: Array) -> Array:
        """Ranges (l,) [m] of ideal sensors at a pose (3,) [m, m, rad], NaN where a ray misses the wall."""
        if not self.is_mounted:
            return self.curve.ranges(pose, self.alpha)[0]
        begin = np.column_stack((self.origins(pose), np.full(self.sensors, pose[2])))
        return np.concatenate(
            [self.curve.ranges(at, angle)[0] for at, angle in zip(begin, self.alpha[:, None], strict=True)]
        )

    @property
    def start_pose(self) -> Array:
        """Known pose (3,) [m, m, rad] of the start; the centre of the wall if it is not known."""
        if self.start is not None:
            return np.array(self.start.pose)
        return np.array([*self.curve.centre, 0.0])

    def difference(self, x: Array, truth: Array) -> Array:
        """Estimate x (3,) minus the truth (3,) [m, m, rad], modulo the symmetry of the wall.

        Of the poses that are indistinguishable from the truth the nearest one counts. In a circle, where they are a
        continuum, that is the one in the direction of the estimate from the centre.
        """
        truth, centre = np.asarray(truth, np.float64), self.curve.centre
        if self.curve.symmetry == 0:
            rotation = _direction(x, centre) - _direction(truth, centre)
            c, s = math.cos(rotation), math.sin(rotation)
            offset = truth[:2] - centre
            offset = np.array([c * offset[0] - s * offset[1], s * offset[0] + c * offset[1]])
            truth = np.array([*(centre + offset), truth[2] + rotation])
        differences = x - self.curve.images(truth)
        differences[:, 2] = wrapped(differences[:, 2])
        nearest: Array = differences[int(np.argmin(np.square(differences).sum(axis=1)))]
        return nearest

    def error(self, x: Array, truth: Array) -> tuple[float, float]:
        """Lengths [m] and [rad] of the two parts of ``difference`` between x (3,) and the truth (3,)."""
        differences = self.difference(x, truth)
        return math.hypot(differences[0], differences[1]), abs(float(differences[2]))


def _same(one: Array, other: Array) -> bool:
    """True for two rays (3,) from one place in one direction."""
    return abs(wrapped(float(one[0] - other[0]))) < _SAME and bool((np.abs(one[1:] - other[1:]) < _SAME).all())


def _direction(pose: Array, centre: Array) -> float:
    return math.atan2(pose[1] - centre[1], pose[0] - centre[0])
