"""Bad statements: each ends in one clear line that names the culprit, its value and what is allowed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.indirect import solve_indirect
from mathnavi.controllers.ocp.methods.adaptation import distribute, redistribute, refine, solve
from mathnavi.controllers.ocp.methods.automatic import automatic
from mathnavi.controllers.ocp.methods.by_name import solve_by
from mathnavi.controllers.ocp.methods.hp import hp
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import Options, transcription
from mathnavi.controllers.ocp.transcriptions.low_order import HermiteSimpson
from mathnavi.interfaces.errors import ProblemError
from tests.controllers.ocp.statements import integrator


def stated() -> tuple[OptimalControlProblem, ca.SX, ca.SX]:
    ocp = OptimalControlProblem("ocp")
    x, u = ocp.state("x", lower=-2.0, upper=2.0), ocp.control("u")
    ocp.state("y", 2)
    ocp.parameter("k", 1.0)
    return ocp, x, u


def whole() -> OptimalControlProblem:
    ocp, x, u = stated()
    y = ca.vertcat(*(v.symbol for v in ocp.statement.states[1:]))
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(ca.vertcat(x, y), ca.vertcat(u, y))
    ocp.start(x, 0.0)
    return ocp


Stated = Callable[[OptimalControlProblem, ca.SX, ca.SX], Any]
OTHER = ca.SX.sym("x")


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda ocp, x, u: ocp.dynamics(x, math.sin(x)), "ocp: dynamics of x = nan: NaN; allowed: finite numbers, and"),
        (lambda ocp, x, u: ocp.dynamics(x, u * math.sin(x)), "math.sin(x) of a symbol is NaN, casadi.sin(x) is not"),
        (lambda ocp, x, u: ocp.minimise(running=u**2 + math.nan), "the running cost = (sq(u)+nan): NaN"),
        (lambda ocp, x, u: ocp.dynamics(x, "u"), "dynamics of x = 'u'; allowed: an SX expression, a number"),
        (lambda ocp, x, u: ocp.dynamics("x", u), "dynamics of = 'x'; allowed: an SX expression"),
        (lambda ocp, x, u: ocp.dynamics(x, {"u": 1}), "dynamics of x = {'u': 1}; allowed"),
        (lambda ocp, x, u: ocp.dynamics(x, ca.MX.sym("m")), "dynamics of x = m, an MX expression; allowed: SX"),
        (lambda ocp, x, u: ocp.dynamics(x, u + ca.MX.sym("m")), "u is an SX expression and m an MX one, which"),
        (lambda ocp, x, u: ocp.constrain(ca.MX.sym("m") <= x), "x is an SX expression and m an MX one"),
        (lambda ocp, x, u: ocp.start(x, 2 * ca.MX.sym("m") @ u), "u is an SX expression and (2.*m) an MX one"),
        (lambda ocp, x, u: ocp.constrain([x <= 1, ca.MX.sym("m")]), "path constraint = m, an MX expression; allowed"),
        (lambda ocp, x, u: ocp.initial(OTHER), "initial: x is not a state"),
        (lambda ocp, x, u: ocp.periodic(OTHER), "periodic: x is not a state"),
        (lambda ocp, x, u: ocp.guess(OTHER, 1.0), "guess of x; allowed: x, y[0]"),
        (lambda ocp, x, u: ocp.integral(ca.SX.sym("z")), "dynamics of integral 1 depends on z, which is not among"),
        (lambda ocp, x, u: ocp.absolute(ca.SX.sym("z")), "path constraint |z| depends on z, which is not among its"),
        (lambda ocp, x, u: ocp.largest(x, ca.SX.sym("z")), "depends on z, which is not among its symbols; allow"),
        (lambda ocp, x, u: ocp.dynamics(x, OTHER), "dynamics of x depends on x (x of another problem)"),
        (lambda ocp, x, u: ocp.dynamics(x, ca.SX.sym("stranger")), "depends on stranger, which is not among"),
        (lambda ocp, x, u: ocp.minimise(terminal=u), "the terminal cost depends on u, which is not among its symbols"),
        (lambda ocp, x, u: ocp.state("z", lower="0"), "z: lower = '0'; allowed: a number"),
        (lambda ocp, x, u: ocp.state("z", 2, upper=[1, 2, 3]), "upper = [1, 2, 3] has 3 numbers; allowed: one, or 2"),
        (lambda ocp, x, u: ocp.state("z", 0), "z: size = 0; allowed: a whole number >= 1"),
        (lambda ocp, x, u: ocp.state("z", 2.5), "z: size = 2.5; allowed: a whole number >= 1"),
        (lambda ocp, x, u: ocp.state("z", guess="3"), "z: guess = '3'; allowed: finite numbers, or a function of time"),
        (lambda ocp, x, u: ocp.state("z", guess={"z": 3}), "z: guess = {'z': 3}; allowed: finite numbers, or"),
        (lambda ocp, x, u: ocp.state("z", 2, guess=[1, 2, 3]), "guess = [1.0, 2.0, 3.0]; allowed: finite numbers, 2"),
        (lambda ocp, x, u: ocp.state("z", guess=[]), "z: guess = []; allowed: finite numbers, at least one"),
        (lambda ocp, x, u: ocp.state("z", scale=-1), "z: scale = -1.0; allowed: a finite value > 0"),
        (lambda ocp, x, u: ocp.state(3), "variable 3 is empty or taken; allowed: a text other than"),
        (lambda ocp, x, u: ocp.state("y"), "variable 'y' is empty or taken"),
        (lambda ocp, x, u: OptimalControlProblem(None), "name = None; allowed: a text"),
        (lambda ocp, x, u: ocp.parameter("p", {"p": 1}), "parameter p = {'p': 1}; allowed: a number"),
        (lambda ocp, x, u: ocp.parameter("p", "1"), "parameter p = '1'; allowed: a number"),
        (lambda ocp, x, u: ocp.duration("1"), "duration = '1'; allowed: a number"),
        (lambda ocp, x, u: ocp.end(x, 3.0), "end of x = 3, outside its bounds; allowed: -2 to 2"),
        (lambda ocp, x, u: ocp.start(x, -3.0), "start of x = -3, outside its bounds; allowed: -2 to 2"),
        (lambda ocp, x, u: [ocp.end(x, 1), ocp.constrain(x <= 0.5)], "end of x = 1, outside its bounds"),
        (lambda ocp, x, u: [ocp.start(x, 0), ocp.start(x, 1)], "start of x = 1, and = 0 before; allowed: one value"),
        (lambda ocp, x, u: [ocp.end(x, 0), ocp.end(x, 1)], "end of x = 1, and = 0 before; allowed: one value"),
        (lambda ocp, x, u: ocp.constrain(x >= 3), "lower = 3.0, upper = 2.0; allowed: lower <= upper"),
        (lambda ocp, x, u: ocp.start(x, u), "start of x depends on u, which is not among its symbols; allowed: x"),
        (lambda ocp, x, u: ocp.start(u, 0), "start: u is not a state; allowed: ['x', 'y[0]', 'y[1]']"),
        (lambda ocp, x, u: ocp.guess(x**2, 1.0), "guess of sq(x); allowed: x, y[0], y[1], u"),
        (lambda ocp, x, u: ocp.guess(x, [1, 2], times=[1, 0]), "times of the guess = [1.0, 0.0]; allowed: 2"),
        (lambda ocp, x, u: ocp.guess_by_simulation({"z": 1}), "start of z; allowed: x, y[0], y[1]"),
        (lambda ocp, x, u: [ocp.start_time(1), ocp.start_time(2)], "the start time is given twice"),
        (lambda ocp, x, u: ocp.state("z", upper=math.nan), "upper = nan"),
        (lambda ocp, x, u: ocp.control("w", guess=(0.0, math.nan)), "guess = [0.0, nan]"),
        (lambda ocp, x, u: ocp.free_duration(guess=1.0, lower=2.0), "lower = 2.0, guess = 1.0"),
        (lambda ocp, x, u: ocp.duration(-1.0), "duration"),
        (lambda ocp, x, u: ocp.duration(math.inf), "duration"),
        (lambda ocp, x, u: [ocp.duration(1.0), ocp.duration(1.0)], "the duration is given twice"),
        (lambda ocp, x, u: ocp.dynamics(x, ca.SX.sym("z", 2)), "shape (2, 1)"),
        (lambda ocp, x, u: [ocp.dynamics(x, u), ocp.dynamics(x, 1.0)], "given twice"),
        (lambda ocp, x, u: ocp.dynamics(ca.SX.sym("z"), 1.0), "not a state"),
        (lambda ocp, x, u: ocp.minimise(running=ca.SX.sym("z", 2)), "running cost"),
        (lambda ocp, x, u: [ocp.minimise(terminal=x) for _ in range(2)], "minimise() is called twice"),
        (lambda ocp, x, u: ocp.parameter("p", math.inf), "parameter p = inf"),
    ],
)  # fmt: skip
def test_a_bad_statement_ends_where_it_is_written(wrong: Stated, named: str) -> None:
    with pytest.raises(ProblemError, match=re.escape(named)) as refused:
        wrong(*stated())
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("more", "named"),
    [
        (lambda ocp, x, u: ocp.start_constraint(2 * x), "2 equations at the start: start of x, (2.*x); allowed: 1, "),
        (lambda ocp, x, u: ocp.start_constraint(x**2), "allowed: 1, as many as x, y[0], y[1] can meet"),
        (
            lambda ocp, x, u: [ocp.start_constraint(k * ca.sum1(ocp.statement.x[1:])) for k in (1, 2)],
            "3 equations at the start",
        ),
        (lambda ocp, x, u: ocp.start_constraint(ca.sqrt(x - 9)), "2 equations at the start: start of x, sqrt((x-9))"),
        (lambda ocp, x, u: [ocp.end(x, 1), ocp.end_constraint(x**2)], "2 equations at the end: end of x, sq(x); "),
        (lambda ocp, x, u: ocp.end_constraint(ocp.statement.final_time == 3), "1 equations at the end"),
        (lambda ocp, x, u: [ocp.constrain(u == 0), ocp.constrain(u + x == 0)], "2 equations at the path"),
        (lambda ocp, x, u: ocp.state("z"), "no dynamics for z"),
        (lambda ocp, x, u: ocp.guess(x, lambda t: math.nan), "x: guess at t = 0 s is nan; allowed: finite numbers"),
        (lambda ocp, x, u: ocp.guess(x, lambda t: "a"), "x: guess at t = 0 s is 'a'; allowed: finite numbers"),
    ],
)  # fmt: skip
def test_what_contradicts_itself_as_a_whole_ends_before_the_solve(more: Stated, named: str) -> None:
    ocp = whole()
    more(ocp, ocp.statement.states[0].symbol, ocp.statement.controls[0].symbol)
    with pytest.raises(ProblemError, match=re.escape(named)) as refused:
        ocp.solve(5)
    assert "\n" not in str(refused.value)


def test_more_conditions_than_a_problem_without_control_can_meet_are_counted() -> None:
    ocp = OptimalControlProblem("falling")
    x = ocp.state("x")
    ocp.duration(1.0)
    ocp.dynamics(x, -x)
    ocp.start(x, 1.0)
    ocp.end(x, 2.0)
    with pytest.raises(ProblemError, match="2 equations at the start and the end, and no control; allowed: 1"):
        ocp.solve(5)


@pytest.mark.parametrize(
    "call",
    [
        lambda ocp: solve(ocp, 5),
        lambda ocp: refine(ocp),
        lambda ocp: redistribute(ocp, 5),
        lambda ocp: distribute(ocp, 5),
        lambda ocp: hp(ocp),
        lambda ocp: automatic(ocp),
        lambda ocp: solve_by(ocp, 5, "refine", None, guess=None, parameters=np.empty(0)),
        lambda ocp: transcription(ocp, HermiteSimpson(), 5),
        lambda ocp: solve_indirect(ocp),
    ],
)
def test_a_problem_in_place_of_its_functions_is_refused(call: Callable[[Any], object]) -> None:
    with pytest.raises(ProblemError, match=r"= OptimalControlProblem 'ocp'; allowed: ") as refused:
        call(whole())
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda ocp: refine(ocp.functions(), most_nodes=60.5), "most_nodes = 60.5; allowed: a whole number"),  # type: ignore[arg-type]
        (lambda ocp: refine(ocp.functions(), nodes=6.0), "nodes = 6.0; allowed: a whole number"),  # type: ignore[arg-type]
        (lambda ocp: solve(ocp.functions(), 5.5), "nodes = 5.5; allowed: a whole number"),  # type: ignore[arg-type]
        (lambda ocp: solve(ocp.functions(), "5"), "nodes = '5'; allowed: a whole number"),  # type: ignore[arg-type]
        (lambda ocp: distribute(ocp.functions(), 5.0), "nodes = 5.0; allowed: a whole number"),  # type: ignore[arg-type]
        (lambda ocp: redistribute(ocp.functions(), 5.0), "nodes = 5.0; allowed: a whole number"),  # type: ignore[arg-type]
        (lambda ocp: ocp.solve(5.5), "nodes = 5.5; allowed: a whole number"),
        (lambda ocp: ocp.solve(40.5, method="refine"), "nodes = 40.5; allowed: a whole number"),
        (lambda ocp: transcription(ocp.functions(), HermiteSimpson(), 1), "nodes = 1; allowed: a whole number N >= 2"),
        (lambda ocp: ocp.solve(5, parameters=[1.0]), "parameters = [1.0]; allowed: values by name"),
        (lambda ocp: ocp.solve(5, parameters={"k": "1"}), "parameter k = '1'; allowed: a finite number"),
        (lambda ocp: ocp.solve(5, parameters={"q": 1}), "parameter 'q' is not known; allowed: k"),
        (lambda ocp: solve(ocp.functions(), 5, parameters={"k": 1.0}), "parameters = {'k': 1.0}; allowed: (1,)"),  # type: ignore[arg-type]
        (lambda ocp: ocp.solve(5, guess=[1.0]), "guess = [1.0]; allowed: a Solution"),
        (lambda ocp: ocp.solve(5, scheme="radau"), "scheme = 'radau'; did you mean Radau? allowed: Herm"),
        (lambda ocp: ocp.solve(5, scheme=3), "scheme = 3; allowed: Hermite-Simpson, trapezoid, Radau,"),  # type: ignore[arg-type]
        (
            lambda ocp: ocp.solve(5, method="hp", scheme="Radau"),
            "scheme = 'Radau' with method = 'hp': it collocates by Radau's scheme; allowed: method = 'auto'",
        ),
        (
            lambda ocp: ocp.solve(method="hp", options=Options(backend="fatrop")),
            "backend = 'fatrop' with method = 'hp': it collocates by Radau's scheme, whose steps FATROP cannot",
        ),
    ],
)  # fmt: skip
def test_bad_arguments_of_a_solve_are_refused(call: Callable[[OptimalControlProblem], object], named: str) -> None:
    with pytest.raises(ProblemError, match=re.escape(named)) as refused:
        call(whole())
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("rate", "named"),
    [
        (lambda x, u, t: ca.sqrt(x - 1.0) + u, "dynamics of x are nan at t = 0 s of the guess, where x = 0, u = 0"),
        (lambda x, u, t: u + ca.sqrt(0.5 - t), "dynamics of x are nan at t = "),
        (lambda x, u, t: u + 1 / x, "dynamics of x are inf at t = 0 s of the guess, where x = 0, u = 0"),
    ],
)
def test_dynamics_that_are_not_finite_name_the_state_and_the_time(rate: Callable[..., ca.SX], named: str) -> None:
    ocp = OptimalControlProblem("ocp")
    x, u = ocp.state("x"), ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, rate(x, u, ocp.t))
    ocp.start(x, 0.0)
    failed = ocp.solve(5)
    assert failed.status is SolverOutcome.NOT_FINITE
    assert named in failed.message


def test_a_cost_or_a_constraint_that_is_not_finite_is_named() -> None:
    for say, named in (
        (lambda ocp, x: ocp.minimise(running=ca.log(x - 1)), "running cost is nan at t = 0 s"),
        (lambda ocp, x: ocp.minimise(terminal=ca.log(x - 1)), "terminal cost is nan"),
        (lambda ocp, x: ocp.constrain(ca.sqrt(x - 1) >= 0.1, name="root"), "path constraint root is nan at t = 0 s"),
    ):
        ocp, x, _ = integrator()
        ocp.duration(1.0)
        say(ocp, x)
        failed = ocp.solve(5)
        assert failed.status is SolverOutcome.NOT_FINITE
        assert named in failed.message


def falling() -> ProblemFunctions:
    """x'' = -9.81, thrown so that it is back after T, to be found, with the least speed that takes at least 2 s."""
    ocp = OptimalControlProblem("falling")
    x, v = ocp.state("x", guess=(0.0, 1.0, 0.0)), ocp.state("v", guess=(10.0, -10.0))
    ocp.free_duration(guess=2.5, lower=2.0, upper=4.0)
    ocp.minimise(terminal=-v)
    ocp.dynamics(x, v)
    ocp.dynamics(v, -9.81)
    ocp.start(x, 0.0)
    ocp.end(x, 0.0)
    return ocp.functions()


@pytest.mark.parametrize(
    "method",
    [
        lambda problem: solve(problem, 5),
        lambda problem: refine(problem),
        lambda problem: redistribute(problem, 7),
        lambda problem: distribute(problem, 7),
        lambda problem: hp(problem),
        lambda problem: automatic(problem),
    ],
)
def test_a_problem_without_a_control_works_in_every_method(method: Callable[[ProblemFunctions], Solution]) -> None:
    found = method(falling())
    assert found.ok
    assert found.cost == pytest.approx(9.81, rel=1e-6)
    assert found.control(0.5).shape == (0,)
