"""Pose estimation of a robot within a known wall from its range sensors, on your own data (thesis, Paper C).

A pose is (x_1, x_2, phi) [m, m, rad]; sensor i measures along phi + alpha_i, counter-clockwise. Odometry is the mean
input over a step, (u_1, u_2) [m/s, rad/s].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mathnavi.estimators.plausibility.checks import FirstReadings
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.failures import raising
from mathnavi.interfaces.fields import configured
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.short_tables import Row, html_table, short_table
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status, status_text
from mathnavi.models.field.curve import Curve
from mathnavi.models.field.wall import Wall
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.sim.plugin.registry import PluginSpec, checked_estimator, load

_RESAMPLED = 2048  # points of a polygon


@dataclass(frozen=True, eq=False, repr=False)
class PoseEstimate:
    """Estimate of a pose."""

    estimate: Estimate

    @property
    def t(self) -> float:
        """Time [s] since the first step."""
        return self.estimate.t

    @property
    def pose(self) -> Array:
        """Pose (3,) [m, m, rad]; the wall's centre as long as nothing is known."""
        return self.estimate.x

    @property
    def covariance(self) -> Array | None:
        """Covariance (3, 3) of the pose."""
        return self.estimate.covariance

    @property
    def status(self) -> Status:
        """Status: OK, INITIALISING, DEGRADED or LOST; see ``Status``."""
        return self.estimate.status

    def _table(self) -> tuple[str, list[Row]]:
        deviation = [np.nan] * 3 if self.covariance is None else np.sqrt(np.diag(self.covariance)).tolist()
        return f"estimate at {self.t:.6g} s: {status_text(self.estimate)}", [
            (name, f"{value:.4g}" + ("" if np.isnan(sigma) else f" ± {sigma:.2g}"), unit)
            for name, value, sigma, unit in zip(
                ("x_1", "x_2", "phi"), self.pose.tolist(), deviation, ("m", "m", "rad"), strict=True
            )
        ]

    def __repr__(self) -> str:
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        return html_table(*self._table())


class PoseObserver:
    """Estimator of a robot's pose, stepped through ranges and odometry.

    ``wall`` is a closed curve, ``ellipse(a, b)``, ``wall_through(points)`` or a ``Curve``, or a ``Polygon``. ``angles``
    (l,) [rad] are those of the sensors relative to the heading. ``method`` is a plug-in, feasible_set_bank, range_ekf,
    range_iekf, range_ukf, moving_horizon, range_particle or, within a smooth curve, range_observer, and ``fields`` are
    its fields.
    ``range_noise`` [m] and ``odometry_noise`` [m/s, rad/s] are standard deviations of the sensors. ``start`` (3,) is
    the pose at the start if it is known, and ``period`` [s] the usual length of a step. ``mounting`` (1, 2) or (l, 2)
    [m] is where the sensors are, ahead of the middle of the axle and to its left, if elsewhere. ``map_deviation`` [m,
    rad] is by how much walls that were measured may be off, as standard deviations. ``trust_units`` says that readings
    are right that fit the wall in another unit or with another sign only.

    Raises PluginError for an unknown method, FieldError for a field or a value that is not allowed.
    """

    def __init__(
        self,
        wall: Wall,
        angles: Sequence[float],
        *,
        method: str = "feasible_set_bank",
        range_noise: float = 0.01,
        odometry_noise: tuple[float, float] = (0.02, 0.02),
        start: tuple[float, float, float] | None = None,
        period: float = 0.01,
        mounting: Sequence[tuple[float, float]] = (),
        map_deviation: tuple[float, float] = (0.0, 0.0),
        trust_units: bool = False,
        **fields: Any,
    ) -> None:
        with raising(FieldError):
            mission = RangingMission(
                wall,
                tuple(map(float, angles)),
                RangeQuality(absolute=range_noise),
                OdometryQuality(noise=odometry_noise),
                None if start is None else KnownStart(start),
                period=period,
                map_deviation=map_deviation,
                mounting=tuple(mounting),
            )
            found = load("estimators", method)
            spec = PluginSpec(found, configured(found.Config(), fields))
            self._estimator: Estimator = checked_estimator(spec, mission)
        self._mission, self._method, self._t = mission, method, 0.0
        self._first_readings = None if trust_units else FirstReadings(mission)

    def step(self, dt: float, ranges: ArrayLike | None, odometry: ArrayLike) -> PoseEstimate:
        """Return the estimate at the end of a step of dt [s].

        ``ranges`` (l,) [m] are read at its end, NaN where a ray was lost; None if all were. ``odometry`` (2,) [m/s,
        rad/s] is the mean speed and turn rate over the step, as the wheels measure it.

        Once the first readings have shown that they fit the wall only in another unit or with another sign, every
        estimate is LOST, and its message says so.

        Raises FieldError for a dt that is negative, and for arrays of another shape.
        """
        count = self._mission.sensors
        if not (np.isfinite(dt) and dt >= 0.0):
            raise FieldError(f"dt = {dt!r}; allowed: a finite number >= 0 [s]")
        u = np.array(odometry, dtype=np.float64)
        rho = np.full(count, np.nan) if ranges is None else np.array(ranges, dtype=np.float64)
        if u.shape != (2,) or rho.shape != (count,) or not np.isfinite(u).all():
            raise FieldError(f"ranges {rho.shape}, odometry {u.tolist()}; allowed: ({count},) and two finite numbers")
        self._t += float(dt)
        readings = [Measurement("ranges", self._t, rho), Measurement("odometry", self._t, u)]
        estimate = self._estimator.update(self._t, readings, u)
        if self._first_readings is not None:
            estimate = self._first_readings.judged(estimate, self._t, {"ranges": rho, "odometry": u}, u)
        return PoseEstimate(estimate)

    def __repr__(self) -> str:
        rows = [("wall", self._mission.curve.name, ""), ("sensors", str(self._mission.sensors), "")]
        return short_table(f"{self._method}", rows)


def feasible_set_bank(wall: Wall, angles: Sequence[float], **options: Any) -> PoseObserver:
    """Build the feasible-set bank (Definition C.9), a ``PoseObserver`` that finds the pose from any start.

    Its first readings determine on which set FS_y the pose is; Kalman filters start on it, and those that contradict
    the rays while the robot moves are dropped. Arguments, units and errors are those of ``PoseObserver``.
    """
    return PoseObserver(wall, angles, method="feasible_set_bank", **options)


def wall_through(points: ArrayLike, order: int = 16) -> Curve:
    """Fit a smooth closed curve through measured points (n, 2) [m], in their order, by a Fourier series:

        theta(s) = sum_k a_k cos ks + b_k sin ks,   s proportional to the length along the polygon.

    Raises FieldError for fewer than three points, and for points whose curve crosses itself.
    """
    corners = np.array(points, dtype=np.float64)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3 or not np.isfinite(corners).all():
        raise FieldError(f"points have shape {corners.shape}; allowed: (n, 2) finite numbers [m] with n >= 3")
    if not 1 <= order < _RESAMPLED // 4:
        raise FieldError(f"order = {order!r}; allowed: 1 to {_RESAMPLED // 4 - 1}")
    closed = np.vstack([corners, corners[:1]])
    x, y = closed.T
    if float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) < 0.0:
        closed = closed[::-1]  # counter-clockwise
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    if not (np.diff(along) > 0.0).all():
        raise FieldError("points: two consecutive ones are the same; allowed: different ones")
    s = np.linspace(0.0, along[-1], _RESAMPLED, endpoint=False)
    series = [np.fft.rfft(np.interp(s, along, closed[:, axis]))[: order + 1] / _RESAMPLED for axis in range(2)]
    rows = []
    for k in range(order + 1):
        scale = 1.0 if k == 0 else 2.0
        (c_x, c_y) = (scale * complex(each[k]) for each in series)
        rows.append((c_x.real, -c_x.imag if k else 0.0, c_y.real, -c_y.imag if k else 0.0))
    with raising(FieldError):
        return Curve(tuple(rows), f"wall through {len(corners)} points")
