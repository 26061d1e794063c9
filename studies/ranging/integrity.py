"""Integrity: how long is an estimator sure of a wrong pose, flight or swing of an arm, while its sensors fail?

A robot drives between places that are drawn within a wall through five corners, with three rays and odometry, 50
readings a second. From ``ONSET`` to ``END`` a sensor is at fault. Every estimator runs over the same readings with its
monitor of integrity (``mathnavi.estimators.integrity``), and without it to compare. Another robot drives among beacons
(``beacon_integrity``), a point mass flies by fixes and among beacons (``flight_integrity``), a quadrotor by an IMU and
fixes (``inertial_integrity``), a missile by readings of its whole state (``missile_integrity``), a device turns with a
gyro and an accelerometer (``attitude_integrity``) and a body whose attitude is read (``body_integrity``), an arm swings
whose encoders are read (``encoder_integrity``), a quadruped moves its legs (``legged_integrity``), and textbook systems
have outputs (``textbook_integrity``). ``full_state`` and ``quadrotor_state`` pass on what is declared to be the state;
there is nothing that they could compare it with.

**Sure and wrong** is defined in ``mathnavi.sim.metrics.sure_and_wrong``, of position and heading apart. Before a fault
can be found (``integrity_detection``) no test can show it. Until then an estimate is judged by its protection level
instead, ``extra["protection"]``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult
from mathnavi.studies.ranging import (
    attitude_integrity,
    beacon_integrity,
    body_integrity,
    encoder_integrity,
    flight_integrity,
    inertial_integrity,
    legged_integrity,
    missile_integrity,
    pose_integrity,
    textbook_integrity,
)
from mathnavi.studies.ranging.integrity_judging import Outcome, Watched

FIRST_SEED = 5000  # no threshold of the monitor was chosen on these


class Part(NamedTuple):
    """Estimators that are tried in the same way."""

    where: str  # end of a title
    module: Any  # has SETTING, DURATION and END [s]
    estimators: Sequence[str]
    faults: Mapping[str, object]  # by name
    watched: Callable[[Watched], Outcome]  # job of a run


PARTS = (
    Part("", pose_integrity, pose_integrity.ESTIMATORS, pose_integrity.FAULTS, pose_integrity.watched),
    Part(
        ", a robot among beacons", beacon_integrity, beacon_integrity.ESTIMATORS, beacon_integrity.FAULTS,
        beacon_integrity.watched,
    ),
    *(
        Part(f", a flight by {by}", flight_integrity, names, flight_integrity.FAULTS[by], flight_integrity.watched)
        for by, names in (("fixes", flight_integrity.ESTIMATORS[:2]), ("beacons", flight_integrity.ESTIMATORS[2:]))
    ),
    Part(
        ", a quadrotor by an IMU and fixes", inertial_integrity, (inertial_integrity.ESTIMATOR,),
        inertial_integrity.FAULTS, inertial_integrity.watched,
    ),
    Part(
        ", a missile by its whole state", missile_integrity, (missile_integrity.ESTIMATOR,), missile_integrity.FAULTS,
        missile_integrity.watched,
    ),
    Part(
        ", a device by a gyro and an accelerometer", attitude_integrity, (attitude_integrity.ESTIMATOR,),
        attitude_integrity.FAULTS, attitude_integrity.watched,
    ),
    Part(
        ", an arm by its encoders", encoder_integrity, encoder_integrity.ESTIMATORS, encoder_integrity.FAULTS,
        encoder_integrity.watched,
    ),
    Part(
        ", a quadruped by an IMU and its feet", legged_integrity, (legged_integrity.ESTIMATOR,),
        legged_integrity.FAULTS, legged_integrity.watched,
    ),
    Part(
        ", a body by its attitude", body_integrity, body_integrity.ESTIMATORS, body_integrity.FAULTS,
        body_integrity.watched,
    ),
    Part(
        ", a textbook system by its output", textbook_integrity, textbook_integrity.ESTIMATORS,
        textbook_integrity.FAULTS, textbook_integrity.watched,
    ),
)  # fmt: skip
ALL = tuple(estimator for part in PARTS for estimator in part.estimators)
INSEPARABLE = (
    *pose_integrity.OF_ITS_OWN, beacon_integrity.ESTIMATORS[1], *flight_integrity.INSEPARABLE,
    *encoder_integrity.ESTIMATORS, *body_integrity.ESTIMATORS, *textbook_integrity.ESTIMATORS,
)  # fmt: skip
"""estimators whose monitor is a part of them"""
UNOBSERVABLE = {(legged_integrity.ESTIMATOR, fault) for fault in legged_integrity.OF_ITS_IMU}
"""estimators and faults after which a part of the state is never known again"""
MOST_WRONG, MOST_FALSE, LEAST_RECOVERED = 0.005, 0.01, 0.9
COLOURS = {True: "#0d5fa8", False: "#c2183b"}


@configuration
class IntegrityConfig:
    """Sample sizes."""

    seeds: Count = 20
    """number of drives of each estimator under each fault"""
    alone: Count = 5
    """number of those that are also run without the monitor"""
    faults: Count = max(len(part.faults) for part in PARTS)
    """number of faults, none among them"""
    estimators: Count = len(ALL)
    """number of estimators"""


def _part(estimator: str) -> Part:
    """Part of the study in which an estimator is tried."""
    return next(part for part in PARTS if estimator in part.estimators)


class Integrity:
    """Estimators of poses, flights and joints while their sensors fail (Papers A, C and D)."""

    Config = IntegrityConfig
    quick = IntegrityConfig(seeds=1, alone=1, faults=3, estimators=2)
    title = "Sensors that fail: no estimator is sure and wrong"
    on_terrain = False

    @staticmethod
    def run(config: IntegrityConfig, setup: Setup) -> StudyResult:
        jobs = Jobs()
        asked = [
            (estimator, fault)
            for estimator in ALL[: config.estimators]
            for fault in [*_part(estimator).faults][: config.faults]
        ]
        for estimator, fault in asked:
            job = _part(estimator).watched
            for seed in range(FIRST_SEED, FIRST_SEED + config.seeds):
                bare = seed < FIRST_SEED + config.alone and estimator not in INSEPARABLE
                for monitored in (True, False)[: 1 + bare]:
                    run = Watched(estimator, fault, seed, monitored)
                    jobs.add(run, job, [run])
        rows = [
            {"estimator": run.estimator, "fault": run.fault, "seed": run.seed, "monitored": run.monitored, **vars(done)}
            for run, (done,) in jobs.done(setup).items()
        ]
        cells = [Cell(estimator, fault, rows) for estimator, fault in asked]
        places = dict.fromkeys(_part(cell.estimator).where for cell in cells)
        return StudyResult(
            summary=(
                f"{config.seeds} drives {' '.join(dict.fromkeys(part.module.SETTING for part in PARTS))} The first "
                f"{min(config.alone, config.seeds)} runs of each are also made without the monitor, but for filters of "
                "which it is a part.",
            ),
            rows=rows,
            tables=[
                each
                for where in places
                for each in tables([cell for cell in cells if _part(cell.estimator).where == where], where)
            ],
            figure=figure(cells),
            caption="Each dot is an estimator under a fault: (a) share of the time from the fault on in which it is "
            "sure and wrong, or beyond its protection level before the fault can be found, with its monitor (blue), "
            "and in which it is sure and wrong without (red), dotted the most that is allowed; (b) median time until "
            "it is not OK; (c) median time from the end of the fault until it is OK and right for good.",
            claims=claims(cells),
        )  # fmt: skip


class Cell:
    """Runs of an estimator under a fault, with and without its monitor."""

    def __init__(self, estimator: str, fault: str, rows: Sequence[dict[str, Any]]) -> None:
        self.estimator, self.fault = estimator, fault
        chosen = [row for row in rows if row["estimator"] == estimator and row["fault"] == fault]
        self.with_, self.without = ([row for row in chosen if row["monitored"] is each] for each in (True, False))

    def wrong(self, monitored: bool = True) -> float:
        """The larger share, of position and of heading, velocity or attitude, that is sure and wrong."""
        rows = self.with_ if monitored else self.without
        return max(float(np.mean([row[name] for row in rows])) for name in ("position", "rest"))

    @property
    def judged(self) -> float:
        """Share that is sure and wrong, or beyond the protection level where the fault cannot be found yet."""
        return float(np.mean([row["judged"] for row in self.with_]))

    def mean(self, name: str) -> float:
        """Mean over the runs that have one; NaN if none has."""
        values = [row[name] for row in self.with_ if not math.isnan(row[name])]
        return float(np.mean(values)) if values else math.nan

    def median(self, name: str) -> float:
        """Median [s] over the runs that have one; NaN if most have none."""
        values = np.array([row[name] for row in self.with_])
        return float(np.median(np.where(np.isnan(values), np.inf, values)))

    @property
    def recovered(self) -> float:
        return float(np.mean([not math.isnan(row["recovered"]) for row in self.with_]))

    @property
    def false(self) -> float:
        return float(np.mean([row["false"] for row in self.with_]))

    @property
    def name(self) -> str:
        return f"{self.estimator}, {self.fault}"


def tables(cells: Sequence[Cell], where: str = "") -> tuple[Table, ...]:
    """One table for each figure, the faults by the estimators; ``where`` ends their titles."""
    estimators, faults = (
        [*dict.fromkeys(names)] for names in zip(*((e.estimator, e.fault) for e in cells), strict=True)
    )
    by_name = {(e.estimator, e.fault): e for e in cells}

    def table(title: str, text: Callable[[Cell], str]) -> Table:
        rows = [(fault, *(text(by_name[estimator, fault]) for estimator in estimators)) for fault in faults]
        return Table(title + where, ("fault", *estimators), rows)

    return (
        table(
            "Sure and wrong, or beyond the protection level before the fault can be found [%]",
            lambda e: f"{100.0 * e.judged:.2f}",
        ),
        table(
            "Above three deviations for more than a second, all the time, with the monitor (without) [%]",
            lambda e: (
                f"{100.0 * e.wrong():.2f} ({100.0 * e.wrong(False):.0f})" if e.without else f"{100.0 * e.wrong():.2f}"
            ),
        ),
        table(
            "Protection kept while it is OK [%], and the median level [m]",
            lambda e: f"{100.0 * e.mean('kept'):.2f}, {e.mean('level'):.3f}",
        ),
        table(
            "Median time until it is not OK, and until the fault can be found [s]",
            lambda e: f"{_seconds(e.median('detected'))}, {_seconds(e.median('findable'))}",
        ),
        table(
            "Recovered, and the median time after the fault [s]",
            lambda e: f"{100.0 * e.recovered:.0f} %, {_seconds(e.median('recovered'))}",
        ),
        table("Not OK before the fault [%]", lambda e: f"{100.0 * e.false:.2f}"),
    )


def _seconds(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "–"


def claims(cells: Sequence[Cell]) -> list[Claim]:
    """Evaluate every claim of the study."""
    wrong = [e for e in cells if e.judged > MOST_WRONG]
    observable = [e for e in cells if (e.estimator, e.fault) not in UNOBSERVABLE]
    lost = [e for e in observable if e.recovered < LEAST_RECOVERED]
    times = dict.fromkeys(f"{part.module.DURATION - part.module.END:g} s{part.where}" for part in PARTS)
    false = {
        name: float(np.mean([e.false for e in cells if e.estimator == name]))
        for name in dict.fromkeys(e.estimator for e in cells)
    }
    before = [e.wrong(False) for e in cells if e.fault != "none" and e.without]
    worst, often = max(cells, key=lambda e: e.judged), sum(e.wrong() <= MOST_WRONG for e in cells)
    named = "; ".join(f"{e.name}: {e.judged:.1%}" for e in wrong)
    return [
        Claim(
            "integrity.sure-and-wrong", "target", "An estimator whose sensors fail is not sure and wrong.",
            "C.4", "OK with an error above three deviations for more than a second once the fault can be found, beyond "
            f"the protection level before: <= {MOST_WRONG:.1%} of the time from the fault on, for each estimator and "
            "fault",
            f"{len(cells) - len(wrong)} of {len(cells)}; largest {worst.judged:.1%}, {worst.name}; by three deviations "
            f"all the time {often}; without the monitor {np.mean(before) if before else 0.0:.0%} on average"
            + f". Beyond: {named}" * bool(wrong),
            not wrong,
        ),
        Claim(
            "integrity.false-alarm", "target", "The monitor is silent while no sensor fails.", "C.4",
            f"not OK before the fault, from {pose_integrity.SETTLED:g} s on: <= {MOST_FALSE:.0%} of the time of each "
            "estimator",
            ", ".join(f"{name} {share:.2%}" for name, share in false.items()), max(false.values()) <= MOST_FALSE,
        ),
        Claim(
            "integrity.recovers", "target", "An estimator is right again once its sensors are.", "C.4",
            f"OK and right for good within {'; '.join(times)}: "
            f">= {LEAST_RECOVERED:.0%} of the runs of each estimator and fault that leaves the state "
            "observable",
            f"{len(observable) - len(lost)} of {len(observable)}"
            + f"; not {', '.join(f'{e.name} ({e.recovered:.0%})' for e in lost)}" * bool(lost), not lost,
        ),
    ]  # fmt: skip


def figure(cells: Sequence[Cell]) -> Figure:
    """Draw three panels over the faults: sure and wrong, detection, recovery."""
    faults = [*dict.fromkeys(e.fault for e in cells)]
    with styled_figure((12.0, max(4.8, 2.0 + 0.2 * len(faults))), ConstrainedLayoutEngine(w_pad=0.08)) as drawn:
        wrong, detected, recovered = drawn.subplots(1, 3, sharey=True)
        for monitored, shift in ((False, 0.15), (True, -0.15)):
            bare = [100.0 * e.wrong(False) if e.without else math.nan for e in cells]
            shares = [100.0 * e.judged for e in cells] if monitored else bare
            label = "with its monitor" if monitored else "without"
            _dots(wrong, [faults.index(e.fault) + shift for e in cells], shares, COLOURS[monitored], label)
        wrong.axvline(100.0 * MOST_WRONG, color=INK, lw=1.0, ls=":")
        wrong.set_xscale("symlog", linthresh=1.0)
        wrong.set(xlim=(-0.1, 110.0), xlabel="sure and wrong [% of the time]", title="(a) sure and wrong")
        wrong.set_yticks(range(len(faults)), faults)
        wrong.invert_yaxis()
        wrong.legend(loc="upper center", bbox_to_anchor=(0.5, -0.8 / (1.0 + 0.2 * len(faults))), ncols=2, fontsize=8)
        rows = [faults.index(e.fault) for e in cells]
        _dots(detected, rows, [e.median("detected") for e in cells], COLOURS[True])
        detected.set_xscale("symlog", linthresh=0.1)
        detected.set(xlabel="time until it is not OK [s]", title="(b) detection")
        _dots(recovered, rows, [e.median("recovered") for e in cells], COLOURS[True])
        recovered.set(xlabel="time after the fault until it is right [s]", title="(c) recovery")
    return drawn


def _dots(axes: Axes, y: Sequence[float], x: Sequence[float], colour: str, label: str = "") -> None:
    finite = np.where(np.isfinite(x), x, np.nan)
    axes.plot(finite, y, "o", ms=5.0, color=colour, alpha=0.6, mew=0, label=label or None)
