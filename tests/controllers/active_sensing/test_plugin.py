"""The plug-in's configuration: every mode is there, and what makes no sense is refused by name."""

from __future__ import annotations

from typing import Any, get_args

import pytest

from mathnavi.controllers.active_sensing.plugin import CRITERIA, PATTERNS, ActiveSensing, ModeName, ReferenceName
from tests.controllers.active_sensing.robots import mission


def test_every_mode_is_a_pattern_or_a_criterion() -> None:
    assert set(get_args(ModeName)) == PATTERNS.keys() | CRITERIA.keys()
    assert not PATTERNS.keys() & CRITERIA.keys()
    assert set(get_args(ReferenceName)) - {"none"} <= PATTERNS.keys()


@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"mode": "spiral"}, r"mode = 'spiral'; allowed: active, .*still"),
        ({"then": "straight"}, r"then = 'straight'; allowed: none, figure-eight, circle"),
        ({"mode": "circle", "then": "circle"}, r"then = 'circle' with mode = 'circle'.*allowed.*active"),
        ({"period": 2.0}, r"period = 2\.0; allowed: at most the horizon, 1 s"),
        ({"horizon": 1e4}, r"horizon = 10000\.0; allowed: at most 600 s"),
        ({"nodes": 5000}, r"nodes = 5000; allowed: 1 to 1000"),
        ({"deviations": -1.0}, r"deviations = -1\.0; allowed: a finite value >= 0"),
        ({"seed": -1}, r"seed = -1; allowed: a whole number"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(fields: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        ActiveSensing.Config(**fields)


def test_a_period_between_those_of_the_robot_is_refused() -> None:
    with pytest.raises(ValueError, match=r"period = 0\.123; allowed: a whole number of the robot's periods of 0\.01 s"):
        ActiveSensing.build(ActiveSensing.Config(period=0.123), mission())
