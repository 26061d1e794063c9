"""The library's optima are what mathematics says they are, and every problem is stated so that it can be solved."""

from __future__ import annotations

import pkgutil

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from mathnavi.controllers.ocp import problems
from mathnavi.controllers.ocp.methods.refinement import refine
from mathnavi.controllers.ocp.problems.hypersensitive import hypersensitive, hypersensitive_short
from mathnavi.controllers.ocp.problems.library import MISSILES, PROBLEMS, KnownOptimum
from mathnavi.controllers.ocp.solution import Outcome
from mathnavi.sim.interfaces.signals import Array

ALL = PROBLEMS | MISSILES
EASY = (
    "brachistochrone", "brachistochrone, g = 9.81", "brachistochrone, drop", "Bryson-Denham", "hypersensitive, short",
    "double integrator, energy", "double integrator, energy, v(T) free", "Rayleigh", "cart-pole",
)  # fmt: skip


def test_every_problem_file_is_in_the_library() -> None:
    files = {module.name for module in pkgutil.iter_modules(problems.__path__)} - {"library"}
    used = {known.problem().name for known in ALL.values()}
    assert len(used) == len(ALL)  # no two are the same
    made = {getattr(known.problem, "func", known.problem).__module__.rpartition(".")[2] for known in ALL.values()}
    assert files == made


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


@pytest.mark.parametrize("name", EASY)
def test_refinement_reaches_the_optimum(name: str) -> None:
    solution = refine(ALL[name].problem())
    assert solution.status in (Outcome.OPTIMAL, Outcome.CONVERGED)
    assert solution.nodes <= 60
    assert solution.replay is not None
    assert ALL[name].error(solution.cost) <= ALL[name].tolerance
    assert ALL[name].error(solution.replay.cost) <= ALL[name].tolerance


def test_the_hypersensitive_optimum_is_the_sum_of_its_boundary_layers() -> None:
    def layer(end: float, sign: float) -> float:
        return quad(lambda x: x * np.sqrt(x**4 + 1.0) + sign * x**3, 0.0, end)[0]

    assert PROBLEMS["hypersensitive"].optimum == pytest.approx(layer(1.0, -1.0) + layer(1.5, 1.0), rel=1e-7)
    assert PROBLEMS["hypersensitive, short"].optimum == pytest.approx(layer(1.5, -1.0) + layer(1.0, 1.0), rel=1e-7)
    assert hypersensitive().duration_bounds == (1e4, 1e4)
    assert hypersensitive_short().duration_bounds == (50.0, 50.0)


def test_the_brachistochrones_are_cycloids() -> None:
    """Of x = a (φ - sin φ), drop = a (1 - cos φ) the time is φ sqrt(a / g)."""
    for name, across, drop, g in (
        ("brachistochrone", 2.0, 2.0, 9.8),
        ("brachistochrone, g = 9.81", 2.0, 2.0, 9.81),
        ("brachistochrone, drop", 10.0, 5.0, 9.80665),
    ):
        phi = brentq(lambda p, slope: p - np.sin(p) - slope * (1.0 - np.cos(p)), 0.1, 6.2, args=(across / drop,))
        a = drop / (1.0 - np.cos(phi))
        assert PROBLEMS[name].optimum == pytest.approx(phi * np.sqrt(a / g), rel=2e-7)


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
