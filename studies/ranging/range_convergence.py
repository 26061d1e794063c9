"""Range estimators from an unknown start: convergence, accuracy, consistency and cost.

The observer (C.5) without noise, the feasible-set bank and filterpy's filters with the standard noise (5 % of the
range; odometry 0.05 per reading and a bias of 2 %), the bank within a non-convex wall and on two driven wheels in
MuJoCo, and the cost of an update.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FixedLocator, NullFormatter, StrMethodFormatter

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN
from mathnavi.renders.figures import INK
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.consistency import Consistency, RootMeanSquare, consistency, root_mean_square
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.statistics import Proportion, rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult
from mathnavi.studies.ranging.estimator_runs import (
    ALL_ALIVE,
    BANK,
    BANK_LOOP,
    EKF,
    EKF_LOOP,
    FLOOR,
    INSTANTS,
    PARTICLE_LOOP,
    PARTICLES,
    PLUGINS,
    UKF,
    EstimatorResult,
    ExactAttempt,
    RangeRun,
    costs,
    estimator_results,
    observer_converges,
    read,
)
from mathnavi.studies.ranging.observability_measures import SENSORS, STANDARD

FRICTIONS = (0.15, 0.4, 1.0)
ELLIPSE, BEAN_WALL = "ellipse", "bean"
WALLS = {ELLIPSE: STANDARD, BEAN_WALL: BEAN}
TIMED = 10  # [s] of readings that updates are timed over
OBSERVED: Mapping[str, float] = {"2s": 0.95, "3": 0.95, "4": 0.95, "2t": 0.85}
"""required shares of starts from which the observer finds the state, by sensors"""
BEYOND_EKF: Mapping[str, float] = {"2s": 1.25, "2t": 1.25, "4": 1.15}
"""required ratios of the bank's share of converged runs to the EKF's, by sensors"""
FOUND, IN_BEAN = 0.98, 0.95  # shares of starts from which the bank is to find the pose
OVER_FLOOR, OVER_PARTICLES, CHEAPER = 1.4, 1.0, 20.0
DRIVEN: Mapping[str, float] = {"2s": 0.03, "4": 0.02}
"""largest allowed RMS position errors on wheels [m], by sensors"""
REAL_TIME = 10.0

GREY = hexadecimal(COLOURS[SceneElement.IMAGE])
COLOUR: Mapping[str, str] = {
    BANK: hexadecimal(COLOURS[SceneElement.ESTIMATE]),
    EKF: hexadecimal(COLOURS[SceneElement.DRIVEN]),
    UKF: hexadecimal(COLOURS[SceneElement.RAY]),
    PARTICLES: hexadecimal(COLOURS[SceneElement.HYPOTHESIS]),
    FLOOR: GREY,
}
OBSERVER = "#101824"
MARKERS: Mapping[str, str] = {"2s": "o", "2t": "s", "3": "^", "4": "D"}
SHOWN = "2t"  # whose errors are drawn against time
LIKENED = (BANK, EKF, UKF, PARTICLES)
TIMES: Mapping[str, tuple[str, str]] = {  # name, colour of what is timed
    EKF_LOOP: ("one EKF of the bank", COLOUR[BANK]),
    BANK_LOOP: ("bank, as flown", COLOUR[BANK]),
    ALL_ALIVE: ("bank, all 16 alive", COLOUR[BANK]),
    PARTICLE_LOOP: ("1000 particles", COLOUR[PARTICLES]),
    PLUGINS[BANK]: ("bank, called", COLOUR[BANK]),
    PLUGINS[EKF]: ("filterpy EKF, called", COLOUR[EKF]),
    PLUGINS[UKF]: ("filterpy UKF, called", COLOUR[UKF]),
    PLUGINS[PARTICLES]: ("AMCL, called", COLOUR[PARTICLES]),
}

FoundKey = tuple[str, str, str]
"""(wall, sensors, estimator)"""
Costs = Mapping[str, Mapping[str, Array]]
"""CPU times (R,) [us] of an update, by sensors and name"""


@configuration
class RangeConvergenceConfig:
    """Sample sizes: cases that are measured."""

    seeds: Count = 200
    """number of runs of the observer, the bank and the EKF with each set of sensors"""
    peers: Count = 60
    """number of runs with the UKF and the particle filter too"""
    drives: Count = 10
    """number of runs on wheels with each set of sensors and friction"""
    repetitions: Count = 7
    """number of measurements of each time"""
    seconds: Count = 20
    """duration of a run [s]"""


class RangeConvergence:
    """Convergence, accuracy, consistency and cost of the range estimators (Paper C)."""

    Config = RangeConvergenceConfig
    quick = RangeConvergenceConfig(seeds=10, peers=3, drives=1, repetitions=1)
    title = "Finding the pose from an unknown start: the bank of feasible poses beside other filters"
    on_terrain = False

    @staticmethod
    def run(config: RangeConvergenceConfig, setup: Setup) -> StudyResult:
        seconds, seeds = config.seconds, range(config.seeds)
        jobs = Jobs()
        for name in OBSERVED:
            attempts = [ExactAttempt(STANDARD, name, seed, seconds) for seed in seeds]
            jobs.add(("observer", name), observer_converges, attempts)
        for name in BEYOND_EKF:
            for wall, curve in WALLS.items():
                runs = [RangeRun(curve, name, seed, seconds, _estimators(wall, seed, config.peers)) for seed in seeds]
                jobs.add((wall, name), estimator_results, runs)
        driven = setup.fly_groups({
            (name, friction): [_on_wheels(name, friction, seed, seconds) for seed in range(config.drives)]
            for name in DRIVEN for friction in FRICTIONS
        })  # fmt: skip
        done = jobs.done(setup)
        repetitions = config.repetitions
        timed = setup.compute(timed_updates, BEYOND_EKF, seconds=min(TIMED, seconds), repetitions=repetitions)
        (run_times,) = setup.compute(timed_runs, [seconds], repetitions=repetitions)
        observed = {name: rate(sum(done["observer", name]), config.seeds) for name in OBSERVED}
        found = {
            (wall, name, estimator): Found([run[estimator] for run in done[wall, name] if estimator in run])
            for wall in WALLS for name in BEYOND_EKF for estimator in _estimators(wall, 0, 1)
        }  # fmt: skip
        update: Costs = {
            name: {what: np.array(taken) for what, taken in times.items()}
            for name, times in zip(BEYOND_EKF, timed, strict=True)
        }
        drives = {key: Drives(records) for key, records in driven.items()}
        run_cpu = float(np.median(run_times))
        return StudyResult(
            summary=(
                f"{config.seeds} runs of {seconds} s with each set of sensors, a figure of eight of 1.5 m by "
                f"0.55 m, from a start that is drawn and not known; {min(config.peers, config.seeds)} of them with the "
                "UKF and adaptive Monte Carlo localisation (AMCL), all on the same readings. Converged: RMS error "
                "below 0.3 m and 0.2 rad over the last quarter, modulo the symmetry of the wall. RMSE: of the runs "
                "that converged. 2s are sensors at ±60°, 2t at -90° and -45°, 3 and 4 evenly spaced. "
                "The EKF from nearby is given its start to 0.1 m and 0.1 rad.",
            ),
            rows=_rows(observed, found, update, drives, run_cpu),
            tables=_tables(found, update, drives),
            figure=figure(observed, found, update, drives, seconds),
            caption="(a) Shares of runs that converged, with 95 % limits of Clopper and Pearson. (b) Position error "
            "with sensors at -90° and -45°: the median of all runs, and where the middle half of the bank's lies. "
            "(c) RMSE of the runs that converged, with 95 % bootstrap bands. (d) CPU time of an update: loops of "
            "compiled kernels, and plug-ins called from Python. (e) Average NEES of the bank over the runs that "
            "converged, and where that of a consistent filter lies 95 % of the time. (f) RMS position error of the "
            "bank on two driven wheels; a dot for each run, a line through the RMS of all.",
            claims=claims(observed, found, update, drives, run_cpu),
        )


class Found:
    """Runs of an estimator with a set of sensors in a wall: share, accuracy and consistency of the converged ones."""

    def __init__(self, runs: Sequence[EstimatorResult]) -> None:
        self.runs = runs
        self.converged = [run for run in runs if run.converged]
        self.share = rate(len(self.converged), len(runs))
        positions = [run.position for run in self.converged]  # [m] RMS over the last quarter of each
        self.rms = root_mean_square(positions, np.random.default_rng(0)) if positions else None

    @property
    def nees(self) -> Consistency | None:
        """Average NEES at the end of the converged runs; None without any."""
        squares = [run.nees[-1] for run in self.converged]
        return consistency(squares, 3) if squares else None  # degrees of freedom of a pose

    @property
    def nis(self) -> float:
        """Average NIS per ray of the converged runs, 1 for a consistent filter; NaN without any."""
        ratios = [run.nis / run.rays for run in self.converged]
        return float(np.mean(ratios)) if ratios else math.nan


class Drives:
    """Runs of the bank on wheels with a set of sensors and a friction."""

    def __init__(self, records: Sequence[Record]) -> None:
        self.runs = len(records)
        self.errors = figures(records, "position_rms_m")  # (n,) [m]
        self.rms = float(np.sqrt(np.mean(np.square(self.errors))))
        self.converged, self.touched = (
            sum(bool(record.summary[name]) for record in records) for name in ("converged", "touched_wall")
        )


def _rows(
    observed: Mapping[str, Proportion],
    found: Mapping[FoundKey, Found],
    update: Costs,
    drives: Mapping[tuple[str, float], Drives],
    run_cpu: float,
) -> list[dict[str, Any]]:
    """Return the rows of the CSV, whose kind is ``what``."""
    return [
        *(
            {"what": "observer", "wall": ELLIPSE, "sensors": name, "estimator": "observer", **_share(share)}
            for name, share in observed.items()
        ),
        *(_found_row(*key, e) for key, e in found.items()),
        *(
            {"what": "update", "sensors": name, "estimator": what, "update_wall_s": 1e-6 * float(np.median(taken))}
            for name, cost in update.items() for what, taken in cost.items()
        ),
        *(
            {"what": "on wheels", "wall": ELLIPSE, "sensors": name, "estimator": BANK, "friction": friction,
             "runs": e.runs, "converged": e.converged, "position_rms_m": e.rms}
            for (name, friction), e in drives.items()
        ),
        {"what": "on wheels, a second", "run_wall_s": run_cpu},
    ]  # fmt: skip


def _found_row(wall: str, sensors: str, estimator: str, e: Found) -> dict[str, Any]:
    row: dict[str, Any] = {"what": "found", "wall": wall, "sensors": sensors, "estimator": estimator, **_share(e.share)}
    if e.rms is not None:
        row |= {"position_rms_m": e.rms.value, "rms_low_m": e.rms.low, "rms_high_m": e.rms.high}
    if (wall, estimator) == (ELLIPSE, BANK) and (nees := e.nees) is not None:
        row |= {"nees": nees.average, "nees_low": nees.low, "nees_high": nees.high, "nis_ray": e.nis}
    return row


def _share(share: Proportion) -> dict[str, Any]:
    return {"runs": share.trials, "converged": share.events, "share": share.value, "share_low": share.low,
            "share_high": share.high}  # fmt: skip


def _tables(
    found: Mapping[FoundKey, Found], update: Costs, drives: Mapping[tuple[str, float], Drives]
) -> tuple[Table, ...]:
    return (
        Table(
            "Runs that converged, and how exact their last quarter is",
            ("wall", "sensors", "estimator", "converged", "RMSE [m]", "NIS a ray"),
            [(*key, e.share.text(), "–" if e.rms is None else e.rms.text(),
              "–" if key[0] != ELLIPSE or np.isnan(e.nis) else f"{e.nis:.3f}") for key, e in found.items()],
        ),
        Table(
            "CPU time of an update [µs], medians; the first four are loops of compiled kernels, the others are called "
            "from Python",
            ("estimator", *update),
            [(name, *(f"{np.median(cost[name]):.2f}" for cost in update.values())) for name in update["4"]],
        ),
        Table(
            "The bank on two driven wheels in MuJoCo",
            ("sensors", "friction", "converged", "RMS position error [m]", "largest of a run [m]", "touched the wall"),
            [(name, f"{friction:g}", rate(e.converged, e.runs).text(), f"{e.rms:.4f}", f"{e.errors.max():.4f}",
              f"{e.touched} of {e.runs}") for (name, friction), e in drives.items()],
        ),
    )  # fmt: skip


def claims(
    observed: Mapping[str, Proportion],
    found: Mapping[FoundKey, Found],
    update: Costs,
    drives: Mapping[tuple[str, float], Drives],
    run_cpu: float,
) -> list[Claim]:
    """Evaluate every claim of the study; ``run_cpu`` is the CPU time of a run on wheels over its duration."""
    bank, bean = ({name: found[wall, name, BANK] for name in BEYOND_EKF} for wall in WALLS)
    worst = {name: max(drives[name, friction].rms for friction in FRICTIONS) for name in DRIVEN}
    factor = 1.0 / run_cpu
    nees = {name: e.nees for name, e in bank.items()}
    return [
        Claim(
            "range.global", "target", "Without noise and turning, the observer finds the pose from anywhere.",
            "C.3, C.4",
            "manifold feed-forward, figure of eight: " + _each({name: f">= {x:g}" for name, x in OBSERVED.items()}),
            _each({name: share.text() for name, share in observed.items()}),
            all(observed[name].value >= least for name, least in OBSERVED.items()),
        ),
        _bank(found, update),
        Claim(
            "range.nonconvex", "target", "The bank finds the pose within a wall that is not convex.", "2.2, C.4",
            f"a bean: converged >= {IN_BEAN:g}", _each({name: e.share.text() for name, e in bean.items()}),
            all(e.share.value >= IN_BEAN for e in bean.values()),
        ),
        Claim(
            "range.diffdrive", "target", "On two driven wheels in MuJoCo the robot knows its pose too.", "C.4",
            f"friction >= {FRICTIONS[0]:g}: RMS <= {DRIVEN['2s']:g} m (2s) and {DRIVEN['4']:g} m (4); "
            f">= {REAL_TIME:g} times real time",
            f"friction {', '.join(f'{friction:g}' for friction in FRICTIONS)}: at most "
            f"{_each({name: f'{value:.4f} m' for name, value in worst.items()})}; {factor:.1f} times real time (CPU); "
            f"{sum(e.touched for e in drives.values())} of {sum(e.runs for e in drives.values())} runs touched the "
            "wall",
            all(worst[name] <= most for name, most in DRIVEN.items()) and factor >= REAL_TIME,
        ),
        Claim(
            "range.consistency", "target", "The bank knows how good its estimate is.", "C.4",
            "locked, at the end of the runs: average NEES within its 95 % chi-square bounds",
            _each({name: "none locked" if one is None else one.text() for name, one in nees.items()})
            + f"; NIS a ray {_each({name: f'{e.nis:.3f}' for name, e in bank.items()})}",
            all(one is not None and one.holds for one in nees.values()),
        ),
    ]  # fmt: skip


def _bank(found: Mapping[FoundKey, Found], update: Costs) -> Claim:
    shares, holds = {}, []
    ratios: dict[str, list[float]] = {FLOOR: [], PARTICLES: []}
    whole, flown = ({name: _cheaper(cost, loop) for name, cost in update.items()} for loop in (ALL_ALIVE, BANK_LOOP))
    for name, least in BEYOND_EKF.items():
        bank, ekf = found[ELLIPSE, name, BANK], found[ELLIPSE, name, EKF].share
        beyond = bank.share.value / ekf.value if ekf.events else math.inf
        shares[name] = f"{bank.share.text()}, {beyond:.2f} times the EKF's"
        holds += [bank.share.value >= FOUND, beyond >= least, whole[name] >= CHEAPER]
        for other, most in ((FLOOR, OVER_FLOOR), (PARTICLES, OVER_PARTICLES)):
            ratios[other].append(_ratio(bank.rms, found[ELLIPSE, name, other].rms))
            holds.append(ratios[other][-1] <= most)
    floor, particles = (" / ".join(f"{ratio:.2f}" for ratio in group) for group in ratios.values())
    each_whole, each_flown = (_each({name: f"1/{x:.0f}" for name, x in times.items()}) for times in (whole, flown))
    cost = update["4"]  # the most sensors that were timed
    called = {
        PLUGINS[name].removeprefix("range_"): f"{np.median(cost[PLUGINS[name]] / cost[PLUGINS[BANK]]):.1f}"
        for name in (EKF, UKF, PARTICLES)
    }
    return Claim(
        "range.bank", "target", "The feasible-set bank finds the pose from anywhere, as exactly as can be.",
        "C.4, Definition C.9",
        f"converged >= {FOUND:g} and " + _each({name: f">= {least:g}" for name, least in BEYOND_EKF.items()})
        + f" times the EKF; RMSE <= {OVER_FLOOR:g} of an EKF from nearby and <= {OVER_PARTICLES:g} of adaptive Monte "
        f"Carlo localisation; an update <= 1/{CHEAPER:g} of 1000 particles', both compiled",
        f"{_each(shares)}; RMSE {floor} of the floor, {particles} of adaptive Monte Carlo localisation's; an update "
        f"with no hypothesis dropped {each_whole}, as flown {each_flown}; called from Python, others' over the bank's: "
        f"{_each(called)}",
        all(holds),
    )  # fmt: skip


def _ratio(one: RootMeanSquare | None, other: RootMeanSquare | None) -> float:
    return math.nan if one is None or other is None else one.value / other.value


def _cheaper(cost: Mapping[str, Array], name: str) -> float:
    """Return the cost of an update of the particle filter over that of a loop of the bank's kernels."""
    return float(np.median(cost[PARTICLE_LOOP] / cost[name]))


def _each(texts: Mapping[str, str]) -> str:
    return ", ".join(f"{name}: {text}" for name, text in texts.items())


def figure(
    observed: Mapping[str, Proportion],
    found: Mapping[FoundKey, Found],
    update: Costs,
    drives: Mapping[tuple[str, float], Drives],
    seconds: float,
) -> Figure:
    """Draw six panels: shares, errors over time, accuracy, cost, consistency, and runs on wheels."""
    with styled_figure((12.4, 9.4), ConstrainedLayoutEngine(h_pad=0.1, w_pad=0.08)) as drawn:
        parts = drawn.subplot_mosaic([["share", "error", "rms"], ["cost", "nees", "wheels"]])
        _shares(parts["share"], observed, found)
        _errors(parts["error"], found, seconds)
        _rms(parts["rms"], found)
        _costs(parts["cost"], update["4"])
        _nees(parts["nees"], found, seconds)
        _wheels(parts["wheels"], drives)
    return drawn


def _shares(axes: Axes, observed: Mapping[str, Proportion], found: Mapping[FoundKey, Found]) -> None:
    lines: list[tuple[str, str, Mapping[str, Proportion]]] = [("observer,\nno noise", OBSERVER, observed)]
    lines += [(_short(name), COLOUR[name], _sets(found, ELLIPSE, name)) for name in LIKENED]
    lines.insert(2, ("bank,\nin a bean", COLOUR[BANK], _sets(found, BEAN_WALL, BANK)))
    for k, (_, colour, rates) in enumerate(lines):
        for sensors, share in rates.items():
            y = k + 0.19 * (list(MARKERS).index(sensors) - 1.5)
            axes.plot([share.low, share.high], [y, y], color=colour, lw=1.6, alpha=0.45, solid_capstyle="round")
            axes.plot(share.value, y, MARKERS[sensors], color=colour, ms=5.0, mec="white", mew=0.7)
    for sensors, marker in MARKERS.items():
        axes.plot([], [], marker, color=GREY, ms=5.0, label=sensors)
    axes.legend(loc="lower center", fontsize=8, title="sensors", title_fontsize=8, handletextpad=0.1, ncols=4)
    axes.set_yticks(range(len(lines)), [name for name, _, _ in lines])
    axes.set(xlim=(0.0, 1.03), ylim=(len(lines) + 0.35, -0.55), xlabel="share of the runs")
    axes.set_title("(a) who finds the pose from anywhere")
    axes.grid(visible=False, axis="y")


def _sets(found: Mapping[FoundKey, Found], wall: str, estimator: str) -> dict[str, Proportion]:
    return {sensors: found[wall, sensors, estimator].share for sensors in BEYOND_EKF}


def _short(name: str) -> str:
    return name.replace("particle filter", "AMCL").replace("EKF from nearby", "EKF from\nnearby")


def _errors(axes: Axes, found: Mapping[FoundKey, Found], seconds: float) -> None:
    t = np.linspace(0.0, seconds, INSTANTS)
    ends = []
    for name in (*LIKENED, FLOOR):
        errors = np.array([run.error for run in found[ELLIPSE, SHOWN, name].runs])
        middle: Array = np.median(errors, axis=0)
        axes.plot(t, middle, color=COLOUR[name], lw=2.0 if name == BANK else 1.4, ls="--" if name == FLOOR else "-")
        ends.append((name, float(np.exp(np.log(middle[-8:]).mean()))))
        if name == BANK:
            low, high = np.quantile(errors, (0.25, 0.75), axis=0)
            axes.fill_between(t, low, high, color=COLOUR[name], alpha=0.16, lw=0)
    _logarithmic(axes, (0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0))
    axes.set(xlim=(0.0, seconds), xlabel="t [s]", ylabel="position error [m]")
    for (name, _), y in zip(sorted(ends, key=lambda end: end[1]), _apart(sorted(y for _, y in ends)), strict=True):
        annotate(axes, _short(name), (seconds, y), (4, 0), va="center", fontsize=8, color=COLOUR[name],
                 annotation_clip=False, linespacing=0.9)  # fmt: skip
    axes.set_title(f"(b) median error, sensors {SHOWN}")


def _apart(values: list[float]) -> list[float]:
    """Return heights on a logarithmic scale, each far enough above the one before to be legible."""
    placed: list[float] = []
    for value in values:
        placed.append(value if not placed else max(value, 1.6 * placed[-1]))
    return placed


def _rms(axes: Axes, found: Mapping[FoundKey, Found]) -> None:
    names = (FLOOR, *LIKENED)
    for k, name in enumerate(names):
        for j, sensors in enumerate(BEYOND_EKF):
            rms = found[ELLIPSE, sensors, name].rms
            if rms is None:
                continue
            x = k + 0.22 * (j - 1)
            axes.plot([x, x], [rms.low, rms.high], color=COLOUR[name], lw=1.6, alpha=0.45)
            axes.plot(x, rms.value, MARKERS[sensors], color=COLOUR[name], ms=5.5, mec="white", mew=0.7)
    _logarithmic(axes, (0.003, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2))
    axes.set_xticks(range(len(names)), [_short(name) for name in names], fontsize=8.5)
    axes.set(xlim=(-0.5, len(names) - 0.5), ylabel="RMSE of the runs that converged [m]")
    axes.set_title("(c) how exactly, once found")
    axes.grid(visible=False, axis="x")


def _costs(axes: Axes, cost: Mapping[str, Array]) -> None:
    for k, (key, (_, colour)) in enumerate(TIMES.items()):
        taken = float(np.median(cost[key]))
        axes.barh(k, taken, color=colour, alpha=0.85 if k < 4 else 0.5, height=0.66)
        annotate(axes, f"{taken:.0f}" if taken >= 10.0 else f"{taken:.1f}", (taken, k), (4, 0), va="center", fontsize=8)
    axes.axhline(3.5, color=INK, lw=0.8, ls=":")
    axes.set(xscale="log", xlim=(0.5, 5.0 * float(max(np.median(taken) for taken in cost.values()))))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_yticks(range(len(TIMES)), [name for name, _ in TIMES.values()])
    axes.invert_yaxis()
    for y, words in ((-0.35, "compiled loops"), (3.65, "plug-ins")):
        axes.text(0.98, y, words, transform=axes.get_yaxis_transform(), ha="right", va="top", fontsize=8, color=GREY)
    axes.set(xlabel="CPU time of an update [µs]", title="(d) what an update costs, 4 sensors")
    axes.grid(visible=False, axis="y")


def _nees(axes: Axes, found: Mapping[FoundKey, Found], seconds: float) -> None:
    t = np.linspace(0.0, seconds, INSTANTS)[1:]
    limits: Consistency | None = None
    for sensors, style in zip(BEYOND_EKF, ("-", "--", ":"), strict=True):
        bank = found[ELLIPSE, sensors, BANK]
        if bank.nees is None:
            continue
        limits = bank.nees
        means = np.array([run.nees for run in bank.converged]).mean(axis=0)
        axes.plot(t, means[1:], color=COLOUR[BANK], ls=style, lw=1.5, label=sensors)
    if limits is not None:
        axes.axhspan(limits.low, limits.high, color=COLOURS[SceneElement.RAY], alpha=0.18, lw=0)
        annotate(axes, "95 % of consistent filters", (0.98, limits.low), (0, -3), xycoords=("axes fraction", "data"),
                 ha="right", va="top", fontsize=8, color=COLOUR[UKF])  # fmt: skip
        axes.legend(loc="upper right", fontsize=8, title="sensors", title_fontsize=8, ncols=3)
    axes.set(xlim=(0.0, seconds), ylim=(0.0, 6.5), xlabel="t [s]", ylabel="average NEES, 3 degrees of freedom")
    axes.set_title("(e) does the bank know how good it is?")


def _wheels(axes: Axes, drives: Mapping[tuple[str, float], Drives]) -> None:
    rng = np.random.default_rng(0)
    highest = max(1e3 * drives[sensors, FRICTIONS[-1]].rms for sensors in DRIVEN)
    for sensors, colour in zip(DRIVEN, (COLOUR[BANK], OBSERVER), strict=True):
        means = [1e3 * drives[sensors, friction].rms for friction in FRICTIONS]
        for k, friction in enumerate(FRICTIONS):
            own = 1e3 * drives[sensors, friction].errors
            x = k + rng.uniform(-0.08, 0.08, len(own))
            axes.plot(x, own, MARKERS[sensors], color=colour, ms=3.5, alpha=0.4, mew=0)
        axes.plot(range(len(FRICTIONS)), means, color=colour, marker=MARKERS[sensors], mec="white", ms=6.0)
        annotate(axes, f"sensors {sensors}", (len(FRICTIONS) - 1, means[-1]), (9, 6 if means[-1] == highest else -6),
                 va="center", color=colour, fontsize=8.5, annotation_clip=False)  # fmt: skip
        axes.axhline(1e3 * DRIVEN[sensors], color=colour, ls=":", lw=1.2)
        annotate(axes, f"asked of {sensors}: {1e3 * DRIVEN[sensors]:g} mm",
                 (len(FRICTIONS) - 0.32, 1e3 * DRIVEN[sensors]), (0, 3), ha="right", fontsize=8,
                 color=colour)  # fmt: skip
    axes.set_xticks(range(len(FRICTIONS)), [f"{friction:g}" for friction in FRICTIONS])
    axes.set(xlim=(-0.35, len(FRICTIONS) - 0.3), xlabel="friction of the wheels", ylabel="RMS position error [mm]",
             ylim=(0.0, 1.15e3 * max(DRIVEN.values())), title="(f) on two driven wheels, in MuJoCo")  # fmt: skip
    axes.grid(visible=False, axis="x")


def _logarithmic(axes: Axes, ticks: Sequence[float]) -> None:
    """Set a logarithmic scale of metres."""
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(FixedLocator(list(ticks)))
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _estimators(wall: str, seed: int, peers: int) -> tuple[str, ...]:
    if wall != ELLIPSE:
        return (BANK,)
    return (BANK, EKF, FLOOR, UKF, PARTICLES) if seed < peers else (BANK, EKF, FLOOR)


def _on_wheels(sensors: str, friction: float, seed: int, seconds: int) -> Trial:
    fields = {"sensors": SENSORS[sensors], "friction": friction, "planner.mode": "figure-eight"}
    return trial("range-localisation", seed, fields=fields, drive="differential", duration=float(seconds))


def timed_updates(sensors: str, seconds: float, repetitions: int) -> dict[str, list[MeasuredTime]]:
    """A job: CPU times (R,) [us] of an update by estimator, over readings of a set of sensors."""
    found = costs(read(sensors, seconds, np.random.default_rng(0)), repetitions)
    return {name: [MeasuredTime(one) for one in taken] for name, taken in found.items()}


def timed_runs(seconds: int, repetitions: int) -> list[MeasuredTime]:
    """A job: CPU times (R,) of a run on wheels over its duration, physics and bank, after compilation."""
    taken = []
    for _ in range(repetitions + 1):
        closed_loop = _on_wheels("4", FRICTIONS[-1], 0, seconds).build()
        began = time.thread_time()
        run = closed_loop.run()
        taken.append(MeasuredTime((time.thread_time() - began) / float(run.recording.t[-1])))
    return taken[1:]
