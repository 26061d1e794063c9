"""Counts and comparisons of the study of stretched grids, on records made by hand."""

from __future__ import annotations

from typing import Any

import pytest

from mathnavi.sim.records.store import Record
from mathnavi.studies.flight import flight_grids

GOOD = {
    "arrived": True, "flight_time_s": 250.0, "deadline_s": 300.0, "min_clearance_m": 60.0, "ground_contacts": 0,
    "control_effort": 2000.0, "path_length_m": 7e4, "plans_rejected": 1, "replans": 150, "plans_adopted": 140,
    "tracking_breaches": 0, "solve_ms_mean": 0.5, "solve_ms_p99": 2.0,
}  # fmt: skip


def record(**summary: Any) -> Record:
    parameters = {"config": {"clearance_min": 50.0}}
    return Record("key", "safe-flight", parameters, 1, "code", "ok", True, {**GOOD, **summary}, {}, None)


@pytest.mark.parametrize(
    ("summary", "low", "late"),
    [
        ({}, 0, 0),
        ({"min_clearance_m": 49.9}, 1, 0),
        ({"ground_contacts": 1}, 1, 0),
        ({"flight_time_s": 300.1}, 0, 1),
        ({"arrived": False}, 0, 1),
        ({"arrived": False, "min_clearance_m": -3.0}, 1, 1),
    ],
)
def test_a_guarantee_is_broken_by_a_mission_that_is_low_or_late(summary: dict[str, Any], low: int, late: int) -> None:
    kept = flight_grids._kept("faults", [record(), record(**summary)])
    assert (kept["low"], kept["late"], kept["broken"]) == (low, late, max(low, late))
    assert kept["not_flown"] == 20


def test_the_cost_of_a_mission_is_its_effort_and_a_hundred_a_second() -> None:
    uniform = [record(), record(flight_time_s=280.0)]
    faster = [record(flight_time_s=240.0), record(flight_time_s=270.0, control_effort=3000.0)]
    row = flight_grids._row(flight_grids.STRETCHED, faster, uniform)
    assert row["cost"] == 0.5 * (26_000.0 + 30_000.0)
    assert row["over_uniform_percent"] == pytest.approx(100.0 * (28_000.0 / 28_500.0 - 1.0))
    assert row["median_over_uniform_percent"] == pytest.approx(50.0 * (26_000.0 / 27_000.0 + 30_000.0 / 30_000.0 - 2.0))


def test_the_stretched_grid_has_the_nodes_of_the_uniform_one_and_twice_its_horizon() -> None:
    assert flight_grids.STRETCHED.nodes == flight_grids.UNIFORM.nodes
    assert sum(flight_grids.STRETCHED.lengths) == pytest.approx(2.0 * sum(flight_grids.UNIFORM.lengths))
    assert flight_grids.STRETCHED.stretch > 1.0
