"""Costs and constraints at given times: exact in the programme, flown in the replay, refused where they cannot be."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from mathnavi.controllers.ocp.grid import Grid
from mathnavi.controllers.ocp.indirect import solve_indirect
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.pontryagin import check_pontryagin
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.saved_solution import load_solution
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.controllers.ocp.solver import Options
from mathnavi.interfaces.errors import ProblemError

TIMES = np.arange(25) / 4.0  # [s]
READINGS = 3.0 * np.exp(-0.7 * TIMES) + 0.05 * np.cos(9.0 * TIMES)


def decay() -> OptimalControlProblem:
    """x' = -k x, with k and x(0) to be found."""
    ocp = OptimalControlProblem("decay")
    x, k = ocp.state("x", guess=1.0), ocp.unknown("k", lower=0.0, upper=5.0, guess=0.3)
    ocp.duration(6.0)
    ocp.dynamics(x, -k * x)
    for t, reading in zip(TIMES, READINGS, strict=True):
        ocp.at(t).minimise((x - reading) ** 2)
    return ocp


def least_squares() -> tuple[float, float]:
    """k and the sum of squares: x(0) is linear, so it is the zero of one function of k."""

    def rest(k: float) -> float:
        basis = np.exp(-k * TIMES)
        return float(((basis * (basis @ READINGS) / (basis @ basis) - READINGS) ** 2).sum())

    found = minimize_scalar(rest, bounds=(0.3, 1.5), method="bounded", options={"xatol": 1e-12})
    return float(found.x), float(found.fun)


@pytest.mark.parametrize("nodes", [None, 40])
def test_readings_at_given_times_are_fitted(nodes: int | None) -> None:
    found, (k, rest) = decay().solve(nodes), least_squares()
    assert found.ok
    assert found.cost == pytest.approx(rest, abs=1e-7)
    assert found["k"][0] == pytest.approx(k, abs=1e-6)
    np.testing.assert_allclose(found.t[found.instant_nodes], TIMES, atol=1e-9)
    assert found.replay is not None
    assert found.replay.cost == pytest.approx(found.cost, abs=1e-7)


def test_pinene_is_fitted_without_a_phase_for_each_reading() -> None:
    """COPS 3, α-pinene: the isomerisation's five rates from five concentrations [%] at eight times [min]."""
    times = [1230.0, 3060.0, 4920.0, 7800.0, 10680.0, 15030.0, 22620.0, 36420.0]
    readings = np.array(
        [
            [88.35, 7.3, 2.3, 0.4, 1.75], [76.4, 15.6, 4.5, 0.7, 2.8], [65.1, 23.1, 5.3, 1.1, 5.8],
            [50.4, 32.9, 6.0, 1.5, 9.3], [37.5, 42.7, 6.0, 1.9, 12.0], [25.9, 49.1, 5.9, 2.2, 17.0],
            [14.0, 57.4, 5.1, 2.6, 21.0], [4.5, 63.1, 3.8, 2.9, 25.7],
        ]
    )  # fmt: skip
    ocp = OptimalControlProblem("pinene")
    y, k = ocp.state("y", 5, scale=100.0), ocp.unknown("k", 5, lower=0.0, scale=1e-4, guess=5e-5)
    ocp.duration(times[-1])
    ocp.dynamics(
        y,
        ca.vertcat(
            -(k[0] + k[1]) * y[0],
            k[0] * y[0],
            k[1] * y[0] - (k[2] + k[3]) * y[2] + k[4] * y[4],
            k[2] * y[2],
            k[3] * y[2] - k[4] * y[4],
        ),
    )
    ocp.start(y, [100.0, 0.0, 0.0, 0.0, 0.0])
    ocp.guess(y, np.vstack([[100.0, 0.0, 0.0, 0.0, 0.0], readings]), times=[0.0, *times])
    for time, reading in zip(times, readings, strict=True):
        ocp.at(time).minimise(ca.sumsqr(y - reading))
    found = ocp.solve()
    assert found.ok
    assert found.cost == pytest.approx(19.872166923, rel=1e-7)


def via(state: float = 1.0) -> OptimalControlProblem:
    """From rest at 0 to rest at 0 in 2 s, through x(0.7) = ``state``."""
    ocp = OptimalControlProblem("via")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u")
    ocp.duration(2.0)
    ocp.minimise(running=u**2)
    ocp.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))
    ocp.start(ca.vertcat(x, v), 0.0)
    ocp.end(ca.vertcat(x, v), 0.0)
    ocp.at(0.7).constrain(x == state, name="via")
    return ocp


def in_two_phases() -> float:
    """The same through the end of a first phase: its least J."""
    problem = MultiPhaseProblem("via")
    ends = []
    for name, T in (("before", 0.7), ("after", 1.3)):
        phase = problem.phase(name)
        x, v, u = phase.state("x"), phase.state("v"), phase.control("u")
        phase.duration(T)
        phase.minimise(running=u**2)
        phase.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))
        ends.append((phase, x, v))
    (before, x, v), (after, *last) = ends
    before.start(ca.vertcat(x, v), 0.0)
    before.end(x, 1.0)
    after.end(ca.vertcat(*last), 0.0)
    problem.link(before, after)
    return problem.solve(5).cost


@pytest.mark.parametrize("how", [{}, {"nodes": 21}, {"method": "redistribute"}, {"method": "refine"}])
def test_a_point_is_passed_on_time_by_every_method(how: dict[str, Any]) -> None:
    found = via().solve(**how)
    assert found.ok
    assert found("x", 0.7) == pytest.approx(1.0, abs=1e-9)
    assert found.cost == pytest.approx(in_two_phases(), rel=1e-9)


def test_a_phase_counts_from_its_own_start_and_shares_what_is_unknown() -> None:
    problem = MultiPhaseProblem("decay in two")
    k = problem.unknown("k", guess=0.3, lower=0.0, upper=5.0)
    phases = problem.phase("a"), problem.phase("b")
    for phase, begin in zip(phases, (0.0, 3.0), strict=True):
        x = phase.state("x", guess=1.0)
        phase.duration(3.0)
        phase.dynamics(x, -k * x)
        for t, reading in zip(TIMES, READINGS, strict=True):
            if begin <= t < begin + 3.0 or t == 6.0 == begin + 3.0:
                phase.at(t - begin).minimise((x - reading + 0.0 * phase.t) ** 2)
    problem.link(*phases)
    found, (k_best, rest) = problem.solve(25), least_squares()
    assert found.ok
    assert found.cost == pytest.approx(rest, abs=1e-7)
    assert found.unknowns["k"] == pytest.approx(k_best, abs=1e-6)
    assert found["a"].cost + found["b"].cost == pytest.approx(found.cost, abs=1e-9)


@pytest.mark.parametrize("nodes", [None, 60])
def test_pontryagins_conditions_hold_with_the_jumps_of_the_costate(nodes: int | None) -> None:
    found = decay().solve(nodes)
    assert check_pontryagin(found).holds
    found = via().solve(nodes)
    checked = check_pontryagin(found)
    assert checked.holds
    assert not checked.not_judged
    # λ_x is constant on either side, and what J costs per metre of the point is its fall.
    node, multiplier = int(found.instant_nodes[0]), found.multipliers.instants
    assert multiplier is not None
    assert found.costates[node - 1, 0] - found.costates[node, 0] == pytest.approx(multiplier["via at 0.7 s"])
    more, less = (via(1.0 + shift).solve(nodes).cost for shift in (1e-3, -1e-3))
    assert (more - less) / 2e-3 == pytest.approx(-multiplier["via at 0.7 s"], rel=1e-6)


def test_a_saved_solution_has_what_was_stated_at_a_time(tmp_path: Path) -> None:
    solution = via().solve(5)
    kept = load_solution(solution.save(tmp_path / "via.npz"))
    assert kept.problem.breaks == solution.problem.breaks == (0.35,)
    for shown in (via(), kept.problem):
        assert "via at 0.7 s = 1" in " ".join(repr(shown).split())
    again = replayed(kept)
    assert again.replay is not None
    assert solution.replay is not None
    assert again.replay.figures == solution.replay.figures


def test_what_cannot_hold_at_a_time_is_named() -> None:
    ocp = via(state=9.0)
    ocp.constrain(ocp.bounded(-1, ocp.statement.controls[0].symbol, 1))
    assert "via at 0.7 s" in ocp.solve(9).message


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda ocp, x, u: ocp.at(-1.0), "via: at(-1.0); allowed: a time >= 0 s since the start"),
        (lambda ocp, x, u: ocp.at("noon"), "via: at() = 'noon'; allowed: a number"),
        (lambda ocp, x, u: ocp.at(1.0).minimise(u**2), "at 1 s: cost depends on u: a control may jump at a node;"),
        (lambda ocp, x, u: ocp.at(1.0).constrain(x + u <= 1), "depends on u: a control may jump"),
        (lambda ocp, x, u: ocp.at(1.0).minimise(ca.SX.sym("z")), "at 1 s: cost depends on z, which is not among"),
        (lambda ocp, x, u: ocp.at(1.0).minimise(ca.vertcat(x, x)), "at 1 s: cost of shape (2, 1); allowed: one"),
        (lambda ocp, x, u: [ocp.at(2.5).minimise(x), ocp.solve(5)], "via: at(2.5); allowed: 0 to 2 s, the duration"),
        (lambda ocp, x, u: solve_indirect(ocp.solve(5)), "via: at() makes costates jump; allowed: problems without"),
        (lambda ocp, x, u: ocp.solve(2), "via: nodes = 2; allowed: at least 3, one at each of the 1 times of at()"),
        (lambda ocp, x, u: ocp.solve(9, method="distribute"), "via: at() with nodes that are unknowns; allowed"),
        (lambda ocp, x, u: solve(ocp.functions(), Grid(np.array([0.0, 0.5, 1.0]))), "grid: no node at 0.7 s, where"),
        (
            lambda ocp, x, u: ocp.solve(9, scheme="multiple shooting", options=Options(backend="fatrop")),
            "at() with backend = 'fatrop'; allowed: nodes that are given, and backend = 'ipopt'",
        ),
    ],
)  # fmt: skip
def test_what_cannot_be_stated_at_a_time_is_refused(wrong: Callable[..., Any], named: str) -> None:
    ocp = via()
    with pytest.raises(ProblemError, match=re.escape(named)) as refused:
        wrong(ocp, ocp.statement.states[0].symbol, ocp.statement.controls[0].symbol)
    assert "\n" not in str(refused.value)


def test_a_time_inside_of_a_free_duration_is_refused_with_the_way_out() -> None:
    ocp = OptimalControlProblem("free")
    x, u = ocp.state("x"), ocp.control("u")
    T = ocp.free_duration(guess=2.0, upper=9.0)
    ocp.minimise(running=u**2, terminal=T)
    ocp.dynamics(x, u)
    ocp.end(x, 1.0)
    ocp.at(0.0).constrain(x == 0)
    assert ocp.solve(9).status is SolverOutcome.OPTIMAL
    ocp.at(1.0).constrain(x == 0.2)
    with pytest.raises(ProblemError, match=re.escape("free: at(1): the duration is free; allowed: a duration that")):
        ocp.solve(9)
