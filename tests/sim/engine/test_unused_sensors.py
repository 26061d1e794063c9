"""A sensor whose readings its estimator never uses is noticed, once, and one that is used is not."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.full_state import FullState, FullStateConfig
from mathnavi.interfaces.signals import Measurement
from mathnavi.sim.engine.unused_sensors import UnusedReadings
from tests import flight


def reading(name: str, t: float) -> Measurement:
    return Measurement(name, t, np.array([t]))


def test_a_reading_that_is_used_stays_itself() -> None:
    unused = UnusedReadings(("speed",))
    (watched,) = unused.watched([reading("speed", 1.0)])
    assert isinstance(watched, Measurement)
    assert (watched.name, watched.t) == ("speed", 1.0)
    assert not unused.used
    assert watched.value == 1.0
    assert unused.used == {"speed"}
    plain = [reading("speed", 2.0)]
    assert unused.watched(plain) is plain


def test_readings_that_nobody_uses_are_found_once() -> None:
    unused, found = UnusedReadings(("sped", "ranges")), []
    for t in range(100):
        for each in unused.watched([reading("sped", t), reading("ranges", t), reading("log", t)]):
            if each.name == "ranges":
                assert each.value == t
        found.append(unused.found())
    assert [names for names in found if names] == [["sped"]]


class Misspelt(FullState):
    """Looks for readings of "full_state", and asks for a sensor of another name."""

    @staticmethod
    def build(config: FullStateConfig, mission: Any) -> FullState:
        return Misspelt(config, mission)

    @staticmethod
    def sensors(config: FullStateConfig, mission: Any) -> Sequence[Any]:
        (sensor,) = FullState.sensors(config, mission)
        return (dataclasses.replace(sensor, name="ful_state"),)


@pytest.mark.parametrize(("estimator", "events"), [(Misspelt, 1), (FullState, 0)])
def test_a_flight_says_that_its_sensor_is_not_read(estimator: Any, events: int, tmp_path: Any) -> None:
    near = flight.above(flight.mountains(), (2500.0, 2000.0), 150.0)
    terrain = flight.save(flight.mountains(), tmp_path / "mountains.npz")
    start = flight.above(flight.mountains(), flight.START, 150.0)
    run = mn.run("safe-flight", terrain=terrain, start=start, target=near, estimator=mn.plugin(estimator))
    found = [event for event in run.events if event.kind == "sensor-unused"]
    assert len(found) == events
    assert all("'ful_state'" in event.message for event in found)
