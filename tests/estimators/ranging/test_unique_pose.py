"""The observer of Paper C is not believed at a pose that is not the only one with which its ranges agree."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.ranging.observer import RangeObserver
from mathnavi.interfaces.signals import Measurement, Status
from mathnavi.models.field.curve import EGG
from mathnavi.models.unicycle.quality import KnownStart
from mathnavi.studies.ranging import pose_integrity as part
from mathnavi.studies.ranging.integrity_judging import Watched


@pytest.mark.parametrize("noise", [0.005, 0.02])
def test_it_is_ok_where_all_is_as_declared(noise: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The noise of odometry is a part of what fitted ranges and rates may be off: without, up to 67 % were doubted."""
    monkeypatch.setattr(part, "NOISE", noise)
    monkeypatch.setattr(part, "DURATION", 15.0)
    drive = part.driven(np.random.default_rng(101), EGG)
    x, y, phi = drive.fine[0].tolist()
    observer = RangeObserver.build(RangeObserver.Config(), part._mission(KnownStart((x, y, phi), (0.05,) * 3), EGG))
    statuses = [observer.update(*update).status for update in part._updates(drive)]
    settled = round(part.SETTLED / part.PERIOD)
    assert all(each is Status.OK for each in statuses[settled:])


def test_without_a_start_it_is_ok_once_another_estimator_has_found_the_same() -> None:
    drive = part.driven(np.random.default_rng(102), EGG)
    observer = RangeObserver.build(RangeObserver.Config(), part._mission(None, EGG))
    for update, truth in zip(part._updates(drive), drive.truth, strict=True):
        estimate = observer.update(*update)
        if estimate.status is Status.OK:
            assert estimate.covariance is not None
            deviation = np.sqrt(np.linalg.eigvalsh(estimate.covariance[:2, :2])[-1])
            assert np.hypot(*(estimate.x - truth)[:2]) < 5.0 * deviation + 0.05


def test_lost_by_a_ray_that_is_blocked_it_is_not_sure_of_a_wrong_pose() -> None:
    """It settles at a pose turned by half a turn, with which its ranges agree nearly."""
    assert part.watched(Watched("range_observer", "a ray reads 0.3 m", 103, True)).judged == 0.0


def test_a_robot_that_stands_may_read_the_same_again_and_again() -> None:
    """Its ranges are rounded to more than their noise; where it moves, a ray that does so is stuck."""
    drive = part.driven(np.random.default_rng(102), EGG)
    x, y, phi = drive.truth[0].tolist()
    ranges = np.round(drive.ranges[0] - drive.noise[0], 2)
    observer = RangeObserver.build(RangeObserver.Config(), part._mission(KnownStart((x, y, phi), (0.05,) * 3), EGG))
    for k in range(400):
        t = part.PERIOD * (k + 1)
        read = (Measurement("ranges", t, ranges), Measurement("odometry", t, np.zeros(2)))
        estimate = observer.update(t, read, np.zeros(2))
    assert estimate.status is Status.OK
    assert estimate.extra["unused"].sum() == 0.0
