"""Structure of a solution: on which arcs each control rests on a bound, and where constraints begin and end to hold.

Read from a solution that may be coarse. A control that enters linearly jumps between its bounds, or leaves them on a
singular arc; another one has a kink where it reaches a bound. Both want a node there (see ``arcs``), as do the ends of
an arc on a path constraint or on the bound of a state. A bound counts as held only where its multiplier says that it
holds the control back: on a singular arc, where a coarse control rings between its bounds, it does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.sim.interfaces.signals import Array, Integers

_AT_BOUND = 1e-3  # distance, over the range, that counts as resting on a control's bound
_TOUCHING = 1e-5  # scaled distance to the limit of a constraint or of a state
_WEAK = 1e-3  # of its largest value: a multiplier that is as small holds nothing back
_SAME = 1e-3  # [of the mean interval] boundaries that are as near are one


@dataclass(frozen=True, eq=False)
class Structure:
    """Boundaries (A - 1,) between arcs, fractions of T, and on each arc which bound holds each control."""

    boundaries: Array
    held: Integers  # (A, nu): -1 at the lower bound, 1 at the upper, 0 free

    def __len__(self) -> int:
        return len(self.held)

    def control_bounds(self, problem: ProblemFunctions) -> Interval:
        """Bounds (A, nu) of the controls on each arc, equal where one is held."""
        lower, upper = problem.control_bounds
        return Interval(np.where(self.held > 0, upper, lower), np.where(self.held < 0, lower, upper))

    def same(self, other: Structure) -> bool:
        """True if the arcs of both hold the same controls in the same order."""
        return np.array_equal(self.held, other.held)


def structure(solution: Solution) -> Structure:
    """Structure of a solution."""
    problem, k = solution.problem, len(solution.scheme.points)
    tau, multipliers = (solution.point_times / solution.duration).ravel(), solution.multipliers.controls.values
    linear = linear_controls(problem)
    codes, boundaries = [], []
    for j in range(problem.nu):
        bounds = problem.control_bounds.lower[j], problem.control_bounds.upper[j]
        u = solution.u[:, :, j].ravel()
        multiplier = multipliers[:, :, j].ravel()
        code, ends = _control_runs(u, multiplier, bounds, problem.control_scale[j], linear=bool(linear[j]), k=k)
        switches = _between(tau, ends, solution.grid.nodes)
        codes.append((code, switches))
        boundaries.append(switches)
    constraints = [_constraint_runs(tau, active, solution.grid.nodes) for active in _active_constraints(solution)]
    every = _apart(np.concatenate([*boundaries, np.empty(0)]), solution.nodes)
    # Where every control is held anyway, a constraint that begins to hold changes nothing.
    moves = [at for at in np.concatenate([*constraints, np.empty(0)]) if not _held(codes, np.array([at])).all()]
    every = _apart(np.concatenate([every, moves]), solution.nodes)
    return Structure(every, _held(codes, 0.5 * (np.append(0.0, every) + np.append(every, 1.0))))


def _apart(boundaries: Array, nodes: int) -> Array:
    """Boundaries inside ]0, 1[ in order, without those that are as good as equal."""
    near = _SAME / (nodes - 1)
    inside = np.sort(boundaries[(boundaries > near) & (boundaries < 1.0 - near)])
    return inside[np.append(True, np.diff(inside) > near)] if len(inside) else inside


def _held(codes: list[tuple[Integers, Array]], at: Array) -> Integers:
    """Codes (n, nu) of the controls at fractions (n,) of T, from the runs of each and the boundaries between them."""
    columns = [code[np.searchsorted(switches, at)] for code, switches in codes]
    return np.array(columns, dtype=np.int64).reshape(len(codes), len(at)).T


@lru_cache(maxsize=64)
def linear_controls(problem: ProblemFunctions) -> NDArray[np.bool_]:
    """Controls (nu,) that enter dynamics and running cost linearly, and no path constraint otherwise."""
    x, u, t, p = problem.dynamics.sx_in()
    outputs = ca.vertcat(problem.dynamics(x, u, t, p), problem.running_cost(x, u, t, p), problem.path(x, u, t, p))
    slopes = ca.jacobian(outputs, u)
    return np.array([not ca.depends_on(ca.vec(slopes[:, j]), u[j]) for j in range(problem.nu)], dtype=bool)


def _control_runs(
    u: Array, multiplier: Array, bounds: tuple[float, float], scale: float, *, linear: bool, k: int
) -> tuple[Integers, Integers]:
    """Codes (r,) of the runs of one control, and the last points (r - 1,) of all but the last run."""
    lower, upper = bounds
    extent = upper - lower if np.isfinite(upper - lower) else scale
    code = np.where(u >= upper - _AT_BOUND * extent, 1, np.where(u <= lower + _AT_BOUND * extent, -1, 0))
    weak = _WEAK * np.abs(multiplier).max(initial=0.0)
    starts, ends, values = _runs(code)
    # A run of one interval or less whose multiplier is weak, or of the wrong sign, does not rest on its bound.
    for start, end, value in zip(starts, ends, values, strict=True):
        if value and (value * multiplier[start:end]).max(initial=0.0) <= weak:
            code[start:end] = 0
    if linear:
        _calm(code, k + 1)
    starts, ends, values = _runs(code)
    if linear:
        for n, (start, end, value) in enumerate(zip(starts, ends, values, strict=True)):
            before, after = values[n - 1] if n else 0, values[n + 1] if n + 1 < len(values) else 0
            if value == 0 and end - start <= k + 1 and (before or after):
                if before and after and before != after:  # a jump inside the run: where the area is that of the control
                    share = (u[start:end].mean() - lower) / extent
                    count = round((share if before > 0 else 1.0 - share) * (end - start))
                    code[start : start + count], code[start + count : end] = before, after
                elif np.abs(u[start:end] - (upper if (before or after) > 0 else lower)).mean() < 0.1 * extent:
                    code[start:end] = before or after
        starts, ends, values = _runs(code)
    else:
        for start, end, value in zip(starts, ends, values, strict=True):
            if value and end - start < 2:
                code[start:end] = 0
        starts, ends, values = _runs(code)
    return values, ends[:-1] - 1


def _calm(code: Integers, short: int) -> None:
    """Free a control where it rings: three or more runs in a row of at most ``short`` points, one at either bound."""
    starts, ends, values = _runs(code)
    brief = np.concatenate([ends - starts <= short, [False]])
    first = 0
    for n, is_brief in enumerate(brief):
        if is_brief:
            continue
        among = set(values[first:n].tolist())
        if n - first >= 3 and {-1, 1} <= among:
            code[starts[first] : ends[n - 1]] = 0
        first = n + 1


def _between(tau: Array, last: Integers, nodes: Array) -> Array:
    """Fractions of T between each ``last`` point and the next one: a node where there is one, or the middle."""
    node = nodes[np.clip(np.searchsorted(nodes, tau[last] - 1e-12), 0, len(nodes) - 1)]
    return np.where(node < tau[last + 1], node, 0.5 * (tau[last] + tau[last + 1]))


def _active_constraints(solution: Solution) -> list[NDArray[np.bool_]]:
    """Activity (points,) of each path constraint and each bound of a state that is touched somewhere."""
    problem, of = solution.problem, solution.multipliers
    x, u = solution.inner.reshape(-1, problem.nx), solution.u.reshape(-1, problem.nu)
    weak = _WEAK * max(abs(solution.cost), _WEAK) / solution.duration
    found = []
    for values, (lower, upper), scale, multipliers in (
        (x, problem.state_bounds, problem.state_scale, of.states.values),
        (_path_values(solution, x, u), problem.path_bounds, np.ones(len(problem.path_bounds.lower)), of.path.values),
    ):
        felt = np.abs(multipliers.reshape(len(x), -1)) * scale > weak
        for touched in (values - lower <= _TOUCHING * scale, upper - values <= _TOUCHING * scale):
            found += [
                column
                for column, strong, fixed in zip(touched.T, felt.T, lower == upper, strict=True)
                if not fixed and (column & strong).any()
            ]
    return found


def _path_values(solution: Solution, x: Array, u: Array) -> Array:
    points = np.array(solution.scheme.points)
    t = (solution.t[:-1, None] + points * np.diff(solution.t)[:, None]).ravel()
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    return np.array(solution.problem.path.map(len(t))(x.T, u.T, t[None, :], p).full().T)


def _constraint_runs(tau: Array, active: NDArray[np.bool_], nodes: Array) -> Array:
    """Fractions of T at which a constraint begins or ends to hold; the one point of a touch."""
    starts, ends, values = _runs(active.astype(np.int64))
    last, touches = [], []
    for start, end, value in zip(starts, ends, values, strict=True):
        if value and end - start > 1:
            last += ([start - 1] if start else []) + ([end - 1] if end < len(tau) else [])
        elif value and 0 < start < len(tau) - 1:
            touches.append(tau[start])
    return np.concatenate([_between(tau, np.array(last, dtype=np.int64), nodes), touches])


def _runs(code: Integers) -> tuple[Integers, Integers, Integers]:
    """First index, index behind the last, and value of each run of equal values."""
    edges = np.flatnonzero(np.diff(code)) + 1
    starts = np.concatenate([[0], edges]).astype(np.int64)
    return starts, np.concatenate([edges, [len(code)]]).astype(np.int64), code[starts]
