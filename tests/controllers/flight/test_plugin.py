"""The configuration of the plug-in: which grids and periods there are, and which are refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from tests import flight

CONTROL = 1.0 / 60.0  # [s]


def test_unless_asked_for_the_grid_is_uniform_and_a_period_is_one_arc() -> None:
    config = FlightConfig(nodes=7, horizon=12.0)
    assert config.lengths == 6 * (2.0,)
    assert config.replan_period(CONTROL) == pytest.approx(2.0)


def test_a_stretched_grid_fills_the_horizon_and_a_period_is_its_first_arc_to_whole_control_periods() -> None:
    config = FlightConfig(nodes=11, horizon=40.0, stretch=1.25)
    assert math.fsum(config.lengths) == pytest.approx(40.0)
    np.testing.assert_allclose(np.divide(config.lengths[1:], config.lengths[:-1]), 1.25)
    period = config.replan_period(CONTROL)
    assert abs(period - config.lengths[0]) <= 0.5 * CONTROL
    assert period / CONTROL == pytest.approx(round(period / CONTROL))


@pytest.mark.parametrize(("period", "ticks"), [(5.0 / 3.0, 100), (1.6667, 100), (CONTROL, 1), (20.0, 1200)])
def test_a_period_that_is_given_is_kept_to_its_digits(period: float, ticks: int) -> None:
    planner, _ = FlightController.build(FlightConfig(stretch=1.1, period=period), flight.mission())
    assert planner.period == pytest.approx(ticks * CONTROL, rel=1e-12)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        *(({"stretch": ratio}, "stretch = .*; allowed at nodes = 13: ") for ratio in (0.0, -1.2, math.nan, math.inf)),
        ({"stretch": 2.0}, "stretch = 2.0; allowed at nodes = 13: 0.5337 to 1.874, .* 1000 times"),
        ({"stretch": 1.1, "nodes": 121}, "stretch = 1.1; allowed at nodes = 121: "),
        *(({"period": period}, "period = .*; allowed: > 0") for period in (0.0, -1.0, math.nan, math.inf)),
        ({"period": 20.1}, "period = 20.1; .* at most the horizon of 20 s"),
        ({"period": 5.1, "horizon": 5.0}, "period = 5.1; .* at most the horizon of 5 s"),
    ],
)
def test_grids_and_periods_that_make_no_sense_are_refused(fields: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match=expected):
        FlightConfig(**fields)


@pytest.mark.parametrize(("period", "nearest"), [(1.675, "1.66667|1.68333"), (0.003, "0.0166667"), (1.66, "1.66667")])
def test_a_period_between_two_commands_is_refused(period: float, nearest: str) -> None:
    expected = (
        rf"period = {period}; allowed: a whole number of control periods of 0\.0166667 s; the nearest is ({nearest})"
    )
    with pytest.raises(ValueError, match=expected):
        FlightController.build(FlightConfig(period=period), flight.mission())
