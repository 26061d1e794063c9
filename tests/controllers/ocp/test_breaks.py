"""Nodes at the times at which a statement jumps or has a kink: found in tables and comparisons, or given."""

from __future__ import annotations

import re
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.grid import on_breaks, uniform
from mathnavi.controllers.ocp.linear_tables import table_knots
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.structure import linear_controls
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

KNOTS = np.array([0.0, 1.0, 2.5, 3.0, 4.0])
TABLE = ca.interpolant("table", "linear", [KNOTS], np.array([0.0, 1.0, 0.0, 2.0, 3.0]))


def followed(rate: ca.SX, ocp: OptimalControlProblem) -> OptimalControlProblem:
    """x' = u + rate, at the cost of x^2 + u^2 over 4 s."""
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(4.0)
    ocp.minimise(running=x**2 + u**2)
    ocp.dynamics(x, u + rate)
    ocp.start(x, 0.0)
    return ocp


def test_the_knots_of_a_linear_table_are_read() -> None:
    np.testing.assert_array_equal(table_knots(TABLE)[0], KNOTS)
    flat = ca.interpolant("flat", "linear", [KNOTS[:3], np.arange(4.0)], np.arange(12.0))
    for found, known in zip(table_knots(flat), (KNOTS[:3], np.arange(4.0)), strict=True):
        np.testing.assert_array_equal(found, known)


@pytest.mark.parametrize(
    ("times", "breaks"),
    [
        (TABLE, [1.0, 2.5, 3.0]),
        (lambda t: TABLE(2 * t - 1), [0.5, 1.0, 1.75, 2.0, 2.5]),
        (lambda t: ca.if_else(t < 1.5, 1.0, 0.0), [1.5]),
        (lambda t: ca.pw_const(t, [1.0, 2.0], [0.0, 1.0, 0.0]), [1.0, 2.0]),
        (lambda t: ca.pw_lin(t, [1.0, 2.0, 3.0], [0.0, 1.0, 0.0]), [2.0]),
        (lambda t: ca.fabs(t - 3) + ca.fmax(t, 2), [2.0, 3.0]),
        (lambda t: ca.fabs(ca.sin(t)), [np.pi]),
        (lambda t: ca.sin(t) + ca.fabs(t + 1), []),
    ],
)
def test_break_times_are_found_in_what_depends_on_the_time(
    times: Callable[[ca.SX], ca.SX], breaks: list[float]
) -> None:
    ocp = OptimalControlProblem("followed")
    followed(times(ocp.t), ocp)
    np.testing.assert_allclose(4.0 * np.array(ocp.functions().breaks), breaks, atol=1e-9)


def test_break_times_count_from_the_start_of_the_problem() -> None:
    ocp = OptimalControlProblem("followed")
    followed(TABLE(ocp.t) + ca.fabs(ocp.elapsed - 1.25), ocp)
    ocp.start_time(0.5)
    np.testing.assert_allclose(4.0 * np.array(ocp.functions().breaks), [0.5, 1.25, 2.0, 2.5, 3.5])


def test_a_linear_table_is_solved_as_well_as_a_smooth_one() -> None:
    ocp = OptimalControlProblem("followed")
    found = followed(TABLE(ocp.t), ocp).solve(tolerance=1e-8)
    assert found.ok
    assert found.cost == pytest.approx(2.400440554, abs=1e-8)  # of a tolerance of 1e-10
    assert np.abs(found.t[:, None] - KNOTS).min(axis=0).max() == 0.0


def test_break_times_that_are_given_have_nodes() -> None:
    ocp = OptimalControlProblem("followed")
    smooth = ca.interpolant("smooth", "bspline", [KNOTS], np.array([0.0, 1.0, 0.0, 2.0, 3.0]))
    followed(smooth(ocp.t), ocp)
    found = ocp.solve(9, breaks=[0.3, 2.9])
    assert {0.3, 2.9} <= set(np.round(found.t, 12).tolist())
    assert ocp.solve(9).t == pytest.approx(np.linspace(0.0, 4.0, 9))
    for wrong, named in (
        ({"breaks": [5.0]}, "followed: breaks = [5.0]; allowed: times between 0 and 4 s"),
        ({"breaks": "noon"}, "followed: breaks = 'noon'; allowed: times between 0 and 4 s"),
        ({"breaks": [1.0], "method": "distribute"}, "breaks with method = 'distribute', whose nodes are unknowns"),
    ):
        with pytest.raises(ProblemError, match=re.escape(named)):
            ocp.solve(9, **wrong)  # type: ignore[arg-type]


def test_nodes_move_to_breaks_in_order() -> None:
    grid = on_breaks(uniform(6), (0.19, 0.21, 0.97))
    assert len(grid) == 6
    assert np.isin([0.19, 0.21, 0.97], grid.nodes).all()
    assert len(on_breaks(uniform(3), tuple(np.arange(1, 9) / 9.0))) == 10
    assert on_breaks(uniform(5), ()).nodes.tolist() == uniform(5).nodes.tolist()


def test_controls_of_a_table_enter_linearly() -> None:
    ocp = storage(np.array([4.0, 1.0, 3.0, 6.0, 2.0]))
    assert linear_controls(ocp.functions()).all()


def storage(prices: Array) -> OptimalControlProblem:
    """Energy E' = P, |P| <= 1, bought at a price that is straight between its hours; as much at the end."""
    hours = len(prices) - 1.0
    price = ca.interpolant("price", "linear", [np.arange(hours + 1.0)], prices)
    ocp = OptimalControlProblem("storage")
    E, P = ocp.state("E", guess=1.0), ocp.control("P", lower=-1.0, upper=1.0)
    ocp.duration(hours)
    ocp.minimise(running=price(ocp.t) * P)
    ocp.dynamics(E, P)
    ocp.start(E, 1.0)
    ocp.end(E, 1.0)
    return ocp


def test_a_switch_finds_its_place_between_the_knots_of_a_price() -> None:
    found = storage(np.array([4.0, 1.0, 3.0, 6.0, 2.0])).solve()
    # Bought for two hours in all, where the price is below p: on parts of three hours, and in the second.
    p = 34.0 / 11.0
    parts = 1.0 - (4.0 - p) / 3.0, (p - 3.0) / 3.0, (p - 2.0) / 4.0  # [h]
    assert sum(parts) == pytest.approx(1.0)
    bought = parts[0] * (1.0 + p) / 2.0 + 2.0 + parts[1] * (3.0 + p) / 2.0 + parts[2] * (2.0 + p) / 2.0
    assert found.ok
    assert found.cost == pytest.approx(2.0 * bought - 13.0, abs=1e-5)  # all of it at its price is 13


def test_a_day_of_prices_is_solved_to_the_tolerance() -> None:
    """The least J sells above a price and buys below it, half of the time each: a level set of the table."""
    hours = np.arange(25.0)
    prices = 50.0 + 30.0 * np.sin(0.25 * (hours - 9.0)) + 9.0 * np.cos(2.0 * hours)
    found = storage(prices).solve()
    fine = np.interp(np.linspace(0.0, 24.0, 2_400_001), hours, prices)
    least = -np.abs(fine - np.median(fine)).mean() * 24.0
    assert found.ok
    assert found.cost == pytest.approx(least, rel=1e-6)
    assert np.abs(found.t[:, None] - hours).min(axis=0).max() < 1e-9


@pytest.mark.filterwarnings("error")
def test_a_kink_of_the_time_alone_is_no_warning() -> None:
    ocp = OptimalControlProblem("priced")
    u = ocp.control("u")
    ocp.minimise(running=u**2 * ca.fabs(ocp.t - 1.0))
    bent = OptimalControlProblem("bent")
    with pytest.raises(UserWarning, match=r"the running cost has a kink \(fabs\)"):
        bent.minimise(running=ca.fabs(bent.t - bent.control("u")))
