"""Logs of robots among beacons: readings, mission and reference, and the errors of filter and smoother over them.

**Plaza1** is a lawn mower with four radio beacons; the ranges of a beacon are some percent too long, and the heading of
the reference is that of a gyroscope. **MR.CLAM** are unicycles that see landmarks by a camera, under motion capture.
Errors are at the times of the log that the reference spans, those of the filter as it had them at the time.
The deviations that are declared were set by hand on these logs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.input_files import InputFile
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.beacons import BeaconMission, BeaconQuality
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality
from mathnavi.sim.logs.formats import read_log
from mathnavi.sim.records.sensor_log import EstimateHistory, SensorLog, estimate, smoother
from mathnavi.sim.records.table import Row
from mathnavi.studies.real.judging import pose_figures, row, timed

ODOMETRY = (0.15, 0.02)  # [m/s, rad/s] of a reading of Plaza's
RANGE = 1.0  # [m] of Plaza's, whose errors last for some readings
DELAY = 0.2  # [s] by which MR.CLAM's commands act later
NEAR = {"beacons": (1.0, 0.2), "unicycles": (0.3, 0.2)}  # [m, rad] within which a pose is near
_FEW = 100  # readings by which kernels are loaded
KNOWN = (0.1, 0.1, 0.02)  # [m, m, rad] deviation of a start that is known


@dataclass(frozen=True)
class RecordedDrive:
    """A log for estimators, its mission, and the reference."""

    log: SensorLog
    mission: BeaconMission
    t: Array  # (n,) [s]
    truth: Array  # (n, 3)

    def with_beacons(self, count: int) -> RecordedDrive:
        """The drive with ``count`` of the beacons only, spread over their order; all of them with 0."""
        if not 0 < count < len(self.mission.beacons):
            return self
        chosen = np.linspace(0, len(self.mission.beacons) - 1, count).round().astype(int)
        readings = {
            name: values[:, chosen] if name.startswith("beacon") else values
            for name, values in self.log.readings.items()
        }
        places = tuple(self.mission.beacons[k] for k in chosen.tolist())
        return replace(
            self, log=replace(self.log, readings=readings), mission=replace(self.mission, beacons=places)
        )  # fmt: skip

    @property
    def start(self) -> KnownStart:
        """The first pose of the reference."""
        x, y, heading = self.truth[0].tolist()
        return KnownStart((x, y, heading), KNOWN, float(self.t[0]))

    def truth_at(self, t: Array) -> Array:
        """Poses (m, 3) of the reference at times (m,) [s] that it spans."""
        heading = np.unwrap(self.truth[:, 2])
        return np.column_stack([np.interp(t, self.t, each) for each in (*self.truth[:, :2].T, heading)])


def plaza(file: Path) -> RecordedDrive:
    """A lawn mower among four radio beacons: file of GTSAM's examples."""
    log = read_log(file, "matlab", time_column=0, arrays=("DR", "TD", "GT")).rates("DR")
    log = log.spread("TD:TD 3", by="TD:TD 2")
    own = log.sensor_log(readings={"beacon_ranges": "TD 3", "odometry": "DR"}, disorder="sort")
    places = beacons_of(file)
    order = [int(signal.partition("=")[2]) for signal in log["TD 3"].signals]
    mission = BeaconMission(
        tuple(places[node] for node in order),
        ranges=BeaconQuality(RANGE, outliers=0.02),
        range_scale=0.1,
        odometry=OdometryQuality(ODOMETRY, 0.01),
        speed_max=3.0,
        period=0.2,
        interval=0.25,
    )
    return RecordedDrive(own, mission, log["GT"].t, log["GT"].values)


def beacons_of(file: Path) -> dict[int, tuple[float, float]]:
    """Places [m] of Plaza's beacons by their number."""
    from scipy.io import loadmat

    return {int(node): (float(x), float(y)) for node, x, y in loadmat(file)["TL"]}


def mrclam(folder: Path, robot: int) -> RecordedDrive:
    """One robot of MR.CLAM: ranges and bearings of the landmarks that it saw, by its camera."""
    log = read_log(folder, "mrclam", robot=robot).delayed("odometry", DELAY)
    seen = sorted(set(log["landmarks"].values[:, 0].astype(int).tolist()))
    for signal in ("range", "bearing"):
        log = log.spread(f"landmarks:{signal}", by="landmarks:subject")
    readings = {"beacon_ranges": "range", "beacon_bearings": "bearing"}
    own = log.sensor_log(readings=readings, inputs="odometry", disorder="sort")
    places = [log.facts[f"landmark {each} [m]"].split() for each in seen]
    mission = BeaconMission(
        tuple((float(x), float(y)) for x, y in places),
        ranges=BeaconQuality(0.1, 0.1, outliers=0.05),
        bearings=BeaconQuality(0.03, outliers=0.05),
        odometry=OdometryQuality((0.15, 0.5), 0.2),
        odometry_is_input=True,
        surroundings=3.0,
        period=0.0145,
        interval=0.3,
    )
    return RecordedDrive(own, mission, log["motion capture"].t, log["motion capture"].values)


@dataclass(frozen=True)
class BeaconCase:
    """A log, its robot, and how many beacons count."""

    part: str  # of NEAR
    files: Annotated[tuple[str, ...], InputFile()]  # Plaza's one, or those of MR.CLAM's folder
    robot: int = 0
    beacons: int = 0  # of all that there are; 0 for all
    knows_start: bool = False

    def drive(self) -> RecordedDrive:
        """Read the log."""
        file = Path(self.files[0])
        whole = plaza(file) if self.part == "beacons" else mrclam(file.parent, self.robot)
        return whole.with_beacons(self.beacons)

    @property
    def log(self) -> str:
        """Name of the log."""
        file = Path(self.files[0])
        return file.stem.strip("_") if self.part == "beacons" else f"{file.parent.name}, robot {self.robot}"


def beacon_rows(case: BeaconCase) -> list[Row]:
    """A job: rows of filter and smoother over a log."""
    drive = case.drive()
    mission = replace(drive.mission, start=drive.start if case.knows_start else None)
    methods: dict[str, Any] = {"beacon_bank": "beacon_bank", "smoother of beacon_bank": smoother("beacon_bank")}
    rows = []
    for name, method in methods.items():
        try:
            run = partial(estimate, method, mission, drive.log)
            found, update = timed(name, run, partial(estimate, method, *_head(drive)))
        except LogError:  # the smoother, where the filter finds no pose to begin with
            rows.append(_unfound(case, drive, name))
        else:
            rows.append(_row(case, drive, name, found, update))
    return rows


def _head(drive: RecordedDrive) -> tuple[BeaconMission, SensorLog]:
    """The first readings of a log since the reference began, with a start that is known."""
    log, first = drive.log, int(np.searchsorted(drive.log.t, drive.t[0]))
    some = slice(first, first + _FEW)
    head = replace(
        log,
        t=log.t[some],
        readings={name: values[some] for name, values in log.readings.items()},
        inputs=None if log.inputs is None else log.inputs[some],
    )
    return replace(drive.mission, start=drive.start), head


def _unfound(case: BeaconCase, drive: RecordedDrive, name: str) -> Row:
    start = "known" if case.knows_start else "unknown"
    return row(
        part=case.part, log=case.log, beams=len(drive.mission.beacons), estimator=name, start=start, found=False
    )  # fmt: skip


def _row(case: BeaconCase, drive: RecordedDrive, name: str, found: EstimateHistory, update: float) -> Row:
    at = np.flatnonzero((found.t >= drive.t[0]) & (found.t <= drive.t[-1]))
    truth = drive.truth_at(found.t[at])
    figures = pose_figures(found, at, truth, NEAR[case.part])
    scales = found.extra.get("scales")
    return row(
        part=case.part,
        log=case.log,
        beams=len(drive.mission.beacons),
        estimator=name,
        start="known" if case.knows_start else "unknown",
        found=bool(np.isfinite(figures["lock_s"])),
        last_error_m=float(np.hypot(*(found.x[at[-1], :2] - truth[-1, :2]))),
        setting=float("nan") if scales is None or case.part != "beacons" else float(scales[-1, 2]),
        update_us=update,
        **figures,
    )
