"""Pontryagin's conditions, solved next to a direct solution."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.ocp.indirect import solve_indirect
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.articles import double_integrator_energy, double_integrator_time
from mathnavi.controllers.ocp.problems.manuals import brachistochrone
from mathnavi.controllers.ocp.problems.missile import missile
from tests.controllers.ocp.statements import integrator


def test_the_minimum_energy_transfer_is_found_exactly() -> None:
    found = solve_indirect(solve(double_integrator_energy(), 11))
    assert found.converged
    assert np.allclose(found.u[:, 0], 6.0 - 12.0 * found.t, atol=1e-6)
    assert np.allclose(found.costates[:, 1], -found.u[:, 0], atol=1e-6)


def test_a_bounded_control_is_held_at_its_bound() -> None:
    ocp = OptimalControlProblem("bounded")
    x, u = ocp.state("x"), ocp.control("u", lower=-0.5, upper=0.5)
    ocp.duration(1.0)
    ocp.minimise(running=(x**2 + u**2) / 2)
    ocp.dynamics(x, u)
    ocp.start(x, 1.0)
    found = solve_indirect(solve(ocp.functions(), 41))
    assert found.converged
    assert found.u.min() == pytest.approx(-0.5, abs=1e-9)
    assert (found.u >= -0.5 - 1e-12).all()
    assert np.abs(found.u[-1]) < 1e-6  # λ(T) = 0


def test_an_implicit_control_is_found_and_the_hamiltonian_of_a_free_time_vanishes() -> None:
    found = solve_indirect(solve(brachistochrone(), 31))
    assert found.converged
    assert found.duration == pytest.approx(0.8247591, abs=2e-7)
    assert np.abs(found.hamiltonian + 1.0).max() < 1e-5  # H = -1 with a terminal cost of T


def test_the_missile_of_both_methods_is_the_same() -> None:
    direct = solve(missile("SM2"), 61)
    found = solve_indirect(direct, tolerance=1e-6)
    assert found.converged
    assert found.duration == pytest.approx(8.271096, abs=2e-6)
    scale = direct.problem.control_scale
    error = (direct.control(found.t) - found.u) / scale
    assert np.sqrt((error**2).sum() / ((found.u / scale) ** 2).sum()) < 2e-3
    assert np.ptp(found.hamiltonian) < 1e-5


def test_controls_that_the_hamiltonian_is_linear_in_are_refused() -> None:
    with pytest.raises(ValueError, match="linear in the controls"):
        solve_indirect(solve(double_integrator_time(), 20))


def _held_by(what: str) -> OptimalControlProblem:
    """A problem in which one thing is active that the conditions do not cover."""
    ocp, x, u = integrator(what, upper=0.5 if what == "the bound of a state" else math.inf)
    if what == "the bound of T":
        ocp.free_duration(guess=0.8, lower=0.1, upper=1.0)
        ocp.minimise(running=u**2 + 0.01)
        ocp.end(x, 1.0)
        return ocp
    ocp.duration(1.0)
    ocp.minimise(running=(u - 1.0) ** 2)
    if what == "a path constraint":
        ocp.constrain(x, upper=0.5)
    return ocp


@pytest.mark.parametrize("what", ["the bound of a state", "the bound of T", "a path constraint"])
def test_what_is_active_and_not_among_the_conditions_is_refused(what: str) -> None:
    direct = solve(_held_by(what).functions(), 11)
    assert direct.solved
    with pytest.raises(ValueError, match=what):
        solve_indirect(direct)


def test_a_state_that_an_end_condition_puts_on_its_bound_is_covered() -> None:
    ocp, x, u = integrator("to the bound", lower=0.0, upper=1.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.end(x, 1.0)
    assert solve_indirect(solve(ocp.functions(), 11)).converged


@pytest.mark.parametrize(("limit", "end"), [(0.5, 0.5), (2.0, 1.0)])
def test_an_end_that_is_limited_holds_only_where_it_has_to(limit: float, end: float) -> None:
    ocp, x, u = integrator()
    ocp.duration(1.0)
    ocp.minimise(running=(u - 1.0) ** 2)
    ocp.end_constraint(x, lower=-math.inf, upper=limit)
    found = solve_indirect(solve(ocp.functions(), 11))
    assert found.converged
    assert found.x[-1, 0] == pytest.approx(end, abs=1e-9)
    assert found.costates[-1, 0] == pytest.approx(2.0 * (1.0 - end), abs=1e-7)
