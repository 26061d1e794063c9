"""Radau collocation with a number of points of its own in each interval is collocation in each of them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.controllers.ocp.distribution import Equidistributed
from mathnavi.controllers.ocp.grid import Grid
from mathnavi.controllers.ocp.methods.adaptation import distribute, solve
from mathnavi.controllers.ocp.pontryagin import check_pontryagin
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import _integrated
from mathnavi.controllers.ocp.residual import local_errors
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.controllers.ocp.transcriptions.variable_radau import VariableRadauIIA
from mathnavi.interfaces.errors import FieldError, ProblemError

COUNTS = (3, 5, 4, 6)


def swing() -> ProblemFunctions:
    """A pendulum that is pushed within a bound, with a limit on a sum of speed and push: all kinds of rows."""
    ocp = OptimalControlProblem("push")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u", lower=-8.0, upper=8.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u - x)
    ocp.constrain(u + v <= 4.8, name="effort")
    ocp.start(x, 0.0)
    ocp.start(v, 0.0)
    ocp.end(x, 1.0)
    ocp.end(v, 0.0)
    return ocp.functions()


@pytest.fixture(scope="module")
def problem() -> ProblemFunctions:
    return swing()


@pytest.fixture(scope="module")
def mixed(problem: ProblemFunctions) -> Solution:
    return solve(problem, 5, scheme=VariableRadauIIA(COUNTS))


def test_with_as_many_points_everywhere_it_is_the_plain_scheme(problem: ProblemFunctions) -> None:
    plain, same = (solve(problem, 5, scheme=scheme) for scheme in (RadauIIA(3), VariableRadauIIA((3,) * 4)))
    assert np.array_equal(plain.u, same.u)
    assert np.array_equal(plain.multipliers.path.values, same.multipliers.path.values)
    assert plain.replay is not None
    assert same.replay is not None
    assert plain.replay.cost == same.replay.cost


def test_points_of_an_interval_are_its_own(mixed: Solution) -> None:
    for i, k in enumerate(COUNTS):
        own = solve(mixed.problem, Grid(np.array([0.0, 1.0])), scheme=RadauIIA(k))
        assert np.allclose((mixed.point_times[i, :k] - mixed.t[i]) / np.diff(mixed.t)[i], own.point_times[0])
        assert np.array_equal(mixed.point_shares[i] > 0.0, np.arange(max(COUNTS)) < k)
        for values in (mixed.u, mixed.inner, mixed.rates, *(v.values for v in _along(mixed))):
            assert np.array_equal(values[i, k:], np.repeat(values[i, k - 1 : k], max(COUNTS) - k, axis=0))
    assert mixed.point_shares.sum() == pytest.approx(mixed.duration)


def _along(solution: Solution) -> tuple[object, ...]:
    m = solution.multipliers
    return m.dynamics, m.path, m.states, m.controls


def test_states_controls_and_multipliers_are_those_of_a_fine_mesh(mixed: Solution) -> None:
    fine = solve(mixed.problem, 21, scheme=RadauIIA(5))
    times = np.linspace(0.0, 0.999, 40)
    assert mixed.cost == pytest.approx(fine.cost, rel=2e-3)
    assert np.abs(mixed.state(times) - fine.state(times)).max() < 1e-2
    assert np.abs(mixed.costate(times) - fine.costate(times)).max() < 2e-2 * np.abs(fine.costates).max()
    impulses = [(s.multipliers.path["effort"] * s.point_shares).sum() for s in (mixed, fine)]
    assert impulses[0] == pytest.approx(impulses[1], rel=0.05)
    assert impulses[1] > 0.01  # it holds back
    judged = check_pontryagin(mixed, tolerance=3e-2)
    assert judged["start"].residual < 1e-3
    assert judged["stationarity"].residual < 1e-3
    assert judged["adjoint"].residual < 3e-2


def test_the_replay_flies_each_interval_with_its_own_polynomial(mixed: Solution) -> None:
    assert mixed.replay is not None
    assert mixed.replay.miss < 1e-4
    y = mixed.x[1] / mixed.problem.state_scale
    path = _integrated(mixed, 1, y)
    assert path is not None
    assert np.abs(path[0][-1] - mixed.x[2] / mixed.problem.state_scale).max() < 1e-6
    errors = local_errors(mixed)
    assert errors.shape == (4,)
    assert errors[3] < errors[0]  # where the points are more


def test_a_solution_on_another_mesh_is_a_guess(mixed: Solution) -> None:
    again = solve(mixed.problem, mixed.grid, scheme=VariableRadauIIA((4, 3, 6, 5)), guess=mixed)
    assert again.solved
    assert again.iterations <= mixed.iterations
    assert again.scaled_derivative(np.linspace(0.0, 1.0, 9), 2).shape == (9, 2)


def test_numbers_of_points_that_do_not_fit_are_refused(problem: ProblemFunctions, mixed: Solution) -> None:
    with pytest.raises(ProblemError, match=r"points for 2 intervals; allowed: 4"):
        solve(problem, 5, scheme=VariableRadauIIA((3, 4)))
    with pytest.raises(FieldError, match=r"count = 1; allowed"):
        VariableRadauIIA((3, 1))
    with pytest.raises(ProblemError, match=r"counts = \(\)"):
        VariableRadauIIA(())
    with pytest.raises(ProblemError, match="with nodes that are unknowns; allowed: RadauIIA"):
        distribute(problem, 5, Equidistributed(), scheme=VariableRadauIIA(COUNTS), guess=mixed)
    assert "orders 5 to 11" in mixed.scheme.name
    assert dataclasses.replace(mixed).scheme.order == 5
