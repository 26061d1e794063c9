"""``safe-flight`` among beacons: it arrives by ranges alone, names a beacon at fault, and its log can be estimated."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.models.aerial.beacons import slant_ranges
from mathnavi.models.aerial.mission import DeclaredGusts
from mathnavi.renders.flight.report import beacons_figure
from mathnavi.renders.flight.run_data import load_run
from mathnavi.sim.records.run_spec import RunSpec

PLACES = (
    (9000.0, 13000.0, 900.0), (13000.0, 9500.0, 420.0), (12500.0, 15500.0, 1500.0), (16500.0, 12500.0, 600.0),
    (12500.0, 12500.0, 1700.0), (11000.0, 11500.0, 450.0),
)  # fmt: skip
FIELDS: dict[str, Any] = {
    "terrain": "jacksboro", "start": (11000.0, 11000.0, 900.0), "target": (13300.0, 12600.0, 900.0),
    "speed_max": 100.0, "beacons.places": PLACES, "beacons.range_noise": 0.5, "faults.gust_rms": 1.0,
}  # fmt: skip


@cache
def flown(seed: int = 3, fault: str = "") -> mn.RunResult:
    fields = FIELDS | ({"faults.beacons": (1,), "faults.beacon_fault": fault} if fault else {})
    return mn.run("safe-flight", seed=seed, estimator="kalman", **fields)


def test_it_arrives_by_ranges_in_place_of_fixes() -> None:
    run = flown()
    assert run.success
    assert "measurement.position" not in run.arrays
    ranges, x = run["measurement.beacon_ranges"], run["truth.x"]
    read = np.isfinite(ranges).all(axis=1)
    exact = np.array([slant_ranges(np.array(PLACES), p)[0] for p in x[read, :3]])
    assert np.std(ranges[read] - exact) == pytest.approx(0.5, rel=0.1)
    error = run["estimate.x"][:, :3] - x[: len(run["estimate.x"]), :3]
    assert np.sqrt(np.square(error).sum(axis=1).mean()) < 3.0
    assert run.summary["efficiency"] < 1.3


def test_a_stuck_beacon_is_named_and_left_out_in_the_loop() -> None:
    run = flown(fault="stuck")
    assert run.success
    assert run.summary["left_out_beacons"] == "1"
    assert any("beacon 1" in event.message for event in run.events if event.kind == "estimator-status")
    assert [event.message for event in run.events if event.kind == "sensor-left-out"] == ["leaves out beacon 1"]
    out = run["estimate.left_out"]
    assert (out[-100:, 1] == 1.0).all()
    assert out[:, [0, 2, 3, 4, 5]].sum() == 0.0


def test_the_recorded_flight_is_estimated_with_fewer_beacons_and_smoothed() -> None:
    run = flown()
    n, used = len(run.t), [0, 1, 2, 3]
    beacons = mn.FlightBeacons(tuple(PLACES[i] for i in used), noise=0.5)
    task = mn.FlightMission(
        mn.load_terrain("jacksboro"), FIELDS["start"], FIELDS["target"], gust=DeclaredGusts(1.0), beacons=beacons
    )
    log = mn.SensorLog(run.t, {"beacon_ranges": run["measurement.beacon_ranges"][:, used]}, run["command.u"])
    found = mn.estimate("kalman", task, log)
    smooth = mn.estimate(mn.smoother("kalman"), task, log)
    rms = [
        float(np.sqrt(np.square(each.x[:n, :3] - run["truth.x"][:, :3]).sum(axis=1).mean())) for each in (found, smooth)
    ]
    assert rms[1] < rms[0] < 6.0


def test_it_arrives_by_bearings_and_differences_and_its_log_gives_the_same_estimates(tmp_path: Path) -> None:
    fields = FIELDS | {"beacons.read": ("bearings", "range-differences"), "beacons.bearing_noise": 0.002}
    run = mn.run("safe-flight", seed=3, estimator="kalman", **fields)
    assert run.success
    assert run.summary["nees_mean"] < 9.0
    assert run.summary["efficiency"] < 1.3
    assert "measurement.beacon_ranges" not in run.arrays
    folder = run.save(tmp_path / "run")
    assert main(["estimate", "kalman", str(folder), "--out", str(tmp_path / "again")]) == 0
    again = load_run(tmp_path / "again").log.arrays
    for name in ("x", "deviation", "innovations", "left_out"):
        assert np.array_equal(again[f"estimate.{name}"], run[f"estimate.{name}"], equal_nan=True), name
    figure = beacons_figure(load_run(folder))
    assert [text.get_text() for text in figure.axes[1].get_yticklabels()][-2:] == ["4", "5"]


@pytest.mark.parametrize("read", [("ranges",), ("bearings", "range-differences")])
def test_it_finds_beacons_on_its_way_and_its_log_gives_the_same_places(tmp_path: Path, read: tuple[str, ...]) -> None:
    unknown = {"beacons.places": PLACES[:4], "beacons.unknown": (1, 3), "noise.position": 2.0, "estimator.fixes": True}
    unknown |= {"beacons.read": read, "beacons.bearing_noise": 0.002} if "bearings" in read else {}
    run = mn.run("safe-flight", seed=3, estimator="kalman", **(FIELDS | unknown))
    assert run.success
    assert run.summary["beacons_found"] == 2
    assert run.summary["beacon_error_max_m"] < 3.0 * run.summary["beacon_deviation_max_m"]
    for i in (1, 3):
        e = run["estimate.beacon_places"][-1, i] - PLACES[i]
        assert e @ np.linalg.solve(run["estimate.beacon_places_covariance"][-1, i], e) < 14.16
    folder = run.save(tmp_path / "run")
    assert main(["estimate", "kalman", str(folder), "--out", str(tmp_path / "again")]) == 0
    again = load_run(tmp_path / "again").log.arrays
    for name in ("x", "deviation", "innovations", "left_out", "beacon_places", "beacon_places_covariance"):
        assert np.array_equal(again[f"estimate.{name}"], run[f"estimate.{name}"], equal_nan=True), name


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"beacons.places": ((0.0, 0.0, 1.0),) * 2}, "beacons.places = .* one place twice"),
        ({"beacons.places": ((0.0, 0.0, 1e9),)}, "beacons.places.*three values"),
        ({"beacons.range_noise": -1.0}, "beacons.range_noise = -1.0"),
        ({"beacons.read": ()}, "beacons.read is empty; allowed: ranges, bearings, range-differences"),
        ({"beacons.places": PLACES[:1], "beacons.read": ("range-differences",)}, "range-differences of one beacon"),
        ({"beacons.bearing_noise": -1.0}, "beacons.bearing_noise = -1.0"),
        ({"faults.beacons": (6,)}, r"faults.beacons = \(6,\), of 6 beacons; allowed: 0 to 5"),
        ({"beacons.places": PLACES[:1], "faults.beacons": (1,)}, r"of 1 beacon; allowed: 0$"),
        (
            {"beacons.places": (), "beacons.range_noise": 1.0, "faults.beacons": (0,)},
            "allowed: none without beacons.places",
        ),
        (
            {"faults.beacons": (0, 2, 0)},
            r"faults.beacons = \(0, 2, 0\), of 6 beacons; allowed: different numbers, 0 to 5",
        ),
        ({"beacons.unknown": (6,)}, r"beacons.unknown = \(6,\) with 6 places; allowed: different numbers"),
        (
            {"beacons.unknown": (1, 0), "beacons.read": ("ranges", "range-differences")},
            r"beacons.unknown = \(1, 0\) with beacons.read = .*; allowed: numbers from 1",
        ),
        ({"beacons.places": ()}, "beacons.range_noise = 0.5 without beacons.places; allowed"),
    ],
)
def test_beacons_that_cannot_be_are_refused(fields: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        RunSpec.of("safe-flight", 1, estimator="kalman", fields=FIELDS | fields)


@pytest.mark.parametrize("estimator", ["full_state", "moving_horizon"])
def test_beacons_that_an_estimator_does_not_read_are_refused(estimator: str) -> None:
    spec = RunSpec.of("safe-flight", 1, estimator=estimator, fields=FIELDS)
    with pytest.raises(ValueError, match=f"beacons.places = .*: the estimator {estimator} does not read them; allowed"):
        spec.build()


@pytest.mark.parametrize(
    ("place", "where"), [((12000.0, 12000.0, -900.0), "below the ground"), ((-9.0, 12000.0, 900.0), "off the map")]
)
def test_a_beacon_that_nothing_ever_sees_is_refused_where_sight_is_needed(
    place: tuple[float, float, float], where: str
) -> None:
    fields = FIELDS | {"beacons.places": (PLACES[2], place)}
    sight = {"beacons.line_of_sight": True}
    unknown = {"beacons.unknown": (1,), "estimator.fixes": True}
    for more in (sight, sight | unknown):
        spec = RunSpec.of("safe-flight", 1, estimator="kalman", fields=fields | more)
        with pytest.raises(ValueError, match=f"beacons.places = .*{place[0]}.* is {where}.*; allowed"):
            spec.build()


@pytest.mark.parametrize(("field", "value"), [("fixes", True), ("position_std_max", 9.0)])
def test_fields_of_an_estimator_that_are_of_beacons_are_refused_without_any(field: str, value: float) -> None:
    fields = {"terrain": "jacksboro", f"estimator.{field}": value}
    spec = RunSpec.of("safe-flight", 1, estimator="kalman", fields=fields)
    with pytest.raises(ValueError, match=f"estimator.{field} = .* without beacons; allowed"):
        spec.build()


def test_bounds_that_beacons_leave_nothing_of_are_refused_with_how_well_these_tell_the_position() -> None:
    spec = RunSpec.of("safe-flight", 1, estimator="kalman", fields=FIELDS | {"beacons.range_maximum": 10.0})
    with pytest.raises(ValueError, match=r"leaves nothing to plan with.*beacons.* 20 m.*position_std_max"):
        spec.build()
