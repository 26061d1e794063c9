"""Integrity: how long is an estimator sure of a wrong pose, or of a wrong flight, while its sensors fail?

A robot drives between places that are drawn within a wall through five corners, with three rays and odometry, 50
readings a second. From ``ONSET`` to ``END`` a sensor is at fault. Every estimator runs over the same readings with its
monitor of integrity (``mathnavi.estimators.integrity``), and without it to compare. Another robot drives among beacons
(``beacon_integrity``), a point mass flies by fixes and among beacons (``flight_integrity``), and a quadrotor by an IMU
and fixes (``inertial_integrity``).

**Sure and wrong** is defined in ``mathnavi.sim.metrics.sure_and_wrong``, of position and heading apart. Before a fault
can be found (``integrity_detection``) no test can show it. Until then an estimate is judged by its protection level
instead, ``extra["protection"]``.
"""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from mathnavi.estimators.integrity.guard import alone
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.plugin.registry import load
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult
from mathnavi.studies.ranging import beacon_integrity, flight_integrity, inertial_integrity
from mathnavi.studies.ranging.integrity_detection import findable
from mathnavi.studies.ranging.integrity_judging import Outcome, Timing, Watched, judged

FIRST_SEED = 5000  # no threshold of the monitor was chosen on these
WALL = Curve(
    (
        (2.206, 0.0, 1.301, 0.0),
        (-1.931, 1.153, -0.913, -1.451),
        (-0.028, -0.028, -0.053, 0.104),
        (-0.039, 0.003, -0.149, 0.064),
        (0.004, -0.047, -0.081, -0.049),
        (-0.081, 0.018, 0.01, 0.042),
        (-0.028, -0.029, 0.005, -0.005),
        (-0.007, 0.032, -0.037, -0.012),
        (-0.011, -0.001, -0.007, -0.008),
    )
)
"""through (0, 0), (4, -0.2), (4.6, 2), (2.4, 3.2) and (0.2, 2.4) [m], but for its harmonics beyond the eighth"""
_CENTRE, (_A, *_OTHERS), *_REST = WALL.coefficients
WIDER = Curve((_CENTRE, (_A - 0.1, *_OTHERS), *_REST))
GREATEST = 8.0  # [m] a reading without an echo
ANGLES = np.array([0.0, 0.5 * math.pi, -1.75])  # [rad] of the rays
PERIOD, FINE = 0.02, 0.01  # [s] of the readings and of the truth
DURATION, ONSET, END = 30.0, 8.0, 18.0  # [s] of a run, and of its fault
SETTLED = 3.0  # [s] until which a filter may be wrong by the start that it was told
NOISE, ODOMETRY, UNSURE = 0.02, (0.02, 0.02), 0.05  # [m], [m/s, rad/s]; [m, rad] deviation of a start that is known
SPEED, TURN, MARGIN = 0.25, 1.0, 0.5  # [m/s], [rad/s] at most; [m] between the places to drive to and the wall
CARRIED = 2.0  # [m]
FINDING = ("feasible_set_bank", "range_certified")  # estimators that are not told the start
ESTIMATORS = (
    "range_ekf", "feasible_set_bank", "range_ukf", "range_iekf", "range_certified", "moving_horizon", "range_particle",
)  # fmt: skip
ALL = (*ESTIMATORS, beacon_integrity.ESTIMATOR, *flight_integrity.ESTIMATORS, inertial_integrity.ESTIMATOR)
MOST_WRONG, MOST_FALSE, LEAST_RECOVERED = 0.005, 0.01, 0.9
COLOURS = {True: "#0d5fa8", False: "#c2183b"}


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive that its sensors read without a fault: n updates, of l rays."""

    truth: Array  # (n, 3) [m, m, rad] at the updates
    fine: Array  # (m, 3) every ``FINE`` seconds from 0 s on
    ranges: Array  # (n, l) [m]
    noise: Array  # (n, l) [m] in them
    odometry: Array  # (n, 2) [m/s, rad/s]
    commands: Array  # (n, 2)


Fault = Callable[[Drive, slice, np.random.Generator], None]
"""change of the readings of a drive, in place, in the updates of a slice"""


def _ray(rng: np.random.Generator) -> int:
    return int(rng.integers(len(ANGLES)))


def _none(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    pass


def _blocked(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    ray = _ray(rng)
    drive.ranges[during, ray] = 0.3 + drive.noise[during, ray]


def _stuck(drive: Drive, during: slice, rng: np.random.Generator, count: int = 1) -> None:
    for ray in rng.permutation(len(ANGLES))[:count]:
        drive.ranges[during, ray] = drive.ranges[during.start, ray]


def _two_stuck(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    _stuck(drive, during, rng, 2)


def _scaled(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during, _ray(rng)] *= 1.1


def _slightly_scaled(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during, _ray(rng)] *= 1.02


def _offset(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during, _ray(rng)] += 0.1


def _no_odometry(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.odometry[during.start : during.start + round(3.0 / PERIOD)] = np.nan


def _fast_odometry(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.odometry[during] *= 1.1


def _noisy(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    drive.ranges[during] += 2.0 * drive.noise[during]


def _drift(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    speed = rng.choice((-1.0, 1.0)) * rng.uniform(0.01, 0.05)  # [m/s]
    drive.ranges[during, _ray(rng)] += speed * PERIOD * np.arange(during.stop - during.start)


def _doubled(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    """Every second reading is the one before, with a new time stamp."""
    drive.ranges[during.start + 1 : during.stop : 2] = drive.ranges[during.start : during.stop - 1 : 2]


def _late(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    """Ranges of 50 ms ago with the stamp of now."""
    for k in range(during.start, during.stop):
        ago = drive.fine[round((PERIOD * (k + 1) - 0.05) / FINE)]
        drive.ranges[k] = WALL.ranges(ago, ANGLES)[0] + drive.noise[k]


def _wider(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    """The wall is 0.1 m farther out on either side than on the map."""
    for k in range(during.start, during.stop):
        drive.ranges[k] = WIDER.ranges(drive.truth[k], ANGLES)[0] + drive.noise[k]


def _without_echo(drive: Drive, during: slice, rng: np.random.Generator) -> None:
    """Three readings in ten are the greatest that the sensor has."""
    lost = rng.random(drive.ranges[during].shape) < 0.3
    drive.ranges[during][lost] = GREATEST


FAULTS: dict[str, Fault] = {
    "none": _none,
    "a ray reads 0.3 m": _blocked,
    "a ray stuck": _stuck,
    "two rays stuck": _two_stuck,
    "a ray times 1.1": _scaled,
    "a ray times 1.02": _slightly_scaled,
    "a ray 0.1 m too long": _offset,
    "no odometry for 3 s": _no_odometry,
    "odometry times 1.1": _fast_odometry,
    "carried away 2 m": _none,  # the robot itself, not its readings
    "noise times 3": _noisy,
    "a ray drifts": _drift,
    "every reading twice": _doubled,
    "ranges 50 ms late": _late,
    "wall 0.1 m wider": _wider,
    "readings of 8 m": _without_echo,
}
AWAY = "carried away 2 m"


@configuration
class IntegrityConfig:
    """Sample sizes."""

    seeds: Count = 20
    """number of drives of each estimator under each fault"""
    alone: Count = 5
    """number of those that are also run without the monitor"""
    faults: Count = len(FAULTS)
    """number of faults, none among them"""
    estimators: Count = len(ALL)
    """number of estimators"""


def _part(estimator: str) -> tuple[str, Iterable[str], Callable[[Watched], Outcome]]:
    """Words for where an estimator is tried, its faults, and the job of a run."""
    if estimator == beacon_integrity.ESTIMATOR:
        return ", a robot among beacons", beacon_integrity.FAULTS, beacon_integrity.watched
    if estimator in flight_integrity.ESTIMATORS:
        where = f", a flight by {estimator.split(', ')[1]}"
        return where, flight_integrity.faults_of(estimator), flight_integrity.watched
    if estimator == inertial_integrity.ESTIMATOR:
        return ", a quadrotor by an IMU and fixes", inertial_integrity.FAULTS, inertial_integrity.watched
    return "", FAULTS, watched


class Integrity:
    """Estimators of poses and flights while their sensors fail (Papers A and C)."""

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
            for fault in [*_part(estimator)[1]][: config.faults]
        ]
        for estimator, fault in asked:
            job = _part(estimator)[2]
            for seed in range(FIRST_SEED, FIRST_SEED + config.seeds):
                for monitored in (True, False)[: 1 + (seed < FIRST_SEED + config.alone)]:
                    run = Watched(estimator, fault, seed, monitored)
                    jobs.add(run, job, [run])
        rows = [
            {"estimator": run.estimator, "fault": run.fault, "seed": run.seed, "monitored": run.monitored, **vars(done)}
            for run, (done,) in jobs.done(setup).items()
        ]
        cells = [Cell(estimator, fault, rows) for estimator, fault in asked]
        places = dict.fromkeys(_part(cell.estimator)[0] for cell in cells)
        return StudyResult(
            summary=(
                f"{config.seeds} drives of {DURATION:g} s each, the fault from {ONSET:g} to {END:g} s (the robot is "
                f"carried away at {ONSET:g} s for good); three rays, deviations {NOISE:g} m of a range and "
                f"{ODOMETRY[0]:g} of the odometry, {1.0 / PERIOD:g} readings a second. {' and '.join(FINDING)} are not "
                f"told the start. Ray and drift are drawn. "
                f"{beacon_integrity.ESTIMATOR} drives for {beacon_integrity.DURATION:g} s among "
                f"{len(beacon_integrity.PLACES)} beacons, one of which is read every "
                f"{beacon_integrity.EVERY * beacon_integrity.PERIOD:g} s with a deviation of "
                f"{beacon_integrity.NOISE:g} m, the fault from {beacon_integrity.ONSET:g} to "
                f"{beacon_integrity.END:g} s. Flights of {flight_integrity.DURATION:g} s under gusts of "
                f"{flight_integrity.GUSTS.rms:g} m/s^2 read fixes of {flight_integrity.FIX_NOISE:g} m, or ranges of "
                f"{flight_integrity.RANGE_NOISE:g} m to {len(flight_integrity.PLACES)} beacons, ten times a second, "
                f"the fault from {flight_integrity.ONSET:g} to {flight_integrity.END:g} s; by fixes alone there is no "
                f"protection level, nor is there one by an IMU and fixes: a quadrotor that swings and turns for "
                f"{inertial_integrity.DURATION:g} s reads its IMU {1.0 / inertial_integrity.PERIOD:g} times a second, "
                f"with deviations of {inertial_integrity.IMU.gyro:g} rad/s and "
                f"{inertial_integrity.IMU.accelerometer:g} m/s^2, and fixes of {inertial_integrity.FIX_NOISE:g} m "
                f"every {inertial_integrity.EVERY * inertial_integrity.PERIOD:g} s, the fault from "
                f"{inertial_integrity.ONSET:g} to {inertial_integrity.END:g} s. The first "
                f"{min(config.alone, config.seeds)} runs of each are also made without the monitor.",
            ),
            rows=rows,
            tables=[
                each
                for where in places
                for each in tables([cell for cell in cells if _part(cell.estimator)[0] == where], where)
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
    lost = [e for e in cells if e.recovered < LEAST_RECOVERED]
    false = {
        name: float(np.mean([e.false for e in cells if e.estimator == name]))
        for name in dict.fromkeys(e.estimator for e in cells)
    }
    before = [e.wrong(False) for e in cells if e.fault != "none"]
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
            f"not OK before the fault, from {SETTLED:g} s on: <= {MOST_FALSE:.0%} of the time of each estimator",
            ", ".join(f"{name} {share:.2%}" for name, share in false.items()), max(false.values()) <= MOST_FALSE,
        ),
        Claim(
            "integrity.recovers", "target", "An estimator is right again once its sensors are.", "C.4",
            f"OK and right for good within {DURATION - END:g} s, among beacons "
            f"{beacon_integrity.DURATION - beacon_integrity.END:g} s, in flight "
            f"{flight_integrity.DURATION - flight_integrity.END:g} s, by an IMU "
            f"{inertial_integrity.DURATION - inertial_integrity.END:g} s: "
            f">= {LEAST_RECOVERED:.0%} of the runs of each estimator and fault",
            f"{len(cells) - len(lost)} of {len(cells)}"
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
        wrong.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, fontsize=8)
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


def watched(run: Watched) -> Outcome:
    """A job: what becomes of an estimator under a fault; the seed determines drive and fault."""
    rng = np.random.default_rng(run.seed)
    drive = driven(rng, carried=run.fault == AWAY)
    first = drive.fine[0] + UNSURE * rng.standard_normal(3)
    during, noise = slice(round(ONSET / PERIOD), round(END / PERIOD)), drive.noise
    quiet = dataclasses.replace(
        drive, ranges=drive.ranges - noise, noise=np.zeros_like(noise), odometry=drive.commands.copy()
    )
    FAULTS[run.fault](quiet, during, copy.deepcopy(rng))
    FAULTS[run.fault](drive, during, rng)
    start = None if run.estimator in FINDING else KnownStart((first[0], first[1], first[2]), (UNSURE, UNSURE, UNSURE))
    plugin = load("estimators", run.estimator)
    estimator = plugin.build(plugin.Config(), _mission(start))
    estimator = estimator if run.monitored else alone(estimator)
    estimates = [estimator.update(*update) for update in _updates(drive)]
    spread = np.var((drive.ranges - quiet.ranges)[during], axis=0) / np.var(noise[during], axis=0)
    begins = KnownStart((drive.fine[0][0], drive.fine[0][1], drive.fine[0][2]), (UNSURE, UNSURE, UNSURE))
    found = findable(_mission(begins), list(_updates(quiet)), during, spread)
    return judged(estimates, drive.truth, found, Timing(PERIOD, ONSET, END, SETTLED), persists=run.fault == AWAY)


def _mission(start: KnownStart | None) -> RangingMission:
    quality, odometry = RangeQuality(absolute=NOISE), OdometryQuality(noise=ODOMETRY)
    return RangingMission(WALL, tuple(ANGLES.tolist()), quality, odometry, start=start, period=PERIOD)


def _updates(drive: Drive) -> Iterator[tuple[float, tuple[Measurement, ...], Array]]:
    for k, (rho, u, command) in enumerate(zip(drive.ranges, drive.odometry, drive.commands, strict=True)):
        t = PERIOD * (k + 1)
        yield t, (Measurement("ranges", t, rho), Measurement("odometry", t, u)), command


def driven(rng: np.random.Generator, *, carried: bool = False) -> Drive:
    """Drive from place to place within the wall, without a fault but for a robot that is ``carried`` away at ONSET."""
    mission, x = _mission(None), np.array([*_place(rng), rng.uniform(-math.pi, math.pi)])
    place, fine, commands = _place(rng), [x], []
    ratio, u = round(PERIOD / FINE), np.zeros(2)
    for k in range(round(DURATION / FINE)):
        if carried and k == round(ONSET / FINE):
            x = _carried(x, rng)
        if k % ratio == 0:
            while math.dist(place, x[:2]) < 0.3:
                place = _place(rng)
            turn = math.remainder(math.atan2(place[1] - x[1], place[0] - x[0]) - x[2], 2.0 * math.pi)
            u = np.array([SPEED * max(0.2, math.cos(turn)), min(max(2.0 * turn, -TURN), TURN)])
            commands.append(u)
        x = mission.flow(x, u, FINE)
        fine.append(x)
    truth = np.array(fine)[ratio::ratio]
    noise = NOISE * rng.standard_normal((len(truth), len(ANGLES)))
    ranges = np.array([WALL.ranges(pose, ANGLES)[0] for pose in truth]) + noise
    odometry = np.array(commands) + ODOMETRY * rng.standard_normal((len(truth), 2))
    return Drive(truth, np.array(fine), ranges, noise, odometry, np.array(commands))


def _place(rng: np.random.Generator) -> tuple[float, float]:
    """Draw a point [m] that is well within the wall."""
    low, high = WALL.polyline.min(axis=0), WALL.polyline.max(axis=0)
    while not WALL.contains(point := rng.uniform(low, high), MARGIN):
        pass
    return float(point[0]), float(point[1])


def _carried(x: Array, rng: np.random.Generator) -> Array:
    """Draw the pose (3,) of a robot that is carried 2 m away, or as far as the wall lets it."""
    for distance in np.arange(CARRIED, 0.0, -0.1):
        for angle in rng.uniform(-math.pi, math.pi, 100):
            to = x[:2] + distance * np.array([math.cos(angle), math.sin(angle)])
            if WALL.contains(to, MARGIN):
                return np.array([*to, x[2]])
    raise AssertionError("no place within the wall")
