"""Constraints written as comparisons hold in the solution; what cannot be one is refused in one line."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import casadi as ca
import pytest

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.interfaces.errors import ProblemError
from tests.controllers.ocp.statements import double_integrator

Constrain = Callable[[OptimalControlProblem, ca.SX, ca.SX, ca.SX], Any]


def rest_to_rest() -> tuple[OptimalControlProblem, ca.SX, ca.SX, ca.SX]:
    """x'' = u from rest at 0 to rest at 1 in a second, least ∫ u^2 / 2: u from 6 to -6 and v up to 1.5."""
    ocp, x, v, u = double_integrator("rest to rest")
    ocp.parameter("p", 1.25)
    ocp.duration(1.0)
    ocp.minimise(running=u**2 / 2)
    ocp.end(ca.vertcat(x, v), [1.0, 0.0])
    return ocp, x, v, u


def p_of(ocp: OptimalControlProblem) -> ca.SX:
    return ocp.statement.p


@pytest.mark.parametrize(
    ("constrain", "variable", "least", "most"),
    [
        (lambda ocp, x, v, u: ocp.constrain(v <= 1.2), "v", 0.0, 1.2),
        (lambda ocp, x, v, u: ocp.constrain(v < 1.2), "v", 0.0, 1.2),
        (lambda ocp, x, v, u: ocp.constrain(2 * v <= 2.4), "v", 0.0, 1.2),
        (lambda ocp, x, v, u: ocp.constrain(-v >= -1.2), "v", 0.0, 1.2),
        (lambda ocp, x, v, u: ocp.constrain(v <= p_of(ocp)), "v", 0.0, 1.25),
        (lambda ocp, x, v, u: ocp.constrain(v, upper=p_of(ocp)), "v", 0.0, 1.25),
        (lambda ocp, x, v, u: ocp.constrain(u <= 5.0), "u", None, 5.0),
        (lambda ocp, x, v, u: ocp.constrain(u >= -5.0), "u", -5.0, None),
        (lambda ocp, x, v, u: ocp.constrain(ocp.bounded(-5, u, 5)), "u", -5.0, 5.0),
        (lambda ocp, x, v, u: ocp.constrain((u >= -5) <= 5), "u", -5.0, 5.0),
        (lambda ocp, x, v, u: ocp.constrain(ocp.bounded(-10, 2 * u, 4 * p_of(ocp) + 5)), "u", -5.0, 5.0),
        (lambda ocp, x, v, u: ocp.constrain([v <= 1.2, u <= 8]), "v", 0.0, 1.2),
        (lambda ocp, x, v, u: ocp.constrain(ca.vertcat(v, u) <= [1.2, 8]), "v", 0.0, 1.2),
    ],
)
def test_a_comparison_along_the_path_holds(
    constrain: Constrain, variable: str, least: float | None, most: float | None
) -> None:
    ocp, x, v, u = rest_to_rest()
    constrain(ocp, x, v, u)
    solution = ocp.solve(21)
    assert solution.ok
    for reached, limit in ((solution[variable].min(), least), (solution[variable].max(), most)):
        assert limit is None or reached == pytest.approx(limit, abs=1e-6)


@pytest.mark.parametrize(
    ("constrain", "end"),
    [
        (lambda ocp, x, T: ocp.end_constraint(x >= 5), 5.0),
        (lambda ocp, x, T: ocp.end_constraint(x >= 2 * T), 2.0),
        (lambda ocp, x, T: ocp.end_constraint(x == 3), 3.0),
        (lambda ocp, x, T: ocp.end_constraint(ocp.bounded(2, x, 5)), 2.0),
        (lambda ocp, x, T: ocp.end_constraint(x - 4), 4.0),
        (lambda ocp, x, T: ocp.end_constraint(x, lower=2, upper=4), 2.0),
        (lambda ocp, x, T: ocp.end_constraint(x, upper=3), 0.5),
        (lambda ocp, x, T: ocp.end_constraint(x, upper=-3), -3.0),
        (lambda ocp, x, T: ocp.end_constraint(x, lower=-3), 0.5),
        (lambda ocp, x, T: ocp.start_constraint(x, upper=3), 0.5),
        (lambda ocp, x, T: ocp.end_constraint(x <= 5), 0.5),
    ],
)
def test_a_comparison_at_the_end_holds(constrain: Callable[..., Any], end: float) -> None:
    ocp = OptimalControlProblem("there")
    x, u = ocp.state("x"), ocp.control("u")
    T = ocp.free_duration(guess=1.0, lower=1.0, upper=1.001)
    ocp.minimise(running=u**2, terminal=T)
    ocp.dynamics(x, u)
    ocp.start_constraint(x >= 0.5)
    ocp.start_constraint(x <= 0.5)
    constrain(ocp, x, T)
    assert ocp.solve(5)["x"][[0, -1]] == pytest.approx([0.5, end], abs=1e-6)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda ocp, x, v, u: ocp.constrain(u), "path constraint u has no limit; allowed: <=, >=, =="),
        (lambda ocp, x, v, u: ocp.constrain(u, upper=math.inf), "u: lower = -inf, upper = inf is no limit"),
        (lambda ocp, x, v, u: ocp.constrain(u <= math.inf), "is no limit"),
        (lambda ocp, x, v, u: ocp.constrain(u <= 1, upper=2), "(u<=1) is a comparison and has a limit as well"),
        (lambda ocp, x, v, u: ocp.end_constraint(x >= 5, lower=0), "(5<=x) is a comparison and has a limit as well"),
        (lambda ocp, x, v, u: ocp.constrain(ca.logic_and(u <= 1, u >= 0)), "is a logical and, which cannot be"),
        (lambda ocp, x, v, u: ocp.constrain(ca.logic_or(u <= 1, u >= 0)), "is a logical or, which cannot be"),
        (lambda ocp, x, v, u: ocp.constrain(ca.logic_not(u <= 1)), "is a logical not, which cannot be"),
        (lambda ocp, x, v, u: ocp.constrain(u != 1), "is !=, which cannot be"),
        (lambda ocp, x, v, u: ocp.constrain((u <= 1) + 2 <= 3), "is constant but for jumps"),
        (lambda ocp, x, v, u: ocp.constrain((u <= 1) * 2, upper=3), "is constant but for jumps"),
        (lambda ocp, x, v, u: ocp.constrain((u <= 1) == (x <= 1)), "compares a comparison"),
        (lambda ocp, x, v, u: ocp.constrain((u <= 1) <= 1), "compares a comparison"),
        (lambda ocp, x, v, u: ocp.constrain(True), "is True, the truth value of numbers"),
        (lambda ocp, x, v, u: ocp.constrain(x - x <= 1), "1 always holds for all values of the variables"),
        (lambda ocp, x, v, u: ocp.constrain(u**2 >= 0), "1 always holds"),
        (lambda ocp, x, v, u: ocp.constrain(x - x >= 1), "0 never holds"),
        (lambda ocp, x, v, u: ocp.constrain(x - x, upper=1), "depends on no symbol"),
        (lambda ocp, x, v, u: ocp.constrain(ocp.bounded(2, u, 1)), "lower = 2.0, upper = 1.0; allowed: lower <= upper"),
        (lambda ocp, x, v, u: ocp.constrain(u <= math.nan), "NaN"),
        (lambda ocp, x, v, u: ocp.constrain("u <= 1"), "path constraint = 'u <= 1'; allowed: an SX expression"),
        (lambda ocp, x, v, u: ocp.constrain(u, upper=[1, 2, 3]), "3 limits of 1 expressions; allowed: one, or 1"),
        (lambda ocp, x, v, u: ocp.start_constraint(u <= 1), "start constraint (u<=1) depends on u"),
        (lambda ocp, x, v, u: ocp.end_constraint(x <= ocp.t), "depends on t, which is not among its symbols"),
        (lambda ocp, x, v, u: ocp.constrain(0 <= u <= 1), "(0<=u) has no truth value; allowed in place of a <= x <= b"),
        (lambda ocp, x, v, u: ocp.constrain(u <= 1 and u >= 0), "(u<=1) has no truth value"),
        (lambda ocp, x, v, u: ocp.minimise(running=max(u, 0)), "casadi.fmax"),
        (lambda ocp, x, v, u: bool(ca.MX.sym("m") <= 1), "(m<=1) has no truth value"),
    ],
)
def test_what_cannot_be_a_constraint_is_refused(wrong: Constrain, named: str) -> None:
    ocp, x, v, u = rest_to_rest()
    with pytest.raises(ProblemError, match=re.escape(named)) as refused:
        wrong(ocp, x, v, u)
    assert "\n" not in str(refused.value)


def test_numbers_keep_their_truth_value() -> None:
    assert bool(ca.SX(1) <= 2)
    assert not ca.SX(3) <= 2
