"""CasADi's statement of the problem of ``mathnavi.controllers.flight.problem``, solved by IPOPT or FATROP.

It shares no code with the compiled kernels, and one is tested against the other. Where those condense the dynamics
into affine maps of the accelerations, here the states are unknowns as well (multiple shooting), ordered stage by stage
as FATROP wants them:

    x_1, a_1, s_1, x_2, a_2, s_2, ..., x_N, w, s_N,    x_i = (p_i, v_i),

s_i the slacks of the points on arc i, s_N those of the manoeuvre and of the approach condition. Everything that
changes from one problem to the next is a parameter, the arcs' lengths too, so a solver is built once per number of arcs
and points and size of the splines, in milliseconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mathnavi.controllers.flight.kernels import problem_data
from mathnavi.controllers.flight.problem import POINTS_ON_MANOEUVRE, PlanSolution, Problem
from mathnavi.controllers.flight.spline import TARGET_LENGTH
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import BufferedFunction
from mathnavi.models.nlp_solver import (
    IPOPT_WARM_START,
    NlpPlugin,
    NlpSolver,
    SolverOutcome,
    StageStructure,
    fatrop_settings,
    ipopt_settings,
)

_ITERATION_LIMIT = 200
SECONDS = 60.0
"""CPU time [s] after which a solve is ended"""
_STATE, _INPUT = 6, 3  # of a stage: position and velocity; acceleration, before the slacks
_MORE: dict[str, dict[str, object]] = {
    "ipopt": {**IPOPT_WARM_START, "mu_strategy": "adaptive"},
    "fatrop": {"mu_init": 1e-3},
}


@dataclass(frozen=True)
class _Shape:
    """Structure of a programme: points on each arc, kind of end, sizes of the splines' windows."""

    points: tuple[int, ...]
    fixed_end: bool
    heights: tuple[int, int]
    ground: tuple[int, int]
    ratio: tuple[int, int, int]

    @property
    def stages(self) -> list[int]:
        """Variables of each arc's stage: state, acceleration and slacks."""
        return [_STATE + _INPUT + count for count in self.points]

    @property
    def last_input(self) -> int:
        """Variables after the last state: the climb rate and the slacks of the manoeuvre and the approach."""
        return 1 + POINTS_ON_MANOEUVRE + (0 if self.fixed_end else 1)


@dataclass(frozen=True, eq=False)
class SplineWindow:
    """The coefficients of a spline within reach of the start, and where they lie in the whole array."""

    coefficients: Array
    corner: Array  # (2,) row and column of its first coefficient
    whole: Array  # (2,) rows and columns of the whole array

    @property
    def frame(self) -> Array:
        """(4,) corner and size of the whole."""
        return np.concatenate([self.corner, self.whole])

    @staticmethod
    def around(coefficients: Array, row: float, column: float, distance: float) -> SplineWindow:
        """Cut the last two axes of ``coefficients`` (..., m, n) to ``distance`` cells around a point given in cells."""
        reach = 8 * math.ceil(distance / 8)  # few sizes, so that few solvers are built
        size = 2 * reach + 5
        rows, columns = coefficients.shape[-2:]
        corner = [
            min(max(math.floor(centre) - reach, 0), max(0, count - size))
            for centre, count in ((row, rows), (column, columns))
        ]
        part = coefficients[..., corner[0] : corner[0] + size, corner[1] : corner[1] + size]
        return SplineWindow(part, np.array(corner, float), np.array([rows, columns], float))


def windows(problem: Problem) -> tuple[SplineWindow, SplineWindow, SplineWindow]:
    """Windows of terrain, grid ground and ratio that no feasible trajectory can leave."""
    p, cost, spacing = problem.parameters, problem.environment.cost, problem.environment.terrain.spacing
    reach = p.speed_max * (p.horizon + p.lengths[-1] + p.manoeuvre_duration)
    x, y = problem.start[:2]
    grid = cost.grid
    on_grid = (y - grid.y_0) / grid.spacing, (x - grid.x_0) / grid.spacing
    return (
        SplineWindow.around(problem.environment.heights, y / spacing, x / spacing, reach / spacing),
        SplineWindow.around(cost.ground, *on_grid, reach / grid.spacing),
        SplineWindow.around(cost.ratio, *on_grid, reach / grid.spacing),
    )


def _basis(f: ca.MX) -> ca.MX:
    """The four cubic B-spline basis functions at fractions f (1, Q) of a cell, (4, Q)."""
    g = 1 - f
    return ca.vertcat(g**3, 4 - 6 * f**2 + 3 * f**3, 4 - 6 * g**2 + 3 * g**3, f**3) / 6


def _spline(c: ca.MX, axes: Sequence[tuple[int, ca.MX, ca.MX]], coordinates: Sequence[ca.MX]) -> ca.MX:
    """Tensor-product cubic B-spline at Q points, (1, Q).

    ``c`` holds the coefficients of the window in C order; each axis is (size of the window, its corner, size of the
    whole array), each of the coordinates (1, Q) is in cells of the whole array and clipped to [0, nodes - 1]. Written
    with gathers over all the points at once, because ``casadi.bspline`` with symbolic coefficients differentiates the
    whole array of coefficients at every evaluation.
    """
    index, weight = ca.MX(), ca.MX()
    for (size, corner, whole), coordinate in zip(axes, coordinates, strict=True):
        clipped = ca.fmin(ca.fmax(coordinate, 0), whole - 3)
        cell = ca.fmin(ca.floor(clipped), whole - 4)
        first = ca.fmin(ca.fmax(cell - corner, 0), size - 4)
        rows, basis = ca.repmat(first, 4, 1) + ca.repmat(ca.DM(range(4)), 1, first.shape[1]), _basis(clipped - cell)
        if index.is_empty():
            index, weight = rows, basis
        else:
            terms = index.shape[0]
            each, tiled = np.repeat(np.arange(terms), 4).tolist(), np.tile(np.arange(4), terms).tolist()
            index, weight = index[each, :] * size + rows[tiled, :], weight[each, :] * basis[tiled, :]
    gathered = ca.reshape(c[ca.vec(index)], index.shape[0], index.shape[1])
    return ca.sum1(gathered * weight)


@dataclass(frozen=True, eq=False)
class _Programme:
    """min f(x, p) subject to lower <= g(x, p) <= upper and bounds on x, and FATROP's view of its structure."""

    functions: dict[str, ca.MX]  # x, p, f, g
    lower: Array  # (m,)
    upper: Array  # (m,)
    equality: list[bool]  # (m,)
    path_constraints: list[int]  # (N,) at each stage
    unit: ca.MX  # of the objective for FATROP, which stops at an absolute tolerance
    relaxed: ca.MX  # x with the least slacks that its states and inputs allow


def _programme(shape: _Shape) -> _Programme:
    """The optimal control problem."""
    n = len(shape.points)
    # Parameters: what is known.
    start, target, scales = ca.MX.sym("start", 6), ca.MX.sym("target", 3), ca.MX.sym("scales", 8)
    lengths = ca.MX.sym("lengths", n)
    packed = ca.MX.sym("packed", problem_data.PACKED_SIZE)
    frames = [ca.MX.sym(name, 4) for name in ("heights_frame", "ground_frame")]  # corner and size of the whole
    heights_c, ground_c, ratio_c = (
        ca.MX.sym(name, math.prod(size))
        for name, size in (("heights", shape.heights), ("ground", shape.ground), ("ratio", shape.ratio))
    )
    duration, floor = packed[problem_data.MANOEUVRE], packed[problem_data.FLOOR]
    speed_max, acceleration_max = packed[problem_data.SPEED], packed[problem_data.ACCELERATION]
    beta, psi, epsilon = packed[problem_data.BETA], packed[problem_data.PSI], packed[problem_data.EPSILON]
    sides, spacing = packed[[problem_data.WIDTH, problem_data.DEPTH]], packed[problem_data.SPACING]
    kappa_h, kappa_s = packed[problem_data.TERRAIN_WEIGHT], packed[problem_data.APPROACH_WEIGHT]
    rho_w = packed[problem_data.CLIMB_WEIGHT]

    def axes(frame: ca.MX, size: tuple[int, int]) -> list[tuple[int, ca.MX, ca.MX]]:
        return [(size[0], frame[0], frame[2]), (size[1], frame[1], frame[3])]

    def height(q: ca.MX) -> ca.MX:
        """H at points (3, Q), (1, Q) [m]."""
        return _spline(heights_c, axes(frames[0], shape.heights), [q[1, :] / spacing, q[0, :] / spacing])

    def lowness(q: ca.MX) -> ca.MX:
        """Clearance (1, Q) [m] that points (3, Q) lack of the least one."""
        return height(q) + floor - q[2, :]

    def length_to_go(q: ca.MX) -> ca.MX:
        """Psi without its factor at points (3, Q), (1, Q) [m]."""
        x_0, y_0, cell, level_0, layer_spacing, p_f = (*ca.vertsplit(scales[:5]), scales[5:])
        row, column = (q[1, :] - y_0) / cell, (q[0, :] - x_0) / cell
        ground = _spline(ground_c, axes(frames[1], shape.ground), [row, column])
        layer = (q[2, :] - ground - level_0) / layer_spacing
        layers = (shape.ratio[0], ca.MX(0), ca.MX(shape.ratio[0]))
        tau = _spline(ratio_c, [layers, *axes(frames[1], (shape.ratio[1], shape.ratio[2]))], [layer, row, column])
        difference = q - ca.repmat(p_f, 1, q.shape[1])
        return ca.sqrt(ca.sum1(difference**2) + TARGET_LENGTH**2) * tau - TARGET_LENGTH

    # Variables.
    stages = [ca.MX.sym(f"stage_{i}", size) for i, size in enumerate(shape.stages)]
    last = ca.MX.sym("last", _STATE + shape.last_input)
    p, v, a = (ca.horzcat(*(stage[k : k + 3] for stage in stages)) for k in (0, 3, 6))  # (3, n)
    slacks = [stage[_STATE + _INPUT :] for stage in stages]
    p_end, v_end, w = last[0:3], last[3:6], last[6]
    s_manoeuvre, s_approach = last[7 : 7 + POINTS_ON_MANOEUVRE], last[7 + POINTS_ON_MANOEUVRE :]
    braking = (ca.vertcat(0, 0, w) - v_end) / duration

    # Objective.
    s = ca.vertcat(*slacks)
    cost = ca.sum1(a**2) @ lengths + rho_w / 2 * w**2
    cost += kappa_h / 2 * (ca.sumsqr(s) + ca.sumsqr(s_manoeuvre)) + kappa_s / 2 * ca.sumsqr(s_approach)
    beyond = lengths[n - 1]
    if not shape.fixed_end:
        togo = length_to_go(ca.horzcat(p_end, p_end + beyond * v_end))
        here, there = ca.horzsplit(psi * togo)
        error = togo[0] - packed[problem_data.LENGTH]
        cost += packed[problem_data.LENGTH_WEIGHT] / 2 * error**2 + here

    # Soft constraints, of the form "at most the slack".
    arc = np.repeat(np.arange(n), shape.points).tolist()  # of each point
    share = [part / count for count in shape.points for part in range(1, count + 1)]
    t = ca.repmat((lengths[arc] * ca.DM(share)).T, 3, 1)
    low = ca.vertsplit(lowness(p[:, arc] + t * v[:, arc] + t**2 / 2 * a[:, arc]).T, np.cumsum([0, *shape.points]))
    t = duration * ca.DM(range(1, POINTS_ON_MANOEUVRE + 1)).T / POINTS_ON_MANOEUVRE
    manoeuvre = ca.repmat(p_end, 1, POINTS_ON_MANOEUVRE) + v_end @ t + braking @ (t**2 / 2)
    low_manoeuvre = lowness(manoeuvre).T
    far = ca.MX(0, 1) if shape.fixed_end else ca.if_else(psi > 0, (there - here) / (beyond * beta) + 1 + epsilon, -1)
    relaxed = [
        ca.vertcat(stage[: _STATE + _INPUT], ca.fmax(lowest, 0)) for stage, lowest in zip(stages, low, strict=True)
    ]
    relaxed += [p_end, v_end, w, ca.fmax(low_manoeuvre, 0), ca.fmax(far, 0)]

    # Dynamics, stage by stage, with the path constraints of each stage after them; boundary conditions at both ends.
    following = ca.horzcat(*(stage[:_STATE] for stage in stages[1:]), last[:_STATE])
    h = ca.repmat(lengths.T, 3, 1)
    gap = following - ca.vertcat(p + h * v + h**2 / 2 * a, v + h * a)
    speed = ca.sum1((v + h * a) ** 2) / speed_max**2
    acceleration = ca.sum1(a**2) / acceleration_max**2
    constraints: list[tuple[ca.MX, float, float]] = []
    path_constraints = []
    for i in range(n):
        constraints.append((gap[:, i], 0.0, 0.0))
        path = [(speed[i], -np.inf, 1.0), (acceleration[i], -np.inf, 1.0), (low[i] - slacks[i], -np.inf, 0.0)]
        if i == 0:
            path.append((stages[0][:_STATE] - start, 0.0, 0.0))
        constraints += path
        path_constraints.append(sum(g.numel() for g, _, _ in path))
    # On the map, as fractions of what lies inside its border.
    middle, half = sides / 2, sides / 2 - problem_data.BORDER
    final = [(ca.sumsqr(braking) / acceleration_max**2, -np.inf, 1.0)]
    final += [((q[:2] - middle) / half, -1.0, 1.0) for q in (p_end, manoeuvre[:, -1])]
    final += [(low_manoeuvre - s_manoeuvre, -np.inf, 0.0), (far - s_approach, -np.inf, 0.0)]
    if shape.fixed_end:
        final.append((p_end - target, 0.0, 0.0))
    constraints += final
    path_constraints.append(sum(g.numel() for g, _, _ in final))

    known = [start, target, lengths, scales, packed, *frames, heights_c]
    if not shape.fixed_end:
        known += [ground_c, ratio_c]
    return _Programme(
        functions={
            "x": ca.vertcat(*stages, last),
            "p": ca.vertcat(*known),
            "f": cost,
            "g": ca.vertcat(*(g for g, _, _ in constraints)),
        },
        lower=np.concatenate([np.full(g.numel(), low) for g, low, _ in constraints]),
        upper=np.concatenate([np.full(g.numel(), high) for g, _, high in constraints]),
        equality=[low == high for g, low, high in constraints for _ in range(g.numel())],
        path_constraints=path_constraints,
        unit=ca.MX(1) if shape.fixed_end else 1 + beta,
        relaxed=ca.vertcat(*relaxed),
    )


def _values(problem: Problem) -> tuple[_Shape, list[Array]]:
    """The shape of a problem and its parameters, in the order of ``_programme``."""
    around = windows(problem)
    heights, ground, ratio = (window.coefficients for window in around)
    fixed_end = problem.terminal_position is not None
    values = [
        problem.start,
        problem.terminal_position if problem.terminal_position is not None else np.zeros(3),
        problem.matrices.lengths,
    ]
    values += [problem.environment.cost.scales, problem.packed, around[0].frame, around[1].frame, heights]
    if not fixed_end:
        values += [ground, ratio]
    return _Shape(problem.parameters.points, fixed_end, heights.shape, ground.shape, ratio.shape), values


class InteriorPoint:
    """Solver of one ``Problem`` after another by an interior-point method on its CasADi formulation.

    A solve starts from the guess and, if the last one of the same shape succeeded, from its multipliers. ``compiled``
    translates the statement's derivatives to C once per shape (tens of seconds, kept in the user's cache folder);
    otherwise they run in CasADi's virtual machine.
    """

    def __init__(self, backend: NlpPlugin = "ipopt", tolerance: float = 1e-6, *, compiled: bool = False) -> None:
        if backend not in ("ipopt", "fatrop"):
            raise ArgumentError(f"backend = {backend!r}; allowed: ipopt, fatrop")
        if not tolerance > 0.0:
            raise ArgumentError(f"tolerance = {tolerance!r}; allowed: > 0")
        self._backend, self._tolerance, self._compiled = backend, tolerance, compiled
        self._solvers: dict[_Shape, _Solver] = {}

    def solve(self, problem: Problem, guess: Array) -> PlanSolution | str:
        """Solve from ``guess`` (3n + 1,) [m/s^2, m/s]; returns the solver's reason if it fails."""
        shape, values = _values(problem)
        if shape not in self._solvers:
            self._solvers[shape] = _Solver(shape, self._backend, self._tolerance, self._compiled)
        return self._solvers[shape].solve(problem, values, guess)


class _Solver:
    """The NLP solver for problems of one shape."""

    def __init__(self, shape: _Shape, backend: NlpPlugin, tolerance: float, compiled: bool) -> None:
        programme = _programme(shape)
        functions = dict(programme.functions)
        if backend == "ipopt":
            settings = ipopt_settings(tolerance, _ITERATION_LIMIT, _MORE[backend])
        else:
            functions["f"] = functions["f"] / programme.unit
            stages = StageStructure(
                states=[_STATE] * (len(shape.points) + 1),
                inputs=[size - _STATE for size in shape.stages] + [shape.last_input],
                path_rows=programme.path_constraints,
                equality=programme.equality,
            )
            settings = fatrop_settings(stages, tolerance, _ITERATION_LIMIT, _MORE[backend])
        self._scaled = backend == "fatrop" and not shape.fixed_end
        begin = np.cumsum([0, *shape.stages])[:-1]
        self._accelerations = begin[:, None] + _STATE + np.arange(_INPUT)  # (n, 3) where they stand
        self._solver = NlpSolver(
            "flight", backend, functions, settings, ("x", "f", "lam_x", "lam_g"), seconds=SECONDS, compiled=compiled
        )
        self._in, self._out = self._solver.inputs, self._solver.outputs
        relax = ca.Function("relax", [functions["x"], functions["p"]], [programme.relaxed], ["x0", "p"], ["x"])
        self._relaxed = np.zeros_like(self._in["x0"])
        self._relax = BufferedFunction(relax, (self._in["x0"], self._in["p"]), [self._relaxed])
        self._in["lbg"][:], self._in["ubg"][:] = programme.lower, programme.upper
        self._in["lbx"][:], self._in["ubx"][:] = -np.inf, np.inf
        self._climb = -shape.last_input
        self._in["lbx"][self._climb] = 0.0  # 0 <= w <= v_max

    def solve(self, problem: Problem, values: list[Array], guess: Array) -> PlanSolution | str:
        self._in["ubx"][self._climb] = problem.parameters.speed_max
        np.concatenate([value.ravel() for value in values], out=self._in["p"])
        self._in["x0"][:] = _lifted(problem, guess)
        self._relax()
        self._in["x0"][:] = self._relaxed
        report, x = self._solver.solve(), self._out["x"]
        if report.iterations is None:  # the solver raised an exception
            self._forget()
            return report.message
        if not (report.outcome is SolverOutcome.CONVERGED and np.isfinite(x).all()):
            self._forget()
            return f"{report.message} after {report.iterations} iterations"
        self._in["lam_x0"][:], self._in["lam_g0"][:] = self._out["lam_x"], self._out["lam_g"]
        cost = float(self._out["f"][0])
        if self._scaled:
            cost *= 1.0 + problem.parameters.beta
        return PlanSolution(x[self._accelerations], float(x[self._climb]), cost, True, report.iterations)

    def _forget(self) -> None:
        """Drop the multipliers of a solve that failed."""
        self._in["lam_x0"][:], self._in["lam_g0"][:] = 0.0, 0.0


def _lifted(problem: Problem, unknowns: Array) -> Array:
    """The variables of accelerations and climb rate (3n + 1,): dynamics exact, slacks zero."""
    p, x, out = problem.parameters, problem.start, []
    for a, h, count in zip(unknowns[:-1].reshape(-1, 3), p.lengths, p.points, strict=True):
        out += [x, a, np.zeros(count)]
        x = np.concatenate([x[:3] + h * x[3:] + 0.5 * h * h * a, x[3:] + h * a])
    approach = 0 if problem.terminal_position is not None else 1
    return np.concatenate([*out, x, unknowns[-1:], np.zeros(POINTS_ON_MANOEUVRE + approach)])
