"""Fresh readings are OK, old ones are lost, before the first an estimator initialises, and after a gap it converges."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.timeout_monitor import TimeoutMonitor, is_late, time_ahead, waiting, worst
from mathnavi.interfaces.signals import Status


def status(
    monitor: TimeoutMonitor, t: float, usable: bool, deviation: float | None = None, agrees: bool = True
) -> Status:
    monitor.note(t, usable, agrees)
    return monitor.status(t, None if deviation is None else np.diag([deviation**2, 1.0]))


def test_it_initialises_until_a_reading_is_used_and_is_lost_after_the_timeout() -> None:
    monitor = TimeoutMonitor(0.5, 0.1)
    assert status(monitor, 0.0, False) is Status.INITIALISING
    assert status(monitor, 9.0, False) is Status.INITIALISING
    assert status(monitor, 10.0, True) is Status.OK
    assert status(monitor, 10.5, False) is Status.OK
    assert status(monitor, 10.51, False) is Status.LOST
    assert status(TimeoutMonitor(0.5, 0.1, settling=0.0), 0.0, True) is Status.OK


def test_after_a_longer_gap_it_is_degraded_until_readings_have_agreed_for_as_long_as_it_takes() -> None:
    """A gap counts whether somebody looked in between or not; readings have to agree for the timeout in the end."""
    monitor = TimeoutMonitor(0.5, 0.1, settling=1.0)
    assert status(monitor, 0.0, True) is Status.OK
    assert status(monitor, 3600.0, True) is Status.DEGRADED
    assert status(monitor, 3600.4, True, agrees=False) is Status.DEGRADED
    assert status(monitor, 3600.9, True, agrees=False) is status(monitor, 3601.3, True) is Status.DEGRADED
    assert status(monitor, 3601.4, True) is Status.OK
    assert status(monitor, 3601.8, True, agrees=False) is Status.OK, "without a gap its own gate judges a reading"
    assert status(monitor, 3602.31, False) is Status.LOST
    assert status(monitor, 3602.4, True) is Status.DEGRADED


def test_it_says_why_it_is_not_ok() -> None:
    monitor = TimeoutMonitor(0.5, 0.1, of="fixes")
    assert (status(monitor, 0.0, False), monitor.message) == (Status.INITIALISING, "")
    assert (status(monitor, 3.0, True), monitor.message) == (Status.OK, "")
    assert (status(monitor, 3.6, False), monitor.message) == (Status.LOST, "has used no fixes since 3 s")
    assert status(monitor, 4.0, True) is Status.DEGRADED
    assert monitor.message == "has not converged yet after a gap in its fixes that ended at 4 s"
    assert (status(monitor, 4.5, True), monitor.message) == (Status.OK, "")
    monitor.restart(4.6)
    assert status(monitor, 4.7, True) is Status.DEGRADED
    assert monitor.message == "has not converged yet after it was wrong at 4.6 s"


def test_it_is_degraded_as_long_as_it_is_less_sure_than_it_was_when_it_was_ok() -> None:
    monitor = TimeoutMonitor(0.5, 0.1, settling=0.0)
    assert status(monitor, 0.0, True, 1.0) is Status.OK
    assert status(monitor, 9.0, True, 1.6) is status(monitor, 9.1, True, np.nan) is Status.DEGRADED
    assert status(monitor, 9.2, True, 1.4) is status(monitor, 9.3, True, 9.0) is Status.OK


def test_one_reading_of_a_slow_sensor_may_be_missing_and_a_sensor_may_be_one_of_several() -> None:
    slow, beside = TimeoutMonitor(0.5, 1.0), TimeoutMonitor(0.5, 0.1, beyond=Status.DEGRADED)
    assert status(slow, 0.0, True) is status(slow, 2.0, True) is Status.OK
    assert status(slow, 4.2, True) is Status.DEGRADED
    assert status(beside, 0.0, True) is Status.OK
    assert beside.status(0.6) is Status.DEGRADED


def test_the_worst_status_of_several_sensors_is_that_of_the_estimate_which_says_what_it_waits_for() -> None:
    ok, degraded, lost, new = Status.OK, Status.DEGRADED, Status.LOST, Status.INITIALISING
    assert [worst(ok, ok), worst(ok, degraded), worst(degraded, lost), worst(lost, new)] == [ok, degraded, lost, new]
    assert [status.usable for status in (ok, degraded, lost, new)] == [True, True, False, False]
    assert (waiting(new, "a fix"), waiting(lost, "a fix")) == ("waits for a fix", "")


def test_a_reading_from_before_the_filters_time_is_late_but_for_rounding_and_an_estimate_is_refused() -> None:
    assert [is_late(t, 2.0) for t in (2.5, 2.0 - 1e-10, 1.9)] == [False, False, True]
    assert not is_late(1.9, None)
    assert time_ahead(2.5, 2.0) == 0.5
    assert time_ahead(2.0 - 1e-10, 2.0) == pytest.approx(0.0, abs=2e-10)
    with pytest.raises(ValueError, match=r"at 1\.9\d* s was asked of a filter that is at 2\.0\d* s already"):
        time_ahead(1.9, 2.0)
