"""Real logs: every applicable estimator on published logs.

A part is an entry of ``PARTS``: where its logs are from (``published``), and its computations, each of which returns
rows of the same columns (``judging``). Its targets are in ``targets``. Without ``data`` the logs are fetched; a part
whose logs are not at hand is named with the reason, and its targets are not measured.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import numpy as np
from annotated_types import Interval

from mathnavi.interfaces.bounds import Count, Each, Positive, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import TOGETHER
from mathnavi.models.mechanism.entity import MechanismPlace, file_of
from mathnavi.renders.study_report import Table
from mathnavi.studies.framework.study import Jobs, Row, Setup, StudyResult, chosen
from mathnavi.studies.real import gtsam_peers, targets
from mathnavi.studies.real.arm_filters import ArmComparison, arm_rows
from mathnavi.studies.real.attitude_logs import AttitudeLog, attitude_rows
from mathnavi.studies.real.beacon_logs import BeaconCase, beacon_rows
from mathnavi.studies.real.drawings import figure
from mathnavi.studies.real.floor_windows import (
    BANK,
    LEFT_OUT,
    PLACES,
    DrawnWindow,
    FloorWindow,
    drawn_window,
    window_rows,
    windows_of,
)
from mathnavi.studies.real.published import (
    ARMS,
    ATTITUDES,
    BEACONS,
    FLOORS,
    UNICYCLES,
    LogSource,
    NotAtHandError,
    logs_of,
    named,
)
from mathnavi.studies.real.targets import MANY, TARGETS
from mathnavi.studies.real.unknown_beacons import OFF, PART, unknown_rows

PartName = Literal["floors", "beacons", "unicycles", "arm", "attitude"]
_ODOMETRY = re.compile(r"Robot(\d+)_Odometry\.dat")


@configuration
class RealConfig:
    """Logs, and how much of them."""

    data: Path | None = None
    """folder with carmen, plaza, mrclam6, ur10e and broad; fetched from where they were published if not given"""
    parts: Annotated[tuple[PartName, ...], TOGETHER] = get_args(PartName)
    """parts of the study"""
    windows: Count = 10
    """largest number of windows of each log of a building"""
    beams: Annotated[tuple[int, ...], Each(Interval(ge=1, le=180), allowed="1 to 180"), TOGETHER] = (1, 2, 4, 8)
    """numbers of beams or beacons to try; all beacons are tried too"""
    seconds: Positive = 60.0
    """length of a window [s]"""
    apart: Positive = 60.0
    """least time between a window and the scans of its map [s]"""
    arm: MechanismPlace = "menagerie:universal_robots_ur10e"
    """arm of the logs in ur10e, a name or an MJCF file"""


Computation = tuple[Callable[..., list[Row]], Any, Mapping[str, Any]]  # function, argument, arguments by name


@dataclass(frozen=True)
class LogPart:
    """Logs of one kind, and what is computed over them."""

    source: LogSource
    computations: Callable[[Sequence[str], RealConfig], Iterator[Computation]]
    rows: tuple[str, ...]  # values of the column ``part``


def _floors(files: Sequence[str], config: RealConfig) -> Iterator[Computation]:
    for window in _windows(files, config):  # all of a window after each other: its map is made once
        for beams in config.beams:
            yield window_rows, window, {"beams": beams}


def _windows(files: Sequence[str], config: RealConfig) -> list[FloorWindow]:
    return [
        window
        for file in files
        for place in PLACES
        for window in windows_of(file, place, config.windows, config.seconds, config.apart)
    ]


def _beacons(files: Sequence[str], config: RealConfig) -> Iterator[Computation]:
    for file in files:
        case = BeaconCase("beacons", (file,))
        yield from _among_beacons(case, config)
        yield unknown_rows, case, {}


def _unicycles(files: Sequence[str], config: RealConfig) -> Iterator[Computation]:
    robots = [int(found[1]) for found in map(_ODOMETRY.match, (Path(file).name for file in files)) if found]
    for robot in robots:
        yield from _among_beacons(BeaconCase("unicycles", tuple(files), robot), config)


def _among_beacons(case: BeaconCase, config: RealConfig) -> Iterator[Computation]:
    """All beacons with a start that is known and one that is not, and fewer of them."""
    most = len(case.drive().mission.beacons)
    yield beacon_rows, replace(case, knows_start=True), {}
    for count in (0, *(each for each in config.beams if each < most)):
        yield beacon_rows, replace(case, beacons=count), {}


def _arm(files: Sequence[str], config: RealConfig) -> Iterator[Computation]:
    """The arm is identified on the log without load, and filters are compared on the others."""
    tune = named(files, "unload")
    tests = tuple(file for file in files if file != tune)
    if tune is None or not tests:
        raise NotAtHandError(f"{len(files)} logs of {ARMS.folder}, none of them *unload*; it and another are needed")
    try:
        file_of(config.arm)
    except FieldError as fault:
        raise NotAtHandError(str(fault).partition("; allowed")[0]) from fault
    yield arm_rows, ArmComparison(tune, tests, config.arm), {}


def _attitude(files: Sequence[str], config: RealConfig) -> Iterator[Computation]:
    for file in files:
        yield attitude_rows, AttitudeLog(file), {}


PARTS: Mapping[PartName, LogPart] = {
    "floors": LogPart(FLOORS, _floors, ("floor", "room")),
    "beacons": LogPart(BEACONS, _beacons, ("beacons", PART)),
    "unicycles": LogPart(UNICYCLES, _unicycles, ("unicycles",)),
    "arm": LogPart(ARMS, _arm, ("arm",)),
    "attitude": LogPart(ATTITUDES, _attitude, ("attitude",)),
}


class Real:
    """Estimators on published logs: buildings, beacons, landmarks, an arm, an IMU."""

    Config = RealConfig
    quick = RealConfig(parts=("beacons",), windows=1, beams=(2,))
    title = "From a real log to an estimate"
    on_terrain = False

    @staticmethod
    def run(config: RealConfig, setup: Setup) -> StudyResult:
        """Run the study on the logs that are at hand."""
        wanted: dict[str, list[Computation]] = {}
        reasons: dict[str, str] = {}
        for name in config.parts:
            try:
                files = logs_of(PARTS[name].source, config.data)
                wanted[name] = list(PARTS[name].computations(files, config))
            except NotAtHandError as reason:
                reasons[name] = str(reason)
        jobs = Jobs()
        for part, computations in wanted.items():
            for function, argument, more in computations:
                jobs.add(part, function, [argument], **more)
        rows: list[Row] = [row for of_part in jobs.done(setup).values() for each in of_part for row in each]
        arguments = [argument for computations in wanted.values() for _, argument, _ in computations]
        rows += _peers(rows, [each for each in arguments if isinstance(each, BeaconCase)], setup)
        drawn = _drawn(rows, [each for each in arguments if isinstance(each, FloorWindow)], setup)
        return StudyResult(
            summary=_summary(reasons),
            rows=rows,
            tables=tables(rows),
            figure=figure(drawn, rows),
            caption=_caption(drawn),
            claims=[target.claim(rows, _reason(target.part, reasons)) for target in TARGETS],
        )


def _peers(rows: Sequence[Row], cases: Sequence[BeaconCase], setup: Setup) -> list[Row]:
    """Rows of GTSAM with all beacons, the ranges as recorded and over the scale that our filter found."""
    if not gtsam_peers.at_hand():
        return []
    jobs = Jobs()
    for case in cases:
        if case.knows_start:
            scales = {row["setting"] for row in chosen(rows, part=case.part, log=case.log, start="known")}
            for scale in (0.0, *sorted(each for each in scales if math.isfinite(each))):
                jobs.add(case.part, gtsam_peers.gtsam_rows, [case], scale=scale)
    return [row for of_part in jobs.done(setup).values() for each in of_part for row in each]


def _drawn(rows: Sequence[Row], windows: Sequence[FloorWindow], setup: Setup) -> DrawnWindow | None:
    """The window for the picture: of those on floors that the bank found, the one in which it took longest.

    Most beams come first, and then the first floor of which the target speaks.
    """
    found = [row for row in chosen(rows, part="floor", estimator=BANK, found=True) if math.isfinite(row["lock_s"])]
    if not found:
        return None
    best = max(found, key=lambda row: (row["beams"] == MANY, row["log"] == targets.FLOORS[0], row["lock_s"]))
    window = next(
        each for each in windows if (each.name, each.place, each.case) == (best["log"], "floor", best["case"])
    )
    drawn: DrawnWindow = setup.compute(drawn_window, [window], beams=best["beams"])[0]
    return drawn


def _reason(part: str, reasons: Mapping[str, str]) -> str:
    name = next(name for name, each in PARTS.items() if part in each.rows)
    return reasons.get(name, "not among the parts that were run, or no window of the logs can be measured")


def _summary(reasons: Mapping[str, str]) -> tuple[str, ...]:
    missing = (f"Not at hand: {'; '.join(f'{name}, {reason}' for name, reason in reasons.items())}.",)
    return (
        "Logs of others. On floors and in rooms test scans are at least 60 s from any scan of the map, and errors are "
        "against SLAM's poses, of which the map is made too: they are no independent truth. In a room the map is what "
        "scans near the path saw, so that the robot knows the room and not where in it. Those that find a pose have an "
        f"unknown start, the others begin within 0.3 m and 0.15 rad. Left out: {LEFT_OUT}.",
        "Among beacons and landmarks errors are against the published reference, and deviations were set by hand on "
        "these logs; GTSAM begins with the reference. Without a place of any beacon, path and places of every method "
        "are moved and turned together onto the reference, for readings do not tell where on the ground they are; "
        f"GTSAM begins with the places of our smoother, or with others {OFF:g} m off. Of the arm the reference is made "
        "of the readings of its own log, by polynomials that know the future. Attitudes are judged by cameras, while "
        "the device moves, as BROAD does.",
        "Sure and wrong: OK, and off by more than three declared deviations for over a second. Lock: from the start to "
        "the first estimate that is near and stays so.",
        *(missing if reasons else ()),
    )


def _caption(drawn: DrawnWindow | None) -> str:
    charts = (
        "Windows in which the pose is right in the end, by the number of beams; errors among beacons; of an arm; of "
        "attitudes. A kind of logs that was not measured has no chart."
    )
    if drawn is None:
        return charts
    return (
        f"{drawn.name}: a robot with {drawn.beams} beams (blue) of a laser that finds itself. Orange: the poses that "
        f"can be. Green: where it is by SLAM. Below: {charts[0].lower()}{charts[1:]}"
    )


def tables(rows: Sequence[Row]) -> list[Table]:
    """Tables of buildings, beacons and landmarks, unknown ones, the arm and attitudes, of those with rows."""
    buildings = [row for row in rows if row["part"] in PLACES]
    drives = [row for row in rows if row["part"] in ("beacons", "unicycles")]
    unplaced, arm = chosen(rows, part=PART), chosen(rows, part="arm")
    made = (
        Table("Buildings, medians over windows; shares are means", _BUILDINGS, _building_rows(buildings)),
        Table("Beacons and landmarks", _DRIVES, [_drive_cells(row) for row in drives]),
        Table(f"{PART.capitalize()}, path and places aligned", _PLACES, [_place_cells(row) for row in unplaced]),
        Table("Arm", _ARM, [_arm_cells(row) for row in arm]),
        Table("Attitude", _ATTITUDE, [_attitude_cells(row) for row in chosen(rows, part="attitude")]),
    )
    return [each for each in made if each.rows]


_BUILDINGS = (
    *("log", "place", "beams", "estimator", "right in the end", "error, RMS [m]", "NEES", "used [%]"),
    *("sure and wrong [%]", "lock [s]", "update [µs]"),
)
_DRIVES = (
    *("log", "beacons", "method", "start", "error while used, RMS [m]", "at all times [m]", "heading [°]", "NEES"),
    *("used [%]", "sure and wrong [%]", "lock [s]", "update [µs]"),
)
_PLACES = (
    *("log", "beacons", "method", "start", "error while used, RMS [m]", "places, RMS [m]", "largest [m]", "used [%]"),
    "update [µs]",
)
_ATTITUDE = (
    *("trial", "filter", "inclination, RMS [°]", "drift of the heading, RMS [°]", "total, RMS [°]", "NEES"),
    *("sure and wrong [%]", "update [µs]"),
)
_ARM = ("log", "filter", "parameter", "error, RMS [rad/s]", "NEES", "sure and wrong [%]", "update [µs]")


def _building_rows(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    groups: dict[tuple[str, str, int, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["log"], row["part"], row["beams"], row["estimator"]), []).append(row)
    return [
        (
            log, place, str(beams), name, f"{sum(row['found'] for row in own)} of {len(own)}",
            _number(_median(own, "position_rms_m")), _number(_median(own, "nees")), _percent(own, "usable_share"),
            _percent(own, "wrong_share"), _number(_median(own, "lock_s")), f"{_median(own, 'update_us'):.0f}",
        )
        for (log, place, beams, name), own in groups.items()
    ]  # fmt: skip


def _method(row: Row) -> str:
    return f"{row['estimator']}, {row['case']}" if isinstance(row["case"], str) else str(row["estimator"])


def _place_cells(row: Row) -> tuple[str, ...]:
    errors = (_number(row[name]) for name in ("position_rms_m", "beacons_rms_m", "beacons_max_m"))
    used, update = _percent([row], "usable_share"), _number(row["update_us"])
    return row["log"], str(row["beams"]), _method(row), row["start"], *errors, used, update


def _drive_cells(row: Row) -> tuple[str, ...]:
    return (
        row["log"], str(row["beams"]), _method(row), row["start"], _number(row["position_rms_m"]),
        _number(row["position_rms_all_m"]), _number(row["heading_rms_deg"]), _number(row["nees"]),
        _percent([row], "usable_share"), _percent([row], "wrong_share"), _number(row["lock_s"]),
        _number(row["update_us"]),
    )  # fmt: skip


def _arm_cells(row: Row) -> tuple[str, ...]:
    return (
        row["log"], row["estimator"], row["case"], f"{row['velocity_rms_rad_s']:.4f}", _number(row["nees"]),
        _percent([row], "wrong_share"), _number(row["update_us"]),
    )  # fmt: skip


def _attitude_cells(row: Row) -> tuple[str, ...]:
    degrees = (f"{row[name]:.2f}" for name in ("inclination_rms_deg", "heading_rms_deg", "total_rms_deg"))
    return (
        row["log"], row["estimator"], *degrees, _number(row["nees"]), _percent([row], "wrong_share"),
        _number(row["update_us"]),
    )  # fmt: skip


def _median(rows: Sequence[Row], column: str) -> float:
    values = np.array([row[column] for row in rows], dtype=float)
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else math.nan


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3g}"


def _percent(rows: Sequence[Row], column: str) -> str:
    mean = float(np.mean([row[column] for row in rows]))
    return "–" if math.isnan(mean) else f"{100.0 * mean:.2g}"
