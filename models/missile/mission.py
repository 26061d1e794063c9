"""The task of a missile: reach a target, which may move, under a terminal aspect angle (thesis B.4).

A mission is the common knowledge of all parts: the problem to optimise, the declared body, the limits of the thrusters,
the quality of the sensors. It holds no truth of a run.

**Sensors of the missile**: from its true motion, in MuJoCo's joint coordinates, to readings of the thesis' state.

**True motion of a missile's target**: along straight legs, at a constant velocity on each.

**Frame of a mission**: the world turned about the vertical, so that no nose has to point along the axis of pitch.

A missile that does not roll has the attitude R_y(theta) R_z(psi), which is singular where the nose points along Y, at
psi = +-90 degrees. The axis Y is a choice. A flight surely takes three directions, the nose d_0 at the start, the line
d_1 from the start to the target and the nose d_2 at the target; they are at the angles psi_i = asin(d_i . Y) to the
plane X, Z. The azimuth A of X is that with

    min max(|psi_0| - 50°, |psi_1|, |psi_2|),      Y = (-sin A, cos A, 0),      |psi_0| <= 80°,      d_0 . X > 0,

for a flight leaves the yaw of its start soon, and its planners of pitch and yaw need a line near their plane. The world
itself, A = 0, is kept where it has at most 30 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mathnavi.interfaces.bounds import NonNegative, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import PLANAR, Coordinates
from mathnavi.models.missile.dynamics import NOMINAL, TICK, Body


@configuration(prefix="full_state sensor: ")
class StateNoise:
    """Standard deviations of a full-state reading, independent on each axis and from reading to reading."""

    position: NonNegative = 0.0  # [m]
    velocity: NonNegative = 0.0  # [m/s] on the axes of the body frame
    angle: NonNegative = 0.0  # [rad]
    rate: NonNegative = 0.0  # [rad/s]

    def deviations(self, coordinates: Coordinates) -> Array:
        """Standard deviations (nx,) of the components of the state, in their units."""
        by_unit = {"m": self.position, "m/s": self.velocity, "rad": self.angle, "rad/s": self.rate}
        return np.array([by_unit[unit] for unit in coordinates.units])


@dataclass(frozen=True)
class MissileStateSensor:
    """Sensor of the thesis' state (nx,) with Gaussian noise."""

    coordinates: Coordinates
    noise: StateNoise = field(default_factory=StateNoise)
    rate: float | None = None  # [Hz]; None: every control step
    name: str = "full_state"

    @property
    def size(self) -> int:
        """Number nx of states."""
        return self.coordinates.state_size

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the thesis' state (nx,) of ``motion``; ``rng`` draws the noise."""
        x = self.coordinates.from_joints(motion.x)
        deviations = self.noise.deviations(self.coordinates)
        if not deviations.any():
            return x
        noise: Array = deviations * rng.standard_normal(len(x))
        return x + noise


Place = tuple[float, float, float]

MOST_DELAY = 1.0
"""longest declared delay [s] of the thrusters"""


@dataclass(frozen=True)
class Case:
    """A trajectory optimisation problem of the missile: J = int_0^T L dt with the final time T free and

        L = 1 + a_x (F_x / m g)^2 + a_z (F_z / m g)^2 + b (M / I)^2 + k (w / u)^2.

    In space F_z^2 stands for F_y^2 + F_z^2, M^2 for M^2 + N^2 and w^2 for v^2 + w^2.
    """

    name: str
    speed: float  # [m/s] V_0 at the start
    a_x: float
    a_z: float
    b: float  # [s^4]
    k: float

    def running_cost(self, coordinates: Coordinates, x: Array, u: Array, body: Body = NOMINAL) -> Array:
        """L (...,) at states (..., nx) and inputs (..., nu): ``running_cost`` of arrays.

        It divides before it squares, as the recorded costs do; a test compares it with ``running_cost``.
        """
        x, u = coordinates.in_space(x), coordinates.input_in_space(u)
        weight = body.mass * body.gravity
        force, moment = u[..., :3] / weight, u[..., 3:] / body.inertia
        lateral = np.square(force[..., 1]) + np.square(force[..., 2])
        drift = (np.square(x[..., 1]) + np.square(x[..., 2])) / np.square(x[..., 0])
        cost: Array = (
            1.0
            + self.a_x * np.square(force[..., 0])
            + self.a_z * lateral
            + self.b * np.square(moment).sum(axis=-1)
            + self.k * drift
        )
        return cost


def running_cost(
    weights: Sequence[Any], body: Body, velocity: Sequence[Any], force: Sequence[Any], moments: Any
) -> Any:
    """L of ``Case``, stated once, for numbers, arrays or CasADi expressions.

    ``weights`` are (a_x, a_z, b, k), ``velocity`` (u, v, w) [m/s] and ``force`` (F_x, F_y, F_z) [N] are along the axes
    of the body, and ``moments`` is M^2 + N^2 [N^2 m^2].
    """
    a_x, a_z, b, k = weights
    weight = body.mass * body.gravity
    (u, v, w), (F_x, F_y, F_z) = velocity, force
    axial, lateral = (F_x / weight) ** 2, (F_y**2 + F_z**2) / weight**2
    return 1 + a_x * axial + a_z * lateral + b * moments / body.inertia**2 + k * (v**2 + w**2) / u**2


CASES = {
    case.name: case
    for case in (
        Case("SM", 120.0, 1.0, 0.05, 0.1, 20.0),
        Case("SM2", 120.0, 0.2, 0.05, 0.1, 20.0),
        Case("SM3", 120.0, 0.1, 0.05, 0.1, 20.0),
        Case("FAST", 200.0, 1.0, 0.01, 0.02, 100.0),
    )
}


@dataclass(frozen=True)
class Target:
    """Target: its position at time ``t``, and its known velocity from then on."""

    place: Place  # [m] Earth frame
    velocity: Place = (0.0, 0.0, 0.0)  # [m/s] Earth frame
    t: float = 0.0  # [s]

    def at(self, t: float) -> Array:
        """Place (3,) [m] in the Earth frame at time t [s]."""
        return np.array(self.place) + (t - self.t) * np.array(self.velocity)


@dataclass(frozen=True)
class GustStrength:
    """Gauss-Markov force and moment on each axis, their vectors clipped to a length."""

    force: float = 0.0  # [N] rms, before clipping
    moment: float = 0.0  # [N m] rms, before clipping
    time_constant: float = 1.0  # [s]
    force_limit: float = 2000.0  # [N]
    moment_limit: float = 200.0  # [N m]


@dataclass(frozen=True)
class MissileMission:
    """Flight from ``start`` at t = 0 to ``target``, there with nose and velocity at ``aspect_angle`` to the horizontal.

    Raises MissionError for a start or limits of another size, and for limits that are not positive.
    """

    start: tuple[float, ...]  # (nx,) the thesis' state
    target: Target  # as known at the start
    case: Case
    coordinates: Coordinates = PLANAR
    aspect_angle: float = -0.5 * math.pi  # [rad] over the horizontal, of nose and velocity at the target
    aspect_azimuth: float = 0.0  # [rad] of both from X_e to the right
    input_max: tuple[float, ...] = ()  # (nu,) on the magnitude of each input; none: unlimited
    body: Body = NOMINAL  # as declared; the true one may differ
    input_delay: float = 0.0  # [s] from a command to the thrusters' response, as declared
    noise: StateNoise = field(default_factory=StateNoise)
    gust: GustStrength = field(default_factory=GustStrength)
    control_period: float = 4 * TICK  # [s] of estimator and tracker

    def __post_init__(self) -> None:
        sizes = {"start": self.coordinates.state_size, "input_max": self.coordinates.input_size}
        for name, size in sizes.items():
            given = getattr(self, name)
            if len(given) != size and not (name == "input_max" and not given):
                raise MissionError(
                    f"{name} has {len(given)} numbers; allowed: {size} in {self.coordinates.name} flight"
                )
        if not 0.0 <= self.input_delay <= MOST_DELAY:  # NaN too
            raise MissionError(f"input_delay = {self.input_delay!r}; allowed: 0 to {MOST_DELAY:g} s")
        if not self.input_max:
            object.__setattr__(self, "input_max", (math.inf,) * self.coordinates.input_size)
        if not all(limit > 0.0 for limit in self.input_max):  # NaN too
            raise MissionError(f"input_max = {self.input_max!r}; allowed: numbers > 0, infinity for none")

    @property
    def input_size(self) -> int:
        """Number nu of inputs."""
        return self.coordinates.input_size

    @property
    def start_state(self) -> Array:
        """State (nx,) at t = 0."""
        return np.array(self.start)

    @property
    def final_direction(self) -> Array:
        """Unit vector (3,) of the Earth frame along which nose and velocity shall point at the target."""
        c, s = math.cos(self.aspect_angle), math.sin(self.aspect_angle)
        return np.array([c * math.cos(self.aspect_azimuth), c * math.sin(self.aspect_azimuth), -s])

    @property
    def final_attitude(self) -> tuple[float, float]:
        """theta and psi [rad] of a nose along ``final_direction``."""
        x, y, z = self.final_direction.tolist()
        return math.atan2(0.0 - z, x), math.asin(max(-1.0, min(1.0, y)))

    # ---- interface of an estimator to the vehicle, common to all missions

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """State (nx,) after the input u (nu,) [N, N m], clipped to its limits, was held for dt [s] from x (nx,), as
        declared.
        """
        return self.coordinates.flow(x, np.clip(u, -np.array(self.input_max), self.input_max), dt, self.body)

    def full_state_sensor(self, rate: float | None) -> MissileStateSensor:
        """Sensor that reads the whole state ``rate`` times a second, or at every control step if it is None."""
        return MissileStateSensor(self.coordinates, self.noise, rate)

    def full_state_covariance(self, age: float) -> Array:
        """Covariance (nx, nx) of a reading propagated for ``age`` [s]; a constant gust bounds every other."""
        kick = {  # rates of the velocities that a gust gives
            **dict.fromkeys(("u", "v", "w"), self.gust.force / self.body.mass),
            **dict.fromkeys(("q", "r"), self.gust.moment / self.body.inertia),
        }
        drift = {
            **dict.fromkeys(("x_e", "y_e", "z_e"), kick["u"]),
            **dict.fromkeys(("theta", "psi"), kick["q"]),
        }
        deviations = [
            kick[name] * age if name in kick else drift[name] * 0.5 * age * age for name in self.coordinates.states
        ]
        return np.diag(self.noise.deviations(self.coordinates) ** 2 + np.square(deviations))

    def full_state_quality(self, rate: float | None, timeout: float) -> Any:
        """Covariance of a reading: the estimate is not certified."""
        return self.full_state_covariance(0.0)


@dataclass(frozen=True)
class TargetMotion:
    """The legs in order of time; the first is that of t = 0."""

    legs: tuple[Target, ...]

    @staticmethod
    def along(place: Place, velocity: Place, changes: Sequence[tuple[float, Place]] = ()) -> TargetMotion:
        """Motion from ``place`` (3,) [m] with ``velocity`` (3,) [m/s], Earth frame; ``changes`` hold times [s] and new
        velocities.
        """
        legs = [Target(place, velocity)]
        for t, after in sorted(changes):
            x, y, z = legs[-1].at(t).tolist()
            legs.append(Target((x, y, z), after, t))
        return TargetMotion(tuple(legs))

    def leg(self, t: float) -> Target:
        """Leg at time t [s]."""
        return [leg for leg in self.legs if leg.t <= max(t, 0.0)][-1]

    def at(self, t: float | Array) -> Array:
        """Place (3,) or (n, 3) [m] in the Earth frame at time t [s], a number or an array (n,)."""
        if isinstance(t, np.ndarray):
            return np.array([self.at(float(each)) for each in t]).reshape(-1, 3)
        return self.leg(t).at(t)

    def velocity(self, t: float) -> Array:
        """Velocity (3,) [m/s] in the Earth frame at time t [s]."""
        return np.array(self.leg(t).velocity)


Point = tuple[float, float, float]

GOOD, LEFT_SOON = math.radians(30.0), math.radians(50.0)
"""greatest yaw [rad] with which the frame of the world is kept, and yaw that counts less at the start"""
MOST_AT_START = math.radians(80.0)
"""greatest yaw [rad] at the start"""
_ROUND_OFF = 1e-9


@dataclass(frozen=True)
class MissionFrame:
    """A frame with X ahead, Y to the left, Z up; X is at a whole number of degrees from the x of the world."""

    azimuth: int = 0  # [deg] to the left

    @staticmethod
    def for_flight(heading: float, start: Point, target: Point, aspect_angle: float, *, planar: bool) -> MissionFrame:
        """The frame of a level start at ``heading`` [deg] to the left; places are those of the world.

        The target is hit at ``aspect_angle`` [deg] over the horizontal and azimuth 0. A ``planar`` flight keeps x, z.
        """
        h, a = math.radians(heading), math.radians(aspect_angle)
        line = np.array(target) - np.array(start)
        length = float(np.linalg.norm(line))
        directions = np.array(
            [
                (math.cos(h), math.sin(h), 0.0),
                line / length if length > 0.0 else (1.0, 0.0, 0.0),
                (math.cos(a), 0.0, math.sin(a)),
            ]
        )
        frames = [MissionFrame(azimuth) for azimuth in ((0, 180) if planar else range(-179, 181))]
        upright = [
            frame for frame in frames if float(frame.axes[0] @ directions[0]) >= math.cos(MOST_AT_START) - _ROUND_OFF
        ]
        world = MissionFrame()
        if world in upright and world._worst(directions) <= GOOD + _ROUND_OFF:
            return world
        return min(upright, key=lambda frame: (round(frame._worst(directions), 9), abs(frame.azimuth)))

    @property
    def axes(self) -> Array:
        """Unit vectors X, Y, Z (3, 3), one in each row, of the world."""
        c, s = math.cos(math.radians(self.azimuth)), math.sin(math.radians(self.azimuth))
        if self.azimuth % 180 == 0:
            s = 0.0  # not 1e-16: a flight in the plane has to stay there
        return np.array([(c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0)])

    def turned(self, vector: Point) -> Point:
        """Transform a vector or place (3,) of the world to this frame."""
        x, y, z = (self.axes @ np.array(vector)).tolist() if self.azimuth else vector
        return x, y, z

    def _worst(self, directions: Array) -> float:
        start, *others = np.arcsin(np.minimum(np.abs(directions @ self.axes[1]), 1.0)).tolist()
        return float(max(start - LEFT_SOON, *others))
