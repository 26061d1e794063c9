from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.velocity.high_gain import HighGain
from mathnavi.interfaces.signals import Measurement
from mathnavi.sim.metrics.tuning import RecordedCall, ReplayedErrors, Tuning, recorded_error, replayed, spread, tuned
from tests.estimators.velocity.runs import mission_of, moving, recorded

VELOCITY = slice(4, 7)


def test_the_error_is_the_root_of_the_mean_square_length_after_the_start() -> None:
    """An observer that receives no measurement estimates (1, 0, 0, 0) and no rate."""
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


def test_a_best_value_at_the_edge_of_the_grid_is_reported() -> None:
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


def test_a_replay_tells_when_the_error_was_last_above_a_limit() -> None:
    t = np.arange(5.0)
    ran = ReplayedErrors(t, np.array([4.0, 1.0, 3.0, 1.0, 1.0]), 0, 0, 0)
    assert ran.below_from(5.0) == 0.0
    assert ran.below_from(2.0) == 2.0
    assert ran.below_from(0.5) is None
    assert ReplayedErrors(t, np.array([4.0, 1.0, math.nan, 1.0, 1.0]), 0, 0, 0).below_from(2.0) == 2.0


def test_a_replay_counts_the_readings_that_were_refused() -> None:
    """A body at rest that is read half a turn off, once."""
    system, start = moving("rigid body", 0.0)
    mission = mission_of(system)
    calls = recorded(mission, start, 0.2)
    outlier = system.manifold.point(start[:4], np.array([1.5, 0.0, 0.0]))
    wrong = Measurement("position", calls[10].t, outlier)
    calls[10] = RecordedCall(calls[10].t, (wrong,), calls[10].command, calls[10].truth)
    ran = replayed(HighGain.build(HighGain.Config(), mission), calls, VELOCITY)
    assert (ran.refused, ran.restarts, ran.lost) == (1, 0, 0)
    assert ran.rms(0.0) == pytest.approx(0.0, abs=1e-6)


def test_a_grid_is_thinned_from_its_first_to_its_last() -> None:
    grid = (1.0, 2.0, 3.0, 4.0, 5.0)
    assert spread(grid, 9) == grid
    assert spread(grid, 3) == (1.0, 3.0, 5.0)
    assert spread(grid, 1) == (1.0,)
