"""Reading the folder of a fleet's run, the announcements in its video, and the error when it cannot be read."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.renders.film import Frame
from mathnavi.renders.fleet.drawing import CAMERAS, annotations_of, drawing, highlight, overlay, shot_list
from mathnavi.renders.fleet.run_data import FleetRun, load_run
from mathnavi.sim.records.run_folder import read_log


def test_the_run_is_that_of_the_summary(fleet_run: FleetRun) -> None:
    summary = fleet_run.summary
    assert fleet_run.spread == pytest.approx(summary["spread_s"], abs=1e-9)
    assert fleet_run.arrivals.max() == pytest.approx(summary["arrival_time_s"], abs=1e-9)
    assert fleet_run.neighbours.min() == pytest.approx(summary["separation_min_m"], abs=10.0)
    least = np.array([fleet_run.nearest(float(t)) for t in fleet_run.t[::100]])
    np.testing.assert_allclose(least, fleet_run.neighbours.min(axis=0)[::100], atol=1e-6)
    assert [fleet_run.arrived(t) for t in (0.0, fleet_run.duration)] == [0, 3]
    assert {event.agent for flight in fleet_run.flights for event in flight.events} <= set(fleet_run.vehicles)
    assert all(flight.log.plans for flight in fleet_run.flights)


def test_what_was_agreed_is_when_they_arrive(fleet_run: FleetRun) -> None:
    (first, *_), (*_, (_, last)) = fleet_run.agreements, fleet_run.agreements
    assert first[0] < 5.0
    assert last == pytest.approx(fleet_run.arrivals.max(), abs=1.0)
    assert np.isnan(fleet_run.agreed(-1.0)).all()
    np.testing.assert_allclose(fleet_run.agreed(fleet_run.duration), last, atol=0.5)


def test_the_video_covers_the_run_and_ends_at_the_slots_with_the_verdict(fleet_run: FleetRun) -> None:
    filmed = shot_list(fleet_run)
    assert filmed[0].begin == 0.0
    assert all(one.end == other.begin for one, other in pairwise(filmed))
    assert {shot.camera for shot in filmed} == set(CAMERAS)
    assert 12.0 <= sum(shot.length for shot in filmed) <= 25.0
    frames = drawing.frames(fleet_run, "tour", 4)
    assert frames[-1].camera == "arrival"
    assert frames[-1].t == fleet_run.duration
    expected = f"all 3 arrived within {fleet_run.spread:.2f} s"
    assert annotations_of(fleet_run)[-1] == (fleet_run.duration, expected)
    assert annotations_of(fleet_run)[0][1].startswith("agreed to arrive at ")
    assert overlay(fleet_run, frames[-1]).state == expected
    assert any(frame.annotation == expected for frame in frames)
    assert all(frame.camera == "top" for frame in drawing.frames(fleet_run, "top", 2))
    begin, end = highlight(fleet_run)
    assert 0.0 < begin < end == fleet_run.duration


@pytest.mark.parametrize("direction", ["chase", ""])
def test_another_camera_is_refused(fleet_run: FleetRun, direction: str) -> None:
    with pytest.raises(ValueError, match="allowed: overview, top, arrival"):
        drawing.frames(fleet_run, direction)


def test_the_caption_tells_who_has_arrived_and_how_near_they_are(fleet_run: FleetRun) -> None:
    t = float(np.sort(fleet_run.arrivals)[1])
    numbers = {name: (value, note) for name, value, note in overlay(fleet_run, Frame(t, "top", 0.0, 0.0)).numbers}
    assert numbers["ARRIVED"][0] == "2 of 3"
    assert numbers["LEAST DISTANCE NOW"] == (f"{fleet_run.nearest(t):.0f} m", "at least 150 m")
    assert numbers["AGREED ARRIVAL"][0] == f"{fleet_run.agreed(t).max():.1f} s"


def test_a_fleet_is_no_single_vehicle(fleet_dir: Path) -> None:
    with pytest.raises(ValueError, match="is the log of a fleet; allowed: the run of a single vehicle"):
        read_log(fleet_dir)


Arrays = dict[str, Array]
BROKEN: dict[str, tuple[Callable[[Arrays], Arrays], str]] = {
    "no fleet": (lambda log: {"t": log["t"], "truth.x": log["vehicle_1.truth.x"]}, "only the run of a fleet"),
    "no times": (lambda log: {name: rows for name, rows in log.items() if name != "t"}, r"log\.npz' lacks t$"),
    "a vehicle less": (lambda log: {k: rows for k, rows in log.items() if "_3." not in k}, "allowed: the same in both"),
    "no commands": (
        lambda log: {k: rows for k, rows in log.items() if k != "vehicle_2.command.u"}, r"lacks vehicle_2\.command\.u$",
    ),
    "short": (
        lambda log: log | {"vehicle_2.truth.x": log["vehicle_2.truth.x"][:-1]}, r"vehicle_2\.truth\.x \(\d+, 6\)",
    ),
    "narrow": (
        lambda log: log | {"vehicle_2.truth.x": log["vehicle_2.truth.x"][:, :4]},
        r"vehicle_2\.truth\.x has 4 states; allowed: 6",
    ),
    "not finite": (
        lambda log: log | {"vehicle_3.truth.x": np.full_like(log["vehicle_3.truth.x"], np.nan)},
        r"vehicle_3\.truth\.x is not finite",
    ),
    "plans": (lambda log: log | {"vehicle_1.plan.cost": log["vehicle_1.plan.cost"][:-1]}, "plan.cost has the shape"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_log_is_one_clear_error(fleet_dir: Path, tmp_path: Path, case: str) -> None:
    change, expected = BROKEN[case]
    copy = shutil.copytree(fleet_dir, tmp_path / "run")
    with np.load(copy / "log.npz") as log:
        keep = {k: rows for k, rows in log.items() if "measurement" not in k and "estimate" not in k}
    np.savez(copy / "log.npz", **change(keep))
    with pytest.raises(ValueError, match=expected):
        load_run(copy)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda config: config["mission"].pop("vehicles"), "vehicles is missing"),
        (lambda config: config["mission"]["vehicles"]["vehicle_1"].pop("target"), "target is missing"),
        (lambda config: config["mission"].update(separation=None), "does not describe the flight of a fleet"),
        (lambda config: config["mission"].update(vehicles=3), "does not describe the flight of a fleet"),
        (lambda config: config["terrain"].update(digest="0" * 64), "no longer the one"),
        (lambda config: config.pop("seed"), "seed is missing"),
    ],
)
def test_a_broken_configuration_is_one_clear_error(
    fleet_dir: Path, tmp_path: Path, change: Callable[[Any], None], expected: str
) -> None:
    copy = shutil.copytree(fleet_dir, tmp_path / "run")
    config = json.loads((copy / "config.json").read_text())
    change(config)
    (copy / "config.json").write_text(json.dumps(config))
    with pytest.raises(ValueError, match=expected):
        load_run(copy)


@pytest.mark.parametrize("name", ["config.json", "summary.json", "events.jsonl", "log.npz"])
def test_a_missing_file_is_named(fleet_dir: Path, tmp_path: Path, name: str) -> None:
    copy = shutil.copytree(fleet_dir, tmp_path / "run")
    (copy / name).unlink()
    with pytest.raises(FileNotFoundError, match=name):
        load_run(copy)
