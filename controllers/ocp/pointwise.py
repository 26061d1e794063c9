"""The programme of a collocation scheme on fixed nodes, point by point.

Its equations are linear in the rates at the points (see ``collocation``),

    x_{i+1} / s - x_i / s - Σ_j b_j F_ij = 0,       x_i / s + Σ_j A_mj F_ij - X_im / s = 0,

F_ij = d_i f(X_ij, u_ij, t_ij) / s, s the states' scales, and J is the sum of b_j d_i L_ij. So the functions of a
problem are differentiated at one point, once, whatever the degree, the number of nodes and the scheme; a programme
joins the derivatives at its points with constant factors. A programme of another mesh costs its assembly only.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.layout import (
    ProgrammeLayout,
    bounded_controls,
    fractions_between,
    mixed_constraints,
    variation,
)
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.stagewise import Block, Factors, Stage
from mathnavi.controllers.ocp.transcriptions.collocation import integration_matrix
from mathnavi.controllers.ocp.transcriptions.gauss import GaussLegendre
from mathnavi.controllers.ocp.transcriptions.pseudospectral import LegendreGaussLobatto
from mathnavi.controllers.ocp.transcriptions.radau import RadauIIA
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme, weights
from mathnavi.sim.interfaces.signals import Array, Integers

COLLOCATIONS = (RadauIIA, GaussLegendre, LegendreGaussLobatto)
"""schemes whose equations are those of collocation at their points"""


def collocation_blocks(
    layout: ProgrammeLayout, places: Integers, p: ca.MX, before: ca.MX, share: ca.MX, smoothing: ca.MX
) -> tuple[list[Block], Factors]:
    """Blocks of the intervals of a programme, and the constant matrix L of what is linear in its rows.

    Args:
        layout: of the unknowns; its scheme is one of ``COLLOCATIONS``.
        places: (N - 1, ·) rows of each interval: gap, inner equations, path constraints, controls between points,
            mixed constraints at the start.
        p: (np,) parameters of the problem.
        before: E (A, N - 1), shares of the arcs before each interval, or τ (1, N - 1) at its start.
        share: W (A, N - 1), shares of the interval itself, or its width (1, N - 1) as a fraction of T.
        smoothing: ρ (nu or 0, N - 1).
    """
    problem, scheme, count = layout.problem, layout.scheme, layout.nodes - 1
    k = len(scheme.points)
    states, controls, lengths = _columns(layout)
    c = np.tile(scheme.points, count)
    each = ca.DM(np.repeat(np.eye(count), k, axis=1))  # of an interval, at each of its points
    shares = ca.mtimes(share, each)
    starts = ca.mtimes(before, each) + shares * ca.DM(np.tile(c, (layout.arcs, 1)))
    A, b = integration_matrix(scheme.points)
    points = Block(
        _point(problem, layout.arcs),
        np.hstack([states.reshape(count * k, -1), controls.reshape(count * k, -1), np.repeat(lengths, k, axis=0)]),
        _factors(layout, places, A, b),
        ca.vertcat(ca.repmat(p, 1, count * k), starts, shares),
        np.tile(b, count),
    )
    blocks = [points]
    own = controls.reshape(count, -1)
    if mixed_constraints(problem) and fractions_between(scheme):
        mixed = len(mixed_constraints(problem))
        columns = np.hstack([_starts(layout)[:-1, : problem.nx], own, lengths])
        known = ca.vertcat(ca.repmat(p, 1, count), before, share)
        blocks.append(Block(_start_of_interval(problem, layout.arcs, scheme), columns, places[:, -mixed:], known))
    if layout.smoothed:
        known = ca.vertcat(ca.repmat(p, 1, count), smoothing)
        nothing = np.zeros((count, 0), dtype=np.int64)
        blocks.append(Block(_smoothed(problem, scheme), own, nothing, known))
    return blocks, _linear(layout, places, states, controls)


def _starts(layout: ProgrammeLayout) -> Integers:
    """(N, state_size) where z of each node stands."""
    stride = layout.state_size + layout.input_size
    return stride * np.arange(layout.nodes, dtype=np.int64)[:, None] + np.arange(layout.state_size)


def _columns(layout: ProgrammeLayout) -> tuple[Integers, Integers, Integers]:
    """States (N - 1, k, nx), controls (N - 1, k, nu) and durations (N - 1, ·): where the unknowns stand."""
    problem, points, own = layout.problem, layout.scheme.points, layout.own_points
    nx, nu, z = problem.nx, problem.nu, _starts(layout)
    first = z[:-1, :1] + layout.state_size  # of w
    inner = [c for c in points if 0.0 < c < 1.0]
    states = []
    for c in points:
        if c in inner:
            states.append(first + own * nu + inner.index(c) * nx + np.arange(nx))
        else:
            states.append((z[:-1] if c == 0.0 else z[1:])[:, :nx])
    controls = [first + j * nu + np.arange(nu) for j in range(own)]
    if layout.scheme.shared:
        controls.append(z[1:, :1] + layout.state_size + np.arange(nu))
    return np.stack(states, axis=1), np.stack(controls, axis=1), z[:-1, nx : nx + layout.durations]


def _factors(layout: ProgrammeLayout, places: Integers, A: Array, b: Array) -> Factors:
    """S: what the rates and path constraints at the points enter."""
    problem, k, count = layout.problem, len(layout.scheme.points), layout.nodes - 1
    nx, nd, nz = problem.nx, len(problem.path_bounds.lower), layout.state_size
    height = nx + nd
    first = height * (np.arange(count, dtype=np.int64)[:, None] * k + np.arange(k))  # of each point's rows
    rows, columns, values = [], [], []
    for s in range(nx):
        for m, row in enumerate((-b, *A)):
            own = s if m == 0 else nz + (m - 1) * nx + s
            rows.append(np.repeat(places[:, own], k))
            columns.append((first + s).ravel())
            values.append(np.tile(row, count))
    path = nz + len(A) * nx
    for j in range(layout.own_points):
        for q in range(nd):
            rows.append(places[:, path + j * nd + q])
            columns.append(first[:, j] + nx + q)
            values.append(np.ones(count))
    return Factors(*(np.concatenate(each) for each in (rows, columns, values)))


def _linear(layout: ProgrammeLayout, places: Integers, states: Integers, controls: Integers) -> Factors:
    """L: z_{i+1} - z_i in the gaps, x_i - X_im in the inner equations, and controls between the points."""
    problem, scheme, z = layout.problem, layout.scheme, _starts(layout)
    nx, nd, nz = problem.nx, len(problem.path_bounds.lower), layout.state_size
    entries: list[tuple[Integers, Integers, float]] = [
        (places[:, :nz], z[1:], 1.0),
        (places[:, :nz], z[:-1], -1.0),
    ]
    inner = [j for j, c in enumerate(scheme.points) if 0.0 < c < 1.0]
    for m, j in enumerate(inner):
        rows = places[:, nz + m * nx : nz + (m + 1) * nx]
        entries += [(rows, z[:-1, :nx], 1.0), (rows, states[:, j], -1.0)]
    first = nz + len(inner) * nx + layout.own_points * nd
    bounded = bounded_controls(problem)
    for q, row in enumerate(weights(scheme.points, np.array(fractions_between(scheme)))):
        rows = places[:, first + q * len(bounded) : first + (q + 1) * len(bounded)]
        entries += [(rows, controls[:, j][:, bounded], float(value)) for j, value in enumerate(row)]
    return Factors(
        np.concatenate([rows.ravel() for rows, _, _ in entries]),
        np.concatenate([columns.ravel() for _, columns, _ in entries]),
        np.concatenate([np.full(rows.size, value) for rows, _, value in entries]),
    )


class _Symbols:
    """Unknown lengths of the arcs, parameters and shares, over their scales, with the time and the width they make."""

    def __init__(self, problem: ProblemFunctions, arcs: int) -> None:
        self.lengths = ca.SX.sym("T", arcs if arcs > 1 else int(problem.free_duration))
        self.p = ca.SX.sym("p", len(problem.parameters))
        before, share = ca.SX.sym("E", arcs), ca.SX.sym("W", arcs)
        guess = ca.DM(problem.guess_duration)
        own = self.lengths * guess if self.lengths.numel() else guess
        self.t, self.d = ca.dot(before, own), ca.dot(share, own)
        self.data = ca.vertcat(self.p, before, share)


@lru_cache(maxsize=64)
def _point(problem: ProblemFunctions, arcs: int) -> Stage:
    """Stage of a point: rows F and d, cost d L, of (x, u, lengths) and (p, shares before it, those of the interval)."""
    given = _Symbols(problem, arcs)
    x, u = ca.SX.sym("x", problem.nx), ca.SX.sym("u", problem.nu)
    state, control = x * ca.DM(problem.state_scale), u * ca.DM(problem.control_scale)
    arguments = state, control, given.t, given.p
    rates = given.d * problem.dynamics(*arguments) / ca.DM(problem.state_scale)
    rows = ca.vertcat(rates, problem.path(*arguments))
    cost = given.d * problem.running_cost(*arguments)
    return Stage(ca.vertcat(x, u, given.lengths), given.data, rows, cost)


@lru_cache(maxsize=64)
def _start_of_interval(problem: ProblemFunctions, arcs: int, scheme: Scheme) -> Stage:
    """Stage of the path constraints that depend on a control, at the start of an interval, of (x_i, U, lengths)."""
    given = _Symbols(problem, arcs)
    x, U = ca.SX.sym("x", problem.nx), ca.SX.sym("U", problem.nu * len(scheme.points))
    basis = ca.DM(weights(scheme.points, np.zeros(1)).T)
    control = ca.mtimes(ca.reshape(U, problem.nu, -1), basis) * ca.DM(problem.control_scale)
    held = problem.path(x * ca.DM(problem.state_scale), control, given.t, given.p)
    rows = held[mixed_constraints(problem), :]
    return Stage(ca.vertcat(x, U, given.lengths), given.data, rows, ca.SX(0))


@lru_cache(maxsize=64)
def _smoothed(problem: ProblemFunctions, scheme: Scheme) -> Stage:
    """Stage of the variation of the controls within an interval, of U and (p, ρ)."""
    U, rho = ca.SX.sym("U", problem.nu * len(scheme.points)), ca.SX.sym("rho", problem.nu)
    own = ca.reshape(U, problem.nu, -1)
    cost = ca.dot(rho, ca.sum2(ca.mtimes(own, ca.DM(variation(scheme))) * own))
    return Stage(U, ca.vertcat(ca.SX.sym("p", len(problem.parameters)), rho), ca.SX(0, 1), cost)
