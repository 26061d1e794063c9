"""Beacons at unknown places: found with the pose, said only when one place is left, and smoothed."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.models.unicycle.beacons import exact_readings
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
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


RANGES, BEARINGS, DIFFERENCES = "ranges", "bearings", "range_differences"
ALL = "ranges+bearings+range_differences"


@pytest.mark.parametrize(
    ("read", "known", "started"),
    [
        ((BEARINGS,) * 4, (), True),
        ((BEARINGS,) * 4, (0, 1), False),
        ((DIFFERENCES,) * 4, (0,), True),
        ((DIFFERENCES,) * 4, (1, 2), True),  # beacon 0 itself is found by them
        ((DIFFERENCES,) * 4, (0, 1, 2), False),
        ((RANGES, DIFFERENCES, DIFFERENCES, DIFFERENCES), (), True),
        ((RANGES, BEARINGS, DIFFERENCES, ALL), (), True),
    ],
)
def test_places_are_found_by_what_is_read_of_each_beacon_as_well_as_is_said(
    read: tuple[str, ...], known: tuple[int, ...], started: bool
) -> None:
    asked, driven, places = wandering(3, read=read, known=known, started=started)
    if started:  # the smoother begins with the first reading
        x, y, heading = driven.truth[0].tolist()
        asked = dataclasses.replace(asked, start=mn.KnownStart((x, y, heading), (0.01,) * 3, float(driven.log.t[0])))
    for method in ("beacon_bank", mn.smoother("beacon_bank")):
        found = mn.estimate(method, asked, driven.log)
        difference = found.x - driven.truth
        difference[:, 2] = wrapped(difference[:, 2])
        assert found.ok[-100:].all()
        assert not sure_and_wrong(found.t, found.ok, difference, found.covariance).any()
        at = np.flatnonzero(found.ok)
        off, P = found.extra["beacons"][at] - places.ravel(), found.extra["beacons_covariance"][at]
        for i in asked.unknown:
            own = slice(2 * i, 2 * i + 2)
            squares = np.einsum("ki,ki->k", off[:, own], np.linalg.solve(P[:, own, own], off[:, own, None])[..., 0])
            assert squares.max() < 13.8, "the region of 99.9 %"
        assert np.abs(off[-1]).max() < 2.0


@pytest.mark.parametrize(
    ("seed", "fields"),
    [
        (8, {"read": (RANGES, DIFFERENCES, DIFFERENCES, DIFFERENCES)}),  # images by range differences
        (10, {"read": (DIFFERENCES,) * 4, "known": (0, 1, 2), "started": False}),  # a fit that leaps
    ],
)
def test_no_other_place_is_said_to_be_that_of_a_beacon(seed: int, fields: dict[str, Any]) -> None:
    asked, driven, places = wandering(seed, **fields)
    found = mn.estimate("beacon_bank", asked, driven.log)
    assert np.isfinite(found.extra["beacons"][-1]).all()
    assert np.nanmax(np.abs(found.extra["beacons"] - places.ravel())) < 10.0


def straight(place: tuple[float, float], kind: int) -> mn.EstimateHistory:
    """Estimates of a straight drive along x_1, on which a beacon at a place is read."""
    names = ("ranges", "bearings")
    asked = mn.BeaconMission(
        (None,), **{names[kind]: mn.BeaconQuality(0.02)}, odometry=mn.OdometryQuality((0.02, 0.005)), period=0.2,
        interval=0.2, start=mn.KnownStart((0.0, 0.0, 0.0), (0.01, 0.01, 0.001)),
    )  # fmt: skip
    t = 0.2 * np.arange(1, 76)
    poses = np.column_stack([t, 0.0 * t, 0.0 * t])
    read = np.array([exact_readings(np.array([place]), kind, pose) for pose in poses])
    sensor = ("beacon_ranges", "beacon_bearings")[kind]
    return mn.estimate("beacon_bank", asked, mn.SensorLog(t, {sensor: read, "odometry": np.tile([1.0, 0.0], (75, 1))}))


def test_of_a_straight_path_bearings_tell_the_side_but_not_how_far_ahead_a_beacon_is() -> None:
    abeam, ahead = (8.0, 5.0), (60.0, 0.0)
    assert not straight(abeam, 0).usable.any()
    found = straight(abeam, 1)
    assert found.ok[-1]
    assert found.extra["beacons"][-1] == pytest.approx(abeam, abs=0.5)
    assert not straight(ahead, 1).usable.any()


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


def test_what_does_not_find_a_place_is_refused_or_waited_for() -> None:
    driven = drive(count=10)
    with pytest.raises(ValueError, match="in what frame the pose is"):
        mn.estimate("beacon_bank", unknown(None, 0, 1, 2, 3), driven.log)
    with pytest.raises(mn.MissionError, match="range differences alone: beacon 0"):
        dataclasses.replace(mission("range_differences"), beacons=(None, None), start=start_of(driven))
    by_differences = drive("range_differences", count=40)
    asked = dataclasses.replace(mission("range_differences"), beacons=(None, *PLACES[1:]))
    with pytest.raises(ValueError, match="or two at known places, beacon 0 among them"):
        mn.estimate("beacon_bank", asked, by_differences.log)
    nothing = {"beacon_ranges": np.full((len(by_differences.log.t), 4), np.nan)}
    log = mn.SensorLog(by_differences.log.t, {**by_differences.log.readings, **nothing})
    asked = dataclasses.replace(
        mission("ranges+range_differences", surroundings=40.0), beacons=(None,) * 4, start=start_of(by_differences)
    )
    assert mn.estimate("beacon_bank", asked, log).message[-1].startswith("waits for beacon 0, to which")
    asked = dataclasses.replace(mission("bearings", surroundings=40.0), beacons=(PLACES[0], None, None, None))
    found = mn.estimate("beacon_bank", asked, drive("bearings", count=40).log)
    assert found.message[-1].startswith("one beacon at a known place does not say")
    assert not found.usable.any()
    assert math.isnan(unknown(None, 0).places[0, 0])


@pytest.mark.parametrize("seed", [4, 7])
def test_readings_that_contradict_the_fit_of_all_are_said(seed: int) -> None:
    asked, driven, _ = wandering(seed)
    ranges = np.array(driven.log.readings["beacon_ranges"])
    late = np.arange(len(ranges)) >= len(ranges) // 2
    told = []
    for off in (0.0, 1.2):  # [m] of beacon 1: four deviations, which no single reading shows
        ranges[late, 1] += off
        log = mn.SensorLog(driven.log.t, {**driven.log.readings, "beacon_ranges": ranges})
        found = mn.estimate("beacon_bank", asked, log)
        error = found.x - driven.truth
        error[:, 2] = wrapped(error[:, 2])
        assert not sure_and_wrong(found.t, found.ok, error, found.covariance).any()
        told.append(any("contradict what fits them best" in each for each in found.message))
    assert told == [False, True]
