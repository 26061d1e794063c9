"""A problem without a feasible point names the constraints that cannot hold together; INFEASIBLE is a proof."""

from __future__ import annotations

import casadi as ca
import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.methods.by_name import Method
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.controllers.ocp.transcriptions.collocation import LegendreGaussLobatto
from mathnavi.controllers.ocp.transcriptions.low_order import Trapezoid
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from tests.controllers.ocp.statements import double_integrator


def sledge(T: float | None = 1.0) -> tuple[OptimalControlProblem, ca.SX, ca.SX, ca.SX]:
    """x'' = u from rest, |u| <= 1, v free of limits; T [s] fixed, or at most 2 s."""
    ocp, x, v, u = double_integrator("sledge", 1.0)
    if T is None:
        ocp.free_duration(guess=1.0, upper=2.0)
    else:
        ocp.duration(T)
    ocp.minimise(running=u**2)
    return ocp, x, v, u


def message(ocp: OptimalControlProblem, scheme: Scheme | None = None) -> str:
    found = ocp.solve(8) if scheme is None else solve(ocp.functions(), 4, scheme=scheme)
    assert found.status is SolverOutcome.INFEASIBLE, found.status
    return found.message


@pytest.mark.parametrize("scheme", [None, Trapezoid(), LegendreGaussLobatto(4)])
def test_an_end_that_is_out_of_reach(scheme: Scheme | None) -> None:
    ocp, x, _, _ = sledge()
    ocp.end(x, 5.0)
    violated, others = message(ocp, scheme).split(": cannot hold with ")
    assert violated == "end of x (violated by 4.5)"  # a time of 1 s at |u| = 1 leads 0.5 far
    assert set(others.split("; ")) == {"start of x", "start of v", "u <= 1"}


@pytest.mark.parametrize("method", ["auto", "hp", "refine", "redistribute", "distribute"])
def test_every_method_names_what_cannot_hold(method: Method) -> None:
    ocp, x, _, _ = sledge()
    ocp.end(x, 5.0)
    found = ocp.solve(method=method)
    assert found.status is SolverOutcome.INFEASIBLE
    assert "end of x (violated by 4.5): cannot hold with " in found.message


def test_a_final_time_that_is_too_short() -> None:
    ocp, x, _, _ = sledge(None)
    ocp.end(x, 5.0)
    violated, others = message(ocp).split(": cannot hold with ")
    assert violated == "end of x (violated by 3)"
    reached = "from the start x is between -2.03 and 2.03 within 2 s"  # at least
    assert set(others.split("; ")) == {"start of x", "start of v", "u <= 1", "T <= 2", reached}


def test_a_path_constraint_and_an_end() -> None:
    ocp, x, v, _ = sledge()
    ocp.constrain(v <= 0.1)
    ocp.end(x, 0.2)
    found = message(ocp)
    assert "end of x" in found
    assert "v <= 0.1" in found


def test_two_path_constraints_that_contradict_each_other() -> None:
    ocp, x, _, u = sledge()
    ocp.constrain(x + u, lower=0.5)
    ocp.constrain(x + u**3, upper=0.0)
    found = solve(ocp.functions(), 8)
    assert found.status is SolverOutcome.NO_FEASIBLE_POINT  # it is so, but neither proof shows it
    assert "path: 0.5 <= (x+u)" in found.message
    assert "<= 0" in found.message


def test_a_limit_of_a_state_and_the_dynamics() -> None:
    ocp = OptimalControlProblem("flood")
    x = ocp.state("x", upper=1.0)
    ocp.duration(3.0)
    ocp.minimise(running=x**2)
    ocp.dynamics(x, 1.0)
    ocp.start(x, 0.0)
    found = message(ocp)
    assert "start of x (violated by 2)" in found
    assert "x <= 1" in found
