"""Problems of several phases: the optimum does not depend on how they are cut, and linkages hold."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

import casadi as ca
import numpy as np
import pytest

from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.solution import SolverOutcome
from mathnavi.interfaces.errors import ProblemError

Begin = Callable[[OptimalControlProblem], Any]


def carried(phase: OptimalControlProblem, effort: float = 1.0) -> tuple[ca.SX, ca.SX, ca.SX]:
    """x'' = u, at a cost of ``effort`` u^2 / 2."""
    x, v, u = phase.state("x", guess=(0.0, 1.0)), phase.state("v"), phase.control("u")
    phase.minimise(running=effort * u**2 / 2)
    phase.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))
    return x, v, u


def cut(first: Begin, second: Begin) -> tuple[MultiPhaseProblem, OptimalControlProblem, OptimalControlProblem]:
    """From rest at 0 to rest at 1, in two phases."""
    problem = MultiPhaseProblem("cut in two")
    a, b = problem.phase("a"), problem.phase("b")
    x, v, _ = carried(a)
    a.start(ca.vertcat(x, v), 0.0)
    x, v, _ = carried(b)
    b.end(ca.vertcat(x, v), [1.0, 0.0])
    first(a), second(b)
    problem.link(a, b)
    return problem, a, b


def bare(problem: MultiPhaseProblem) -> OptimalControlProblem:
    """A phase more, without a state."""
    return problem.phase("bare")


def counting(problem: MultiPhaseProblem, name: str) -> OptimalControlProblem:
    """A phase more, with an integral."""
    phase = problem.phase(name)
    phase.integral(1, name="w")
    return phase


def test_the_optimum_does_not_depend_on_where_the_phases_are_cut() -> None:
    problem, _, _ = cut(lambda a: a.duration(0.3), lambda b: b.duration(0.7))
    found = problem.solve(9)
    assert found.ok
    assert found.cost == pytest.approx(6.0)
    t = np.linspace(0.0, 1.0, 11)
    x = np.array([found["a"].state(s)[0] if s < 0.3 else found["b"].state(s - 0.3)[0] for s in t])
    np.testing.assert_allclose(x, 3 * t**2 - 2 * t**3, atol=1e-6)
    assert found.start_times == {"a": 0.0, "b": pytest.approx(0.3)}
    assert found["a"].cost + found["b"].cost == pytest.approx(6.0)
    with pytest.raises(KeyError, match="0 is no phase"):
        found[0]  # type: ignore[index]
    for phase in ("a", "b"):
        assert found[phase].replay is not None
        assert found[phase].replay.miss < 1e-8  # type: ignore[union-attr]


def test_free_durations_are_found_with_a_sum() -> None:
    problem, a, b = cut(lambda a: a.free_duration(guess=0.5), lambda b: b.free_duration(guess=0.5))
    T_a, T_b = a.statement.final_time, b.statement.final_time
    problem.couple(T_a + T_b == 1.0)
    problem.couple(T_a <= 0.4, name="early")
    found = problem.solve(9)
    assert found.cost == pytest.approx(6.0)
    assert found.duration == pytest.approx(1.0)
    assert found["a"].duration <= 0.4 + 1e-8
    assert "coupling" not in repr(found)
    assert re.search(r"phase b +0\.\d+ to 1 +s", repr(found))


def test_an_event_in_the_interior_is_a_boundary() -> None:
    """Through x = 1.5 on the way from 0 to 1, at whatever time is best: J is above 6, and x(t_1) = 1.5."""
    problem, a, b = cut(
        lambda a: a.free_duration(guess=0.7, lower=0.1), lambda b: b.free_duration(guess=0.3, lower=0.1)
    )
    a.end(a.statement.states[0].symbol, 1.5)
    problem.couple(a.statement.final_time + b.statement.final_time, lower=1.0, upper=1.0)
    found = problem.solve(21)
    assert found.ok
    assert found["a"]["x"][-1] == found["b"]["x"][0] == pytest.approx(1.5)
    assert found["a"]["v"][-1] == pytest.approx(found["b"]["v"][0])
    assert found.cost > 6.0


def test_a_state_jumps_by_an_expression() -> None:
    """A ball that falls 1 m keeps 80 % of its speed in a bounce and rises to .64 m."""
    problem = MultiPhaseProblem("bounce")
    fall, rise = problem.phase("fall"), problem.phase("rise")
    g = problem.parameter("g", 9.81)
    for phase in (fall, rise):
        x, v = phase.state("x", guess=1.0), phase.state("v", guess=-1.0)
        phase.free_duration(guess=0.5, lower=0.1, upper=2.0)
        phase.dynamics(ca.vertcat(x, v), ca.vertcat(v, -g))
    (x, v), (_, v_rise) = ([s.symbol for s in phase.statement.states] for phase in (fall, rise))
    fall.start(x, 1.0), fall.start(v, 0.0), fall.end(x, 0.0), rise.end(v_rise, 0.0)
    problem.link(fall, rise, jumps={"v": -1.8 * v})
    found = problem.solve(5)
    assert found["rise"]["x"][-1] == pytest.approx(0.64)
    assert found["fall"].duration == pytest.approx(math.sqrt(2.0 / 9.81))
    assert found["rise"].replay.miss < 1e-8  # type: ignore[union-attr]
    moon = problem.solve(5, parameters={"g": 1.62}, guess=found)
    assert moon["fall"].duration == pytest.approx(math.sqrt(2.0 / 1.62))


def test_time_goes_on_from_phase_to_phase() -> None:
    problem = MultiPhaseProblem("clock")
    a, b = problem.phase("a"), problem.phase("b")
    for phase in (a, b):
        x = phase.state("x")
        phase.duration(1.0)
        phase.dynamics(x, ca.cos(phase.t))
    a.start_time(0.5)
    a.start(a.statement.states[0].symbol, 0.0)
    problem.link(a, b)
    found = problem.solve(9)
    assert found["b"]["x"][-1] == pytest.approx(math.sin(2.5) - math.sin(0.5))
    assert found.start_times == {"a": 0.5, "b": 1.5}
    assert found["b"].replay.miss < 1e-7  # type: ignore[union-attr]


def test_switches_of_two_phases_do_not_share_their_places() -> None:
    """A battery, charged and discharged about a price that peaks at noon, where the day is cut: a linear programme.

    Its closed form: charged by 40 MWh from midnight on and again up to midnight, discharged by 80 MWh about noon.
    """
    problem, efficiency, most = MultiPhaseProblem("cut at noon"), 0.92, 25.0
    phases = [problem.phase("am"), problem.phase("pm")]
    for phase, slope in zip(phases, (1.0, -1.0), strict=True):
        E = phase.state("E", lower=10.0, upper=90.0, guess=50.0)
        charge, discharge = (phase.control(name, lower=0.0, upper=most) for name in ("c", "d"))
        phase.duration(12.0)
        phase.minimise(running=(50.0 + 40.0 * (1.0 + slope * (phase.t - 12.0) / 6.0)) * (charge - discharge))
        phase.dynamics(E, efficiency * charge - discharge / efficiency)
    phases[0].start(phases[0].statement.states[0].symbol, 50.0)
    phases[1].end_constraint(phases[1].statement.states[0].symbol >= 50.0)
    problem.link(*phases)
    found = problem.solve()
    charging, selling = 40.0 / efficiency / most, 80.0 * efficiency / most / 2.0
    best = 2.0 * most * (10.0 * charging + 40.0 / 12.0 * charging**2)
    best -= most * (90.0 * 2.0 * selling - 40.0 / 6.0 * selling**2)
    assert found.ok
    assert found.cost == pytest.approx(best, rel=1e-7)
    for phase, switches in (("am", (charging, 12.0 - selling)), ("pm", (selling, 12.0 - charging))):
        assert np.abs(found[phase].t[:, None] - switches).min(axis=0) == pytest.approx([0.0, 0.0], abs=1e-5)
        assert found[phase].replay.error < 1e-6  # type: ignore[union-attr]
    assert found["am"].cost + found["pm"].cost == pytest.approx(best, rel=1e-7)
    again = problem.solve(method="hp", guess=found)
    assert again.cost == pytest.approx(best, rel=1e-7)


@pytest.mark.parametrize("fastest", [math.inf, 1.2])
def test_phases_with_arcs_of_their_own_numbers(fastest: float) -> None:
    """From rest to rest over a distance, |u| <= 1 and v at most ``fastest``, three times, in the least time."""
    problem, distances = MultiPhaseProblem("three ways"), (1.0, 3.0, 5.0)
    for k, distance in enumerate(distances):
        phase = problem.phase(f"{k}")
        x, v = phase.state("x", guess=(0.0, distance)), phase.state("v", upper=fastest)
        u = phase.control("u", lower=-1.0, upper=1.0)
        phase.minimise(terminal=phase.free_duration(guess=3.0, lower=0.1, upper=30.0))
        phase.dynamics(ca.vertcat(x, v), ca.vertcat(v, u))
        phase.start(ca.vertcat(x, v), 0.0), phase.end(ca.vertcat(x, v), [distance, 0.0])
    found = problem.solve()
    peaks = [min(fastest, math.sqrt(distance)) for distance in distances]
    assert found.ok
    for k, (distance, peak) in enumerate(zip(distances, peaks, strict=True)):
        assert found[f"{k}"].duration == pytest.approx(peak + distance / peak, rel=1e-8)


def handed_over(end: float | None, start: float) -> tuple[MultiPhaseProblem, OptimalControlProblem, Any]:
    """x' = u twice, x from 0 to ``end``, then from ``start`` to 6; not linked yet."""
    problem = MultiPhaseProblem("handed over")
    a, b = problem.phase("a"), problem.phase("b")
    for phase in (a, b):
        x, u = phase.state("x"), phase.control("u")
        phase.duration(1.0), phase.minimise(running=u**2), phase.dynamics(x, u)
    a.start(a.statement.states[0].symbol, 0.0)
    if end is not None:
        a.end(a.statement.states[0].symbol, end)
    b.start(b.statement.states[0].symbol, start), b.end(b.statement.states[0].symbol, 6.0)
    return problem, a, b


@pytest.mark.parametrize(("end", "jumps"), [(None, {}), (5.0, {}), (None, {"x": 4.0}), (1.0, {"x": 4.0})])
def test_a_linked_state_ends_where_the_next_phase_starts_it(end: float | None, jumps: dict[str, float]) -> None:
    problem, a, b = handed_over(end, 5.0)
    problem.link(a, b, jumps=jumps)
    found = problem.solve(5)
    assert found.ok
    assert found["b"]["x"][0] - found["a"]["x"][-1] == pytest.approx(jumps.get("x", 0.0))
    assert found.cost == pytest.approx(found["a"]["x"][-1] ** 2 + 1.0)


def test_a_link_to_a_start_that_contradicts_the_end_is_refused_or_has_no_solution() -> None:
    problem, a, b = handed_over(1.0, 5.0)
    with pytest.raises(ProblemError, match=r"a to b: x ends at 1 and starts at 5, jump 0; allowed: a jump of 4"):
        problem.link(a, b)
    problem, a, b = handed_over(None, 5.0)
    problem.link(a, b)
    a.end(a.statement.states[0].symbol, 1.0)
    with pytest.raises(ProblemError, match="3 equations at the end"):
        problem.solve(5)


def test_integrals_of_two_phases_have_the_same_name_and_are_not_linked() -> None:
    problem = MultiPhaseProblem("integrals")
    a, b = problem.phase("a"), problem.phase("b")
    for phase in (a, b):
        x = phase.state("x")
        phase.duration(1.0)
        phase.dynamics(x, 1.0)
        phase.integral(x)
    a.start(a.statement.states[0].symbol, 0.0)
    problem.link(a, b)
    found = problem.solve(5)
    assert found["a"]["integral 1"][[0, -1]] == pytest.approx([0.0, 0.5])
    assert found["b"]["integral 1"][[0, -1]] == pytest.approx([0.0, 1.5])


def test_a_phase_whose_duration_nothing_limits_is_unbounded() -> None:
    problem, _, b = cut(lambda a: a.duration(0.5), lambda b: b.free_duration(guess=1.0))
    b.statement.terminal = -b.statement.final_time
    found = problem.solve()
    assert {found.status, found["a"].status, found["b"].status} == {SolverOutcome.UNBOUNDED}
    assert not found.ok
    assert "b.duration ends at 1e+09 s, its default upper limit" in found.message


@pytest.mark.parametrize("method", ["redistribute", "refine"])
def test_phases_are_solved_by_every_method(method: Any) -> None:
    problem, _, _ = cut(lambda a: a.duration(0.3), lambda b: b.duration(0.7))
    assert problem.solve(9, method=method).cost == pytest.approx(6.0)


def test_a_path_constraint_belongs_to_its_phase() -> None:
    problem, _, b = cut(lambda a: a.duration(0.5), lambda b: b.duration(0.5))
    b.constrain(2 * b.statement.states[1].symbol <= 2.4, name="slow")
    found = problem.solve(9)
    assert found["a"]["v"].max() > 1.2 - 1e-6
    assert found["b"]["v"].max() <= 1.2 + 1e-6
    assert (found["a"].problem.path_names, found["b"].problem.path_names) == ((), ("slow",))
    assert found["b"].multipliers.path.names == ("slow",)


def test_multipliers_of_a_phase_are_those_of_the_problem_in_one_phase() -> None:
    one = OptimalControlProblem("one phase")
    x, v, u = carried(one)
    one.duration(1.0)
    one.constrain(u <= 4.0)
    one.start(ca.vertcat(x, v), 0.0)
    one.end(ca.vertcat(x, v), [1.0, 0.0])
    problem, a, _ = cut(lambda a: a.duration(0.5), lambda b: b.duration(0.5))
    a.constrain(a.statement.controls[0].symbol <= 4.0)
    whole, found = one.solve(41), problem.solve(21)
    for phase, half in (("a", slice(0, 20)), ("b", slice(20, 40))):
        own = found[phase].multipliers
        for name in ("x", "v"):
            np.testing.assert_allclose(own.dynamics[name], whole.multipliers.dynamics[name][half], rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(own.controls["u"], whole.multipliers.controls["u"][half], rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(found["b"].multipliers.final["x"], whole.multipliers.final["x"], rtol=1e-5)
    np.testing.assert_allclose(found["a"].multipliers.initial["v"], whole.multipliers.initial["v"], rtol=1e-5)


def to_orbit(length: float, time: float, *, twice: bool) -> MultiPhaseProblem:
    """Two phases of thrust about the earth to five elements of an orbit, in units of length [m] and of time [s].

    ``twice`` states an angular momentum that follows from them.
    """
    mu, radius = 3.986012e14 * time**2 / length**3, 6378145.0 / length
    problem, speed = MultiPhaseProblem("to orbit"), math.sqrt(mu / radius)
    phases = [problem.phase("thrust"), problem.phase("more")]
    for phase in phases:
        r, v = phase.state("r", 3, guess=[(radius, 0.0, 0.0), (0.0, radius, 0.0)]), phase.state("v", 3, guess=speed)
        u = phase.control("u", 3)
        phase.duration(1000.0 / time)
        phase.dynamics(r, v)
        phase.dynamics(v, u - mu * r / ca.norm_2(r) ** 3)
        phase.minimise(running=ca.sumsqr(u))
    phases[0].start(phases[0].statement.x[:3], [radius, 0.0, 0.0])
    h = ca.cross(r, v)
    e, size, node = ca.cross(v, h) / mu - r / ca.norm_2(r), ca.norm_2(h), ca.vertcat(-h[1], h[0], 0.0)
    phase.end_constraint(1.0 / (2.0 / ca.norm_2(r) - ca.sumsqr(v) / mu) == 3.8 * radius)
    phase.end_constraint(ca.norm_2(e) == 0.73)
    phase.end_constraint(ca.acos(h[2] / size) == 0.5)
    phase.end_constraint(ca.atan2(node[1], node[0]) == -1.6)
    phase.end_constraint(ca.acos(ca.dot(node, e) / ca.norm_2(node) / ca.norm_2(e)) == 2.3)
    if twice:
        phase.end_constraint(ca.sumsqr(h) == mu * 3.8 * radius * (1.0 - 0.73**2))
    problem.link(*phases)
    return problem


@pytest.mark.parametrize(("length", "time"), [(1.0, 1.0), (1e3, 1.0), (6378145.0, 806.81)])
def test_equations_are_counted_alike_in_every_unit(length: float, time: float) -> None:
    assert len(to_orbit(length, time, twice=False).functions().final_names) == 11
    with pytest.raises(ProblemError, match=r"12 equations at the end: .* allowed: 11, as many as .*, 6 more can meet"):
        to_orbit(length, time, twice=True).functions()


def readings(coupled: Callable[[MultiPhaseProblem, ca.SX, ca.SX], Any]) -> MultiPhaseProblem:
    """x' = -k x from 1, k to be found from two readings, a phase for each; the phases share k by the link, and more."""
    problem = MultiPhaseProblem("readings")
    phases = [problem.phase("a"), problem.phase("b")]
    for phase, reading in zip(phases, (math.exp(-0.5), math.exp(-1.0)), strict=True):
        x, k = phase.state("x", guess=1.0), phase.unknown("k")
        phase.duration(1.0)
        phase.dynamics(x, -k * x)
        phase.minimise(terminal=(x - reading) ** 2)
    phases[0].start(phases[0].statement.x[0], 1.0)
    problem.link(*phases)
    coupled(problem, *(phase.statement.x[1] for phase in phases))
    return problem


@pytest.mark.parametrize(
    "coupled",
    [
        lambda problem, k_a, k_b: None,
        lambda problem, k_a, k_b: problem.couple(k_b == k_a),
        lambda problem, k_a, k_b: [problem.couple(2 * k_b == 1), problem.couple(k_a + k_b == 1)],
    ],
)
def test_equations_of_constants_that_follow_from_others_do_not_count(coupled: Callable[..., Any]) -> None:
    found = readings(coupled).solve()
    assert found.ok
    assert found["b"]["k"][-1] == pytest.approx(0.5)
    assert found["a"].multipliers.initial["x"] == pytest.approx(0.0, abs=1e-6)


def test_equations_of_constants_that_contradict_each_other_are_too_many() -> None:
    problem = readings(lambda problem, k_a, k_b: [problem.couple(k_b == 1), problem.couple(k_a == 2)])
    assert problem.solve(5).status is SolverOutcome.OVERDETERMINED


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        (lambda problem, a, b: problem.phase("a"), "cut in two: phase 'a' is empty or taken; allowed: other than"),
        (lambda problem, a, b: problem.link(a, OptimalControlProblem("c")), "is not one of its phases; allowed: ['a'"),
        (
            lambda problem, a, b: problem.link(a, b, jumps={"m": 1.0}),
            "a to b: jump of m: m is no state of either phase; allowed: jumps of x, v, the states of both phases",
        ),
        (lambda problem, a, b: problem.link(a, b, jumps={"u": 1.0}), "jump of u: u is a control of a; allowed"),
        (
            lambda problem, a, b: [a.state("s"), problem.link(a, b, jumps={"s": -100})],
            "jump of s: s is a state of a only; allowed: jumps of x, v, the states of both",
        ),
        (
            lambda problem, a, b: [
                a.integral(1, name="w"),
                b.integral(1, name="w"),
                problem.link(a, b, jumps={"w": 1}),
            ],
            "jump of w: w is an integral, which starts from 0 in b; allowed: jumps of x, v, the states of both",
        ),
        (
            lambda problem, a, b: problem.link(counting(problem, "c"), counting(problem, "d")),
            "c to d: w: integrals, which start from 0 in d; allowed: at least one other state of both phases",
        ),
        (lambda problem, a, b: problem.link(a, bare(problem)), "a to bare: no state in common; allowed: phases with"),
        (lambda problem, a, b: problem.unknown("x"), "a: variable 'x' is empty or taken"),
        (lambda problem, a, b: problem.couple(ca.SX.sym("z") == 1), "coupling (z==1) depends on z"),
        (lambda problem, a, b: problem.couple(a.statement.states[0].symbol <= math.inf), "is no limit"),
        (lambda problem, a, b: [problem.phase("c").state("x"), problem.solve(5)], "phase c has no duration"),
        (lambda problem, a, b: MultiPhaseProblem("none").solve(5), "none: no phase is begun"),
        (lambda problem, a, b: problem.solve(5)["c"], "'c' is no phase; allowed: a, b"),
        (lambda problem, a, b: [problem.link(a, b), problem.solve(5)], "6 equations at the end"),
    ],
)  # fmt: skip
def test_a_wrong_statement_of_phases_is_refused(wrong: Callable[..., Any], named: str) -> None:
    problem, a, b = cut(lambda a: a.duration(0.5), lambda b: b.duration(0.5))
    with pytest.raises((ProblemError, KeyError), match=re.escape(named)):
        wrong(problem, a, b)
