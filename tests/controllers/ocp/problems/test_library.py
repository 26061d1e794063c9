"""The library's optima are what mathematics says they are, and every problem is stated so that it can be solved."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from typing import get_args

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mathnavi.controllers.ocp import problems
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.library import MISSILES, PROBLEMS, Kind, KnownOptimum
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.interfaces.signals import Array

ALL = PROBLEMS | MISSILES
QUICK = ("brachistochrone", "van der Pol, time", "singular regulator", "Bryson-Denham, L = 0.1")  # one of each kind


def test_every_problem_is_in_the_library() -> None:
    modules = [
        importlib.import_module(f"{problems.__name__}.{file.name}") for file in pkgutil.iter_modules(problems.__path__)
    ]
    stated = {
        function
        for module in modules
        for name, function in vars(module).items()
        if not name.startswith("_") and getattr(function, "__module__", "") == module.__name__
        if inspect.isroutine(inspect.unwrap(function))
    }
    used = {known.problem().name for known in ALL.values()}
    assert len(used) == len(ALL)  # no two are the same
    assert stated == {getattr(known.problem, "func", known.problem) for known in ALL.values()}


@pytest.mark.parametrize("name", ALL)
def test_a_problem_is_made_once_because_programmes_are_kept_for_it(name: str) -> None:
    assert ALL[name].problem() is ALL[name].problem()


@pytest.mark.parametrize("name", ALL)
def test_a_guess_is_finite_and_within_the_bounds(name: str) -> None:
    problem = ALL[name].problem()
    for values, bounds in (
        (problem.guess_states, problem.state_bounds),
        (problem.guess_controls, problem.control_bounds),
    ):
        assert np.isfinite(values).all()
        assert (values >= bounds.lower - 1e-12).all()
        assert (values <= bounds.upper + 1e-12).all()


def test_every_kind_of_control_is_in_the_library() -> None:
    assert {known.kind for known in PROBLEMS.values()} == set(get_args(Kind))
    assert {PROBLEMS[name].kind for name in QUICK} == set(get_args(Kind))


@pytest.mark.parametrize("name", QUICK)
def test_a_problem_is_solved_by_its_name(name: str) -> None:
    solution, known = OptimalControlProblem(name).solve(), PROBLEMS[name]
    assert solution.status is SolverOutcome.OPTIMAL
    assert solution.replay is not None
    assert known.error(solution.cost) <= known.precision
    assert known.error(solution.replay.cost) <= known.precision


def test_goddards_optimum_is_thrust_singular_arc_and_coast() -> None:
    """On the singular arc D (1 + 2 v) = m / h^2, and the thrust is what keeps it so (Bryson and Ho, 8.4)."""

    def drag(h: float, v: float) -> float:
        return float(310.0 * v**2 * np.exp(-500.0 * (h - 1.0)))

    def rates(x: Array, thrust: float) -> list[float]:
        h, v, m = x
        return [v, (thrust - drag(h, v)) / m - 1.0 / h**2, -2.0 * thrust]

    def surplus(x: Array) -> float:
        h, v, m = x
        return drag(h, v) * (1.0 + 2.0 * v) - m / h**2

    def surplus_rate(x: Array, thrust: float) -> float:
        step, slope = 1e-6, np.array(rates(x, thrust))
        return (surplus(x + step * slope) - surplus(x - step * slope)) / (2.0 * step)

    def singular_thrust(x: Array) -> float:
        at_none, at_one = surplus_rate(x, 0.0), surplus_rate(x, 1.0)
        return -at_none / (at_one - at_none)

    def until(event: object, thrust: object, x: Array) -> Array:
        event.terminal = True  # type: ignore[attr-defined]
        path = solve_ivp(
            lambda t, y: rates(y, thrust(y)),  # type: ignore[operator]
            (0.0, 1.0), x, events=event, method="DOP853", rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        return np.array(path.y[:, -1])

    x = until(lambda t, y: surplus(y), lambda y: 3.5, np.array([1.0, 0.0, 1.0]))
    x = until(lambda t, y: y[2] - 0.6, singular_thrust, x)
    x = until(lambda t, y: y[1], lambda y: 0.0, x)
    assert PROBLEMS["Goddard"].optimum == pytest.approx(x[0], abs=1e-7)


def test_an_error_is_relative_to_the_distance_that_matters() -> None:
    known = KnownOptimum(PROBLEMS["Goddard"].problem, 1.01, "", "singular", sign=-1.0, origin=1.0)
    assert known.value(-1.02) == 1.02
    assert known.error(-1.02) == pytest.approx(1.0)
    assert KnownOptimum(known.problem, 4.0, "", "smooth").error(4.4) == pytest.approx(0.1)
