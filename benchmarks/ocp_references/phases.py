"""Collocation of a problem as stated, of one phase or several, with a mesh of equal intervals in each phase.

Of ``mathnavi.controllers.ocp`` it reads the statement alone: symbols, expressions, limits and guesses. On every
interval of width h the dynamics hold at the k points of Radau IIA or of Gauss-Legendre, two discretisations that share
no point:

    X_j = x_0 + h Σ_i A_ji f(X_i, u_i),      x_1 = x_0 + h Σ_i b_i f(X_i, u_i),      J = Σ h Σ_i b_i L(X_i, u_i) + Psi.

A control has a value at each point, or is a polynomial of a lower degree that is within its limits between the points,
as a singular arc needs it. Where controls jump, the widths of the intervals are unknowns too: a boundary moves to the
jump. With controls of degree 0 or 1 the optimum is then an upper bound of J; with a value at each point it would profit
from the errors of wide intervals. What is stated at given times, and the known kinks of tables of the time, are
boundaries that do not move.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.ocp_references.collocation import NoReferenceError, coefficients, gauss, lagrange, radau
from mathnavi.controllers.ocp.breaks import break_fractions
from mathnavi.controllers.ocp.comparisons import Row
from mathnavi.controllers.ocp.guesses import Derived
from mathnavi.controllers.ocp.phase_solutions import MultiPhaseSolution
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.statement import Statement, Variable
from mathnavi.controllers.ocp.substitutions import since_start
from mathnavi.interfaces.signals import Array

Stated = OptimalControlProblem | MultiPhaseProblem

LIMITS = 0.1, 3.0  # of a width that is an unknown, over the equal one
IPOPT: dict[str, Any] = {
    "ipopt.constr_viol_tol": 1e-11,
    "ipopt.dual_inf_tol": 1e-6,
    "ipopt.compl_inf_tol": 1e-11,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.fixed_variable_treatment": "make_parameter",
    "ipopt.max_iter": 3000,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
    "error_on_fail": False,
}


@dataclass(frozen=True)
class Mesh:
    """Intervals of each phase, and what happens inside of them."""

    intervals: int = 60
    degree: int = 5  # k, the number of points in an interval
    control_degree: int | None = None  # of the controls in an interval; None: a value at each point
    moving: bool = False  # whether the widths of the intervals are unknowns

    def points(self, scheme: str) -> Array:
        """Points c (k,) of "Radau" or "Gauss"."""
        return radau(self.degree) if scheme == "Radau" else gauss(self.degree)

    def __str__(self) -> str:
        held = "" if self.control_degree is None else f", controls of degree {self.control_degree}"
        return f"{self.intervals} x {self.degree}{held}{', moving' if self.moving else ''}"


@dataclass(frozen=True, eq=False)
class Course:
    """A phase over the fraction of its duration."""

    duration: float
    tau: Array  # (n,) of the states
    x: Array  # (n, nx)
    tau_u: Array  # (m,) of the controls
    u: Array  # (m, nu)
    widths: Array = field(default_factory=lambda: np.empty(0))  # (intervals,) fractions


@dataclass(frozen=True, eq=False)
class Collocated:
    """A discretised optimum."""

    cost: float
    phases: Mapping[str, Course]  # by name; "" for a problem of one phase
    constants: Array  # unknowns that all phases share

    def __str__(self) -> str:
        spans = ", ".join(f"{name or 'T'} {phase.duration:.10g}" for name, phase in self.phases.items())
        return f"J = {self.cost:.12g} ({spans})"


def of_solution(solution: Solution | MultiPhaseSolution) -> Collocated:
    """A solution of ``solve()`` as a place to start from."""
    own = solution.phases if isinstance(solution, MultiPhaseSolution) else {"": solution}
    constants = np.array(list(solution.unknowns.values())) if isinstance(solution, MultiPhaseSolution) else np.empty(0)
    phases = {}
    for name, phase in own.items():
        tau = phase.t / phase.duration
        times = phase.point_times.ravel() / phase.duration
        u = phase.u.reshape(len(times), -1)
        _, first = np.unique(times, return_index=True)
        phases[name] = Course(phase.duration, tau, phase.x, times[first], u[first])
    return Collocated(solution.cost, phases, constants)


class Programme:
    """A nonlinear programme in the making: scaled unknowns, constraints and cost."""

    def __init__(self) -> None:
        """Begin an empty one."""
        self.w: list[ca.SX] = []
        self.g: list[ca.SX] = []
        self.cost = ca.SX(0)
        self.columns: list[tuple[Array, Array, Array]] = []  # start, lower and upper of the unknowns
        self.limits: list[tuple[Array, Array]] = []

    def unknown(self, name: str, start: Array, lower: Array, upper: Array, scale: Array) -> ca.SX:
        """Unknowns (n,) as an expression in their own units."""
        symbol = ca.SX.sym(name, len(start))
        self.w.append(symbol)
        inside = np.clip(start, lower, upper)
        self.columns.append((inside / scale, lower / scale, upper / scale))
        return symbol * ca.DM(scale)

    def require(self, rows: ca.SX, lower: Array | float = 0.0, upper: Array | float = 0.0) -> None:
        """Constrain rows (n,)."""
        if rows.numel():
            self.g.append(rows)
            self.limits.append((np.full(rows.numel(), lower), np.full(rows.numel(), upper)))

    def solved(self, tolerance: float, wanted: Sequence[ca.SX]) -> tuple[float, list[Array]]:
        """Cost and values of expressions at the optimum; NoReferenceError where IPOPT finds none."""
        every = ca.vertcat(*self.w)
        nlp = {"x": every, "f": self.cost, "g": ca.vertcat(*self.g)}
        solver = ca.nlpsol("reference", "ipopt", nlp, IPOPT | {"ipopt.tol": tolerance})
        x_0, lbx, ubx = (np.concatenate(part) for part in zip(*self.columns, strict=True))
        lbg, ubg = (np.concatenate(part) for part in zip(*self.limits, strict=True))
        answer = solver(x0=x_0, lbx=lbx, ubx=ubx, lbg=lbg, ubg=ubg)
        message = solver.stats()["return_status"]
        if message not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
            raise NoReferenceError(message)
        return float(answer["f"]), [
            each.full() for each in ca.Function("read", [every], list(wanted)).call([answer["x"]])
        ]


def collocated(
    problem: Stated, mesh: Mesh, scheme: str, start: Collocated | None = None, tolerance: float = 1e-11
) -> Collocated:
    """The optimum of a problem on a mesh.

    Args:
        problem: the problem as stated.
        mesh: intervals, degree, and what moves.
        scheme: "Radau" or "Gauss".
        start: another optimum to start from; None for the guess that is stated.
        tolerance: tolerance of IPOPT.

    Raises:
        NoReferenceError: IPOPT finds no solution.
    """
    if isinstance(problem, MultiPhaseProblem):
        statements = {name: each.statement for name, each in problem._phases.items()}
        shared: list[Variable] = problem._unknowns
    else:
        statements, shared = {"": problem.statement}, []
    programme = Programme()
    firsts = [float(v.guess.at(np.zeros(1), 1.0)[0]) for v in shared]
    values = np.array(firsts) if start is None else start.constants
    constants = ca.SX(0, 1)
    if shared:
        scale = np.array([_scale(v, value, 0.0, 0.0) for v, value in zip(shared, firsts, strict=True)])
        lower, upper = np.array([[v.lower for v in shared], [v.upper for v in shared]])
        constants = programme.unknown("constants", values, lower, upper, scale)
    elapsed, made = ca.SX(0), dict[str, _Phase]()
    for name, statement in statements.items():
        begun = None if start is None else start.phases[name]
        made[name] = _Phase(
            programme, statement, mesh, mesh.points(scheme), constants, elapsed, begun, np.array(firsts)
        )
        elapsed = made[name].begin + made[name].T
    if isinstance(problem, MultiPhaseProblem):
        _couple(programme, problem, made, constants)
    wanted = [part for phase in made.values() for part in phase.wanted()]
    try:
        cost, found = programme.solved(tolerance, [constants, *wanted])
    except NoReferenceError as error:
        raise NoReferenceError(f"{problem.name}: {scheme}, {mesh}: {error}") from None
    parts = iter(found[1:])
    phases = {name: Course(float(next(parts).item()), *_course(parts)) for name in made}
    return Collocated(cost, phases, found[0].ravel())


def _course(parts: Iterator[Array]) -> tuple[Array, Array, Array, Array, Array]:
    """Times, states, times of the controls, controls and widths of a phase."""
    tau, x, tau_u, u, widths = (next(parts) for _ in range(5))
    return tau.ravel(), x, tau_u.ravel(), u, widths.ravel()


def _couple(programme: Programme, problem: MultiPhaseProblem, made: Mapping[str, _Phase], constants: ca.SX) -> None:
    """Constraints on the ends of several phases together."""
    rows = problem._couplings
    phases = [(each.statement, made[name]) for name, each in problem._phases.items()]
    known = [s.x for s, _ in phases] + [s.final_time for s, _ in phases]
    at = [phase.x_end for _, phase in phases] + [phase.T for _, phase in phases]
    known += [ca.vertcat(*(v.symbol for v in problem._unknowns)), ca.vertcat(*(p.symbol for p in problem._parameters))]
    at += [constants, ca.SX(ca.DM([p.nominal for p in problem._parameters]))]
    own: set[str] = set()
    for s, _ in phases:  # parameters of one phase
        for parameter in s.parameters:
            if parameter not in problem._parameters and parameter.name not in own:
                own.add(parameter.name)
                known.append(parameter.symbol)
                at.append(ca.SX(parameter.nominal))
    values = ca.Function("couplings", known, [ca.vertcat(*(row.expression for row in rows))])(*at)
    programme.require(values, np.array([row.lower for row in rows]), np.array([row.upper for row in rows]))


def _scale(variable: Variable, guessed: float, first: float, last: float) -> float:
    """Magnitude of a variable: the stated one, that of its guess and its ends, or that of its bounds."""
    if variable.scale is not None:
        return variable.scale
    most = max(abs(guessed), abs(first), abs(last))
    if most > 1e-9:
        return most
    finite = [abs(side) for side in (variable.lower, variable.upper) if 0.0 < abs(side) < 1e6]
    return max(finite, default=1.0)


class _Phase:
    """The unknowns and constraints of a phase, added to a programme."""

    def __init__(
        self,
        programme: Programme,
        statement: Statement,
        mesh: Mesh,
        points: Array,
        constants: ca.SX,
        elapsed: ca.SX,
        start: Course | None,
        shared: Array,
    ) -> None:
        s, duration = statement, statement.duration
        assert duration is not None
        self._programme, self._statement, self._constants = programme, s, constants
        self._p = ca.SX(ca.DM([each.nominal for each in s.parameters]))
        if start is None:
            start = _stated_course(s, shared)
        T_0 = np.array([start.duration])
        self.T = (
            programme.unknown("T", T_0, np.array([duration.lower]), np.array([duration.upper]), T_0)
            if duration.free
            else ca.SX(duration.guess)
        )
        bounds = [np.array([[v.lower for v in own], [v.upper for v in own]]) for own in (s.states, s.controls)]
        scales = [
            np.array([_scale(v, np.abs(column).max(), *_ends(s, v)) for v, column in zip(own, values.T, strict=True)])
            for own, values in ((s.states, start.x), (s.controls, start.u))
        ]

        def state(tau: float) -> ca.SX:
            guess = np.array([np.interp(tau, start.tau, column) for column in start.x.T])
            return programme.unknown("x", guess, bounds[0][0], bounds[0][1], scales[0])

        def control(tau: float) -> ca.SX:
            guess = np.array([np.interp(tau, start.tau_u, column) for column in start.u.T])
            return programme.unknown("u", guess, bounds[1][0], bounds[1][1], scales[1])

        self._known = [s.x, s.u, s.t, s.elapsed, s.final_time, ca.vertcat(*(v.symbol for v in s.shared)), s.p]
        rates = self._function([s.rates[v.name] for v in s.states])
        running, path = self._function([s.running]), self._function([row.expression for row in s.path])
        limits = np.array([[row.lower for row in s.path], [row.upper for row in s.path]])
        A, b = coefficients(points)
        at = points if mesh.control_degree is None else gauss(mesh.control_degree + 1)
        basis = lagrange(at, points)
        within = (
            np.empty((0, 0))
            if mesh.control_degree is None
            else lagrange(at, np.linspace(0.0, 1.0, max(2, 2 * len(at) - 1)))
        )
        x = state(0.0)
        self.begin = elapsed if s.start_time.is_zero() else ca.Function("t_0", [s.x, s.p], [s.start_time])(x, self._p)
        nothing = ca.SX.zeros(len(s.controls))
        self._rows(s.initial, x, nothing, ca.SX(0))
        boundaries, fixed = _boundaries(s, mesh)
        self._instants(boundaries[0], x, nothing)
        equal = np.diff(boundaries)
        given = start.widths if mesh.moving and len(start.widths) == len(equal) else equal
        widths = ca.SX(ca.DM(equal))
        if mesh.moving:
            widths = programme.unknown("w", given, LIMITS[0] * equal, LIMITS[1] * equal, equal)
            for first, last in pairwise(fixed):
                programme.require(ca.sum1(widths[first:last]) / (boundaries[last] - boundaries[first]), 1.0, 1.0)
        now, tau_0 = ca.SX(0), 0.0
        self._x, self._tau, self._u, self._tau_u = [x], [ca.SX(0)], list[ca.SX](), list[ca.SX]()
        self._widths = widths
        for k in range(len(equal)):
            h = self.T * widths[k]
            values = [control(tau_0 + c * given[k]) for c in at]
            self._u += values
            self._tau_u += [now + c * widths[k] for c in at]
            for row in within:  # a polynomial may overshoot between its points
                u = sum((row[i] * values[i] for i in range(len(at))), ca.SX.zeros(len(s.controls)))
                programme.require(u / scales[1], *(side / scales[1] for side in bounds[1]))
            f, L, X = list[ca.SX](), list[ca.SX](), list[ca.SX]()
            for j, c in enumerate(points):
                u = sum((basis[j, i] * values[i] for i in range(len(at))), ca.SX.zeros(len(s.controls)))
                y = state(tau_0 + c * given[k])
                place = self._place(y, u, (now + c * widths[k]) * self.T)
                f.append(rates(*place))
                L.append(running(*place))
                X.append(y)
                programme.require(path(*place), *limits)
            for j in range(len(points)):
                moved = h * sum((A[j, i] * f[i] for i in range(len(points))), ca.SX(0))
                programme.require((x + moved - X[j]) / scales[0])
            programme.cost += h * sum((b[i] * L[i] for i in range(len(points))), ca.SX(0))
            reached = x + h * sum((b[i] * f[i] for i in range(len(points))), ca.SX(0))
            self._x += X
            self._tau += [now + c * widths[k] for c in points]
            now, tau_0 = now + widths[k], tau_0 + given[k]
            if points[-1] == 1.0:
                x = X[-1]
            else:
                x = state(tau_0)
                programme.require((reached - x) / scales[0])
            self._instants(boundaries[k + 1], x, nothing)
        self._rows(s.final, x, nothing, self.T)
        programme.cost += self._function([s.terminal])(*self._place(x, nothing, self.T))
        self.x_end = x

    def wanted(self) -> list[ca.SX]:
        """Readings of the optimum, as ``_course`` takes them."""
        tau, tau_u = ca.vertcat(*self._tau), ca.vertcat(*self._tau_u)
        u = ca.horzcat(*self._u).T if self._statement.controls else ca.SX(len(self._tau_u), 0)
        return [self.T, tau, ca.horzcat(*self._x).T, tau_u, u, self._widths]

    def _function(self, made: Sequence[ca.SX]) -> ca.Function:
        return ca.Function("made", self._known, [ca.vertcat(*made)])

    def _place(self, x: ca.SX, u: ca.SX, elapsed: ca.SX) -> list[ca.SX]:
        """Arguments of the functions at a time since the start."""
        return [x, u, self.begin + elapsed, elapsed, self.T, self._constants, self._p]

    def _rows(self, rows: Sequence[Row], x: ca.SX, u: ca.SX, elapsed: ca.SX) -> None:
        values = self._function([row.expression for row in rows])(*self._place(x, u, elapsed))
        self._programme.require(values, np.array([row.lower for row in rows]), np.array([row.upper for row in rows]))

    def _instants(self, fraction: float, x: ca.SX, u: ca.SX) -> None:
        """Cost and constraints at a given time."""
        duration = self._statement.duration
        assert duration is not None
        for each in self._statement.instants:
            if math.isclose(each.time / duration.guess, fraction, rel_tol=1e-11, abs_tol=1e-11):
                self._programme.cost += self._function([each.cost])(*self._place(x, u, ca.SX(each.time)))
                self._rows(each.rows, x, u, ca.SX(each.time))


def _boundaries(statement: Statement, mesh: Mesh) -> tuple[Array, list[int]]:
    """Boundaries (intervals + 1,) of the intervals, as fractions, and the places of those that do not move.

    Each part between two that do not move has its share of the intervals, and at least one.
    """
    assert statement.duration is not None
    T = statement.duration.guess
    times = {min(each.time / T, 1.0) for each in statement.instants}
    times |= set(break_fractions(since_start(statement)))
    fixed = sorted({0.0, 1.0, *times})
    boundaries, places = [0.0], [0]
    for first, last in pairwise(fixed):
        count = max(1, round(mesh.intervals * (last - first)))
        boundaries += np.linspace(first, last, count + 1)[1:].tolist()
        places.append(len(boundaries) - 1)
    return np.array(boundaries), places


def _ends(statement: Statement, variable: Variable) -> tuple[float, float]:
    """Start and end of a state that are numbers; 0 otherwise."""
    known = [stated.get(variable.name) for stated in (statement.starts, statement.ends)]
    first, last = (float(each) if each is not None and each.is_constant() else 0.0 for each in known)
    return first, last


SAMPLED = 201  # places at which a stated guess is read


def _stated_course(statement: Statement, shared: Array) -> Course:
    """The guess that is stated, with integrals and a simulation made of it."""
    s = statement
    assert s.duration is not None
    T, tau = s.duration.guess, np.linspace(0.0, 1.0, SAMPLED)
    x, u = (np.array([v.guess.at(tau, T) for v in own]).reshape(len(own), SAMPLED).T for own in (s.states, s.controls))
    names = [v.name for v in s.states]
    rates = ca.Function(
        "rates",
        [s.x, s.u, s.t, s.elapsed, s.final_time, ca.vertcat(*(v.symbol for v in s.shared)), s.p],
        [ca.vertcat(*(s.rates[name] for name in names))],
    )
    p = np.array([each.nominal for each in s.parameters])
    begin = float(ca.Function("t_0", [s.x, s.p], [s.start_time])(x[0], p))

    def rate(now: float, at: Array) -> Array:
        held = np.array([np.interp(now / T, tau, column) for column in u.T])
        return np.asarray(rates(at, held, begin + now, now, T, shared, p)).ravel()

    for k, v in enumerate(s.states):
        if isinstance(v.guess, Derived) and v.guess.start_of:
            x[:, k] = x[0, names.index(v.guess.start_of)]
        elif isinstance(v.guess, Derived):
            sampled = np.array([rate(now * T, row)[k] for now, row in zip(tau, x, strict=True)])
            x[:, k] = np.concatenate([[0.0], np.cumsum(0.5 * (sampled[1:] + sampled[:-1]))]) * T / (SAMPLED - 1)
    if s.simulation is not None:
        first = [s.simulation.start.get(name, _ends(s, v)[0] if name in s.starts else x[0, k])
                 for k, (name, v) in enumerate(zip(names, s.states, strict=True))]  # fmt: skip
        x = solve_ivp(rate, (0.0, T), first, t_eval=tau * T, rtol=1e-8, atol=1e-10).y.T
    return Course(T, tau, np.nan_to_num(x), tau, u)


def witness(
    problem: Stated, mesh: Mesh | None = None, start: Collocated | None = None, coarse: Mesh | None = None
) -> tuple[Collocated, Collocated]:
    """Both discretisations of a problem on a mesh, the first started from a coarser one.

    NoReferenceError names what did not converge.
    """
    mesh = mesh or Mesh()
    first = collocated(problem, coarse or Mesh(max(10, mesh.intervals // 4), 3), "Radau", start, tolerance=1e-7)
    by_radau = collocated(problem, mesh, "Radau", first)
    return by_radau, collocated(problem, mesh, "Gauss", by_radau)
