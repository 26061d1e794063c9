"""The set of feasible states FS_y = {x : h(x) = y} of a reading, and its value function (Definitions C.9, C.10).

Its dimension is 3 - l: with one sensor a surface, given here by its slices at constant headings; with two sensors
curves, closed or from wall to wall; with three or more, in general, points. Each curve is followed by continuation.
Starts are searched everywhere: a sensor that reads y_1 and points at theta(s) along e is at theta(s) - y_1 e, so the
poses that read y_1 are a surface over (s, phi), which a grid covers. A node is a start if the other ranges may equal y
within the cells around it, or if the surface ends there.

In a field that is not convex the output map jumps where a ray grazes the wall, and a curve may end there too.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mathnavi.estimators.observability.continuation import Equations, TracedCurve, on_curve, trace_curve
from mathnavi.estimators.observability.range_outputs import RangeOutputs, different_poses, pose_difference
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

_SAME = 1e-4  # two points with three sensors and more are the same
_SEEN = 1e-6  # [m] between the range that a pose was made for and the range that it reads


@dataclass(frozen=True)
class FeasibleSet:
    """FS_y of one reading. One of ``curves`` and ``points`` is empty."""

    y: Array  # (l,) [m]
    curves: tuple[TracedCurve, ...]  # of poses; with one sensor, slices at constant headings
    points: Array  # (k, 3)

    @property
    def poses(self) -> Array:
        """Sampled poses (n, 3) [m, m, rad] of the whole set."""
        return np.vstack([self.points, *(curve.points for curve in self.curves)])


def feasible_set(outputs: RangeOutputs, y: Array, step: float = 0.01, grid: int = 96, slices: int = 24) -> FeasibleSet:
    """Feasible set FS_y of a reading y (l,) [m] (Definition C.9), its curves at points ``step`` apart.

    ``grid`` is the number of nodes along s and along phi among which starts are searched, ``slices`` the number of
    headings at which the surface of a single sensor is cut. Raises ArgumentError for a reading that is not l positive
    numbers.
    """
    y = np.asarray(y, dtype=np.float64)
    if y.shape != (outputs.sensors,) or not (np.isfinite(y).all() and (y > 0.0).all()):
        raise ArgumentError(f"y = {y.tolist()}; allowed: {outputs.sensors} positive ranges")
    if grid < 8 or slices < 1:
        raise ArgumentError(f"grid = {grid}, slices = {slices}; allowed: at least 8 and 1")
    if outputs.sensors == 1:
        headings = 2.0 * math.pi * np.arange(slices) / slices
        curves = [curve for phi in headings for curve in _slice(outputs, y, float(phi), step, grid)]
        return FeasibleSet(y, tuple(curves), np.empty((0, 3)))
    starts = [x for node in _starts(outputs, y, grid) if (x := outputs.fit(y, node)) is not None]
    if outputs.sensors == 2:
        return FeasibleSet(y, _traced(_equations(outputs, y), starts, step), np.empty((0, 3)))
    return FeasibleSet(y, (), different_poses(np.array(starts).reshape(-1, 3), _SAME))


def _equations(outputs: RangeOutputs, y: Array) -> Equations:
    def equations(x: Array) -> tuple[Array, Array]:
        reading, J = outputs.at(x)
        return reading - y, J

    return equations


def _slice(outputs: RangeOutputs, y: Array, phi: float, step: float, grid: int) -> tuple[TracedCurve, ...]:
    """The poses that read y = (y_1) with the heading phi."""
    across = np.array([0.0, 0.0, 1.0])

    def equations(x: Array) -> tuple[Array, Array]:
        reading, J = outputs.at(x)
        return np.append(reading - y, x[2] - phi), np.vstack([J, across])

    starts = [x for x in _surface(outputs, y[0], grid, np.array([phi]))[:, 0] if on_curve(equations, x) is not None]
    return _traced(equations, starts, step)


def _surface(outputs: RangeOutputs, y_1: float, grid: int, headings: Array) -> Array:
    """Poses (grid, k, 3) that read y_1 with the first sensor, over s and headings (k,); NaN where none exists."""
    s = 2.0 * math.pi * np.arange(grid) / grid
    ends = outputs.curve.points(s)
    poses = np.empty((grid, len(headings), 3))
    for j, phi in enumerate(headings):
        beta = phi + outputs.angles[0]
        poses[:, j, :2], poses[:, j, 2] = ends - y_1 * np.array([math.cos(beta), math.sin(beta)]), phi
    seen = np.array([[outputs.at(x)[0][0] for x in row] for row in poses])
    poses[~(np.abs(seen - y_1) <= _SEEN)] = np.nan  # outside, or the ray is blocked
    return poses


def _starts(outputs: RangeOutputs, y: Array, grid: int) -> Array:
    """Nodes (k, 3) around which the residuals of the other sensors may all vanish, and those at the surface's edge.

    At the edge a curve may run between the last nodes and the wall.
    """
    headings = 2.0 * math.pi * np.arange(grid) / grid
    poses = _surface(outputs, y[0], grid, headings)
    r = np.array([[outputs.at(x)[0][1:] - y[1:] for x in row] for row in poses])  # (grid, grid, l - 1)
    reach, at_edge = np.zeros_like(r), np.zeros((grid, grid), dtype=bool)
    for shift in itertools.product((-1, 0, 1), repeat=2):
        around = np.roll(r, shift, axis=(0, 1))
        reach = np.fmax(reach, np.abs(around - r))  # NaN is ignored
        at_edge |= np.isnan(around).any(axis=2)
    near: Array = poses[(np.isfinite(r) & ((np.abs(r) <= reach) | at_edge[..., None])).all(axis=2)]
    return near


def _traced(equations: Equations, starts: list[Array], step: float) -> tuple[TracedCurve, ...]:
    """The curves through the starts, each once."""
    curves: list[TracedCurve] = []
    trees: list[cKDTree] = []
    for start in starts:
        if any(tree.query(_chart(start))[0] <= step for tree in trees):
            continue
        curves.append(trace_curve(equations, start, step, difference=pose_difference))
        trees.append(cKDTree(_chart(curves[-1].points)))
    return tuple(curves)


def _chart(poses: Array) -> Array:
    """Poses (..., 3) where headings a turn apart are the same (..., 4)."""
    return np.stack([poses[..., 0], poses[..., 1], np.cos(poses[..., 2]), np.sin(poses[..., 2])], axis=-1)
