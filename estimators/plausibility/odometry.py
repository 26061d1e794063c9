"""Check of the ranges and the odometry of a unicycle within a wall against each other.

Over a window the odometry gives the path up to its start; the start, three numbers that are not known, is the one from
which the rays along the path are nearest to the ranges. It is searched from many poses, and then by least squares. A
turn rate in another unit, or the other way round, bends the path so that no start explains the ranges.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares

from mathnavi.estimators.plausibility.units import (
    BACKWARDS,
    CENTIMETRES,
    CENTIMETRES_PER_SECOND,
    CLOCKWISE,
    DEGREES_PER_SECOND,
    MILLIMETRES,
    MILLIMETRES_PER_SECOND,
    Unit,
    fit_only,
)
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.wall import Wall
from mathnavi.models.unicycle.mission import LEAST_NOISE, RangingMission

_DURATION, _WINDOWS, _TIMES = 6.0, 3, 16  # [s] of a window at most, number of windows, times of one with ranges
_FEWEST = 8  # times
_PLACES, _HEADINGS, _NEAR, _BEST = 7, 12, 30, 3  # of starts: along either axis, all around, to compare, to improve
_NEAR_A_STEP = 10  # starts that are compared in one step
_KEPT = 0.7  # of the rays: some are outliers
_WORSE, _NOISE = 4.0, 5.0  # times what the best way leaves unexplained, of the ranges, and the declared noise
_THOROUGH = 3  # times as many starts before a log is refused


@dataclass(frozen=True)
class _Way:
    """Way of reading."""

    speed: Unit | None = None
    turn_rate: Unit | None = None
    ranges: Unit | None = None

    @property
    def factors(self) -> Array:
        """Factors (3,) of speed, turn rate and ranges."""
        return np.array([1.0 if each is None else each.factor for each in (self.speed, self.turn_rate, self.ranges)])

    @property
    def parts(self) -> list[tuple[str, str, str]]:
        """Units, columns, and what is allowed."""
        columns = ("column 0 of odometry, the speed", "column 1 of odometry, the turn rate", "ranges")
        units = zip((self.speed, self.turn_rate, self.ranges), columns, strict=True)
        return [(unit.name, column, unit.allowed) for unit, column in units if unit is not None]


_WAYS = (
    _Way(turn_rate=DEGREES_PER_SECOND),
    _Way(turn_rate=CLOCKWISE),
    _Way(speed=BACKWARDS),
    _Way(speed=MILLIMETRES_PER_SECOND),
    _Way(speed=CENTIMETRES_PER_SECOND),
    _Way(speed=MILLIMETRES_PER_SECOND, turn_rate=DEGREES_PER_SECOND),
    _Way(ranges=MILLIMETRES),
    _Way(ranges=CENTIMETRES),
    _Way(ranges=MILLIMETRES, speed=MILLIMETRES_PER_SECOND),
)


def misread(mission: RangingMission, t: Array, ranges: Array, odometry: Array) -> Generator[None, None, str]:
    """Return the only other way in which the ``ranges`` (n, l) [m] at t (n,) [s] fit the wall along the path of the
    ``odometry`` (n, 2) [m/s, rad/s]; "" if they fit unchanged, or not at all. NaN where there is no reading.
    """
    windows = list(_windows(t, np.where(np.isfinite(ranges), ranges, np.nan), odometry))
    if not windows:
        return ""
    noise = max(LEAST_NOISE, math.hypot(mission.ranging.absolute, mission.ranging.relative * _size(mission.curve)))
    search = _Search(mission)
    as_is = yield from search.unexplained(windows, _Way())
    if as_is <= _NOISE * noise:
        return ""
    left = []
    for way in _WAYS:
        left.append((yield from search.unexplained(windows, way)) / way.factors[2])  # as a share of the ranges
    best = int(np.argmin(left))
    if as_is > _WORSE * left[best]:
        as_is = yield from _Search(mission, _THOROUGH).unexplained(windows, _Way())
    if as_is <= max(_WORSE * left[best], _NOISE * noise):
        return ""
    return fit_only("ranges and odometry", "the wall", _WAYS[best].parts)


@dataclass(frozen=True, eq=False)
class _Window:
    dt: Array  # (k,) [s]
    inputs: Array  # (k, 2) over each
    rows: Array  # (m,) of the times with ranges, from 0 to k
    ranges: Array  # (m, l) [m]

    def path(self, way: _Way) -> Array:
        """Poses (m, 3) of the times with ranges, from the origin on."""
        forward, turn = (self.inputs * way.factors[:2] * self.dt[:, None]).T
        phi = np.concatenate([[0.0], np.cumsum(turn)])
        chord = forward * np.sinc(0.5 * turn / math.pi)
        steps = chord * np.array([np.cos(phi[:-1] + 0.5 * turn), np.sin(phi[:-1] + 0.5 * turn)])
        places = np.concatenate([np.zeros((2, 1)), np.cumsum(steps, axis=1)], axis=1)
        poses: Array = np.vstack([places, phi]).T[self.rows]
        return poses


def _windows(t: Array, ranges: Array, odometry: Array) -> Iterator[_Window]:
    """Windows that are spread over a log."""
    ranged = np.flatnonzero(~np.isnan(ranges).all(axis=1))
    driven = ~np.isnan(odometry).any(axis=1)
    if len(ranged) < _FEWEST or not driven.any():
        return
    length = min(_DURATION, t[ranged[-1]] - t[ranged[0]])
    starts = ranged[t[ranged] + length <= t[ranged[-1]] + 1e-9]
    last = np.maximum.accumulate(
        np.where(driven, np.arange(len(t)), int(np.argmax(driven)))
    )  # the reading that is held
    for first in starts[np.unique(np.linspace(0, len(starts) - 1, _WINDOWS).astype(np.intp))]:
        end = int(np.searchsorted(t, t[first] + length, side="right"))
        rows = ranged[(ranged >= first) & (ranged < end)]
        if len(rows) >= _FEWEST:
            rows = rows[np.unique(np.linspace(0, len(rows) - 1, _TIMES).astype(np.intp))]
            yield _Window(np.diff(t[first:end]), odometry[last[first + 1 : end]], rows - first, ranges[rows])


@dataclass(frozen=True, eq=False)
class _Search:
    """Search of the pose at the start of a window."""

    mission: RangingMission
    denser: int = 1
    starts: Array = field(init=False)  # (s, 3)
    expected: Array = field(init=False)  # (s, l) [m] ranges from them

    def __post_init__(self) -> None:
        curve, count = self.mission.curve, _PLACES * self.denser
        axes = [
            np.linspace(low, high, count + 2)[1:-1]
            for low, high in zip(curve.polyline.min(0), curve.polyline.max(0), strict=True)
        ]
        places = [(x, y) for x in axes[0] for y in axes[1] if curve.contains(np.array([x, y]))]
        if not places:
            places.append((curve.centre[0], curve.centre[1]))
        turns = np.linspace(0.0, 2.0 * math.pi, _HEADINGS * self.denser, endpoint=False)
        starts = np.array([(x, y, phi) for x, y in places for phi in turns])
        object.__setattr__(self, "starts", starts)
        object.__setattr__(self, "expected", self._rays(starts))

    def unexplained(self, windows: Sequence[_Window], way: _Way) -> Generator[None, None, float]:
        """Median over the windows of the ranges that the best start leaves unexplained [m]."""
        found = []
        for window in windows:
            path, measured = window.path(way), window.ranges * way.factors[2]
            first = _rest(self.expected - measured[0])
            near = self.starts[np.argsort(first)[: _NEAR * self.denser]]
            whole = []
            for k, start in enumerate(near):
                whole.append(_rest((self._along(start, path) - measured).ravel()))
                if not k % _NEAR_A_STEP:
                    yield
            best = math.inf
            for k in np.argsort(whole)[: _BEST * self.denser]:
                yield
                best = min(best, self._improved(near[k], path, measured))
            found.append(best)
        return float(np.median(found))

    def _improved(self, start: Array, path: Array, measured: Array) -> float:
        """Rest [m] that the best start near this one leaves."""
        known = ~np.isnan(measured)

        def errors(x: Array) -> Array:
            return (self._along(x, path) - measured)[known]

        scale = max(float(np.median(np.abs(errors(start)))), LEAST_NOISE)
        x = least_squares(errors, start, loss="soft_l1", f_scale=scale, max_nfev=12).x
        return float(_rest(errors(x)))

    def _along(self, start: Array, path: Array) -> Array:
        """Ranges (m, l) [m] along a path (m, 3) from a start (3,)."""
        c, s = math.cos(start[2]), math.sin(start[2])
        turned = path[:, :2] @ np.array([[c, s], [-s, c]])
        return self._rays(np.column_stack([turned + start[:2], path[:, 2] + start[2]]))

    def _rays(self, poses: Array) -> Array:
        """Ranges (m, l) [m] from poses (m, 3); beyond the wall as far as the wall is large."""
        rays = np.array([self.mission.ranges(pose) for pose in poses])
        return np.where(np.isfinite(rays), rays, _size(self.mission.curve))


def _rest(errors: Array) -> Array:
    """Root mean square of the smallest errors (..., l), NaN left out."""
    squares = np.sort(np.square(np.atleast_2d(errors)), axis=-1)  # NaN last
    kept = np.ceil(_KEPT * np.sum(~np.isnan(squares), axis=-1, keepdims=True))
    smallest = np.where(np.arange(squares.shape[-1]) < kept, squares, np.nan)
    rest: Array = np.sqrt(np.nanmean(smallest, axis=-1))
    return rest if np.ndim(errors) > 1 else rest[0]


def _size(curve: Wall) -> float:
    """Distance [m] between opposite corners of the rectangle about the wall."""
    corners = curve.polyline
    return float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0)))
