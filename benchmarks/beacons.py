"""Robots among beacons, on published logs: filter and smoother of ``beacon_bank``, and GTSAM's batch smoother.

    python -m benchmarks.beacons --data FOLDER [--only plaza mrclam]

FOLDER has ``plaza/Plaza1_.mat`` (borglab/gtsam, examples/Data) and ``mrclam6/`` (MR.CLAM, data set 6); a part whose
files are not there is named and left out, and the exit code is 1. GTSAM takes part where it is installed
(``pip install gtsam``). It has no scale of ranges as an unknown: it gets the ranges as recorded, and once more over the
scale that our filter has found. Errors are taken at the times of the log that the reference spans; the estimates of the
filter are those that it had at the time, *all* also where it calls itself lost, *usable* where it does not.
"""

from __future__ import annotations

import importlib
import math
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

import mathnavi as mn
from benchmarks.arguments import read_arguments
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.field_table import TOGETHER
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.sim.records.reference_figures import reference_figures

NAMES = ("x [m]", "y [m]", "heading [rad]")
ODOMETRY = (0.15, 0.02)  # [m/s, rad/s] of a reading of Plaza's
RANGE, DELAY = (
    1.0,
    0.2,
)  # [m] of Plaza's, whose errors last for some readings; [s] by which MR.CLAM's commands act later


@dataclass(frozen=True)
class Recorded:
    """A log for estimators, its mission, and the reference."""

    log: mn.SensorLog
    mission: mn.BeaconMission
    t: Array  # (n,) [s]
    truth: Array  # (n, 3)


def plaza(file: Path) -> Recorded:
    """Plaza1: a lawn mower, four radio beacons; the heading of the reference is that of its gyroscope."""
    log = mn.read_log(file, "matlab", time_column=0, arrays=("DR", "TD", "GT")).rates("DR")
    log = log.spread("TD:TD 3", by="TD:TD 2")
    own = log.sensor_log(readings={"beacon_ranges": "TD 3", "odometry": "DR"}, disorder="sort")
    places = beacons_of(file)
    order = [int(signal.partition("=")[2]) for signal in log["TD 3"].signals]
    mission = mn.BeaconMission(
        tuple(places[node] for node in order),
        ranges=mn.BeaconQuality(RANGE, outliers=0.02),
        range_scale=0.1,
        odometry=mn.OdometryQuality(ODOMETRY, 0.01),
        speed_max=3.0,
        period=0.2,
        interval=0.25,
    )
    return Recorded(own, mission, log["GT"].t, log["GT"].values)


def beacons_of(file: Path) -> dict[int, tuple[float, float]]:
    """Places [m] of Plaza's beacons by their number."""
    from scipy.io import loadmat

    return {int(node): (float(x), float(y)) for node, x, y in loadmat(file)["TL"]}


def mrclam(folder: Path, robot: int) -> Recorded:
    """One robot of MR.CLAM: ranges and bearings of the landmarks that it saw, by its camera."""
    log = mn.read_log(folder, "mrclam", robot=robot).delayed("odometry", DELAY)
    seen = sorted(set(log["landmarks"].values[:, 0].astype(int).tolist()))
    for signal in ("range", "bearing"):
        log = log.spread(f"landmarks:{signal}", by="landmarks:subject")
    readings = {"beacon_ranges": "range", "beacon_bearings": "bearing"}
    own = log.sensor_log(readings=readings, inputs="odometry", disorder="sort")
    places = [log.facts[f"landmark {each} [m]"].split() for each in seen]
    mission = mn.BeaconMission(
        tuple((float(x), float(y)) for x, y in places),
        ranges=mn.BeaconQuality(0.1, 0.1, outliers=0.05),
        bearings=mn.BeaconQuality(0.03, outliers=0.05),
        odometry=mn.OdometryQuality((0.15, 0.5), 0.2),
        odometry_is_input=True,
        surroundings=3.0,
        period=0.0145,
        interval=0.3,
    )
    return Recorded(own, mission, log["motion capture"].t, log["motion capture"].values)


def figures(found: mn.EstimateHistory, recorded: Recorded) -> dict[str, float]:
    """Figures at the times of the estimates that the reference spans, and the root mean square over all of these."""
    t = recorded.t
    kept = (found.t >= t[0]) & (found.t <= t[-1])
    heading = np.unwrap(recorded.truth[:, 2])
    columns = [np.interp(found.t[kept], t, each) for each in (*recorded.truth[:, :2].T, heading)]
    truth = np.column_stack(columns)
    statuses = tuple(status for status, inside in zip(found.status, kept, strict=True) if inside)
    part = replace(
        found,
        t=found.t[kept],
        x=found.x[kept],
        covariance=found.covariance[kept],
        status=statuses,
        message=(),
        extra={},
    )
    all_of_it = float(np.sqrt(np.mean(np.square(part.x[:, :2] - truth[:, :2]).sum(axis=1))))
    return {"all_m": all_of_it, **reference_figures(part, part.t, truth, NAMES)}


def ours(recorded: Recorded, start: mn.KnownStart | None) -> dict[str, tuple[mn.EstimateHistory, float]]:
    """Estimates of filter and smoother over a log, and the times [s] that they took."""
    mission = replace(recorded.mission, start=start)
    found = {}
    for name, method in (("filter", "beacon_bank"), ("smoother", mn.smoother("beacon_bank"))):
        begun = time.process_time()
        found[name] = mn.estimate(method, mission, recorded.log), time.process_time() - begun
    return found


def gtsam_smoother(file: Path, scale: float) -> tuple[float, float] | None:
    """Root mean squares of GTSAM over Plaza1, position [m] and heading [rad], from the true start; None without it.

    Poses are at the times of odometry, a range at the nearest, as in GTSAM's own examples; Tukey's loss.
    """
    try:
        gtsam: Any = importlib.import_module("gtsam")
    except ImportError:
        return None
    from scipy.io import loadmat

    content = loadmat(file)
    steps, ranges, truth = content["DR"], content["TD"], content["GT"]
    sigmas, prior = np.array([0.2 * ODOMETRY[0], 0.01, 0.2 * ODOMETRY[1]]), np.array([0.1, 0.1, 0.02])
    diagonal = gtsam.noiseModel.Diagonal.Sigmas
    tukey = gtsam.noiseModel.mEstimator.Tukey.Create(4.685)
    of_range = gtsam.noiseModel.Robust.Create(tukey, gtsam.noiseModel.Isotropic.Sigma(1, RANGE))
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    pose = gtsam.Pose2(*truth[0, 1:])
    graph.add(gtsam.PriorFactorPose2(gtsam.symbol("x", 0), pose, diagonal(prior)))
    values.insert(gtsam.symbol("x", 0), pose)
    for k, (_, d, turn) in enumerate(steps):
        step = gtsam.Pose2(d * math.cos(0.5 * turn), d * math.sin(0.5 * turn), turn)
        one, other = gtsam.symbol("x", k), gtsam.symbol("x", k + 1)
        graph.add(gtsam.BetweenFactorPose2(one, other, step, diagonal(sigmas)))
        pose = pose.compose(step)
        values.insert(other, pose)
    for node, place in beacons_of(file).items():
        point = gtsam.Point2(*place)
        values.insert(gtsam.symbol("l", node), point)
        exact = gtsam.noiseModel.Isotropic.Sigma(2, 1e-4)
        graph.add(gtsam.PriorFactorPoint2(gtsam.symbol("l", node), point, exact))
    t = np.concatenate([truth[:1, 0], steps[:, 0]])
    for at, _, node, rho in ranges:
        nearest = gtsam.symbol("x", int(np.argmin(np.abs(t - at))))
        graph.add(gtsam.RangeFactor2D(nearest, gtsam.symbol("l", int(node)), rho / (1.0 + scale), of_range))
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    poses = [found.atPose2(gtsam.symbol("x", k)) for k in range(len(t))]
    error = np.array([[each.x(), each.y(), each.theta()] for each in poses]) - truth[:, 1:]
    heading = wrapped(error[:, 2])
    return float(np.sqrt(np.square(error[:, :2]).sum(axis=1).mean())), float(np.sqrt(np.square(heading).mean()))


@configuration
class BeaconArguments:
    """Robots among beacons, on published logs: errors of filter and smoother, and of GTSAM's where it is installed."""

    data: Path
    """folder with plaza/Plaza1_.mat and mrclam6/"""
    only: Annotated[tuple[Literal["plaza", "mrclam"], ...], TOGETHER] = ("plaza", "mrclam")
    """parts"""


def main(options: BeaconArguments) -> int:
    """Print the table; 1 if data of a part are not there."""
    file, folder = options.data / "plaza" / "Plaza1_.mat", options.data / "mrclam6"
    whole = True
    print(f"{'':32}{'all':>7}{'usable':>8}{'heading':>9}{'NEES':>7}{'used':>7}{'wrong':>8}{'found':>8}{'CPU':>7}")
    print(f"{'':32}{'[m]':>7}{'[m]':>8}{'[deg]':>9}{'/3':>7}{'[%]':>7}{'[%]':>8}{'[s]':>8}{'[s]':>7}")
    if "plaza" in options.only:
        if file.is_file():
            run_plaza(file)
        else:
            whole = False
            print(f"plaza: there is no {file}; see the head of this file for where it is published")
    if "mrclam" in options.only:
        if folder.is_dir():
            for robot in (1, 2, 3):
                run(f"MR.CLAM 6, robot {robot}", mrclam(folder, robot), None)
        else:
            whole = False
            print(f"mrclam: there is no {folder}; see the head of this file for where it is published")
    return 0 if whole else 1


def run_plaza(file: Path) -> None:
    """Print the rows of Plaza1."""
    recorded = plaza(file)
    known = mn.KnownStart(tuple(recorded.truth[0].tolist()), (0.1, 0.1, 0.02), float(recorded.t[0]))
    scale = run("Plaza1, start known", recorded, known)
    run("Plaza1, start unknown", recorded, None)
    for words, divided in (("GTSAM, as recorded", 0.0), (f"GTSAM, ranges / {1.0 + scale:.4f}", scale)):
        answer = gtsam_smoother(file, divided)
        if answer is None:
            print("GTSAM is not installed; allowed: pip install gtsam")
            return
        print(f"{words:32}{answer[0]:7.3f}{'':8}{math.degrees(answer[1]):9.2f}", flush=True)


def run(words: str, recorded: Recorded, start: mn.KnownStart | None) -> float:
    """Print the rows of filter and smoother, and return the scale error of the ranges that the filter ended with."""
    found = ours(recorded, start)
    for name, (history, seconds) in found.items():
        each = figures(history, recorded)
        print(
            f"{f'{words}, {name}':32}{each['all_m']:7.3f}{each['position_rms_m']:8.3f}{each['heading_rms_deg']:9.2f}"
            f"{each['nees_mean']:7.2f}{100.0 * each['usable_share']:7.1f}{100.0 * each['wrong_share']:8.2f}"
            f"{each['initialising_s']:8.1f}{seconds:7.1f}",
            flush=True,
        )
    return float(found["filter"][0].extra["scales"][-1, 2])


if __name__ == "__main__":
    sys.exit(main(read_arguments(BeaconArguments)))
