"""A quadruped in the study of integrity: its readings without a fault are quiet, and an IMU that is wrong is found."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from mathnavi.interfaces.signals import Status
from mathnavi.studies.ranging import legged_integrity as legs

WALK = legs.walked(3)
SHORT = dataclasses.replace(WALK, readings=WALK.readings[:450], commands=WALK.commands[:450])


@pytest.mark.parametrize("fault", ["accelerometer in g", "gyro in deg/s", "accelerometer stuck"])
def test_an_imu_that_contradicts_the_feet_is_doubted_for_good(fault: str) -> None:
    estimates = legs.estimated(SHORT, WALK.mission, fault, monitored=True)
    before = [each for each in estimates if 0.1 < each.t < legs.ONSET]
    assert all(each.status is Status.OK for each in before)
    assert all(each.status is not Status.OK for each in estimates if each.t > legs.ONSET + 0.7)
    bare = legs.estimated(SHORT, WALK.mission, fault, monitored=False)
    nq = WALK.mission.system.manifold.size
    errors = [np.linalg.norm(each.x[nq : nq + 3] - truth[3:6]) for each, truth in zip(bare, WALK.truth, strict=False)]
    assert max(e for e, each in zip(errors, bare, strict=True) if each.status is Status.OK) > 0.1  # m/s, and sure


def test_the_place_is_within_what_is_declared() -> None:
    estimates = legs.estimated(SHORT, WALK.mission, "none", monitored=True)
    for each, truth in zip(estimates[::50], WALK.truth[::50], strict=False):  # only the beginning
        assert np.linalg.norm(each.x[:3] - truth[:3]) < 3.0 * each.extra["base_deviation"][6:].max()
