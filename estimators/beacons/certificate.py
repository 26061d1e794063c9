"""A certificate of a pose among beacons: no pose explains the last ranges except those near the estimate.

A pose x at the middle one of the last n ranges, with a scale s = 1 / (1 + c), explains them if

    | |p(x m_k) - b_i| - s y_ki | <= b_ki    for all k, i, except as many outliers as are declared,

x m_k being the pose to which odometry leads from it, p its place; and if the sum of the squares over the variances,
without the largest ones that may be outliers, is within its chi-square limit. The bounds are kappa standard deviations
of the range, max(1, s) times, plus the largest error of the motion in between, with constant errors of odometry up to
twice their declared deviation. The true pose satisfies all of them except with the configured probability. The branch
and bound is that of ``ranging.pose_certificate``, from all poses that the ranges allow on: it needs no surroundings.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtri

from mathnavi.estimators.beacons.kernels import RANGE
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.estimators.ranging.pose_certificate import (
    LEAST_SPREAD,
    MOST_OTHERS,
    Certification,
    Sample,
    composed,
    most_outliers,
    relative,
)
from mathnavi.estimators.ranging.pose_certificate_kernels import explains, search
from mathnavi.estimators.stagewise.model import StageBuilder
from mathnavi.interfaces.bounds import CountInMemory, Positive, PositiveFraction, Probability, configuration
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.unicycle.beacons import BeaconMission
from mathnavi.models.unicycle.kernels import integrate

_MOST_BOXES = 100_000
_SHARES = np.array([[0.5, 0.0], [0.15, 0.15], [0.02, 0.02]])  # of radius and angle: half-widths of boxes, as ``search``
_FIRST_TURN = math.pi / 16  # [rad] half-width of the first boxes
_CELL = 1e-3  # [m] half of the step of a derivative
_NO_WALL = np.empty((0, 0))


@configuration
class BeaconCertificateConfig:
    """Ranges that a certificate uses, and its assumptions about them."""

    readings: CountInMemory = 40
    """number of ranges, the newest one included"""
    spacing: Positive = 0.5
    """time between two ranges to the same beacon [s]"""
    probability: Probability = 1e-3
    """probability that the bounds of all readings together exclude the true pose"""
    radius: PositiveFraction = 0.05
    """distance within which a pose counts as the estimate, as a share of the diagonal of the surroundings"""
    angle: Positive = 0.4
    """difference of headings within which a pose counts as the estimate [rad]"""


@dataclass(frozen=True, eq=False)
class BeaconCertification(Certification):
    """Result of a certificate."""

    bounds: Array  # (2,) [m, rad] within which of the estimate every pose is that explains the ranges, if certified


class BeaconCertificate:
    """Certificate of a pose among beacons: collects ranges and finds the poses that explain them."""

    def __init__(self, config: BeaconCertificateConfig, mission: BeaconMission) -> None:
        self._config, self._model = config, BeaconModel(mission)
        self._stages = StageBuilder(self._model)
        self._radius = config.radius * mission.longest  # [m]
        self._now = Sample(np.zeros(3), np.empty(0), np.zeros(2), np.zeros(2))
        self._samples: deque[Sample] = deque(maxlen=config.readings)  # ranges (2,): the beacon and the range [m]
        self._last: dict[int, float] = {}  # [s] of the newest one of each beacon

    def note(self, t: float, measurements: Sequence[Measurement], command: Array) -> None:
        """Note what was read until t [s]; ``command`` (2,) replaces odometry that there never was."""
        for stage in self._stages.add(t, measurements, command):
            for h, u in stage.inputs:
                self._now = Sample(
                    integrate(self._now.pose, float(u[0]), float(u[1]), h),
                    self._now.ranges,
                    self._now.path + np.abs(u[:2]) * h,
                    self._now.variance + u[2:] * h,
                )
            for y in stage.readings:
                for row in np.flatnonzero(np.isfinite(y)).tolist():
                    kind, i = self._model.entries[row]
                    spaced = stage.t - self._last.get(i, -math.inf) >= self._config.spacing * (1.0 - 1e-9)
                    if kind == RANGE and spaced:
                        self._last[i], now = stage.t, self._now
                        self._samples.append(Sample(now.pose, np.array([i, y[row]]), now.path, now.variance))

    @property
    def is_full(self) -> bool:
        """True once there are ``readings`` ranges."""
        return len(self._samples) == self._config.readings

    def forget(self) -> None:
        """Begin again with no ranges."""
        self._samples.clear()

    def check(self, estimate: Array, scale_error: float) -> BeaconCertification:
        """Certify an ``estimate`` (3,) [m, m, rad] of the pose now, with that of the scale error c of the ranges."""
        rays, rows, outliers, limit, scales = self.constraints()
        middle, nowhere = self._middle, np.full(2, math.inf)
        if not len(rays):
            return BeaconCertification(False, np.empty((0, 3)), False, 0, nowhere)
        step = relative(middle.pose, self._now.pose)
        drift = np.array(self._now.drift(middle, self._kappa, self._model.mission.odometry.bias))
        nearby = np.array([self._radius, self._config.angle])
        sizes = _SHARES * nearby
        sizes[0, 1] = _FIRST_TURN
        scale = min(max(1.0 / (1.0 + scale_error), scales[0] - scales[1]), scales[0] + scales[1])
        pose = np.append(self.at_middle(estimate), scale)
        wall, limits = (_NO_WALL, _box(rays, scales, outliers)), (MOST_OTHERS, _MOST_BOXES)
        found, undecided, boxes = search(
            wall, (_NO_WALL, 0.0, 0.0, _CELL, 0.0), (rows, outliers, limit), rays, pose,
            (float(nearby[0]), float(nearby[1])), sizes, limits, (step[0], step[1]), scales,
        )  # fmt: skip
        alone = undecided == 0 and not len(found) and bool(explains(wall, rays, outliers, limit, pose))
        others = np.array([composed(other, step) for other in found]).reshape(-1, 3)
        bounds = nearby + drift + [drift[1] * math.hypot(step[0], step[1]), 0.0] if alone else nowhere
        return BeaconCertification(alone, others, undecided == 0, boxes, bounds)

    def at_middle(self, pose: Array) -> Array:
        """Pose (3,) at the middle sample of a robot that is at ``pose`` (3,) now, by odometry."""
        return composed(np.asarray(pose, np.float64), relative(self._now.pose, self._middle.pose))

    @property
    def _middle(self) -> Sample:
        return self._samples[len(self._samples) // 2]

    @property
    def _kappa(self) -> float:
        """Standard deviations of all bounds: of each range, of each motion and of the scale."""
        return -float(ndtri(0.25 * self._config.probability / (5 * len(self._samples) + 1)))

    def constraints(self) -> tuple[Array, Array, int, float, tuple[float, float]]:
        """Rays (m, 9) and rows (m, 9) of the tests of ``search``, the number of ranges that may be outliers, the limit
        of the sum, and the middle and half-width of the scales; no rays if there is too much noise.
        """
        empty = np.empty((0, 9)), np.empty((0, 9)), 0, math.inf, (1.0, 0.0)
        absolute, share, fraction, _ = self._model.errors[RANGE]
        kappa, bias = self._kappa, self._model.mission.odometry.bias
        widest = kappa * self._model.mission.range_scale  # of c
        if widest > 1.0 - LEAST_SPREAD:
            return empty
        low, high = 1.0 / (1.0 + widest), 1.0 / (1.0 - widest)
        spread = 1.0 - kappa * share * high
        if spread < LEAST_SPREAD:
            return empty
        half = 0.5 * self._config.probability
        outliers = most_outliers(len(self._samples), fraction, half)
        rays, rows = [], []
        for sample in self._samples:
            x, y, _ = relative(self._middle.pose, sample.pose)
            drift, _ = sample.drift(self._middle, kappa, bias)
            i, rho = int(sample.ranges[0]), float(sample.ranges[1])
            sigma = math.hypot(absolute, share * high * rho) / spread
            bound = kappa * sigma + drift
            beacon = self._model.places[i].tolist()
            rays.append((x, y, 0.0, rho, drift, sigma, bound, *beacon))
            rows.append((x, y, math.hypot(x, y), bound, drift, sigma, *beacon, rho))
        limit = float(chdtri(len(rays), half))
        return np.array(rays), np.array(rows), outliers, limit, (0.5 * (low + high), 0.5 * (high - low))


def _box(rays: Array, scales: tuple[float, float], outliers: int) -> Array:
    """Corners (2, 2) [m] of a box that holds all places at the middle sample from which the ranges can be."""
    high = scales[0] + scales[1]
    far = np.hypot(rays[:, 0], rays[:, 1]) + high * rays[:, 3] + max(1.0, high) * rays[:, 6]
    least = np.sort(rays[:, 7:9] - far[:, None], axis=0)[-1 - outliers]
    most = np.sort(rays[:, 7:9] + far[:, None], axis=0)[outliers]
    return np.array([least, np.maximum(least, most)])
