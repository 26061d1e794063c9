"""The independent collocation of stated problems: phases, given times, unknowns, switches, and what it cannot solve."""

from __future__ import annotations

import pytest

from benchmarks.ocp_references.collocation import NoReferenceError
from benchmarks.ocp_references.phases import Mesh, witness
from mathnavi.controllers.ocp.phases import MultiPhaseProblem
from mathnavi.controllers.ocp.problem import OptimalControlProblem


def double_integrator(name: str, most: float = 10.0) -> tuple[OptimalControlProblem, tuple[object, object, object]]:
    """x'' = u from rest to rest over a distance of 1."""
    ocp = OptimalControlProblem(name)
    x, v = ocp.state("x"), ocp.state("v")
    u = ocp.control("u", lower=-most, upper=most)
    ocp.dynamics(x, v), ocp.dynamics(v, u)
    ocp.start(x, 0.0), ocp.start(v, 0.0)
    return ocp, (x, v, u)


def test_both_schemes_find_a_closed_form_through_phases_with_a_shared_unknown() -> None:
    problem = MultiPhaseProblem("two")
    gain = problem.parameter("gain", 2.0)
    where = problem.unknown("where", guess=0.2)
    for name in ("a", "b"):
        phase = problem.phase(name)
        x, v, u = phase.state("x"), phase.state("v"), phase.control("u")
        phase.dynamics(x, v), phase.dynamics(v, gain * u)
        phase.minimise(running=u**2)
        if name == "a":
            phase.duration(0.5)
            phase.start(x, 0.0), phase.start(v, 0.0), phase.end(x, where)
            first = phase
        else:
            phase.free_duration(guess=0.3, lower=0.1, upper=0.5)
            phase.end(x, 1.0), phase.end(v, 0.0)
            problem.link(first, phase)
    for found in witness(problem, Mesh(4, 4)):  # 12 / gain^2
        assert found.cost == pytest.approx(3.0, rel=1e-9)
        assert found.constants == pytest.approx([0.5], abs=1e-6)


def test_what_is_stated_at_a_time_is_a_boundary() -> None:
    ocp, (x, v, u) = double_integrator("at", 100.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2)
    ocp.end(x, 1.0), ocp.end(v, 0.0)
    ocp.at(0.4).constrain(x == 0.5)
    ours = ocp.solve()
    for found in witness(ocp, Mesh(5, 4)):
        assert found.cost == pytest.approx(ours.cost, rel=1e-8)


def test_a_switch_is_found_where_widths_are_unknowns() -> None:
    ocp, (x, v, _) = double_integrator("switch")
    T = ocp.free_duration(guess=1.0)
    ocp.minimise(terminal=T)
    ocp.end(x, 1.0), ocp.end(v, 1.0)
    speed = (10.0 + 0.5) ** 0.5  # at the switch
    exact = (2.0 * speed - 1.0) / 10.0
    for found in witness(ocp, Mesh(6, 3, control_degree=0, moving=True)):
        assert found.cost == pytest.approx(exact, rel=1e-9)


def test_what_has_no_solution_is_named() -> None:
    ocp, (x, _, u) = double_integrator("too far")
    ocp.duration(0.1)
    ocp.minimise(running=u**2)
    ocp.end(x, 1.0)
    with pytest.raises(NoReferenceError, match="too far: Radau"):
        witness(ocp, Mesh(4, 2))
