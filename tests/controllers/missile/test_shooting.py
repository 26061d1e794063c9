"""A problem solved again and again: the shift of a solution by time, and the means of what is held."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.controllers.missile.optimiser import pitch_guess
from mathnavi.controllers.missile.problem import TerminalCondition, ground_parameters, guidance_problem, weights
from mathnavi.controllers.missile.shooting import Failed, Shooting, Solved, mean_between
from mathnavi.controllers.ocp.distribution import Equidistributed, Fixed, NodeDistribution
from mathnavi.models.missile.coordinates import PLANAR
from mathnavi.models.missile.dynamics import NOMINAL
from mathnavi.models.missile.mission import CASES
from tests.controllers.missile.flights import INPUT_MAX, mission
from tests.controllers.ocp.statements import growing

CONDITION = TerminalCondition(np.array([700.0, 0.0, 0.0]), np.zeros(3), -0.5 * np.pi)
NODES = 15
GROUND = ground_parameters(10.0, 5.0)


def shooting(distribution: NodeDistribution) -> Shooting:
    return Shooting(guidance_problem(NOMINAL, PLANAR, INPUT_MAX[PLANAR]), NODES, "fatrop", distribution)


@cache
def solved(distribution: NodeDistribution) -> Solved:
    start = mission().start_state
    guess = pitch_guess(start, CONDITION, NOMINAL, np.linspace(0.0, 1.0, NODES), 1.0)
    parameters = np.concatenate([weights(CASES["SM2"]), CONDITION.parameters(start, PLANAR), GROUND])
    found = shooting(distribution).solve(guess, parameters, first=True)
    assert isinstance(found, Solved), found
    return found


@pytest.mark.parametrize("distribution", [Fixed(), Equidistributed()])
def test_what_is_left_of_an_optimum_is_nearly_optimal(distribution: NodeDistribution) -> None:
    whole = solved(distribution)
    shift = 0.7  # [s] no whole number of intervals
    left = whole.after(shift)
    assert left.duration == pytest.approx(whole.duration - shift)
    start = left.x[0]
    parameters = np.concatenate([weights(CASES["SM2"]), CONDITION.parameters(start, PLANAR), GROUND])
    again = shooting(distribution).solve(left, parameters)
    assert isinstance(again, Solved)
    assert again.iterations <= 6
    assert again.duration == pytest.approx(left.duration, abs=0.02)
    np.testing.assert_allclose(again.nodes, left.nodes, atol=0.02)


def test_a_solve_in_flight_that_does_not_return_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mathnavi.controllers.missile.shooting.SECONDS", 0.1)
    far = Solved(np.full((6, 1), 5.0), np.zeros((5, 1)), np.linspace(0.0, 1.0, 6), 1.0, np.empty(0), np.nan, 0)
    lost = Shooting(growing(0.0), 6, "fatrop").solve(far, np.empty(0))
    assert isinstance(lost, Failed)
    assert "fatrop did not return within 0.1 s of CPU time" in lost.message
    assert not lost.infeasible


def test_a_shift_keeps_the_nodes_that_are_equidistant() -> None:
    left = solved(Fixed()).after(1.0)
    np.testing.assert_allclose(left.nodes, np.linspace(0.0, 1.0, NODES), atol=1e-12)


def test_a_shift_by_nothing_changes_nothing() -> None:
    whole = solved(Equidistributed())
    same = whole.after(0.0)
    np.testing.assert_allclose(same.x, whole.x, atol=1e-9)
    np.testing.assert_allclose(same.u, whole.u, atol=1e-6)
    np.testing.assert_allclose(same.constants, whole.constants)


def test_equidistributed_nodes_hold_equal_shares_of_the_arclength() -> None:
    found = solved(Equidistributed())
    scale = np.array([100.0, 100.0, 1.0, 1.0, 100.0, 100.0])
    chords = np.linalg.norm(np.diff(found.x, axis=0) / scale, axis=1)
    assert np.ptp(chords) / chords.mean() < 0.05
    assert np.ptp(np.diff(found.nodes)) > 0.01


def test_a_start_that_is_out_of_reach_is_a_failure_that_says_so() -> None:
    start = mission().start_state
    guess = pitch_guess(start, CONDITION, NOMINAL, np.linspace(0.0, 1.0, NODES), 1.0)
    start[0] = -5.0  # u below its bound
    parameters = np.concatenate([weights(CASES["SM2"]), CONDITION.parameters(start, PLANAR), GROUND])
    failed = shooting(Fixed()).solve(guess, parameters, first=True)
    assert isinstance(failed, Failed)
    assert failed.message


@given(st.integers(0, 1000))
def test_means_keep_the_integral(seed: int) -> None:
    rng = np.random.default_rng(seed)
    breaks = np.cumsum(rng.uniform(0.1, 1.0, 8))
    held = rng.standard_normal((7, 2))
    at = np.sort(np.concatenate([breaks[[0, -1]], rng.uniform(breaks[0], breaks[-1], 5)]))
    means = mean_between(breaks, held, at)
    np.testing.assert_allclose(np.diff(at) @ means, np.diff(breaks) @ held, atol=1e-12)


def test_means_within_one_interval_are_its_value_and_beyond_the_ends_the_nearest() -> None:
    breaks, held = np.array([0.0, 1.0, 3.0]), np.array([[2.0], [5.0]])
    means = mean_between(breaks, held, np.array([-2.0, -1.0, 0.5, 0.9, 2.0, 4.0, 6.0]))[:, 0]
    np.testing.assert_allclose(means, [2.0, 2.0, 2.0, (0.1 * 2 + 1.0 * 5) / 1.1, 5.0, 5.0])
