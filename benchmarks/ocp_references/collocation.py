"""Collocation on arcs whose lengths are unknowns: the optimum of a problem whose control jumps, to ten digits.

The horizon is a chain of arcs a = 1 ... A, each of width d_a > 0 and of equal intervals. On an arc a control is held
at a value, follows from an equation that holds there, or is free; so it is smooth inside every arc and jumps only where
two arcs meet. On a singular arc a control with a value at each point would exploit the errors of the
quadrature: there it is a polynomial of lower degree. In every interval of width d the dynamics hold at the k points of
an implicit Runge-Kutta method,

    X_j = x_0 + d Σ_i A_ji f(X_i, u_i),      x_1 = x_0 + d Σ_i b_i f(X_i, u_i),      J = Σ d Σ_i b_i L(X_i, u_i) + Psi,

with the points of Radau IIA or of Gauss-Legendre: two discretisations that share no point.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.polynomial import Legendre

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.interfaces.signals import Array

Equation = Callable[[ca.SX, ca.SX, ca.SX], ca.SX]
"""function (x, u, t) -> expressions that vanish along an arc"""

Entry = Callable[[ca.SX, ca.SX], ca.SX]
"""function (x, t) -> expressions that vanish where an arc begins"""


class NoReferenceError(RuntimeError):
    """A reference solution did not converge."""


@dataclass(frozen=True)
class Arc:
    """A part of the horizon on which every control is smooth."""

    width: float  # guess, as a fraction of T; what is found lies between half and twice of it
    held: Mapping[str, float] = field(default_factory=dict)  # controls by name
    equation: Equation | None = None
    entry: Entry | None = None
    intervals: int = 4
    degree: int | None = None  # of free controls in an interval; None: a value at each point of the method


@dataclass(frozen=True, eq=False)
class Reference:
    """A discretised optimum."""

    cost: float
    duration: float
    widths: Array  # (A,) of the arcs [s]
    t: Array  # (n,) [s] points
    x: Array  # (n, nx)
    u: Array  # (n, nu)
    message: str


def radau(k: int) -> Array:
    """Return the points (k,) of Radau IIA: the zeros of P_k - P_(k-1) on [0, 1], which include 1."""
    points = np.sort(np.real((Legendre.basis(k) - Legendre.basis(k - 1)).roots()))
    points[-1] = 1.0
    return 0.5 * (points + 1.0)


def gauss(k: int) -> Array:
    """Return the Gauss-Legendre points (k,) on [0, 1]."""
    return 0.5 * (np.polynomial.legendre.leggauss(k)[0] + 1.0)


def lagrange(c: Array, at: Array) -> Array:
    """Return the Lagrange basis l_i (n, k) on the points c (k,) at n places."""
    k = len(c)
    return np.array([[np.prod([(s - c[m]) / (c[i] - c[m]) for m in range(k) if m != i]) for i in range(k)] for s in at])


def coefficients(c: Array) -> tuple[Array, Array]:
    """Return A (k, k) and b (k,) of the collocation method with points c: A_ji = ∫_0^c_j l_i, b_i = ∫_0^1 l_i."""
    k = len(c)
    nodes, share = np.polynomial.legendre.leggauss(k)

    def integrals(to: float) -> Array:
        return np.asarray(0.5 * to * share @ lagrange(c, 0.5 * to * (nodes + 1.0)))

    return np.array([integrals(each) for each in c]), integrals(1.0)


def collocate(
    problem: ProblemFunctions,
    arcs: Sequence[Arc],
    points: Array,
    guess: Reference | None = None,
    moving: bool = True,
    tolerance: float = 1e-11,
) -> Reference:
    """Return the optimum on a chain of arcs.

    Args:
        problem: the problem as compiled functions.
        arcs: the chain.
        points: points c of the method in an interval.
        guess: another optimum to start from; None for the problem's guess.
        moving: whether the widths are unknowns; if not, the arcs keep their proportions.
        tolerance: tolerance of IPOPT.

    Raises:
        NoReferenceError: IPOPT finds no solution.
    """
    A, b = coefficients(points)
    nx, p = problem.nx, ca.DM(problem.nominal)
    w: list[ca.SX] = []
    w_0: list[Array] = []
    lower: list[Array] = []
    upper: list[Array] = []
    g: list[ca.SX] = []
    g_lower: list[Array] = []
    g_upper: list[Array] = []

    def unknown(name: str, start: Array, bounds: Sequence[Array], scale: Array) -> ca.SX:
        symbol = ca.SX.sym(name, len(start))
        w.append(symbol)
        w_0.append(np.clip(start, *bounds) / scale)
        lower.append(bounds[0] / scale)
        upper.append(bounds[1] / scale)
        return symbol * ca.DM(scale)

    def require(expression: ca.SX, low: Array, high: Array) -> None:
        g.append(expression)
        g_lower.append(np.asarray(low, float))
        g_upper.append(np.asarray(high, float))

    shortest, longest = problem.duration_bounds
    T_0 = guess.duration if guess is not None else problem.guess_duration
    shares = np.array([arc.width for arc in arcs])
    starts = shares / shares.sum() * T_0
    if not moving:
        T = unknown("T", np.array([T_0]), (np.array([shortest]), np.array([longest])), np.array([T_0]))
        d = T * ca.DM(shares / shares.sum())
    else:
        ends = 0.5 * starts, 2.0 * starts
        d = unknown("d", starts, ends, np.full(len(arcs), T_0))
        T = ca.sum1(d)
        require(T / T_0, np.array([shortest / T_0]), np.array([longest / T_0]))
    state_at, control_at = _guesses(problem, guess)
    x = unknown("x", state_at(0.0), problem.state_bounds, problem.state_scale)
    require(problem.initial(x, p), *problem.initial_bounds)
    cost, t = ca.SX(0), ca.SX(0)
    times, states, controls = [], [], []
    tau = 0.0  # fraction of T, in the guess
    for index, (arc, share) in enumerate(zip(arcs, shares / shares.sum(), strict=True)):
        h, h_0 = d[index] / arc.intervals, share / arc.intervals
        if arc.entry is not None:
            rows = arc.entry(x, t)
            require(rows, np.zeros(rows.numel()), np.zeros(rows.numel()))
        for _ in range(arc.intervals):
            f: list[ca.SX] = []
            X: list[ca.SX] = []
            L: list[ca.SX] = []
            at = points if arc.degree is None else gauss(arc.degree + 1)
            low, high = (np.array(side, float) for side in problem.control_bounds)
            for name, value in arc.held.items():
                low[problem.controls.index(name)] = high[problem.controls.index(name)] = value
            values = [unknown("u", control_at(tau + c * h_0), (low, high), problem.control_scale) for c in at]
            basis = lagrange(at, points)
            for j, c in enumerate(points):
                now = t + c * h
                u = sum((basis[j, i] * values[i] for i in range(len(at))), ca.SX(0))
                y = unknown("X", state_at(tau + c * h_0), problem.state_bounds, problem.state_scale)
                f.append(problem.dynamics(y, u, now, p))
                L.append(problem.running_cost(y, u, now, p))
                X.append(y)
                if arc.equation is not None:
                    rows = arc.equation(y, u, now)
                    require(rows, np.zeros(rows.numel()), np.zeros(rows.numel()))
                elif problem.path_bounds.lower.size:
                    require(problem.path(y, u, now, p), *problem.path_bounds)
                times.append(now)
                states.append(y)
                controls.append(u)
            for j in range(len(points)):
                defect = x + h * sum((A[j, i] * f[i] for i in range(len(points))), ca.SX(0)) - X[j]
                require(defect / ca.DM(problem.state_scale), np.zeros(nx), np.zeros(nx))
            cost += h * sum((b[i] * L[i] for i in range(len(points))), ca.SX(0))
            reached = x + h * sum((b[i] * f[i] for i in range(len(points))), ca.SX(0))
            t, tau = t + h, tau + h_0
            if points[-1] == 1.0:
                x = X[-1]
            else:
                x = unknown("x", state_at(tau), problem.state_bounds, problem.state_scale)
                require((reached - x) / ca.DM(problem.state_scale), np.zeros(nx), np.zeros(nx))
    require(problem.final(x, T, p), *problem.final_bounds)
    cost += problem.terminal_cost(x, T, p)
    every = ca.vertcat(*w)
    solver = ca.nlpsol(
        "reference",
        "ipopt",
        {"x": every, "f": cost, "g": ca.vertcat(*g)},
        {
            "ipopt.tol": tolerance,
            "ipopt.constr_viol_tol": 1e-11,
            "ipopt.dual_inf_tol": 1e-6,
            "ipopt.compl_inf_tol": 1e-11,
            "ipopt.bound_relax_factor": 0.0,
            "ipopt.fixed_variable_treatment": "make_parameter",
            "ipopt.max_iter": 1000,
            "ipopt.print_level": 0,
            "ipopt.sb": "yes",
            "print_time": False,
        },
    )
    answer = solver(
        x0=np.concatenate(w_0), lbx=np.concatenate(lower), ubx=np.concatenate(upper),
        lbg=np.concatenate(g_lower), ubg=np.concatenate(g_upper),
    )  # fmt: skip
    message = solver.stats()["return_status"]
    if message not in ("Solve_Succeeded", "Solved_To_Acceptable_Level"):
        raise NoReferenceError(f"{problem.name}: {message}")
    read = ca.Function("read", [every], [T, d, ca.vertcat(*times), ca.horzcat(*states).T, ca.horzcat(*controls).T])
    T_v, d_v, t_v, x_v, u_v = (np.array(each) for each in read(answer["x"]))
    return Reference(float(answer["f"]), T_v.item(), d_v.ravel(), t_v.ravel(), x_v, u_v, message)


def _guesses(
    problem: ProblemFunctions, guess: Reference | None
) -> tuple[Callable[[float], Array], Callable[[float], Array]]:
    """Return the guess of states and controls as a function of the fraction of T."""
    if guess is None:
        at, x, u = problem.guess_times, problem.guess_states, problem.guess_controls
    else:
        at, x, u = guess.t / guess.duration, guess.x, guess.u

    def state(tau: float) -> Array:
        return np.array([np.interp(tau, at, column) for column in x.T])

    def control(tau: float) -> Array:
        return np.array([np.interp(tau, at, column) for column in u.T])

    return state, control
