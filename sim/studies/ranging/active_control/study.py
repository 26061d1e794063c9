"""Active control: how much sooner a robot finds itself that drives where it learns most (Paper C, C.1, C.3 and C.6).

The input that is expected to leave the least covariance, against inputs that are fixed or drawn: with a turn rate of at
most .15 rad/s and with 1 rad/s. And a path that is kept once the robot knows where it is, or from the first estimate
on, on a slippery floor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.statistics import Band
from mathnavi.sim.records.store import Record
from mathnavi.sim.studies.framework.study import Setup, StudyResult, median
from mathnavi.sim.studies.ranging.active_control.claims import ActiveControlResults, claims
from mathnavi.sim.studies.ranging.active_control.figure import figure
from mathnavi.sim.studies.ranging.active_control.flights import (
    COMPARED,
    FAST,
    LIMIT,
    LIMITS,
    MODES,
    SLOW,
    TRACKS,
    LocalisationRun,
    tracking,
)
from mathnavi.sim.studies.ranging.active_control.input_search import InputSearch, soonest


@configuration
class ActiveControlConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 100
    """runs of each mode that the target compares"""
    others: Count = 40
    """runs of each other mode, and of each at the higher turn rate"""
    tracked: Count = 6
    """runs that keep a path, of each kind"""
    searched: Count = 100
    """starts from which every sequence of inputs is gone through, the pose being known"""
    depth: Annotated[int, Interval(ge=1, le=4)] = 3
    """inputs of such a sequence"""
    seconds: Count = 20
    """of a run; a run that is not within the limit for good by then counts as that long"""


class ActiveControl:
    """Active sensing: how much sooner a robot localises itself that chooses the most informative input (Paper C)."""

    Config = ActiveControlConfig
    quick = ActiveControlConfig(seeds=6, others=2, tracked=1, searched=10, depth=2)
    title = "Active control: inputs that teach a robot where it is"
    on_terrain = False

    @staticmethod
    def run(config: ActiveControlConfig, setup: Setup) -> StudyResult:
        flights = [
            LocalisationRun(mode, turn_rate, seed, config.seconds)
            for seed in range(config.seeds)
            for turn_rate, modes in ((SLOW, MODES), (FAST, COMPARED))
            for mode in modes
            if seed < config.others or (turn_rate == SLOW and mode in COMPARED)
        ]
        paths = [(kind, seed) for kind in TRACKS for seed in range(config.tracked)]
        trials = [flight.trial for flight in flights]
        records = setup.fly([*trials, *(tracking(kind, seed, float(config.seconds)) for kind, seed in paths)])
        flown: dict[tuple[str, float], list[Record]] = {}
        for flight, record in zip(flights, records, strict=False):
            flown.setdefault((flight.mode, flight.turn_rate), []).append(record)
        tracks: dict[str, list[Record]] = {}
        for (kind, _), record in zip(paths, records[len(flights) :], strict=True):
            tracks.setdefault(kind, []).append(record)
        searches = [
            InputSearch(seed, limit, float(config.seconds), config.depth)
            for limit in LIMITS
            for seed in range(config.searched)
        ]
        searched: dict[tuple[str, float], list[float]] = {}
        for search, times_s in zip(searches, setup.compute(soonest, searches), strict=True):
            for mode, time in times_s.items():
                searched.setdefault((mode, search.limit), []).append(time)
        evidence = _evidence(flown, tracks, searched, float(config.seconds))
        return StudyResult(
            summary=(
                f"Two sensors at ±60° in the standard ellipse, 5 % range noise, an EKF that is given the start to .3 m "
                f"and .3 rad. Time: the last instant with a position error above {LIMIT} m; a run that is not below it "
                f"for good after {config.seconds} s, or touches the wall, counts as {config.seconds} s. Medians, with "
                "95 % bootstrap bands. Start, what is known of the start, and noise are the same for every mode.",
            ),
            rows=list(chain(_rows(flown, config.seconds), _track_rows(tracks))),
            tables=(_mode_table(evidence), _search_table(evidence, config.depth), _track_table(tracks)),
            figure=figure(flown, evidence, tracks, float(config.seconds)),
            caption="(a) Position errors: medians, and between the quartiles. (b) When they are below "
            f"{LIMIT} m for good: medians with 95 % bands. (c) One run of each mode, from the same start, "
            "coloured by its error; the last two: a figure of eight on a slippery floor, kept from the first estimate "
            "on, and after active sensing (dashed: the path).",
            claims=claims(evidence),
        )


def times(records: Sequence[Record], seconds: float) -> Array:
    """(n,) [s] until the error is below the limit for good, censored."""
    found = [seconds if r.summary["touched_wall"] else min(seconds, r.summary["last_above_s"]) for r in records]
    return np.array(found)


def _evidence(
    flown: Mapping[tuple[str, float], Sequence[Record]],
    tracks: Mapping[str, Sequence[Record]],
    searched: Mapping[tuple[str, float], Sequence[float]],
    seconds: float,
) -> ActiveControlResults:
    samples = {key: times(records, seconds) for key, records in flown.items()}
    return ActiveControlResults(
        medians={key: median(sample) for key, sample in samples.items()},
        found={key: (int((sample < seconds).sum()), len(sample)) for key, sample in samples.items()},
        touched={key: sum(r.summary["touched_wall"] for r in records) for key, records in flown.items()},
        tracks={kind: [r.summary for r in records] for kind, records in tracks.items()},
        searched={key: median(np.array(sample)) for key, sample in searched.items()},
        seconds=seconds,
    )


def _rows(flown: Mapping[tuple[str, float], Sequence[Record]], seconds: float) -> list[dict[str, object]]:
    return [
        {
            "mode": mode,
            "turn_rate_max_rad_s": turn_rate,
            "seed": record.seed,
            "time_s": float(time),
            "touched_wall": record.summary["touched_wall"],
            "error_at_end_m": record.summary["errors_m"][-1],
            "path_length_m": record.summary["path_length_m"],
        }
        for (mode, turn_rate), records in flown.items()
        for record, time in zip(records, times(records, seconds), strict=True)
    ]


_TRACKED = ("tracking_from_s", "joins", "off_path_rms_m", "slip_m", "touched_wall", "position_rms_m")


def _track_rows(tracks: Mapping[str, Sequence[Record]]) -> list[dict[str, object]]:
    return [
        {"mode": kind, "seed": record.seed, **{name: record.summary[name] for name in _TRACKED}}
        for kind, records in tracks.items()
        for record in records
    ]


def _mode_table(evidence: ActiveControlResults) -> Table:
    rows: list[tuple[object, ...]] = []
    for (mode, turn_rate), band in evidence.medians.items():
        found, n = evidence.found[mode, turn_rate]
        factor = band.median / _least(evidence.medians["active", turn_rate])
        rows.append(
            (mode, turn_rate, band.text(), f"{factor:.2f}", f"{found} of {n}", evidence.touched[mode, turn_rate])
        )
    columns = ("mode", "turn rate ≤ [rad/s]", "time [s]", "times that of active", "found", "touched the wall")
    return Table("How soon the robot knows where it is", columns, rows)


def _search_table(evidence: ActiveControlResults, depth: int) -> Table:
    rows = [
        (mode, limit, band.text(), f"{evidence.sooner(mode, limit):.2f}")
        for (mode, limit), band in evidence.searched.items()
    ]
    columns = ("inputs", "limit [m]", "time [s]", "times sooner than random")
    title = f"With the pose known: the Cramér-Rao bound, best of every sequence of {depth} inputs"
    return Table(title, columns, rows)


def _least(band: Band) -> float:
    """Its median, which is nought only where every run begins within the limit."""
    return max(band.median, 1e-9)


def _track_table(tracks: Mapping[str, Sequence[Record]]) -> Table:
    rows = [
        (kind, r.seed, *(_cell(r.summary[name]) for name in _TRACKED)) for kind, group in tracks.items() for r in group
    ]
    return Table("A figure of eight on a slippery floor", ("loop", "seed", *_TRACKED), rows)


def _cell(value: object) -> object:
    return "never" if value is None else value
