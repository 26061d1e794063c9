"""A certificate of a pose: no pose in the room explains the last readings except those near the estimate.

A pose x explains n sets of ranges, read at the poses x m_k of a motion that odometry measured from the middle one, if

    |rho(x m_k, alpha_i) - y_ki| <= b_ki    for all k, i, except as many outliers as are declared,

and, if no outliers are declared, if the sum of the squares over the variances is within its chi-square limit. The
bounds b are kappa standard deviations of the range plus the largest error of the motion in between; the true pose
satisfies all of them except with the configured probability. Branch and bound (``pose_certificate_kernels``) divides
the set of all poses into boxes until each is refuted by interval bounds or lies near a pose that does explain the
readings: the estimate, or another one, which is listed. No pose that explains them is refuted, so the answer is a proof
as far as the bounds hold.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import chdtri, ndtri

from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.pose_certificate_kernels import DistanceGrid, distance_grid, explains, search
from mathnavi.interfaces.bounds import CountInMemory, Positive, Probability, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from mathnavi.models.field.wall import Wall
from mathnavi.models.unicycle.kernels import integrate, wrapped
from mathnavi.models.unicycle.mission import RangingMission

_NODES = 400  # of the grid of distances, along the longer side of the room
MOST_OTHERS = 8
_MOST_BOXES = 20_000
_SIZES = np.array([[0.25, math.pi / 16], [0.06, 0.06], [0.008, 0.008]])
"""[m, rad] half-widths of the first boxes, those at which a pose is sought, and those at which a box is undecided"""
_OBLIQUE = 3.0  # largest change of a range if its ray's end moves by 1, unless it nearly grazes the wall
LEAST_SPREAD = 0.2  # of 1 - kappa r: with more noise a reading has too little information
_ALONG = (0.25, 0.5, 0.75)  # shares of a ray that have to be within the wall


@configuration
class PoseCertificateConfig:
    """Readings that a certificate uses, and its assumptions about them."""

    readings: CountInMemory = 16
    """number of sets of ranges, the newest one included"""
    spacing: Positive = 0.25
    """time between two sets of ranges [s]"""
    probability: Probability = 1e-3
    """probability that the bounds of all readings together exclude the true pose"""
    radius: Positive = 0.4
    """distance within which a pose counts as the estimate [m]"""
    angle: Positive = 0.4
    """difference of headings within which a pose counts as the estimate [rad]"""


@dataclass(frozen=True, eq=False)
class Certification:
    """Result of a certificate."""

    certified: bool  # the estimate explains the readings, and every pose that does is near it
    others: Array  # (k, 3) [m, m, rad] poses that explain them and are not near; 8 at most
    complete: bool  # all poses that do are near the estimate or one of the others
    boxes: int  # that were examined


@dataclass(frozen=True, eq=False)
class Sample:
    """Ranges with the pose by dead reckoning at which they were read, and how much odometry there was before."""

    pose: Array  # (3,)
    ranges: Array  # (l,) [m]
    path: Array  # (2,) [m, rad] driven and turned, in absolute terms
    variance: Array  # (2,) [m^2, rad^2] of the sum of the odometry's noise

    def drift(self, other: Sample, kappa: float, bias: float) -> tuple[float, float]:
        """Error [m, rad] that the motion between this and another sample may have, with a relative ``bias``."""
        driven, swept = np.abs(other.path - self.path)
        noise = kappa * np.sqrt(np.abs(other.variance - self.variance))
        drift_angle = float(noise[1] + 2.0 * bias * swept)
        return float(noise[0] + 2.0 * bias * driven + drift_angle * driven), drift_angle


class PoseCertificate:
    """Certificate of a pose: collects readings and finds the poses that explain them."""

    def __init__(self, config: PoseCertificateConfig, mission: RangingMission) -> None:
        self._config, self._model = config, RangeModel(mission)
        self._grid = _grid(mission.curve)
        self._bias, self._outliers = mission.odometry.bias, mission.ranging.outliers
        self._samples: list[Sample] = []
        self._reckoned, self._path, self._variance = np.zeros(3), np.zeros(2), np.zeros(2)
        self._t = self._t_sample = -math.inf

    def note(self, t: float, ranges: Array, u: Array) -> None:
        """Note ranges (l,) [m] of t [s], NaN where lost, and the mean input u (2,) [m/s, rad/s] since the last call."""
        if t > self._t > -math.inf:
            dt = t - self._t
            self._reckoned = integrate(self._reckoned, float(u[0]), float(u[1]), dt)
            self._path = self._path + np.abs(u) * dt
            self._variance = self._variance + self._model.W * dt * dt
        self._t = t
        sample = Sample(self._reckoned, ranges.copy(), self._path, self._variance)
        if t - self._t_sample < self._config.spacing * (1.0 - 1e-9) and len(self._samples) > 1:
            self._samples[-1] = sample  # the newest one stays until it is old enough
            return
        self._samples.append(sample)
        self._samples = self._samples[-self._config.readings :]
        self._t_sample = t

    @property
    def is_full(self) -> bool:
        """True once there are ``readings`` sets of ranges."""
        return len(self._samples) == self._config.readings

    def check(self, estimate: Array) -> Certification:
        """Certify an ``estimate`` (3,) [m, m, rad] of the pose at the time of the last readings."""
        rays, rows, outliers, limit = self.constraints()
        if not len(rays):
            return Certification(False, np.empty((0, 3)), False, 0)
        config, wall = self._config, self._model.wall
        then, now = self._middle.pose, self._samples[-1].pose
        pose = self.at_middle(estimate)
        found, undecided, boxes = search(
            wall, self._grid, (rows, outliers, limit), rays, pose, (config.radius, config.angle), _SIZES,
            (MOST_OTHERS, _MOST_BOXES),
        )  # fmt: skip
        alone = undecided == 0 and not len(found)
        others = np.array([composed(other, relative(then, now)) for other in found]).reshape(-1, 3)
        return Certification(alone and bool(explains(wall, rays, outliers, limit, pose)), others, undecided == 0, boxes)

    def at_middle(self, pose: Array) -> Array:
        """Pose (3,) at the middle sample of a robot that is at ``pose`` (3,) now, by odometry."""
        return composed(np.asarray(pose, np.float64), relative(self._samples[-1].pose, self._middle.pose))

    @property
    def _middle(self) -> Sample:
        """The sample to whose pose the others are related: by it the motion in between is off the least."""
        return self._samples[len(self._samples) // 2]

    def constraints(self) -> tuple[Array, Array, int, float]:
        """Rays (m, 7), rows of the tests of ``search``, the number of rays that may be outliers, and the limit of the
        sum.
        """
        config, samples = self._config, self._samples
        count = sum(int(np.isfinite(sample.ranges).sum()) for sample in samples)
        if not count:
            return np.empty((0, 7)), np.empty((0, 6)), 0, math.inf
        outliers = most_outliers(count, self._outliers, 0.5 * config.probability)
        kappa = -float(ndtri(0.25 * config.probability / (count + 4 * len(samples))))
        # A range of relative noise r is known from its reading y: it is y / (1 - kappa r) at most.
        spread = 1.0 - kappa * self._model.relative
        if spread < LEAST_SPREAD:
            return np.empty((0, 7)), np.empty((0, 6)), 0, math.inf
        limit = math.inf if outliers else float(chdtri(count, 0.5 * config.probability))
        rays: list[tuple[float, ...]] = []
        ends: list[tuple[float, ...]] = []
        within: list[tuple[float, ...]] = []
        for sample in reversed(samples):
            x, y, turned = relative(self._middle.pose, sample.pose)
            drift, drift_angle = sample.drift(self._middle, kappa, self._bias)
            within.append((x, y, math.hypot(x, y), 0.0, drift, 1.0))
            deviations = np.sqrt(self._model.range_variance(sample.ranges)) / spread
            for rho, alpha, sigma in zip(sample.ranges.tolist(), self._model.angles, deviations.tolist(), strict=True):
                if not math.isfinite(rho):
                    continue
                beta, bound, moved = turned + float(alpha), kappa * sigma, drift + rho * drift_angle
                c, s = math.cos(beta), math.sin(beta)
                rays.append((x, y, beta, rho, _OBLIQUE * moved, sigma, bound + _OBLIQUE * moved))
                ends.append(
                    (x + rho * c, y + rho * s, math.hypot(x + rho * c, y + rho * s), bound + moved, moved, sigma)
                )
                for share in () if outliers else _ALONG:
                    r = share * max(0.0, rho - bound)
                    far = math.hypot(x + r * c, y + r * s)
                    within.append((x + r * c, y + r * s, far, 0.0, drift + r * drift_angle, 1.0))
        return np.array(rays), np.array(ends + within), outliers, limit


def relative(now: Array, then: Array) -> tuple[float, float, float]:
    """Pose ``then`` (3,) in the axes of ``now`` (3,)."""
    c, s = math.cos(now[2]), math.sin(now[2])
    dx, dy = then[0] - now[0], then[1] - now[1]
    return float(c * dx + s * dy), float(c * dy - s * dx), float(then[2] - now[2])


def composed(pose: Array, step: tuple[float, float, float]) -> Array:
    """Pose (3,) that a step in the axes of ``pose`` (3,) leads to."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = pose[0] + c * step[0] - s * step[1], pose[1] + s * step[0] + c * step[1]
    return np.array([x, y, wrapped(float(pose[2]) + step[2])])


def most_outliers(count: int, fraction: float, probability: float) -> int:
    """Least number that the outliers among ``count`` readings exceed with at most this probability."""
    if fraction <= 0.0:
        return 0
    from scipy.stats import binom

    return int(binom.isf(probability, count, fraction))


@lru_cache(maxsize=4)
def _grid(wall: Wall) -> DistanceGrid:
    grid: DistanceGrid = distance_grid(wall.wall, _NODES, _chord_error(wall) if isinstance(wall, Curve) else 0.0)
    return grid


def _chord_error(curve: Curve) -> float:
    """Distance [m] between a curve and its chords, at most."""
    step = 2.0 * math.pi / (len(curve.polyline) - 1)
    second_derivative = curve.second_derivative(np.linspace(0.0, 2.0 * math.pi, 4096))
    return float(np.linalg.norm(second_derivative, axis=1).max() * step**2 / 8.0)
