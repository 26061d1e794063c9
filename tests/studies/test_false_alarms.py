"""When an alarm is false: the estimate was right before it and until it ended."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.interfaces.signals import Estimate, Status
from mathnavi.studies.introduction.false_alarms import SETTLED, settled

PERIOD = 0.1


def estimates(statuses: list[Status]) -> list[Estimate]:
    return [Estimate(PERIOD * k, np.zeros(1), np.eye(1), status) for k, status in enumerate(statuses)]


@pytest.mark.parametrize(("wrong_from", "false"), [(None, True), (55, False), (45, False), (10, True), (85, True)])
def test_an_alarm_about_an_estimate_that_is_wrong_is_not_false(wrong_from: int | None, false: bool) -> None:
    """It may be wrong up to three seconds before the alarm, from 6 to 8 s here; or during it."""
    found = estimates([Status.OK] * 60 + [Status.DEGRADED] * 20 + [Status.OK] * 20)
    wrong = np.zeros(100, np.bool_)
    if wrong_from is not None:
        wrong[wrong_from : wrong_from + 10] = True
    begun, alarm, is_false = settled(found, wrong)
    assert begun == 0.0
    assert alarm.sum() == 20
    assert is_false.sum() == (20 if false else 0)


def test_alarms_count_once_an_estimator_has_settled() -> None:
    early = estimates([Status.INITIALISING] * 10 + [Status.OK] * 5 + [Status.LOST] * 10 + [Status.OK] * 75)
    begun, alarm, false = settled(early, np.zeros(100, np.bool_))
    assert begun == pytest.approx(1.0)
    assert len(alarm) == len(false) == 100 - round((1.0 + SETTLED) / PERIOD)
    assert not alarm.any()
    assert np.isnan(settled(estimates([Status.LOST] * 5), np.zeros(5, np.bool_)).begun)
