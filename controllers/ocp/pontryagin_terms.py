"""The terms of Pontryagin's conditions as functions of a problem, compiled once each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions


@dataclass(frozen=True, eq=False)
class HamiltonianSymbols:
    """Symbols of H = L + λ'f, and its parts in them."""

    x: ca.SX
    u: ca.SX
    t: ca.SX
    p: ca.SX
    costate: ca.SX
    mu: ca.SX  # multipliers of the path constraints
    f: ca.SX
    running: ca.SX

    @property
    def hamiltonian(self) -> ca.SX:
        """H ()."""
        return self.running + ca.dot(self.costate, self.f)

    @property
    def arguments(self) -> list[ca.SX]:
        """x, u, t, p and λ, the arguments of the functions here."""
        return [self.x, self.u, self.t, self.p, self.costate]


def symbols_of(problem: ProblemFunctions) -> HamiltonianSymbols:
    """Fresh symbols for a problem, with its dynamics and running cost in them."""
    x, u, t = ca.SX.sym("x", problem.nx), ca.SX.sym("u", problem.nu), ca.SX.sym("t")
    p, costate = ca.SX.sym("p", len(problem.parameters)), ca.SX.sym("costate", problem.nx)
    mu = ca.SX.sym("mu", len(problem.path_bounds.lower))
    return HamiltonianSymbols(x, u, t, p, costate, mu, problem.dynamics(x, u, t, p), problem.running_cost(x, u, t, p))


@lru_cache(maxsize=64)
def hamiltonian_terms(problem: ProblemFunctions) -> ca.Function:
    """(x, u, t, p, λ, μ) -> H, |L| + Σ|λ f|, H_x + d_x'μ, H_t + d_t'μ, H_u + d_u'μ, |L_u| + |f_u|'|λ|, H_uu, H_u."""
    s = symbols_of(problem)
    H = s.hamiltonian
    whole = H + ca.dot(s.mu, problem.path(s.x, s.u, s.t, s.p))
    size = ca.fabs(s.running) + ca.sum1(ca.fabs(s.costate * s.f))
    by_u = ca.fabs(ca.jacobian(s.f, s.u)).T @ ca.fabs(s.costate) + ca.fabs(ca.gradient(s.running, s.u))
    curvature = ca.vec(ca.densify(ca.hessian(whole, s.u)[0]))
    results = [H, size, ca.gradient(whole, s.x), ca.gradient(whole, s.t), ca.gradient(whole, s.u), by_u, curvature]
    results.append(ca.gradient(H, s.u))
    return ca.Function("terms", [*s.arguments, s.mu], [ca.densify(result) for result in results])


@lru_cache(maxsize=64)
def controls_linear_in_hamiltonian(problem: ProblemFunctions) -> tuple[bool, ...]:
    """True for each control of which H is a linear function, at any value of the others."""
    s = symbols_of(problem)
    curvature = ca.hessian(s.hamiltonian + ca.dot(s.mu, problem.path(s.x, s.u, s.t, s.p)), s.u)[0]
    return tuple(bool(ca.simplify(curvature[:, j]).is_zero()) for j in range(problem.nu))


@lru_cache(maxsize=64)
def is_quadratic(problem: ProblemFunctions, j: int) -> bool:
    """True if H is at most quadratic in a control, so that a stationary convex point is its minimum."""
    s = symbols_of(problem)
    return not ca.depends_on(ca.hessian(s.hamiltonian, s.u)[0][j, j], s.u)


@lru_cache(maxsize=64)
def switching_terms(problem: ProblemFunctions, j: int) -> ca.Function:
    """(x, u, t, p, λ) -> d(H_u)/dt, the size of its terms, -∂/∂u d²(H_u)/dt², for a control in which H is linear."""
    s = symbols_of(problem)
    adjoint = -ca.gradient(s.hamiltonian, s.x)

    def terms(value: ca.SX) -> ca.SX:
        by_x, by_costate = ca.gradient(value, s.x) * s.f, ca.gradient(value, s.costate) * adjoint
        return ca.vertcat(by_x, by_costate, ca.gradient(value, s.t))

    switching = ca.gradient(s.hamiltonian, s.u)[j]
    parts = terms(switching)
    rate = ca.sum1(parts)
    kelley = -ca.gradient(ca.sum1(terms(rate)), s.u)[j]
    return ca.Function("switching", s.arguments, [ca.densify(rate), ca.sum1(ca.fabs(parts)), ca.densify(kelley)])


@lru_cache(maxsize=64)
def start_gradient(problem: ProblemFunctions) -> ca.Function:
    """(x(0), p, ν_0) -> i_x'ν_0."""
    x, p = ca.SX.sym("x", problem.nx), ca.SX.sym("p", len(problem.parameters))
    nu = ca.SX.sym("nu", len(problem.initial_bounds.lower))
    return ca.Function("start", [x, p, nu], [ca.densify(ca.gradient(ca.dot(nu, problem.initial(x, p)), x))])


@lru_cache(maxsize=64)
def end_gradients(problem: ProblemFunctions) -> ca.Function:
    """(x(T), T, p, ν) -> Psi_x + s_x'ν, Psi_T + s_T'ν."""
    x, T, p = ca.SX.sym("x", problem.nx), ca.SX.sym("T"), ca.SX.sym("p", len(problem.parameters))
    nu = ca.SX.sym("nu", len(problem.final_bounds.lower))
    value = problem.terminal_cost(x, T, p) + ca.dot(nu, problem.final(x, T, p))
    return ca.Function("end", [x, T, p, nu], [ca.densify(ca.gradient(value, x)), ca.densify(ca.gradient(value, T))])


@lru_cache(maxsize=64)
def instant_gradients(problem: ProblemFunctions) -> ca.Function:
    """(X, p, ν_k) -> Σ_k (Psi_k + ν_k'c_k)_X (m nx,), by which λ falls at the given times, at states X (m nx,)."""
    assert problem.instants is not None
    found = problem.instants
    X, p = ca.SX.sym("X", len(found.fractions) * problem.nx), ca.SX.sym("p", len(problem.parameters))
    nu = ca.SX.sym("nu", len(found.names))
    value = found.cost(X, p) + ca.dot(nu, found.rows(X, p))
    return ca.Function("instants", [X, p, nu], [ca.densify(ca.gradient(value, X))])
