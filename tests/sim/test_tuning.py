from __future__ import annotations

import math

import numpy as np
import pytest

from estimators.velocity.high_gain import HighGain
from sim.tuning import RecordedCall, Tuning, recorded_error, tuned
from tests.estimators.velocity.runs import mission_of, moving, recorded

VELOCITY = slice(4, 7)


def test_the_error_is_the_root_of_the_mean_square_length_after_the_start() -> None:
    """An observer that is never told anything says (1, 0, 0, 0) and no rate."""
    calls = [RecordedCall(t, (), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0, 3.0 * t, 4.0 * t, 0.0])) for t in range(4)]
    system, _ = moving("rigid body", 0.0)
    observer = HighGain.build(HighGain.Config(), mission_of(system))
    assert recorded_error(observer, calls, VELOCITY, 2.0) == pytest.approx(5.0 * math.sqrt((4.0 + 9.0) / 2.0))


def test_the_best_of_a_grid_is_a_compromise_of_noise_and_transient() -> None:
    system, start = moving("rigid body", 0.5)
    mission = mission_of(system, noise=0.01)
    calls = recorded(mission, start, 3.0)
    grid = (0.3, 1.0, 3.0, 10.0, 30.0)
    found = tuned(HighGain, HighGain.Config(), mission, calls, "bandwidth", grid, VELOCITY, 1.0)
    assert found.grid == grid
    assert not found.at_edge
    alone = recorded_error(HighGain.build(HighGain.Config(bandwidth=found.best), mission), calls, VELOCITY, 1.0)
    assert alone == min(found.errors)


def test_a_best_value_at_the_edge_of_the_grid_is_told() -> None:
    assert Tuning("f", (1.0, 2.0, 3.0), (1.0, 2.0, 3.0)).at_edge
    assert not Tuning("f", (1.0, 2.0, 3.0), (2.0, 1.0, 3.0)).at_edge


def test_nothing_to_choose_from_and_nothing_to_measure_are_refused() -> None:
    system, start = moving("rigid body", 0.5)
    mission = mission_of(system)
    calls = recorded(mission, start, 0.1)
    with pytest.raises(ValueError, match=r"grid = \(\); allowed"):
        tuned(HighGain, HighGain.Config(), mission, calls, "bandwidth", (), VELOCITY, 0.0)
    with pytest.raises(ValueError, match=r"begin = 1\.0; allowed"):
        tuned(HighGain, HighGain.Config(), mission, calls, "bandwidth", (1.0,), VELOCITY, 1.0)


def test_a_value_that_diverges_is_never_the_best() -> None:
    assert Tuning("f", (1.0, 2.0, 3.0), (math.nan, 2.0, 1.0)).best == 3.0
    assert Tuning("f", (1.0, 2.0, 3.0), (2.0, 3.0, math.inf)).best == 1.0
