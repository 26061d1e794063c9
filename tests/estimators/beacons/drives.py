"""Drives of a unicycle among beacons as logs, with the poses that are true."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import mathnavi as mn
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.beacons import exact_readings
from mathnavi.models.unicycle.kernels import integrate

PLACES = ((0.0, -20.0), (25.0, 2.0), (-18.0, 30.0), (22.0, 26.0))
PERIOD = 0.2  # [s]
SENSORS = {"ranges": "beacon_ranges", "bearings": "beacon_bearings", "range_differences": "beacon_differences"}


@dataclass(frozen=True)
class Drive:
    """A log, and the pose (n, 3) at each of its times."""

    log: mn.SensorLog
    truth: Array


def mission(kind: str = "ranges", **changes: object) -> mn.BeaconMission:
    """A robot that reads one kind of its beacons, or several "a+b"; its start is not known."""
    qualities = {
        "ranges": mn.BeaconQuality(0.3, outliers=0.05),
        "bearings": mn.BeaconQuality(0.03, outliers=0.05),
        "range_differences": mn.BeaconQuality(0.3, outliers=0.05),
    }
    given = {name: qualities[name] for name in kind.split("+")}
    fields = {"range_scale": 0.1, "odometry": mn.OdometryQuality((0.05, 0.02), 0.02), "period": PERIOD} | given
    return mn.BeaconMission(PLACES, **(fields | {"interval": 0.5} | changes))  # type: ignore[arg-type]


def drive(kind: str = "ranges", count: int = 600, *, scale: float = 0.07, outliers: float = 0.03) -> Drive:
    """A drive in bends: one beacon is read between two readings of odometry, each half a second or so."""
    rng = np.random.default_rng(3)
    pose, t, times, truths = np.array([3.0, -4.0, 2.2]), 0.0, [], []
    names = kind.split("+")
    rows: dict[str, list[Array]] = {name: [] for name in (*names, "odometry")}
    deviation = {"ranges": 0.3, "bearings": 0.03, "range_differences": 0.3}
    order = ("ranges", "bearings", "range_differences")
    for k in range(count):
        u = np.array([1.2 + 0.3 * np.sin(0.03 * k), 0.35 * np.sin(0.02 * k)])
        read = k % 2 == 0
        steps = (0.07, PERIOD - 0.07) if read else (PERIOD,)
        for n, h in enumerate(steps):
            pose, t = integrate(pose, u[0], u[1], h), t + h
            last = n == len(steps) - 1
            for name in names:
                row = np.full(len(PLACES), np.nan)
                if read and not last:
                    i = 1 + k // 2 % 3 if name == "range_differences" else k // 2 % 4
                    own = exact_readings(np.array(PLACES), order.index(name), pose)[i]
                    own = own if name == "bearings" else (1.0 + scale) * own
                    row[i] = own + deviation[name] * rng.standard_normal()
                    if rng.random() < outliers:
                        row[i] = rng.uniform(-3.0, 3.0) if name == "bearings" else rng.uniform(0.0, 60.0)
                rows[name].append(row)
            noise = np.array([0.05, 0.02]) * rng.standard_normal(2)
            rows["odometry"].append(1.01 * u + noise if last else np.full(2, np.nan))
            times.append(t)
            truths.append(pose)
    readings = {SENSORS.get(name, name): np.array(each) for name, each in rows.items()}
    return Drive(mn.SensorLog(np.array(times), readings), np.array(truths))


def wandering(
    seed: int,
    count: int = 500,
    *,
    read: Sequence[str] = ("ranges",) * 4,
    known: Sequence[int] = (),
    started: bool = True,
) -> tuple[mn.BeaconMission, Drive, Array]:
    """A mission with four beacons at unknown places but those ``known``, a drive through it, and the places (4, 2).

    Of each beacon the kinds ``read`` are read, several "a+b". The start is known if ``started``.
    """
    rng = np.random.default_rng(seed)
    places, pose, times, truths = rng.uniform(-35.0, 35.0, (4, 2)), np.zeros(3), [], []
    of_beacon = [each.split("+") for each in read]
    names = [name for name in SENSORS if any(name in each for each in of_beacon)]
    rows, odometry = {name: np.full((count, 4), np.nan) for name in names}, np.empty((count, 2))
    deviation = {"ranges": 0.3, "bearings": 0.03, "range_differences": 0.3}
    fastest, phase = rng.uniform(0.1, 0.35), rng.uniform(0.0, 6.0)
    for k in range(count):
        u = np.array([1.2 + 0.3 * np.sin(0.03 * k), fastest * np.sin(0.02 * k + phase)])
        pose = integrate(pose, u[0], u[1], PERIOD)
        if k % 2:
            i = k // 2 % 4
            for name in of_beacon[i]:
                exact = exact_readings(places, list(SENSORS).index(name), pose)[i]
                scale = 1.0 if name == "bearings" else 1.05
                rows[name][k, i] = scale * exact + deviation[name] * rng.standard_normal()
                if rng.random() < 0.03 and np.isfinite(exact):
                    rows[name][k, i] = rng.uniform(-3.0, 3.0) if name == "bearings" else rng.uniform(0.0, 60.0)
        odometry[k] = 1.01 * u + np.array([0.05, 0.02]) * rng.standard_normal(2)
        times.append(times[-1] + PERIOD if times else PERIOD)
        truths.append(pose)
    start = mn.KnownStart((0.0, 0.0, 0.0), (1e-3, 1e-3, 1e-3), 0.0) if started else None
    given = tuple((x, y) if i in known else None for i, (x, y) in enumerate(places.tolist()))
    asked = dataclasses.replace(mission("+".join(names), surroundings=40.0), beacons=given, start=start)
    log = mn.SensorLog(np.array(times), {**{SENSORS[name]: each for name, each in rows.items()}, "odometry": odometry})
    return asked, Drive(log, np.array(truths)), places
