"""An attitude sensor that leaps or is late is doubted, and the deviation of the attitude has the leap."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.signals import Estimate, Status
from mathnavi.sim.plugin.registry import load
from mathnavi.studies.ranging import body_integrity as part
from mathnavi.studies.ranging.integrity_judging import Watched

AFTER = round((part.ONSET + 6.0) / part.PERIOD)  # updates; the doubt about a leap has passed


@pytest.mark.parametrize("estimator", part.ESTIMATORS)
def test_a_healthy_one_is_ok_and_one_that_is_late_is_not(estimator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(part, "DURATION", 12.0)
    monkeypatch.setattr(part, "END", 11.0)
    healthy = part.watched(Watched(estimator, "none", 100, True))
    assert healthy.false == healthy.position == healthy.rest == 0.0
    assert math.isnan(healthy.detected)
    late = part.watched(Watched(estimator, "readings 50 ms late", 100, True))
    assert late.judged == 0.0
    assert late.detected < 0.1


def estimated(fault: str, seconds: float) -> list[Estimate]:
    """Estimates of a body under a fault, for a while from the start on."""
    rng, during = np.random.default_rng(101), slice(round(part.ONSET / part.PERIOD), round(part.END / part.PERIOD))
    body = part.turning(rng, "none")
    part.FAULTS[fault](body, during, rng)
    plugin: Any = load("estimators", "riemannian_observer")
    estimator = plugin.build(plugin.Config(), part._mission())
    updates = list(part._updates(body))[: round(seconds / part.PERIOD)]
    return [estimator.update(*update) for update in updates]


def test_a_leap_is_a_deviation_of_the_attitude_until_it_leaps_back() -> None:
    found = estimated("attitude 0.2 rad off", part.END + 6.0)
    assert np.linalg.norm(found[AFTER].extra["deviation"][:3]) == pytest.approx(part.SLIP, rel=0.1)
    assert np.linalg.norm(found[-1].extra["deviation"][:3]) < 0.01
    assert found[-1].status is Status.OK


def test_late_readings_are_named_with_their_delay() -> None:
    found = estimated("readings 50 ms late", part.END + 3.0)
    assert found[AFTER].status is Status.DEGRADED
    delay = float(found[AFTER].message.partition("that are ")[2].partition(" s late")[0])
    assert delay == pytest.approx(part.LATE, abs=0.01)
    assert found[-1].status is Status.OK
