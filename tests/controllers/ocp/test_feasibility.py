"""A feasible problem is not called infeasible, whatever the guess; INFEASIBLE has a proof that holds for it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.backend import Options
from mathnavi.controllers.ocp.feasibility.certificate import affinely_infeasible
from mathnavi.controllers.ocp.feasibility.enclosure import infeasible_by_enclosure
from mathnavi.controllers.ocp.feasibility.intervals import enclosed
from mathnavi.controllers.ocp.feasibility.starts import starts
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import Interval
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from tests.controllers.ocp.feasibility_cases import (
    cubic,
    dubins,
    enclosed_area,
    horizon,
    one_way,
    round_a_disc,
    sideways,
    sledge,
    swing,
    valve,
)
from tests.controllers.ocp.statements import double_integrator, integrator

Stated = Callable[[], OptimalControlProblem]

FEASIBLE: list[tuple[Stated, int | None, float]] = [  # nodes, None for as many as it needs, and the least J
    (valve, None, 1.0),
    (cubic, None, 1.0),
    (dubins, None, 6.5140532),
    (sideways, 21, 2.7895397),
    (enclosed_area, 21, 2.0 * math.pi),
    (horizon, 15, 62.8193),
]


@pytest.mark.parametrize(("stated", "nodes", "least"), FEASIBLE, ids=[stated.__name__ for stated, _, _ in FEASIBLE])
def test_a_guess_that_is_stationary_for_a_constraint_is_left(stated: Stated, nodes: int | None, least: float) -> None:
    found = stated().solve(nodes)
    assert found.solved, (found.status, found.message)
    assert found.cost == pytest.approx(least, rel=1e-6 if nodes is None else 3e-2)
    assert found.message.startswith("from restart ")


INFEASIBLE = [
    (sledge(5.0, 1.0), "end of x (violated by 4.5): cannot hold with "),
    (sledge(3.0, 2.0, most=1.0), "end of x (violated by 1.5): cannot hold with "),
    (sledge(0.3, 2.0, wall=0.2), "end of x (violated by 0.1): cannot hold with path: wall <= 0.2"),
    (sledge(0.1, 1.0, speed=2.0), "end of v (violated by 1)"),
    (swing(1.8, 2.0), "end of x (violated by 0.38): cannot hold with "),  # only the adjoint shows it: 1 - cos 2 = 1.42
    (sideways(distance=9.0, seconds=6.0), "from the start y is between -5.4"),  # 7 - π/2 = 5.43
    (one_way(), "end of x"),
    (round_a_disc(start=2.5), "start of p[0]; start of p[1]: cannot hold with path: 1 <= disc, which is 0.25 there"),
    (round_a_disc(end=2.0), "end of p[0]; end of p[1]: cannot hold with path: 1 <= disc, which is 0 there"),
]


@pytest.mark.parametrize(("ocp", "named"), INFEASIBLE, ids=[named for _, named in INFEASIBLE])
def test_infeasible_is_a_proof_that_names_the_constraint(ocp: OptimalControlProblem, named: str) -> None:
    found = ocp.solve(13)
    assert found.status is SolverOutcome.INFEASIBLE
    assert named in found.message


@pytest.mark.parametrize("T", [2.0002, 2.002, 2.02])  # at T = 2 the switch is in the middle
def test_nodes_that_are_too_few_for_a_switch_prove_nothing(T: float) -> None:
    assert solve(sledge(1.0, T, speed=0.0).functions(), 4).status is SolverOutcome.NO_FEASIBLE_POINT
    assert solve(sledge(1.0, 1.998, speed=0.0).functions(), 4).status is SolverOutcome.INFEASIBLE


@pytest.mark.parametrize(("width", "end", "infeasible"), [(1e-4, 2.5, False), (0.3, 2.5, False), (0.3, 3.5, True)])
def test_a_push_between_two_nodes_is_not_passed_over(width: float, end: float, infeasible: bool) -> None:
    ocp = OptimalControlProblem("push")
    x, u = ocp.state("x"), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    push = 2.0 / width * ca.exp(-np.pi * ((ocp.t - 0.4137) / width) ** 2)  # carries x by 2, and u by 1 more
    ocp.dynamics(x, u + push)
    ocp.start(x, 0.0)
    ocp.end(x, end)
    found = ocp.solve(5, options=Options(restarts=0))
    assert (found.status is SolverOutcome.INFEASIBLE) is infeasible


def test_what_an_oscillator_just_reaches_is_not_proved_to_be_out_of_reach() -> None:
    best = 1.0 - math.cos(2.0)
    assert solve(swing(best + 1e-2, 2.0).functions(), 6).status is SolverOutcome.INFEASIBLE
    assert solve(swing(best - 1e-2, 2.0).functions(), 6).status is not SolverOutcome.INFEASIBLE


def test_a_feasible_point_that_no_start_finds_is_not_denied() -> None:
    ocp, x, u = integrator()
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.constrain(ca.sin(x + u) + ca.cos(x + u), lower=1.5, name="wave")  # at most sqrt(2), enclosed by 2
    found = ocp.solve(5, options=Options(restarts=4))
    assert found.status is SolverOutcome.NO_FEASIBLE_POINT
    assert found.message.startswith("none found from 5 starts; ")
    assert "path: 1.5 <= wave" in found.message


def test_a_path_constraint_that_holds_nowhere_is_proved() -> None:
    ocp, x, u = integrator(limit=1.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.constrain(x**2 + u**2, lower=1.5, name="far")  # at t = 0 at most 1
    assert ocp.solve(5).message == "start of x: cannot hold with path: 1.5 <= far, which is between 0 and 1 there"


def test_restarts_are_the_same_each_time() -> None:
    problem = dubins().functions()
    first, again = (
        list(starts(problem, problem.guess, problem.nominal, 12, np.random.default_rng(0))) for _ in range(2)
    )
    assert [name for name, _ in first] == [name for name, _ in again]
    assert all(np.array_equal(a.states, b.states) for (_, a), (_, b) in zip(first, again, strict=True))
    assert len({guess.duration for _, guess in first}) > 2
    low, high = problem.control_bounds
    assert all((guess.controls >= low).all() and (guess.controls <= high).all() for _, guess in first)


def test_no_two_restarts_of_a_problem_without_controls_are_the_same() -> None:
    """They vary the unknown rate, whose guess of 0 is stationary, and the constant mass."""
    ocp = OptimalControlProblem("growth")
    x, rate, mass = ocp.state("x"), ocp.unknown("rate"), ocp.state("mass", lower=0.5, upper=8.0, guess=2.0)
    ocp.dynamics(x, rate**2)
    ocp.dynamics(mass, 0.0)
    ocp.start(x, 0.0)
    ocp.end(x, 1.0)
    ocp.duration(1.0)
    ocp.minimise(rate**2)
    problem = ocp.functions()
    found = list(starts(problem, problem.guess, np.empty(0), 8, np.random.default_rng(0)))
    begun = np.array([guess.states_at(np.zeros(1))[0] for _, guess in found])
    simulated = [name != "the guess with noise" for name, _ in found]
    assert len(np.unique(begun[:, 1])) == len(np.unique(begun[:, 2])) == len(found) == 8
    assert (begun[simulated, 0] == 0.0).all()
    assert ((begun[:, 2] >= 0.5) & (begun[:, 2] <= 8.0)).all()
    assert begun[1:, 1].std() > 0.1


def test_a_simulation_for_a_restart_follows_the_dynamics() -> None:
    problem = swing(1.0).functions()
    name, guess = list(starts(problem, problem.guess, problem.nominal, 2, np.random.default_rng(0)))[1]
    u = guess.controls[0, 0]
    assert name == "constant controls"
    np.testing.assert_allclose(guess.states[:, 0], u * (1.0 - np.cos(4.0 * guess.times)), atol=1e-6)


def test_conditions_at_the_start_that_contradict_each_other_are_proved_and_named() -> None:
    ocp = OptimalControlProblem("start")
    x, y, u = ocp.state("x", upper=1.0), ocp.state("y"), ocp.control("u")
    ocp.minimise(terminal=ocp.free_duration(guess=1.0, lower=0.1, upper=2.0))
    ocp.dynamics(ca.vertcat(x, y), ca.vertcat(ca.sin(y), u))
    ocp.start_constraint(x + y >= 2.0)
    ocp.start_constraint(x - y >= 2.0)
    found = ocp.solve(5)
    assert found.status is SolverOutcome.INFEASIBLE
    assert found.message.endswith("cannot hold with x <= 1")


def test_the_number_of_restarts_is_the_callers() -> None:
    found = valve().solve(9, options=Options(restarts=1))  # the controls of 0, simulated
    assert found.status is SolverOutcome.NO_FEASIBLE_POINT
    assert found.message == "none found from 2 starts; end of x (violated by 1): cannot hold with start of x"
    at_once = valve().solve(9, options=Options(restarts=0))
    assert at_once.message == "end of x (violated by 1): cannot hold with start of x"


def test_a_solve_that_succeeds_is_not_restarted() -> None:
    found = sledge(0.25, 1.0).solve(9)
    assert found.ok
    assert "restart" not in found.message


def test_a_value_that_is_not_finite_at_the_start_is_no_miss() -> None:
    ocp = OptimalControlProblem("logarithm")
    x, u = ocp.state("x", guess=0.5), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, u + 0.1 * ca.log(x))
    ocp.start(x, 0.0)
    found = ocp.solve(15)
    assert found.status is SolverOutcome.NOT_FINITE
    assert "dynamics of x are -inf at t = 0 s of the solution, where x = 0" in found.message


def test_a_parameter_can_put_the_end_inside_an_obstacle() -> None:
    ocp, x, u = integrator()
    far = ocp.parameter("far", 3.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.constrain((x - 2.0) ** 2, lower=0.25, name="post")
    ocp.end(x, far)
    problem = ocp.functions()
    assert infeasible_by_enclosure(problem, np.array([3.0])) is None
    inside = infeasible_by_enclosure(problem, np.array([1.9]))
    assert str(inside) == "end of x: cannot hold with path: 0.25 <= post, which is 0.01 there"


EXPRESSIONS: list[Callable[[ca.SX], ca.SX]] = [
    lambda x: x[0] * x[1] - x[2] / x[0],
    lambda x: ca.sin(3 * x[0]) + ca.cos(x[1]) + ca.tan(0.4 * x[2]),
    lambda x: ca.exp(x[0]) * ca.tanh(x[1]) - x[2] ** 3 + x[0] ** 2,
    lambda x: ca.fabs(x[0]) * ca.fmax(x[1], x[2]) + ca.fmin(x[0], 1),
    lambda x: ca.if_else(x[0] > 0, x[1], x[2]) + ca.atan2(x[0], x[1]),
    lambda x: x[0] ** -2 + ca.fabs(x[1]) ** 1.5 + x[2] ** 4,
    lambda x: ca.log(1 + x[0] ** 2) + ca.sqrt(ca.fabs(x[1])) + ca.cosh(x[2]) + ca.hypot(x[0], x[1]),
]


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_an_enclosure_holds_all_values(expression: Callable[[ca.SX], ca.SX]) -> None:
    rng, x = np.random.default_rng(1), ca.SX.sym("x", 3)
    f = ca.Function("f", [x], [expression(x)])
    lower = 2.0 * rng.normal(size=(3, 50))
    width = rng.uniform(0.0, 2.0, (3, 50)) ** 2
    found = enclosed(f, [Interval(lower, lower + width)])
    for share in (0.0, 1.0, *rng.uniform(size=(40, 3, 50))):
        values = np.array(f.map(50)(lower + share * width).full())
        assert (values >= found.lower - 1e-9).all()
        assert (values <= found.upper + 1e-9).all()
    assert np.isfinite(found.upper).any()


@pytest.mark.parametrize("seed", range(4))
def test_no_multipliers_prove_that_a_feasible_problem_is_infeasible(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ocp, x, v, u = double_integrator(limit=1.0, upper=1.0)
    ocp.duration(2.0)
    ocp.minimise(running=u**2)
    ocp.constrain(x + 0.3 * v, upper=0.9, name="wall")
    ocp.constrain(u - v, lower=-2.0, upper=0.8, name="mixed")
    ocp.end(x, 0.7)
    ocp.end_constraint(x + v, lower=0.5, upper=1.0)
    found = solve(ocp.functions(), 5)
    assert found.solved
    many = found.multipliers
    for _ in range(10):
        drawn = {
            name: dataclasses.replace(own, values=rng.normal(size=own.values.shape) * rng.choice([0.0, 1.0]))
            for name in ("path", "states", "final")
            for own in (getattr(many, name),)
        }
        assert not affinely_infeasible(dataclasses.replace(found, multipliers=dataclasses.replace(many, **drawn)), 0.0)


def from_rest(size: int, drag: Callable[[ca.SX], ca.SX]) -> Solution:
    ocp = OptimalControlProblem("from rest")
    x, w, u = ocp.state("x"), ocp.state("w", size), ocp.control("u", size, lower=-2.0, upper=2.0)
    ocp.duration(1.0)
    ocp.dynamics(x, w[0])
    ocp.dynamics(w, u - drag(w))
    ocp.minimise(running=ca.sumsqr(u))
    ocp.start(x, 0.0)
    ocp.start(w, 0.0)
    ocp.end(x, 0.5)
    return ocp.solve()


def test_a_guess_that_is_not_finite_is_left_for_one_that_is() -> None:
    """Drag |w| w has a derivative at rest, 0, but as an expression 0 / 0; along a line it is w^2."""
    found, known = from_rest(2, lambda w: ca.norm_2(w) * w), from_rest(1, lambda w: w**2)
    assert found.status is known.status is SolverOutcome.OPTIMAL
    assert found.message.startswith("from restart ")
    assert found.cost == pytest.approx(known.cost, rel=1e-6)
