"""As many states are indistinguishable as rotations map the wall onto itself, if the input excites (Definition C.8)."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.observability.output_flow import indistinguishable_states, small_time
from mathnavi.estimators.observability.range_outputs import motion_under, pose_difference
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.patterns import figure_eight
from tests.estimators.observability.fields import CIRCLE, EGG, ELLIPSE, sensors

EIGHT = motion_under(lambda t: figure_eight(t, 0.5, 8.0), 4.0, 12)
STRAIGHT = motion_under(lambda t: (0.3, 0.0), 1.0, 6)
X = np.array([0.3, -0.1, 0.4])
CLOVER = Curve(((0.0, 0.0, 0.0, 0.0), (2.0, 0.0, 0.0, 2.0), (0.15, 0.0, 0.0, -0.15)), "clover")  # of order 3


@pytest.mark.parametrize("degrees", [(0.0,), (-90.0, -45.0), (-60.0, 60.0), (0.0, 90.0, 180.0, 270.0)])
def test_in_the_ellipse_there_are_exactly_two(degrees: tuple[float, ...]) -> None:
    outputs = sensors(ELLIPSE, *degrees)
    found = indistinguishable_states(outputs, X, [EIGHT], np.random.default_rng(0), starts=60)
    np.testing.assert_allclose(pose_difference(found.states, ELLIPSE.images(X)), 0.0, atol=1e-6)
    assert found.hits.min() >= 3


@pytest.mark.parametrize(("curve", "count"), [(EGG, 1), (CLOVER, 3)])
def test_in_other_walls_as_many_as_rotations(curve: Curve, count: int) -> None:
    found = indistinguishable_states(sensors(curve, -60.0, 60.0), X, [EIGHT], np.random.default_rng(0), starts=60)
    assert len(found.states) == curve.symmetry == count


def test_one_sensor_along_the_heading_learns_nothing_more_from_driving_straight() -> None:
    """It sees one point of the wall only, Example C.1."""
    found = indistinguishable_states(sensors(ELLIPSE, 0.0), X, [STRAIGHT], np.random.default_rng(0), starts=30)
    assert len(found.states) > 10


def test_every_state_reads_the_same() -> None:
    outputs = sensors(ELLIPSE, -60.0, 60.0)
    y, _ = outputs.along(X, STRAIGHT)
    for x in indistinguishable_states(outputs, X, [STRAIGHT], np.random.default_rng(1), starts=30).states:
        np.testing.assert_allclose(outputs.along(x, STRAIGHT)[0], y, atol=1e-8)


def test_the_ellipse_is_weakly_small_time_observable_and_not_small_time_observable() -> None:
    outputs, inputs = sensors(ELLIPSE, -60.0, 60.0), (lambda t: (0.5, 0.0), lambda t: (0.0, 1.0))
    for T in (0.5, 0.05):
        found = small_time(outputs, X, T, inputs, np.random.default_rng(0), starts=40)
        assert len(found.others) == 1
        assert found.weakly_observable
        assert not found.observable


def test_the_egg_is_small_time_observable() -> None:
    outputs, inputs = sensors(EGG, -60.0, 60.0), (lambda t: (0.5, 0.0), lambda t: (0.0, 1.0))
    found = small_time(outputs, X, 0.3, inputs, np.random.default_rng(0), starts=40)
    assert found.observable
    assert found.nearest == np.inf


def test_a_circle_is_not_even_weakly_observable_and_nor_is_a_robot_that_stands_still() -> None:
    rng = np.random.default_rng(0)
    assert not small_time(sensors(CIRCLE, -60.0, 60.0), X, 0.3, [lambda t: (0.5, 0.5)], rng, 10).weakly_observable
    assert not small_time(sensors(ELLIPSE, -60.0, 60.0), X, 0.3, [lambda t: (0.0, 0.0)], rng, 10).weakly_observable
    assert small_time(sensors(ELLIPSE, 0.0, 120.0, 240.0), X, 0.3, [lambda t: (0.0, 0.0)], rng, 10).weakly_observable


def test_a_motion_out_of_the_field_is_refused() -> None:
    motion = motion_under(lambda t: (9.0, 0.0), 1.0)
    with pytest.raises(ValueError, match="a motion leaves the field"):
        indistinguishable_states(sensors(ELLIPSE, 0.0), X, [motion], np.random.default_rng(0))
