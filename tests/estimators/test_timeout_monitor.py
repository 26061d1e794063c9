"""Fresh readings are OK, old ones are lost, and before the first an estimator initialises."""

from __future__ import annotations

import pytest

from mathnavi.estimators.timeout_monitor import TimeoutMonitor, time_ahead
from mathnavi.interfaces.signals import Status


def test_it_initialises_until_a_reading_is_used_and_is_lost_after_the_timeout() -> None:
    timeout_monitor = TimeoutMonitor(0.5)

    def status(t: float, usable: bool) -> Status:
        timeout_monitor.note(t, usable)
        return timeout_monitor.status(t)

    assert status(0.0, False) is Status.INITIALISING
    assert status(9.0, False) is Status.INITIALISING
    assert status(10.0, True) is Status.OK
    assert status(10.5, False) is Status.OK
    assert status(10.51, False) is Status.LOST
    assert status(10.52, True) is Status.OK


def test_a_reading_from_before_the_filters_time_is_refused_but_for_rounding() -> None:
    assert time_ahead(2.5, 2.0, "a fix") == 0.5
    assert time_ahead(2.0 - 1e-10, 2.0, "a fix") == pytest.approx(0.0, abs=2e-10)
    with pytest.raises(ValueError, match=r"a fix at 1\.9\d* s reached a Kalman filter that is at 2\.0\d* s already"):
        time_ahead(1.9, 2.0, "a fix")
