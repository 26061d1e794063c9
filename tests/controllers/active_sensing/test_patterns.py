"""Patterns use no measurement, come back after a cycle, and lead where the nominal path says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.active_sensing.plugin import ActiveSensing
from mathnavi.controllers.active_sensing.policies import (
    Circle,
    FigureEight,
    Pattern,
    Still,
    Straight,
    check_drivable,
    path,
)
from mathnavi.interfaces.signals import Estimate
from tests.controllers.active_sensing.robots import START, built, fly, mission

MODES = ("figure-eight", "circle", "straight", "still")
MOVING = (FigureEight(0.5, 8.0), Circle(0.5, 8.0), Straight(0.5, 8.0))
PATTERNS = (*MOVING, Still())


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_cycle_leads_back_to_where_it_began(pattern: Pattern) -> None:
    poses = path(pattern, START, 0.01)
    np.testing.assert_allclose(poses[-1, :2], START[:2], atol=2e-5)
    assert math.remainder(poses[-1, 2] - START[2], 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_inputs_come_again_and_are_the_largest_at_first(pattern: Pattern) -> None:
    first = np.abs(pattern.input_at(0.0))
    for t in np.linspace(0.01, 7.9, 50):
        np.testing.assert_allclose(pattern.input_at(t), pattern.input_at(t + pattern.cycle), atol=1e-9)
        assert (np.abs(pattern.input_at(t)) <= first + 1e-12).all()


def test_patterns_have_the_size_that_they_say() -> None:
    circle, eight, line = (np.ptp(path(p, START, 0.01)[:, :2], axis=0) for p in (MOVING[1], MOVING[0], MOVING[2]))
    assert circle == pytest.approx(np.full(2, 4.0 / math.pi), abs=1e-3)
    # Across its heading at the start: the figure of eight is turned by the heading at which it began.
    c, s = math.cos(START[2]), math.sin(START[2])
    turned = path(MOVING[0], START, 0.01)[:, :2] @ np.array([[c, -s], [s, c]])
    assert np.ptp(turned, axis=0) == pytest.approx([0.139 * 4.0, 0.375 * 4.0], abs=2e-3)
    assert np.hypot(*line) == pytest.approx(2.0, abs=1e-9)
    assert np.hypot(*eight) > 1.5


@pytest.mark.parametrize("mode", MODES)
def test_the_nominal_path_is_flown_whatever_the_estimator_says(mode: str) -> None:
    task = mission()
    nominal = ActiveSensing.nominal_path(ActiveSensing.Config(mode=mode), task, START)
    flight = fly(built(task, mode=mode), task, START, 8.0, lambda t, truth: Estimate(t, np.array([3.0, 0.0, 1.0])))
    flown = np.array(flight.truth)
    np.testing.assert_allclose(flown[: len(nominal)], nominal[: len(flown)], rtol=0.0, atol=1e-9)
    assert flight.kinds == []


@pytest.mark.parametrize("mode", ["active", "singular-value", "random"])
def test_where_a_mode_searches_nothing_is_nominal_but_the_start(mode: str) -> None:
    nominal = ActiveSensing.nominal_path(ActiveSensing.Config(mode=mode), mission(), START)
    np.testing.assert_array_equal(nominal, START[None, :])


def test_a_pattern_that_is_too_fast_is_refused_and_the_error_says_what_is_not() -> None:
    task = mission(speed_max=0.4, turn_rate_max=0.5)
    with pytest.raises(ValueError, match=r"speed = 0\.5; allowed: at most the robot's 0\.4"):
        built(task, mode="straight")
    with pytest.raises(ValueError, match=r"cycle = 8\.0 needs .*allowed: at least 12\.57 s"):
        built(task, mode="circle", speed=0.3)
    check_drivable(Circle(0.3, 12.57), task)
    check_drivable(FigureEight(0.3, 30.22), task)
