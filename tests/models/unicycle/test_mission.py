"""The mission of a robot with range sensors: what is refused, and errors that know the symmetry of the wall."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN, ellipse
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart
from tests.unicycle import STANDARD

SENSORS = (-0.5 * math.pi, -0.25 * math.pi)
MISSION = RangingMission(STANDARD, SENSORS)
IN_A_CIRCLE = RangingMission(ellipse(2.0, 2.0), SENSORS)

poses = st.integers(0, 2**32).map(lambda seed: STANDARD.draw(np.random.default_rng(seed)))
small = st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)).map(np.array)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"angles": ()}, "one sensor or more"),
        ({"angles": (0.0, 2.0 * math.pi)}, "one direction twice"),
        ({"angles": (1.0, 0.5, 1.0)}, "one direction twice"),
        ({"angles": (0.0, 0.0), "mounting": ((0.1, 0.0),)}, "one direction from one place twice"),
        ({"angles": (0.0, 1.0, 0.0), "mounting": ((0.1, 0.2), (0.1, 0.2), (0.1, 0.2))}, "one direction from one place"),
        ({"angles": (math.nan,)}, "finite"),
        ({"start": KnownStart((5.0, 0.0, 0.0))}, "outside"),
    ],
)
def test_what_makes_no_mission_is_refused(fields: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValueError, match=rf"= .*{expected}|{expected}.*allowed"):
        dataclasses.replace(MISSION, **fields)


@given(poses, small, st.integers(-2, 2))
def test_an_error_is_that_of_the_nearest_pose_that_is_indistinguishable(x: Array, error: Array, turns: int) -> None:
    for image in STANDARD.images(x):
        estimate = image + error + [0.0, 0.0, 2.0 * math.pi * turns]
        np.testing.assert_allclose(MISSION.difference(estimate, x), error, rtol=0.0, atol=1e-12)
        assert MISSION.error(estimate, x) == pytest.approx((math.hypot(error[0], error[1]), abs(error[2])), abs=1e-12)


def test_without_symmetry_the_turned_pose_is_another_one() -> None:
    mission = dataclasses.replace(MISSION, curve=BEAN)
    x = np.array([1.0, 0.2, 0.3])
    assert mission.error(-x + [0.0, 0.0, math.pi], x)[0] > 1.0


@given(st.floats(0.1, 1.8), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-7.0, 7.0))
def test_in_a_circle_only_what_is_relative_counts(r: float, at: float, heading: float, turn: float) -> None:
    x = np.array([r * math.cos(at), r * math.sin(at), heading])
    turned = np.array([r * math.cos(at + turn), r * math.sin(at + turn), heading + turn])
    assert IN_A_CIRCLE.error(turned, x) == pytest.approx((0.0, 0.0), abs=1e-9)
    farther = turned * [(r + 0.1) / r, (r + 0.1) / r, 1.0] + [0.0, 0.0, 0.2]
    assert IN_A_CIRCLE.error(farther, x) == pytest.approx((0.1, 0.2), abs=1e-9)


def test_nothing_known_of_the_start_is_the_centre() -> None:
    np.testing.assert_array_equal(MISSION.start_pose, 0.0)
    expected = dataclasses.replace(MISSION, start=KnownStart((1.0, -1.0, 0.5)))
    np.testing.assert_array_equal(expected.start_pose, [1.0, -1.0, 0.5])
