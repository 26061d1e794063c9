"""Windowed tests alarm as seldom as their level says, and find what is off by as much as they can."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.integrity.windows import CLIP, ENERGY, MEAN, Thresholds, Windows
from mathnavi.interfaces.signals import Array

CHANNELS, PERIOD, LENGTHS = 3, 0.02, (0.1, 0.5, 2.0, 5.0)
EVERY = np.ones(CHANNELS, dtype=bool)


def fed(e: Array, kappa: float = 1.0) -> tuple[Windows, Array]:
    """Windows after innovations e (k, l), and the worst ratio (k,) after each."""
    windows = Windows(Thresholds.of(CHANNELS, PERIOD, LENGTHS), CHANNELS, kappa)
    ratios = []
    for row in e:
        windows.add(row, row)
        ratios.append(windows.worst(EVERY).ratio)
    return windows, np.array(ratios)


def test_ten_minutes_of_innovations_as_declared_raise_no_alarm() -> None:
    """The level is 1 % in a minute by Bonferroni's inequality, which is far from sharp."""
    _, ratios = fed(np.random.default_rng(0).standard_normal((30_000, CHANNELS)))
    assert 0.6 < ratios.max() < 1.0


@pytest.mark.parametrize(("bias", "seconds"), [(0.5, 4.0), (1.0, 1.5), (3.0, 0.2)])
def test_a_bias_is_found_as_soon_as_a_window_can_hold_it(bias: float, seconds: float) -> None:
    e = np.random.default_rng(1).standard_normal((1000, CHANNELS))
    e[500:, 1] += bias
    windows, ratios = fed(e)
    alarms = np.flatnonzero(ratios > 1.0)
    assert 500 <= alarms[0] <= 500 + seconds / PERIOD
    found = windows.worst(EVERY)
    assert found.channel == 1
    assert found.test == (MEAN if bias < CLIP else ENERGY)
    assert windows.of_channel(1) > 1.0 > max(windows.of_channel(0), windows.of_channel(2))
    assert windows.worst(np.array([True, False, True])).channel != 1


def test_twice_the_noise_is_found_and_fits_where_it_is_declared() -> None:
    e = 2.0 * np.random.default_rng(2).standard_normal((1000, CHANNELS))
    _, ratios = fed(e)
    assert ratios.max() > 1.0
    _, fitting = fed(e, kappa=4.0)
    assert fitting.max() < 1.0


def test_one_outlier_is_no_fault_and_nothing_read_is_nothing() -> None:
    e = np.random.default_rng(3).standard_normal((500, CHANNELS))
    e[250, 0] = 1e6
    e[300:, 2] = math.nan
    windows, ratios = fed(e)
    assert ratios.max() < 1.0
    assert not windows.is_quiet(2, 100)


def test_what_is_forgotten_does_not_count_and_a_copy_has_sums_of_its_own() -> None:
    e = np.random.default_rng(4).standard_normal((400, CHANNELS))
    e[:, 0] += 3.0
    windows, _ = fed(e)
    copied = windows.copy()
    copied.forget(0)
    assert copied.of_channel(0) == 0.0 < 1.0 < windows.of_channel(0)
    for row in e[:100] - np.array([3.0, 0.0, 0.0]):
        copied.add(row, row)
    assert copied.is_quiet(0, 100)
    assert not windows.is_quiet(0, 100)
