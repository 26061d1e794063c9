"""Every scheme through one suite: order, consistency, what its unknowns are, what its solutions say in between."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mathnavi.controllers.ocp.grid import stretched, uniform
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.transcriptions.collocation import (
    GaussLegendre,
    LegendreGaussLobatto,
    RadauIIA,
    legendre_gauss_lobatto,
    radau,
)
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson, MultipleShooting, Trapezoid
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme, integral_weights, weights
from tests.controllers.ocp.statements import double_integrator, integrator

SCHEMES = [
    Euler(),
    Trapezoid(),
    HermiteSimpson(),
    MultipleShooting(1),
    LegendreGaussLobatto(3),
    LegendreGaussLobatto(5),
    RadauIIA(2),
    RadauIIA(4),
    GaussLegendre(3),
]
schemes = pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)


def pendulum() -> ProblemFunctions:
    """Nothing to choose: a pendulum with a drive that depends on time; J = ∫ x^2 dt."""
    ocp = OptimalControlProblem("pendulum")
    x, v = ocp.state("x"), ocp.state("v")
    ocp.duration(2.0)
    ocp.minimise(running=x**2, terminal=v)
    ocp.dynamics(x, v)
    ocp.dynamics(v, -ca.sin(x) + ca.cos(3.0 * ocp.t))
    ocp.start(x, 1.0)
    ocp.start(v, 0.0)
    return ocp.functions()


def linear_quadratic() -> ProblemFunctions:
    """x' = u, ∫ (x^2 + u^2) / 2 over [0, 1] from 1: J* = tanh(1) / 2, u = -sinh(1 - t) / cosh(1)."""
    ocp = OptimalControlProblem("linear-quadratic")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=(x**2 + u**2) / 2)
    ocp.dynamics(x, u)
    ocp.start(x, 1.0)
    return ocp.functions()


@schemes
def test_the_error_of_the_end_falls_with_the_order_of_the_scheme(scheme: Scheme) -> None:
    problem = pendulum()

    def rates(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -np.sin(y[0]) + np.cos(3.0 * t), y[0] ** 2]

    truth = solve_ivp(rates, (0.0, 2.0), [1.0, 0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    coarse, fine = (8, 16) if scheme.order < 6 else (2, 4)
    errors, costs = [], []
    for intervals in (coarse, fine):
        solution = solve(problem, intervals + 1, scheme=scheme)
        assert solution.solved
        errors.append(np.abs(solution.x[-1] - truth[:2]).max())
        costs.append(abs(solution.cost - truth[2] - truth[1]))
    assert 2 ** (scheme.order - 0.75) < errors[0] / errors[1] < 2 ** (scheme.order + 1.5)
    if scheme.order > 1:  # Euler's errors of opposite sign may cancel
        assert 2 ** (scheme.order - 1.0) < costs[0] / costs[1]


@schemes
def test_optimum_and_costates_are_found_on_an_uneven_grid(scheme: Scheme) -> None:
    solution = solve(linear_quadratic(), stretched(31 if scheme.order > 1 else 301, 1.01), scheme=scheme)
    held = len(scheme.points) == 1
    tolerance = {1: 4e-3, 2: 5e-4}.get(scheme.order, 2e-4 if held else 1e-6)
    assert solution.cost == pytest.approx(np.tanh(1.0) / 2.0, abs=tolerance)
    t = np.linspace(0.0, 1.0, 50)
    error = np.abs(solution.control(t)[:, 0] + np.sinh(1.0 - t) / np.cosh(1.0)).max()
    assert error < (0.05 if held else 0.03 if scheme.order == 2 else 2e-3 if len(scheme.points) == 2 else 1e-4)
    truth = np.sinh(1.0 - solution.costate_times) / np.cosh(1.0)  # λ = -u, with H = L + λ'f
    assert np.abs(solution.costates[:, 0] - truth).max() < (6e-3 if scheme.order == 1 else 5e-4)


@pytest.mark.parametrize(("scheme", "error"), [(RadauIIA(2), 1e-5), (RadauIIA(3), 1e-8), (GaussLegendre(3), 1e-8)])
def test_costates_of_points_inside_the_intervals_have_the_order_of_the_scheme(scheme: Scheme, error: float) -> None:
    solution = solve(linear_quadratic(), 16, scheme=scheme)
    assert solution.costate_times.tolist() == solution.t[:-1].tolist()
    truth = np.sinh(1.0 - solution.costate_times) / np.cosh(1.0)
    assert np.abs(solution.costates[:, 0] - truth).max() < error


@schemes
def test_states_and_controls_between_nodes_pass_through_the_unknowns(scheme: Scheme) -> None:
    solution = solve(linear_quadratic(), 9, scheme=scheme)
    assert np.allclose(solution.state(solution.t), solution.x, atol=1e-10)
    times = solution.t[:-1, None] + np.array(scheme.points) * np.diff(solution.t)[:, None]
    inside = np.array(scheme.points) < 1.0
    assert np.allclose(solution.control(times[:, inside].ravel()), solution.u[:, inside].reshape(-1, 1), atol=1e-10)


@pytest.mark.parametrize(("degree", "scheme"), [(1, Trapezoid()), (2, HermiteSimpson())])
def test_low_degrees_of_lobatto_are_the_classical_schemes(degree: int, scheme: Scheme) -> None:
    one, other = (solve(pendulum(), 9, scheme=s) for s in (LegendreGaussLobatto(degree), scheme))
    assert np.allclose(one.x, other.x, atol=1e-9)


def test_one_interval_of_high_degree_is_spectrally_accurate() -> None:
    solution = solve(linear_quadratic(), 2, scheme=LegendreGaussLobatto(10))
    assert solution.cost == pytest.approx(np.tanh(1.0) / 2.0, abs=1e-11)


@pytest.mark.parametrize("degree", [1, 2, 5, 20, 40])
def test_lagrange_weights_reproduce_polynomials(degree: int) -> None:
    points = legendre_gauss_lobatto(degree)
    at = np.linspace(0.0, 1.0, 23)
    values = np.polynomial.chebyshev.chebval(2.0 * np.array(points) - 1.0, np.eye(degree + 1)[degree])
    exact = np.polynomial.chebyshev.chebval(2.0 * at - 1.0, np.eye(degree + 1)[degree])
    assert np.allclose(weights(points, at) @ values, exact, atol=1e-9)
    integral = np.polynomial.chebyshev.chebint(np.eye(degree + 1)[degree], lbnd=-1.0)
    assert np.allclose(
        integral_weights(points, at) @ values,
        0.5 * np.polynomial.chebyshev.chebval(2.0 * at - 1.0, integral),
        atol=1e-9,
    )


@schemes
def test_two_nodes_are_enough(scheme: Scheme) -> None:
    assert solve(linear_quadratic(), uniform(2), scheme=scheme).solved


@schemes
def test_a_path_constraint_on_the_state_holds_at_the_last_node_too(scheme: Scheme) -> None:
    ocp, x, u = integrator()
    ocp.duration(1.0)
    ocp.minimise(running=(u - 1.0) ** 2)
    ocp.constrain(x, upper=0.5)
    ocp.constrain(x + 0.1 * u, lower=-5.0)  # depends on u, which a zero-order hold does not have there
    found = solve(ocp.functions(), 6, scheme=scheme)
    assert found.x[-1, 0] == pytest.approx(0.5, abs=1e-6)
    assert found.cost == pytest.approx(0.25, rel=1e-3)


@pytest.mark.parametrize("count", [2, 3, 5, 12])
def test_radau_points_integrate_polynomials_up_to_twice_their_number_less_two(count: int) -> None:
    points = radau(count)
    assert 0.0 < points[0] < points[-1] == 1.0
    powers = np.arange(2 * count - 1)
    quadrature = integral_weights(points, np.array([1.0]))[0] @ np.array(points)[:, None] ** powers
    assert np.allclose(quadrature, 1.0 / (powers + 1.0), atol=1e-12)


def test_a_control_may_jump_at_a_node_of_radau_collocation() -> None:
    ocp, x, v, _ = double_integrator(limit=1.0)
    ocp.minimise(terminal=ocp.free_duration(guess=3.0, lower=0.5, upper=20.0))
    ocp.end(ca.vertcat(x, v), [1.0, 0.0])
    solution = solve(ocp.functions(), 3, scheme=RadauIIA(2))
    assert solution.cost == pytest.approx(2.0, abs=1e-8)
    assert np.allclose(solution.u[:, :, 0], [[1.0, 1.0], [-1.0, -1.0]], atol=1e-4)


@pytest.mark.parametrize(
    "wrong",
    [lambda: LegendreGaussLobatto(0), lambda: MultipleShooting(0), lambda: RadauIIA(1), lambda: GaussLegendre(1)],
)
def test_a_scheme_of_nothing_is_refused(wrong: object) -> None:
    with pytest.raises(ValueError, match="allowed"):
        wrong()  # type: ignore[operator]
