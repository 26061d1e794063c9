"""Programme of a collocation scheme on fixed nodes, point by point.

Its equations are linear in the rates at the points (see ``collocation``),

    x_{i+1} / s - x_i / s - Σ_j b_j F_ij = 0,       x_i / s + Σ_j A_mj F_ij - X_im / s = 0,

F_ij = d_i f(X_ij, u_ij, t_ij) / s, s the states' scales, and J is the sum of b_j d_i L_ij. So the functions of a
problem are differentiated at one point, once, for all degrees, numbers of nodes and schemes; a programme
joins the derivatives at its points with constant factors. A programme of another mesh costs its assembly only.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.derivative_assembly import Block, Factors, NlpStage
from mathnavi.controllers.ocp.layout import (
    ProgrammeLayout,
    bounded_controls,
    fractions_between,
    mixed_constraints,
    variation,
)
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.transcriptions.collocation import (
    GaussLegendre,
    LegendreGaussLobatto,
    RadauIIA,
    integration_matrix,
)
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme, weights
from mathnavi.controllers.ocp.transcriptions.variable_radau import Members, VariableRadauIIA
from mathnavi.interfaces.signals import Array, Integers

COLLOCATIONS = (RadauIIA, VariableRadauIIA, GaussLegendre, LegendreGaussLobatto)
"""schemes whose equations are those of collocation at their points"""


def collocation_blocks(
    layout: ProgrammeLayout, places: Integers, p: ca.MX, before: ca.MX, share: ca.MX, smoothing: ca.MX
) -> tuple[list[Block], Factors]:
    """Blocks of the intervals of a programme, and the constant matrix L of what is linear in its rows.

    Args:
        layout: layout of the unknowns; its scheme is one of ``COLLOCATIONS``.
        places: (N - 1, ·) rows of each interval: gap, inner equations, path constraints, controls between points,
            mixed constraints at the start; -1 for those that an interval lacks.
        p: (np,) parameters of the problem.
        before: E (A, N - 1), shares of the arcs before each interval, or τ (1, N - 1) at its start.
        share: W (A, N - 1), shares of the interval itself, or its width (1, N - 1) as a fraction of T.
        smoothing: ρ (nu or 0, N - 1).
    """
    groups = [_Alike(layout, members, places) for members in layout.members]
    blocks, entries = [_points(layout, groups, p, before, share)], []
    for own in groups:
        chosen = slice(None) if len(groups) == 1 else own.intervals.tolist()
        blocks += own.blocks(p, before[:, chosen], share[:, chosen], smoothing[:, chosen])
        entries += own.linear()
    linear = Factors(
        np.concatenate([rows.ravel() for rows, _, _ in entries]),
        np.concatenate([columns.ravel() for _, columns, _ in entries]),
        np.concatenate([np.full(rows.size, value) for rows, _, value in entries]),
    )
    return blocks, linear


def _points(layout: ProgrammeLayout, groups: Sequence[_Alike], p: ca.MX, before: ca.MX, share: ca.MX) -> Block:
    """Block of the points of all intervals."""
    problem = layout.problem
    height = problem.nx + len(problem.path_bounds.lower)
    of_point = np.concatenate([np.repeat(own.intervals, own.k) for own in groups])
    fractions = np.concatenate([np.tile(own.scheme.points, own.count) for own in groups])
    each = ca.DM(np.eye(layout.nodes - 1)[:, of_point])  # of an interval, at each of its points
    shares = ca.mtimes(share, each)
    starts = ca.mtimes(before, each) + shares * ca.DM(np.tile(fractions, (layout.arcs, 1)))
    factors, quadratures, done = [], [], 0
    for own in groups:
        A, b = integration_matrix(own.scheme.points)
        rows, columns, values = own.factors(A, b)
        factors.append((rows, columns + height * done, values))
        quadratures.append(np.tile(b, own.count))
        done += own.k * own.count
    return Block(
        _point(problem, layout.arcs),
        np.vstack([own.at_points for own in groups]),
        Factors(*(np.concatenate(parts) for parts in zip(*factors, strict=True))),
        ca.vertcat(ca.repmat(p, 1, done), starts, shares),
        np.concatenate(quadratures),
    )


class _Alike:
    """Intervals (n,) with the same transcription, with the places of their unknowns and rows."""

    def __init__(self, layout: ProgrammeLayout, members: Members, places: Integers) -> None:
        self.layout, self.problem, self.scheme = layout, layout.problem, members.scheme
        problem, scheme, intervals = self.problem, self.scheme, members.intervals
        self.intervals = intervals
        self.count, self.k, own = len(intervals), len(scheme.points), len(scheme.points) - int(scheme.shared)
        nx, nu, nd, nz = problem.nx, problem.nu, len(problem.path_bounds.lower), layout.state_size
        self.z, self.z_next = layout.state_columns[intervals], layout.state_columns[intervals + 1]
        inputs = layout.stage_columns[intervals, nz:]
        self.lengths = self.z[:, nx : nx + layout.durations]
        hidden = inputs[:, layout.own_points * nu :]
        self.inner = [j for j, c in enumerate(scheme.points) if 0.0 < c < 1.0]
        states = [
            hidden[:, self.inner.index(j) * nx :][:, :nx]
            if j in self.inner
            else (self.z if c == 0.0 else self.z_next)[:, :nx]
            for j, c in enumerate(scheme.points)
        ]
        controls = [inputs[:, j * nu : (j + 1) * nu] for j in range(own)]
        if scheme.shared:
            controls.append(self.z_next[:, :1] + nz + np.arange(nu))
        self.states, self.controls = np.stack(states, axis=1), np.stack(controls, axis=1)
        # Rows: of what the largest interval has, the first are those of this one.
        rows, between = places[intervals], len(fractions_between(scheme)) * len(bounded_controls(problem))
        path = nz + layout.scheme.interior * nx
        after = path + layout.own_points * nd
        self.gap, self.of_inner = rows[:, :nz], rows[:, nz : nz + len(self.inner) * nx]
        self.path, self.between = rows[:, path : path + own * nd], rows[:, after : after + between]
        self.mixed = rows[:, rows.shape[1] - len(mixed_constraints(problem)) :]

    def blocks(self, p: ca.MX, before: ca.MX, share: ca.MX, smoothing: ca.MX) -> list[Block]:
        """Blocks of what holds between points; arguments as of ``collocation_blocks``, of these intervals."""
        problem, scheme, count, arcs = self.problem, self.scheme, self.count, self.layout.arcs
        blocks, own = [], self.controls.reshape(count, -1)
        if mixed_constraints(problem) and fractions_between(scheme):
            columns = np.hstack([self.z[:, : problem.nx], own, self.lengths])
            known = ca.vertcat(ca.repmat(p, 1, count), before, share)
            blocks.append(Block(_start_of_interval(problem, arcs, scheme), columns, self.mixed, known))
        if self.layout.smoothed:
            known = ca.vertcat(ca.repmat(p, 1, count), smoothing)
            nothing = np.zeros((count, 0), dtype=np.int64)
            blocks.append(Block(_smoothed(problem, scheme), own, nothing, known))
        return blocks

    @property
    def at_points(self) -> Integers:
        """Columns (n k, nx + nu + ·) of state, control and durations at every point."""
        parts = (self.states, self.controls, np.repeat(self.lengths[:, None], self.k, axis=1))
        return np.concatenate(parts, axis=2).reshape(self.count * self.k, -1)

    def factors(self, A: Array, b: Array) -> Factors:
        """S: what the rates and path constraints at the points enter."""
        nx, nd, k, count = self.problem.nx, len(self.problem.path_bounds.lower), self.k, self.count
        first = (nx + nd) * (np.arange(count, dtype=np.int64)[:, None] * k + np.arange(k))  # of each point's rows
        rows, columns, values = [], [], []
        for s in range(nx):
            for m, row in enumerate((-b, *A)):
                own = self.gap[:, s] if m == 0 else self.of_inner[:, (m - 1) * nx + s]
                rows.append(np.repeat(own, k))
                columns.append((first + s).ravel())
                values.append(np.tile(row, count))
        for j in range(k - int(self.scheme.shared)):
            for q in range(nd):
                rows.append(self.path[:, j * nd + q])
                columns.append(first[:, j] + nx + q)
                values.append(np.ones(count))
        return Factors(*(np.concatenate(each) for each in (rows, columns, values)))

    def linear(self) -> list[tuple[Integers, Integers, float]]:
        """Rows, columns and value of each part of L.

        z_{i+1} - z_i in the gaps, x_i - X_im in the inner equations, and controls between the points.
        """
        nx, scheme = self.problem.nx, self.scheme
        entries = [(self.gap, self.z_next, 1.0), (self.gap, self.z, -1.0)]
        for m, j in enumerate(self.inner):
            rows = self.of_inner[:, m * nx : (m + 1) * nx]
            entries += [(rows, self.z[:, :nx], 1.0), (rows, self.states[:, j], -1.0)]
        bounded = bounded_controls(self.problem)
        for q, row in enumerate(weights(scheme.points, np.array(fractions_between(scheme)))):
            rows = self.between[:, q * len(bounded) : (q + 1) * len(bounded)]
            entries += [(rows, self.controls[:, j][:, bounded], float(value)) for j, value in enumerate(row)]
        return entries


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
def _point(problem: ProblemFunctions, arcs: int) -> NlpStage:
    """Stage of a point: rows F and d, cost d L, of (x, u, lengths) and (p, shares before it, those of the interval)."""
    given = _Symbols(problem, arcs)
    x, u = ca.SX.sym("x", problem.nx), ca.SX.sym("u", problem.nu)
    state, control = x * ca.DM(problem.state_scale), u * ca.DM(problem.control_scale)
    arguments = state, control, given.t, given.p
    rates = given.d * problem.dynamics(*arguments) / ca.DM(problem.state_scale)
    rows = ca.vertcat(rates, problem.path(*arguments))
    cost = given.d * problem.running_cost(*arguments)
    return NlpStage(ca.vertcat(x, u, given.lengths), given.data, rows, cost)


@lru_cache(maxsize=64)
def _start_of_interval(problem: ProblemFunctions, arcs: int, scheme: Scheme) -> NlpStage:
    """Stage of the path constraints that depend on a control, at the start of an interval, of (x_i, U, lengths)."""
    given = _Symbols(problem, arcs)
    x, U = ca.SX.sym("x", problem.nx), ca.SX.sym("U", problem.nu * len(scheme.points))
    basis = ca.DM(weights(scheme.points, np.zeros(1)).T)
    control = ca.mtimes(ca.reshape(U, problem.nu, -1), basis) * ca.DM(problem.control_scale)
    held = problem.path(x * ca.DM(problem.state_scale), control, given.t, given.p)
    rows = held[mixed_constraints(problem), :]
    return NlpStage(ca.vertcat(x, U, given.lengths), given.data, rows, ca.SX(0))


@lru_cache(maxsize=64)
def _smoothed(problem: ProblemFunctions, scheme: Scheme) -> NlpStage:
    """Stage of the variation of the controls within an interval, of U and (p, ρ)."""
    U, rho = ca.SX.sym("U", problem.nu * len(scheme.points)), ca.SX.sym("rho", problem.nu)
    own = ca.reshape(U, problem.nu, -1)
    cost = ca.dot(rho, ca.sum2(ca.mtimes(own, ca.DM(variation(scheme))) * own))
    return NlpStage(U, ca.vertcat(ca.SX.sym("p", len(problem.parameters)), rho), ca.SX(0, 1), cost)
