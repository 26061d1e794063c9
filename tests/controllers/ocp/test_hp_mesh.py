"""Each interval gets points where its solution is smooth, nodes where not, and loses what it does not need."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.controllers.ocp.grid import LEAST_WIDTH, Grid
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.methods.hp import hp
from mathnavi.controllers.ocp.methods.hp_mesh import HIGHEST_COUNT, HpMesh, IntervalErrors, meshed
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.structure import without_structure
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA
from mathnavi.controllers.ocp.transcriptions.variable_radau import VariableRadauIIA, point_counts

NODES, ALLOWED = 41, 1e-7
EACH = ALLOWED / (NODES - 1)


@pytest.fixture(scope="module")
def switching() -> Solution:
    """A control that jumps inside the interval in the middle; smooth elsewhere."""
    solution = solve(PROBLEMS["double integrator, energy"].problem(), NODES, scheme=RadauIIA(4))
    u = solution.u.copy()
    u[20, 2:] += 1.0
    return dataclasses.replace(solution, u=u)


def next_mesh(
    solution: Solution,
    own: dict[int, float],
    path: dict[int, float] | None = None,
    held: dict[int, float] | None = None,
    gaps: dict[int, float] | None = None,
) -> HpMesh:
    errors = IntervalErrors(
        np.full(NODES - 1, 0.5 * EACH), np.zeros(NODES - 1), np.zeros(NODES - 1), np.zeros(NODES - 1)
    )
    for i, value in (gaps or {}).items():
        errors.gaps[i] = errors.own[i] = value
    for i, value in own.items():
        errors.own[i] = value
    for i, value in (path or {}).items():
        errors.path[i] = value
    for i, value in (held or {}).items():
        errors.held[i] = value
    return meshed(solution, without_structure(solution.problem), errors, ALLOWED, 300, hard=False)


def test_a_smooth_interval_gets_points_and_one_with_a_jump_nodes(switching: Solution) -> None:
    mesh = next_mesh(switching, {5: 10.0 * EACH, 20: 10.0 * EACH})
    assert len(mesh.grid) > NODES
    assert mesh.counts[5] > 4
    assert np.array_equal(mesh.grid.nodes[:20], switching.grid.nodes[:20])
    inside = (mesh.grid.nodes > switching.grid.nodes[20]) & (mesh.grid.nodes < switching.grid.nodes[21])
    assert inside.any()
    assert set(np.delete(mesh.counts, 5).tolist()) == {4}


def test_an_interval_that_would_need_too_many_points_is_divided(switching: Solution) -> None:
    mesh = next_mesh(switching, {5: 1.0, 20: 1.0})
    assert mesh.counts.max() <= HIGHEST_COUNT
    assert len(mesh.grid) > NODES


def test_a_violated_constraint_gets_nodes_even_where_all_is_smooth(switching: Solution) -> None:
    mesh = next_mesh(switching, {5: 10.0 * EACH}, {5: 1e-3})
    assert np.abs(mesh.grid.nodes - 0.5 * (switching.grid.nodes[5] + switching.grid.nodes[6])).min() < 1e-12
    assert set(mesh.counts.tolist()) == {4}


def test_a_switch_inside_of_a_smooth_interval_gets_nodes(switching: Solution) -> None:
    mesh = next_mesh(switching, {}, gaps={5: 10.0 * EACH})
    inside = (mesh.grid.nodes > switching.grid.nodes[5]) & (mesh.grid.nodes < switching.grid.nodes[6])
    assert inside.sum() == 3
    assert set(mesh.counts.tolist()) == {4}


def test_what_is_not_needed_goes(switching: Solution) -> None:
    idle = dict.fromkeys(range(5, 15), 1e-9 * EACH) | {20: 10.0 * EACH}
    mesh = next_mesh(switching, idle)
    merged = np.setdiff1d(switching.grid.nodes, mesh.grid.nodes)
    assert len(merged)
    assert merged.min() >= switching.grid.nodes[5]
    assert merged.max() <= switching.grid.nodes[15]
    assert 3 in mesh.counts


def test_a_constraint_that_holds_throughout_gets_points_where_its_control_is_smooth(switching: Solution) -> None:
    mesh = next_mesh(switching, {}, held={5: 10.0 * ALLOWED, 20: 10.0 * ALLOWED})
    assert mesh.counts[5] > 4
    assert np.array_equal(mesh.grid.nodes[:20], switching.grid.nodes[:20])
    assert len(mesh.grid) > NODES  # but nodes where it jumps


@pytest.mark.parametrize("boundaries", [[], [0.5], [1.0 - 3e-6, 1.0 - 1e-6]])
def test_nodes_do_not_pile_up(boundaries: list[float]) -> None:
    piled = Grid(np.concatenate([[0.0, 1e-13, 0.25, 0.5 - 1e-12], 1.0 - np.array([2e-6, 1e-12, 5e-13, 1e-15, 0.0])]))
    mesh = HpMesh.uniform(piled, 4).with_boundaries(np.array(boundaries), 300)
    assert mesh.grid.widths.min() >= 0.99 * LEAST_WIDTH
    assert set(boundaries) <= set(mesh.grid.nodes.tolist())
    assert mesh.counts.shape == mesh.grid.widths.shape


def test_an_error_that_is_too_large_everywhere_raises_all_alike(switching: Solution) -> None:
    mesh = next_mesh(switching, dict.fromkeys(range(NODES - 1), 2.0 * EACH))
    assert isinstance(mesh.scheme, RadauIIA)
    assert mesh.scheme.count == 5
    assert np.array_equal(mesh.grid.nodes, switching.grid.nodes)


def test_a_boundary_layer_takes_intervals_of_high_order() -> None:
    found = hp(PROBLEMS["hypersensitive, short"].problem())
    counts, middles = point_counts(found.scheme), 0.5 * (found.grid.nodes[1:] + found.grid.nodes[:-1])
    assert isinstance(found.scheme, VariableRadauIIA)
    assert counts.sum() < 150  # a single order takes 86 nodes, 255 points
    layers = (middles < 0.1) | (middles > 0.9)
    assert counts[layers].max() > counts[~layers].max()
    assert found.replay is not None
    assert found.replay.error < 1e-6
