"""Crossings: when a trajectory passes a switching surface on which the dynamics, cost or constraints are not smooth.

At a jump or a kink inside an interval no derivative that a solver evaluates sees the surface: the time of the crossing
is held by the mesh, not chosen by J, and a replay is blind to that. A node that the programme keeps on the surface is
free to move with it (see ``crossing_phases``). A surface counts where the functions on its two sides differ, in their
values (a jump) or in their one-sided derivatives (a kink); u |u| has neither at u = 0. A path constraint counts where
it holds back. The kinks of a table are mostly its approximation of a smooth function: at a tolerance they count where
they bend what an interval integrates by more than that, Δ h^2 / 8 of a jump Δ in its slope.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mathnavi.controllers.ocp.solution_view import SolutionView
from mathnavi.controllers.ocp.switching_surfaces import Surfaces, SwitchingSurface, steps_passed, surfaces_of
from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.stretches import stretches

_DENSE = 20  # points of an interval at which the levels are evaluated
_EDGE = 1e-6  # of an interval: how far from a node the first and the last of them are, and what is at the node
_NEAR = 1e-7  # of the scales: distance at which a trajectory is on a surface
_SIDE = 1e-5  # of the scales: distance at which both sides are compared
_JUMP, _KINK = 1e-6, 1e-4  # of the largest value, and the largest derivative, along the trajectory
_ARC = 1e-3  # of T: least duration of an arc on a surface
_BISECTIONS = 50
_PASSED = 10  # steps that are passed between two points, at most
_HOLDS_BACK = 1e-6  # of |J|: effect of a constraint that holds back
_MOST = 3  # crossings that a message names

MOST_CROSSINGS = 39
"""number of crossings at which nodes are placed: a table of which more knots are passed is as good as smooth"""


@dataclass(frozen=True)
class Crossing:
    """A passage of a trajectory through a switching surface, or an arc on it."""

    surface: int  # among those of the problem
    text: str  # its expression
    time: float  # [s]
    until: float  # [s] later than ``time`` for an arc on the surface
    jump: bool  # True for a jump, False for a kink
    inside: bool  # True if it is inside an interval, or a jump at a node that nothing holds on the surface
    given: bool = False  # True for a break time that a person gave
    bend: float = math.inf  # over the scales, of what the interval integrates, by the kink of a table; others count

    def __str__(self) -> str:
        if self.given:
            return f"a break is given at t = {self.time:.6g} s"
        what = "jumps" if self.jump else "has a kink"
        if self.until > self.time:
            return f"{self.text}, which {what}, is held from t = {self.time:.4g} to {self.until:.4g} s"
        return f"{self.text} {what} at t = {self.time:.6g} s"


class _Samples(NamedTuple):
    """A trajectory at the dense points of all intervals, one after the other."""

    t: Array  # (n,)
    levels: Array  # (n, m)
    sizes: Array  # (n, m)


def crossings(solution: SolutionView) -> tuple[Crossing, ...]:
    """All crossings of a solution's trajectory in the order of time; none where its problem is smooth.

    Without the kinks of tables where there are more than ``MOST_CROSSINGS`` of them.
    """
    surfaces = surfaces_of(solution.problem)
    if surfaces is None or not np.isfinite(solution.x).all():
        return ()
    d = np.diff(solution.t)
    c = np.concatenate([[_EDGE], (np.arange(_DENSE) + 0.5) / _DENSE, [1.0 - _EDGE]])
    t = (solution.t[:-1, None] + c * d[:, None]).ravel()
    g, size = _levels(surfaces, solution, t)
    samples = _Samples(t, g, size)
    sides = _Sides(surfaces, solution, t)
    found = [
        crossing for k in range(len(surfaces.every)) for crossing in _of_surface(surfaces, solution, samples, sides, k)
    ]
    fine = [each for each in found if surfaces.every[each.surface].knots and not each.jump]
    if len(fine) > MOST_CROSSINGS:
        found = [each for each in found if each not in fine]
    return tuple(sorted(found, key=lambda each: each.time))


def not_smooth(solution: SolutionView, tolerance: float) -> tuple[str, ...]:
    """Crossings inside intervals that count at a tolerance, in words, the first few."""
    inside = [str(each) for each in crossings(solution) if each.inside and each.bend > tolerance]
    more = len(inside) - _MOST
    return (*inside[:_MOST], f"{more} more") if more > 0 else tuple(inside)


def _levels(surfaces: Surfaces, solution: SolutionView, t: Array) -> tuple[Array, Array]:
    """Levels and their sizes (n, m) at times (n,)."""
    x, u = solution.state(t), solution.control(t)
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    g, size = surfaces.levels.map(len(t))(x.T, u.T, t[None, :], p)
    return np.array(g.full()).T, np.array(size.full()).T


def _of_surface(surfaces: Surfaces, solution: SolutionView, samples: _Samples, sides: _Sides, k: int) -> list[Crossing]:
    surface, g = surfaces.every[k], samples.levels[:, k]
    passed = steps_passed(surface, g)
    near = np.abs(g - surface.nearest_step(g)) <= _NEAR * np.maximum(samples.sizes[:, k], 1e-300)
    known = np.maximum.accumulate(np.where(near, -1, np.arange(len(g))))
    known[known < 0] = int(np.flatnonzero(~near)[0]) if not near.all() else 0
    passed = passed[known]  # on the surface: on the side from which it came
    found = list[Crossing]()
    after = np.flatnonzero(np.diff(passed))

    def add(begin: float, end: float, jump: bool, inside: bool) -> None:
        bend = sides.bend(begin) if surface.knots and inside and not jump and begin == end else math.inf
        level = float(_levels(surfaces, solution, np.array([begin]))[0][0, k]) if surface.knots else 0.0
        found.append(Crossing(k, surface.named(level), begin, end, jump, inside, surface.given, bend))

    for time in _passages(surfaces, solution, samples.t[known[after]], samples.t[after + 1], k):
        jump = sides.differ(k, time)
        if surface.given or jump is not None:
            jump = bool(jump)
            add(time, time, jump, _inside(surface, solution, time, jump))
    for first, behind in stretches(near).tolist():
        begin, end = (_at_node(solution, float(samples.t[j])) for j in (first, behind - 1))
        if end - begin > _ARC * solution.duration and (jump := sides.differ(k, 0.5 * (begin + end))) is not None:
            add(begin, end, jump, inside=True)
    return found


def _inside(surface: SwitchingSurface, solution: SolutionView, time: float, jump: bool) -> bool:
    """True for a crossing that no node resolves.

    Where a state, or a free duration, takes part in a jump, a node that happens to be there is not enough: the
    programme has to hold it on the surface, or J has no say in when it is crossed.
    """
    if _at_node(solution, time) not in solution.t:
        return True
    i = int(np.abs(solution.t - time).argmin())
    moves = surface.by_state or solution.problem.free_duration
    return jump and moves and i not in solution.surface_nodes


def _at_node(solution: SolutionView, time: float) -> float:
    """The time [s] of the node at a time; the time itself where no node lies."""
    i = int(np.abs(solution.t - time).argmin())
    held = i in solution.surface_nodes  # a hair before the surface, however narrow its intervals are
    width = solution.duration / (solution.nodes - 1) if held else np.diff(solution.t)[max(i - 1, 0) : i + 1].min()
    return float(solution.t[i]) if abs(solution.t[i] - time) <= 2.0 * _EDGE * width else time


def _passages(surfaces: Surfaces, solution: SolutionView, low: Array, high: Array, k: int) -> list[float]:
    """Times at which a level passes a step between times (n,) and later ones (n,), by bisection.

    Where it passes several between two of them, at the first: the next is sought from there.
    """
    if not len(low):
        return []
    surface, found = surfaces.every[k], list[float]()

    def passed(t: Array) -> Array:
        return steps_passed(surface, _levels(surfaces, solution, t)[0][:, k])

    begin, end = low, high
    for _ in range(_PASSED):
        if not len(begin):
            break
        before, after = passed(begin), passed(end)
        first, last = begin, end
        for _ in range(_BISECTIONS):
            middle = 0.5 * (first + last)
            same = passed(middle) == before
            first, last = np.where(same, middle, first), np.where(same, last, middle)
        found += (0.5 * (first + last)).tolist()
        more = passed(last) != after
        begin, end = last[more], end[more]
    return sorted(found)


class _Sides:
    """Functions of a problem on both sides of its surfaces, compared with their largest values along a trajectory."""

    def __init__(self, surfaces: Surfaces, solution: SolutionView, t: Array) -> None:
        self._surfaces, self._solution, problem = surfaces, solution, solution.problem
        self._scale = np.concatenate([problem.state_scale, problem.control_scale, [solution.duration]])
        values, slopes = self._at(solution.state(t), solution.control(t), t)
        least = np.concatenate([problem.state_scale, [abs(solution.cost)], np.ones(len(problem.path_bounds.lower))])
        least[: problem.nx + 1] *= 1e-6 / solution.duration
        self._size = np.maximum(np.abs(values).max(axis=0), least)
        self._steepness = np.maximum(np.abs(slopes).max(axis=0).max(axis=1), self._size)

    def _at(self, x: Array, u: Array, t: Array) -> tuple[Array, Array]:
        """Values (n, rows) and scaled derivatives (n, rows, nx + nu + 1)."""
        n = len(t)
        given = (x.T, u.T, t[None, :], np.tile(self._solution.parameters[:, None], (1, n)))
        values = np.array(self._surfaces.rows.map(n)(*given).full()).T
        slopes = np.array(self._surfaces.slopes.map(n)(*given).full())
        shaped = slopes.reshape(values.shape[1], n, len(self._scale)).transpose(1, 0, 2)
        return np.nan_to_num(values), np.nan_to_num(shaped * self._scale)

    def differ(self, k: int, time: float) -> bool | None:
        """True for a jump, False for a kink, None where both sides of surface k go on smoothly at a time [s]."""
        s, problem = self._solution, self._solution.problem
        at = np.concatenate([s.state(time), s.control(time), [time]])
        normal = np.array(self._surfaces.normals(s.state(time), s.control(time), time, s.parameters).full())[k]
        length = float(np.linalg.norm(normal * self._scale))
        if not length > 0.0:
            return None
        along = normal * self._scale**2 / length
        points = at + _SIDE * np.array([2.0, 1.0, -1.0, -2.0])[:, None] * along
        nx, nu = problem.nx, problem.nu
        x = np.clip(points[:, :nx], *problem.state_bounds)
        u = np.clip(points[:, nx : nx + nu], *problem.control_bounds)
        t = points[:, -1]
        levels = self._surfaces.levels.map(4)(x.T, u.T, t[None, :], np.tile(s.parameters[:, None], (1, 4)))[0].full()[k]
        passed = steps_passed(self._surfaces.every[k], levels)
        if passed[0] != passed[1] or passed[2] != passed[3] or passed[1] == passed[2]:
            return None  # a bound keeps to one side
        values, slopes = self._at(x, u, t)
        counts = np.concatenate([np.ones(nx + 1, bool), self._holding_back(time)])
        jump = 2.0 * (values[1] - values[2]) - (values[0] - values[3])
        if (np.abs(jump[counts]) > _JUMP * self._size[counts]).any():
            return True
        kink = np.abs(2.0 * (slopes[1] - slopes[2]) - (slopes[0] - slopes[3])).max(axis=1)
        return False if (kink[counts] > _KINK * self._steepness[counts]).any() else None

    def bend(self, time: float) -> float:
        """Largest bend of a state, J or a path constraint, over its size, by a kink at a time [s] in an interval."""
        s, problem, nx = self._solution, self._solution.problem, self._solution.problem.nx
        i = int(np.clip(np.searchsorted(s.t, time) - 1, 0, s.nodes - 2))
        h = float(s.t[i + 1] - s.t[i])
        step = _EDGE * h
        t = time + step * np.array([-2.0, -1.0, 1.0, 2.0])
        values, _ = self._at(s.state(t), s.control(t), t)
        slope = np.abs((values[3] - values[2]) - (values[1] - values[0])) / step
        sizes = np.concatenate([problem.state_scale, [max(1.0, abs(s.cost))], self._size[nx + 1 :]])
        share = np.full(len(sizes), h**2 / 8.0)
        share[nx + 1 :] = h / 4.0  # a constraint is not integrated
        counts = np.concatenate([np.ones(nx + 1, bool), self._holding_back(time)])
        return float((slope * share / sizes)[counts].max(initial=0.0))

    def _holding_back(self, time: float) -> Array:
        """(nd,) True for each path constraint with a multiplier around a time [s]."""
        s = self._solution
        mu = np.abs(s.multipliers.path.values)
        if not mu.size:
            return np.zeros(mu.shape[2], bool)
        i = int(np.clip(np.searchsorted(s.t, time) - 1, 0, len(mu) - 1))
        around = mu[max(i - 1, 0) : i + 2].max(axis=(0, 1))
        share = around * self._size[self._solution.problem.nx + 1 :] * s.duration
        holding: Array = share > _HOLDS_BACK * max(abs(s.cost), _HOLDS_BACK)
        return holding
