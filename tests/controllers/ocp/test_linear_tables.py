"""Kinks at the knots of linear tables: found, named, and crossed with a node, in time, in states and in both."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq, fsolve, minimize

from mathnavi.controllers.ocp.crossings import crossings
from mathnavi.controllers.ocp.linear_tables import MOST_KNOTS, inner_knots
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.switching_surfaces import SwitchingSurface, branched, surfaces_of
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array
from tests.controllers.ocp.statements import two_costs

KNOTS, ROWS = np.array([0.0, 1.0, 2.5, 4.0]), np.array([0.0, 1.0, 3.0])
LINE = ca.interpolant("line", "linear", [KNOTS], np.array([0.0, 1.0, 3.0, 3.5]))
FLAT = ca.interpolant("flat", "linear", [KNOTS, ROWS], np.arange(12.0) ** 2)
PAIR = ca.interpolant("pair", "linear", [ROWS], np.arange(6.0) ** 2)
VALUES = ca.interpolant("values", "linear", [ROWS], 1)
SMOOTH = ca.interpolant("smooth", "bspline", [KNOTS], np.array([0.0, 1.0, 3.0, 3.5]))
WRITTEN = ca.MX.sym("m", 2)
OF_MX = ca.Function("of_mx", [WRITTEN], [LINE(WRITTEN[0]) + ca.if_else(WRITTEN[1] < 1.0, 1.0, 2.0)])

Expression = Callable[[ca.SX], ca.SX]


def searched(made: Expression) -> tuple[ca.Function, ca.SX, list[SwitchingSurface]]:
    """A function of two states, its symbols, and its surfaces."""
    x, found = ca.SX.sym("x", 2), list[SwitchingSurface]()
    function = ca.Function("made", [x], [ca.densify(ca.vec(made(x)))])
    branched(function, [x, ca.SX.sym("u", 0)], found, ())
    return function, x, found


@pytest.mark.parametrize(
    ("made", "surfaces"),
    [
        (lambda x: LINE(2.0 * x[0]), {"line at (2.*x_0)": (1.0, 2.5)}),
        (lambda x: FLAT(x), {"flat at x_0": (1.0, 2.5), "flat at x_1": (1.0,)}),
        (lambda x: FLAT(ca.vertcat(x[0], 2.0)), {"flat at x_0": (1.0, 2.5)}),
        (lambda x: PAIR(x[1]), {"pair at x_1": (1.0,)}),
        (lambda x: VALUES(x[0], ca.vertcat(1.0, x[1], -3.0)), {"values at x_0": (1.0,)}),
        (lambda x: ca.jacobian(LINE(x[0]), x), {"jac_line at x_0": (1.0, 2.5)}),
        (lambda x: ca.jacobian(FLAT(x), x), {"jac_flat at x_0": (1.0, 2.5), "jac_flat at x_1": (1.0,)}),
        (lambda x: SMOOTH(x[0]) * ca.fabs(x[1]), {"fabs(x_1)": ()}),
        (lambda x: OF_MX(x), {"line at x_0": (1.0, 2.5), "(x_1<1)": ()}),
    ],
)
def test_in_a_cell_a_table_is_its_piece(made: Expression, surfaces: dict[str, tuple[float, ...]]) -> None:
    function, x, found = searched(made)
    assert {each.text: each.knots for each in found} == surfaces
    levels = ca.Function("levels", [x], [ca.vertcat(*(each.level for each in found))])
    for point in np.random.default_rng(0).uniform(-1.0, 5.0, (40, 2)):
        inside = levels(point).full()[:, 0]
        # With all cells given; with the first one, and the last one, left open.
        for k in (None, 0, len(inside) - 1):
            branches = [np.nan if i == k else value for i, value in enumerate(inside.tolist())]
            piece = ca.Function("piece", [x], [branched(function, [x, ca.SX.sym("u", 0)], found, branches)])
            np.testing.assert_allclose(piece(point).full(), function(point).full(), atol=1e-12)


def test_a_piece_goes_on_beyond_its_cell() -> None:
    function, x, found = searched(lambda x: LINE(x[0]))
    piece = ca.Function("piece", [x], [branched(function, [x, ca.SX.sym("u", 0)], found, [0.5])])
    assert float(piece([4.0, 0.0])) == pytest.approx(4.0)
    assert float(function([4.0, 0.0])) == pytest.approx(3.5)
    assert not any(piece.instruction_id(k) == ca.OP_CALL for k in range(piece.n_instructions()))


def test_a_table_with_very_many_knots_is_as_good_as_smooth() -> None:
    def table(count: int) -> ca.Function:
        return ca.interpolant("table", "linear", [np.arange(float(count))], np.arange(float(count)) ** 2)

    few, many = inner_knots(table(MOST_KNOTS)), inner_knots(table(MOST_KNOTS + 1))
    assert few is not None
    assert many is not None
    assert (len(few[0]), len(many[0])) == (MOST_KNOTS - 2, 0)
    assert inner_knots(SMOOTH) is None


def test_a_problem_without_branches_and_tables_is_not_searched() -> None:
    ocp = OptimalControlProblem("smooth")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u - SMOOTH(x))
    assert surfaces_of(ocp.functions()) is None


# a drag table in a run of least time

SPEEDS, DRAGS = np.array([0.0, 1.0, 2.0, 4.0]), np.array([0.0, 0.1, 0.5, 0.9])


def run() -> OptimalControlProblem:
    """10 m from rest to rest in the least time, against the drag of a table."""
    drag = ca.interpolant("drag", "linear", [SPEEDS], DRAGS)
    ocp = OptimalControlProblem("run")
    x, v = ocp.state("x", guess=(0.0, 10.0)), ocp.state("v", lower=0.0, guess=1.0)
    u = ocp.control("u", lower=-1.0, upper=1.0)
    ocp.minimise(terminal=ocp.free_duration(guess=8.0, lower=1.0, upper=50.0))
    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u - drag(v)))
    ocp.start(ca.vertcat(x, v), 0.0)
    ocp.end(ca.vertcat(x, v), [10.0, 0.0])
    return ocp


def test_a_run_against_a_drag_table_crosses_its_knots_at_nodes() -> None:
    def over(v: float, u: float, power: int) -> float:
        """∫ v^k dv / (u - drag) up to a speed: duration (k = 0) and distance (k = 1) of a part at full control."""
        points = SPEEDS[1:-1][SPEEDS[1:-1] < v].tolist()
        value, _ = quad(lambda w: w**power / abs(u - np.interp(w, SPEEDS, DRAGS)), 0.0, v, points=points, epsabs=1e-13)
        return float(value)

    fastest = brentq(lambda v: over(v, 1.0, 1) + over(v, -1.0, 1) - 10.0, 1.0, 4.0, xtol=1e-13)
    least = over(fastest, 1.0, 0) + over(fastest, -1.0, 0)
    found = run().solve()
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(least, rel=1e-9)
    assert found["v"][list(found.surface_nodes)] == pytest.approx([1.0, 2.0, 2.0, 1.0], abs=1e-8)
    assert "a node where drag at v = 1 has a kink at t = 1.05361 s" in found.message
    assert found.conditions is not None
    assert found.conditions.holds, found.conditions


@pytest.mark.parametrize(("tolerance", "status"), [(1e-2, SolverOutcome.CONVERGED), (1.0, SolverOutcome.OPTIMAL)])
def test_on_given_nodes_a_kink_that_bends_j_by_more_than_the_tolerance_is_named(
    tolerance: float, status: SolverOutcome
) -> None:
    """The slope changes by 2.02 inside an interval of 2/3 s: J by up to 0.11."""
    found = clock([0.0, 0.9, 2.0], [0.0, 1.0, 0.0], nodes=4, tolerance=tolerance)
    (crossing,) = crossings(found)
    assert str(crossing).startswith("table at x = 0.9 has a kink at t = 0.")
    assert crossing.bend == pytest.approx(2.02 * (2.0 / 3.0) ** 2 / 8.0, rel=2e-2)
    assert found.status is status
    assert (str(crossing) in found.message) is (status is SolverOutcome.CONVERGED)


def clock(knots: list[float], values: list[float], nodes: int, tolerance: float) -> Solution:
    """x = t over [0, 2] at a cost that a table has of x."""
    table = ca.interpolant("table", "linear", [knots], values)
    ocp = OptimalControlProblem("clock")
    x, u = ocp.state("x", guess=(0.0, 2.0)), ocp.control("u", guess=1.0)
    ocp.duration(2.0)
    ocp.minimise(running=table(x) + 1e3 * (u - 1.0) ** 2)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end(x, 2.0)
    return ocp.solve(nodes, tolerance=tolerance)


def test_of_a_table_with_more_knots_than_nodes_can_be_placed_none_is_counted() -> None:
    def passed(count: int) -> int:
        speeds = np.linspace(0.0, 2.0, count)
        return len(crossings(clock(speeds.tolist(), (speeds**2).tolist(), nodes=12, tolerance=1.0)))

    assert passed(11) == 9
    assert passed(60) == 0


# a table of position and speed

PLACES, DRAG = np.array([0.0, 2.0, 4.0, 8.0]), np.array([0.0, 1.0, 2.0, 3.0, 4.0])
FIELD = 0.075 * np.outer(1.0 + 0.2 * np.abs(PLACES - 4.0), DRAG**2)


def test_a_table_of_two_states_is_crossed_along_both() -> None:
    """u = -λ_v / 2 against a drag of place and speed, by shooting."""
    ocp = OptimalControlProblem("field")
    table = ca.interpolant("drag", "linear", [PLACES, DRAG], FIELD.ravel(order="F"))
    x, v, u = ocp.state("x", guess=(0.0, 8.0)), ocp.state("v", guess=1.0), ocp.control("u")
    ocp.duration(6.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u - table(ca.vertcat(x, v))))
    ocp.start(ca.vertcat(x, v), 0.0)
    ocp.end(ca.vertcat(x, v), [8.0, 0.0])
    found = ocp.solve()
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert "drag at v = 1 has a kink" in found.message
    assert "drag at x = 4 has a kink" in found.message

    def rates(t: float, y: Array) -> list[float]:
        i = int(np.clip(np.searchsorted(PLACES, y[0]) - 1, 0, 2))
        j = int(np.clip(np.searchsorted(DRAG, y[1]) - 1, 0, 3))
        h, k = PLACES[i + 1] - PLACES[i], DRAG[j + 1] - DRAG[j]
        a, b, cell = (y[0] - PLACES[i]) / h, (y[1] - DRAG[j]) / k, FIELD[i : i + 2, j : j + 2]
        value = np.array([1.0 - a, a]) @ cell @ np.array([1.0 - b, b])
        by_x, by_v = (cell[1] - cell[0]) @ [1.0 - b, b] / h, [1.0 - a, a] @ (cell[:, 1] - cell[:, 0]) / k
        force = -0.5 * y[3]
        return [y[1], force - value, y[3] * by_x, -y[2] + y[3] * by_v, force**2]

    def flown(first: Array) -> Array:
        found = solve_ivp(rates, (0.0, 6.0), [0.0, 0.0, *first, 0.0], rtol=1e-10, atol=1e-11, max_step=0.05)
        end: Array = found.y[:, -1]
        return end

    first = fsolve(lambda first: flown(first)[:2] - [8.0, 0.0], found.costates[0], xtol=1e-10)
    assert flown(first)[:2] == pytest.approx([8.0, 0.0], abs=1e-7)
    assert found.cost == pytest.approx(flown(first)[4], rel=1e-7)


# the time, in a free duration


def trip(limit: Expression) -> tuple[Solution, Array]:
    """10 m from rest to rest in the least time with a thrust whose limit changes with the time; and (s, T)."""
    ocp = OptimalControlProblem("trip")
    x, v, u = ocp.state("x", guess=(0.0, 10.0)), ocp.state("v", guess=1.0), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.minimise(terminal=ocp.free_duration(guess=8.0, lower=1.0, upper=50.0))
    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, limit(ocp.t) * u))
    ocp.start(ca.vertcat(x, v), 0.0)
    ocp.end(ca.vertcat(x, v), [10.0, 0.0])
    t = ca.SX.sym("t")
    value = ca.Function("limit", [t], [limit(t)])

    def gained(s: float, T: float) -> tuple[float, float]:
        """Speed and place at T of a thrust that turns at s."""
        parts = np.unique([0.0, T, *(each for each in (s, 2.0, 3.0) if each < T)])
        total = np.zeros(2)
        for a, b in itertools.pairwise(parts.tolist()):
            at, weights = np.polynomial.legendre.leggauss(4)  # exact: the limit is straight in each part
            at, weights = a + 0.5 * (b - a) * (at + 1.0), 0.5 * (b - a) * weights
            force = np.array([float(value(now)) for now in at]) * (1.0 if b <= s else -1.0)
            total += [weights @ force, weights @ ((T - at) * force)]
        return float(total[0]), float(total[1] - 10.0)

    return ocp.solve(), fsolve(lambda z: gained(*z), [3.5, 7.7], xtol=1e-13)


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        (lambda t: ca.if_else(t < 3.0, 1.0, 0.5), "a node where (t<3) jumps at t = 3 s"),
        (
            ca.interpolant("limit", "linear", [[0.0, 2.0, 3.0, 20.0]], [1.0, 1.0, 0.5, 0.5]),
            "a node where limit at t = 2 has a kink at t = 2 s, limit at t = 3 has a kink at t = 3 s",
        ),
    ],
)
def test_a_thrust_that_changes_on_the_way_has_nodes_there(limit: Expression, words: str) -> None:
    found, (_, T) = trip(limit)
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert words in found.message
    assert found.duration == pytest.approx(T, rel=1e-8)


def test_a_price_table_says_when_to_end() -> None:
    """Bought from 0.3 to 1.8 s, where the price is 3.1, and 3.1 less what a second costs."""
    price = ca.interpolant("price", "linear", [np.array([0.0, 1.0, 2.0, 3.0])], [4.0, 1.0, 3.0, 6.0])
    ocp = OptimalControlProblem("purchase")
    E, P = ocp.state("E", guess=(0.0, 2.0)), ocp.control("P", lower=0.0, upper=1.0)
    ocp.minimise(running=price(ocp.t) * P, terminal=0.5 * ocp.free_duration(guess=4.0, lower=1.0, upper=6.0))
    ocp.dynamics(E, P)
    ocp.start(E, 0.0)
    ocp.end(E, 1.5)
    found = ocp.solve()
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(0.7 * 4.1 / 2.0 + 0.8 * 3.6 / 2.0 + 0.9, rel=1e-8)
    assert found.duration == pytest.approx(1.8, rel=1e-6)


def walk(rate: Expression, guess: float) -> OptimalControlProblem:
    """4 m at u with u^2 and a rate of the time as its cost, J = 16 / T + ∫ rate dt."""
    ocp = OptimalControlProblem("walk")
    x, u = ocp.state("x", guess=(0.0, 4.0)), ocp.control("u", guess=1.0)
    ocp.free_duration(guess=guess, lower=0.5, upper=20.0)
    ocp.minimise(running=u**2 + rate(ocp.t))
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end(x, 4.0)
    return ocp


def test_a_solver_that_gives_up_at_a_kink_is_helped_by_a_node_there() -> None:
    dear = ca.interpolant("dear", "linear", [np.array([0.0, 2.9, 3.1, 20.0])], [1.0, 1.0, 5.0, 5.0])
    found = walk(dear, 2.0).solve(verify=False)
    T = brentq(lambda T: 16.0 / T**2 - 1.0 - 20.0 * (T - 2.9), 2.9, 3.1, xtol=1e-13)
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(16.0 / T + T + 10.0 * (T - 2.9) ** 2, rel=1e-9)


def test_a_duration_ends_on_the_time_from_which_on_it_is_dear() -> None:
    found = walk(lambda t: ca.if_else(t < 3.0, 1.0, 5.0), 3.1).solve(verify=False)
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(16.0 / 3.0 + 3.0, rel=1e-6)
    assert "its end on (t<3)" in found.message


def opaque() -> OptimalControlProblem:
    """4 m at a cost of u^2, and of half of it from 2 s on, which cannot be seen, and of 1 a second."""
    t = ca.MX.sym("t")
    price = ca.Function("price", [t], [ca.if_else(t < 2.0, 1.0, 0.5)], {"never_inline": True})
    ocp = OptimalControlProblem("opaque")
    x, u = ocp.state("x", guess=(0.0, 4.0)), ocp.control("u", guess=1.0)
    T = ocp.free_duration(guess=3.0, lower=0.5, upper=20.0)
    ocp.minimise(running=price(ocp.t) * u**2, terminal=T)
    ocp.dynamics(x, u)
    ocp.start(x, 0.0)
    ocp.end(x, 4.0)
    return ocp


def test_break_times_of_a_free_duration_are_held() -> None:
    found = opaque().solve(breaks=[2.0, 15.0], verify=False)  # the second one is not reached
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(1.0 + 4.0 * np.sqrt(2.0), rel=1e-8)
    assert found.t[list(found.surface_nodes)] == pytest.approx([2.0], abs=1e-7)
    assert "a node where a break is given at t = 2 s" in found.message


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"breaks": [25.0]}, "opaque: breaks = [25.0]; allowed: times between 0 and 20 s"),
        ({"breaks": [2.0], "nodes": 9}, "opaque: breaks where the duration is free; allowed: method = 'auto' without"),
        ({"breaks": [2.0], "method": "hp"}, "opaque: breaks where the duration is free; allowed: method = 'auto'"),
    ],
)
def test_break_times_that_cannot_be_held_are_refused(wrong: dict[str, object], named: str) -> None:
    with pytest.raises(ProblemError, match=re.escape(named)):
        opaque().solve(**wrong)  # type: ignore[arg-type]


def test_what_is_stated_at_a_time_holds_beside_a_crossing() -> None:
    ocp, x = two_costs()
    ocp.at(0.7).minimise(40.0 * (x + 0.9) ** 2)
    ocp.at(1.9).constrain(x <= 0.85, name="late")
    found = ocp.solve()

    def cost(z: Array) -> float:
        """J of the place at 0.7 s and of the time at which 0.1 is crossed."""
        first, slow = (z[0] + 1.0) ** 2 / 0.7 + 40.0 * (z[0] + 0.9) ** 2, (0.1 - z[0]) ** 2 / (z[1] - 0.7)
        return float(first + slow + 3.0 * (0.75**2 / (1.9 - z[1]) + 0.15**2 / 0.1))

    least = minimize(cost, [-0.9, 1.2], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13})
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(least.fun, rel=1e-6)
    assert found("x", 1.9) == pytest.approx(0.85, abs=1e-6)
    assert found.multipliers.instants is not None
    assert abs(found.multipliers.instants["late at 1.9 s"]) > 0.1
    assert found.conditions is not None
    assert found.conditions.holds, found.conditions
