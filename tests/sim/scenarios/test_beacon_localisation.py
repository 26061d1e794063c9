"""``range-localisation`` with beacons: sites of the model, sensors of the robot, and an estimator that reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.commands.cli import main
from mathnavi.models.unicycle.beacons import exact_readings
from mathnavi.renders.ranging.run_data import load_run
from mathnavi.renders.ranging.web import web_scene
from mathnavi.sim.records.run_spec import RunSpec

PLACES = ((3.0, 2.0), (-3.0, 2.5), (-2.5, -3.0))
FIELDS: dict[str, Any] = {"beacons.places": PLACES, "duration": 4.0, "planner.mode": "figure-eight"}


def flown(seed: int = 2, **fields: Any) -> mn.RunResult:
    return mn.run("range-localisation", seed=seed, estimator="beacon_bank", **{**FIELDS, **fields})


def test_the_robot_finds_itself_by_beacons_in_the_loop() -> None:
    run = flown(**{"beacons.read": ("ranges", "bearings"), "beacons.range_scale": 0.05})
    assert run.success
    assert run.summary["position_rms_m"] < 0.1
    assert run.summary["observable"] is None
    ranges, bearings = run["measurement.beacon_ranges"], run["measurement.beacon_bearings"]
    read = np.isfinite(ranges).all(axis=1)
    assert 0.09 <= read.mean() <= 0.11, "ten times a second, of a hundred samples"
    poses = run["truth.x"][read, :3]
    exact = np.array([exact_readings(np.array(PLACES), 0, pose) for pose in poses])
    scales = np.median(ranges[read] / exact, axis=0)
    assert np.ptp(scales) < 0.03, "one scale for all"
    assert np.isfinite(bearings[read]).all()


NEAR: dict[str, Any] = {"beacons.places": ((2.5, 0.8), (-2.5, 0.9), (0.3, -1.2))}


def test_a_robot_near_the_wall_moves_to_find_its_heading_by_beacons() -> None:
    run = mn.run("range-localisation", seed=7000, estimator="beacon_bank", duration=4.0, **NEAR)
    assert run.summary["convergence_time_s"] < 2.0
    assert run.summary["degraded_s"] == run.summary["lost_s"] == 0.0


def test_filters_that_begin_without_a_heading_raise_no_alarm() -> None:
    run = mn.run("range-localisation", seed=7005, estimator="beacon_bank", duration=4.0, **NEAR)
    assert run.summary["initialising_s"] < 1.0
    assert run.summary["degraded_s"] == run.summary["lost_s"] == 0.0


def test_beacons_are_sites_of_the_model() -> None:
    spec = RunSpec.of("range-localisation", 1, estimator="beacon_bank", fields={"beacons.places": PLACES})
    model = spec.build().plant.model  # type: ignore[attr-defined]
    assert [model.site(f"beacon_{i}").pos[:2].tolist() for i in range(3)] == [list(place) for place in PLACES]


def test_the_wall_can_be_read_instead_of_the_beacons() -> None:
    one = mn.run("range-localisation", seed=2, estimator="range_iekf", start_known=True, **FIELDS)
    assert "measurement.beacon_ranges" not in one.arrays
    assert one.summary["position_rms_m"] < 0.3


def test_an_outage_leaves_out_beacons_too() -> None:
    run = flown(outage=((1.0, 2.0),))
    t, read = run.t, np.isfinite(run["measurement.beacon_ranges"]).any(axis=1)
    assert not read[(t > 1.0) & (t < 2.0)].any()
    assert read[t > 2.0].any()


UNKNOWN: dict[str, Any] = {"beacons.unknown": (0, 2), "start_known": True, "start_error": (0.02, 0.02, 0.5)}


@pytest.fixture(scope="module")
def mapped() -> mn.RunResult:
    return flown(3, **UNKNOWN, duration=10.0)


def test_beacons_that_the_estimator_is_not_given_are_read_where_they_are_and_found_there(mapped: mn.RunResult) -> None:
    read = np.isfinite(mapped["measurement.beacon_ranges"]).all(axis=1)
    exact = np.array([exact_readings(np.array(PLACES), 0, pose) for pose in mapped["truth.x"][read, :3]])
    assert np.abs(mapped["measurement.beacon_ranges"][read] - exact).mean() < 0.15
    found, P = mapped["estimate.beacons"][-1].reshape(-1, 2), mapped["estimate.beacons_covariance"][-1]
    errors = np.hypot(*(found - PLACES).T)
    assert errors[1] == 0.0
    assert 0.0 < errors.max() < 0.5
    summary = mapped.summary
    assert summary["beacons_found"] == 2
    assert summary["beacon_error_max_m"] == pytest.approx(errors.max())
    assert summary["beacon_deviation_max_m"] == pytest.approx(
        max(np.sqrt(np.trace(P[k : k + 2, k : k + 2])) for k in (0, 4))
    )
    assert summary["beacon_places"].startswith(f"0: ({found[0, 0]:.2f}, {found[0, 1]:.2f}) m, sigma ")
    assert "beacons_found" not in flown(duration=0.5).summary


@pytest.mark.parametrize("kind", ["bearings", "range-differences"])
def test_places_are_found_without_ranges_too(kind: str) -> None:
    run = flown(3, **UNKNOWN, duration=12.0, **{"beacons.read": (kind,)})
    assert run.summary["beacons_found"] == 2
    assert run.summary["beacon_error_max_m"] < 3.0 * run.summary["beacon_deviation_max_m"] < 2.0


def test_a_recorded_run_with_unknown_beacons_gives_the_same_estimates_and_is_drawn(
    mapped: mn.RunResult, tmp_path: Path
) -> None:
    folder = mapped.save(tmp_path / "run")
    assert main(["estimate", "beacon_bank", str(folder), "--out", str(tmp_path / "again")]) in {0, 1}
    again = load_run(tmp_path / "again").log.arrays
    for name in ("x", "deviation", "beacons", "beacons_covariance"):
        assert np.array_equal(again[f"estimate.{name}"], mapped[f"estimate.{name}"], equal_nan=True), name
    drawn = load_run(folder)
    assert drawn.beacons.tolist() == [list(place) for place in PLACES]
    (place, P), (other, _) = drawn.beacons_believed(len(drawn.beliefs.t) - 1).values()
    assert place == pytest.approx(mapped["estimate.beacons"][-1, :2])
    assert other == pytest.approx(mapped["estimate.beacons"][-1, 4:])
    assert np.linalg.eigvalsh(P)[0] > 0.0
    assert drawn.beacons_believed(0) == {}
    scene = web_scene(drawn)
    assert [mark.text for mark in scene.marks] == ["robot", "beacon 0", "beacon 1", "beacon 2"]
    ends = [line for lines in scene.lines for line in lines.at(drawn.duration)]
    assert any(np.allclose(line[:, :2].mean(axis=0), place, atol=1e-6) for line in ends), "a cross where it is believed"


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"beacons.unknown": (3,)}, "beacons.unknown = .* with 3 places"),
        ({"beacons.unknown": (1, 1)}, "different numbers"),
        ({"beacons.unknown": (-1,)}, "beacons.unknown"),
        ({"beacons.unknown": (0, 1, 2), "beacons.read": ("range-differences",)}, "beacon 0, to which they are"),
        ({"beacons.unknown": (0, 1, 2)}, "neither the start nor the place of a beacon is known"),
        ({"beacons.places": ((0.0, 0.0), (0.0, 0.0))}, "one place twice"),
        ({"beacons.places": ((0.0, 0.0),), "beacons.read": ("range-differences",)}, "of one beacon"),
        ({"beacons.read": ()}, "beacons.read is empty"),
        ({"beacons.places": (), "beacons.unknown": (0,)}, r"beacons.unknown = \(0,\) without beacons.places; allowed"),
        ({"beacons.places": (), "beacons.rate": 5.0}, "beacons.rate = 5.0 without beacons.places; allowed"),
        ({"beacons.places": ()}, "'beacon_bank' is for a BeaconMission or BeaconFieldMission"),
    ],
)
def test_beacons_that_cannot_be_are_refused(fields: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        flown(**fields)


def test_unknown_beacons_that_an_estimator_does_not_read_are_refused() -> None:
    fields = FIELDS | {"beacons.unknown": (0,), "start_known": True}
    spec = RunSpec.of("range-localisation", 1, estimator="range_ekf", fields=fields)
    with pytest.raises(ValueError, match=r"beacons.unknown = \(0,\): the estimator range_ekf .* allowed"):
        spec.build()
