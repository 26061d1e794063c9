"""Range estimators from an unknown start: how often they find the pose, how exactly, how sure, and at what cost.

The observer (C.5) without noise, the feasible-set bank beside filterpy's filters with the standard noise (ranges 5 %
off, odometry .05 per reading and 2 % always), the bank in a wall that is not convex and on two driven wheels in MuJoCo,
and what an update costs.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from mathnavi.models.field.curve import BEAN
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.studies.framework.jobs import Jobs
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.ranging.observability_measures import SENSORS, STANDARD
from mathnavi.sim.studies.ranging.range_convergence.claims import (
    BEAN_WALL,
    BEYOND_EKF,
    DRIVEN,
    ELLIPSE,
    OBSERVED,
    ConvergenceResults,
    claims,
)
from mathnavi.sim.studies.ranging.range_convergence.costs import costs, read
from mathnavi.sim.studies.ranging.range_convergence.figure import figure
from mathnavi.sim.studies.ranging.range_convergence.runs import (
    BANK,
    EKF,
    FLOOR,
    PARTICLES,
    UKF,
    ExactAttempt,
    RangeRun,
    estimator_results,
    observer_converges,
)
from mathnavi.sim.sweep.trial import Trial, trial

FRICTIONS = (0.15, 0.4, 1.0)
WALLS = {ELLIPSE: STANDARD, BEAN_WALL: BEAN}
TIMED = 10  # [s] of readings that updates are timed over


@configuration
class RangeConvergenceConfig:
    """Sample sizes: cases that are measured."""

    seeds: Count = 200
    """runs of the observer, the bank and the EKF with each set of sensors"""
    peers: Count = 60
    """of them that the UKF and the particle filter follow too"""
    drives: Count = 10
    """runs on wheels with each set of sensors and friction"""
    repetitions: Count = 7
    """of what is timed"""
    seconds: Count = 20
    """of a run [s]"""


class RangeConvergence:
    """Convergence, accuracy, consistency and cost of the range estimators (Paper C)."""

    Config = RangeConvergenceConfig
    quick = RangeConvergenceConfig(seeds=10, peers=3, drives=1, repetitions=1)
    title = "Finding the pose from an unknown start: the bank of feasible poses beside other filters"
    on_terrain = False

    @staticmethod
    def run(config: RangeConvergenceConfig, setup: Setup) -> StudyResult:
        evidence = _evidence(config, setup)
        peers = min(config.peers, config.seeds)
        return StudyResult(
            summary=(
                f"{config.seeds} runs of {config.seconds} s with each set of sensors, a figure of eight of 1.5 m by "
                f".55 m, from a start that is drawn and not known; {peers} of them with the UKF and adaptive "
                "Monte Carlo localisation (AMCL), all on the same readings. Converged: RMS error below .3 m and .2 rad "
                "over the last quarter, modulo the symmetry of the wall. RMSE: of the runs that converged. 2s are "
                "sensors at ±60°, 2t at -90° and -45°, 3 and 4 evenly spaced. "
                "The EKF from nearby is given its start to .1 m and .1 rad.",
            ),
            rows=_rows(evidence),
            tables=(_found_table(evidence), _cost_table(evidence), _drive_table(evidence)),
            figure=figure(evidence, config.seconds),
            caption="(a) Shares of runs that converged, with 95 % limits of Clopper and Pearson. (b) Position error "
            "with sensors at -90° and -45°: the median of all runs, and where the middle half of the bank's lies. "
            "(c) RMSE of the runs that converged, with 95 % bootstrap bands. (d) CPU time of an update: loops of "
            "compiled kernels, and plug-ins called from Python. (e) Average NEES of the bank over the runs that "
            "converged, and where that of a consistent filter lies 95 % of the time. (f) RMS position error of the "
            "bank on two driven wheels; a dot for each run, a line through the RMS of all.",
            claims=claims(evidence),
        )


def _evidence(config: RangeConvergenceConfig, setup: Setup) -> ConvergenceResults:
    jobs = Jobs()
    for name in OBSERVED:
        attempts = [ExactAttempt(STANDARD, name, seed, config.seconds) for seed in range(config.seeds)]
        jobs.add(("observer", name), observer_converges, attempts)
    for name in BEYOND_EKF:
        for wall, curve in WALLS.items():
            runs = [
                RangeRun(curve, name, seed, config.seconds, _estimators(wall, seed, config.peers))
                for seed in range(config.seeds)
            ]
            jobs.add((wall, name), estimator_results, runs)
    asked = {
        (name, friction): [_on_wheels(name, friction, seed, config.seconds) for seed in range(config.drives)]
        for name in DRIVEN
        for friction in FRICTIONS
    }
    drives = setup.fly_groups(asked)
    done = jobs.done(setup)
    timing = {"repetitions": config.repetitions}
    update_times = setup.compute(timed_updates, BEYOND_EKF, seconds=min(TIMED, config.seconds), **timing)
    (run_times,) = setup.compute(timed_runs, [config.seconds], **timing)
    return ConvergenceResults(
        observed={name: rate(sum(done["observer", name]), config.seeds) for name in OBSERVED},
        found={
            (wall, name, estimator): [run[estimator] for run in done[wall, name] if estimator in run]
            for wall in WALLS
            for name in BEYOND_EKF
            for estimator in _estimators(wall, 0, 1)
        },
        costs={
            name: {filter_name: np.array(taken) for filter_name, taken in found.items()}
            for name, found in zip(BEYOND_EKF, update_times, strict=True)
        },
        drives=drives,
        run_cpu=np.array(run_times),
    )


def _estimators(wall: str, seed: int, peers: int) -> tuple[str, ...]:
    if wall != ELLIPSE:
        return (BANK,)
    return (BANK, EKF, FLOOR, UKF, PARTICLES) if seed < peers else (BANK, EKF, FLOOR)


def _on_wheels(sensors: str, friction: float, seed: int, seconds: int) -> Trial:
    fields = {"sensors": SENSORS[sensors], "friction": friction, "planner.mode": "figure-eight"}
    return trial("range-localisation", seed, fields=fields, drive="differential", duration=float(seconds))


def timed_updates(sensors: str, seconds: float, repetitions: int) -> dict[str, list[MeasuredTime]]:
    """(R,) CPU time [us] of an update by estimator, over readings of a set of sensors."""
    found = costs(read(sensors, seconds, np.random.default_rng(0)), repetitions)
    return {name: [MeasuredTime(time) for time in taken] for name, taken in found.items()}


def timed_runs(seconds: int, repetitions: int) -> list[MeasuredTime]:
    """(R,) CPU time of a run on wheels, physics and bank, over its duration; what is compiled is compiled before."""
    taken = []
    for _ in range(repetitions + 1):
        closed_loop = _on_wheels("4", FRICTIONS[-1], 0, seconds).build()
        began = time.thread_time()
        run = closed_loop.run()
        taken.append(MeasuredTime((time.thread_time() - began) / float(run.recording.t[-1])))
    return taken[1:]


# ---- rows and tables


def _rows(e: ConvergenceResults) -> list[dict[str, Any]]:
    """The CSV: a row for each thing that was measured, distinguished by ``what``."""
    return [
        *(
            {"what": "observer", "wall": ELLIPSE, "sensors": name, "estimator": "observer", "runs": found.trials,
             "converged": found.events, "share": found.value, "share_low": found.low, "share_high": found.high}
            for name, found in e.observed.items()
        ),
        *(_found_row(e, *key) for key in e.found),
        *(
            {"what": "update", "sensors": name, "estimator": what, "update_wall_s": 1e-6 * float(np.median(taken))}
            for name, cost in e.costs.items() for what, taken in cost.items()
        ),
        *(
            {"what": "on wheels", "wall": ELLIPSE, "sensors": name, "estimator": BANK, "friction": friction,
             "runs": len(records), "converged": sum(bool(record.summary["converged"]) for record in records),
             "position_rms_m": e.driven(name, friction)}
            for (name, friction), records in e.drives.items()
        ),
        {"what": "on wheels, a second", "run_wall_s": float(np.median(e.run_cpu))},
    ]  # fmt: skip


def _found_row(e: ConvergenceResults, wall: str, sensors: str, estimator: str) -> dict[str, Any]:
    share, rms = e.share(wall, sensors, estimator), e.rms(wall, sensors, estimator)
    row: dict[str, Any] = {
        "what": "found", "wall": wall, "sensors": sensors, "estimator": estimator, "runs": share.trials,
        "converged": share.events, "share": share.value, "share_low": share.low, "share_high": share.high,
    }  # fmt: skip
    if rms is not None:
        row |= {"position_rms_m": rms.value, "rms_low_m": rms.low, "rms_high_m": rms.high}
    if (wall, estimator) == (ELLIPSE, BANK) and (nees := e.nees(sensors)) is not None:
        row |= {"nees": nees.average, "nees_low": nees.low, "nees_high": nees.high, "nis_ray": e.nis(sensors, BANK)}
    return row


def _found_table(e: ConvergenceResults) -> Table:
    columns = ("wall", "sensors", "estimator", "converged", "RMSE [m]", "NIS a ray")
    rows = []
    for wall, sensors, estimator in e.found:
        rms = e.rms(wall, sensors, estimator)
        nis = e.nis(sensors, estimator) if wall == ELLIPSE else np.nan
        rows.append(
            (wall, sensors, estimator, e.share(wall, sensors, estimator).text(), "–" if rms is None else rms.text(),
             "–" if np.isnan(nis) else f"{nis:.3f}")
        )  # fmt: skip
    return Table("Runs that converged, and how exact their last quarter is", columns, rows)


def _cost_table(e: ConvergenceResults) -> Table:
    names = list(next(iter(e.costs.values())))
    rows = [(name, *(f"{np.median(cost[name]):.2f}" for cost in e.costs.values())) for name in names]
    return Table(
        "CPU time of an update [µs], medians; the first four are loops of compiled kernels, the others are called "
        "from Python",
        ("estimator", *e.costs),
        rows,
    )


def _drive_table(e: ConvergenceResults) -> Table:
    columns = ("sensors", "friction", "converged", "RMS position error [m]", "largest of a run [m]", "touched the wall")
    rows = []
    for (name, friction), records in e.drives.items():
        converged, touched = (sum(bool(r.summary[key]) for r in records) for key in ("converged", "touched_wall"))
        largest = figures(records, "position_rms_m").max()
        rows.append((name, f"{friction:g}", rate(converged, len(records)).text(), f"{e.driven(name, friction):.4f}",
                     f"{largest:.4f}", f"{touched} of {len(records)}"))  # fmt: skip
    return Table("The bank on two driven wheels in MuJoCo", columns, rows)
