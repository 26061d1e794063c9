"""Pontryagin's conditions, solved next to a direct solution."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.indirect import solve_indirect
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.missile import missile


def test_the_minimum_energy_transfer_is_found_exactly() -> None:
    ocp = OptimalControlProblem("minimum energy")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u", scale=6.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2 / 2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    for state, begin, end in ((x, 0.0, 1.0), (v, 0.0, 0.0)):
        ocp.start(state, begin)
        ocp.end(state, end)
    found = solve_indirect(solve(ocp.functions(), 11))
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
    ocp = OptimalControlProblem("brachistochrone")
    x, y, v = ocp.state("x", guess=(0.0, 2.0)), ocp.state("y", guess=(0.0, 2.0)), ocp.state("v", guess=(0.1, 5.0))
    theta = ocp.control("theta", lower=-1.0, upper=3.0, guess=(0.2, 1.5))
    T = ocp.free_duration(guess=1.0, lower=0.1, upper=10.0)
    ocp.minimise(terminal=T)
    ocp.dynamics(x, v * ca.sin(theta))
    ocp.dynamics(y, v * ca.cos(theta))
    ocp.dynamics(v, 9.8 * ca.cos(theta))
    for state in (x, y, v):
        ocp.start(state, 0.0)
    ocp.end(x, 2.0)
    ocp.end(y, 2.0)
    found = solve_indirect(solve(ocp.functions(), 31))
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
    ocp = OptimalControlProblem("bang-bang")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u", lower=-1.0, upper=1.0)
    T = ocp.free_duration(guess=3.0)
    ocp.minimise(terminal=T)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    for state, begin, end in ((x, 0.0, 3.0), (v, 0.0, 0.0)):
        ocp.start(state, begin)
        ocp.end(state, end)
    with pytest.raises(ValueError, match="linear in the controls"):
        solve_indirect(solve(ocp.functions(), 20))


def _held_by(what: str) -> OptimalControlProblem:
    """A problem in which one thing is active that the conditions do not cover."""
    ocp = OptimalControlProblem(what)
    x, u = ocp.state("x", upper=0.5 if what == "the bound of a state" else math.inf), ocp.control("u")
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
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
    ocp = OptimalControlProblem("to the bound")
    x, u = ocp.state("x", lower=0.0, upper=1.0), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end(x, 1.0)
    assert solve_indirect(solve(ocp.functions(), 11)).converged


@pytest.mark.parametrize(("limit", "end"), [(0.5, 0.5), (2.0, 1.0)])
def test_an_end_that_is_limited_holds_only_where_it_has_to(limit: float, end: float) -> None:
    ocp = OptimalControlProblem("limited end")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=(u - 1.0) ** 2)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end_constraint(x, lower=-math.inf, upper=limit)
    found = solve_indirect(solve(ocp.functions(), 11))
    assert found.converged
    assert found.x[-1, 0] == pytest.approx(end, abs=1e-9)
    assert found.costates[-1, 0] == pytest.approx(2.0 * (1.0 - end), abs=1e-7)
