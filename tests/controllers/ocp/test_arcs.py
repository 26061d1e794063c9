"""Arcs whose lengths are unknowns put a switch where it belongs, and keep the time that was stated."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.ocp.arcs import Arcs, placed, starts
from mathnavi.controllers.ocp.distribution import Equidistributed
from mathnavi.controllers.ocp.grid import Grid, uniform
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.problems.articles import double_integrator_time
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA

NOTHING = Interval(np.empty((2, 0)), np.empty((2, 0)))  # bounds of no path constraints, and of no states, on two arcs


def to_rest() -> ProblemFunctions:
    """x' = u, |u| <= 1, ∫ x^2 over [0, 1] from 1/2: u = -1 until 1/2, then 0, J* = 1/24."""
    ocp = OptimalControlProblem("to rest")
    x, u = ocp.state("x", guess=(0.5, 0.0)), ocp.control("u", lower=-1.0, upper=1.0)
    ocp.duration(1.0)
    ocp.minimise(running=x**2)
    ocp.dynamics(x, u)
    ocp.start(x, 0.5)
    return ocp.functions()


def test_shares_add_up_to_the_grid() -> None:
    grid = Grid(np.array([0.0, 0.1, 0.4, 0.6, 1.0]))
    arcs = Arcs((1, 3), NOTHING, NOTHING, NOTHING)
    shares, lengths = arcs.shares(grid), arcs.lengths(grid)
    assert lengths == pytest.approx([0.1, 0.9])
    assert placed(shares, lengths).nodes == pytest.approx(grid.nodes)
    assert starts(shares) @ lengths == pytest.approx(grid.nodes[:-1])
    assert np.diff(placed(shares, np.array([0.5, 0.5])).nodes)[0] == pytest.approx(0.5)
    assert len(placed(shares, np.array([1.0, 1e-18]))) == 5  # of an arc that vanishes, no two nodes become one


def test_a_held_control_switches_where_time_is_least() -> None:
    held = np.array([[1.0], [-1.0]])
    arcs = Arcs((2, 2), Interval(held, held), NOTHING, NOTHING)
    made = transcription(double_integrator_time(), RadauIIA(2), 5, arcs=2)
    found = made.solve(grid=Grid(np.array([0.0, 0.2, 0.4, 0.7, 1.0])), arcs=arcs)
    assert found.solved
    assert found.duration == pytest.approx(2.0 * math.sqrt(3.0), abs=1e-9)
    assert found.grid.nodes == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0], abs=1e-8)
    assert found.u[:, :, 0] == pytest.approx(np.repeat([[1.0], [-1.0]], 2, axis=0) * np.ones((4, 2)))
    of_bounds = found.multipliers.controls["u"]  # each bound holds the control back on its own arc, to the switch
    assert (of_bounds[:2].ravel()[:-1] > 0.0).all()
    assert of_bounds[1, -1] == pytest.approx(0.0, abs=1e-9)
    assert (of_bounds[2:, 1:] < 0.0).all()


def test_arcs_of_a_fixed_time_add_up_to_it() -> None:
    bounds = Interval(np.array([[-1.0], [-1.0]]), np.array([[-1.0], [1.0]]))
    found = transcription(to_rest(), RadauIIA(3), 5, arcs=2).solve(
        grid=uniform(5), arcs=Arcs((1, 3), bounds, NOTHING, NOTHING)
    )
    assert found.duration == pytest.approx(1.0)
    assert found.grid.nodes[1] == pytest.approx(0.5, abs=1e-4)
    assert found.cost == pytest.approx(1.0 / 24.0, abs=1e-8)


def test_smoothing_is_no_part_of_the_cost() -> None:
    bounds = Interval(np.array([[-1.0]]), np.array([[1.0]]))
    none = Interval(np.empty((1, 0)), np.empty((1, 0)))
    made = transcription(to_rest(), RadauIIA(3), 4)
    rough, smooth = (
        made.solve(grid=uniform(4), arcs=Arcs((3,), bounds, none, none, np.array([[weight]]))) for weight in (0.0, 1e3)
    )
    bend = [np.abs(found.u[:, 0] - 2.0 * found.u[:, 1] + found.u[:, 2]).max() for found in (rough, smooth)]
    assert bend[1] < 0.2 * bend[0]
    assert smooth.cost == pytest.approx(1.0 / 24.0, rel=0.2)  # with its smoothing it would be many times that


def test_arcs_that_do_not_fit_are_refused() -> None:
    made = transcription(double_integrator_time(), RadauIIA(2), 5, arcs=2)
    with pytest.raises(ValueError, match="the 2 of this transcription"):
        made.solve()
    with pytest.raises(ValueError, match="allowed: 4 in all"):
        made.solve(grid=uniform(5), arcs=Arcs((1, 2), Interval(-np.ones((2, 1)), np.ones((2, 1))), NOTHING, NOTHING))
    with pytest.raises(ValueError, match="at least one in each"):
        Arcs((1, 0), NOTHING, NOTHING, NOTHING)
    with pytest.raises(ValueError, match="arcs = 2 with Equidistributed"):
        transcription(double_integrator_time(), RadauIIA(2), 5, Equidistributed(), arcs=2)
