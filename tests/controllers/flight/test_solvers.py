"""The compiled kernels against CasADi's statement of the same problem, and the solvers against each other."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.flight import reference
from mathnavi.controllers.flight.cost_to_go import factored_cost
from mathnavi.controllers.flight.kernels import problem_data
from mathnavi.controllers.flight.kernels.linearisation import linearise
from mathnavi.controllers.flight.kernels.problem_data import QuadraticProgramme, objective
from mathnavi.controllers.flight.problem import (
    LengthToGo,
    Parameters,
    PlanningEnvironment,
    PlanSolution,
    Problem,
    proportional,
)
from mathnavi.controllers.flight.reference import InteriorPoint
from mathnavi.controllers.flight.sqp import CondensedSqp
from mathnavi.interfaces.signals import Array
from mathnavi.models.nlp_solver import NlpPlugin
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar

SPACING, NODES = 320.0, 97
TARGET = (26_000.0, 24_000.0)  # [m]
SPEED = 300.0
H = 5.0 / 3.0


def mountains() -> HeightField:
    """Ridges and peaks, 31 km square, 0 to about 2.5 km high."""
    x, y = np.meshgrid(np.arange(NODES) * SPACING, np.arange(NODES) * SPACING)
    z = 600.0 + 300.0 * np.sin(x / 2100.0) * np.cos(y / 1700.0)
    rng = np.random.default_rng(7)
    for _ in range(12):
        east, north = rng.uniform(0.0, NODES * SPACING, 2)
        height, width = rng.uniform(300.0, 1500.0), rng.uniform(900.0, 2500.0)
        z += height * np.exp(-((x - east) ** 2 + (y - north) ** 2) / (2.0 * width**2))
    return HeightField(z, SPACING)


@pytest.fixture(scope="module")
def environment() -> PlanningEnvironment:
    terrain = mountains()
    target = np.array([*TARGET, float(terrain.height(*TARGET)) + 200.0])
    radar = Radar(15_000.0, 14_000.0, 5_000.0, 3.0)
    return PlanningEnvironment.build(terrain, factored_cost(terrain, target, [radar], 33, 5))


def uniform(arcs: int) -> tuple[float, ...]:
    return arcs * (H,)


def stretched(arcs: int, horizon: float, ratio: float) -> tuple[float, ...]:
    return proportional([ratio**i for i in range(arcs)], horizon)


def problem_at(
    environment: PlanningEnvironment,
    x: float,
    y: float,
    above: float,
    velocity: Array,
    lengths: tuple[float, ...] = uniform(8),
    beta: float = 100.0,
) -> Problem:
    parameters = Parameters(lengths, SPEED, 40.0, beta, clearance=75.0)
    start = np.array([x, y, float(environment.terrain.height(x, y)) + above, *velocity])
    return Problem(parameters, environment, start)


def arriving(environment: PlanningEnvironment, lengths: tuple[float, ...], distance: float) -> Problem:
    """An exact arrival from ``distance`` [m] south-west of the target, flying towards it."""
    target = environment.cost.target
    x, y = target[:2] - distance / np.sqrt(2.0)
    velocity = np.array([140.0, 140.0, 0.0])
    parameters = Parameters(lengths, SPEED, 40.0, 100.0, clearance=75.0)
    start = np.array([x, y, max(target[2], float(environment.terrain.height(x, y)) + 150.0), *velocity])
    return Problem(parameters, environment, start, terminal_position=target)


def timed(problem: Problem, share: float, **penalty: Any) -> Problem:
    """With a length to go at p_N that is this share of that at the start; ``penalty`` makes it one."""
    return replace(
        problem, length_to_go=LengthToGo(share * float(problem.environment.cost(problem.start[:3])[0]), **penalty)
    )


def some_problems(environment: PlanningEnvironment) -> list[Problem]:
    rest, towards = np.zeros(3), np.array([180.0, 160.0, 0.0])
    return [
        problem_at(environment, 3_000.0, 2_500.0, 300.0, rest),
        problem_at(environment, 9_000.0, 8_000.0, 90.0, towards),  # low: the ground pushes
        problem_at(environment, 6_000.0, 9_000.0, 80.0, towards, uniform(12)),
        problem_at(environment, 12_000.0, 12_000.0, 120.0, towards, uniform(4), beta=1.0),
        problem_at(environment, 9_000.0, 14_000.0, 400.0, towards, beta=1e4),
        arriving(environment, uniform(6), 2_200.0),
        arriving(environment, uniform(3), 1_000.0),
        problem_at(environment, 9_000.0, 8_000.0, 90.0, towards, stretched(8, 25.0, 1.3)),
        problem_at(environment, 12_000.0, 12_000.0, 120.0, towards, stretched(12, 40.0, 1.2)),
        problem_at(environment, 6_000.0, 9_000.0, 80.0, towards, stretched(6, 15.0, 0.8)),
        arriving(environment, stretched(6, 10.0, 1.25), 2_200.0),
        timed(problem_at(environment, 6_000.0, 9_000.0, 80.0, towards, uniform(8)), 0.85),
        timed(problem_at(environment, 9_000.0, 8_000.0, 300.0, towards, uniform(8)), 0.95),
        timed(problem_at(environment, 6_000.0, 9_000.0, 80.0, towards, uniform(8)), 0.85, weight=0.02, instead=False),
    ]


def kernel_cost(problem: Problem, unknowns: Array) -> float:
    return float(objective(unknowns, problem.data))


def casadi_cost(problem: Problem) -> tuple[ca.Function, Array]:
    """CasADi's objective of the condensed unknowns (3n + 1,), slacks at their least, and its parameters."""
    shape, values = reference._values(problem)
    programme = reference._programme(shape)
    statement, unknowns = programme.functions, ca.MX.sym("U", 3 * problem.arcs + 1)
    p, v, lifted = ca.MX(problem.start[:3]), ca.MX(problem.start[3:]), []
    for i, (h, count) in enumerate(zip(problem.parameters.lengths, problem.parameters.points, strict=True)):
        a = unknowns[3 * i : 3 * i + 3]
        lifted += [p, v, a, ca.MX.zeros(count)]
        p, v = p + h * v + h**2 / 2 * a, v + h * a
    lifted += [p, v, unknowns[-1], ca.MX.zeros(shape.last_input - 1)]
    relax = ca.Function("relax", [statement["x"], statement["p"]], [programme.relaxed])
    cost = ca.Function("cost", [statement["x"], statement["p"]], [statement["f"]])
    known = statement["p"]
    value = cost(relax(ca.vertcat(*lifted), known), known)
    return ca.Function("condensed", [unknowns, known], [value, ca.gradient(value, unknowns)]), np.concatenate(
        [value.ravel() for value in values]
    )


def random_unknowns(problem: Problem, rng: np.random.Generator) -> Array:
    return np.append(rng.normal(0.0, 8.0, 3 * problem.arcs), rng.uniform(0.0, 60.0))


def solved(outcome: PlanSolution | str) -> PlanSolution:
    assert isinstance(outcome, PlanSolution), outcome
    return outcome


def test_kernels_and_casadi_state_the_same_objective_and_gradient(environment: PlanningEnvironment) -> None:
    """The gradient of the kernels is the programme's, plus what its soft rows contribute at a zero step.

    Their Hessian leaves the terrain's curvature out, so only what a descent direction needs is asserted.
    """
    rng = np.random.default_rng(1)
    for problem in some_problems(environment):
        n, points = problem.arcs, len(problem.matrices.base) - 2
        size, still = 3 * n + 1, np.zeros(2 * n + 1)
        count = points + 1 + 2 * n + 1 + 4 + (3 if problem.terminal_position is not None else 0)
        terminal_position = np.empty(0) if problem.terminal_position is None else problem.terminal_position
        statement, known = casadi_cost(problem)
        for _ in range(5):
            unknowns = random_unknowns(problem, rng)
            hessian, gradient, rows = np.zeros((size, size)), np.zeros(size), np.zeros((count, size))
            upper, lower = np.zeros(size + count), np.zeros(size + count)
            programme = QuadraticProgramme(hessian, gradient, rows, upper, lower)
            linearise(unknowns, problem.data, terminal_position, still, programme)
            soft = slice(size, size + points + 1)
            gradient -= rows[: points + 1].T @ np.maximum(lower[soft], 0.0)
            gradient += rows[: points + 1].T @ np.maximum(-upper[soft], 0.0)
            assert np.linalg.eigvalsh(hessian).min() > 0.0
            np.testing.assert_allclose(hessian, hessian.T, rtol=1e-9, atol=1e-9 * np.abs(hessian).max())
            value, slope = statement(unknowns, known)
            assert kernel_cost(problem, unknowns) == pytest.approx(float(value), rel=1e-10)
            expected = np.array(slope).ravel()
            np.testing.assert_allclose(gradient, expected, rtol=1e-8, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("lengths", [uniform(6), stretched(6, 14.0, 1.3)], ids=["uniform", "stretched"])
def test_the_balls_have_the_slope_and_the_curvature_of_norms(
    environment: PlanningEnvironment, lengths: tuple[float, ...]
) -> None:
    """With an exact arrival the Hessian is that of effort, climb rate and the balls, weighted by their multipliers."""
    rng, problem = np.random.default_rng(2), arriving(environment, lengths, 2_200.0)
    n, points = problem.arcs, len(problem.matrices.base) - 2
    size, count = 3 * n + 1, points + 1 + 2 * n + 1 + 4 + 3
    unknowns, multipliers = random_unknowns(problem, rng), rng.uniform(1.0, 50.0, 2 * n + 1)
    hessian, gradient, rows = np.zeros((size, size)), np.zeros(size), np.zeros((count, size))
    upper, lower = np.zeros(size + count), np.zeros(size + count)
    assert problem.terminal_position is not None
    programme = QuadraticProgramme(hessian, gradient, rows, upper, lower)
    linearise(unknowns, problem.data, problem.terminal_position, multipliers, programme)
    U = ca.SX.sym("U", size)
    a, v, norms = [U[3 * i : 3 * i + 3] for i in range(n)], ca.SX(problem.start[3:]), []
    for h, push in zip(lengths, a, strict=True):
        v += h * push
        norms.append(ca.norm_2(v))
    norms += [*(ca.norm_2(push) for push in a), ca.norm_2(v - ca.vertcat(0, 0, U[-1]))]
    effort = sum(h * ca.sumsqr(push) for h, push in zip(lengths, a, strict=True))
    climbing = problem.packed[problem_data.CLIMB_WEIGHT] / 2 * U[-1] ** 2
    lagrangian = effort + climbing + ca.dot(multipliers, ca.vertcat(*norms))
    expected = ca.Function("f", [U], [ca.hessian(lagrangian, U)[0], ca.jacobian(ca.vertcat(*norms), U)])(unknowns)
    np.testing.assert_allclose(hessian, np.array(expected[0]), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(rows[points + 1 : points + 2 + 2 * n], np.array(expected[1]), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("backend", ["ipopt", "fatrop"])
def test_the_condensed_solver_finds_the_cost_that_the_interior_point_methods_find_within_the_bounds(
    environment: PlanningEnvironment, backend: NlpPlugin
) -> None:
    condensed, interior = CondensedSqp(1e-6, 50), InteriorPoint(backend, 1e-6)
    for problem in some_problems(environment):
        guess = np.zeros(3 * problem.arcs + 1)
        ours, theirs = solved(condensed.solve(problem, guess)), solved(interior.solve(problem, guess))
        for solution in (ours, theirs):
            changes = problem.matrices.lengths[:, None] * solution.accelerations
            velocities = problem.start[3:] + np.cumsum(changes, axis=0)
            assert np.linalg.norm(velocities, axis=1).max() <= SPEED * (1.0 + 1e-4)
            assert np.linalg.norm(solution.accelerations, axis=1).max() <= 40.0 * (1.0 + 1e-4)
        assert ours.converged
        assert theirs.cost == pytest.approx(kernel_cost(problem, theirs.unknowns), rel=1e-6)
        assert ours.cost == pytest.approx(theirs.cost, rel=1e-5, abs=1e-5), problem.start


@pytest.mark.parametrize("share", [0.8, 0.9, 0.97])
def test_a_target_length_to_go_is_reached_where_it_can_be(environment: PlanningEnvironment, share: float) -> None:
    """Within a few metres: sooner by flying faster, later by flying slower or about."""
    problem = timed(problem_at(environment, 6_000.0, 9_000.0, 300.0, np.array([180.0, 160.0, 0.0]), uniform(12)), share)
    solution = solved(CondensedSqp().solve(problem, np.zeros(37)))
    s = problem.matrices
    end = problem.start[:3] + s.base[-2] * problem.start[3:] + s.weights[-2] @ solution.accelerations
    assert problem.length_to_go is not None
    assert float(environment.cost(end)[0]) == pytest.approx(problem.length_to_go.length, abs=5.0)


def test_a_warm_start_from_the_solution_finds_it_again(environment: PlanningEnvironment) -> None:
    problem = some_problems(environment)[1]
    solver = InteriorPoint()
    first = solved(solver.solve(problem, np.zeros(3 * problem.arcs + 1)))
    again = solved(solver.solve(problem, first.unknowns))
    assert again.cost == pytest.approx(first.cost, rel=1e-7)
    assert again.iterations <= first.iterations


def test_a_target_out_of_reach_gives_a_reason_not_an_exception(environment: PlanningEnvironment) -> None:
    problem = arriving(environment, uniform(3), 6_000.0)  # three arcs of 5/3 s at 300 m/s go 1500 m
    for solver in (CondensedSqp(), InteriorPoint("ipopt"), InteriorPoint("fatrop")):
        outcome = solver.solve(problem, np.zeros(3 * problem.arcs + 1))
        assert isinstance(outcome, str)
        assert outcome


def test_unknown_backends_and_tolerances_are_refused() -> None:
    with pytest.raises(ValueError, match="backend = 'snopt'"):
        InteriorPoint(cast(Any, "snopt"))
    with pytest.raises(ValueError, match="tolerance"):
        InteriorPoint(tolerance=0.0)
