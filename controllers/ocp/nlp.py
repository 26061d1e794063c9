"""The nonlinear programme of a problem, a transcription and a distribution of nodes (B.2, B.3).

Unknowns, stage by stage, each over its scale:

    z_1, w_1, z_2, w_2, ..., z_N, w_N,      z_i = (x_i, T, s, τ_i),  w_i = (U_i, X_i, D_i).

The final time T and the constant s of an equidistribution are states that stay constant, so the programme has the band
structure that a Riccati solver needs. D_i = d_i (N - 1) / T are the relative node distances and τ_i the running sum of
D_i / (N - 1); on a fixed grid both are parameters. A grid of several arcs (see ``arcs``) has their lengths δ in the
place of T. The constraints of a stage are its gap, z_{i+1} - flow(z_i, w_i) =
0, then what holds along its interval.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.distribution import NodeDistribution
from mathnavi.controllers.ocp.mesh import Mesh
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.stagewise import Assembly, Block
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme, gauss_legendre, weights
from mathnavi.sim.interfaces.errors import ProblemError
from mathnavi.sim.interfaces.signals import Array, Integers

RELATIVE_WIDTHS = (0.02, 20.0)
"""bounds of D_i where the nodes are unknowns"""
SLOPE = 1e-3
"""share of a control's slope in its variation"""
SHORTEST_ARC = 1e-6
"""least length of an arc, over the guess of T"""


@dataclass(frozen=True, eq=False)
class ProgrammeLayout:
    """Layout of the vector of unknowns (size,): the place and the scale of each part, see the module."""

    problem: ProblemFunctions
    scheme: Scheme
    nodes: int  # N
    moving: bool  # True if the nodes are unknowns
    constants: int  # number of the distribution's constants s
    arcs: int = 1  # A

    @property
    def free_duration(self) -> bool:
        """True if T is an unknown."""
        return self.problem.free_duration

    @property
    def durations(self) -> int:
        """Number of unknown durations: the lengths of several arcs, or T if it is free."""
        return self.arcs if self.arcs > 1 else int(self.free_duration)

    @property
    def state_size(self) -> int:
        """Size of z_i = (x_i, T, s, τ_i)."""
        return self.problem.nx + self.durations + self.constants + int(self.moving)

    @property
    def own_points(self) -> int:
        """Number of an interval's control points that are not those of the next."""
        return len(self.scheme.points) - int(self.scheme.shared)

    @property
    def input_size(self) -> int:
        """Size of w_i = (U_i, X_i, D_i), but for the last stage."""
        p = self.problem
        return self.own_points * p.nu + self.scheme.interior * p.nx + int(self.moving)

    @property
    def last_input_size(self) -> int:
        """Size of w_N in the last stage: its control, if the scheme shares it between intervals."""
        return self.problem.nu if self.scheme.shared else 0

    @property
    def smoothed(self) -> int:
        """Number of controls whose variation within an interval a weight ρ holds down: all that may jump at nodes."""
        return self.problem.nu if fractions_between(self.scheme) else 0

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return (self.nodes - 1) * (self.state_size + self.input_size) + self.state_size + self.last_input_size

    @cached_property
    def state_scale(self) -> Array:
        """Scales (state_size,) of z."""
        duration = np.full(self.durations, self.problem.guess_duration)
        return np.concatenate([self.problem.state_scale, duration, np.ones(self.constants + int(self.moving))])

    @cached_property
    def input_scale(self) -> Array:
        """Scales (input_size,) of w."""
        p = self.problem
        return np.concatenate(
            [
                np.tile(p.control_scale, self.own_points),
                np.tile(p.state_scale, self.scheme.interior),
                np.ones(int(self.moving)),
            ]
        )

    @cached_property
    def scale(self) -> Array:
        """Scales (size,) of the unknowns."""
        stage = np.concatenate([self.state_scale, self.input_scale])
        last = [self.state_scale, self.problem.control_scale if self.scheme.shared else np.empty(0)]
        return np.concatenate([np.tile(stage, self.nodes - 1), *last])

    def split(self, unknowns: Array) -> tuple[Array, Array, Array]:
        """Split scaled unknowns (size,) into z (N, state_size), w (N - 1, input_size) and w_N (last_input_size,).

        The parts are in the problem's units, no longer over their scales.
        """
        values = unknowns * self.scale
        stage = self.state_size + self.input_size
        body = values[: (self.nodes - 1) * stage].reshape(self.nodes - 1, stage)
        tail = values[(self.nodes - 1) * stage :]
        z = np.vstack([body[:, : self.state_size], tail[: self.state_size]])
        return z, body[:, self.state_size :], tail[self.state_size :]

    def join(self, z: Array, w: Array, last: Array) -> Array:
        """Join z (N, state_size), w (N - 1, input_size) and w_N (last_input_size,) to scaled unknowns (size,).

        The inverse of ``split``.
        """
        body = np.hstack([z[:-1], w]).ravel()
        joined: Array = np.concatenate([body, z[-1], last]) / self.scale
        return joined


@dataclass(frozen=True, eq=False)
class Programme:
    """A nonlinear programme: minimise f(x, p) subject to lower <= g(x, p) <= upper, x_lower <= x <= x_upper."""

    layout: ProgrammeLayout
    x: ca.MX  # (layout.size,)
    p: ca.MX  # (np + N - 1,) parameters of the problem, then D on a fixed grid or E, W (N - 1, A) of arcs, then ρ
    assembly: Assembly  # f, g and their derivatives
    lower: Array  # (m,)
    upper: Array  # (m,)
    x_lower: Array  # (layout.size,) over the scales
    x_upper: Array  # (layout.size,) over the scales
    path_rows: tuple[int, ...]  # (N,) constraints of each stage beside its gap
    gap_start: Integers  # (N - 1,) row of each stage's gap
    inner_rows: Integers  # (N - 1, interior * nx) rows of the scheme's inner equations
    held_rows: Integers  # (N - 1, ·) rows of what holds along each interval: path constraints first
    initial_rows: Integers  # (ni,) rows of the start
    final_rows: Integers  # (ns + ·,) rows of the end, and of the path constraints at the last node
    functional: ca.MX | None  # () Σ I_i(x, p), the distribution's share of f; None where it has none

    @property
    def equality(self) -> list[bool]:
        """Rows (m,) of g that are equations: lower = upper."""
        return [bool(equal) for equal in self.lower == self.upper]


def programme(
    problem: ProblemFunctions, scheme: Scheme, distribution: NodeDistribution, nodes: int, arcs: int = 1
) -> Programme:
    """Nonlinear programme of a problem by a scheme on ``nodes`` nodes with a distribution, in so many arcs.

    Its objective is J = Σ cost_i + Psi + Σ I_i, its rows those of the start, the intervals and the end. Raises
    ProblemError where the distribution cannot place so few nodes, and for several arcs of nodes that are unknowns.
    """
    if arcs > 1 and distribution.moving:
        raise ProblemError(f"arcs = {arcs} with {distribution!r}; allowed: one arc, or fixed nodes in each")
    layout = ProgrammeLayout(problem, scheme, nodes, distribution.moving, distribution.constants, arcs)
    count, nz, stride = nodes - 1, layout.state_size, layout.state_size + layout.input_size
    x = ca.MX.sym("x", layout.size)
    parameters = ca.MX.sym("p", len(problem.parameters))
    places_known = [] if layout.moving else [ca.MX.sym("D", count)] if arcs == 1 else _arc_shares(count, arcs)
    start, (interval, functional), end = _start(layout), _interval(layout, distribution), _end(layout)

    # Rows of g: the first interval's gap, what holds at the start, the rest of the first interval, the other intervals
    # and what holds at the end.
    shift = len(start.lower)
    places = np.arange(count * len(interval.lower)).reshape(count, -1) + shift
    places[0, :nz] -= shift
    at_start, at_end = nz + np.arange(shift)[None, :], places[-1, -1] + 1 + np.arange(len(end.lower))[None, :]
    lower, upper = (
        np.concatenate([each[:nz], first, each[nz:], np.tile(each, count - 1), last])
        for first, each, last in zip(start.limits, interval.limits, end.limits, strict=True)
    )
    columns = np.arange(interval.v.numel()) + stride * np.arange(count)[:, None]
    known: list[ca.MX] = [ca.repmat(parameters, 1, count), ca.MX(ca.DM(range(count)).T)]
    if arcs > 1:
        known += places_known
    elif places_known:
        known += [_starts(places_known[0]), places_known[0].T]
    smoothing = ca.MX.sym("rho", layout.smoothed, count)
    known.append(smoothing)
    blocks = (
        start.block(columns[:1, :nz], at_start, parameters),
        interval.block(columns, places, ca.vertcat(*known)),
        end.block(count * stride + np.arange(end.v.numel())[None, :], at_end, parameters),
    )
    p = ca.vertcat(parameters, *(ca.vec(each) for each in (*places_known, smoothing)))
    shares = dataclasses.replace(interval, cost=functional).block(columns, places, ca.vertcat(*known))
    x_lower, x_upper = _variable_bounds(layout, distribution)
    path_rows = [len(interval.lower) - nz] * count + [len(end.lower)]
    path_rows[0] += shift
    return Programme(
        layout=layout,
        x=x,
        p=p,
        assembly=Assembly(x, p, len(lower), blocks),
        lower=lower,
        upper=upper,
        x_lower=x_lower,
        x_upper=x_upper,
        path_rows=tuple(path_rows),
        gap_start=places[:, 0],
        inner_rows=places[:, nz : nz + scheme.interior * problem.nx],
        held_rows=places[:, nz + scheme.interior * problem.nx :],
        initial_rows=at_start[0],
        final_rows=at_end[0],
        functional=None if functional.is_zero() else Assembly(x, p, len(lower), [shares]).f,
    )


def _arc_shares(count: int, arcs: int) -> list[ca.MX]:
    """E and W, (A, N - 1) each."""
    return [ca.MX.sym(name, arcs, count) for name in ("E", "W")]


def variation(scheme: Scheme) -> Array:
    """Matrix (k, k) whose quadratic form is the mean square of a control less its straight line over an interval.

    The line's own slope counts for a thousandth.
    """
    abscissae, share = gauss_legendre(len(scheme.points))
    basis, b = weights(scheme.points, 0.5 * (abscissae + 1.0)), 0.5 * share
    slope = np.outer(abscissae, (b * abscissae) @ basis / (b @ abscissae**2))
    bent = basis - b @ basis - slope
    matrix: Array = bent.T @ (b[:, None] * bent) + SLOPE * slope.T @ (b[:, None] * slope)
    return matrix


def _starts(widths: ca.MX) -> ca.MX:
    """(1, N - 1) τ at the start of each interval, the sum of the D before it over N - 1."""
    count = widths.numel()
    return (ca.DM(np.tril(np.ones((count, count)), -1) / count) @ widths).T


@dataclass(frozen=True, eq=False)
class _Part:
    """Expressions of the start, of an interval or of the end, with the limits of their rows."""

    v: ca.SX  # unknowns
    data: ca.SX
    rows: ca.SX
    cost: ca.SX
    lower: Array
    upper: Array

    @property
    def limits(self) -> tuple[Array, Array]:
        return self.lower, self.upper

    def block(self, columns: Integers, places: Integers, known: ca.MX) -> Block:
        return Block(self.v, self.data, self.rows, self.cost, columns, places, known)


def _interval(layout: ProgrammeLayout, distribution: NodeDistribution) -> tuple[_Part, ca.SX]:
    """Rows of an interval, scaled: its gap, the scheme's inner equations, what holds along it. Its functional I_i too,
    which the part's cost contains.
    """
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
    lower, upper = _along_bounds(layout, distribution, layout.own_points + len(interval.between))
    equations = np.zeros(gap.numel() + inner.numel())
    functional, smoothed = ca.SX(distribution.functional(mesh)), ca.SX(0)
    for k, row in enumerate(variation(scheme).tolist() if layout.smoothed else []):
        for own, other in zip(row, U, strict=True):
            smoothed += own * ca.dot(smoothing, U[k] * other / problem.control_scale**2)
    part = _Part(
        v=ca.vertcat(z, w, z_next, u_next),
        data=ca.vertcat(p, index, before, share, smoothing),
        rows=ca.vertcat(gap, inner, held),
        cost=interval.cost + functional + smoothed,
        lower=np.concatenate([equations, lower]),
        upper=np.concatenate([equations, upper]),
    )
    return part, functional


def bounded_states(problem: ProblemFunctions) -> list[int]:
    """Indices of the states with a finite bound along the path."""
    lower, upper = problem.state_bounds
    return np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)).tolist()


def mixed_constraints(problem: ProblemFunctions) -> list[int]:
    """Indices of the path constraints that depend on a control."""
    return sorted(set(problem.path.jac_sparsity(0, 1).row()))


def bounded_controls(problem: ProblemFunctions) -> list[int]:
    """Indices of the controls with a finite bound."""
    lower, upper = problem.control_bounds
    return np.flatnonzero(np.isfinite(lower) | np.isfinite(upper)).tolist()


def fractions_between(scheme: Scheme) -> tuple[float, ...]:
    """Fractions of an interval at which bounds of a control that may jump at nodes hold beside the scheme's points.

    The start, where the control is extrapolated, and the middles between two points; none for a control that is held
    or shared between intervals.
    """
    points = scheme.points
    if scheme.shared or len(points) == 1:
        return ()
    ends = (0.0,) if points[-1] == 1.0 else (0.0, 1.0)
    return (*ends, *(0.5 * (a + b) for a, b in pairwise(points)))


def _along_bounds(layout: ProgrammeLayout, distribution: NodeDistribution, points: int) -> tuple[Array, Array]:
    """Limits of the path constraints of an interval at so many points, in the order of the stage function.

    States at nodes and interior states are unknowns and bounded as such; a midpoint that is an expression is not.
    """
    problem, scheme = layout.problem, layout.scheme
    bounded = bounded_states(problem)
    hidden = max(0, len(scheme.points) - 2) if scheme.interior == 0 else 0
    vanishing = np.zeros(distribution.constraints(_sample_mesh(problem), ca.SX.zeros(distribution.constants)).numel())
    lower, upper = (
        np.concatenate([np.tile(path, points), np.tile(states[bounded], hidden), vanishing, between])
        for path, states, between in zip(
            problem.path_bounds, problem.state_bounds, _bounds_between(problem, scheme), strict=True
        )
    )
    return lower, upper


def _bounds_between(problem: ProblemFunctions, scheme: Scheme) -> tuple[Array, Array]:
    """Limits of the controls over their scales at ``fractions_between``, then of mixed constraints at the start."""
    count, bounded = len(fractions_between(scheme)), bounded_controls(problem)
    mixed = mixed_constraints(problem) if count else []
    lower, upper = (
        np.concatenate([np.tile((side / problem.control_scale)[bounded], count), path[mixed]])
        for side, path in zip(problem.control_bounds, problem.path_bounds, strict=True)
    )
    return lower, upper


def _sample_mesh(problem: ProblemFunctions) -> Mesh:
    """Any mesh, to count a distribution's constraints with."""
    one, column = ca.SX(1), ca.SX.ones(problem.nx)
    return Mesh(1, ca.SX(0), one, one, column, column)


def _start(layout: ProgrammeLayout) -> _Part:
    """Rows at the first node, i(x(0); p)."""
    problem = layout.problem
    z, p = ca.SX.sym("z", layout.state_size), ca.SX.sym("p", len(problem.parameters))
    rows = problem.initial(z[: problem.nx] * ca.DM(problem.state_scale), p)
    return _Part(z, p, rows, ca.SX(0), *problem.initial_bounds)


def _end(layout: ProgrammeLayout) -> _Part:
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
    rows = ca.vertcat(problem.final(x, duration, p), held)
    if layout.arcs > 1:  # Σ δ = T
        rows = ca.vertcat(rows, duration / problem.guess_duration)
        shortest, longest = problem.duration_bounds
        lower = np.append(lower, shortest / problem.guess_duration)
        upper = np.append(upper, longest / problem.guess_duration)
    return _Part(ca.vertcat(z, w), p, rows, problem.terminal_cost(x, duration, p), lower, upper)


def _variable_bounds(layout: ProgrammeLayout, distribution: NodeDistribution) -> tuple[Array, Array]:
    """Bounds on the scaled unknowns."""
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
        controls = problem.control_bounds[k]
        inputs = [np.tile(controls, layout.own_points), np.tile(problem.state_bounds[k], layout.scheme.interior)]
        inputs.append(np.full(int(layout.moving), RELATIVE_WIDTHS[k]))
        w = np.tile(np.concatenate(inputs), (n - 1, 1))
        bounds.append(layout.join(z, w, controls if layout.scheme.shared else np.empty(0)))
    return bounds[0], bounds[1]
