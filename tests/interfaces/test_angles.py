"""Angles in the other unit are refused, with what may have been meant; every field that holds one knows its unit."""

from __future__ import annotations

import math
from typing import Annotated, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.controllers.active_sensing.plugin import ActiveSensingConfig
from mathnavi.controllers.intrinsic.references import AttitudeTrackingConfig, JointTrackingConfig
from mathnavi.controllers.quadrotor.tracker import TrackerConfig
from mathnavi.estimators.missile_kalman import MissileKalmanConfig
from mathnavi.estimators.ranging.feasible_set_bank import FeasibleSetBankConfig
from mathnavi.interfaces.angles import Degrees, Radians, check_angle
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.models.manifold.mission import PositionQuality
from mathnavi.sim.scenarios.attitude_tracking import AttitudeTrackingFields
from mathnavi.sim.scenarios.missile_fields import MissileGuidanceConfig, MissileNoise
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig


@configuration
class Sensor:
    heading: Annotated[float, Degrees(-180.0, 180.0)] = 0.0
    beam: Annotated[float, Radians(0.0, math.pi, open_low=True)] = 0.1
    turn: Annotated[float, Radians(0.0, 10.0, unit="rad/s")] = 1.0


@pytest.mark.parametrize("value", [math.pi / 2.0, -math.pi / 3.0, 1.5708, -1.57, 3.14, 0.7854, 2.0944, 1.047, math.pi])
def test_a_fraction_of_a_turn_in_radians_is_no_angle_in_degrees(value: float) -> None:
    meant = round(math.degrees(value))
    with pytest.raises(FieldError, match=rf"heading = {value!r}; allowed: .* deg; did you mean {meant} deg, which are"):
        Sensor(heading=value)


@pytest.mark.parametrize("value", [0.0, 1.0, -1.5, 1.05, 1.56, 2.5, 45.0, 90.0, -180.0, 0.5, 6.2])
def test_degrees_are_degrees(value: float) -> None:
    assert Sensor(heading=value).heading == value


@given(st.floats(-180.0, 180.0).map(lambda angle: round(angle, 1)))
def test_no_angle_in_tenths_of_a_degree_is_taken_for_radians(angle: float) -> None:
    assert Sensor(heading=angle).heading == angle


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("beam", 90.0, "> 0 and <= 3.142 rad; did you mean 1.571 rad, which are 90 deg?"),
        ("turn", 45.0, "0 to 10 rad/s; did you mean 0.7854 rad/s, which are 45 deg/s?"),
        ("heading", 200.0, "-180 to 180 deg"),
        ("beam", 1000.0, "> 0 and <= 3.142 rad"),
        ("beam", 0.0, "> 0 and <= 3.142 rad"),
        ("heading", math.nan, "-180 to 180 deg"),
        ("turn", math.inf, "0 to 10 rad/s"),
    ],
)
def test_an_error_names_the_value_the_unit_and_what_may_have_been_meant(field: str, value: float, words: str) -> None:
    with pytest.raises(FieldError) as error:
        Sensor(**{field: value})
    assert str(error.value) == f"{field} = {value!r}; allowed: {words}"


def test_an_item_of_a_tuple_is_checked_by_itself() -> None:
    check_angle(30.0, "heading", Degrees())
    with pytest.raises(FieldError, match=r"heading = 1\.5708; .*did you mean 90 deg"):
        check_angle(1.5708, "heading", Degrees())


IN_DEGREES: list[tuple[Any, dict[str, Any]]] = [
    (MissileGuidanceConfig, {"aspect_angle": -1.5708}),
    (MissileGuidanceConfig, {"aspect_allowed": 0.5236}),
    (MissileGuidanceConfig, {"start_heading": 0.7854, "dimension": "spatial"}),
    (MissileNoise, {"angle": 0.5236}),
    (RangeLocalisationConfig, {"sensors": (-1.0472, 1.0472)}),
    (RangeLocalisationConfig, {"start": (0.0, 0.0, 1.5708)}),
    (RangeLocalisationConfig, {"start_error": (0.3, 0.3, 0.5236), "start_known": True}),
    (TrackerConfig, {"tilt_max": 1.0472}),
]
IN_RADIANS: list[tuple[Any, dict[str, Any]]] = [
    (RangeLocalisationConfig, {"turn_rate_max": 45.0}),
    (AttitudeTrackingFields, {"attitude_tolerance": 6.0}),
    (AttitudeTrackingFields, {"speed": 360.0}),
    (AttitudeTrackingConfig, {"rate": 180.0}),
    (AttitudeTrackingConfig, {"frequency": 180.0}),
    (JointTrackingConfig, {"amplitude": 45.0}),
    (JointTrackingConfig, {"frequency": 180.0}),
    (PositionQuality, {"noise": 2.0}),
    (PositionQuality, {"jump_size": 30.0}),
    (MissileKalmanConfig, {"start_angle_std": 2.0}),
    (MissileKalmanConfig, {"start_rate_std": 45.0}),
    (FeasibleSetBankConfig, {"deviation": (0.6, 0.4, 30.0)}),
    (ActiveSensingConfig, {"sure_heading": 5.0}),
    (TrackerConfig, {"turn_max": 90.0}),
]


@pytest.mark.parametrize(("config", "fields"), IN_DEGREES)
def test_fields_in_degrees_know_it(config: Any, fields: dict[str, Any]) -> None:
    config()
    with pytest.raises(FieldError, match=r"did you mean -?\d+ deg, which are"):
        config(**fields)


@pytest.mark.parametrize(("config", "fields"), IN_RADIANS)
def test_fields_in_radians_know_it(config: Any, fields: dict[str, Any]) -> None:
    config()
    with pytest.raises(FieldError, match=r"did you mean [\d.]+ rad.*, which are .* deg"):
        config(**fields)
