"""Proof by enclosure that a problem has no feasible point: its ends, and what can be reached from its start.

Boxes [l, h] of states hold all feasible x(t). Over a step from t to t + d a box Y with [l, h] + [0, d] f(Y) within Y
holds them on the way (Picard), and by the differential inequalities of Müller

    l_i(t + d) = l_i + d min f_i(x, u, s; p)  over  x in Y, x_i near l_i, u in U, t <= s <= t + d,

and h_i also, with interval arithmetic for the extrema (see ``intervals``) and within the bounds of the states. They
begin at the values that the start pins. Where no x(T) of the box meets the conditions at the end, or a constraint holds
nowhere in it, no trajectory is feasible, whatever the transcription. The other way round nothing follows: a box may be
larger than what can be reached.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.ocp.call import check
from mathnavi.controllers.ocp.feasibility.intervals import enclosed, point, whole
from mathnavi.controllers.ocp.feasibility.labels import limited, with_place
from mathnavi.controllers.ocp.problem_functions import DURATION_LIMITS, Interval, ProblemFunctions
from mathnavi.interfaces.signals import Array

_STEPS = 200  # of the box over the longest duration
_PICARD = 6  # tries of a box that holds the states over a step; the last has no limits
_ROOM = 0.25  # of a try, over the size of the step
_ROUNDING = 1e-9  # relative: what is violated by less may hold
_MOST = 6  # conditions that are named


def pinned(problem: ProblemFunctions, p: Array, where: str) -> Interval:
    """States (nx,) at the "start" or the "end", between their bounds and as conditions on one of them alone pin them.

    The box is empty, lower > upper, where these contradict each other.
    """
    function, rows = (
        (problem.initial, problem.initial_bounds) if where == "start" else (problem.final, problem.final_bounds)
    )
    lower, upper = (side.copy() for side in problem.state_bounds)
    states, slopes, offsets = _alone(function)
    arguments = (p,) if where == "start" else (problem.guess_duration, p)
    coefficients, values = (np.array(each(*arguments).full())[:, 0] for each in (slopes, offsets))
    for row, state in states.items():
        if where == "end" and problem.free_duration and row in _timed(function):
            continue
        coefficient = coefficients[row]
        if not (np.isfinite(coefficient) and np.isfinite(values[row])) or coefficient == 0.0:
            continue
        ends = sorted((float(side[row]) - float(values[row])) / float(coefficient) for side in rows)
        lower[state], upper[state] = max(lower[state], ends[0]), min(upper[state], ends[1])
    return Interval(lower, upper)


@lru_cache(maxsize=64)
def _alone(function: ca.Function) -> tuple[dict[int, int], ca.Function, ca.Function]:
    """Conditions that are linear in one state, {row: state}, with the functions of their factors and offsets."""
    x, *others = function.sx_in()
    rows = function(x, *others)
    jacobian = ca.jacobian(rows, x)
    bent = ca.which_depends(rows, x, 2, True) if rows.numel() else []
    pattern = list(zip(jacobian.sparsity().row(), jacobian.sparsity().get_triplet()[1], strict=True))
    states = {
        row: column for row, column in pattern if sum(other == row for other, _ in pattern) == 1 and not bent[row]
    }
    zero = ca.DM.zeros(x.numel())
    slopes = ca.Function("slopes", others, [ca.densify(ca.sum2(ca.substitute(jacobian, x, zero)))])
    offsets = ca.Function("offsets", others, [ca.densify(ca.substitute(rows, x, zero))])
    return states, slopes, offsets


@lru_cache(maxsize=64)
def _timed(function: ca.Function) -> frozenset[int]:
    """Rows of the conditions at the end that depend on the final time."""
    return frozenset(function.jac_sparsity(0, 1).row())


def _outside(values: Interval, limits: Interval) -> NDArray[np.bool_]:
    """(m, n) True where no value (m, n) of an enclosure is within limits (m,)."""
    lower, upper = (
        side[:, None] + sign * _ROUNDING * np.maximum(1.0, np.where(np.isfinite(side), np.abs(side), 0.0))[:, None]
        for side, sign in zip(limits, (-1.0, 1.0), strict=True)
    )
    found: NDArray[np.bool_] = (values.upper < lower) | (values.lower > upper)
    return found


class Proof(NamedTuple):
    """Proof that no trajectory is feasible."""

    words: str  # names of the conditions that cannot hold
    reached: str = ""  # what the states come to from the start, where that is the reason

    def __str__(self) -> str:
        return f"{self.words}; from the start {self.reached}" if self.reached else self.words


def infeasible_by_enclosure(problem: ProblemFunctions, p: Array) -> Proof | None:
    """Prove, for parameters p (np,), that no trajectory is feasible; None where the enclosures do not show it."""
    return _proof(problem, tuple(p.tolist()))


@lru_cache(maxsize=64)
def _proof(problem: ProblemFunctions, values: tuple[float, ...]) -> Proof | None:
    p = np.array(values)
    return contradiction_at_ends(problem, p) or out_of_reach(problem, p)


def contradiction_at_ends(problem: ProblemFunctions, p: Array) -> Proof | None:
    """The first condition that cannot hold at the start or the end with what is pinned there; None if absent.

    The duration may be any one within its limits and controls any within theirs. It is exact where all states that the
    condition depends on are pinned.
    """
    known = point(p)
    durations = Interval(*(np.array([[limit]]) for limit in problem.duration_bounds))
    for where in ("start", "end"):
        box = pinned(problem, p, where)
        empty = np.flatnonzero(box.lower - box.upper > _ROUNDING * np.maximum(1.0, np.abs(box.upper)))
        if len(empty):
            name = problem.states[empty[0]]
            bound = _limit_text(name, problem.state_bounds.lower[empty[0]], problem.state_bounds.upper[empty[0]])
            return Proof(f"{_pins(problem, where, [int(empty[0])])}: cannot hold with {bound or 'each other'}")
        states, inputs = whole(box), whole(problem.control_bounds)
        at = point(0.0) if where == "start" else durations
        conditions = (
            (problem.initial, (states, known), problem.initial_bounds, problem.initial_names, "start")
            if where == "start"
            else (problem.final, (states, durations, known), problem.final_bounds, problem.final_names, "end")
        )
        path = (problem.path, (states, inputs, at, known), problem.path_bounds, problem.path_names, "path")
        for function, boxes, limits, names, kind in (conditions, path):
            if not len(names):
                continue
            values = enclosed(function, boxes)
            for row in np.flatnonzero(_outside(values, limits)[:, 0]):
                depends = sorted({c for r, c in _pattern(function) if r == row})
                text = limited(names, *limits)[row]
                label = f"path: {text}" if kind == "path" else with_place(kind, [text])[0]
                least, most = float(values.lower[row, 0]), float(values.upper[row, 0])
                others = [each for each in _pins(problem, where, depends).split("; ") if each != label]
                shown = _range(least, most)
                return Proof(f"{'; '.join(others)}: cannot hold with {label}, which is {shown} there")
    return None


@lru_cache(maxsize=64)
def _pattern(function: ca.Function) -> tuple[tuple[int, int], ...]:
    """(row, state) that depend on each other."""
    rows, columns = function.jac_sparsity(0, 0).get_triplet()
    return tuple(zip(rows, columns, strict=True))


def _pins(problem: ProblemFunctions, where: str, states: list[int]) -> str:
    """Names of the conditions at one end that are on one of these states alone."""
    function, names, limits = (
        (problem.initial, problem.initial_names, problem.initial_bounds)
        if where == "start"
        else (problem.final, problem.final_names, problem.final_bounds)
    )
    of_state = _alone(function)[0]
    texts = with_place(where, limited(names, *limits))
    return "; ".join([texts[row] for row, state in of_state.items() if state in states][:_MOST]) or f"the {where}"


def _limit_text(name: str, lower: float, upper: float) -> str:
    if not (np.isfinite(lower) or np.isfinite(upper)):
        return ""
    return limited((name,), np.array([lower]), np.array([upper]))[0]


def _range(lower: float, upper: float) -> str:
    lower, upper = (0.0 if abs(end) < 1e-6 * (upper - lower) else end for end in (lower, upper))
    if upper - lower <= _ROUNDING * max(1.0, abs(upper)):
        return f"{0.5 * (lower + upper):.4g}"
    if lower == -np.inf:
        return f"at most {upper:.4g}"
    return f"at least {lower:.4g}" if upper == np.inf else f"between {lower:.4g} and {upper:.4g}"


class _Tube(NamedTuple):
    """Boxes that hold all feasible states: (nx, n + 1) at times, (nx, n) from each time to the next."""

    times: Array  # (n + 1,) [s]
    at: Interval
    between: Interval


def out_of_reach(problem: ProblemFunctions, p: Array) -> Proof | None:
    """The first condition that no trajectory from the start can meet; None where the box does not show it.

    Also None where the final time is free without a limit that was stated.
    """
    if problem.duration_bounds[1] >= DURATION_LIMITS[1] or not problem.nx:
        return None
    tube = _tube(problem, p)
    return _on_the_way(problem, p, tube) or _at_the_end(problem, p, tube)


def _tube(problem: ProblemFunctions, p: Array) -> _Tube:
    """Boxes from the start on; empty ones, lower > upper, from where no state is within its bounds."""
    nx, bounds, step = problem.nx, problem.state_bounds, problem.duration_bounds[1] / _STEPS
    faces, known, inputs = np.arange(nx), point(p, 2 * nx), whole(problem.control_bounds, 2 * nx)
    single = Interval(known.lower[:, :1], known.upper[:, :1]), Interval(inputs.lower[:, :1], inputs.upper[:, :1])
    box = pinned(problem, p, "start")
    at, between, rates = [box], list[Interval](), Interval(np.zeros(nx), np.zeros(nx))
    with np.errstate(all="ignore"):
        for k in range(_STEPS):
            check()
            t = Interval(np.full((1, 2 * nx), k * step), np.full((1, 2 * nx), (k + 1) * step))
            for tried in range(_PICARD):
                way = _grown(box, rates, step, room=_ROOM if tried < _PICARD - 1 else np.inf, bounds=bounds)
                found = enclosed(
                    problem.dynamics, (whole(way), single[1], Interval(t.lower[:, :1], t.upper[:, :1]), single[0])
                )
                rates = Interval(found.lower[:, 0], found.upper[:, 0])
                needed = _grown(box, rates, step, room=0.0, bounds=bounds)
                if (needed.lower >= way.lower).all() and (needed.upper <= way.upper).all():
                    break
            near = whole(way, 2 * nx)  # faces: x_i about l_i, then about h_i
            near.lower[faces, faces] = box.lower + step * np.minimum(rates.lower, 0.0)
            near.upper[faces, faces] = box.lower + step * np.maximum(rates.upper, 0.0)
            near.lower[faces, nx + faces] = box.upper + step * np.minimum(rates.lower, 0.0)
            near.upper[faces, nx + faces] = box.upper + step * np.maximum(rates.upper, 0.0)
            found = enclosed(problem.dynamics, (near, inputs, t, known))
            lower = box.lower + step * np.maximum(found.lower[faces, faces], rates.lower)
            upper = box.upper + step * np.minimum(found.upper[faces, nx + faces], rates.upper)
            lower, upper = np.where(np.isnan(lower), -np.inf, lower), np.where(np.isnan(upper), np.inf, upper)
            between.append(way)
            at.append(Interval(lower, upper))
            if _outside(Interval(lower[:, None], upper[:, None]), bounds).any():
                break
            box = Interval(np.clip(lower, *bounds), np.clip(upper, *bounds))
    ends, ways = (
        Interval(np.array([each.lower for each in of]).T, np.array([each.upper for each in of]).T)
        for of in (at, between)
    )
    return _Tube(np.linspace(0.0, step * (len(at) - 1), len(at)), ends, ways)


def _grown(box: Interval, rates: Interval, step: float, *, room: float, bounds: Interval) -> Interval:
    """The box (nx,) and what it comes to within a step at rates (nx,), with some room, within bounds (nx,)."""
    lower, upper = box.lower + step * np.minimum(rates.lower, 0.0), box.upper + step * np.maximum(rates.upper, 0.0)
    more = room * (box.lower - lower + upper - box.upper) + (room and _ROUNDING * (1.0 + np.abs(box.upper)))
    more = np.where(np.isnan(more), np.inf, more)
    return Interval(np.maximum(lower - more, bounds.lower), np.minimum(upper + more, bounds.upper))


def _on_the_way(problem: ProblemFunctions, p: Array, tube: _Tube) -> Proof | None:
    """A bound or a path constraint that holds nowhere in the box at a time that every trajectory comes to."""
    bounds, many = problem.state_bounds, tube.times <= problem.duration_bounds[0] * (1.0 + _ROUNDING)
    left = _outside(tube.at, bounds) & many
    if left.any():
        k = int(left.any(axis=0).argmax())
        i = int(left[:, k].argmax())
        bound = _limit_text(problem.states[i], bounds.lower[i], bounds.upper[i])
        shown = _range(float(tube.at.lower[i, k]), float(tube.at.upper[i, k]))
        return Proof(f"{bound}: cannot hold", f"{problem.states[i]} is {shown} at t = {tube.times[k]:.4g} s")
    if len(problem.path_names):
        n = int(many.sum())
        states = _within(Interval(tube.at.lower[:, :n], tube.at.upper[:, :n]), bounds)
        boxes = (states, whole(problem.control_bounds, n), Interval(*(tube.times[None, :n],) * 2), point(p, n))
        values = enclosed(problem.path, boxes)
        broken = _outside(values, problem.path_bounds)
        if broken.any():
            k = int(broken.any(axis=0).argmax())
            row = int(broken[:, k].argmax())
            text = limited(problem.path_names, *problem.path_bounds)[row]
            shown = _range(float(values.lower[row, k]), float(values.upper[row, k]))
            return Proof(f"path: {text}: cannot hold", f"it is {shown} at t = {tube.times[k]:.4g} s")
    return None


def _at_the_end(problem: ProblemFunctions, p: Array, tube: _Tube) -> Proof | None:
    """A condition at the end that the box does not meet at any duration within its limits."""
    shortest, longest = problem.duration_bounds
    target = pinned(problem, p, "end")
    if problem.free_duration:
        own = tube.times[1:] >= shortest
        reached = Interval(tube.between.lower[:, own], tube.between.upper[:, own])
        ends = Interval(tube.times[None, :-1][:, own], tube.times[None, 1:][:, own])
    else:
        reached, ends = Interval(tube.at.lower[:, -1:], tube.at.upper[:, -1:]), point(longest)
    n = reached.lower.shape[1]
    apart = _outside(reached, target)
    for i in np.flatnonzero(apart.all(axis=1)):
        name = _pins(problem, "end", [int(i)])
        if name == "the end":
            name = _limit_text(problem.states[i], problem.state_bounds.lower[i], problem.state_bounds.upper[i])
        where = f"within {longest:.4g} s" if problem.free_duration else f"at T = {longest:.4g} s"
        shown = _range(float(reached.lower[i].min()), float(reached.upper[i].max()))
        return Proof(f"{name}: cannot hold", f"{problem.states[i]} is {shown} {where}")
    if len(problem.final_names):
        boxes = (_within(reached, target), ends, point(p, n))
        missed = _outside(enclosed(problem.final, boxes), problem.final_bounds)
        missed = missed | apart.any(axis=0)
        if missed.any(axis=0).all():
            texts = with_place("end", limited(problem.final_names, *problem.final_bounds))
            named = [texts[row] for row in np.flatnonzero(missed.any(axis=1))][:_MOST]
            return Proof(f"{'; '.join(named)}: cannot hold", "the states do not come there")
    return None


def _within(boxes: Interval, limits: Interval) -> Interval:
    """Boxes (nx, n) within limits (nx,); a box outside them is turned over, and means nothing."""
    lower, upper = np.maximum(boxes.lower, limits.lower[:, None]), np.minimum(boxes.upper, limits.upper[:, None])
    return Interval(np.minimum(lower, upper), np.maximum(lower, upper))
