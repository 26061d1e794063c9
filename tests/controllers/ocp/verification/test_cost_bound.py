"""J on two finer meshes bounds the error of J, in any unit."""

from __future__ import annotations

import math

import casadi as ca
import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solver import Options
from mathnavi.controllers.ocp.verification.cost_bound import cost_bound, cost_size
from tests.controllers.ocp.statements import integrator, transfer

OPTIONS = Options(tolerance=1e-11)


@pytest.mark.parametrize(
    ("name", "nodes"),
    [("lunar landing", 40), ("van der Pol, time", 30), ("robot arm", 20), ("hypersensitive, short", 15)],
)
def test_it_holds_where_a_mesh_is_too_coarse(name: str, nodes: int) -> None:
    known = PROBLEMS[name]
    coarse = solve(known.problem(), nodes)
    found = cost_bound(coarse, OPTIONS)
    error = abs(coarse.cost - known.sign * known.optimum)
    assert error <= found.bound <= 40.0 * error


def test_the_size_of_a_cost_of_nothing_is_what_it_gathers() -> None:
    ocp, _, u = integrator()
    ocp.duration(1.0)
    ocp.minimise(running=u**2 + ca.sin(2.0 * math.pi * ocp.t))
    found = solve(ocp.functions(), 21)
    assert abs(found.cost) < 1e-9
    assert cost_size(found) == pytest.approx(2.0 / math.pi, rel=1e-3)


def test_a_mesh_that_is_not_solved_bounds_nothing() -> None:
    found = cost_bound(solve(transfer(0.5, 1.0).functions(), 5), Options(iterations=1))
    assert found.bound == math.inf
