"""Residual of a collocation solution in the differential equation, and its share in the cost.

Between its nodes the polynomial x(t) of a collocation scheme does not follow its dynamics. Its residual gives every
interval i two errors,

    η_i  = max over states of ∫ |x' - f(x, u, t)| / x_scale dt,
    ηJ_i = ∫ Σ_j |λ_j| |x_j' - f_j(x, u, t)| + |L(x, u, t) - L_scheme(t)| dt,

the second weighted with the sensitivity of J to the state, its costate λ: the interval's share in the error of J (the
dual-weighted residual of Becker and Rannacher, Acta Numerica 2001). A monitor function that holds both in equal shares
sees boundary layers that no derivative of a coarse solution shows.
"""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.ocp.monitors import Monitor
from mathnavi.controllers.ocp.solution import Solution, along
from mathnavi.controllers.ocp.transcriptions.scheme import gauss_legendre
from mathnavi.controllers.ocp.transcriptions.variable_radau import (
    interval_integral_weights,
    interval_weights,
    point_counts,
)
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

_POINTS = 6  # Gauss points of the integrals over an interval
_NEIGHBOUR = 0.3  # of an interval's mass that its neighbours have at least: a layer is wider than what was seen of it


def local_errors(solution: Solution) -> Array:
    """Local error η_i (N - 1,) of each interval of a solution, over the states' scales.

    η_i = max over states of ∫ |x' - f(x, u, t)| / x_scale dt. ProblemError for a scheme whose state has no polynomial,
    one of a single point.
    """
    residual, _ = _residuals(solution)
    errors: Array = (residual / solution.problem.state_scale).max(axis=1)
    return errors


def cost_errors(solution: Solution) -> Array:
    """Share ηJ_i (N - 1,) of each interval in the error of J, in units of J.

    ηJ_i = ∫ Σ_j |λ_j| |x_j' - f_j| + |L - L_scheme| dt. ProblemError as for ``local_errors``.
    """
    residual, quadrature = _residuals(solution)
    errors: Array = (residual * np.abs(solution.costates)).sum(axis=1) + quadrature
    return errors


def _residuals(solution: Solution) -> tuple[Array, Array]:
    """∫ |x' - f| dt (N - 1, nx) and ∫ |L - L_scheme| dt (N - 1,) of each interval."""
    problem, scheme, d = solution.problem, solution.scheme, np.diff(solution.t)
    if len(scheme.points) < 2:
        raise ProblemError(f"scheme = {scheme.name} has no polynomial to integrate; allowed: a collocation scheme")
    abscissae, share = gauss_legendre(_POINTS)
    fractions = 0.5 * (abscissae + 1.0)
    basis, steps = interval_weights(scheme, fractions), interval_integral_weights(scheme, fractions)
    t = solution.t[:-1, None] + fractions * d[:, None]
    u = basis @ solution.u
    x = solution.x[:-1, None, :] + d[:, None, None] * (steps @ solution.rates)
    f = along(problem, x.reshape(t.size, -1), u.reshape(t.size, -1), t.ravel(), solution.parameters)
    residual = np.abs(basis @ solution.rates - f.reshape(x.shape))
    at_points = _running_costs(solution, solution.inner, solution.u, solution.point_times)
    polynomial = (basis @ at_points[:, :, None])[:, :, 0]
    quadrature = np.abs(_running_costs(solution, x, u, t) - polynomial)
    half = 0.5 * d
    return half[:, None] * np.einsum("g,ngm->nm", share, residual), half * (quadrature @ share)


def _running_costs(solution: Solution, x: Array, u: Array, t: Array) -> Array:
    """L (n, g) at states (n, g, nx), controls (n, g, nu) and times (n, g)."""
    problem, count = solution.problem, t.size
    p = np.tile(solution.parameters[:, None], (1, count))
    mapped = problem.running_cost.map(count)
    values = mapped(x.reshape(count, problem.nx).T, u.reshape(count, problem.nu).T, t.reshape(1, -1), p)
    return np.array(values.full()).reshape(t.shape)


def _residual_density(solution: Solution, tau: Array, epsilon: float) -> Array:
    """w = (ε + e_i)^(1 / (k + 1)) / Δτ_i in interval i, e_i half its share of η and half of ηJ; k points of the scheme.

    An error of either kind falls as Δτ_i^(k + 1), so equal shares of w are equal errors.
    """
    widths, e = solution.grid.widths, 0.5 * (_shares(local_errors(solution)) + _shares(cost_errors(solution)))
    mass = (epsilon + e) ** (1.0 / (point_counts(solution.scheme) + 1))
    mass[1:] = np.maximum(mass[1:], _NEIGHBOUR * mass[:-1])
    mass[:-1] = np.maximum(mass[:-1], _NEIGHBOUR * mass[1:])
    interval = np.clip(np.searchsorted(solution.grid.nodes, tau, side="right") - 1, 0, len(widths) - 1)
    w: Array = (mass / widths)[interval]
    return w


def _shares(errors: Array) -> Array:
    """Errors (n,) over their sum; unchanged if all are zero. One that is not finite counts as the largest that is."""
    finite = np.isfinite(errors)
    errors = np.where(finite, errors, errors[finite].max(initial=1.0))
    shares: Array = errors / total if (total := errors.sum()) > 0.0 else errors
    return shares


RESIDUAL = Monitor("residual", _residual_density, None, epsilon=1e-12)
"""monitor of the error on the present grid, so a redistribution takes several rounds; only for redistribution"""
