"""Integration of a solution's saturated control on all intervals at once, by Picard's iteration on Gauss points.

The rates of each interval are a polynomial through 12 Gauss points. From those of the solution itself,

    x(t) = x_i + ∫ f(x, sat(u), t) dt,        x_{i+1} = x_i + d Σ_g b_g f_g,

is repeated over the whole flight until nothing changes: some evaluations of all points together, where an integrator
with step-size control takes thousands one after the other. What it found is taken only if between these points, at 13
others, it follows its dynamics as an integrator would, to 1e-10 in every interval; not where a control reaches a bound
inside an interval, for one.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.scheme import gauss_legendre, integral_weights, weights
from mathnavi.controllers.ocp.transcriptions.variable_radau import interval_weights
from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import BufferedFunction

_POINTS = 12
_SWEEPS = 40
_SETTLED = 1e-13  # change of a sweep, in scaled states
_GROWN = 1e3  # times the first change: the iteration diverges


class Flight(NamedTuple):
    """Trajectory that was flown."""

    states: Array  # (N - 1, n, nx) at fractions of each interval, over the scales
    costs: Array  # (N - 1,) running cost gathered on each interval


def flight(solution: Solution, fractions: Array, tolerance: float, *, by_intervals: bool) -> Flight | None:
    """Flight of a solution's control at fractions (n,) of each interval; None where it is not within the tolerance.

    From x(0) or, ``by_intervals``, from the node of each interval.
    """
    problem, d = solution.problem, np.diff(solution.t)
    if len(solution.scheme.points) < 2:
        return None
    c, b, onwards = _gauss(_POINTS)
    scale, nodes = problem.state_scale, solution.x / problem.state_scale
    steps = d[:, None, None]
    rates = interval_weights(solution.scheme, c) @ solution.rates / scale
    at = _Evaluated(solution, c)
    starts, change, first = nodes[:-1], np.inf, None
    with np.errstate(all="ignore"):
        x = starts[:, None, :] + steps * np.einsum("gh,nhm->ngm", onwards, rates)
        for _ in range(_SWEEPS):
            rates, costs = at(x)
            if not by_intervals:
                gained = d[:, None] * np.einsum("g,ngm->nm", b, rates)
                starts = np.vstack([nodes[:1], nodes[0] + np.cumsum(gained, axis=0)[:-1]])
            following = starts[:, None, :] + steps * np.einsum("gh,nhm->ngm", onwards, rates)
            change = float(np.abs(following - x).max())
            x = following
            first = change if first is None else first
            if change <= _SETTLED * max(1.0, float(np.abs(x).max())):
                break
            if not change <= _GROWN * max(first, _SETTLED):  # NaN too
                return None
        else:
            return None
        between, share, _ = _gauss(_POINTS + 1)
        basis, to = weights(tuple(c.tolist()), between), integral_weights(tuple(c.tolist()), between)
        there = starts[:, None, :] + steps * np.einsum("gh,nhm->ngm", to, rates)
        own, running = _Evaluated(solution, between)(there)
        residual = np.abs(np.einsum("gh,nhm->ngm", basis, rates) - own).max(axis=2)
        residual += np.abs(costs @ basis.T - running) / max(1.0, abs(solution.cost))
    if not float((d * (residual @ share)).max()) <= tolerance:
        return None
    reached = integral_weights(tuple(c.tolist()), fractions)
    states = starts[:, None, :] + steps * np.einsum("gh,nhm->ngm", reached, rates)
    return Flight(states, d * (costs @ b))


@lru_cache(maxsize=8)
def _gauss(count: int) -> tuple[Array, Array, Array]:
    """Gauss points (k,) of [0, 1], their quadrature (k,), and the weights (k, k) of the integrals up to each."""
    abscissae, share = gauss_legendre(count)
    c = 0.5 * (abscissae + 1.0)
    return c, 0.5 * share, integral_weights(tuple(c.tolist()), c)


class _Evaluated:
    """Scaled rates and running cost at fractions (k,) of every interval, under the saturated control."""

    def __init__(self, solution: Solution, c: Array) -> None:
        problem, (count, k) = solution.problem, (solution.nodes - 1, len(c))
        u = np.clip(interval_weights(solution.scheme, c) @ solution.u, *problem.control_bounds)
        t = solution.t[:-1, None] + c * np.diff(solution.t)[:, None]
        self._shape, self._scale, size = (count, k), problem.state_scale, count * k
        self._x, self._out = np.zeros((size, problem.nx)), np.zeros((size, problem.nx + 1))
        known = [np.ascontiguousarray(each, float) for each in (u.reshape(size, -1), t, solution.parameters)]
        results: list[Array | None] = [self._out]
        self._evaluate = BufferedFunction(
            _rates(problem).map("rates", "serial", size, [3], []), (self._x, *known), results
        )

    def __call__(self, x: Array) -> tuple[Array, Array]:
        self._x[:] = x.reshape(self._x.shape) * self._scale
        self._evaluate()
        values = self._out.reshape(*self._shape, -1)
        return values[..., :-1] / self._scale, values[..., -1].copy()


@lru_cache(maxsize=64)
def _rates(problem: ProblemFunctions) -> ca.Function:
    """(x, u, t, p) -> (f, L), dense."""
    arguments = problem.dynamics.sx_in()
    both = ca.vertcat(problem.dynamics(*arguments), problem.running_cost(*arguments))
    return ca.Function("rates", arguments, [ca.densify(both)])
