"""A robot on a real floor from an unknown start: the feasible-set bank with a few beams of a laser, on published logs.

    python -m benchmarks.floors LOG [--beams 8 4] [--windows 10] [--picture FILE]

LOG is a log of CARMEN with scans whose poses SLAM has corrected (Radish: Intel lab, Freiburg 101). For each window of
the log the map is made from the scans at least ``apart`` away in time, and the bank gets, of the scans within, evenly
spread beams, and the steps of the wheels. A window is found if all errors of its last quarter are within 0.3 m and
0.2 rad. Errors are against the poses of SLAM, which are no independent truth, and the map is of the same poses. Windows
in places that no other scan has seen have no map: they are left out, which is said. The wheels are calibrated on the
steps outside of the window too. An estimate is wrong while it may be used and is off by twice as much. The exit code is
1 if the log is not there. ``--picture`` draws the hypotheses of the first window that is found.
"""

from __future__ import annotations

import itertools
import math
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

import mathnavi as mn
from benchmarks.arguments import read_arguments
from benchmarks.floor_picture import draw
from mathnavi.interfaces.bounds import Count, Positive, Seed, configuration
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.field_table import TOGETHER, Positional
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.models.field.scan_map import grid_of_scans
from mathnavi.models.field.tracing import traced

POSITION, HEADING = 0.3, 0.2  # [m, rad] within which a window is found
LONGEST = 30.0  # [m] from which on a range counts as one without an echo
SOONEST = 0.1  # [s] after the scan before
FEWEST = 10  # scans of a window that can be measured
CANDIDATES = 40  # random poses to begin with, per square metre
TAILS = 2.0  # times the deviation of a step is declared: steps have wider tails than a Gaussian
MAPPED = 0.95  # share of the poses of a window that lie on the map


@dataclass(frozen=True)
class Floor:
    """Scans of a log, their poses by SLAM, and what the wheels measured between them."""

    t: Array  # (n,) [s]
    ranges: Array  # (n, l) [m]
    angles: Array  # (l,) [rad]
    poses: Array  # (n, 3)
    wheels: tuple[Array, ...]  # n: poses (m, 3) by the wheels from the scan before to this one, which begin there


def floor_of(file: Path) -> Floor:
    """Read a log; LogError without scans that SLAM has corrected."""
    log = mn.read_log(file)
    if "scan" not in log or "scan pose" not in log:
        raise LogError(f"{file}: no scans with corrected poses; allowed: a log of CARMEN that SLAM has corrected")
    scan, poses = log["scan"], log["scan pose"].values
    first, step = (float(scan.facts[key]) for key in ("first angle [deg]", "step [deg]"))
    angles = np.radians(first + step * np.arange(scan.values.shape[1]))
    return Floor(scan.t, scan.values, angles, poses, _wheels(log, poses))


def _wheels(log: mn.RecordedLog, poses: Array) -> tuple[Array, ...]:
    """Poses by the wheels from each scan to the next: those of ``scan odometry``, or ODOM as GMapping passes it on.

    GMapping repeats the pose of each scan as a row of ODOM, from which the rows up to the next scan go on.
    """
    if "scan odometry" in log:
        own = log["scan odometry"].values
        return (own[:1], *(own[k - 1 : k + 1] for k in range(1, len(own))))
    rows = log["odometry"].values[:, :3]
    marks, at = [], 0
    for pose in poses:
        same = np.flatnonzero((rows[at:] == pose).all(axis=1))
        if not same.size:
            raise LogError(f"{log.source}: the pose of scan {len(marks)} is in no message ODOM after it")
        # While the robot stands, rows before the repeated one may be the same: the wheels did not move.
        at += int(same[0])
        marks.append(at)
        at += 1
    return (rows[marks[0] : marks[0] + 1], *(rows[a:b] for a, b in itertools.pairwise(marks)))


def map_without(floor: Floor, since: float, until: float, name: str) -> mn.Polygon:
    """Walls by the scans before ``since`` and after ``until`` [s]."""
    used = (floor.t < since) | (floor.t > until)
    grid = grid_of_scans(floor.poses[used], floor.angles, floor.ranges[used], longest=LONGEST, name=name)
    return traced(grid, 0.1, 0.05).walls


def beams_of(floor: Floor, count: int) -> Array:
    """Indices (count,) of beams that are spread evenly over the scan."""
    share = (np.arange(count) + 0.5) / count
    return np.rint(share * (len(floor.angles) - 1)).astype(int)


@dataclass(frozen=True)
class Calibration:
    """Wheels of a robot against the poses of SLAM: the true step is (ahead * d, turn * turn + veer * d)."""

    ahead: float
    turn: float
    veer: float  # [rad/m]
    deviation: tuple[float, float]  # [m, rad] of what is left of a step from one scan to the next


def calibration(floor: Floor, since: float, until: float) -> Calibration:
    """Least squares over the steps before ``since`` and after ``until`` [s]."""
    steps, truth = [], []
    for k in range(1, len(floor.t)):
        if since <= floor.t[k] <= until or since <= floor.t[k - 1] <= until:
            continue
        path = floor.wheels[k]
        steps.append(_relative(path[0], path[-1]))
        truth.append(_relative(floor.poses[k - 1], floor.poses[k]))
    wheels, slam = np.array(steps), np.array(truth)
    ahead = float(wheels[:, 0] @ slam[:, 0] / (wheels[:, 0] @ wheels[:, 0]))
    turn, veer = np.linalg.lstsq(wheels[:, [2, 0]], slam[:, 2], rcond=None)[0].tolist()
    left = np.hypot(slam[:, 0] - ahead * wheels[:, 0], slam[:, 1] - wheels[:, 1])
    turned = slam[:, 2] - turn * wheels[:, 2] - veer * wheels[:, 0]
    return Calibration(ahead, turn, veer, (float(np.sqrt(np.mean(left**2))), float(np.std(turned))))


def _relative(one: Array, other: Array) -> Array:
    """Pose (3,) of ``other`` as seen from ``one``."""
    c, s = math.cos(one[2]), math.sin(one[2])
    d = other[:2] - one[:2]
    return np.array([c * d[0] + s * d[1], -s * d[0] + c * d[1], float(wrapped(other[2] - one[2]))])


def sensor_log(floor: Floor, rows: Array, beams: Array, wheels: Calibration) -> mn.SensorLog:
    """Ranges of the ``beams`` at the scans ``rows``, and mean speeds of the wheels between them.

    Rows of odometry between two scans have no reliable stamps: they count as evenly spread. A scan whose stamp is not
    later than that before it is left out, and the wheels go on to the next.
    """
    nothing = np.full(len(beams), np.nan)
    t, ranges, speeds = [floor.t[rows[0]]], [floor.ranges[rows[0], beams]], [[0.0, 0.0]]
    steps: list[Array] = []
    for k in rows[1:]:
        steps.extend(_arcs(floor.wheels[k]))
        before = t[-1]
        if floor.t[k] < before + SOONEST:
            continue
        dt = (floor.t[k] - before) / len(steps)
        for j, (ahead, turn) in enumerate(steps, start=1):
            is_last = j == len(steps)
            t.append(floor.t[k] if is_last else before + j * dt)
            ranges.append(floor.ranges[k, beams] if is_last else nothing)
            speeds.append([wheels.ahead * ahead / dt, (wheels.turn * turn + wheels.veer * ahead) / dt])
        steps = []
    return mn.SensorLog(np.array(t), {"ranges": np.array(ranges), "odometry": np.array(speeds)})


def _arcs(path: Array) -> list[Array]:
    """Lengths [m] and turns [rad] of the arcs between poses (m, 3); one of no length if there is one pose only."""
    found = [np.zeros(2)] if len(path) < 2 else []
    for one, other in itertools.pairwise(path):
        d, turn = other[:2] - one[:2], float(wrapped(other[2] - one[2]))
        middle = one[2] + 0.5 * turn
        chord = float(d @ [math.cos(middle), math.sin(middle)])
        found.append(np.array([chord / float(np.sinc(0.5 * turn / math.pi)), turn]))
    return found


@dataclass(frozen=True)
class Window:
    """A window of a floor's log, its map, and the estimates in it."""

    since: float  # [s]
    walls: mn.Polygon
    rows: Array  # scans
    beams: Array
    agreeing: float  # share of the beams' ranges that the map has within 0.3 m at the poses of SLAM
    found: mn.EstimateHistory
    at: Array  # rows of the estimates at the scans
    seconds: float  # of computing


def measure(
    floor: Floor, since: float, seconds: float, apart: float, beams: int, seed: int, name: str
) -> Window | None:
    """Estimate over one window; None where its poses are not on the map, or it has too few scans."""
    rows = np.flatnonzero((floor.t >= since) & (floor.t < since + seconds))
    walls = map_without(floor, since - apart, since + seconds + apart, name)
    if len(rows) < FEWEST or np.mean([walls.contains(p[:2]) for p in floor.poses[rows]]) < MAPPED:
        return None
    chosen = beams_of(floor, beams)
    wheels = calibration(floor, since - apart, since + seconds + apart)
    log = sensor_log(floor, rows, chosen, wheels)
    period = float(np.median(np.diff(log.t)))
    scan = (len(log.t) - 1) / (len(rows) - 1)  # readings of odometry from one scan to the next
    noise = tuple(TAILS * each / math.sqrt(scan) / period for each in wheels.deviation)
    mission = mn.RangingMission(
        walls,
        tuple(floor.angles[chosen].tolist()),
        mn.RangeQuality(0.01, 0.1, outliers=0.15, maximum=LONGEST),
        mn.OdometryQuality((noise[0], noise[1]), 0.02),
        period=period,
    )
    rows = rows[np.isin(floor.t[rows], log.t)]
    begun = time.process_time()
    found = mn.estimate("feasible_set_bank", mission, log, seed=seed, **bank_fields(walls))
    taken = time.process_time() - begun
    expected = np.array([walls.ranges(pose, floor.angles[chosen])[0] for pose in floor.poses[rows]])
    read = np.where(floor.ranges[rows][:, chosen] < LONGEST, floor.ranges[rows][:, chosen], np.nan)
    off = np.abs(read - expected)[np.isfinite(read)]
    agreeing = float(np.mean(off < POSITION)) if off.size else 0.0
    return Window(since, walls, rows, chosen, agreeing, found, np.searchsorted(found.t, floor.t[rows]), taken)


def bank_fields(walls: mn.Polygon) -> dict[str, Any]:
    """Fields of the bank: one scan to begin with, and as many poses as the area needs."""
    return {
        "candidates": CANDIDATES * math.ceil(walls.area),
        "hypotheses": 1000,
        "readings": 1,
        "timeout": 20.0,
        "deviation": (0.3, 0.3, 0.15),
        "lowest": -40.0,
        "misfit": 6.0,
    }


@dataclass(frozen=True)
class Verdict:
    """What came of a window."""

    found: bool  # within 0.3 m and 0.2 rad over its last quarter
    median: float  # [m] error while it may be used
    last: float  # [m] greatest error of the last quarter
    usable: float  # share of the scans
    wrong: float  # share of the scans at which it may be used and is off by more than 0.6 m or 0.4 rad
    lock: float  # [s] from which on all errors are small; NaN if never
    update: float  # [us] of one update


def verdict(floor: Floor, window: Window, seconds: float) -> Verdict:
    """Judge a window by the poses of SLAM at its scans."""
    t, truth, x = floor.t[window.rows], floor.poses[window.rows], window.found.x[window.at]
    off = np.hypot(*(x - truth)[:, :2].T)
    turned = np.abs(wrapped(x[:, 2] - truth[:, 2]))
    near = (off <= POSITION) & (turned <= HEADING)
    last = t >= window.since + 0.75 * seconds
    usable = window.found.usable[window.at]
    wrong = usable & ((off > 2.0 * POSITION) | (turned > 2.0 * HEADING))
    bad = np.flatnonzero(~near)
    locked = 0 if not bad.size else int(bad[-1]) + 1
    return Verdict(
        bool(last.any() and near[last].all()),
        float(np.median(off[usable])) if usable.any() else math.nan,
        float(off[last].max(initial=0.0)),
        float(usable.mean()),
        float(wrong.mean()),
        float(t[locked] - t[0]) if locked < len(t) else math.nan,
        1e6 * window.seconds / len(window.found.t),
    )


@configuration
class FloorArguments:
    """A robot on a real floor from an unknown start, by a few beams of a laser and odometry, on a published log."""

    log: Annotated[Path, Positional("LOG")]
    """log of CARMEN with scans whose poses SLAM has corrected"""
    beams: Annotated[tuple[int, ...], TOGETHER] = (8,)
    """numbers of beams, each of which is tried"""
    windows: Count = 10
    """number of windows, spread over the log"""
    seconds: Positive = 60.0
    """length of a window [s]"""
    apart: Positive = 60.0
    """least time between a window and the scans of its map [s]"""
    seed: Seed = 0
    """seed of the random poses"""
    picture: Path | None = None
    """picture to write of the first window that is found; it shows the data"""


def main(options: FloorArguments) -> int:
    """Print the tables; 1 if the log is not there."""
    if not options.log.is_file():
        print(f"there is no {options.log}; the logs are those of Radish, corrected by GMapping (acschaefer/ple)")
        return 1
    floor = floor_of(options.log)
    name, drawn = options.log.name.partition("-corrected")[0], options.picture is None
    print("errors are against the poses of SLAM, of which the map is made too")
    for beams in options.beams:
        print(f"{name}, {beams} beams")
        print(
            f"{'from':>8}{'found':>7}{'median':>8}{'last':>7}{'usable':>8}{'wrong':>7}{'lock':>7}{'update':>8}{'mapped':>8}"
        )
        print(f"{'[s]':>8}{'':7}{'[m]':>8}{'[m]':>7}{'[%]':>8}{'[%]':>7}{'[s]':>7}{'[us]':>8}{'[%]':>8}")
        judged = []
        for since in np.linspace(floor.t.min(), floor.t.max() - options.seconds, options.windows).tolist():
            window = measure(floor, since, options.seconds, options.apart, beams, options.seed, name)
            if window is None:
                print(f"{since:8.0f} left out: fewer than {FEWEST} scans, or a place that no other scan has seen")
                continue
            own = verdict(floor, window, options.seconds)
            judged.append(own)
            print(
                f"{since:8.0f}{'yes' if own.found else 'no':>7}{own.median:8.2f}{own.last:7.2f}{100 * own.usable:8.0f}"
                f"{100 * own.wrong:7.1f}{own.lock:7.1f}{own.update:8.0f}{100 * window.agreeing:8.0f}",
                flush=True,
            )
            if own.found and not drawn and options.picture is not None:
                scans = floor.ranges[window.rows][:, window.beams]
                shown = np.where(scans < LONGEST, scans, np.nan)
                truth, angles = floor.poses[window.rows], floor.angles[window.beams]
                draw(options.picture, window.walls, window.found, window.at, truth, shown, angles)
                drawn = True
        if judged:
            wrong = 100.0 * float(np.mean([each.wrong for each in judged]))
            print(
                f"found {sum(each.found for each in judged)} of {len(judged)} windows, wrong {wrong:.1f} % of the time"
            )
    return 0


if __name__ == "__main__":
    sys.exit(main(read_arguments(FloorArguments)))
