"""A quadrotor by an IMU or fixes that fail: what the filter knows of its state, and when it is OK again."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.invariant.inertial import InertialIekf, InertialIekfConfig
from mathnavi.interfaces.reading_counts import unused_in
from mathnavi.interfaces.signals import Array, Status
from mathnavi.studies.ranging.inertial_integrity import (
    BLOCKS,
    END,
    FAULTS,
    FORCE,
    IMU,
    ONSET,
    PERIOD,
    ImuFlight,
    _mission,
    _updates,
    _with_attitude,
    flown,
)

DURING = slice(round(ONSET / PERIOD), round(END / PERIOD))


def under(fault: str, until: float) -> tuple[Array, Array, Array]:
    """Times (n,) [s], whether the estimate is OK (n,), and its errors (n, 3) over the largest deviation of each block,
    of a flight under a fault, in its first seconds.
    """
    rng, mission = np.random.default_rng(100), _mission()
    flight = flown(rng, mission, fault)
    FAULTS[fault](flight, DURING, rng)
    estimator, times, ok, ratios = InertialIekf(InertialIekfConfig(), mission), [], [], []
    for k, (t, imu, command, fixes) in enumerate(_updates(flight)):
        if t > until:
            break
        estimate = _with_attitude(estimator.update(t, (*imu, *fixes), command), flight.attitudes[k])
        assert estimate.covariance is not None
        error = estimate.x - np.append(flight.truth[k], np.zeros(3))
        largest = [np.linalg.eigvalsh(estimate.covariance[at, at])[-1] for at in BLOCKS]
        times.append(t)
        ok.append(estimate.status is Status.OK)
        ratios.append([float(np.linalg.norm(error[at])) for at in BLOCKS] / np.sqrt(largest))
    return np.array(times), np.array(ok), np.array(ratios)


@pytest.mark.parametrize("fault", ["IMU silent for 3 s", "gyro stuck", "accelerometer stuck"])
def test_an_attitude_that_no_gyro_reads_is_as_unknown_as_it_says(fault: str) -> None:
    """One that is stuck is as good as silent, but for the few readings until it is known to be."""
    t, ok, ratios = under(fault, ONSET + 3.0)
    assert ok[t < ONSET].all()
    assert not ok[(t > ONSET + 0.7) & (t < ONSET + 3.0)].any()
    assert (ratios[t > ONSET, 2] < 4.5).all()


@pytest.mark.parametrize("fault", ["gyro bias 0.01 rad/s", "accelerometer bias 0.3 m/s^2"])
def test_biases_that_change_are_followed_and_the_estimate_is_right_again(fault: str) -> None:
    assert IMU.has_biases
    t, ok, ratios = under(fault, END + 20.0)
    assert ok[t > END + 17.0].all()
    assert (ratios[ok & (t > ONSET + 12.0)] < 3.5).all()


def test_fixes_that_are_stuck_are_not_used_and_those_that_jump_are_doubted_until_they_have_come_back() -> None:
    t, ok, ratios = under("fixes stuck", END + 2.0)
    assert not ok[t > ONSET + 1.0].any()
    assert (ratios[t > END + 1.5, 0] < 3.0).all()
    t, ok, _ = under("fixes 10 m off", END)
    assert not ok[t > ONSET + 0.2].any()


@pytest.mark.parametrize("fault", ["accelerometer in g", "accelerometer upside down"])
def test_thrusts_take_the_place_of_an_accelerometer_that_reads_what_they_cannot_do(
    fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The attitude of the gyro stays, and so does the estimate when the accelerometer is right again."""
    monkeypatch.setitem(FAULTS, "accelerometer upside down", _upside_down)
    t, ok, ratios = under(fault, END + 20.0)
    assert not ok[(t > ONSET + 0.7) & (t < END)].any()
    assert (ratios[t > ONSET + 0.2] < 4.5).all()
    assert ok[t > END + 18.0].all()


def test_an_imu_that_is_shaken_is_noisier_than_declared_and_used_as_such() -> None:
    t, ok, ratios = under("noise of the IMU times 10", END + 5.0)
    assert ok[t < ONSET].all()
    assert not ok[(t > ONSET + 0.5) & (t < END)].any()
    assert (ratios[t > ONSET + 0.5] < 4.5).all()
    assert ok[t > END + 2.5].all()


def _upside_down(flight: ImuFlight, during: slice, rng: np.random.Generator) -> None:
    flight.imu[during, FORCE] *= -1.0


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_thrusts_that_are_others_than_assumed_do_not_condemn_an_accelerometer(share: float) -> None:
    rng, mission = np.random.default_rng(100), _mission()
    flight = flown(rng, mission, "none")
    estimator = InertialIekf(InertialIekfConfig(), mission)
    for t, imu, command, fixes in list(_updates(flight))[:1500]:
        estimate = estimator.update(t, (*imu, *fixes), share * command)
    assert not unused_in(estimate.extra)
