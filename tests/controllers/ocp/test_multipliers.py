"""Multipliers, Hamiltonian and sensitivities of a solution, against what is known on paper and against re-solves."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.articles import double_integrator_energy, double_integrator_time
from mathnavi.controllers.ocp.problems.bryson_ho import WALL, bryson_denham
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.transcriptions.collocation import GaussLegendre, LegendreGaussLobatto, RadauIIA
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson, MultipleShooting, Trapezoid
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from tests.controllers.ocp.statements import integrator


@pytest.mark.parametrize(
    ("scheme", "error"),
    [
        (HermiteSimpson(), 1e-9),
        (LegendreGaussLobatto(4), 1e-9),
        (RadauIIA(3), 1e-9),
        (GaussLegendre(3), 1e-9),
        (Trapezoid(), 0.4),
        (MultipleShooting(), 0.04),
        (Euler(), 1.0),
    ],
    ids=lambda value: getattr(value, "name", ""),
)
def test_costates_and_hamiltonian_are_those_on_paper(scheme: Scheme, error: float) -> None:
    solution = solve(double_integrator_energy(), 21, scheme=scheme)
    t = solution.point_times
    on_paper = np.stack([np.full_like(t, -12.0), 12.0 * t - 6.0], axis=-1)  # u = 6 - 12 t = -λ_v
    assert np.abs(solution.multipliers.dynamics.values - on_paper).max() < error
    between = np.linspace(0.0, 0.9, 7)
    assert np.abs(solution.costate(between)[:, 1] - (12.0 * between - 6.0)).max() < error
    assert solution.costate(0.5).shape == (2,)
    assert np.abs(solution.hamiltonian + 18.0).max() < 7.0 * error  # -λ_v^2 / 2 + λ_x v
    assert solution.multipliers.initial["v"] == pytest.approx(6.0, abs=error)  # λ(0) + ν_0 = 0
    assert solution.multipliers.final["x"] == pytest.approx(-12.0, abs=error)  # λ(T) = ν


@pytest.mark.parametrize(
    "scheme", [HermiteSimpson(), LegendreGaussLobatto(3), RadauIIA(3)], ids=lambda scheme: scheme.name
)
def test_a_limit_of_a_state_makes_the_costate_jump_by_its_multiplier(scheme: Scheme) -> None:
    solution = solve(bryson_denham(), 28, scheme=scheme)  # nodes at t = 3 L and 1 - 3 L, where the arc begins and ends
    times, costate = solution.point_times, solution.multipliers.dynamics["x"]
    jump = 2.0 / (9.0 * WALL**2)
    assert np.allclose(costate[times < 0.3], jump, rtol=2e-3)
    assert np.allclose(costate[times > 0.7], -jump, rtol=2e-3)
    bound, d = solution.multipliers.states["x"], np.diff(solution.t)
    assert (bound > -1e-6).all()
    inside = bound[:, 1:-1].mean(axis=1) if bound.shape[1] > 2 else 0.0
    assert float((inside * d).sum()) < 0.05 * jump  # it acts at the two ends of the arc
    assert np.ptp(solution.hamiltonian[2:-2]) < 0.3


def _spring(limit: float = 0.7, mass: float = 1.3) -> tuple[OptimalControlProblem, list[str]]:
    """A nonlinear problem in which a parameter stands everywhere, and every kind of limit is active."""
    ocp = OptimalControlProblem("spring")
    x, v = ocp.state("x", lower=-0.05), ocp.state("v")
    u = ocp.control("u", lower=-4.0, upper=4.0)
    m, a, b, c = (ocp.parameter(name, value) for name, value in
                  (("mass", mass), ("start", 0.3), ("limit", limit), ("share", 0.2)))  # fmt: skip
    T = ocp.free_duration(guess=1.0, lower=0.3, upper=5.0)
    ocp.minimise(running=1.0 + c * u**2, terminal=m * v**2 / 5 + 0.1 * T)
    ocp.dynamics(x, v)
    ocp.dynamics(v, (u - ca.sin(x)) / m)
    ocp.constrain(v - b, upper=0.0, name="speed")
    ocp.start(x, a)
    ocp.start(v, 0.0)
    ocp.end(x, 1.0)
    ocp.end_constraint(v - c, upper=0.0, name="slow")
    return ocp, ["mass", "start", "limit", "share"]


def test_sensitivities_are_finite_differences_of_solves() -> None:
    ocp, names = _spring()
    problem = ocp.functions()
    solution = solve(problem, 12)
    assert solution.ok
    assert solution.sensitivities.names == tuple(names)
    for name in names:
        h, value = 1e-4, float(problem.nominal[names.index(name)])
        above, below = (solve(problem, 12, parameters=problem.values(**{name: value + s})).cost for s in (h, -h))
        assert solution.sensitivities[name] == pytest.approx((above - below) / (2.0 * h), rel=1e-4, abs=1e-6), name
    limit = solution.multipliers.path["speed"]
    share = np.diff(solution.t)[:, None] * np.array([1.0, 4.0, 1.0]) / 6.0
    assert -float((limit * share).sum()) == pytest.approx(float(solution.sensitivities["limit"]), rel=1e-6)


def test_bounds_of_controls_and_of_the_duration_have_multipliers() -> None:
    solution = solve(double_integrator_time(), 21)
    pushes = solution.multipliers.controls["u"]
    assert (pushes[:8] > 0.01).all()  # u = 1 at first
    assert (pushes[-8:] < -0.01).all()
    assert np.abs(pushes + solution.multipliers.dynamics["v"])[:8].max() < 1e-6  # H_u + μ_u = 0
    ocp, x, u = integrator("in time", guess=(0.0, 1.0))
    ocp.free_duration(guess=0.8, lower=0.1, upper=1.0)
    ocp.minimise(running=u**2)
    ocp.end(x, 1.0)
    assert solve(ocp.functions(), 5).multipliers.duration == pytest.approx(1.0, abs=1e-6)  # J = 1 / T


def test_constraints_are_named_by_what_they_constrain() -> None:
    multipliers = solve(_spring()[0].functions(), 6).multipliers
    assert multipliers.path.names == ("speed",)
    assert multipliers.initial.names == ("x", "v")
    assert multipliers.final.names == ("x", "slow")
    with pytest.raises(KeyError, match="allowed: x, v"):
        multipliers.states["w"]
    assert "end x" in repr(multipliers)
    assert "mass" in repr(solve(_spring()[0].functions(), 6).sensitivities)


def _vector() -> Solution:
    ocp = OptimalControlProblem("vector")
    x, y, u = ocp.state("r[0]"), ocp.state("r[1]"), ocp.control("u[0]")
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(x, y)
    ocp.dynamics(y, u)
    ocp.start(x, 0.0)
    ocp.start(y, 0.0)
    ocp.end(x, 1.0)
    return solve(ocp.functions(), 5)


def test_a_solution_is_read_by_name_at_nodes_and_at_any_time() -> None:
    solution = _vector()
    assert solution["r"].shape == (5, 2)
    assert solution["u"].shape == (5, 1)
    assert np.array_equal(solution["r[1]"], solution.x[:, 1])
    assert solution("r", 0.3).shape == (2,)
    assert solution("r", [0.1, 0.2, 0.3]).shape == (3, 2)
    assert solution("r[0]", 0.3) == solution.state(0.3)[0]
    assert solution("u[0]", np.array([0.1])) == solution.control(0.1)
    assert solution.multipliers.dynamics["r"].shape == (4, 3, 2)
    with pytest.raises(KeyError, match="no state or control"):
        solution("s", 0.0)
