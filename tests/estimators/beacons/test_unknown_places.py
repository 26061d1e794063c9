"""Beacons at unknown places: found with the pose, said only when one place is left, and smoothed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.models.unicycle.beacons import exact_readings
from tests.estimators.beacons.drives import PLACES, Drive, drive, mission, wandering


def unknown(start: mn.KnownStart | None, *numbers: int) -> mn.BeaconMission:
    places = tuple(None if i in numbers else place for i, place in enumerate(PLACES))
    return dataclasses.replace(mission(surroundings=40.0), beacons=places, start=start)


def start_of(driven: Drive) -> mn.KnownStart:
    x, y, heading = driven.truth[0].tolist()
    return mn.KnownStart((x, y, heading), (0.01, 0.01, 0.001), float(driven.log.t[0]))


def test_all_places_are_found_in_the_frame_of_the_start_as_well_as_is_said_and_the_smoother_is_better() -> None:
    driven = drive(count=600)
    asked = unknown(start_of(driven), 0, 1, 2, 3)
    found, smoothed = (mn.estimate(method, asked, driven.log) for method in ("beacon_bank", mn.smoother("beacon_bank")))
    assert found.usable[-300:].all()
    assert found.figures["beacons"][3] == "beacon 1, x_2 [m]"
    first = int(np.argmax(found.usable))
    off = found.extra["beacons"][first:] - np.array(PLACES).ravel()
    assert np.nanmax(np.abs(off)) < 6.0, "no image of a beacon is said to be it"
    P = found.extra["beacons_covariance"][-1]
    assert off[-1] @ np.linalg.solve(P, off[-1]) < 26.1, "one in 1000"
    errors = [np.hypot(*(each.x - driven.truth)[found.usable, :2].T) for each in (found, smoothed)]
    assert np.square(errors[1]).mean() < np.square(errors[0]).mean()
    assert np.abs(smoothed.extra["beacons"][-1] - np.array(PLACES).ravel()).max() < 1.5


def test_an_outlier_among_the_first_readings_of_a_beacon_does_not_lead_the_smoother_astray() -> None:
    asked, driven, places = wandering(7)
    smoothed = mn.estimate(mn.smoother("beacon_bank"), asked, driven.log)
    off = smoothed.extra["beacons"][-1] - places.ravel()
    assert np.abs(off).max() < 2.0
    assert off @ np.linalg.solve(smoothed.extra["beacons_covariance"][-1], off) < 26.1, "one in 1000"


def test_with_some_known_the_start_is_found_too() -> None:
    driven = drive(count=400)
    found = mn.estimate("beacon_bank", unknown(None, 2, 3), driven.log)
    places = found.extra["beacons"][-1].reshape(4, 2)
    assert found.usable[-1]
    assert np.array_equal(places[:2], PLACES[:2])
    assert np.hypot(*(places - PLACES).T).max() < 1.5
    assert not found.extra["beacons_covariance"][-1][:4, :4].any()


def test_the_image_of_a_beacon_in_a_straight_path_is_as_likely_so_that_nothing_is_said() -> None:
    asked = mn.BeaconMission(
        (None,), ranges=mn.BeaconQuality(0.1), odometry=mn.OdometryQuality((0.02, 0.005)), period=0.2, interval=0.2,
        start=mn.KnownStart((0.0, 0.0, 0.0), (0.01, 0.01, 0.001)),
    )  # fmt: skip
    t = 0.2 * np.arange(1, 151)
    for turn, said in ((0.0, False), (0.1, True)):
        heading = turn * t
        x, y = (np.cumsum(0.2 * part(heading - 0.1 * turn)) for part in (np.cos, np.sin))
        rho = [exact_readings(np.array([(8.0, 5.0)]), 0, pose) for pose in np.column_stack([x, y, heading])]
        log = mn.SensorLog(t, {"beacon_ranges": np.array(rho), "odometry": np.tile([1.0, turn], (150, 1))})
        found = mn.estimate("beacon_bank", asked, log)
        assert found.usable.any() == said
        assert np.isfinite(found.extra["beacons"]).any() == said
        if said:
            first = int(np.argmax(found.usable))
            assert np.hypot(*(found.extra["beacons"][first:] - (8.0, 5.0)).T).max() < 2.0
        else:
            assert found.message[-1].endswith("for each beacon that was not given: 0")


def test_a_mission_without_a_frame_or_without_ranges_is_refused() -> None:
    driven = drive(count=10)
    with pytest.raises(ValueError, match="in what frame the pose is"):
        mn.estimate("beacon_bank", unknown(None, 0, 1, 2, 3), driven.log)
    with pytest.raises(mn.MissionError, match="without ranges"):
        dataclasses.replace(mission("bearings"), beacons=(None, (1.0, 2.0)))
    assert math.isnan(unknown(None, 0).places[0, 0])
