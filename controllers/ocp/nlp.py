"""The nonlinear programme of a problem, a transcription and a distribution of nodes (B.2, B.3).

Unknowns, stage by stage, each over its scale:

    z_1, w_1, z_2, w_2, ..., z_N, w_N,      z_i = (x_i, T, s, τ_i),  w_i = (U_i, X_i, D_i).

The final time T and the constant s of an equidistribution are states that stay constant, so the programme has the band
structure that a Riccati solver needs. D_i = d_i (N - 1) / T are the relative node distances and τ_i the running sum of
D_i / (N - 1); on a fixed grid both are parameters. A grid of several arcs (see ``arcs``) has their lengths δ in the
place of T or, of several phases that switch, the rates of their clocks (see ``clocks``), which are equal at the points
of an arc. The constraints of a stage are its gap, z_{i+1} - flow(z_i, w_i) = 0, then what holds along its interval.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from mathnavi.controllers.ocp.clocks import clocks_of
from mathnavi.controllers.ocp.derivative_assembly import Assembly, Block, Factors, NlpStage
from mathnavi.controllers.ocp.distribution import Fixed, NodeDistribution
from mathnavi.controllers.ocp.grid import Mesh
from mathnavi.controllers.ocp.layout import (
    ProgrammeLayout,
    bounded_controls,
    bounded_states,
    fractions_between,
    mixed_constraints,
    variation,
)
from mathnavi.controllers.ocp.pointwise import COLLOCATIONS, collocation_blocks
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.scaling_rows import end_scales, instant_scales, path_scale, state_row_scale
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme, weights
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array, Integers

RELATIVE_WIDTHS = (0.02, 20.0)
"""bounds of D_i where the nodes are unknowns"""
SHORTEST_ARC = 1e-6
"""least length of an arc, over the guess of T"""


@dataclass(frozen=True, eq=False)
class Programme:
    """A nonlinear programme: minimise f(x, p) subject to lower <= g(x, p) <= upper, x_lower <= x <= x_upper."""

    layout: ProgrammeLayout
    x: ca.MX  # (layout.size,)
    p: ca.MX  # (np + N - 1,) parameters of the problem, then D on a fixed grid or E, W (N - 1, A) of arcs, then ρ
    assembly: Assembly  # f, g and their derivatives
    lower: Array  # (m,)
    upper: Array  # (m,)
    row_scale: Array  # (m,) by which a solver divides the rows, see ``scaling_rows``
    x_lower: Array  # (layout.size,) over the scales
    x_upper: Array  # (layout.size,) over the scales
    path_rows: tuple[int, ...]  # (N,) constraints of each stage besides its gap
    gap_start: Integers  # (N - 1,) row of each stage's gap
    inner_rows: Integers  # (N - 1, interior * nx) rows of the scheme's inner equations; -1 for a missing one
    held_rows: Integers  # (N - 1, ·) rows of what holds along each interval, path constraints first; -1 if missing
    initial_rows: Integers  # (ni,) rows of the start
    final_rows: Integers  # (ns + ·,) rows of the end, and of the path constraints at the last node
    instant_rows: Integers  # (nc,) rows of what is stated at given times
    functional: ca.MX | None  # () Σ I_i(x, p), the distribution's share of f; None where it has none
    tied_rows: Integers  # (clocks, n - 1) rows of each clock: its rates at two of the n points in turn are equal
    tied_columns: Integers  # (clocks, n) columns of the rates
    tied_intervals: Integers  # (n,) interval of each point

    @property
    def equality(self) -> list[bool]:
        """Rows (m,) of g that are equations: lower = upper."""
        return [bool(equal) for equal in self.lower == self.upper]


def programme(
    problem: ProblemFunctions,
    scheme: Scheme,
    distribution: NodeDistribution,
    nodes: int,
    arcs: int = 1,
    instant_nodes: tuple[int, ...] = (),
) -> Programme:
    """Build the nonlinear programme of a problem by a scheme on ``nodes`` nodes with a distribution, in ``arcs`` arcs.

    Its objective is J = Σ cost_i + Psi + Σ I_i, its rows those of the start, the intervals and the end. Raises
    ProblemError where there are too few nodes for the distribution, and for several arcs of nodes that are unknowns.
    What is stated at given times holds at ``instant_nodes``, whose indices are those of the nodes.
    """
    if arcs > 1 and distribution.moving:
        raise ProblemError(f"arcs = {arcs} with {distribution!r}; allowed: one arc, or fixed nodes in each")
    tied = arcs > 1 and bool(clocks_of(problem))
    arcs = 1 if tied else arcs
    layout = ProgrammeLayout(problem, scheme, nodes, distribution.moving, distribution.constants, arcs)
    count, nz = nodes - 1, layout.state_size
    x = ca.MX.sym("x", layout.size)
    parameters = ca.MX.sym("p", len(problem.parameters))
    places_known = [] if layout.moving else [ca.MX.sym("D", count)] if arcs == 1 else _arc_shares(count, arcs)
    smoothing = ca.MX.sym("rho", layout.smoothed, count)
    pointwise = isinstance(scheme, COLLOCATIONS) and isinstance(distribution, Fixed)
    interval = None if pointwise else _interval(layout, distribution)
    start, end, instants = _start(layout), _end(layout), _instants(layout)
    between = 0 if interval is None else interval.between
    own_limits = _interval_limits(layout, distribution, layout.own_points + between)
    kept = _own_rows(layout, len(own_limits[0]))

    # Rows of g: the first interval's gap, what holds at the start, the rest of the first interval, the other intervals
    # and what holds at the end.
    shift = len(start.lower)
    places = np.full(kept.shape, -1, dtype=np.int64)
    places[kept] = np.arange(np.count_nonzero(kept)) + shift
    places[0, :nz] -= shift
    at_start, at_end = nz + np.arange(shift)[None, :], places.max() + 1 + np.arange(len(end.lower))[None, :]
    lower, upper, row_scale = (
        np.concatenate([each[:nz], first, np.tile(each, (count, 1))[kept][nz:], last, at])
        for first, each, last, at in zip(
            (start.lower, start.upper, start.scale),
            own_limits,
            (end.lower, end.upper, end.scale),
            (instants.lower, instants.upper, instants.scale),
            strict=True,
        )
    )
    at_instants = at_end.max(initial=places.max()) + 1 + np.arange(len(instants.lower))[None, :]
    p = ca.vertcat(parameters, *(ca.vec(each) for each in (*places_known, smoothing)))
    functional = None
    if interval is None:
        before, share = places_known if arcs > 1 else (_starts(places_known[0]), places_known[0].T / count)
        blocks, linear = collocation_blocks(layout, places, parameters, before, share, smoothing)
    else:
        columns = np.arange(interval.stage.v.numel()) + layout.stage_columns[:, :1]
        known: list[ca.MX] = [ca.repmat(parameters, 1, count), ca.MX(ca.DM(range(count)).T)]
        if arcs > 1:
            known += places_known
        elif places_known:
            known += [_starts(places_known[0]), places_known[0].T]
        known.append(smoothing)
        own = Block(interval.stage, columns, places, ca.vertcat(*known))
        blocks, linear = [own], None
        if not interval.functional.is_zero():
            stage = NlpStage(interval.stage.v, interval.stage.data, interval.stage.rows, interval.functional)
            functional = Assembly(x, p, len(lower), [dataclasses.replace(own, stage=stage)]).f
    blocks = [
        Block(start.stage, np.arange(nz)[None, :], at_start, parameters),
        *blocks,
        Block(end.stage, layout.state_columns[-1:, :1] + np.arange(end.stage.v.numel()), at_end, parameters),
    ]
    if instant_nodes:
        columns = layout.state_columns[list(instant_nodes), : problem.nx].reshape(1, -1)
        blocks.append(Block(instants.stage, columns, at_instants, parameters))
    x_lower, x_upper = _variable_bounds(layout, distribution, tied=tied)
    tied_columns, tied_intervals = _rates(layout, tied=tied)
    tied_rows = len(lower) + np.arange(tied_columns[:, 1:].size, dtype=np.int64).reshape(tied_columns[:, 1:].shape)
    if tied:
        lower, upper = (np.append(side, np.zeros(tied_rows.size)) for side in (lower, upper))
        row_scale = np.append(row_scale, np.ones(tied_rows.size))
        assert linear is not None  # arcs are those of collocation
        rows, ones = tied_rows.ravel(), np.ones(tied_rows.size)
        linear = Factors(
            np.concatenate([linear.rows, rows, rows]),
            np.concatenate([linear.columns, tied_columns[:, :-1].ravel(), tied_columns[:, 1:].ravel()]),
            np.concatenate([linear.values, ones, -ones]),
        )
    path_rows = [*(kept.sum(axis=1) - nz).tolist(), len(end.lower)]
    path_rows[0] += shift
    return Programme(
        layout=layout,
        x=x,
        p=p,
        assembly=Assembly(x, p, len(lower), blocks, linear),
        lower=lower,
        upper=upper,
        row_scale=row_scale,
        x_lower=x_lower,
        x_upper=x_upper,
        path_rows=tuple(path_rows),
        gap_start=places[:, 0],
        inner_rows=places[:, nz : nz + scheme.interior * problem.nx],
        held_rows=places[:, nz + scheme.interior * problem.nx :],
        initial_rows=at_start[0],
        final_rows=at_end[0],
        instant_rows=at_instants[0],
        functional=functional,
        tied_rows=tied_rows,
        tied_columns=tied_columns,
        tied_intervals=tied_intervals,
    )


def _rates(layout: ProgrammeLayout, *, tied: bool) -> tuple[Integers, Integers]:
    """Columns (clocks, n) of the rates of each clock at all points, in their order, and the intervals (n,) of these."""
    nu = layout.problem.nu
    every = layout.stage_columns[:, layout.state_size :][:, : layout.own_points * nu]
    rates = [clock.rate for clock in clocks_of(layout.problem)] if tied else []
    columns = np.array([every[:, rate::nu] for rate in rates], dtype=np.int64)
    columns = columns.reshape(len(rates), layout.nodes - 1, layout.own_points)
    there = every[:, ::nu] >= 0 if nu else np.zeros(columns.shape[1:], dtype=bool)
    intervals = np.repeat(np.arange(layout.nodes - 1, dtype=np.int64), there.sum(axis=1))
    return columns[:, there], intervals


def at_rows(values: Array, rows: Integers) -> Array:
    """Values (m,) of rows at places (·), 0 for a missing row."""
    found: Array = np.where(rows < 0, 0.0, values[rows])
    return found


def _own_rows(layout: ProgrammeLayout, size: int) -> NDArray[np.bool_]:
    """(N - 1, size) True for the rows that an interval has, those of its points, out of those of the largest one."""
    problem, kept = layout.problem, np.zeros((layout.nodes - 1, size), dtype=bool)
    nx, nd, nb = problem.nx, len(problem.path_bounds.lower), len(bounded_controls(problem))
    inner = layout.scheme.interior * nx
    path = layout.state_size + inner + layout.own_points * nd
    if len(layout.members) == 1:
        return ~kept
    between = len(fractions_between(layout.scheme)) * nb
    for scheme, intervals in layout.members:
        own = (
            (layout.state_size, scheme.interior * nx, inner),
            (layout.state_size + inner, len(scheme.points) * nd, layout.own_points * nd),
            (path, len(fractions_between(scheme)) * nb, between),
        )
        present_entries = np.ones(size, dtype=bool)
        for first, present, largest in own:
            present_entries[first + present : first + largest] = False
        kept[intervals] = present_entries
    return kept


def _arc_shares(count: int, arcs: int) -> list[ca.MX]:
    """E and W, (A, N - 1) each."""
    return [ca.MX.sym(name, arcs, count) for name in ("E", "W")]


def _starts(widths: ca.MX) -> ca.MX:
    """(1, N - 1) τ at the start of each interval, the sum of the D before it over N - 1."""
    count = widths.numel()
    return (ca.DM(np.tril(np.ones((count, count)), -1) / count) @ widths).T


@dataclass(frozen=True, eq=False)
class _End:
    """Constraints at the start or at the end, with the limits of its rows."""

    stage: NlpStage
    lower: Array
    upper: Array
    scale: Array


@dataclass(frozen=True, eq=False)
class _Interval:
    """Constraints along an interval."""

    stage: NlpStage
    functional: ca.SX  # () the distribution's I_i, which the stage's cost contains
    between: int  # number of points, besides the scheme's, at which path constraints hold


def _interval(layout: ProgrammeLayout, distribution: NodeDistribution) -> _Interval:
    """Rows of an interval, scaled: its gap, the scheme's inner equations, constraints along it."""
    problem, scheme, count = layout.problem, layout.scheme, layout.nodes - 1
    nx, nu = problem.nx, problem.nu
    z, w = ca.SX.sym("z", layout.state_size), ca.SX.sym("w", layout.input_size)
    z_next, u_next = ca.SX.sym("z_next", layout.state_size), ca.SX.sym("u_next", nu if scheme.shared else 0)
    p = ca.SX.sym("p", len(problem.parameters))
    index, sizes = ca.SX.sym("i"), layout.arcs * int(not layout.moving)
    before, share = ca.SX.sym("E", sizes), ca.SX.sym("W", sizes)  # of a single arc τ and D
    smoothing = ca.SX.sym("rho", layout.smoothed)
    state, inputs = z * layout.state_scale, w * layout.input_scale
    x_0, x_1 = state[:nx], (z_next * layout.state_scale)[:nx]
    lengths = state[nx : nx + layout.durations, :]
    duration = ca.sum1(lengths) if layout.durations else ca.SX(problem.guess_duration)
    # Row slices carry their colon for columns: of one row, an empty slice without it is no column but a row.
    constants = state[nx + layout.durations :, :][: layout.constants, :]
    if layout.arcs > 1:
        t, d = ca.dot(before, lengths), ca.dot(share, lengths)
        relative = count * d / duration
    else:
        relative = inputs[-1] if layout.moving else share
        fraction = state[-1] if layout.moving else before
        t, d = fraction * duration, relative * duration / count
    U = [inputs[k * nu : (k + 1) * nu, :] for k in range(layout.own_points)]
    if scheme.shared:
        U.append(u_next * problem.control_scale)
    inner_start = layout.own_points * nu
    X = [inputs[inner_start + k * nx : inner_start + (k + 1) * nx] for k in range(scheme.interior)]

    def rates(x: ca.SX, u: ca.SX, now: ca.SX) -> tuple[ca.SX, ca.SX]:
        return problem.dynamics(x, u, now, p), problem.running_cost(x, u, now, p)

    interval = scheme.interval(rates, x_0, X, x_1, U, t, d)
    reached = interval.flow if scheme.explicit else x_1
    u_0, u_1 = (
        sum((w * u for w, u in zip(row, U, strict=True) if w), ca.SX.zeros(nu))
        for row in weights(scheme.points, np.array([0.0, 1.0])).tolist()
    )
    mesh = Mesh(
        count=count,
        index=index,
        relative_width=relative,
        duration=duration,
        chord=(reached - x_0) / problem.state_scale,
        second_derivative=duration**2
        / d
        * (rates(reached, u_1, t + d)[0] - rates(x_0, u_0, t)[0])
        / problem.state_scale,
    )
    owned = list(zip(interval.states, U, scheme.points, strict=True))[: layout.own_points]
    along = [problem.path(x, u, t + c * d, p) for x, u, c in owned]
    along += [problem.path(x, U[0], t + c * d, p) for c, x in interval.between]
    along += [x[bounded_states(problem), :] for x in interval.states[1:-1] if scheme.interior == 0]
    along.append(distribution.constraints(mesh, constants))
    between = weights(scheme.points, np.array(fractions_between(scheme))).tolist()
    for row in between:  # the control there, over its scale: a polynomial may leave the bounds that its points keep
        u = sum((w * u / problem.control_scale for w, u in zip(row, U, strict=True)), ca.SX.zeros(nu))
        along.append(u[bounded_controls(problem), :])
    if between:
        along.append(problem.path(x_0, u_0, t, p)[mixed_constraints(problem), :])
    kept = z[nx : nx + layout.durations + layout.constants, :]
    flow = [interval.flow / problem.state_scale, kept]
    if layout.moving:
        flow.append(z[-1] + relative / count)
    inner = interval.inner / np.tile(problem.state_scale, scheme.interior) if scheme.interior else ca.SX(0, 1)
    gap, held = z_next - ca.vertcat(*flow), ca.vertcat(*along)
    functional, smoothed = ca.SX(distribution.functional(mesh)), ca.SX(0)
    for k, row in enumerate(variation(scheme).tolist() if layout.smoothed else []):
        for own, other in zip(row, U, strict=True):
            smoothed += own * ca.dot(smoothing, U[k] * other / problem.control_scale**2)
    stage = NlpStage(
        v=ca.vertcat(z, w, z_next, u_next),
        data=ca.vertcat(p, index, before, share, smoothing),
        rows=ca.vertcat(gap, inner, held),
        cost=interval.cost + functional + smoothed,
    )
    return _Interval(stage, functional, len(interval.between))


def _interval_limits(
    layout: ProgrammeLayout, distribution: NodeDistribution, points: int
) -> tuple[Array, Array, Array]:
    """Limits and scales of the rows of an interval with path constraints at ``points`` points, in the stage's order.

    States at nodes and interior states are unknowns and bounded as such; a midpoint that is an expression is not.
    """
    problem, scheme = layout.problem, layout.scheme
    bounded, equations = bounded_states(problem), np.zeros(layout.state_size + scheme.interior * problem.nx)
    hidden = max(0, len(scheme.points) - 2) if scheme.interior == 0 else 0
    vanishing = np.zeros(distribution.constraints(_sample_mesh(problem), ca.SX.zeros(distribution.constants)).numel())
    controls, count = bounded_controls(problem), len(fractions_between(scheme))
    mixed = mixed_constraints(problem) if count else []

    def rows(own: Array, path: Array, states: Array, between: Array) -> Array:
        parts = [np.tile(path, points), np.tile(states[bounded], hidden), own[len(equations) :]]
        return np.concatenate([own[: len(equations)], *parts, np.tile(between[controls], count), path[mixed]])

    nothing = np.concatenate([equations, vanishing])
    lower, upper = (
        rows(nothing, path, states, own / problem.control_scale)
        for path, states, own in zip(problem.path_bounds, problem.state_bounds, problem.control_bounds, strict=True)
    )
    ones = np.ones(problem.nu)
    return lower, upper, rows(np.ones(len(nothing)), path_scale(problem), state_row_scale(problem), ones)


def _sample_mesh(problem: ProblemFunctions) -> Mesh:
    """Any mesh, to count a distribution's constraints with."""
    one, column = ca.SX(1), ca.SX.ones(problem.nx)
    return Mesh(1, ca.SX(0), one, one, column, column)


def _start(layout: ProgrammeLayout) -> _End:
    """Rows at the first node, i(x(0); p)."""
    problem = layout.problem
    z, p = ca.SX.sym("z", layout.state_size), ca.SX.sym("p", len(problem.parameters))
    rows = problem.initial(z[: problem.nx] * ca.DM(problem.state_scale), p)
    return _End(NlpStage(z, p, rows, ca.SX(0)), *problem.initial_bounds, end_scales(problem)[0])


def _instants(layout: ProgrammeLayout) -> _End:
    """Rows and cost of what is stated at given times."""
    problem, found = layout.problem, layout.problem.instants
    p = ca.SX.sym("p", len(problem.parameters))
    if found is None:
        return _End(NlpStage(ca.SX(0, 1), p, ca.SX(0, 1), ca.SX(0)), np.empty(0), np.empty(0), np.empty(0))
    z = ca.SX.sym("z", len(found.fractions) * problem.nx)
    X = z * ca.DM(np.tile(problem.state_scale, len(found.fractions)))
    return _End(NlpStage(z, p, found.rows(X, p), found.cost(X, p)), *found.bounds, instant_scales(problem))


def _end(layout: ProgrammeLayout) -> _End:
    """Rows at the last node, s(x(T), T; p) and path constraints, and the terminal cost."""
    problem = layout.problem
    z, w = ca.SX.sym("z", layout.state_size), ca.SX.sym("w", layout.last_input_size)
    p = ca.SX.sym("p", len(problem.parameters))
    state = z * ca.DM(layout.state_scale)
    x = state[: problem.nx]
    lengths = state[problem.nx : problem.nx + layout.durations, :]
    duration = ca.sum1(lengths) if layout.durations else ca.SX(problem.guess_duration)
    shared = layout.scheme.shared
    u = w * ca.DM(problem.control_scale) if shared else ca.SX.zeros(problem.nu)
    # Without a control at the last node, what depends on it has held up to there; a scheme whose own last point is
    # this node has held all of it.
    free_of_u = set(range(len(problem.path_bounds.lower))) - set(problem.path.jac_sparsity(0, 1).row())
    along = list(range(len(problem.path_bounds.lower))) if shared else sorted(free_of_u)
    if not shared and layout.scheme.points[-1] == 1.0:
        along = []
    held = problem.path(x, u, duration, p)[along, :]
    lower, upper = (
        np.concatenate([final, path[along]])
        for final, path in zip(problem.final_bounds, problem.path_bounds, strict=True)
    )
    scale = np.concatenate([end_scales(problem)[1], path_scale(problem)[along]])
    rows = ca.vertcat(problem.final(x, duration, p), held)
    if layout.arcs > 1:  # Σ δ = T
        rows = ca.vertcat(rows, duration / problem.guess_duration)
        shortest, longest = problem.duration_bounds
        lower = np.append(lower, shortest / problem.guess_duration)
        upper = np.append(upper, longest / problem.guess_duration)
        scale = np.append(scale, 1.0)
    return _End(NlpStage(ca.vertcat(z, w), p, rows, problem.terminal_cost(x, duration, p)), lower, upper, scale)


def _variable_bounds(layout: ProgrammeLayout, distribution: NodeDistribution, *, tied: bool) -> tuple[Array, Array]:
    """Bounds on the scaled unknowns; clocks run at the rate 1 unless they are ``tied``."""
    problem, n = layout.problem, layout.nodes
    duration = np.tile(np.array(problem.duration_bounds)[:, None], (1, layout.durations))
    if layout.arcs > 1:
        duration[0] = SHORTEST_ARC * problem.guess_duration
    positions = distribution.node_bounds(n)
    bounds = []
    for k, side in enumerate((-np.inf, np.inf)):
        constants = np.full(layout.constants, side)
        z = np.tile(np.concatenate([problem.state_bounds[k], duration[k], constants]), (n, 1))
        if layout.moving:
            z = np.hstack([z, positions[k][:, None]])
        controls = problem.control_bounds[k].copy()
        if not tied:
            controls[[clock.rate for clock in clocks_of(problem)]] = 1.0
        inputs = [np.tile(controls, layout.own_points), np.tile(problem.state_bounds[k], layout.scheme.interior)]
        inputs.append(np.full(int(layout.moving), RELATIVE_WIDTHS[k]))
        w = np.tile(np.concatenate(inputs), (n - 1, 1))
        bounds.append(layout.join(z, w, controls if layout.scheme.shared else np.empty(0)))
    return bounds[0], bounds[1]
