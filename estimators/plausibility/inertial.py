"""Check of an IMU against the position fixes of the same vehicle.

Over a window the gyro's rates give the rotation D since its start, and the fixes lie on

    p = p_0 + v_0 t + R_0 S + g t^2 / 2,        S = the integral, twice, of D f,

f being the specific force that the accelerometer reads. p_0, v_0 and the attitude R_0 at the start of the window are
not known; those that leave the least of the fixes unexplained are taken, R_0 by a singular value decomposition. A
gyro or an accelerometer in another unit leaves metres unexplained. A vehicle that hardly turns shows nothing of the
unit of its gyro. An accelerometer that reads the other way fits as well with the vehicle upside down: so the first R_0
is compared with the attitude at the start that the mission states.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mathnavi.estimators.plausibility.base_imu import products
from mathnavi.estimators.plausibility.units import DEGREES_PER_SECOND, GRAVITIES, MILLIGRAVITIES, Unit, fit_only
from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.dynamics import ATTITUDE
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.quaternion import rotation

_SHORTEST, _FIXES, _WINDOWS = 4.0, 8, 6  # [s] and least number of fixes of a window, number of windows
_LONGER, _MOST = (1.0, 4.0, 16.0), 20_000  # lengths of windows, of the shortest, and most readings of one
_WORSE = 4.0  # times the least that is left unexplained, from which a way contradicts the fixes
_NOISE = 5.0  # times the noise of a fix, likewise
_NEEDED = 2.0  # times what a gyro leaves unexplained, without it: only then it shows its unit
_UPSIDE_DOWN = 2.0  # [rad] between the first attitude and the stated one

_LEAST_NOISE = 1e-3  # [m] of a fix

_AS_READ = np.ones(3)


@dataclass(frozen=True)
class _Way:
    """Way of reading an IMU: factors (3,) of both sensors, along the axes."""

    gyro: Array = field(default_factory=lambda: _AS_READ)
    accelerometer: Array = field(default_factory=lambda: _AS_READ)
    gravity: float = 1.0  # share of gravity that the accelerometer reads
    parts: tuple[tuple[str, str, str], ...] = ()  # units, columns, and what is allowed


def _in(gyro: Unit | None, accelerometer: Unit | None) -> _Way:
    turning, forces = (_AS_READ if unit is None else _AS_READ * unit.factor for unit in (gyro, accelerometer))
    columns = ((gyro, "columns 0, 1, 2, the gyro"), (accelerometer, "columns 3, 4, 5, the accelerometer"))
    return _Way(
        turning, forces, parts=tuple((unit.name, where, unit.allowed) for unit, where in columns if unit is not None)
    )


_DEGREES = _in(DEGREES_PER_SECOND, None)
_FORCES = tuple(_in(gyro, unit) for gyro in (None, DEGREES_PER_SECOND) for unit in (GRAVITIES, MILLIGRAVITIES))
_LACKS = ("without gravity", "columns 3, 4, 5, the accelerometer", "specific force, gravity up at rest: add it")
_UNITS = (_DEGREES, *_FORCES, _Way(gravity=0.0, parts=(_LACKS,)))
_DOWN = np.array([1.0, -1.0, -1.0])
_AXES = (("the other way", "columns 1, 2, 4, 5, along y and z", "axes with z up: multiply by -1"),)
_OTHER_AXES = (
    _in(None, Unit("with the other sign", -1.0, "gravity up at rest: multiply by -1")),
    _Way(_DOWN, _DOWN, parts=_AXES),
)


def misread(mission: QuadrotorMission, t: Array, imu: Array, fixes: Array) -> Generator[None, None, str]:
    """Return the only other way in which the readings ``imu`` (n, 6) [rad/s, m/s^2] fit the position ``fixes`` (n, 3)
    [m] at t (n,) [s] and the attitude at the start that the mission states; "" if they fit unchanged, or not at all.
    """
    for longer in _LONGER:
        windows = list(_windows(t, imu, fixes, longer))
        said = (yield from _misread(mission, windows)) if windows else ""
        if said:
            return said
    return ""


def _misread(mission: QuadrotorMission, windows: list[_Window]) -> Generator[None, None, str]:
    """Say what ``misread`` says, by windows of one length."""
    gravity, noise = mission.vehicle.gravity, max(mission.flight.position_noise, _LEAST_NOISE)
    as_is = yield from _unexplained(windows, _Way(), gravity)
    if as_is > _NOISE * noise:
        way, left = yield from _best(windows, _UNITS, gravity)
        if as_is <= _WORSE * left:
            return ""
        if way.gyro is not _AS_READ:
            still = yield from _unexplained(windows, replace(way, gyro=0.0 * _AS_READ), gravity)
            if still <= _NEEDED * left:
                return ""
        return fit_only("imu", "the fixes", way.parts)
    start = rotation(mission.start_state[ATTITUDE])
    if _tilt(windows[0], _Way(), gravity, start) > _UPSIDE_DOWN:
        upright = [way for way in _OTHER_AXES if _tilt(windows[0], way, gravity, start) < math.pi - _UPSIDE_DOWN]
        if upright:
            way, left = yield from _best(windows, upright, gravity)
            if left <= _WORSE * max(as_is, noise):
                return fit_only("imu", "the mission's attitude at the start", way.parts)
    return ""


def _best(windows: list[_Window], ways: Sequence[_Way], gravity: float) -> Generator[None, None, tuple[_Way, float]]:
    """Way that leaves the least of the fixes unexplained, and what that is [m]."""
    left = []
    for way in ways:
        left.append((yield from _unexplained(windows, way, gravity)))
    best = int(np.argmin(left))
    return ways[best], left[best]


@dataclass(frozen=True, eq=False)
class _Window:
    t: Array  # (k + 1,) [s] of the IMU, from the start of the window
    imu: Array  # (k, 6) held before each time but the first
    rows: Array  # (m,) of the fixes
    fixes: Array  # (m, 3) [m]

    def parts(self, way: _Way) -> tuple[Array, Array]:
        """Fixes (m, 3) [m] and S (m, 3) [m], without what p_0 and v_0 explain of them."""
        dt = np.diff(self.t)[:, None]
        turned = products(Rotation.from_rotvec(self.imu[:, :3] * way.gyro * dt).as_matrix())
        force = self.imu[:, 3:] * way.accelerometer
        force[1:] = (turned[:-1] @ force[1:, :, None])[:, :, 0]
        speed = np.vstack([np.zeros(3), np.cumsum(force * dt, axis=0)])
        S = np.vstack([np.zeros(3), np.cumsum(0.5 * (speed[1:] + speed[:-1]) * dt, axis=0)])
        return self.fixes, S[self.rows]


def _windows(t: Array, imu: Array, fixes: Array, longer: float) -> Iterator[_Window]:
    """Windows that are spread over a log, ``longer`` times the shortest."""
    fixed = np.flatnonzero(~np.isnan(fixes).any(axis=1))
    read: NDArray[np.bool_] = np.logical_not(np.isnan(imu).any(axis=1))
    if len(fixed) < _FIXES or not read.any():
        return
    length = longer * max(_SHORTEST, _FIXES * float(np.median(np.diff(t[fixed]))))
    starts = fixed[t[fixed] + length <= t[fixed[-1]]]
    if not len(starts):
        return
    last = np.maximum.accumulate(np.where(read, np.arange(len(t)), 0))  # the reading that is held
    for first in starts[np.unique(np.linspace(0, len(starts) - 1, _WINDOWS).astype(np.intp))]:
        end = int(np.searchsorted(t, t[first] + length, side="right"))
        rows = fixed[(fixed >= first) & (fixed < end)]
        if len(rows) >= _FIXES and end - first <= _MOST and read[first:end].mean() > 0.1 and read[: first + 1].any():
            yield _Window(t[first:end] - t[first], imu[last[first + 1 : end]], rows - first, fixes[rows])


def _attitude(window: _Window, way: _Way, gravity: float) -> tuple[Array, float]:
    """R_0 (3, 3), and the root mean square [m] of what it leaves unexplained of the fixes."""
    p, S = window.parts(way)
    t = window.t[window.rows]
    p = p + 0.5 * gravity * way.gravity * np.outer(t * t, [0.0, 0.0, 1.0])
    straight, _ = np.linalg.qr(np.column_stack([np.ones_like(t), t]))
    p, S = (each - straight @ (straight.T @ each) for each in (p, S))
    U, _, V = np.linalg.svd(p.T @ S)
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    return R, math.sqrt(float(np.square(p - S @ R.T).sum()) / (3 * len(t)))


def _unexplained(windows: list[_Window], way: _Way, gravity: float) -> Generator[None, None, float]:
    """Median over the windows of what a way leaves unexplained [m]."""
    found = []
    for window in windows:
        found.append(_attitude(window, way, gravity)[1])
        yield
    return float(np.median(found))


def _tilt(window: _Window, way: _Way, gravity: float, start: Array) -> float:
    """Angle [rad] between the body's vertical axes by R_0 of a window and by the stated attitude ``start`` (3, 3)."""
    R, _ = _attitude(window, way, gravity)
    return math.acos(float(np.clip(R[:, 2] @ start[:, 2], -1.0, 1.0)))
