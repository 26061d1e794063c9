"""The stationarity of a smooth solution shows how far its cost is from the least one."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mathnavi.controllers.ocp.defects import defects
from mathnavi.controllers.ocp.grid import uniform
from mathnavi.controllers.ocp.methods.hp_mesh import interval_errors
from mathnavi.controllers.ocp.methods.suboptimality import suboptimality
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.collocation import RadauIIA


def solved(name: str, nodes: int = 13) -> Solution:
    return transcription(PROBLEMS[name].problem(), RadauIIA(3), nodes).solve(grid=uniform(nodes))


@pytest.mark.parametrize("name", ["linear hypersensitive", "stirred tank", "steering"])
def test_with_the_defects_it_is_at_least_the_error_of_the_cost(name: str) -> None:
    solution = solved(name)
    shown = suboptimality(solution) / abs(solution.cost) + interval_errors(solution, defects(solution)).total
    assert PROBLEMS[name].error(solution.cost) <= shown < 1e-2


def test_it_falls_with_the_nodes() -> None:
    assert suboptimality(solved("stirred tank", 25)) < 0.1 * suboptimality(solved("stirred tank"))


def test_another_control_costs_what_it_says() -> None:
    solution = solved("double integrator, energy")
    assert suboptimality(solution) < 1e-12
    bent = dataclasses.replace(solution, u=solution.u + 0.1 * np.sin(2.0 * np.pi * solution.point_times)[:, :, None])
    assert suboptimality(bent) == pytest.approx(0.5 * 0.01 * 0.5, rel=1e-3)  # ∫ (0.1 sin)^2 / 2 dt over one period


@pytest.mark.parametrize("name", ["Bryson-Denham", "lunar landing", "double integrator, time"])
def test_it_says_nothing_where_a_limit_holds_back_or_a_control_is_linear(name: str) -> None:
    assert suboptimality(solved(name)) == math.inf
