"""The task of a unicycle robot with range sensors: to localise itself within a known wall (thesis C.4).

A mission is the common knowledge of all parts: the wall, the directions and the quality of the sensors, the limits of
the wheels, and the known start. It holds no truth of a run. A pose is x = (x_1, x_2, phi) [m, m, rad], an input u =
(u_1, u_2), the speed [m/s] and the turn rate [rad/s].
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from mathnavi.interfaces.bounds import FINITE_NUMBERS, Condition, configuration
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.models.unicycle.sensors import RangeSensor, WheelOdometry

TICK = 0.01
"""tick [s] of the ideal robot; its motion under inputs that are held is exact at any tick"""

LEAST_NOISE = 1e-4  # [m] least noise that an estimator assumes of a range, however small the declared one is
_SAME = 1e-9  # [rad]

SensorAngles = Annotated[tuple[float, ...], Condition(bool, "one sensor or more"), FINITE_NUMBERS]


@configuration
class RangingMission:
    """A robot within ``curve`` with range sensors at ``angles`` (l,) [rad] off its heading.

    Raises MissionError without sensors, with two at the same angle, or with a known start that is not within the wall.
    """

    curve: Curve
    angles: SensorAngles  # (l,) [rad] alpha_i, counter-clockwise from the heading
    ranging: RangeQuality = field(default_factory=RangeQuality)
    odometry: OdometryQuality = field(default_factory=OdometryQuality)
    start: KnownStart | None = None  # None: anywhere within the wall
    speed_max: float = 1.0  # [m/s]
    turn_rate_max: float = 2.0  # [rad/s]
    margin: float = 0.3  # [m] that the robot shall keep from the wall
    period: float = TICK  # [s] of sensors, estimator and tracker

    def __post_init__(self) -> None:
        turned = sorted(angle % (2.0 * math.pi) for angle in self.angles)
        turned.append(turned[0] + 2.0 * math.pi)
        if len(self.angles) > 1 and min(np.diff(turned)) < _SAME:
            raise MissionError(f"angles = {self.angles!r} holds one direction twice; allowed: different directions")
        if self.start is not None and not self.curve.contains(np.array(self.start.pose)):
            raise MissionError(f"start = {self.start.pose!r} is outside the {self.curve.name}; allowed: within it")

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
        corners = self.curve.polyline[:-1:8]
        longest = float(np.linalg.norm(corners[:, None] - corners, axis=2).max())
        rate = 1.0 / self.period
        return RangeSensor(self.sensors, self.ranging, longest, rate), WheelOdometry(self.odometry, rate)

    @property
    def alpha(self) -> Array:
        """Angles (l,) [rad] of the sensors off the heading."""
        return np.array(self.angles)

    @property
    def start_pose(self) -> Array:
        """Known pose (3,) [m, m, rad] of the start; the centre of the wall if it is not known."""
        if self.start is not None:
            return np.array(self.start.pose)
        return np.array([*self.curve.centre, 0.0])

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """Pose (3,) [m, m, rad] after the input u (2,) [m/s, rad/s] was held for dt [s] from x (3,)."""
        after: Array = integrate(np.asarray(x, np.float64), float(u[0]), float(u[1]), dt)
        return after

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


def _direction(pose: Array, centre: Array) -> float:
    return math.atan2(pose[1] - centre[1], pose[0] - centre[0])
