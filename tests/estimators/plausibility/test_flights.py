"""Fixes and readings of beacons of a flight in other units and conventions are named, and good ones never."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.plausibility.flights import misread
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.beacon_names import BEARINGS, DIFFERENCES, RANGES, BeaconKind
from tests.estimators.beacons.flights import FOUR, SIX, flight
from tests.estimators.beacons.test_flight_separation import EVERYTHING

READ: tuple[tuple[BeaconKind, ...], ...] = (EVERYTHING, ("ranges",), ("bearings",), ("range-differences",))


def read(kinds: tuple[BeaconKind, ...], seed: int = 0) -> tuple[mn.FlightMission, Array, dict[str, Array]]:
    """Mission, times and readings of a flight."""
    run = flight(SIX, seed, 3.0, read=kinds)
    t = np.array([sample[0] for sample in run.samples])
    sizes = {each.name: each.size for each in run.mission.beacons.sensors(run.mission.terrain)}  # type: ignore[union-attr]
    readings = {name: np.full((len(t), size), np.nan) for name, size in sizes.items()}
    for k, (_, given, _) in enumerate(run.samples):
        for each in given:
            readings[each.name][k] = each.value
    return run.mission, t, readings


@pytest.mark.parametrize("kinds", READ)
def test_good_readings_are_never_refused(kinds: tuple[BeaconKind, ...]) -> None:
    for seed in range(4):
        mission, t, readings = read(kinds, seed)
        assert misread(mission, t, readings) == ""
        off = replace(mission, start=(mission.start[0] + 500.0, mission.start[1], mission.start[2]))
        assert misread(off, t, readings) == ""


def compass(y: Array) -> Array:
    n = y.shape[1] // 2
    return np.hstack([90.0 - np.rad2deg(y[:, :n]), np.rad2deg(y[:, n:])])


@pytest.mark.refused("sensor log", "readings of a flight in other units, or of a compass")
@pytest.mark.parametrize(
    ("kind", "sensor", "change", "said"),
    [
        ("ranges", RANGES, lambda y: 1000.0 * y, "as millimetres"),
        ("ranges", RANGES, lambda y: 100.0 * y, "as centimetres"),
        ("ranges", RANGES, lambda y: y / 343.0, "as times of sound"),
        ("range-differences", DIFFERENCES, lambda y: 1000.0 * y, "as millimetres"),
        ("range-differences", DIFFERENCES, lambda y: y / 299_792_458.0, "as times of radio"),
        ("bearings", BEARINGS, np.rad2deg, "as degrees in azimuths"),
        ("bearings", BEARINGS, compass, "as those of a compass in degrees"),
    ],
)
def test_other_units_are_named(kind: BeaconKind, sensor: str, change: Callable[[Array], Array], said: str) -> None:
    mission, t, readings = read((kind,))
    assert said in misread(mission, t, readings | {sensor: change(readings[sensor])})


def test_fixes_in_millimetres_are_refused_before_an_estimate() -> None:
    mission = replace(read(("ranges",))[0], beacons=None)
    t = np.arange(0.0, 3.0, 0.1)
    fixes = np.tile(mission.start, (len(t), 1))
    log = mn.SensorLog(t, {"position": 1000.0 * fixes}, np.zeros((len(t), 3)))
    with pytest.raises(mn.LogError, match=r"position fit the declared start only as millimetres .*multiply by 0.001"):
        mn.estimate("kalman", replace(mission, control_period=0.1), log)
    assert misread(mission, t, {"position": fixes}) == ""


def test_two_lengths_tell_nothing() -> None:
    mission, t, readings = read(("ranges",))
    assert mission.beacons is not None
    two = replace(mission, beacons=FlightBeacons(FOUR[:2]))
    assert misread(two, t, {RANGES: 1000.0 * readings[RANGES][:, :2]}) == ""
