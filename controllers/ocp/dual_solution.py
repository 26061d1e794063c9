"""Multipliers as functions of time (see ``multipliers``), from the answer of a nonlinear programme.

A multiplier of the programme is the integral over the part of an interval that its point stands for: it is divided by
that part. Where a costate jumps, at an end of an arc on the limit of a state, the function of time is a peak whose area
is the jump. The costate of a point is the factor of its rate in the Lagrangian of the interval,

    λ_j = 1 / (b_j d) ∂/∂f_j (cost + Λ'flow + Λ_inner'inner + ...),

with the quadrature's weights b_j: as accurate as the states (Hager, Numerische Mathematik 2000). Where collocation is
linear in the rates, so are these.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.layout import bounded_states
from mathnavi.controllers.ocp.multipliers import Multipliers, NamedValues, distinct
from mathnavi.controllers.ocp.nlp import Programme, at_rows
from mathnavi.controllers.ocp.pointwise import COLLOCATIONS
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.transcriptions.collocation import integration_matrix
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme, integral_weights
from mathnavi.controllers.ocp.transcriptions.variable_radau import alike, interval_integral_weights, repeated
from mathnavi.interfaces.signals import Array


class Answer(NamedTuple):
    """Data of a solved programme from which its multipliers are computed."""

    bounds: Array  # (n,) multipliers of the bounds of the scaled unknowns
    rows: Array  # (m,) multipliers of the rows
    t: Array  # (N,) [s] nodes
    x: Array  # (N, nx)
    inner: Array  # (N - 1, k, nx) states at the scheme's points
    u: Array  # (N - 1, k, nu)
    parameters: Array  # (np,)


def multipliers_of(nlp: Programme, answer: Answer) -> Multipliers:
    """Multipliers of a solved programme as functions of time, by name."""
    layout, problem, scheme = nlp.layout, nlp.layout.problem, nlp.layout.scheme
    nx, nu, nd, ns = problem.nx, problem.nu, len(problem.path_bounds.lower), len(problem.final_bounds.lower)
    count, k, own, inside = len(answer.t) - 1, len(scheme.points), layout.own_points, scheme.interior
    z, w, last = layout.split(answer.bounds / layout.scale**2)  # for unknowns in the problem's units
    held = at_rows(answer.rows, nlp.held_rows)

    of_controls, of_path, of_states = (np.zeros((count, k, size)) for size in (nu, nd, nx))
    of_controls[:, :own] = w[:, : own * nu].reshape(count, own, nu)
    of_path[:, :own] = held[:, : own * nd].reshape(count, own, nd)
    if inside:
        first = int(scheme.points[0] == 0.0)
        of_states[:, first : first + inside] = w[:, own * nu : own * nu + inside * nx].reshape(count, inside, nx)
    elif k > 2:  # states between the nodes that are no unknowns, but rows
        bounded = bounded_states(problem)
        rows = held[:, own * nd : own * nd + (k - 2) * len(bounded)]
        of_states[:, 1:-1, bounded] = rows.reshape(count, k - 2, len(bounded))
    factors = (
        -answer.rows[nlp.gap_start[:, None] + np.arange(nx)] / problem.state_scale,
        at_rows(answer.rows, nlp.inner_rows) / np.tile(problem.state_scale, inside),
        of_path.reshape(count, -1),
        of_states.reshape(count, -1),
    )
    costates = _costates_at_points(problem, scheme, answer, factors)

    if scheme.shared:
        of_controls[:-1, -1], of_controls[-1, -1] = of_controls[1:, 0], last
        of_path[:-1, -1], of_path[-1, -1] = of_path[1:, 0], answer.rows[nlp.final_rows[ns : ns + nd]]
    if scheme.points[0] == 0.0:
        of_states[:, 0] = z[:-1, :nx]
    if scheme.points[-1] == 1.0:
        of_states[:, -1] = z[1:, :nx]
    # A point that an interval lacks stands for its last one, and has its values.
    of_path, b, d = repeated(scheme, of_path), interval_integral_weights(scheme, np.ones(1))[:, 0], np.diff(answer.t)
    b = repeated(scheme, b)
    one = point_shares(b, d, joined=scheme.shared)[:, :, None]
    node = point_shares(b, d, joined=scheme.points[0] == 0.0 and scheme.points[-1] == 1.0)[:, :, None]
    return Multipliers(
        dynamics=NamedValues(problem.states, costates),
        path=NamedValues(distinct(problem.path_names), of_path / one),
        states=NamedValues(problem.states, of_states / node),
        controls=NamedValues(problem.controls, of_controls / one),
        initial=NamedValues(own_names(problem.initial_names, "start of "), answer.rows[nlp.initial_rows]),
        final=NamedValues(own_names(problem.final_names, "end of "), answer.rows[nlp.final_rows[:ns]]),
        duration=_of_duration(nlp, z, answer.rows),
        instants=None
        if problem.instants is None
        else NamedValues(distinct(problem.instants.names), answer.rows[nlp.instant_rows]),
    )


def own_names(names: tuple[str, ...], beginning: str) -> tuple[str, ...]:
    """Names without their beginning: a condition at one end has the name of its state."""
    return distinct([name.removeprefix(beginning) for name in names])


def _of_duration(nlp: Programme, z: Array, rows: Array) -> float:
    """Multiplier of the bounds of T: the sum over its nodes or, for several arcs, that of the row that adds them up."""
    layout = nlp.layout
    if layout.arcs > 1:
        return float(rows[nlp.final_rows[-1]]) / layout.problem.guess_duration
    return float(z[:, layout.problem.nx].sum()) if layout.free_duration else 0.0


def quadrature(scheme: Scheme) -> Array:
    """Weights b (k,) of a scheme's quadrature over an interval of width 1."""
    b: Array = integral_weights(scheme.points, np.ones(1))[0]
    return b


def point_shares(b: Array, d: Array, *, joined: bool) -> Array:
    """Time (N - 1, k) [s] that each point stands for; a point that two intervals have in common, for both parts.

    From weights b (N - 1, k) of the quadrature, or (1, k), and the intervals' widths d (N - 1,).
    """
    shares = d[:, None] * b
    if joined:
        at_nodes = shares[1:, 0] + shares[:-1, -1]
        shares[1:, 0], shares[:-1, -1] = at_nodes, at_nodes
    return shares


def _costates_at_points(problem: ProblemFunctions, scheme: Scheme, answer: Answer, factors: tuple[Array, ...]) -> Array:
    """Costates (N - 1, k, nx); ``factors`` are the multipliers of flow, inner, path and states, a row an interval."""
    count, k = len(answer.t) - 1, len(scheme.points)
    if isinstance(scheme, COLLOCATIONS):  # (b_j Λ + Σ_m A_mj Λ_m) / b_j
        costates = np.zeros((count, k, problem.nx))
        for own, intervals in alike(scheme, count):
            A, b = integration_matrix(own.points)
            inner = factors[1][intervals, : len(A) * problem.nx].reshape(len(intervals), len(A), problem.nx)
            known = factors[0][intervals, None, :] + np.einsum("mj,nmi->nji", A / b, inner)
            costates[intervals, : len(own.points)] = known
        return repeated(scheme, costates)
    inside = [0.0 < c < 1.0 for c in scheme.points] if scheme.interior else [False] * k
    found = _costate_function(problem, scheme).map(count)(
        answer.x[:-1].T,
        answer.x[1:].T,
        answer.inner[:, inside].reshape(count, -1).T,
        answer.u.reshape(count, -1).T,
        answer.t[None, :-1],
        np.diff(answer.t)[None, :],
        np.tile(answer.parameters[:, None], (1, count)),
        *(each.T for each in factors),
    )
    return np.array(found.full()).T.reshape(count, k, problem.nx)


@lru_cache(maxsize=64)
def _costate_function(problem: ProblemFunctions, scheme: Scheme) -> ca.Function:
    """(x_0, x_1, X, U, t, d, p, multipliers) -> λ (k nx,) at the points of one interval.

    For a scheme of one point, whose rates are not those at its point, it is the derivative by the state at the start.
    """
    nx, nu, nd, k = problem.nx, problem.nu, len(problem.path_bounds.lower), len(scheme.points)
    x_0, x_1, t, d = ca.SX.sym("x_0", nx), ca.SX.sym("x_1", nx), ca.SX.sym("t"), ca.SX.sym("d")
    X, U, p = ca.SX.sym("X", scheme.interior * nx), ca.SX.sym("U", k * nu), ca.SX.sym("p", len(problem.parameters))
    of_flow, of_inner = ca.SX.sym("flow", nx), ca.SX.sym("inner", scheme.interior * nx)
    of_path, of_states = ca.SX.sym("path", k * nd), ca.SX.sym("states", k * nx)
    e = ca.SX.sym("e", k * nx)  # added to the rate at each point

    def rates(x: ca.SX, u: ca.SX, now: ca.SX) -> tuple[ca.SX, ca.SX]:
        at = float(ca.Function("c", [t, d], [now])(0.0, 1.0))
        j = int(np.argmin(np.abs(np.array(scheme.points) - at)))
        return problem.dynamics(x, u, now, p) + e[j * nx : (j + 1) * nx, :], problem.running_cost(x, u, now, p)

    own_states = [X[j * nx : (j + 1) * nx, :] for j in range(scheme.interior)]
    controls = [U[j * nu : (j + 1) * nu, :] for j in range(k)]
    interval = scheme.interval(rates, x_0, own_states, x_1, controls, t, d)
    lagrangian = interval.cost + ca.dot(of_flow, interval.flow) + ca.dot(of_inner, interval.inner)
    for j, (x, u, c) in enumerate(zip(interval.states, controls, scheme.points, strict=True)):
        lagrangian += ca.dot(of_path[j * nd : (j + 1) * nd, :], problem.path(x, u, t + c * d, p))
        lagrangian += ca.dot(of_states[j * nx : (j + 1) * nx, :], x)
    if k == 1:
        costates = ca.gradient(lagrangian, x_0)
    else:
        costates = ca.gradient(lagrangian, e) / (d * ca.DM(np.repeat(quadrature(scheme), nx)))
    arguments = [x_0, x_1, X, U, t, d, p, of_flow, of_inner, of_path, of_states]
    return ca.Function("costates", arguments, [ca.substitute(costates, e, ca.SX.zeros(k * nx))])
