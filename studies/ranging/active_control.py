"""Active control: localisation with the most informative inputs, compared with others (Paper C, C.1, C.3 and C.6).

The input with the least expected covariance is compared with fixed and with random inputs, at a turn rate of at most
0.15 rad/s and of 1 rad/s. In addition a robot on a slippery floor keeps a path, from when it is localised or from the
first estimate on.

Every mode of active sensing drives the same robot from the same starts: two sensors at ±60°, 5 % range noise, and an
EKF that knows the start with standard deviations of 0.3 m and 0.3 rad. Starts are drawn uniformly among the poses from
which every fixed pattern keeps the margin during the run; the start, its known part and the noise depend on the seed
only.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, LogNorm
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from mathnavi.controllers.active_sensing.plugin import PATTERNS, ActiveSensing
from mathnavi.controllers.active_sensing.policies import path
from mathnavi.controllers.active_sensing.then_track import ReferencePath
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.ranging import RangingErrors, rms
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import Band
from mathnavi.sim.records.store import Record
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.range_localisation import VEHICLE
from mathnavi.sim.scenarios.ranging_fields import RangeLocalisationConfig
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import HALO, annotate, styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult, median
from mathnavi.studies.ranging.input_search import SEARCHED, SLOW, START_ERROR, WALL, InputSearch, soonest

LIMIT = 0.15  # [m] of the position error
LIMITS = (LIMIT, 0.1)  # [m] of the root mean square position error, with the pose known
FAST = 1.0  # [rad/s] the other bound of the turn rate, beside SLOW
OFTEN = 0.2  # [s] between what is kept of a run
MODES = ("active", "singular-value", "circle", "figure-eight", "straight", "random", "still")
COMPARED = ("active", "circle", "random")  # that the target speaks of
SOONER = {"circle": 2.0, "random": 4.0}  # times, that active inputs shall be
TRACKS = AT_ONCE, SENSES_FIRST = "tracks at once", "senses first"
TRACKED = ("tracking_from_s", "joins", "off_path_rms_m", "slip_m", "touched_wall", "position_rms_m")

PATH: dict[str, Any] = {"then": "figure-eight", "speed": 0.3, "cycle": 16.0}  # [m/s], [s]: what is kept
CIRCLES = {SLOW: 0.1, FAST: 0.5}  # [m/s]: of radii 0.67 m and 0.5 m, the field being 2.83 m wide
EIGHT_SPAN = 15.111  # [rad] cycle times turn rate of a figure of eight, a little more than 2 pi times J_0's first zero
SLIPPERY: Mapping[str, float] = {"friction": 0.1, "speed_max": 0.6, "turn_rate_max": 1.2}
NEVER_UNSURE = {"sure_position": 100.0, "sure_heading": math.pi}  # [m], [rad]
STEP = 0.05  # [s] between poses at which a pattern's clearance is evaluated

COLOURS = dict(zip(MODES, ("#0d5fa8", "#7a4fb5", "#e07b00", "#0f9472", "#c2183b", "#8a6d1f", "#6b7a8c"), strict=True))
FALLING = LinearSegmentedColormap.from_list("falling", ("#0d5fa8", "#8fc3e6", "#f0a07c", "#b3202f"))
ERRORS = LogNorm(0.01, 1.0)  # [m]
SHOWN = 3  # which of the runs has its path drawn

Row = dict[str, Any]
Key = tuple[str, float]
"""(mode, bound of the turn rate [rad/s]); for a search with known pose (mode or "best", limit [m])"""


@configuration
class ActiveControlConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 100
    """number of runs of each mode that the target compares"""
    others: Count = 40
    """number of runs of each other mode, and of each mode at the higher turn rate"""
    tracked: Count = 6
    """number of runs that keep a path, of each kind"""
    searched: Count = 100
    """number of starts of the exhaustive search over sequences of inputs, with known pose"""
    depth: Annotated[int, Interval(ge=1, le=4)] = 3
    """number of inputs in a sequence of the exhaustive search"""
    seconds: Count = 20
    """duration of a run [s], also used as the time of a run whose error does not stay below the limit"""


class ActiveControl:
    """Active sensing: gain in the time to localise by choosing the most informative input (Paper C)."""

    Config = ActiveControlConfig
    quick = ActiveControlConfig(seeds=6, others=2, tracked=1, searched=10, depth=2)
    title = "Active control: inputs that teach a robot where it is"
    on_terrain = False

    @staticmethod
    def run(config: ActiveControlConfig, setup: Setup) -> StudyResult:
        seconds, fewer = float(config.seconds), min(config.seeds, config.others)
        runs = {(mode, SLOW): config.seeds if mode in COMPARED else fewer for mode in MODES}
        runs |= {(mode, FAST): fewer for mode in COMPARED}
        trials: dict[Any, list[Trial]] = {
            **{key: [localisation(*key, seed, seconds) for seed in range(n)] for key, n in runs.items()},
            **{kind: [tracking(kind, seed, seconds) for seed in range(config.tracked)] for kind in TRACKS},
        }
        records = setup.fly_groups(trials)
        searches = [
            InputSearch(seed, start(SLOW, seconds, seed), limit, seconds, config.depth)
            for limit in LIMITS for seed in range(config.searched)
        ]  # fmt: skip
        found = list(zip(searches, setup.compute(soonest, searches), strict=True))
        searched = {
            (mode, limit): median(np.array([times[mode] for search, times in found if search.limit == limit]))
            for limit in LIMITS for mode in ("best", *SEARCHED)
        }  # fmt: skip
        rows = [_row(*key, record, seconds) for key in runs for record in records[key]]
        tracks = [
            {"mode": kind, "seed": record.seed, **{name: record.summary[name] for name in TRACKED}}
            for kind in TRACKS for record in records[kind]
        ]  # fmt: skip
        modes = {
            key: ModeRuns([r for r in rows if (r["mode"], r["turn_rate_max_rad_s"]) == key], seconds) for key in runs
        }
        return StudyResult(
            summary=(
                "Two sensors at ±60° in the standard ellipse, 5 % range noise, an EKF that is given the start to 0.3 m "
                f"and 0.3 rad. Time: the last instant with a position error above {LIMIT} m; a run that is not below "
                f"it for good after {config.seconds} s, or touches the wall, counts as {config.seconds} s. Medians, "
                "with 95 % bootstrap bands. Start, what is known of the start, and noise are the same for every mode.",
            ),
            rows=[*rows, *tracks],
            tables=_tables(modes, searched, tracks, config.depth),
            figure=figure(records, modes, seconds),
            caption="(a) Position errors: medians, and between the quartiles. (b) When they are below "
            f"{LIMIT} m for good: medians with 95 % bands. (c) One run of each mode, from the same start, "
            "coloured by its error; the last two: a figure of eight on a slippery floor, kept from the first estimate "
            "on, and after active sensing (dashed: the path).",
            claims=claims(modes, searched, tracks, seconds),
        )


def _row(mode: str, turn_rate: float, record: Record, seconds: float) -> Row:
    """Return a row of the CSV; the time [s] until the error stays below the limit is at most that of the run."""
    summary = record.summary
    return {
        "mode": mode,
        "turn_rate_max_rad_s": turn_rate,
        "seed": record.seed,
        "time_s": seconds if summary["touched_wall"] else min(seconds, summary["last_above_s"]),
        "touched_wall": summary["touched_wall"],
        "error_at_end_m": summary["errors_m"][-1],
        "path_length_m": summary["path_length_m"],
    }


class ModeRuns:
    """Times and outcomes of the runs with one mode, at one bound of the turn rate."""

    def __init__(self, rows: Sequence[Row], seconds: float) -> None:
        times = np.array([row["time_s"] for row in rows])
        self.time = median(times)  # [s] until the error is below the limit for good
        self.runs, self.found = len(rows), int((times < seconds).sum())
        self.touched = sum(row["touched_wall"] for row in rows)

    @property
    def share(self) -> float:
        """Share of the runs in which the error stays below the limit from before the end."""
        return self.found / self.runs

    def times_longer(self, other: ModeRuns) -> float:
        """Return the median time over that of ``other``, which is zero only if every run begins within the limit."""
        return self.time.median / max(other.time.median, 1e-9)


def _sooner(searched: Mapping[Key, Band], mode: str, limit: float) -> float:
    """Return the time to find a known pose to a limit [m] with random inputs, over that with another mode."""
    return searched["random", limit].median / searched[mode, limit].median


def _tables(
    modes: Mapping[Key, ModeRuns], searched: Mapping[Key, Band], tracks: Sequence[Row], depth: int
) -> tuple[Table, ...]:
    return (
        Table(
            "How soon the robot knows where it is",
            ("mode", "turn rate ≤ [rad/s]", "time [s]", "times that of active", "found", "touched the wall"),
            [(mode, turn_rate, e.time.text(), f"{e.times_longer(modes['active', turn_rate]):.2f}",
              f"{e.found} of {e.runs}", e.touched) for (mode, turn_rate), e in modes.items()],
        ),
        Table(
            f"With the pose known: the Cramér-Rao bound, best of every sequence of {depth} inputs",
            ("inputs", "limit [m]", "time [s]", "times sooner than random"),
            [(mode, limit, band.text(), f"{_sooner(searched, mode, limit):.2f}")
             for (mode, limit), band in searched.items()],
        ),
        Table(
            "A figure of eight on a slippery floor",
            ("loop", "seed", *TRACKED),
            [tuple("never" if value is None else value for value in row.values()) for row in tracks],
        ),
    )  # fmt: skip


def claims(
    modes: Mapping[Key, ModeRuns], searched: Mapping[Key, Band], tracks: Sequence[Row], seconds: float
) -> list[Claim]:
    """Evaluate every claim of the study."""
    slow, fast = ({mode: e for (mode, rate), e in modes.items() if rate == bound} for bound in (SLOW, FAST))
    factors = {mode: slow[mode].times_longer(slow["active"]) for mode in SOONER}
    faster = {mode: fast[mode].times_longer(fast["active"]) for mode in SOONER}
    found, then = (
        " and ".join(f"{f:.2f} times sooner than {m}" for m, f in each.items()) for each in (factors, faster)
    )
    first, last = (pick(slow, key=lambda mode: slow[mode].time.median) for pick in (min, max))
    compared = ", ".join(f"{mode} {slow[mode].time.text()}" for mode in COMPARED)
    walls = {kind: [bool(row["touched_wall"]) for row in tracks if row["mode"] == kind] for kind in TRACKS}
    return [
        Claim(
            "range.active", "target", "Active inputs find the pose sooner than a fixed circle and than random inputs.",
            "C.1, C.3, C.6",
            f"at {SLOW} rad/s, two sensors and an EKF from 0.3 m and 0.3 rad: median time of the last error above "
            f"{LIMIT} m at least {SOONER['circle']:g} times sooner than the circle and {SOONER['random']:g} times than "
            "random inputs",
            f"{found}; medians in s: {compared}; touched the wall: "
            f"{', '.join(f'{mode} {slow[mode].touched}' for mode in COMPARED)}; at {FAST:g} rad/s {then}",
            all(factors[mode] >= least for mode, least in SOONER.items()),
        ),
        Claim(
            "range.active-limit", "target",
            f"No inputs find the pose {SOONER['random']:g} times sooner than random ones.",
            "C.6",
            "with the pose known, the best of every sequence of inputs brings the posterior Cramer-Rao bound below "
            f"{LIMIT} m, and below {LIMITS[-1]} m, less than {SOONER['random']:g} times sooner than random inputs, in "
            "the median",
            "; ".join(
                f"{limit} m: best {searched['best', limit].text()} s, {_sooner(searched, 'best', limit):.2f} times "
                f"sooner than random, active {_sooner(searched, 'active', limit):.2f} times" for limit in LIMITS
            ),
            all(_sooner(searched, "best", limit) < SOONER["random"] for limit in LIMITS),
        ),
        Claim(
            "C.input-decides", "printed",
            "Observability, and how an observer converges, depend on the exciting control.", "C.1, C.6",
            "from the same starts, the medians of the best and of the worst input differ beyond their bands",
            f"{first} {slow[first].time.text()} s, {last} {slow[last].time.text()} s (a run ends after {seconds:g} s)",
            slow[first].time.high < slow[last].time.low,
        ),
        Claim(
            "C.basis", "printed",
            "How feasible and output-flow equivalent states meet may be the basis for the design of active observers.",
            "Abstract, C.3.1",
            "the input with the greatest least singular value of [dh; dh'/dt], to first order (C.1), finds the pose "
            "sooner than circle and random inputs",
            f"medians in s: singular-value {slow['singular-value'].time.text()}, {compared}",
            all(slow["singular-value"].time.median < slow[mode].time.median for mode in SOONER),
        ),
        Claim(
            "C.deliberate", "printed",
            "To succeed in reconstructing the state the exciting control has to be deliberate.", "C.6",
            f"within {seconds:g} s active inputs bring the error below {LIMIT} m for good more often than inputs that "
            "nobody chose, random ones and none",
            "found: "
            + ", ".join(f"{m} {slow[m].found} of {slow[m].runs}" for m in ("active", "random", "circle", "still"))
            + "; keeping a path on a slippery floor, touched the wall: "
            + ", ".join(f"{kind} {sum(touched)} of {len(touched)}" for kind, touched in walls.items()),
            all(slow["active"].share > slow[mode].share for mode in ("random", "still")),
        ),
    ]  # fmt: skip


def figure(records: Mapping[Any, Sequence[Record]], modes: Mapping[Key, ModeRuns], seconds: float) -> Figure:
    """Draw three panels: errors over time, times until they stay below the limit, and paths.

    ``records`` are the runs by mode and bound of the turn rate [rad/s], and by kind those that keep a path.
    """
    with styled_figure((13.0, 12.0), None) as page:
        above = page.add_gridspec(
            1, 2, left=0.06, right=0.98, top=0.96, bottom=0.62, width_ratios=(1.25, 1.0), wspace=0.3
        )
        _draw_errors(page.add_subplot(above[0]), records, seconds)
        _draw_times(page.add_subplot(above[1]), modes, seconds)
        below = page.add_gridspec(3, 3, left=0.02, right=0.91, top=0.535, bottom=0.02, hspace=0.16, wspace=0.04)
        places = [page.add_subplot(below[k // 3, k % 3]) for k in range(9)]
        for axes, mode in zip(places, MODES, strict=False):
            flown = records[mode, SLOW]
            _draw_path(axes, flown[min(SHOWN, len(flown) - 1)].summary, mode, COLOURS[mode])
        for axes, kind in zip(places[len(MODES) :], TRACKS, strict=True):
            axes.plot(*_reference(PATH).T, color=INK, lw=1.0, ls=(0, (4, 3)), zorder=1)
            _draw_path(axes, records[kind][0].summary, f"figure of eight, {kind}", INK)
        page.text(0.02, 0.553, f"(c) Paths, {SLOW} rad/s, and a path that is kept", weight="bold", size=10.0)
        bar = page.colorbar(
            ScalarMappable(ERRORS, FALLING), cax=page.add_axes((0.935, 0.1, 0.012, 0.36)), extend="both"
        )
        bar.set_label("position error of the estimate [m]")
        bar.set_ticks([0.01, LIMIT, 1.0], labels=["0.01", f"{LIMIT}", "1"])
        bar.ax.yaxis.set_minor_locator(NullLocator())
    return page


def _draw_errors(axes: Axes, records: Mapping[Any, Sequence[Record]], seconds: float) -> None:
    axes.set_title(f"(a) Position error, turn rate at most {SLOW} rad/s")
    ends = []
    for mode in COMPARED:
        errors = _series([record.summary["errors_m"] for record in records[mode, SLOW]])
        t = OFTEN * np.arange(errors.shape[1])
        low, middle, high = np.nanquantile(errors, [0.25, 0.5, 0.75], axis=0)
        axes.fill_between(t, low, high, color=COLOURS[mode], alpha=0.16, lw=0.0)
        axes.plot(t, middle, color=COLOURS[mode], lw=2.2)
        ends.append((mode, t, middle))
    axes.axhline(LIMIT, color=INK, lw=1.0, ls=(0, (4, 3)))
    axes.set(yscale="log", xlim=(0.0, seconds))
    annotate(axes, f"{LIMIT} m", (seconds, LIMIT), (-4, 4), ha="right", path_effects=HALO)
    for place, (mode, t, middle) in zip((0.07, 0.28, 0.5), ends, strict=True):
        k = round(place * (len(t) - 1))
        annotate(axes, mode, (t[k], middle[k]), (10, 16), color=COLOURS[mode], weight="bold", size=10.0,
                 path_effects=HALO)  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="error [m]: median and quartiles")


def _series(rows: Sequence[Sequence[float]]) -> Array:
    """Return a series (n, m) of n runs, padded with NaN after runs that ended early."""
    filled = np.full((len(rows), max(len(row) for row in rows)), np.nan)
    for k, row in enumerate(rows):
        filled[k, : len(row)] = row
    return filled


def _draw_times(axes: Axes, modes: Mapping[Key, ModeRuns], seconds: float) -> None:
    axes.set_title(f"(b) Below {LIMIT} m for good after")
    for k, mode in enumerate(reversed(MODES)):
        for turn_rate, lift, face in ((SLOW, 0.0, COLOURS[mode]), (FAST, -0.28, "white")):
            if (mode, turn_rate) not in modes:
                continue
            band = modes[mode, turn_rate].time
            axes.plot([band.low, band.high], [k + lift] * 2, color=COLOURS[mode], lw=2.4, alpha=0.6)
            axes.plot(band.median, k + lift, "o", ms=8.0, mfc=face, mec=COLOURS[mode], mew=1.6)
            right = band.median if np.isnan(band.high) else band.high
            never = band.median >= seconds
            text = "not within the run" if never else f"{band.median:.2f} s"
            annotate(axes, text, (band.low if never and np.isfinite(band.low) else right, k + lift),
                     (-8 if never else 8, 0), va="center", ha="right" if never else "left", size=8.5,
                     path_effects=HALO)  # fmt: skip
    axes.set_yticks(range(len(MODES)), list(reversed(MODES)))
    for label, mode in zip(axes.get_yticklabels(), reversed(MODES), strict=True):
        label.set(color=COLOURS[mode], weight="bold")
    axes.set_xscale("log")
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0) if tick <= seconds]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    lowest = min(0.2, *(max(0.02, e.time.median) for e in modes.values()))
    axes.set(xlim=(0.7 * lowest, 1.5 * seconds), ylim=(-0.6, len(MODES) - 0.4))
    axes.grid(axis="y", visible=False)
    axes.set_xlabel(f"time [s]; filled: {SLOW} rad/s, hollow: {FAST:g} rad/s")


def _draw_path(axes: Axes, summary: Mapping[str, Sequence[float]], title: str, colour: str) -> None:
    """Draw the wall and the path driven in it, coloured by the error."""
    places, errors = np.array(summary["places_m"]), np.array(summary["errors_m"])
    axes.add_patch(Polygon(WALL.polyline, closed=True, facecolor="#f6f4ee", edgecolor=INK, lw=1.4, zorder=0))
    pieces = np.stack([places[:-1], places[1:]], axis=1)
    axes.add_collection(LineCollection(list(pieces), colors="white", lw=5.0, zorder=2))
    axes.add_collection(LineCollection(list(pieces), array=errors[1:], cmap=FALLING, norm=ERRORS, lw=2.6, zorder=3))
    axes.plot(*places[0], "o", ms=7.0, mfc="white", mec=INK, mew=1.4, zorder=4)
    axes.plot(*places[-1], "s", ms=6.0, mfc=FALLING(ERRORS(errors[-1])), mec=INK, mew=1.2, zorder=4)
    axes.set_title(title, color=colour, loc="center", pad=2.0, size=9.5)
    reach = np.abs(WALL.polyline).max(axis=0) * 1.04
    axes.set(xlim=(-reach[0], reach[0]), ylim=(-reach[1], reach[1]), aspect="equal")
    axes.axis("off")


def fields_of(mode: str, turn_rate: float) -> dict[str, float]:
    """Return fields of the planner: patterns turn as fast as the robot can, the line returns every 4 s."""
    patterns = {
        "circle": {"speed": CIRCLES[turn_rate], "cycle": 2.0 * math.pi / turn_rate},
        "figure-eight": {"speed": 0.08, "cycle": EIGHT_SPAN / turn_rate},
        "straight": {"speed": 0.5, "cycle": 4.0},
    }
    return patterns.get(mode, {})


def localisation(mode: str, turn_rate: float, seed: int, seconds: float) -> Trial:
    """Return the trial of a robot that drives by one mode, with a bound on its turn rate [rad/s]."""
    planner = {"mode": mode, **fields_of(mode, turn_rate), **({"seed": 1 + seed} if mode == "random" else {})}
    fields = {
        "turn_rate_max": turn_rate,
        "duration": seconds,
        "start": start(turn_rate, seconds, seed),
        "start_known": True,
        "start_error": START_ERROR,
        **{f"planner.{name}": value for name, value in planner.items()},
    }
    return trial("range-localisation", seed, estimator="range_ekf", fields=fields, measure=f"{__name__}:course")


def tracking(kind: str, seed: int, seconds: float) -> Trial:
    """Return the trial of a differential drive that keeps a path on a slippery floor, from an unknown start."""
    planner = {
        f"planner.{name}": value for name, value in {**PATH, **(NEVER_UNSURE if kind == AT_ONCE else {})}.items()
    }
    fields = {"drive": "differential", **SLIPPERY, "duration": seconds, **planner}
    return trial("range-localisation", seed, fields=fields, measure=f"{__name__}:tracked")


@cache
def start(turn_rate: float, seconds: float, seed: int) -> tuple[float, float, float]:
    """Draw a start X Y HEADING [m, m, deg] from which every fixed pattern keeps the margin."""
    margin, rng = RangeLocalisationConfig().margin, np.random.default_rng(seed)
    paths = _pattern_paths(turn_rate, seconds)
    while True:
        x, y, phi = WALL.draw(rng, margin)
        c, s = math.cos(phi), math.sin(phi)
        places = paths @ np.array([[c, s], [-s, c]]) + [x, y]
        if all(WALL.contains(place, margin) for place in places):
            return float(x), float(y), math.degrees(phi)


@cache
def _pattern_paths(turn_rate: float, seconds: float) -> Array:
    """Return positions (n, 2) [m] of the fixed patterns from the origin, from the farthest to the nearest."""
    steps = round(seconds / STEP) + 1
    pattern = (PATTERNS[m](ActiveSensing.Config(mode=m, **fields_of(m, turn_rate))) for m in MODES if m in PATTERNS)  # type: ignore[arg-type]
    places = np.vstack([path(one, np.zeros(3), STEP)[:steps:4, :2] for one in pattern])
    farthest: Array = places[np.argsort(-np.linalg.norm(places, axis=1))]
    return farthest


def course(outcome: RunData) -> dict[str, Any]:
    """A measure: last time [s] with an error above the limit, and error and position [m] every fifth of a second."""
    errors = _errors(outcome)
    above = np.flatnonzero(~(errors.position <= LIMIT))
    kept = _kept(outcome)
    return {
        "last_above_s": float(errors.t[above[-1]]) if len(above) else 0.0,
        "errors_m": errors.position[kept].tolist(),
        "places_m": outcome.recording.truths[VEHICLE][kept, :2].tolist(),
    }


def tracked(outcome: RunData) -> dict[str, Any]:
    """A measure: distance from the path [m], and slip of the wheels [m]."""
    recording, reference = outcome.recording, _reference(outcome.config["controller"]["fields"])
    truth = recording.truths[VEHICLE]
    error = np.array([np.linalg.norm(reference - place, axis=1).min() for place in truth[:, :2]])
    errors, kept = _errors(outcome), _kept(outcome)
    joined = [event.t for event in recording.events if event.kind == "tracking"]
    return {
        "tracking_from_s": joined[0] if joined else None,
        "joins": len(joined),
        "off_path_rms_m": rms(error[errors.last]),
        "slip_m": _slip(recording.agents[VEHICLE].readings["odometry"][: len(truth), 0], truth),
        "off_path_m": error[kept].tolist(),
        "errors_m": errors.position[kept].tolist(),
        "places_m": truth[kept, :2].tolist(),
    }


def _reference(fields: Mapping[str, Any]) -> Array:
    """Return positions (n, 2) [m] of the path that a planner with these fields keeps."""
    config = ActiveSensing.Config(**fields)
    return ReferencePath(PATTERNS[config.then](config), RangingMission(WALL, (0.0,))).poses[:, :2]


def _errors(outcome: RunData) -> RangingErrors:
    """Return the errors modulo the wall's symmetry."""
    return RangingErrors.from_recording(outcome.recording, VEHICLE, RangingMission(WALL, (0.0,)))


def _kept(outcome: RunData) -> slice:
    t = outcome.recording.t
    return slice(0, None, max(1, round(OFTEN / float(t[1] - t[0]))) if len(t) > 1 else 1)


def _slip(measured: Array, truth: Array) -> float:
    """Return the slip [m]: distance by the wheels' speed (n,) [m/s] less the robot's, over intervals OFTEN, summed."""
    period = RangingMission(WALL, (0.0,)).period
    every = round(OFTEN / period)
    blocks = (len(truth) - 1) // every
    wheels = np.nan_to_num(measured[1 : 1 + blocks * every]).reshape(blocks, every).sum(axis=1) * period
    step = np.diff(truth[:, :2], axis=0)[: blocks * every]
    heading = truth[: blocks * every, 2]
    forwards = (step[:, 0] * np.cos(heading) + step[:, 1] * np.sin(heading)).reshape(blocks, every).sum(axis=1)
    return float(np.abs(wheels - forwards).sum())
