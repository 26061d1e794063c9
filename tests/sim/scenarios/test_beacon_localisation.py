"""``range-localisation`` with beacons: sites of the model, sensors of the robot, and an estimator that reads them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.models.unicycle.beacons import exact_readings
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


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"beacons.places": ((0.0, 0.0), (0.0, 0.0))}, "one place twice"),
        ({"beacons.places": ((0.0, 0.0),), "beacons.read": ("range-differences",)}, "of one beacon"),
        ({"beacons.read": ()}, "beacons.read is empty"),
        ({"beacons.places": ()}, "'beacon_bank' is for a BeaconMission or BeaconFieldMission"),
    ],
)
def test_beacons_that_cannot_be_are_refused(fields: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        flown(**fields)
