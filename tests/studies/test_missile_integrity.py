"""A missile whose readings fail: which channel its filter leaves out, and how well it knows the others."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.missile_kalman import MissileKalman, MissileKalmanConfig
from mathnavi.interfaces.signals import Array, Status
from mathnavi.studies.ranging import missile_integrity as study
from mathnavi.studies.ranging.missile_integrity import BLOCKS, FAULTS, ONSET, PERIOD

CHANNELS = {
    "position stuck": "position", "velocity 5 m/s off": "velocity", "attitude 0.1 rad off": "attitude",
    "rates stuck": "rates",
}  # fmt: skip


def under(fault: str, lasts: float, after: float, seed: int = 100) -> tuple[Array, Array, list[str], Array]:
    """Times (n,) [s], whether estimates are OK (n,), their messages, and their errors (n, 4) over the largest deviation
    of each block, of a flight with a fault that ``lasts`` [s], until some time ``after`` it.
    """
    rng, mission = np.random.default_rng(seed), study._mission()
    flight = study.flown(rng, mission, fault)
    FAULTS[fault](flight, slice(round(ONSET / PERIOD), round((ONSET + lasts) / PERIOD)), rng)
    estimator, times, ok, messages, ratios = MissileKalman(MissileKalmanConfig(), mission), [], [], [], []
    for truth, (t, readings, command) in zip(flight.truth, study._updates(flight), strict=True):
        if t > ONSET + lasts + after:
            break
        estimate = estimator.update(t, readings, command)
        assert estimate.covariance is not None
        largest = [np.linalg.eigvalsh(estimate.covariance[at, at])[-1] for at in BLOCKS]
        times.append(t - ONSET)
        ok.append(estimate.status is Status.OK)
        messages.append(estimate.message)
        ratios.append([float(np.linalg.norm((estimate.x - truth)[at])) for at in BLOCKS] / np.sqrt(largest))
    return np.array(times), np.array(ok), messages, np.array(ratios)


@pytest.mark.parametrize("fault", CHANNELS)
def test_the_channel_that_fails_is_left_out_and_the_others_tell_the_state_until_it_is_back(fault: str) -> None:
    t, ok, messages, ratios = under(fault, 3.0, 3.0)
    assert ok[(t > -5.0) & (t < 0.0)].all()
    during = (t > 0.2) & (t < 3.0)
    assert {message for message, at in zip(messages, during, strict=True) if at} == {
        f"leaves out the {CHANNELS[fault]}, which disagrees"
    }
    assert not ok[during].any()
    assert (ratios[t > 0.2] < 5.0).all()
    assert not any("leaves out" in message for message, at in zip(messages, t > 5.3, strict=True) if at)


def test_a_position_that_stays_off_is_followed_with_its_leap_in_the_covariance_until_it_leaps_back() -> None:
    t, ok, messages, ratios = under("position 10 m off", 25.0, 3.0)
    assert ok[(t > 23.0) & (t < 25.0)].all()
    assert (ratios[ok] < 4.5).all()
    assert not ok[t > 25.2].any()
    assert "leaves out" not in messages[-1]
    assert 0.1 < ratios[-1, 0] < 4.5  # no leap is left in its covariance


def test_a_position_that_leaps_and_a_velocity_that_is_blamed_for_it_leave_the_leap_in_the_covariance() -> None:
    t, ok, messages, ratios = under("position 3 m off", 24.0, 0.0, seed=113)
    assert any("leaves out the velocity" in message for message in messages)
    assert ok[t > 23.0].all()
    assert (ratios[t > 23.0] < 3.0).all()


def test_a_position_is_not_read_again_where_the_estimate_has_only_drifted_towards_it() -> None:
    t, _, messages, _ = under("position 3 m off", 19.0, 0.0, seed=106)
    assert {message for message, at in zip(messages, t > 0.2, strict=True) if at} == {
        "leaves out the position, which disagrees"
    }


def test_an_attitude_of_which_nothing_is_left_is_the_one_that_is_read() -> None:
    t, ok, _, ratios = under("all stuck", 30.0, 22.0)
    assert (ratios[t > 31.0] < 5.0).all()
    assert ok[-1]
