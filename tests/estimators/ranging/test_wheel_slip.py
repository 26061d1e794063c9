"""Wheels are expected to slip while they change their speed, and no more than they do on the whole."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.ranging.slip_weight import SlipWeight

DT = 0.01  # [s]


def weights_under(inputs: np.ndarray) -> np.ndarray:
    """Weights (n, 2) under inputs (n, 2) [m/s, rad/s], one a period."""
    slip = SlipWeight()
    return np.array([slip.update(u, DT) for u in inputs])


@pytest.mark.parametrize(("changed", "other"), [(0, 1), (1, 0)])
def test_a_change_of_speed_or_of_turn_rate_is_when_place_or_heading_slips(changed: int, other: int) -> None:
    inputs = np.zeros((1200, 2))
    inputs[:, changed] = np.where(np.arange(1200) // 300 % 2, 1.0, -1.0) * (1.0, 8.0)[changed]
    weights = weights_under(inputs)
    at_once, later = weights[900:905], weights[1195:]
    assert (at_once[:, changed] > 5.0).all()
    assert (later[:, changed] < 0.1).all()
    assert (at_once[:, other] < 0.1).all()


def test_the_weights_have_the_mean_one() -> None:
    k = np.arange(6000)
    inputs = np.column_stack([np.sin(0.05 * k), 8.0 * np.sin(0.05 * k)])
    assert weights_under(inputs)[1000:].mean() == pytest.approx(1.0, abs=0.05)


def test_a_robot_that_drives_evenly_may_slip_as_well() -> None:
    weights = weights_under(np.full((3000, 2), 0.5))
    np.testing.assert_allclose(weights[-1], [1.0, 1.0], atol=0.1)


def test_slip_lasts_longer_after_a_greater_change_of_speed() -> None:
    def lasting(change: float) -> int:
        weights = weights_under(np.repeat([[0.0, 0.0], [change, 0.0]], 300, axis=0))[300:, 0]
        return int((weights > weights[-1] * 2.0).sum())

    assert lasting(1.0) == pytest.approx(2 * lasting(0.5), rel=0.2)


def test_a_robot_that_turns_on_the_spot_after_driving_slides_to_its_side() -> None:
    driving, turning = np.tile([1.0, 0.0], (300, 1)), np.tile([0.0, 2.0], (100, 1))
    after_driving, from_rest = (weights_under(np.vstack([before, turning])) for before in (driving, 0.0 * driving))
    assert (after_driving[300:340, 0] > 5.0 * from_rest[300:340, 0]).all()
