"""A faulty sensor loses readings; the others equal those of the faultless one."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.models.sensor_faults import Dropout, Outage
from mathnavi.models.unicycle.mission import RangeSensor, RangingMission
from mathnavi.models.unicycle.quality import RangeQuality
from tests.unicycle import STANDARD, Imagined

MISSION = RangingMission(STANDARD, (-1.5, -0.8, 0.3), ranging=RangeQuality(0.05))
SENSOR, _ = MISSION.sensors_carried()
POSE = np.array([1.0, -0.4, 0.7])


def test_dropout_loses_its_share_and_leaves_the_other_readings_alone() -> None:
    motion, faulty = Imagined(MISSION, POSE), Dropout(SENSOR, 0.3, np.random.default_rng(1))
    noise, faulty_noise = np.random.default_rng(2), np.random.default_rng(2)
    lost = 0
    for _ in range(3000):
        reading, faulty_reading = SENSOR.read(motion, noise), faulty.read(motion, faulty_noise)
        if faulty_reading is None:
            lost += 1
        else:
            np.testing.assert_array_equal(faulty_reading, reading)
    assert lost / 3000 == pytest.approx(0.3, abs=0.04)
    assert (faulty.name, faulty.size, faulty.rate) == (SENSOR.name, SENSOR.size, SENSOR.rate)


@pytest.mark.parametrize("rate", [-0.1, 1.1, np.nan])
def test_an_impossible_dropout_rate_is_refused(rate: float) -> None:
    with pytest.raises(ValueError, match="ranges: dropout rate"):
        Dropout(SENSOR, rate, np.random.default_rng(0))


def test_an_outage_takes_readings_and_leaves_the_others_as_they_are() -> None:
    motion = Imagined(MISSION, POSE)
    holed = Outage(SENSOR, ((0.02, 0.05), (0.1, 0.2)))
    one, other = np.random.default_rng(3), np.random.default_rng(3)
    arrived = []
    for k in range(15):
        expected, reading = SENSOR.read(motion, one), holed.read(motion, other)
        if reading is not None:
            arrived.append(k)
            np.testing.assert_array_equal(reading, expected)
    assert arrived == [0, 1, 5, 6, 7, 8, 9]


def test_an_outage_needs_a_rate_to_know_the_time() -> None:
    with pytest.raises(ValueError, match=r"ranges: rate = None; allowed"):
        Outage(RangeSensor(1, RangeQuality(), 7.0, None), ((0.0, 1.0),))
