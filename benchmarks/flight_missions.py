"""Missions by the dozen: what the flight planner guarantees, and what the planner of the print does instead.

    python benchmarks/flight_missions.py [--terrain NAME|FILE.npz] [--missions 20] [--workers 2]

Four tables. *Plain*: path over straight line and solve times. *Failures*: 0, 30 and 90 % of the solver's answers are
lost, high and low over the ground, and the literal planner on the same low missions without any failure. *Radar*: one
of 10 km radius stands in the middle of the way; time in its sight, unaware and aware of it. *Noise*: a Kalman filter
on position fixes of 5 m at 10 Hz, in gusts.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from renders.opengl import choose_backend

LOW = (0.5, 30.0)  # [m] above h_min
RADAR_RADIUS, RADAR_WEIGHT = 10_000.0, 10.0
FAILURE_RATES = (0.0, 0.3, 0.9)


@dataclass(frozen=True)
class Arguments:
    """Fly missions by the dozen and print what came of them."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    missions: int = 20
    """seeds 0 ... missions - 1 of the tables on failures"""
    few: int = 5
    """seeds of the other tables"""
    workers: int = 2
    """processes"""


@dataclass(frozen=True)
class Job:
    """One mission."""

    terrain: str
    seed: int
    controller: str = "flight"
    estimator: str = "full_state"
    low: bool = False
    failures: float = 0.0
    noise: float = 0.0
    gusts: float = 0.0
    radar: bool | None = None  # None: there is none; False: it is there and unknown to the planner; True: it is known


def fly(job: Job) -> dict[str, Any]:
    """The summary of one mission; with a radar, also the time in its sight."""
    choose_backend()
    from models.terrain.visibility import Radar
    from sim.metrics import TimedRadar, exposure
    from sim.plugins import Part, load
    from sim.scenarios.safe_flight import VEHICLE, Faults, Noise, SafeFlight, SafeFlightConfig

    config = SafeFlightConfig(
        terrain=job.terrain,
        noise=Noise(position=job.noise),
        faults=Faults(solver_failure_rate=job.failures, gust_rms=job.gusts),
    )
    if job.low:
        config = dataclasses.replace(config, drawn_heights=LOW)
    controller = Part.of(load("controllers", job.controller))
    estimator = Part.of(load("estimators", job.estimator))
    if job.radar is None:
        return SafeFlight.build(config, job.seed, controller, estimator).run().summary
    drawn = SafeFlight.build(config, job.seed, controller, estimator)
    start, target = (drawn.config["mission"][end] for end in ("start", "target"))
    radar = (0.5 * (start[0] + target[0]), 0.5 * (start[1] + target[1]), RADAR_RADIUS, RADAR_WEIGHT)
    config = dataclasses.replace(config, start=start, target=target, radar=(radar,) if job.radar else ())
    outcome = SafeFlight.build(config, job.seed, controller, estimator).run()
    from models.aerial.mission import FlightMission
    from models.terrain.library import load_terrain

    mission = FlightMission(load_terrain(job.terrain), start, target)
    seen = exposure(outcome.recording.t, outcome.recording.truths[VEHICLE], mission, [TimedRadar(Radar(*radar))])
    return outcome.summary | {"seen_s": seen}


def success(summary: dict[str, Any]) -> bool:
    """Arrived in time, untouched, never below h_min."""
    in_time = summary["arrived"] and summary["arrival_time_s"] <= summary["deadline_s"]
    return bool(in_time and summary["ground_contacts"] == 0 and summary["min_clearance_m"] >= 50.0)


def of(rows: Sequence[dict[str, Any]], key: str) -> np.ndarray:
    """One figure of every mission."""
    return np.array([row[key] for row in rows], dtype=float)


def failures_row(name: str, rows: Sequence[dict[str, Any]]) -> list[str]:
    """A row of the table on failures."""
    in_time = sum(bool(r["arrived"]) and r["arrival_time_s"] <= r["deadline_s"] for r in rows)
    return [
        name,
        f"{sum(map(success, rows))} of {len(rows)}",
        f"{int((of(rows, 'ground_contacts') > 0).sum())}",
        f"{int((of(rows, 'min_clearance_m') < 50.0).sum())}",
        f"{of(rows, 'min_clearance_m').min():.1f}",
        f"{in_time}",
        f"{(of(rows, 'flight_time_s') / of(rows, 'deadline_s')).max():.3f}",
        f"{100.0 * of(rows, 'manoeuvres_rejected').sum() / of(rows, 'replans').sum():.2f}",
        f"{100.0 * of(rows, 'solver_failures').sum() / of(rows, 'replans').sum():.1f}",
    ]


def main(arguments: Arguments) -> None:
    console = Console()
    console.width = max(console.width, 150)  # wide tables stay readable in a file
    jobs: dict[str, list[Job]] = {}
    few, many = range(1, arguments.few + 1), range(arguments.missions)
    jobs["plain"] = [Job(arguments.terrain, seed) for seed in few]
    for rate in FAILURE_RATES:
        jobs[f"flight, {rate:.0%} failures"] = [Job(arguments.terrain, s, failures=rate) for s in many]
        jobs[f"flight, low, {rate:.0%} failures"] = [Job(arguments.terrain, s, low=True, failures=rate) for s in many]
    jobs["literal, low, 0% failures"] = [Job(arguments.terrain, s, "literal", low=True) for s in many]
    jobs["unaware"] = [Job(arguments.terrain, s, radar=False) for s in few]
    jobs["aware"] = [Job(arguments.terrain, s, radar=True) for s in few]
    jobs["noise"] = [Job(arguments.terrain, s, estimator="kalman", noise=5.0, gusts=1.5) for s in few]
    with ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool:
        pending = {name: [pool.submit(fly, job) for job in batch] for name, batch in jobs.items()}
        done = {name: [future.result() for future in batch] for name, batch in pending.items()}

    plain = Table("seed", "path / straight", "solve mean [ms]", "p50", "p99", "max", "real time x", title="Plain")
    for row in done["plain"]:
        times = [f"{row[f'solve_ms_{key}']:.3f}" for key in ("mean", "p50", "p99", "max")]
        ratio = f"{row['path_length_m'] / row['straight_line_m']:.4f}"
        plain.add_row(str(row["seed"]), ratio, *times, f"{row['real_time_factor']:.0f}")
    console.print(plain)

    heads = ("", "safe and in time", "hit ground", "below 50 m", "least [m]", "in time", "t / deadline",
             "manoeuvres rejected [%]", "solver failed [%]")  # fmt: skip
    table = Table(*heads, title="Failures")
    for name, rows in done.items():
        if "failures" in name:
            table.add_row(*failures_row(name, rows))
    console.print(table)

    radar = Table("seed", "unaware [s]", "aware [s]", "path longer by [%]", title="Radar of 10 km: time in its sight")
    unaware, aware = done["unaware"], done["aware"]
    longer = of(aware, "path_length_m") / of(unaware, "path_length_m") - 1.0
    for row, other, more in zip(unaware, aware, longer, strict=True):
        radar.add_row(str(row["seed"]), f"{row['seen_s']:.1f}", f"{other['seen_s']:.1f}", f"{100.0 * more:.1f}")
    cut = 1.0 - of(aware, "seen_s").sum() / max(of(unaware, "seen_s").sum(), 1e-9)
    radar.caption = f"mean exposure cut by {100.0 * cut:.1f} % for {100.0 * longer.mean():.1f} % more path"
    console.print(radar)

    noise = Table("seed", "safe and in time", "least [m]", "breaches", "largest error [m]", "bound [m]", title="Noise")
    for row in done["noise"]:
        noise.add_row(
            str(row["seed"]),
            "yes" if success(row) else "no",
            f"{row['min_clearance_m']:.1f}",
            str(row["tracking_breaches"]),
            f"{row['tracking_error_max_m']:.1f}",
            f"{row['tracking_bound_m']:.1f}",
        )
    console.print(noise)


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=__doc__))
