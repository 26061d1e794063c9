"""Automatic scales: what is noise, where a scale comes from, and that units of states, rows and J do not matter."""

from __future__ import annotations

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.grid import uniform
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.models.nlp_solver import NlpReport, NlpSolver, Watch
from tests.controllers.ocp.statements import double_integrator, integrator

ROUNDING = math.sin(math.pi)  # 1.2e-16


def transfer(limit: float = 10.0, end: float = 0.0, **guesses: Any) -> OptimalControlProblem:
    """From rest at 0 to 1 in a second with the least ∫ u^2, which is 12."""
    ocp, x, v, u = double_integrator(limit=limit)
    for name, guess in guesses.items():
        ocp.guess({"x": x, "v": v, "u": u}[name], guess)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.end(x, 1.0)
    ocp.end(v, end)
    return ocp


@pytest.mark.parametrize(
    "stated",
    [{"u": (0.0, ROUNDING)}, {"v": (0.0, ROUNDING)}, {"end": ROUNDING}, {"u": (ROUNDING, 0.0), "limit": math.inf}],
)
def test_rounding_noise_is_no_magnitude(stated: dict[str, Any]) -> None:
    ocp = transfer(**stated)
    assert min(ocp.scaling().values()) == 1.0
    solution = ocp.solve()
    assert solution.status is SolverOutcome.OPTIMAL
    assert solution.cost == pytest.approx(12.0, rel=1e-9)


def test_a_rate_of_rounding_noise_says_nothing_of_its_state() -> None:
    """East at a heading of north: y' = v cos ψ is 1e-15 along the guess, and a turn makes it of the size of v."""
    ocp = OptimalControlProblem("heading")
    y, psi, u = ocp.state("y"), ocp.state("psi", guess=math.pi / 2), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(10.0)
    ocp.dynamics(ca.vertcat(y, psi), ca.vertcat(5.0 * ca.cos(psi), u))
    ocp.minimise(terminal=-y)
    scaling = ocp.scaling()
    assert scaling["y"] == pytest.approx(50.0 * math.pi / 2)
    assert scaling.cost.value == 1.0


def test_a_constant_has_the_scale_that_moves_a_state_by_its_own() -> None:
    """θ of y' = -θ y over a day: 1 / 86,400 decays y by all of it, and 1 would make the guess stiff."""
    ocp = OptimalControlProblem("decay over a day")
    y, theta = ocp.state("y"), ocp.unknown("theta", lower=0.0)
    ocp.duration(86400.0)
    ocp.dynamics(y, -theta * y)
    ocp.start(y, 100.0)
    ocp.guess(y, (100.0, 50.0))
    ocp.minimise(terminal=(y - 37.0) ** 2)
    assert ocp.scaling()["theta"] == pytest.approx(1 / 86400.0)
    assert ocp.scaling().origins["theta"] == "derivative"
    solution = ocp.solve(15)
    assert solution["theta"][0] == pytest.approx(math.log(100.0 / 37.0) / 86400.0, rel=1e-6)


def test_a_state_of_a_phase_that_no_number_describes_has_the_scale_of_another_phase() -> None:
    problem = MultiPhaseProblem("burn, then coast")
    burn, coast = problem.phase("burn"), problem.phase("coast")
    for phase, rate in ((burn, 5.0), (coast, 0.0)):
        v, m = phase.state("v"), phase.state("m", guess=2.0 if rate else 1.0)
        phase.dynamics(v, rate + 1e-5)
        phase.dynamics(m, 0.0)
        phase.duration(10.0)
    problem.link(burn, coast)
    scaling = problem.scaling()
    assert scaling["coast.v"] == pytest.approx(50.0, rel=1e-3)
    assert scaling["coast.v(0)"] == scaling["coast.v"]
    assert [scaling["burn.m"], scaling["coast.m"]] == [2.0, 1.0]  # as guessed
    assert scaling.origins["coast.v"] == "derivative of burn.v"
    assert repr(scaling).startswith("Scales of 'burn, then coast'")


def test_a_cost_that_nothing_changes_keeps_its_own_scale() -> None:
    """All ways of constant speed cost the same, and what is left of the slopes is rounding noise."""
    ocp = OptimalControlProblem("constant speed")
    x, y, theta = ocp.state("x", guess=(0.0, 1.0)), ocp.state("y"), ocp.control("theta", lower=-9.0, upper=9.0)
    dx, dy = 2.138 * ca.cos(theta), 2.138 * ca.sin(theta)
    ocp.duration(1.0)
    ocp.dynamics(ca.vertcat(x, y), ca.vertcat(dx, dy))
    ocp.minimise(running=dx**2 + dy**2)
    ocp.start(ca.vertcat(x, y), 0.0)
    ocp.end(ca.vertcat(x, y), [1.0, 0.5])
    ocp.guess(theta, lambda t: 0.7 + math.sin(9.0 * t))
    assert ocp.scaling().cost.value == 1.0
    solution = ocp.solve()
    assert solution.status is SolverOutcome.OPTIMAL
    assert solution.cost == pytest.approx(2.138**2)


def test_the_components_of_a_vector_share_the_largest_scale() -> None:
    ocp = OptimalControlProblem("vectors")
    r, u = ocp.state("r", 3, guess=[7e6, 0.0, 7e6 * math.cos(math.pi / 2)]), ocp.control("u", 2)
    ocp.guess(u, [3.0, ROUNDING])
    single = ocp.state("single", guess=2.0)
    ocp.duration(1.0)
    ocp.dynamics(r, ca.vertcat(u, 0.0))
    ocp.dynamics(single, 0.0)
    scaling = ocp.scaling()
    assert [scaling[f"r[{k}]"] for k in range(3)] == [7e6] * 3
    assert [scaling["u[0]"], scaling["u[1]"], scaling["single"]] == [3.0, 3.0, 2.0]
    assert scaling.origins["r[1]"] == "guess of r[0]"


def test_a_table_says_where_each_scale_comes_from() -> None:
    ocp, x, v, u = double_integrator("landing", 4.0, guess=(300.0, 0.0))
    m, idle = ocp.state("m", scale=7.0), ocp.state("idle")
    ocp.dynamics(ca.vertcat(m, idle), ca.vertcat(-ca.fabs(u), 0.0))
    w = ocp.control("w", upper=-9.0)
    ocp.free_duration(guess=5.0)
    ocp.minimise(terminal=-1e6 * m)
    ocp.constrain(x**2 >= v**2, name="cone")
    ocp.constrain(x + w <= 400.0, name="roof")
    ocp.start_constraint(m <= 7.0, name="fuel")
    scaling = ocp.scaling()
    assert scaling.origins == {
        "x": "guess", "v": "derivative", "m": "stated", "idle": "nothing known", "u": "bounds", "w": "bounds",
        "T": "guess",
    }  # fmt: skip
    assert scaling == {"x": 300.0, "v": 20.0, "m": 7.0, "idle": 1.0, "u": 4.0, "w": 9.0, "T": 5.0}
    assert (scaling.cost.value, scaling.cost.origin) == (1e5, "derivative")
    shown = [line.split() for line in repr(scaling).splitlines()]
    assert ["m", "7", "stated"] in shown
    assert ["J", "1e+05", "derivative"] in shown
    assert ["cone", "1e+05", "derivative"] in shown
    assert ["fuel", "1", "ordinary", "size"] in shown
    assert scaling._repr_html_().startswith("<b>")
    with pytest.raises(KeyError, match="z"):
        scaling["z"]


def test_decay_and_oscillation_end_the_reach_of_a_rate() -> None:
    """x' = 2 - 100 x reaches 0.02 and not 2 T; of q'' = 9 - 9 q it is a third of the greatest speed, 3."""
    ocp = OptimalControlProblem("fast and slow")
    x, q, s = ocp.state("x"), ocp.state("q"), ocp.state("s")
    u = ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(1000.0)
    ocp.dynamics(ca.vertcat(x, q, s), ca.vertcat(2.0 * u - 100.0 * x, s, 9.0 * u - 9.0 * q))
    scaling = ocp.scaling()
    assert scaling["x"] == pytest.approx(0.02)
    assert scaling["s"] == pytest.approx(3.0)


def braking(unit: float, of_cost: float, of_rows: float) -> Solution:
    ocp, x, u = integrator("braking", guess=(0.0, unit))
    ocp.guess(u, unit)
    y = ocp.state("y")
    ocp.dynamics(y, (x / unit) ** 2 - y)
    ocp.start(y, 0.0)
    ocp.duration(1.0)
    ocp.minimise(running=of_cost * ((u / unit) ** 2 + y**2))
    ocp.end(x, unit)
    ocp.constrain(of_rows * (x / unit + y) >= of_rows * 0.2 * ocp.t, name="floor")
    ocp.constrain(of_rows * (x / unit) <= of_rows * (0.1 + ocp.t**2), name="roof")
    return ocp.solve(15)


@pytest.mark.parametrize(
    ("unit", "of_cost", "of_rows"), [(1e-9, 1.0, 1.0), (1e8, 1.0, 1.0), (1.0, 1e-8, 1.0), (1.0, 1e8, 1.0),
                                     (1.0, 1.0, 1e-8), (1.0, 1.0, 1e8), (1e7, 1e-7, 1e6)],
)  # fmt: skip
def test_units_of_states_cost_and_constraints_do_not_matter(unit: float, of_cost: float, of_rows: float) -> None:
    plain, scaled = braking(1.0, 1.0, 1.0), braking(unit, of_cost, of_rows)
    assert plain.status is SolverOutcome.OPTIMAL
    assert scaled.status is plain.status
    assert scaled.cost / of_cost == pytest.approx(plain.cost, rel=1e-7)
    np.testing.assert_allclose(scaled["x"] / unit, plain["x"], atol=1e-6)
    np.testing.assert_allclose(scaled.costates[:, 1] / of_cost, plain.costates[:, 1], atol=1e-5)
    own = [np.abs(each.multipliers.path.values).max() for each in (scaled, plain)]
    assert own[0] * of_rows / of_cost == pytest.approx(own[1], rel=1e-4)


def test_a_cost_in_small_units_is_as_accurate_as_in_others() -> None:
    def solved(factor: float) -> Solution:
        ocp = OptimalControlProblem("van der Pol")
        x, y, u = ocp.state("x"), ocp.state("y", guess=(1.0, 0.0)), ocp.control("u", upper=0.75)
        ocp.duration(5.0)
        ocp.minimise(running=factor * (x**2 + y**2 + u**2))
        ocp.dynamics(ca.vertcat(x, y), ca.vertcat((1 - y**2) * x - y + u, x))
        ocp.start(ca.vertcat(x, y), [0.0, 1.0])
        return ocp.solve()

    plain, small = solved(1.0), solved(1e-6)
    assert small.status is SolverOutcome.OPTIMAL
    assert small.cost * 1e6 == pytest.approx(plain.cost, rel=1e-6)


def test_limits_far_from_any_solution_do_not_cost_accuracy() -> None:
    solution = transfer(limit=1e6).solve(15)
    assert solution.status is SolverOutcome.OPTIMAL
    assert solution.cost == pytest.approx(12.0, rel=1e-6)


def test_a_solution_on_another_mesh_says_how_large_the_cost_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """J = 12 is a millionth of what a change of u by its scale, 1e3, makes of it: solved twice, but only once more."""
    solves: list[NlpSolver] = []
    own = NlpSolver.solve

    def counted(self: NlpSolver, watch: Watch | None = None) -> NlpReport:
        solves.append(self)
        return own(self, watch)

    monkeypatch.setattr(NlpSolver, "solve", counted)
    ocp, x, v, u = double_integrator(limit=1e4)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.end(x, 1.0)
    ocp.end(v, 0.0)
    problem = ocp.functions()
    first = transcription(problem, RadauIIA(3), 11).solve()
    assert len(solves) == 2
    assert transcription(problem, RadauIIA(3), 13).solve(first, uniform(13)).cost == pytest.approx(12.0, rel=1e-6)
    assert len(solves) == 3
