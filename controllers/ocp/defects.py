"""Defects of a collocation solution: the error of each interval against its true dynamics, with the saturated control.

The collocation polynomial x(t) of an interval is off the trajectory from the same node by e(t),

    e' = f(x + e, sat(u(t)), t) - x',      e(t_i) = 0,

with the control saturated to its bounds. Picard's iteration on Gauss points solves for e of all intervals at once: a
few evaluations of the dynamics where an integrator with step-size control takes hundreds. Its value at the end of an
interval is what a replay of this interval misses by, and with the costates it is a share in the error of J.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.ocp.layout import mixed_constraints
from mathnavi.controllers.ocp.scaling_rows import path_sizes
from mathnavi.controllers.ocp.solution import Solution, along
from mathnavi.controllers.ocp.transcriptions.scheme import gauss_legendre, integral_weights
from mathnavi.controllers.ocp.transcriptions.variable_radau import interval_integral_weights, interval_weights
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_POINTS = 8  # Gauss points of an interval
_SWEEPS = 3  # of Picard's iteration
_HOLDS = 1e-6  # scaled distance to its limit at which a constraint holds


class Defects(NamedTuple):
    """Defects of each interval, infinite where the dynamics are not finite there."""

    states: Array  # (N - 1, nx) e at the end of the interval, over the states' scales
    cost: Array  # (N - 1,) the interval's share in J replayed less that in J, in units of J
    path: Array  # (N - 1,) largest violation of the states' bounds and path constraints, scaled, but for those in:
    held: Array  # (N - 1,) that of constraints on a control that hold at all points of the interval


def defects(solution: Solution) -> Defects:
    """Defects of each interval of a solution; ProblemError for a scheme of a single point."""
    problem, scheme, d = solution.problem, solution.scheme, np.diff(solution.t)
    if len(scheme.points) < 2:
        raise ProblemError(f"scheme = {solution.scheme.name} has no polynomial; allowed: a collocation scheme")
    abscissae, share = gauss_legendre(_POINTS)
    c, b = 0.5 * (abscissae + 1.0), 0.5 * share
    basis, steps = interval_weights(scheme, c), interval_integral_weights(scheme, c)
    onwards = integral_weights(tuple(c.tolist()), c)
    t = (solution.t[:-1, None] + c * d[:, None]).ravel()
    rates = basis @ solution.rates
    x = solution.x[:-1, None, :] + d[:, None, None] * (steps @ solution.rates)
    u = np.clip(basis @ solution.u, *problem.control_bounds).reshape(len(t), problem.nu)
    e = np.zeros_like(x)
    with np.errstate(all="ignore"):
        for _ in range(_SWEEPS):
            flown = x + e
            f = along(problem, flown.reshape(len(t), -1), u, t, solution.parameters).reshape(x.shape)
            e = d[:, None, None] * np.einsum("gh,nhm->ngm", onwards, f - rates)
        ends = d[:, None] * np.einsum("g,ngm->nm", b, f - rates) / problem.state_scale
        gained = d * (running_costs(solution, flown.reshape(len(t), -1), u, t).reshape(-1, _POINTS) @ b)
    at, shares = solution.point_times.ravel(), solution.point_shares
    inner = solution.inner.reshape(len(at), -1), solution.u.reshape(len(at), problem.nu)
    stated = (running_costs(solution, *inner, at).reshape(shares.shape) * shares).sum(axis=1)
    held = _held(solution)
    values = (
        ends,
        gained - stated,
        *(
            _violations(solution, (flown.reshape(len(t), -1), u, t), np.repeat(chosen, _POINTS, axis=0))
            .reshape(-1, _POINTS)
            .max(axis=1)
            for chosen in (~held, held)
        ),
    )
    return Defects(*(np.where(np.isfinite(value), value, np.inf) for value in values))


def _violations(solution: Solution, at: tuple[Array, Array, Array], chosen: NDArray[np.bool_]) -> Array:
    """Largest violation (n,) of the states' bounds and the path constraints, over scales and limits.

    At states (n, nx), controls (n, nu) and times (n,); of what is ``chosen`` (n, nx + nd).
    """
    problem, x = solution.problem, at[0]
    over = [
        np.maximum(lower - values, values - upper) / scale
        for values, (lower, upper), scale in (
            (x, problem.state_bounds, problem.state_scale),
            (_path(solution, *at), problem.path_bounds, path_sizes(problem)),
        )
    ]
    found: Array = np.where(chosen, np.hstack(over), 0.0).max(axis=1, initial=0.0)
    return found


def _held(solution: Solution) -> NDArray[np.bool_]:
    """(N - 1, nx + nd) True for equations, and for path constraints on a control that hold throughout an interval."""
    problem, t = solution.problem, solution.point_times.ravel()
    nd, mixed = len(problem.path_bounds.lower), mixed_constraints(problem)
    found = np.zeros((solution.nodes - 1, problem.nx + nd), dtype=bool)
    found[:, problem.nx :] = problem.path_bounds.lower == problem.path_bounds.upper
    if mixed:
        values = _path(solution, solution.inner.reshape(len(t), -1), solution.u.reshape(len(t), problem.nu), t)
        with np.errstate(invalid="ignore"):
            away = np.minimum(values - problem.path_bounds.lower, problem.path_bounds.upper - values)
        over = (away / path_sizes(problem)).reshape(len(found), -1, nd)
        found[:, problem.nx + np.array(mixed)] |= over[:, :, mixed].max(axis=1) <= _HOLDS
    return found


def _path(solution: Solution, x: Array, u: Array, t: Array) -> Array:
    """Path constraints (n, nd) at states (n, nx), controls (n, nu) and times (n,)."""
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    return np.array(solution.problem.path.map(len(t))(x.T, u.T, t[None, :], p).full().T)


def running_costs(solution: Solution, x: Array, u: Array, t: Array) -> Array:
    """Running cost L (n,) at states (n, nx), controls (n, nu) and times (n,)."""
    p = np.tile(solution.parameters[:, None], (1, len(t)))
    values: Array = solution.problem.running_cost.map(len(t))(x.T, u.T, t[None, :], p).full()
    costs: Array = values[0]
    return costs
