"""The residual is nothing where a polynomial solves the equation, and leads to layers that a coarse grid cannot see."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.controllers.ocp.methods.adaptation import redistribute, solve
from mathnavi.controllers.ocp.problems.articles import double_integrator_energy
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.residual import RESIDUAL, cost_errors, local_errors
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.controllers.ocp.transcriptions.collocation import LegendreGaussLobatto
from mathnavi.controllers.ocp.transcriptions.low_order import Euler
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme


def test_a_polynomial_solution_leaves_no_residual() -> None:
    solution = solve(double_integrator_energy(), 5)
    assert local_errors(solution).max() < 1e-12
    # u is a straight line, so L is a parabola: what Hermite-Simpson integrates is L itself.
    assert cost_errors(solution).max() < 1e-12


def test_where_a_failed_solve_is_not_finite_its_error_is_the_largest() -> None:
    solution = solve(double_integrator_energy(), 5)
    broken = solution.u.copy()
    broken[-1] = np.nan
    density = RESIDUAL.density(dataclasses.replace(solution, u=broken), np.linspace(0.1, 0.9, 5), 1e-12)
    assert np.isfinite(density).all()
    assert density.argmax() == 4


@pytest.mark.parametrize(("scheme", "power"), [(LegendreGaussLobatto(2), 4), (LegendreGaussLobatto(3), 5)])
def test_errors_fall_with_one_power_more_than_there_are_points(scheme: Scheme, power: int) -> None:
    problem = PROBLEMS["Rayleigh"].problem()
    halves = [
        (local_errors(solution).sum() / count, cost_errors(solution).sum() / count)
        for count in (100, 200)
        for solution in (solve(problem, count + 1, scheme=scheme),)
    ]
    for coarse, fine in zip(*halves, strict=True):
        assert np.log2(coarse / fine) == pytest.approx(power, abs=0.8)


def test_it_finds_layers_a_thousandth_of_the_time_wide() -> None:
    known = PROBLEMS["hypersensitive"]
    solution = redistribute(known.problem(), 60, RESIDUAL, rounds=10)
    assert solution.status is SolverOutcome.OPTIMAL
    assert known.error(solution.cost) <= known.tolerance
    assert known.error(solve(known.problem(), 60).cost) > 1.0


def test_a_scheme_without_a_polynomial_is_refused() -> None:
    with pytest.raises(ValueError, match="forward Euler"):
        local_errors(solve(double_integrator_energy(), 5, scheme=Euler()))
