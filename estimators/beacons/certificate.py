"""A certificate of a pose among beacons: no pose explains the last ranges except those near the estimate.

A pose x at the middle one of the last n ranges, with a scale s = 1 / (1 + c), explains them if

    | |p(x m_k) - b_i| - s y_ki | <= b_ki    for all k, i, except as many outliers as are declared,

x m_k being the pose to which odometry leads from it, p its place; and if the sum of the squares over the variances,
without the largest ones that may be outliers, is within its chi-square limit. The bounds are kappa standard deviations
of the range, max(1, s) times, plus as many of the place to which the motion in between leads, to first order, with the
noise and the constant errors of odometry. The true pose satisfies all of them except with the configured probability.
The branch and bound is that of ``ranging.pose_certificate``, from all poses that the ranges allow on: it needs no
surroundings.

Poses that differ from the estimate by less than ``radius`` and twice the ``angle`` count as the estimate, or by less
than the angle where that is enough: ranges hardly say the heading of a robot that hardly moves. The bounds say which.

**History.** Every pose that was possible was within the bounds of the last certificate. By odometry it is now within
bounds that are wider by what the heading, known within theirs, leaves open of the motion since, and by the noise of
odometry. A pose beyond them is no other pose, however well it explains the last ranges: a robot that was certified is
not confused with its mirror image when it drives straight on. It rests on all certificates since its history began,
each of which may be wrong with the configured probability.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtri

from mathnavi.estimators.beacons.kernels import RANGE, STATES
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.estimators.ranging.pose_certificate import (
    LEAST_SPREAD,
    MOST_OTHERS,
    Certification,
    composed,
    most_outliers,
    relative,
)
from mathnavi.estimators.ranging.pose_certificate_kernels import explains, fitted, search
from mathnavi.estimators.stagewise.model import Piece, StageBuilder
from mathnavi.interfaces.bounds import CountInMemory, Positive, PositiveFraction, Probability, configuration
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.unicycle.beacons import BeaconMission
from mathnavi.models.unicycle.kernels import wrapped

_MOST_BOXES = 100_000
_SHARES = np.array([[0.5, 0.0], [0.15, 0.15], [0.02, 0.02]])  # of radius and angle: half-widths of boxes, as ``search``
_FIRST_TURN = math.pi / 16  # [rad] half-width of the first boxes
_WIDER = (2.0, 1.0)  # times the angle: what has to be shown, and what may be
_CELL = 1e-3  # [m] half of the step of a derivative
_BACK = np.array([-1.0, -1.0, 1.0, 1.0])  # an input with the densities of its noise, driven backwards
_NO_WALL = np.empty((0, 0))
_NO_GRID = _NO_WALL, 0.0, 0.0, _CELL, 0.0


@configuration
class BeaconCertificateConfig:
    """Ranges that a certificate uses, and its assumptions about them."""

    readings: CountInMemory = 80
    """number of ranges, the newest one included; with fewer than half as many there is no certificate"""
    spacing: Positive = 0.5
    """time between two ranges to the same beacon [s]"""
    probability: Probability = 1e-3
    """probability that the bounds of all readings together exclude the true pose"""
    radius: PositiveFraction = 0.08
    """distance within which a pose counts as the estimate, as a share of the diagonal of the surroundings"""
    angle: Positive = 0.6
    """half of the difference of headings within which a pose counts as the estimate [rad]"""


@dataclass(frozen=True, eq=False)
class BeaconCertification(Certification):
    """Result of a certificate."""

    bounds: Array
    """(2,) [m, rad] of the estimate within which every pose is that explains the ranges, now and before; NaN if not
    certified"""


@dataclass(frozen=True, eq=False)
class _Reading:
    """Range to a beacon, and the motion since the reading before."""

    beacon: int
    rho: float  # [m]
    pieces: tuple[Piece, ...]


@dataclass(frozen=True, eq=False)
class _Motion:
    """Pose relative to the middle reading, and its standard deviations."""

    pose: Array  # (3,)
    place: float  # [m] in the direction in which it is largest
    heading: float  # [rad]


class BeaconCertificate:
    """Certificate of a pose among beacons: collects ranges and finds the poses that explain them."""

    def __init__(self, config: BeaconCertificateConfig, mission: BeaconMission) -> None:
        self._config, self._model = config, BeaconModel(mission)
        self._stages = StageBuilder(self._model)
        self._radius = config.radius * mission.longest  # [m]
        self._readings: deque[_Reading] = deque(maxlen=config.readings)
        self._since: list[Piece] = []  # motion since the newest one
        self._last: dict[int, float] = {}  # [s] of the newest one of each beacon
        self._bounded: tuple[Array, Array] | None = None  # estimate (3,) and bounds (2,) of the last certificate
        self._driven: list[Piece] = []  # motion since then

    def note(self, t: float, measurements: Sequence[Measurement], command: Array) -> None:
        """Note what was read until t [s]; ``command`` (2,) replaces odometry that there never was."""
        for stage in self._stages.add(t, measurements, command):
            if any(bool((u[2:] > self._model.W).any()) for _, u in stage.inputs):
                self.forget()  # it may have moved in any way while its odometry was missing
            self._since.extend(stage.inputs)
            if self._bounded is not None:
                self._driven.extend(stage.inputs)
            for y in stage.readings:
                for row in np.flatnonzero(np.isfinite(y)).tolist():
                    kind, i = self._model.entries[row]
                    spaced = stage.t - self._last.get(i, -math.inf) >= self._config.spacing * (1.0 - 1e-9)
                    if kind == RANGE and spaced:
                        self._readings.append(_Reading(i, float(y[row]), tuple(self._since)))
                        self._since, self._last[i] = [], stage.t

    @property
    def has_enough(self) -> bool:
        """True once there are half as many ranges as a certificate uses at most."""
        return 2 * len(self._readings) >= self._config.readings

    def forget(self) -> None:
        """Begin again with no ranges and no certificate."""
        self._readings.clear()
        self._since.clear()
        self._bounded = None

    def check(self, estimate: Array, scale_error: float) -> BeaconCertification:
        """Certify an ``estimate`` (3,) [m, m, rad] of the pose now, with that of the scale error c of the ranges."""
        motions, none, nowhere = self._motions(), np.empty((0, 3)), np.full(2, np.nan)
        rays, rows, outliers, limit, scales = self._constraints(motions)
        if not len(rays):
            return BeaconCertification(False, none, False, 0, nowhere)
        now, units = motions[-1], np.array([self._radius, self._config.angle])
        drift = self._kappa * np.array([now.place, now.heading])
        step = relative(np.zeros(3), now.pose)
        scale = min(max(1.0 / (1.0 + scale_error), scales[0] - scales[1]), scales[0] + scales[1])
        pose = np.append(self.at_middle(estimate), scale)
        wall, limits = (_NO_WALL, _box(rays, scales, outliers)), (MOST_OTHERS, _MOST_BOXES)
        start = np.array([*pose[:3], *np.zeros(4), scale, 0.0])
        best = fitted(_NO_GRID, rows, start, len(pose), scales)
        explained = any(
            _is_within(each, pose, units) and bool(explains(wall, rays, outliers, limit, each)) for each in (pose, best)
        )
        carried = self._carried(estimate) if explained else np.full(2, np.inf)  # else history may be what is wrong
        sizes = _SHARES * units
        sizes[0, 1] = _FIRST_TURN
        bounds, boxes = nowhere, 0
        for wider in _WIDER:
            nearby = units * [1.0, wider]
            found, undecided, examined = search(
                wall, _NO_GRID, (rows, outliers, limit), rays, pose, (float(nearby[0]), float(nearby[1])), sizes,
                limits, (step[0], step[1]), scales,
            )  # fmt: skip
            boxes += examined
            others = [composed(each, step) for each in found]  # each stands for those near it
            possible = [each for each in others if _is_within(each, estimate, carried + nearby)]
            if undecided or possible or not explained:
                break
            bounds = np.minimum(nearby + drift, carried)
        if np.isfinite(bounds).all():
            self._bounded, self._driven = (np.array(estimate, np.float64), bounds), []
            return BeaconCertification(True, none, True, boxes, bounds)
        return BeaconCertification(False, np.array(possible).reshape(-1, 3), undecided == 0, boxes, nowhere)

    def _carried(self, estimate: Array) -> Array:
        """Bounds (2,) [m, rad] of an ``estimate`` (3,) of the pose now, by the last certificate and odometry since;
        infinite without one.
        """
        if self._bounded is None:
            return np.full(2, np.inf)
        then, (place, heading) = self._bounded
        moved = self._chain([self._driven])[-1]
        off = estimate - composed(then, relative(np.zeros(3), moved.pose))
        turned = 2.0 * math.sin(0.5 * min(heading, math.pi)) * math.hypot(moved.pose[0], moved.pose[1])
        return np.array([
            place + turned + self._kappa * moved.place + math.hypot(off[0], off[1]),
            heading + self._kappa * moved.heading + abs(wrapped(float(off[2]))),
        ])  # fmt: skip

    @property
    def _kappa(self) -> float:
        """Standard deviations of all bounds: of each range, of each motion and of the scale."""
        return -float(ndtri(0.25 * self._config.probability / (7 * len(self._readings) + 1)))

    def at_middle(self, pose: Array) -> Array:
        """Pose (3,) at the middle reading of a robot that is at ``pose`` (3,) now, by odometry."""
        return composed(np.asarray(pose, np.float64), relative(self._motions()[-1].pose, np.zeros(3)))

    def constraints(self) -> tuple[Array, Array, int, float, tuple[float, float]]:
        """Constraints on a pose at the middle reading; see ``_constraints``."""
        return self._constraints(self._motions())

    def _motions(self) -> list[_Motion]:
        """Motions from the middle reading to each, and to now."""
        readings, middle = list(self._readings), len(self._readings) // 2
        before = [[(h, u * _BACK) for h, u in reversed(each.pieces)] for each in reversed(readings[1 : middle + 1])]
        after = [*(each.pieces for each in readings[middle + 1 :]), self._since]
        still = _Motion(np.zeros(3), 0.0, 0.0)
        return [*reversed(self._chain(before)), still, *self._chain(after)]

    def _chain(self, stages: Iterable[Iterable[Piece]]) -> list[_Motion]:
        """Motions to the end of each stage, with the covariance of all of them so far."""
        x, P, motions = np.zeros(STATES), self._model.covariance(np.zeros(3)), []
        for pieces in stages:
            for h, u in pieces:
                x, A, Q = self._model.transition(x, u, h)
                P = A @ P @ A.T + Q
            place = math.sqrt(max(0.0, float(np.linalg.eigvalsh(P[:2, :2])[-1])))
            motions.append(_Motion(x[:3].copy(), place, math.sqrt(float(P[2, 2]))))
        return motions

    def _constraints(self, motions: Sequence[_Motion]) -> tuple[Array, Array, int, float, tuple[float, float]]:
        """Rays (m, 9) and rows (m, 9) of the tests of ``search``, the number of ranges that may be outliers, the limit
        of the sum, and the middle and half-width of the scales; no rays if there is too much noise.
        """
        empty = np.empty((0, 9)), np.empty((0, 9)), 0, math.inf, (1.0, 0.0)
        absolute, share, fraction, _ = self._model.errors[RANGE]
        kappa = self._kappa
        widest = kappa * self._model.mission.range_scale  # of c
        if widest > 1.0 - LEAST_SPREAD:
            return empty
        low, high = 1.0 / (1.0 + widest), 1.0 / (1.0 - widest)
        spread = 1.0 - kappa * share * high
        if spread < LEAST_SPREAD:
            return empty
        half = 0.5 * self._config.probability
        outliers = most_outliers(len(self._readings), fraction, half)
        rays, rows = [], []
        for reading, motion in zip(self._readings, motions, strict=False):  # the last motion is that to now
            x, y = float(motion.pose[0]), float(motion.pose[1])
            drift, rho = kappa * motion.place, reading.rho
            sigma = math.hypot(absolute, share * high * rho) / spread
            bound = kappa * sigma + drift
            beacon = self._model.places[reading.beacon].tolist()
            rays.append((x, y, 0.0, rho, drift, sigma, bound, *beacon))
            rows.append((x, y, math.hypot(x, y), bound, drift, sigma, *beacon, rho))
        limit = float(chdtri(len(rays), half))
        return np.array(rays), np.array(rows), outliers, limit, (0.5 * (low + high), 0.5 * (high - low))


def _is_within(pose: Array, estimate: Array, bounds: Array) -> bool:
    """True if a ``pose`` (3,) is within ``bounds`` (2,) [m, rad] of an ``estimate`` (3,)."""
    off = pose - estimate
    return bool(math.hypot(off[0], off[1]) <= bounds[0] and abs(wrapped(float(off[2]))) <= bounds[1])


def _box(rays: Array, scales: tuple[float, float], outliers: int) -> Array:
    """Corners (2, 2) [m] of a box that holds all places at the middle sample from which the ranges can be."""
    high = scales[0] + scales[1]
    far = np.hypot(rays[:, 0], rays[:, 1]) + high * rays[:, 3] + max(1.0, high) * rays[:, 6]
    least = np.sort(rays[:, 7:9] - far[:, None], axis=0)[-1 - outliers]
    most = np.sort(rays[:, 7:9] + far[:, None], axis=0)[outliers]
    return np.array([least, np.maximum(least, most)])
