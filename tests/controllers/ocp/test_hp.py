"""hp refinement reaches its tolerance on every kind of problem, or says that it did not."""

from __future__ import annotations

import itertools
import math
import time
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mathnavi.controllers.ocp.methods.automatic import automatic
from mathnavi.controllers.ocp.methods.hp import hp
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import Options
from tests.controllers.ocp.statements import race_car
from tests.controllers.ocp.test_arcs import to_rest

KINDS = (
    "brachistochrone",
    "double integrator, time",
    "lunar landing",
    "Bryson-Denham, L = 0.1",
    "Goddard",
    "catalyst mixing",
    "hypersensitive, short",
    "maximum range",
    "robot arm",
)


@pytest.mark.parametrize("name", KINDS)
def test_the_cost_and_its_replay_are_those_of_the_literature(name: str) -> None:
    known = PROBLEMS[name]
    found = hp(known.problem())
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.replay is not None
    assert known.error(found.cost) <= known.precision
    assert known.error(found.replay.cost) <= known.precision


def test_a_singular_arc_does_not_ring() -> None:
    found = hp(to_rest())
    assert found.replay is not None
    assert found.replay.cost == pytest.approx(1.0 / 24.0, rel=1e-6)
    t = np.linspace(0.0, 1.0, 101)
    assert np.abs(found.control(t[t < 0.49])[:, 0] + 1.0).max() < 1e-6
    assert np.abs(found.control(t[t > 0.51])).max() < 1e-2
    assert "2 arcs" in found.message


def test_a_limit_of_a_state_has_an_arc_of_its_own() -> None:
    found = automatic(race_car().functions())
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(1.904682271, rel=1e-7)
    assert "3 arcs" in found.message


def ascent(thrust: str) -> OptimalControlProblem:
    """Fastest ascent to a height of 1 with a thrust of 2 at most, by its angle or as a vector: one optimum."""
    ocp = OptimalControlProblem(f"ascent, {thrust}")
    y, v = ocp.state("y", guess=(0.0, 1.0)), ocp.state("v", 2, guess=[(0.0, 0.5), (1.0, 0.5)])
    if thrust == "angle":
        angle = ocp.control("angle", guess=(1.0, -0.3))
        u = ca.vertcat(ca.cos(angle), ca.sin(angle))
    else:
        u = ocp.control("u", 2, guess=[(0.5, 0.8), (0.9, -0.3)])
        ocp.constrain(ca.sumsqr(u) <= 1.0)
    ocp.dynamics(y, v[1])
    ocp.dynamics(v, ca.vertcat(2.0 * u[0], 2.0 * u[1] - 1.0))
    for state, start, end in ((y, 0.0, 1.0), (v, [0.0, 0.0], [1.0, 0.0])):
        ocp.start(state, start)
        ocp.end(state, end)
    ocp.minimise(terminal=ocp.free_duration(guess=1.5, lower=0.1, upper=10.0))
    return ocp


def test_a_constraint_on_controls_that_holds_all_the_time_needs_no_more_nodes_than_without_it() -> None:
    """A barrier would leave the direction of the thrust uncertain by the square root of what it is at the end."""
    angle, vector = ascent("angle").solve(), ascent("vector").solve()
    assert angle.status is vector.status is SolverOutcome.OPTIMAL
    assert vector.cost == pytest.approx(angle.cost, rel=1e-7)
    assert vector.nodes <= angle.nodes + 5


def test_boundaries_that_would_leap_over_a_disc_are_left_for_a_mesh_that_stays() -> None:
    """A unicycle round a disc: arcs whose lengths are unknowns put their points on either side of it."""
    ocp = OptimalControlProblem("round a disc")
    x, y = ocp.state("x", guess=(-4.0, 0.0)), ocp.state("y", guess=(0.3, 0.0))
    theta = ocp.state("theta")
    v, w = ocp.control("v", lower=-1.0, upper=1.0), ocp.control("w", lower=-1.5, upper=1.5)
    ocp.duration(3.0)
    ocp.minimise(running=x**2 + y**2 + 0.1 * theta**2 + 0.05 * (v**2 + w**2), terminal=20 * (x**2 + y**2) + theta**2)
    ocp.dynamics(ca.vertcat(x, y, theta), ca.vertcat(v * ca.cos(theta), v * ca.sin(theta), w))
    ocp.constrain((x + 2.0) ** 2 + y**2 >= 0.36)
    ocp.start(ca.vertcat(x, y, theta), [-4.0, 0.3, 0.0])
    solution = hp(ocp.functions())
    assert solution.status is SolverOutcome.OPTIMAL
    assert solution.cost == pytest.approx(46.959005, rel=1e-6)


def test_a_stiff_initial_value_problem_has_its_nodes_where_an_integrator_steps() -> None:
    """Robertson's reaction: on uniform nodes its first layer, of 1e-4 of T, is inside one interval."""
    ocp = OptimalControlProblem("three species")
    x, y, z = ocp.state("x", guess=1.0), ocp.state("y"), ocp.state("z")
    first, second, third = 0.04 * x, 1e4 * y * z, 3e7 * y**2
    rates = ca.vertcat(-first + second, first - second - third, third)
    ocp.duration(4.0)
    ocp.minimise(terminal=-z)
    ocp.dynamics(ca.vertcat(x, y, z), rates)
    ocp.start(ca.vertcat(x, y, z), [1.0, 0.0, 0.0])
    found = hp(ocp.functions())
    at = ca.Function("rates", [ca.vertcat(x, y, z)], [rates])
    known = solve_ivp(lambda t, s: at(s).full()[:, 0], (0.0, 4.0), [1.0, 0.0, 0.0], "LSODA", rtol=1e-11, atol=1e-13)
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost == pytest.approx(-known.y[2, -1], rel=1e-8)
    assert np.diff(found.grid.nodes).min() < 1e-4


def test_a_fit_without_noise_ends_although_its_cost_all_but_vanishes() -> None:
    """A decay read without error: J* = 0, and a relative error of J has no meaning."""
    ocp = OptimalControlProblem("decay")
    x, rate = ocp.state("x", guess=1.0), ocp.unknown("rate", lower=0.0, upper=5.0, guess=0.3)
    ocp.duration(2.0)
    for t in (0.5, 1.0, 1.5, 2.0):
        ocp.at(t).minimise((x - math.exp(-1.3 * t)) ** 2)
    ocp.dynamics(x, -rate * x)
    ocp.start(x, 1.0)
    found = hp(ocp.functions())
    assert found.status is SolverOutcome.OPTIMAL, found.message
    assert found.cost < 1e-12
    assert found.nodes <= 60


def test_too_few_nodes_are_not_called_optimal() -> None:
    found = hp(PROBLEMS["hypersensitive, short"].problem(), 5)
    assert found.status is SolverOutcome.CONVERGED
    assert found.nodes <= 5
    assert "not within 1e-06" in found.message


def test_a_tolerance_is_reached_with_no_more_nodes_than_it_needs() -> None:
    problem = PROBLEMS["hypersensitive, short"].problem()
    loose, tight = (hp(problem, tolerance=tolerance) for tolerance in (1e-3, 1e-7))
    assert loose.status is tight.status is SolverOutcome.OPTIMAL
    assert loose.nodes < tight.nodes


def test_the_choice_is_named_with_its_reason() -> None:
    assert automatic(to_rest()).message.startswith("hp, for u may switch or be singular: ")
    assert automatic(PROBLEMS["target line"].problem()).message.startswith("hp, for the solution is smooth: ")
    assert automatic(PROBLEMS["target line"].problem(), 9).method == "direct"


def test_where_it_falls_short_the_better_replay_is_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    from mathnavi.controllers.ocp.methods import automatic as module

    def short(problem: ProblemFunctions, **options: object) -> object:
        return hp(problem, 4, tolerance=1e-6)

    monkeypatch.setattr(module, "hp", short)
    found = automatic(PROBLEMS["hypersensitive, short"].problem())
    assert found.method == "redistribution, residual"
    assert "for hp replays with" in found.message


@pytest.mark.parametrize(("broken", "said"), [("hp", "redistribution, residual"), ("redistribute", "hp")])
def test_an_attempt_that_ends_in_an_error_is_named_and_not_raised(
    broken: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mathnavi.controllers.ocp.methods import automatic as module

    def short(problem: ProblemFunctions, **options: Any) -> Solution:
        return hp(problem, 4, **options)

    def failing(*_: object, **__: object) -> Solution:
        raise IndexError("no such\nindex 25")

    monkeypatch.setattr(module, "hp", short)
    monkeypatch.setattr(module, broken, failing)
    found = automatic(PROBLEMS["hypersensitive, short"].problem())
    assert found.method == said
    assert "failed (IndexError: index 25)" in found.message
    monkeypatch.setattr(module, "hp", failing)
    monkeypatch.setattr(module, "redistribute", failing)
    with pytest.raises(IndexError, match="no such"):
        automatic(to_rest())


@pytest.mark.parametrize("method", [hp, automatic])
def test_seconds_are_a_budget_of_the_whole_call(method: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    times = itertools.count()
    monkeypatch.setattr(time, "process_time", lambda: next(times))
    found = method(PROBLEMS["hypersensitive, short"].problem(), options=Options(seconds=3.0))
    assert found.status is SolverOutcome.CONVERGED
    assert found.message.endswith("its seconds are spent")


@pytest.mark.parametrize("wrong", [{"tolerance": 0.0}, {"tolerance": math.nan}, {"most_nodes": 1}])
def test_limits_that_are_none_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="allowed"):
        hp(to_rest(), **wrong)  # type: ignore[arg-type]
