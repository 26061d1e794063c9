"""Logs of beacons in other units and signs, those whose places are, and those that are right."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.plausibility.checks import Recording, finished, misread
from mathnavi.interfaces.signals import Array
from tests.estimators.beacons.drives import PLACES, SENSORS, Drive, drive, mission, wandering

KINDS = tuple(SENSORS)
DEGREES = 180.0 / math.pi


@cache
def driven(kind: str) -> Drive:
    """A drive of which one kind is read."""
    return drive(kind)


def said(
    of: mn.BeaconMission, log: mn.SensorLog, factor: float | Array = 1.0, odometry: tuple[float, float] = (1.0, 1.0)
) -> str:
    """What is said of a log whose readings of beacons, and of odometry, are multiplied by factors."""
    read = {
        name: values * (np.array(odometry) if name == "odometry" else factor) for name, values in log.readings.items()
    }
    return finished(misread(of, Recording(log.t, read, np.zeros((len(log.t), 2)), columns=log.columns)))


@pytest.mark.refused("sensor log", "beacons in other units, or with the other sign")
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(
    ("kind", "factor", "expected"),
    [
        ("ranges", 1e3, "as millimetres in beacon_ranges ("),
        ("ranges", 1e2, "as centimetres in beacon_ranges ("),
        ("ranges", 1.0 / 343.0, "as times of sound in seconds in beacon_ranges ("),
        ("range_differences", 1e3, "as millimetres in beacon_differences ("),
        ("range_differences", 1.0 / 299_792_458.0, "as times of radio in seconds in beacon_differences ("),
        ("bearings", DEGREES, "as degrees in beacon_bearings ("),
        ("bearings", -1.0, "with the other sign in beacon_bearings ("),
        ("bearings", -DEGREES, "as degrees with the other sign in beacon_bearings ("),
    ],
)
def test_readings_in_another_unit_contradict_odometry_at_known_and_unknown_places(
    kind: str, factor: float, expected: str, known: bool
) -> None:
    if known:
        of, log = mission(kind), driven(kind).log
    else:
        of, seen, _ = wandering(2, read=(kind,) * 4, known=(0,))
        log = seen.log
    assert expected in said(of, log, factor)
    assert said(of, log) == ""


@pytest.mark.parametrize(
    ("kind", "odometry", "expected"),
    [
        ("ranges", (1e3, 1.0), "as mm/s in column 0 of odometry, the speed"),
        ("ranges", (1e2, 1.0), "as cm/s in column 0 of odometry, the speed"),
        ("bearings", (1.0, DEGREES), "as deg/s in column 1 of odometry, the turn rate"),
    ],
)
def test_odometry_in_another_unit_contradicts_readings_that_fit_the_places(
    kind: str, odometry: tuple[float, float], expected: str
) -> None:
    assert expected in said(mission(kind), driven(kind).log, odometry=odometry)


@pytest.mark.refused("sensor log", "places of beacons in other units")
@pytest.mark.parametrize(
    ("places", "expected"),
    [
        ([(1e3 * x, 1e3 * y) for x, y in PLACES], "as millimetres in the places of the beacons (-20000 to 30000)"),
        ([(1e2 * x, 1e2 * y) for x, y in PLACES], "as centimetres in the places of the beacons"),
        (
            [(59.0 + y / 111_320, 18.0 + x / 57_334) for x, y in PLACES],
            "as degrees of latitude and longitude in",
        ),
    ],
)
def test_places_in_another_unit_contradict_readings_that_fit_odometry(
    places: list[tuple[float, float]], expected: str
) -> None:
    assert expected in said(dataclasses.replace(mission(), beacons=tuple(places)), driven("ranges").log)


def test_lengths_and_odometry_in_millimetres_contradict_the_places_together() -> None:
    text = said(mission(), driven("ranges").log, 1e3, (1e3, 1.0))
    assert "as millimetres in beacon_ranges" in text
    assert "as mm/s in column 0 of odometry" in text


def test_a_beacon_alone_in_another_unit_is_named_with_its_column_before_a_run() -> None:
    log = driven("ranges").log
    columns = {"beacon_ranges": ("r0", "r1", "r2", "r3")}
    read = {**log.readings, "beacon_ranges": log.readings["beacon_ranges"] * [1.0, 1.0, 1e3, 1.0]}
    mixed = mn.SensorLog(log.t, read, columns=columns)
    with pytest.raises(mn.LogError) as refused:
        mn.estimate("beacon_bank", mission(), mixed)
    assert "only as millimetres in beacon 2 of beacon_ranges (column 'r2', " in str(refused.value)
    assert "allowed: metres: multiply by 0.001; trust_units=True takes them as they are" in str(refused.value)
    turned = driven("bearings").log
    assert "as degrees in beacon 3 of beacon_bearings (column 3, " in said(
        mission("bearings"), turned, np.array([1.0, 1.0, 1.0, DEGREES])
    )


@pytest.mark.parametrize("kind", [*KINDS, "+".join(KINDS)])
def test_outliers_few_readings_a_robot_at_rest_and_a_wrong_scale_are_no_evidence(kind: str) -> None:
    for seen in (drive(kind, outliers=0.2), drive(kind, count=30), drive(kind, scale=0.3)):
        assert said(mission(kind), seen.log) == ""
    log = driven(kind).log
    still = {
        name: np.where(np.isfinite(values), 0.0 if name == "odometry" else values[np.isfinite(values)][0], np.nan)
        for name, values in log.readings.items()
    }
    assert said(mission(kind), mn.SensorLog(log.t, still)) == ""
    silent = {name: np.full_like(values, np.nan) for name, values in log.readings.items()}
    assert said(mission(kind), mn.SensorLog(log.t, silent)) == ""
    assert said(mission(kind), mn.SensorLog(log.t, {**log.readings, "odometry": silent["odometry"]})) == ""


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", KINDS)
def test_drives_among_unknown_places_are_not_refused(kind: str, seed: int) -> None:
    of, seen, _ = wandering(seed, read=(kind,) * 4, known=(0,))
    assert said(of, seen.log) == ""


def test_odometry_as_inputs_is_compared_too() -> None:
    of, log = dataclasses.replace(mission("bearings"), odometry_is_input=True), driven("bearings").log
    rows = np.isfinite(log.readings["odometry"]).all(axis=1)
    held = log.readings["odometry"][rows][np.minimum(np.cumsum(rows), rows.sum() - 1)]
    read = {"beacon_bearings": log.readings["beacon_bearings"] * DEGREES}
    with pytest.raises(mn.LogError, match="as degrees in beacon_bearings"):
        mn.estimate("beacon_bank", of, mn.SensorLog(log.t, read, held))
