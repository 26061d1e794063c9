"""What a coarse solution shows of the optimum: which bounds hold its controls, and where that changes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.controllers.ocp.defects import defects
from mathnavi.controllers.ocp.grid import uniform
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.methods.angles import unwound
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.problems.articles import double_integrator_energy, double_integrator_time
from mathnavi.controllers.ocp.problems.betts import free_flying_robot, rayleigh
from mathnavi.controllers.ocp.problems.bryson_ho import bryson_denham, zermelo
from mathnavi.controllers.ocp.problems.manuals import van_der_pol
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.structure import (
    Structure,
    first_order_constraints,
    linear_controls,
    structure,
    switching_constraints,
)
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.controllers.ocp.transcriptions.low_order import Euler
from tests.controllers.ocp.statements import race_car
from tests.controllers.ocp.test_arcs import to_rest

RADAU = RadauIIA(3)


def coarse(problem: ProblemFunctions, nodes: int) -> Solution:
    return transcription(problem, RADAU, nodes).solve(grid=uniform(nodes))


def test_controls_that_enter_linearly_are_known() -> None:
    assert linear_controls(free_flying_robot()).all()
    assert not linear_controls(rayleigh()).any()
    assert switching_constraints(free_flying_robot()).all()
    assert not switching_constraints(rayleigh()).any()


def test_a_switch_is_found_between_two_nodes() -> None:
    seen = structure(coarse(double_integrator_time(), 8))
    assert seen.held.tolist() == [[1], [-1]]
    assert seen.boundaries == pytest.approx([0.5], abs=0.07)


def test_a_singular_arc_is_free() -> None:
    seen = structure(coarse(to_rest(), 8))
    assert seen.held.tolist() == [[-1], [0]]
    assert seen.boundaries == pytest.approx([0.5], abs=0.08)


def test_a_constraint_on_a_state_has_edges_but_no_arc() -> None:
    seen = structure(coarse(bryson_denham(0.1), 13))
    assert len(seen) == 1
    assert seen.edges.min() == pytest.approx(0.3, abs=0.06)
    assert seen.edges.max() == pytest.approx(0.7, abs=0.06)


def test_a_limit_of_first_order_has_an_arc_and_determines_the_control_there() -> None:
    problem = race_car().functions()
    seen = structure(coarse(problem, 13))
    assert first_order_constraints(problem).tolist() == [[True]]
    assert seen.held.tolist() == [[1, 0], [0, 1], [1, 0]]
    controls, path, _ = seen.limits(problem)
    assert (controls.lower[1, 0], controls.upper[1, 0]) == (0.0, 1.0)
    assert path.lower[1, 0] == path.upper[1, 0] == 0.0
    assert not first_order_constraints(bryson_denham(0.1)).any()


def test_a_limit_that_does_not_determine_its_controls_leaves_them_their_bounds() -> None:
    ocp = OptimalControlProblem("two pumps")
    level = ocp.state("level", upper=1.0)
    inlet, outlet = ocp.control("inlet", lower=0.0, upper=2.0), ocp.control("outlet", lower=0.0, upper=2.0)
    ocp.duration(1.0)
    ocp.minimise(running=outlet)
    ocp.dynamics(level, inlet - outlet)
    problem = ocp.functions()
    both, one = (Structure(np.empty(0), np.array([[0, held, 1]]), np.empty(0)) for held in (0, -1))
    assert both.limits(problem, determined=True)[0].upper.tolist() == [[2.0, 2.0]]
    assert one.limits(problem, determined=True)[0].upper.tolist() == [[np.inf, 0.0]]


def test_arcs_that_are_as_good_as_nothing_disappear() -> None:
    seen = Structure(np.array([0.4, 0.400001, 0.7]), np.array([[1], [0], [1], [-1]]), np.empty(0))
    merged = seen.without_arcs_below(1e-3)
    assert merged.boundaries.tolist() == [0.7]
    assert merged.held.tolist() == [[1], [-1]]


def test_defects_are_those_of_each_interval_flown_from_its_own_node() -> None:
    solution = coarse(van_der_pol(), 21)
    found = defects(solution)
    for i in (2, 7):
        ends = solution.t[i : i + 2]
        part = dataclasses.replace(
            solution,
            problem=_lasting(solution.problem, ends[1] - ends[0]),
            grid=uniform(2),
            duration=ends[1] - ends[0],
            x=solution.x[i : i + 2],
            inner=solution.inner[i : i + 1],
            u=solution.u[i : i + 1],
        )
        flown = replayed(part).replay
        assert flown is not None
        missed = (flown.end - solution.x[i + 1]) / solution.problem.state_scale
        assert missed == pytest.approx(found.states[i], abs=6e-5)


def _lasting(problem: ProblemFunctions, duration: float) -> ProblemFunctions:
    return dataclasses.replace(problem, guess_duration=duration, duration_bounds=(duration, duration))


def test_a_polynomial_solution_has_no_defect_and_a_control_beyond_its_bounds_has() -> None:
    solution = solve(double_integrator_energy(), uniform(4), scheme=RADAU)
    assert np.abs(defects(solution).states).max() < 1e-12
    beyond = Interval(np.array([-1.0]), np.array([1.0]))
    bounded = dataclasses.replace(solution.problem, control_bounds=beyond)
    assert np.abs(defects(dataclasses.replace(solution, problem=bounded)).states).max() > 0.1


def test_defects_need_a_polynomial() -> None:
    with pytest.raises(ValueError, match="forward Euler"):
        defects(solve(double_integrator_energy(), 5, scheme=Euler()))


def test_angles_are_unwound_and_other_controls_left() -> None:
    solution = coarse(zermelo(), 8)
    turned = solution.u.copy()
    turned[3:, :, :] += 2.0 * np.pi
    straight = unwound(dataclasses.replace(solution, u=turned))
    assert np.abs(np.diff(straight.u.ravel())).max() < np.pi
    assert np.abs(np.sin(straight.u) - np.sin(turned)).max() < 1e-9
    pushed = coarse(double_integrator_energy(), 5)
    assert unwound(pushed) is pushed
