"""Pontryagin's conditions, judged along direct solutions: what holds, what does not, and what cannot be judged."""

from __future__ import annotations

import dataclasses
import math
import re

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.multipliers import NamedValues
from mathnavi.controllers.ocp.optimality_conditions import ConditionVerdict, PontryaginCheck
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.pontryagin import check_pontryagin
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.articles import double_integrator_time
from mathnavi.controllers.ocp.problems.bryson_ho import bryson_denham
from mathnavi.controllers.ocp.problems.cops import goddard
from mathnavi.controllers.ocp.replay import judged
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.transcriptions.collocation import LegendreGaussLobatto, RadauIIA
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from tests.controllers.ocp.statements import double_integrator

SCHEMES = (HermiteSimpson(), LegendreGaussLobatto(3), RadauIIA(3))


def verdicts(found: PontryaginCheck) -> dict[str, str]:
    return {condition.name: condition.verdict.value for condition in found.conditions}


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)
def test_a_limit_of_a_state_that_holds_is_judged_by_the_jumps_of_its_costate(scheme: Scheme) -> None:
    found = check_pontryagin(solve(bryson_denham(), 28, scheme=scheme), tolerance=1e-3)
    assert set(verdicts(found).values()) == {"holds"}
    assert {
        "dynamics",
        "adjoint",
        "stationarity",
        "minimum",
        "convexity",
        "Hamiltonian",
        "start",
        "end",
        "signs",
    } == set(verdicts(found))


@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)
def test_a_control_that_switches_follows_the_sign_of_its_switching_function(scheme: Scheme) -> None:
    found = check_pontryagin(solve(double_integrator_time(), 31, scheme=scheme))
    assert found.holds
    assert not found.not_judged
    assert found["duration"].verdict is ConditionVerdict.HOLDS
    assert found["stationarity"].residual < 1e-6
    assert found["minimum"].residual < 1e-6


def test_a_limited_end_and_a_limited_duration_are_judged() -> None:
    ocp, x, v, u = double_integrator("limited", guess=(0.0, 1.0))
    ocp.free_duration(guess=0.8, lower=0.1, upper=1.5)
    ocp.minimise(running=u**2 / 2)
    ocp.constrain(u + x, upper=3.0, name="sum")
    ocp.end(x, 1.0)
    ocp.end_constraint(v, lower=-math.inf, upper=0.7, name="slow")
    solution = solve(ocp.functions(), 15)
    found = check_pontryagin(solution)
    assert found.holds, found
    assert found["minimum over u"].reason == "a path constraint limits the controls"
    assert solution.multipliers.final["slow"] > 0.1
    assert solution.multipliers.duration > 0.1


def test_an_arc_on_a_limit_of_a_state_is_not_singular() -> None:
    ocp, x, v, _ = double_integrator("speed limit", 1.0, guess=(0.0, 3.0))
    ocp.minimise(terminal=ocp.free_duration(guess=4.0, lower=0.5, upper=20.0))
    ocp.constrain(v + 0.0 * x, upper=1.25, name="limit")
    ocp.end(ca.vertcat(x, v), [3.0, 0.0])
    found = check_pontryagin(solve(ocp.functions(), 31), tolerance=0.05)
    assert found.holds, found
    assert not found.not_judged


def test_goddard_says_what_cannot_be_judged() -> None:
    found = check_pontryagin(solve(goddard(), 40), tolerance=0.1)
    reasons = {condition.name.split(" of F from")[0]: condition.reason for condition in found.not_judged}
    assert reasons["minimum on the singular arc"] == "H does not depend on F there"
    assert reasons["multipliers of m and F apart"].startswith("m and F are on their bounds at once")
    names = [name.split(" on the singular")[0] for name in verdicts(found)]
    assert "d(H_u)/dt = 0" in names
    assert verdicts(found)[next(name for name in verdicts(found) if name.startswith("Kelley"))] == "holds"
    assert "not judged" in repr(found)


def test_a_singular_arc_of_several_linear_controls_is_not_judged() -> None:
    ocp = OptimalControlProblem("two linear controls")
    x, y = ocp.state("x"), ocp.state("y")
    a, b = (ocp.control(name, lower=-1.0, upper=1.0) for name in "ab")
    ocp.duration(2.0)
    ocp.minimise(running=x**2 + y**2)
    ocp.dynamics(x, a)
    ocp.dynamics(y, b)
    ocp.start(x, 0.5)
    ocp.start(y, -0.5)
    found = check_pontryagin(solve(ocp.functions(), 25))
    assert any(condition.reason == "several controls are linear in H" for condition in found.not_judged)


@pytest.fixture(scope="module")
def swing() -> Solution:
    ocp = OptimalControlProblem("swing")
    a, w, u = ocp.state("a", guess=(0.0, 1.0)), ocp.state("w"), ocp.control("u", lower=-5.0, upper=5.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2 + ocp.t * a**2)
    ocp.dynamics(a, w)
    ocp.dynamics(w, u - ca.sin(a))
    for state, end in ((a, 1.0), (w, 0.0)):
        ocp.start(state, 0.0)
        ocp.end(state, end)
    return solve(ocp.functions(), 25)


def test_every_condition_is_violated_by_something(swing: Solution) -> None:
    """The check is no tautology: each condition fails where just what it is about is spoilt."""
    assert check_pontryagin(swing, tolerance=1e-3).holds
    m = swing.multipliers

    def spoilt(**changes: object) -> set[str]:
        found = check_pontryagin(dataclasses.replace(swing, **changes), tolerance=1e-3)  # type: ignore[arg-type]
        return {name for name, verdict in verdicts(found).items() if verdict == "violated"}

    def with_costates(values: np.ndarray) -> object:
        return dataclasses.replace(m, dynamics=NamedValues(m.dynamics.names, values))

    tilted = m.dynamics.values * (1.0 + 0.1 * swing.point_times[:, :, None])
    assert {"adjoint", "end", "Hamiltonian", "stationarity"} <= spoilt(multipliers=with_costates(tilted))
    assert {"stationarity", "convexity"} & spoilt(multipliers=with_costates(-m.dynamics.values))
    assert spoilt(u=swing.u + 0.2) >= {"stationarity", "minimum"}
    wrong_end = dataclasses.replace(m, final=NamedValues(m.final.names, 1.1 * m.final.values))
    assert spoilt(multipliers=wrong_end) == {"end"}
    wrong_start = dataclasses.replace(m, initial=NamedValues(m.initial.names, 1.1 * m.initial.values))
    assert spoilt(multipliers=wrong_start) == {"start"}
    wrong_sign = dataclasses.replace(m, states=NamedValues(m.states.names, m.states.values + 1e-2))
    assert "signs" in spoilt(multipliers=wrong_sign)


def test_all_witnesses_show_the_same_figures(swing: Solution) -> None:
    """A replay that misses violates x' = f: in the check, the table of the solution and its figure."""
    assert swing.replay is not None
    assert swing.conditions is not None
    assert swing.conditions["dynamics"].residual == swing.replay.miss
    assert swing.conditions.summary == "9 hold"
    assert re.search(r"Pontryagin +9 hold", repr(swing))
    off = judged(dataclasses.replace(swing, replay=dataclasses.replace(swing.replay, miss=0.28)), 1e-3)
    found = check_pontryagin(off)
    assert off.status is SolverOutcome.CONVERGED
    assert "miss 0.28" in off.message
    assert [str(each) for each in found.violated] == ["dynamics violated, 2.8e-01"]
    assert not found.holds
    assert "dynamics violated, 2.8e-01" in repr(off)
    figure = off.plot("u")
    assert "dynamics violated, 2.8e-01" in figure.get_suptitle()
    (note,) = figure.axes[-2].texts
    assert str(found["Hamiltonian"]) in note.get_text()
    assert found["Hamiltonian"].residual < 1e-3


def test_what_has_no_conditions_is_refused(swing: Solution) -> None:
    with pytest.raises(ValueError, match="holds its control"):
        check_pontryagin(solve(swing.problem, 25, scheme=Euler()))
    failed = dataclasses.replace(swing, status=next(s for s in type(swing.status) if s.name == "INFEASIBLE"))
    with pytest.raises(ValueError, match="failed"):
        check_pontryagin(failed)
    with pytest.raises(KeyError, match="allowed: dynamics, adjoint"):
        check_pontryagin(swing)["costates"]


def test_the_ends_of_a_phase_are_judged_with_all_phases_and_its_clock_is_no_control() -> None:
    """Two phases at a speed of at most 1, whose boundary is free: each has a clock."""
    problem = MultiPhaseProblem("there and back")
    there, back = problem.phase("there"), problem.phase("back")
    for phase in (there, back):
        x, u = phase.state("x"), phase.control("u", lower=-1.0, upper=1.0)
        phase.dynamics(x, u)
        phase.minimise(terminal=phase.free_duration(guess=1.0))
        phase.end(x, 2.0 if phase is there else 0.0)
        if phase is there:
            phase.start(x, 0.0)
    problem.link(there, back)
    found = problem.solve()
    assert found.cost == pytest.approx(4.0, rel=1e-6)
    assert check_pontryagin(found.stacked).holds
    for phase in found.phases.values():
        check = check_pontryagin(phase)
        assert check.holds
        assert [each.name for each in check.not_judged] == ["start", "end"]
