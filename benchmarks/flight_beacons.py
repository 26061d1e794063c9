"""A flight by readings of beacons beside the same flight by position fixes: errors, consistency, time that it is OK.

    python -m benchmarks.flight_beacons [--seeds 10]

One mission of ``safe-flight`` over the terrain jacksboro, 2.8 km under gusts of 1 m/s^2, is flown in closed loop by the
estimator ``kalman``, ten times a second each: by fixes with 2 m of noise on each axis, by ranges with 0.5 m of noise to
four or six beacons, by bearings with 1 mrad of noise to four, and by range differences of six, of arrivals with 0.5 m
of noise; and with a beacon that fails from 10 s on: stuck, or off by 5 m, or 10 mrad. The places of two beacons are
found in flight, by ranges, bearings or differences, while fixes or the others carry it. What three beacons tell leaves
nothing to plan with there, unless the flight arrives within 150 m of its target and may be 10 m above the ground.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Le
from rich.console import Console
from rich.table import Table

from benchmarks.arguments import read_arguments
from benchmarks.progress import progress
from mathnavi.interfaces.bounds import configuration

os.environ.setdefault("MUJOCO_GL", "disable")

from mathnavi.interfaces.signals import Status
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.metrics.consistency import normalised_error_squared
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from mathnavi.sim.records.run_spec import RunSpec

PLACES = (
    (9000.0, 13000.0, 900.0), (13000.0, 9500.0, 420.0), (12500.0, 15500.0, 1500.0), (16500.0, 12500.0, 600.0),
    (12500.0, 12500.0, 1700.0), (11000.0, 11500.0, 450.0),
)  # fmt: skip
"""places (6, 3) [m] of the beacons, of which four are the first four"""
MISSION: Mapping[str, Any] = {
    "terrain": "jacksboro", "start": (11000.0, 11000.0, 900.0), "target": (13300.0, 12600.0, 900.0),
    "speed_max": 100.0, "faults.gust_rms": 1.0,
}  # fmt: skip
FAULTY = 1  # number of the beacon that fails


def by_beacons(count: int, fault: str = "", read: str = "ranges", failing: int = FAULTY, **more: Any) -> dict[str, Any]:
    """Fields of the scenario for what is ``read`` of the first ``count`` beacons, of which ``failing`` has a fault."""
    fields: dict[str, Any] = {"beacons.places": PLACES[:count], "beacons.range_noise": 0.5, "beacons.read": (read,)}
    fields |= {"beacons.bearing_noise": 0.001} if read == "bearings" else {}
    return fields | more | ({"faults.beacons": (failing,), "faults.beacon_fault": fault} if fault else {})


OFF_ANGLE: dict[str, Any] = {"faults.beacon_angle": 0.01}
NEAR_GROUND: dict[str, Any] = {"arrival_radius": 150.0, "clearance_min": 10.0}


CONDITIONS: Mapping[str, dict[str, Any]] = {
    "fixes, 2 m": {"noise.position": 2.0},
    "4 beacons": by_beacons(4),
    "6 beacons": by_beacons(6),
    "4 beacons, one stuck": by_beacons(4, "stuck"),
    "4 beacons, one 5 m off": by_beacons(4, "offset"),
    "6 beacons, one stuck": by_beacons(6, "stuck"),
    "6 beacons, one 5 m off": by_beacons(6, "offset"),
    "4 beacons, one 3 m off": by_beacons(4, "offset") | {"faults.beacon_offset": 3.0},
    "3 beacons": by_beacons(3, **NEAR_GROUND),
    "3 beacons, one 5 m off": by_beacons(3, "offset", **NEAR_GROUND),
    "bearings of 4": by_beacons(4, read="bearings"),
    "bearings of 4, one off": by_beacons(4, "offset", "bearings") | OFF_ANGLE,
    "differences of 6": by_beacons(6, read="range-differences"),
    "differences of 6, one 5 m off": by_beacons(6, "offset", "range-differences"),
    "differences of 6, the first 5 m off": by_beacons(6, "offset", "range-differences", 0),
    "fixes, 2 m, and 2 unknown places": {
        **by_beacons(2),
        "beacons.unknown": (0, 1),
        "noise.position": 2.0,
        "estimator.fixes": True,
    },
    "6 beacons, 2 at unknown places": by_beacons(6) | {"beacons.unknown": (1, 3)},
    "bearings of 6, 2 at unknown places": by_beacons(6, read="bearings") | {"beacons.unknown": (1, 3)},
    "differences of 6, 2 at unknown places": by_beacons(6, read="range-differences") | {"beacons.unknown": (1, 3)},
}


@configuration
class Arguments:
    """Compare flights by ranges to beacons with one by position fixes."""

    seeds: Annotated[int, Ge(1), Le(1000)] = 10
    """number of flights of each kind, with the seeds 1, 2, ..."""


@dataclass(frozen=True)
class BeaconFlight:
    """Figures of one flight."""

    arrived: bool
    square: float  # [m^2] mean of the squared error of the position
    nees: float  # mean of e' P^-1 e of the position
    ok: float  # share of the time
    sure_and_wrong: float  # share of the time (``sure_and_wrong``)
    left_out: tuple[int, ...]  # beacons, at any time


def flown(fields: Mapping[str, Any], seed: int) -> BeaconFlight:
    """Fly a mission."""
    result = RunSpec.of("safe-flight", seed, estimator="kalman", fields={**MISSION, **fields}).build().run()
    ((name, agent),) = result.recording.agents.items()
    t, truth = result.recording.t, result.recording.truths[name]
    errors, covariances, ok, out = [], [], [], set[int]()
    for estimate in agent.estimates:
        assert estimate.covariance is not None
        errors.append(estimate.x[:3] - truth[int(np.searchsorted(t, estimate.t - TIME_TOLERANCE)), :3])
        covariances.append(estimate.covariance[:3, :3])
        ok.append(estimate.status is Status.OK)
        out |= set(np.flatnonzero(estimate.extra.get("left_out", np.zeros(0))).tolist())
    e, P, times = np.array(errors), np.array(covariances), np.array([each.t for each in agent.estimates])
    wrong = sure_and_wrong(times, np.array(ok), e, P, (slice(0, 3),))
    return BeaconFlight(
        result.success, float(np.square(e).sum(axis=1).mean()), float(normalised_error_squared(e, P).mean()),
        float(np.mean(ok)), float(wrong.mean()), tuple(sorted(out)),
    )  # fmt: skip


def summed(flights: Sequence[BeaconFlight]) -> list[str]:
    """Row of a table: the figures over all flights of a kind."""
    squares, nees, ok, wrong = (
        np.array([getattr(each, name) for each in flights]) for name in ("square", "nees", "ok", "sure_and_wrong")
    )
    out = {each.left_out for each in flights}
    return [
        f"{sum(each.arrived for each in flights)} of {len(flights)}",
        f"{np.sqrt(squares.mean()):.2f} m",
        f"{nees.mean():.2f}",
        f"{100.0 * ok.mean():.1f} %",
        f"{100.0 * wrong.mean():.2f} %",
        "; ".join(", ".join(map(str, each)) or "none" for each in sorted(out)),
    ]


def main() -> None:
    """Fly all kinds of flights and print the table."""
    arguments, console = read_arguments(Arguments), Console()
    table = Table("", "arrived", "RMS error", "NEES (3)", "OK", "OK and wrong", "left out")
    with progress(Console(stderr=True), "flights", len(CONDITIONS) * arguments.seeds) as report:
        for k, (name, fields) in enumerate(CONDITIONS.items()):
            flights = []
            for seed in range(1, arguments.seeds + 1):
                report(k * arguments.seeds + seed - 1, name)
                flights.append(flown(fields, seed))
            table.add_row(name, *summed(flights))
    console.print(table)


if __name__ == "__main__":
    main()
