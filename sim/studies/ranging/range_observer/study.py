"""The observer of Paper C in the simulations of C.5 (Figures C.3 to C.8), as printed and with what it lacks.

The observer as printed (C.5) beside the three feed-forwards that put it on Psi(x): in Z and in X, without noise and
with 5 % of it, from the thesis' own start, and the effect of gains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, get_args

import numpy as np

from mathnavi.estimators.ranging.observer import FeedForward
from mathnavi.models.angles import wrapped
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.studies.framework.jobs import Jobs
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.ranging.observability.maps import SENSORS, STANDARD
from mathnavi.sim.studies.ranging.range_observer.claims import (
    AS_PRINTED,
    OBSERVER,
    LockResults,
    claims,
    falls,
    largest,
    locked,
    median,
)
from mathnavi.sim.studies.ranging.range_observer.figure import ShownRuns, range_observer_figure
from mathnavi.sim.studies.ranging.range_observer.identities import Identities, identities
from mathnavi.sim.studies.ranging.range_observer.observer_run import RunErrors
from mathnavi.sim.studies.ranging.range_observer.runs import (
    DRIVES,
    MOTIONS,
    PRINTED_GAINS,
    SHOWN,
    START,
    DrawnRun,
    ObserverGains,
    ThesisRun,
    averaged,
    drawn_verdicts,
    shown_run,
    thesis_verdict,
)

SETS = ("2s", "2t", "3", "4")
PRINTED_START = np.array([23.0 * math.pi / 4.0, 242.0 * math.pi / 1101.0, math.pi / 2.0])  # z(0) of C.5
GAINS = (1.0, 10.0, 100.0, 1000.0)
FAST_SETS, FAST_GAINS, FAST_PERIOD, FAST_SECONDS = ("2s", "2t"), (1e3, 1e4, 1e5), 0.001, 6
NOISY_MOTIONS = (SHOWN, "up and down")
NOISY_GAINS = (*(ObserverGains(name, *PRINTED_GAINS) for name in get_args(FeedForward)), ObserverGains("s", 0.2, 0.2))
BOTH = (True, True)


@configuration
class RangeObserverStudyConfig:
    """Sample sizes: runs."""

    starts: Count = 15
    """first estimates that are drawn around the thesis' start"""
    drives: Count = 10
    """starts that are drawn over the field, for each set of sensors"""
    states: Count = 500
    """states at which the identities are checked, for each set of sensors"""
    seconds: Count = 20
    """duration of a run [s]"""


class RangeObserverStudy:
    """The active range observer: Figures C.3 to C.8, the observer as printed beside its feed-forwards."""

    Config = RangeObserverStudyConfig
    quick = RangeObserverStudyConfig(starts=2, drives=1, states=50)
    title = "The active range observer, as printed and with feed-forward (Figures C.3 to C.8)"
    on_terrain = False

    @staticmethod
    def run(config: RangeObserverStudyConfig, setup: Setup) -> StudyResult:
        done = _asked(config).done(setup)
        e = _evidence(done)
        drawn = ShownRuns(
            exact={name: done["shown", name][0] for name in get_args(FeedForward)},
            noisy={gains.feedforward: done["shown, noisy", gains.feedforward][0] for gains in (AS_PRINTED, OBSERVER)},
        )
        return StudyResult(
            summary=(
                f"The thesis does not say how the robot moved, so {len(MOTIONS)} inputs are tried, each from "
                f"{config.starts} first estimates that are off by up to 0.2 rad in each component of z, with the "
                "printed gains (5, 1), sensors at -90° and -45°, and 100 readings a second. Keeping lock: RMS error "
                "below 0.3 m and 0.2 rad over the last quarter of a run, modulo the half-turn that the ellipse has. "
                "With noise, range rates are those of 101 readings around an instant half a second ago.",
            ),
            rows=_rows(e),
            tables=(_thesis_table(e), _noise_table(e), _gains_table(e), _identities_table(e.identities)),
            figure=range_observer_figure(drawn, e),
            caption=f"(a) The components of z in a {SHOWN} from the thesis' start (as Figure C.3), one first estimate. "
            "(b) The same in X (C.5), (c) the errors in X and (d) in Z (C.6, C.4), of all feed-forwards. (e) What the "
            "observer descends on. (f) The phase portrait in Z and (g) the path in X with 5 % range noise (C.7, C.8), "
            "(h) the errors. (i) Shares of the first estimates from which lock is kept. (j) As printed, from starts "
            "that are drawn, started on the truth, by its gain; hollow: with 1000 readings a second.",
            claims=claims(e),
        )  # fmt: skip


# ---- what is asked for


def _asked(config: RangeObserverStudyConfig) -> Jobs:
    jobs, seconds = Jobs(), config.seconds
    for name in get_args(FeedForward):
        gains = ObserverGains(name, *PRINTED_GAINS)
        jobs.add(("shown", name), shown_run, [ThesisRun(SHOWN, gains, 0, seconds)])
        jobs.add(("true start", name), thesis_verdict, [ThesisRun(SHOWN, gains, 0, seconds, true_start=True)])
        for motion in MOTIONS:
            runs = [ThesisRun(motion, gains, seed, seconds) for seed in range(config.starts)]
            jobs.add(("thesis", motion, name), thesis_verdict, runs)
    for gains in (AS_PRINTED, OBSERVER):
        jobs.add(("shown, noisy", gains.feedforward), shown_run, [ThesisRun(SHOWN, gains, 0, seconds, BOTH)])
    for motion in NOISY_MOTIONS:
        for gains in NOISY_GAINS:
            runs = [ThesisRun(motion, gains, seed, seconds, BOTH) for seed in range(config.starts)]
            jobs.add(("noisy", motion, gains), thesis_verdict, runs)
    runs = [ThesisRun(SHOWN, OBSERVER, k, seconds, (k % 2 == 0, k % 2 == 1)) for k in range(config.starts)]
    jobs.add("averaged", averaged, runs)
    for sensors in SETS:
        jobs.add(("identities",), identities, [(sensors, 0, config.states)])
        for drive in DRIVES:
            wanted = [DrawnRun(sensors, drive, GAINS, seed, seconds) for seed in range(config.drives)]
            jobs.add(("drawn", sensors, drive), drawn_verdicts, wanted)
    for sensors in FAST_SETS:
        least = min(seconds, FAST_SECONDS)
        wanted = [DrawnRun(sensors, "standard", FAST_GAINS, k, least, FAST_PERIOD) for k in range(config.drives)]
        jobs.add(("fast", sensors), drawn_verdicts, wanted)
    return jobs


def _evidence(done: Mapping[Any, list[Any]]) -> LockResults:
    psi = np.append(STANDARD.ranges(START, np.radians(SENSORS["2t"]))[1], START[2])
    return LockResults(
        identities=[one for group in done["identities",] for one in group],
        start_error=wrapped(PRINTED_START - psi),
        thesis={key[1:]: group for key, group in done.items() if key[0] == "thesis"},
        noisy={key[1:]: group for key, group in done.items() if key[0] == "noisy"},
        true_start={key[1]: group[0] for key, group in done.items() if key[0] == "true start"},
        drawn={
            (*key[1:], k): [run[i] for run in group]
            for key, group in done.items()
            if key[0] == "drawn"
            for i, k in enumerate(GAINS)
        },
        fast={
            (key[1], k): [run[i] for run in group]
            for key, group in done.items()
            if key[0] == "fast"
            for i, k in enumerate(FAST_GAINS)
        },
        averaged=done["averaged"],
    )


# ---- rows and tables


def _rows(e: LockResults) -> list[dict[str, Any]]:
    """The CSV: a row for each run, and for each set of sensors what is left of the identities."""
    groups: list[tuple[dict[str, Any], Sequence[RunErrors]]] = [
        *(({"what": "thesis' start", "motion": m, **_gains(ObserverGains(f, *PRINTED_GAINS))}, errors)
          for (m, f), errors in e.thesis.items()),
        *(({"what": "thesis' start, 5 % noise", "motion": m, **_gains(g)}, errors)
          for (m, g), errors in e.noisy.items()),
        *(({"what": "from the truth", "motion": d, "sensors": s, **_gains(ObserverGains("none", k, k))}, errors)
          for (s, d, k), errors in e.drawn.items()),
        *(({"what": "from the truth, 1 kHz", "motion": "standard", "sensors": s,
            **_gains(ObserverGains("none", k, k))}, errors)
          for (s, k), errors in e.fast.items()),
    ]  # fmt: skip
    runs = [
        {"sensors": "2t", **run, "seed": seed, "position_rms_m": one.position, "heading_rms_rad": one.heading,
         "z_rms_rad": one.in_z, "keeps_lock": one.locked}
        for run, errors in groups for seed, one in enumerate(errors)
    ]  # fmt: skip
    left = [
        {
            "what": f"identities: {name}",
            "sensors": sensors,
            "largest": largest(_with_sensors(e.identities, sensors), name),
        }
        for sensors in SETS
        for name in ("Q", "s", "rho_dot", "manifold", "heun_s", "heun_rho_dot")
    ]
    return [*runs, *left]


def _gains(gains: ObserverGains) -> dict[str, Any]:
    return {"feedforward": gains.feedforward, "k_v": gains.k_v, "k_q": gains.k_q}


def _with_sensors(identities: Sequence[Identities], sensors: str) -> list[Identities]:
    return [one for one in identities if one.sensors == sensors]


def _thesis_table(e: LockResults) -> Table:
    names: tuple[FeedForward, ...] = get_args(FeedForward)
    columns = ("input", *(f"{'as printed' if name == 'none' else name}: keeps lock, RMS [m], [rad]" for name in names))
    rows = [
        (motion, *(_lock_cell(e.thesis[motion, name]) for name in names)) for motion in MOTIONS
    ]  # fmt: skip
    return Table("From the thesis' start, without noise, gains (5, 1)", columns, rows)


def _noise_table(e: LockResults) -> Table:
    columns = ("input", "feed-forward", "k_V, k_Q", "keeps lock, RMS [m], [rad]")
    rows = [
        (motion, "as printed" if gains.feedforward == "none" else gains.feedforward, f"{gains.k_v:g}, {gains.k_q:g}",
         _lock_cell(errors))
        for (motion, gains), errors in e.noisy.items()
    ]  # fmt: skip
    return Table("From the thesis' start, with 5 % range noise", columns, rows)


def _lock_cell(errors: Sequence[RunErrors]) -> str:
    return f"{locked(errors)} of {len(errors)}, {median(errors):.2g}, {median(errors, 'heading'):.2g}"


def _gains_table(e: LockResults) -> Table:
    columns = ("sensors", "figure of eight", *(f"k = {k:g}" for k in GAINS), "k = 1 over k = 10")
    ratios = falls(e)
    rows = [
        (sensors, drive, *(_lock_cell(e.drawn[sensors, drive, k]) for k in GAINS),
         f"{min(own):.1f} to {max(own):.1f} in {len(own)}" if (own := ratios[sensors, drive]) else "no lock kept")
        for sensors in SETS for drive in DRIVES
    ]  # fmt: skip
    return Table("As printed, from drawn starts, started on the truth: keeps lock, RMS [m], [rad]", columns, rows)


def _identities_table(identities: Sequence[Identities]) -> Table:
    columns = ("sensors", "states", "|Q| [m²/s]", "s [rad/s]", "rho_dot [rad/s]", "manifold, a period [rad]",
               "s, a period by Heun [rad]", "rho_dot, a period by Heun [rad]")  # fmt: skip
    names = ("Q", "s", "rho_dot", "manifold", "heun_s", "heun_rho_dot")
    rows = [
        (sensors, str(len(own)), *(f"{largest(own, name):.1e}" for name in names))
        for sensors in SETS
        if (own := _with_sensors(identities, sensors))
    ]
    return Table("On the truth: the largest of what should vanish", columns, rows)
