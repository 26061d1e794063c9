"""The observer of Paper C in the simulations of C.5 (Figures C.3 to C.8), as printed and with feed-forward.

The observer as printed (C.5) is compared with three feed-forwards that keep it on Psi(x): in Z and in X, without noise
and with 5 % noise, from the start of the thesis; and with other gains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgb
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import LogLocator, NullFormatter

from mathnavi.estimators.ranging.observer import FeedForward, RangeObserverConfig
from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.renders.figures import GRID, INK
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.renders.ranging.shapes import outline
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.ranging import HEADING, POSITION
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import annotate, readable_on, styled_figure
from mathnavi.studies.framework.study import Jobs, Row, Setup, StudyResult, chosen
from mathnavi.studies.ranging.observability_measures import SENSORS, STANDARD, THESIS_START
from mathnavi.studies.ranging.range_observer_runs import (
    DRIVES,
    MOTIONS,
    RESIDUALS,
    DrawnRun,
    ObserverRun,
    ThesisRun,
    averaged,
    drawn_errors,
    identities,
    shown_run,
    thesis_errors,
)

# kinds of runs, as rows have them; those from the known start are not written
THESIS, NOISY, KNOWN = "thesis' start", "thesis' start, 5 % noise", "thesis' start, known"
DRAWN, FAST = "from the truth", "from the truth, 1 kHz"
WRITTEN = (
    "sensors", "what", "motion", "feedforward", "k_v", "k_q", "seed", "position_rms_m", "heading_rms_rad", "z_rms_rad",
    "keeps_lock", "largest",
)  # fmt: skip
NAMES: dict[FeedForward, str] = {"none": "as printed", "s": "s", "rho_dot": "rho_dot", "manifold": "manifold"}
FEED_FORWARDS = tuple(name for name in NAMES if name != "none")
PAIR: tuple[FeedForward, FeedForward] = ("none", "s")  # what is drawn where all would be too many
TURNING = ("figure of eight", "circle", "weaving", "on the spot")
MOVING, STILL, SHOWN = (*TURNING, "up and down"), "standing still", "figure of eight"
NOISY_MOTIONS = (SHOWN, "up and down")
PRINTED_START = np.array([23.0 * math.pi / 4.0, 242.0 * math.pi / 1101.0, math.pi / 2.0])  # z(0) of C.5
PRINTED_GAINS = (5.0, 1.0)  # k_V and k_Q of C.5
OBSERVERS = {name: RangeObserverConfig(name, *PRINTED_GAINS) for name in NAMES}
NOISY_OBSERVERS = (*OBSERVERS.values(), RangeObserverConfig("s", 0.2, 0.2))
SETS = ("2s", "2t", "3", "4")
GAINS = (1.0, 10.0, 100.0, 1000.0)
FAST_SETS, FAST_GAINS, FAST_PERIOD, FAST_SECONDS = ("2s", "2t"), (1e3, 1e4, 1e5), 0.001, 6
BOTH = (True, True)

Q_ZERO, EXACT = 1e-7, 1e-9  # [m^2/s] of |Q|, [rad/s] and [rad] of a feed-forward on the truth
FALL = (4.0, 11.0)  # times by which the printed observer's error falls from k = 1 to k = 10
SAME = 1e-3  # [rad] by which z(0) as printed may be off Psi(x(0))
SMALL = 0.01  # [m] that counts as arbitrarily small

TRUTH = hexadecimal(COLOURS[SceneElement.DRIVEN])
COLOUR: Mapping[FeedForward, str] = {
    "none": hexadecimal(COLOURS[SceneElement.HYPOTHESIS]),
    "s": hexadecimal(COLOURS[SceneElement.ESTIMATE]),
    "rho_dot": hexadecimal(COLOURS[SceneElement.RAY]),
    "manifold": "#101824",
}
SET_COLOURS = dict(zip(SETS, ("#0d5fa8", "#c2183b", "#e07b00", "#0f9472"), strict=True))
SHARES = LinearSegmentedColormap.from_list("share", ("#b3202f", "#f0a07c", "#f4f1ea", "#6fb0dc", "#0d5fa8"))
LEAST = 1e-15  # of an error that is drawn
PARTS = ("$s_1$", "$s_2$", "φ")


@configuration
class RangeObserverStudyConfig:
    """Sample sizes: runs."""

    starts: Count = 15
    """number of first estimates drawn around the start of the thesis"""
    drives: Count = 10
    """number of starts drawn over the field, for each set of sensors"""
    states: Count = 500
    """number of states at which the identities are checked, for each set of sensors"""
    seconds: Count = 20
    """duration of a run [s]"""


class RangeObserverStudy:
    """The active range observer as printed and with feed-forward (Figures C.3 to C.8)."""

    Config = RangeObserverStudyConfig
    quick = RangeObserverStudyConfig(starts=2, drives=1, states=50)
    title = "The active range observer, as printed and with feed-forward (Figures C.3 to C.8)"
    on_terrain = False

    @staticmethod
    def run(config: RangeObserverStudyConfig, setup: Setup) -> StudyResult:
        done = _jobs(config).done(setup)
        residuals = {sensors: done["identities", sensors][0] for sensors in SETS}
        rows = _rows(done, residuals)
        exact = {name: done["shown", name][0] for name in NAMES}
        noisy = {name: done["shown, noisy", name][0] for name in PAIR}
        return StudyResult(
            summary=(
                f"The thesis does not say how the robot moved, so {len(MOTIONS)} inputs are tried, each from "
                f"{config.starts} first estimates that are off by up to 0.2 rad in each component of z, with the "
                "printed gains (5, 1), sensors at -90° and -45°, and 100 readings a second. Keeping lock: RMS error "
                "below 0.3 m and 0.2 rad over the last quarter of a run, modulo the half-turn that the ellipse has. "
                "With noise, range rates are those of 101 readings around an instant half a second ago.",
            ),
            rows=[{key: value for key, value in row.items() if key in WRITTEN} for row in rows if row["what"] != KNOWN],
            tables=(_thesis_table(rows), _noise_table(rows), _gains_table(rows), _identities_table(residuals)),
            figure=range_observer_figure(exact, noisy, rows),
            caption=f"(a) The components of z in a {SHOWN} from the thesis' start (as Figure C.3), one first estimate. "
            "(b) The same in X (C.5), (c) the errors in X and (d) in Z (C.6, C.4), of all feed-forwards. (e) What the "
            "observer descends on. (f) The phase portrait in Z and (g) the path in X with 5 % range noise (C.7, C.8), "
            "(h) the errors. (i) Shares of the first estimates from which lock is kept. (j) As printed, from starts "
            "that are drawn, started on the truth, by its gain; hollow: with 1000 readings a second.",
            claims=claims(rows, residuals, done["averaged",]),
        )  # fmt: skip


def _jobs(config: RangeObserverStudyConfig) -> Jobs:
    """Return all jobs, with groups of runs by kind, sensors, motion, and observer or gains."""
    jobs, seconds = Jobs(), config.seconds
    for name, observer in OBSERVERS.items():
        jobs.add(("shown", name), shown_run, [ThesisRun(SHOWN, observer, 0, seconds)])
        known = ThesisRun(SHOWN, observer, 0, seconds, true_start=True)
        jobs.add((KNOWN, "2t", SHOWN, observer), thesis_errors, [known])
        for motion in MOTIONS:
            runs = [ThesisRun(motion, observer, seed, seconds) for seed in range(config.starts)]
            jobs.add((THESIS, "2t", motion, observer), thesis_errors, runs)
    for name in PAIR:
        jobs.add(("shown, noisy", name), shown_run, [ThesisRun(SHOWN, OBSERVERS[name], 0, seconds, BOTH)])
    for motion in NOISY_MOTIONS:
        for observer in NOISY_OBSERVERS:
            runs = [ThesisRun(motion, observer, seed, seconds, BOTH) for seed in range(config.starts)]
            jobs.add((NOISY, "2t", motion, observer), thesis_errors, runs)
    runs = [ThesisRun(SHOWN, OBSERVERS["s"], k, seconds, (k % 2 == 0, k % 2 == 1)) for k in range(config.starts)]
    jobs.add(("averaged",), averaged, runs)
    for sensors in SETS:
        jobs.add(("identities", sensors), identities, [(sensors, 0, config.states)])
        for drive in DRIVES:
            wanted = [DrawnRun(sensors, drive, GAINS, seed, seconds) for seed in range(config.drives)]
            jobs.add((DRAWN, sensors, drive, GAINS), drawn_errors, wanted)
    for sensors in FAST_SETS:
        least = min(seconds, FAST_SECONDS)
        wanted = [DrawnRun(sensors, "standard", FAST_GAINS, k, least, FAST_PERIOD) for k in range(config.drives)]
        jobs.add((FAST, sensors, "standard", FAST_GAINS), drawn_errors, wanted)
    return jobs


def _rows(done: Mapping[Any, list[Any]], residuals: Mapping[str, Mapping[str, Array]]) -> list[Row]:
    """Return a row for each run, and the residuals of the identities for each set of sensors."""
    groups = [(*key, found) for key, found in done.items() if key[0] in (THESIS, NOISY, KNOWN)]
    groups += [
        (*key[:-1], RangeObserverConfig("none", k, k), [errors[i] for errors in found])
        for key, found in done.items() if key[0] in (DRAWN, FAST) for i, k in enumerate(key[-1])
    ]  # fmt: skip
    return [
        *({"sensors": sensors, "what": what, "motion": motion, "feedforward": observer.feedforward,
           "k_v": observer.k_v, "k_q": observer.k_q, "seed": seed, **errors}
          for what, sensors, motion, observer, found in groups for seed, errors in enumerate(found)),
        *({"what": f"identities: {name}", "sensors": sensors, "largest": float(np.nanmax(residuals[sensors][name]))}
          for sensors in SETS for name in RESIDUALS),
    ]  # fmt: skip


# ---- questions to the rows


def median(rows: Sequence[Row], name: str = "position_rms_m") -> float:
    """Return the median of an error over runs."""
    return float(np.median([row[name] for row in rows]))


def locked(rows: Sequence[Row], flag: str = "keeps_lock") -> int:
    """Count the runs that kept lock in X, or in Z with ``keeps_lock_in_z``."""
    return sum(row[flag] for row in rows)


def falls(rows: Sequence[Row], **values: Any) -> list[float]:
    """Return the ratios of the position errors at k = 1 and k = 10, of runs from drawn starts with lock at both."""
    return [
        slow["position_rms_m"] / fast["position_rms_m"]
        for slow, fast in zip(*(chosen(rows, what=DRAWN, k_v=k, **values) for k in (1.0, 10.0)), strict=True)
        if slow["keeps_lock"] and fast["keeps_lock"]
    ]


def by_gain(rows: Sequence[Row], what: str, sensors: str) -> dict[float, float]:
    """Return the median position error [m] of the standard drive from drawn starts, by gain."""
    own = chosen(rows, what=what, sensors=sensors, motion="standard")
    return {k: median(chosen(own, k_v=k)) for k in dict.fromkeys(row["k_v"] for row in own)}


# ---- tables


def _thesis_table(rows: Sequence[Row]) -> Table:
    columns = ("input", *(f"{name}: keeps lock, RMS [m], [rad]" for name in NAMES.values()))
    cells = [
        (motion, *(_lock_cell(chosen(rows, what=THESIS, motion=motion, feedforward=name)) for name in NAMES))
        for motion in MOTIONS
    ]
    return Table("From the thesis' start, without noise, gains (5, 1)", columns, cells)


def _noise_table(rows: Sequence[Row]) -> Table:
    columns = ("input", "feed-forward", "k_V, k_Q", "keeps lock, RMS [m], [rad]")
    cells = [
        (motion, NAMES[own.feedforward], f"{own.k_v:g}, {own.k_q:g}",
         _lock_cell(chosen(rows, what=NOISY, motion=motion, feedforward=own.feedforward, k_v=own.k_v)))
        for motion in NOISY_MOTIONS for own in NOISY_OBSERVERS
    ]  # fmt: skip
    return Table("From the thesis' start, with 5 % range noise", columns, cells)


def _lock_cell(rows: Sequence[Row]) -> str:
    return f"{locked(rows)} of {len(rows)}, {median(rows):.2g}, {median(rows, 'heading_rms_rad'):.2g}"


def _gains_table(rows: Sequence[Row]) -> Table:
    columns = ("sensors", "figure of eight", *(f"k = {k:g}" for k in GAINS), "k = 1 over k = 10")
    cells = [
        (sensors, drive,
         *(_lock_cell(chosen(rows, what=DRAWN, sensors=sensors, motion=drive, k_v=k)) for k in GAINS),
         f"{min(own):.1f} to {max(own):.1f} in {len(own)}" if own else "no lock kept")
        for sensors in SETS for drive in DRIVES for own in [falls(rows, sensors=sensors, motion=drive)]
    ]  # fmt: skip
    return Table("As printed, from drawn starts, started on the truth: keeps lock, RMS [m], [rad]", columns, cells)


def _identities_table(residuals: Mapping[str, Mapping[str, Array]]) -> Table:
    columns = ("sensors", "states", "|Q| [m²/s]", "s [rad/s]", "rho_dot [rad/s]", "manifold, a period [rad]",
               "s, a period by Heun [rad]", "rho_dot, a period by Heun [rad]")  # fmt: skip
    cells = [
        (sensors, str(len(own["Q"])), *(f"{np.nanmax(own[name]):.1e}" for name in RESIDUALS))
        for sensors, own in residuals.items()
    ]
    return Table("On the truth: the largest of what should vanish", columns, cells)


# ---- claims


def claims(
    rows: Sequence[Row], residuals: Mapping[str, Mapping[str, Array]], averages: Sequence[tuple[float, float]]
) -> list[Claim]:
    """Evaluate every claim; ``averages`` are RMS errors [m] by the mean of both rays and by the faulty one."""
    return [_identities(residuals), _as_printed(rows), *_printed(rows), *_noise(rows, averages), *_depends(rows)]


def _identities(residuals: Mapping[str, Mapping[str, Array]]) -> Claim:
    every = {name: np.concatenate([own[name] for own in residuals.values()]) for name in RESIDUALS}
    Q, s, rho_dot, manifold = (float(np.nanmax(every[name])) for name in ("Q", "s", "rho_dot", "manifold"))
    return Claim(
        "range.identities", "target", "Q vanishes on the truth, and each feed-forward is Ψ_*F there.", "C.4",
        f"|Q| <= {Q_ZERO:.0e} m²/s as printed; s and rho_dot off Ψ_*F by at most {EXACT:.0e} rad/s, manifold off "
        f"Ψ(x) after a period by at most {EXACT:.0e} rad, where no denominator is guarded",
        f"|Q| <= {Q:.1e}; s {s:.1e}, rho_dot {rho_dot:.1e}, manifold {manifold:.1e}, at "
        f"{len(every['s'])} states with random inputs, {np.isnan(every['s']).sum()} of them guarded",
        Q <= Q_ZERO and max(s, rho_dot, manifold) <= EXACT,
    )  # fmt: skip


def _as_printed(rows: Sequence[Row]) -> Claim:
    ratios = falls(rows)
    measured = f"{min(ratios):.1f} to {max(ratios):.1f} times" if ratios else "it keeps lock nowhere"
    turning = {
        name: [row for motion in TURNING for row in chosen(rows, what=THESIS, motion=motion, feedforward=name)]
        for name in NAMES
    }
    runs, kept = len(turning["none"]), {name: locked(own) for name, own in turning.items()}
    return Claim(
        "range.as-printed", "target",
            "The observer as printed errs by 1/k where it keeps lock, and where it turns it loses lock.",
        "C.4, C.5",
        f"its position error falls {FALL[0]:g} to {FALL[1]:g} times from k = 1 to k = 10 in every run that keeps "
        "lock at both; from the thesis' start with turning inputs and gains (5, 1) it keeps lock in no run, each "
        "feed-forward in every one",
        f"{measured} ({len(ratios)} of {len(chosen(rows, what=DRAWN, k_v=1.0))} runs from drawn starts keep "
        f"lock at both); turning from the thesis' start lock is kept in {kept['none']} of {runs}, with "
        + ", ".join(f"{name} in {kept[name]}" for name in FEED_FORWARDS),
        bool(ratios) and FALL[0] <= min(ratios) and max(ratios) <= FALL[1]
        and kept["none"] == 0 and all(kept[name] == runs for name in FEED_FORWARDS),
    )  # fmt: skip


def _printed(rows: Sequence[Row]) -> list[Claim]:
    psi = np.append(STANDARD.ranges(THESIS_START, np.radians(SENSORS["2t"]))[1], THESIS_START[2])
    error = float(np.abs(wrapped(PRINTED_START - psi)).max())
    worst = {row["feedforward"]: row["worst_m"] for row in chosen(rows, what=KNOWN)}
    moving = {motion: chosen(rows, what=THESIS, motion=motion, feedforward="none") for motion in MOVING}
    in_z, in_x = (
        ", ".join(f"{motion} {locked(own, flag)} of {len(own)} ({median(own, name):.2f} {unit})"
                  for motion, own in moving.items())
        for flag, name, unit in (("keeps_lock_in_z", "z_rms_rad", "rad"), ("keeps_lock", "position_rms_m", "m"))
    )  # fmt: skip
    return [
        Claim(
            "C.start", "printed", "x(0) = (1, -1, π/2) is z(0) = (23π/4, 242π/1101, π/2).", "C.5",
            f"to {SAME:.0e} rad with sensors at -90° and -45° in the ellipse with half-axes 3.763 and √2",
            f"off by {error:.1e} rad", error <= SAME,
        ),
        Claim(
            "C.observer", "printed", "(C.5) is an observer: from Ψ(x(0)) it stays on Ψ(x).", "C.4, Definition C.7",
            f"{SHOWN} from the thesis' start, known exactly: the position is never off by more than {SMALL} m",
            f"off by up to {worst['none']:.2f} m; with feed-forward [m]: "
            + ", ".join(f"{name} {worst[name]:.0e}" for name in FEED_FORWARDS), worst["none"] <= SMALL,
        ),
        Claim(
            "C.converges-z", "printed", "Figures C.3 and C.4 show the convergence of the observer in Z.", "C.5",
            f"under one moving input at least, RMS of a component at the end below {HEADING} rad from every start",
            in_z, any(locked(own, "keeps_lock_in_z") == len(own) for own in moving.values()),
        ),
        Claim(
            "C.converges-x", "printed", "Figures C.5 and C.6 show its convergence in X.", "C.5",
            f"under one moving input at least, RMS at the end below {POSITION} m and {HEADING} rad from every start",
            f"{in_x}; least under '{min(moving, key=lambda motion: median(moving[motion]))}', and not nought under any",
            any(locked(own) == len(own) for own in moving.values()),
        ),
    ]  # fmt: skip


def _noise(rows: Sequence[Row], averages: Sequence[tuple[float, float]]) -> list[Claim]:
    noisy = {name: chosen(rows, what=NOISY, feedforward=name, k_v=PRINTED_GAINS[0]) for name in PAIR}
    printed, ours = ({motion: chosen(own, motion=motion) for motion in NOISY_MOTIONS} for own in noisy.values())
    in_z, in_x = (
        {motion: locked(own, flag) for motion, own in printed.items()} for flag in ("keeps_lock_in_z", "keeps_lock")
    )
    runs = len(printed[SHOWN])
    relative = [
        tuple(median(own, name) for name in ("relative_position", "relative_heading")) for own in noisy.values()
    ]
    better = sum(mean < faulty for mean, faulty in averages)
    share = float(np.median([mean / faulty for mean, faulty in averages]))
    return [
        Claim(
            "C.noise-z", "printed", "With 5 % noise it tracks the true observer state quite well.", "C.5, Figure C.7",
            f"under one input at least, RMS of a component below {HEADING} rad in every run",
            "; ".join(f"{motion}: {kept} of {runs}" for motion, kept in in_z.items()), runs in in_z.values(),
        ),
        Claim(
            "C.noise-x", "printed", "With 5 % noise it tracks x as well.", "C.5, Figure C.8",
            f"under one input at least, RMS below {POSITION} m and {HEADING} rad in every run",
            "; ".join(f"{motion}: {kept} of {runs} ({median(printed[motion]):.2f} m)" for motion, kept in in_x.items())
            + f"; with s: {', '.join(f'{median(own):.3f} m' for own in ours.values())}", runs in in_x.values(),
        ),
        Claim(
            "C.position-better", "printed", "With noise the position is estimated much better than φ.", "C.5",
            "the relative error of (x_1, x_2) is below half that of φ, in the median",
            "as printed {:.0%} and {:.0%}, s {:.1%} and {:.1%}".format(*relative[0], *relative[1]),
            all(position < 0.5 * heading for position, heading in relative),
        ),
        Claim(
            "C.vector-average", "printed", "By the vector average a true measurement compensates for a faulty one.",
            "C.5", "5 % noise on one ray: the mean of both is nearer in every run than the ray that errs",
            f"in {better} of {len(averages)} runs; its RMS error is {share:.2f} of the other's, median",
            better == len(averages),
        ),
    ]  # fmt: skip


def _depends(rows: Sequence[Row]) -> list[Claim]:
    """Evaluate the claims on input and gain; with two rays 100 readings a second are too few for the gain of C.2."""
    moving, still = (median(chosen(rows, what=THESIS, motion=m, feedforward="s")) for m in (SHOWN, STILL))
    errors = {s: list((by_gain(rows, FAST, s) or by_gain(rows, DRAWN, s)).values()) for s in SETS}
    return [
        Claim(
            "C.input", "printed", "The convergence of the observer depends on the system input.", "C.6",
            f"s: the position error at the end, median, is below {SMALL} m driving a {SHOWN} and above it standing "
            "still",
            f"{moving:.1e} m and {still:.2f} m", moving < SMALL < still,
        ),
        Claim(
            "C.proposition-2", "printed", "The error of (C.5) can be made arbitrarily small by k_V and k_Q.",
            "Proposition C.2",
            f"from the truth, the median position error falls with k to below {SMALL} m: k = 1 to 1000 at 100 readings "
            "a second with three and four rays, 10³ to 10⁵ at 1000 a second with two",
            "[m] " + "; ".join(f"{s}: {', '.join(f'{error:.2g}' for error in own)}" for s, own in errors.items()),
            all(own[-1] < SMALL and own[-1] < own[0] for own in errors.values()),
        ),
    ]  # fmt: skip


# ---- the figure


def range_observer_figure(
    exact: Mapping[FeedForward, ObserverRun], noisy: Mapping[FeedForward, ObserverRun], rows: Sequence[Row]
) -> Figure:
    """Draw Figures C.3 to C.8, as printed and with feed-forward, row by row, then all runs."""
    with styled_figure((12.4, 16.0), ConstrainedLayoutEngine(w_pad=0.09, h_pad=0.07)) as figure:
        parts = np.array(figure.subfigures(5, 1, height_ratios=(0.85, 1.1, 0.95, 1.1, 1.1), hspace=0.03))
        _components(parts[0].subplots(1, 3), exact)
        field, in_x = parts[1].subplots(1, 2, width_ratios=(1.75, 1.0))
        _field(field, exact, noisy=False)
        _errors(in_x, exact, "position", "(c) error of the position [m] (C.6)")
        in_z, value, plane = parts[2].subplots(1, 3)
        _errors(in_z, exact, "in_z", "(d) error of a component of z [rad] (C.4)")
        _values(value, exact)
        _plane(plane, noisy)
        field, noise = parts[3].subplots(1, 2, width_ratios=(1.75, 1.0))
        _field(field, noisy, noisy=True)
        _noise_errors(noise, noisy)
        shares, gains = parts[4].subplots(1, 2)
        _shares(shares, rows)
        _by_gain(gains, rows)
    return figure


def _components(panels: Sequence[Axes], runs: Mapping[FeedForward, ObserverRun]) -> None:
    for k, (axes, name) in enumerate(zip(panels, PARTS, strict=True)):
        for feedforward, width in zip(PAIR, (1.6, 2.6), strict=True):
            run = runs[feedforward]
            axes.plot(run.t, run.z[:, k], color=COLOUR[feedforward], lw=width)
        run = runs["s"]
        axes.plot(run.t, run.z_true[:, k], color=TRUTH, lw=1.4, ls=(0, (4, 2)))
        axes.set(xlabel="time [s]", xlim=(0.0, run.t[-1]))
        axes.set_title(f"(a) {name} [rad] (C.3)" if k == 0 else f"{name} [rad]")
        low, high = axes.get_ylim()
        axes.set_ylim(low, high + 0.16 * (high - low))
    _legend(panels[0], columns=3)


def _legend(axes: Axes, columns: int) -> None:
    kinds = (("truth", TRUTH, (0, (4, 2))), ("as printed", COLOUR["none"], "-"), ("feed-forward s", COLOUR["s"], "-"))
    for name, colour, style in kinds:
        axes.plot([], [], color=colour, ls=style, lw=2.0, label=name)
    axes.legend(fontsize=8, ncols=columns, loc="upper left", columnspacing=1.0, handlelength=1.8, borderaxespad=0.1)


def _field(axes: Axes, runs: Mapping[FeedForward, ObserverRun], *, noisy: bool) -> None:
    wall = STANDARD.polyline
    axes.fill(*wall.T, color=GRID, alpha=0.22, lw=0)
    axes.plot(*wall.T, color=INK, lw=1.8)
    first = next(iter(runs.values()))
    alpha = first.run.mission.alpha
    for end in STANDARD.points(STANDARD.ranges(THESIS_START, alpha)[1]):
        axes.plot(
            [THESIS_START[0], end[0]], [THESIS_START[1], end[1]], color=hexadecimal(COLOURS[SceneElement.RAY]), lw=0.9
        )
    for feedforward, width in zip(PAIR, (1.1, 1.5), strict=True):
        run = runs[feedforward]
        axes.plot(run.x[:, 0], run.x[:, 1], color=COLOUR[feedforward], lw=width, zorder=3)
        axes.plot(*run.x[0, :2], "o", ms=4.5, color=COLOUR[feedforward], zorder=5)
    axes.plot(first.truth[:, 0], first.truth[:, 1], color=TRUTH, lw=1.8, ls=(0, (4, 2)), zorder=4)
    axes.fill(*outline(THESIS_START).T, facecolor="white", edgecolor=INK, lw=1.1, zorder=6)
    least = first.truth[np.argmin(first.truth[:, 0])]
    astray = runs["none"].x[np.argmax(runs["none"].position)]
    halo = [patheffects.withStroke(linewidth=2.6, foreground="#f3f5f6")]
    labels = [
        ("truth, and around it s" if noisy else "truth, and on it s", least, (-8, 0), "right", INK),
        ("as printed", astray, (-4, 12), "right", COLOUR["none"]),
    ]
    if not noisy:
        labels.append(("first estimate", runs["s"].x[0], (-2, 12), "center", COLOUR["s"]))
    for text, place, offset, side, colour in labels:
        annotate(axes, text, (place[0], place[1]), offset, ha=side, va="center", color=colour, fontsize=8.5, zorder=7,
                 path_effects=halo)  # fmt: skip
    title = "(g) in X, with 5 % range noise (C.8)" if noisy else "(b) in X, without noise (C.5)"
    axes.set(aspect="equal", title=title)
    low, high = wall.min(axis=0), wall.max(axis=0)
    axes.set(xlim=(low[0] - 0.1, high[0] + 0.1), ylim=(low[1] - 0.1, high[1] + 0.1))
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set(xticks=[], yticks=[])
    bar = low[0] + 0.1
    axes.plot([bar, bar + 1.0], [low[1] + 0.06] * 2, color=INK, lw=2.4, solid_capstyle="butt")
    annotate(axes, "1 m", (bar + 0.5, low[1] + 0.06), (0, 4), ha="center", fontsize=8)


def _errors(axes: Axes, runs: Mapping[FeedForward, ObserverRun], name: str, title: str) -> None:
    errors = {feedforward: np.maximum(getattr(run, name), LEAST) for feedforward, run in runs.items()}
    t = runs["s"].t
    for feedforward, error in errors.items():
        axes.plot(t, error, color=COLOUR[feedforward], lw=1.5)
    _log(axes, (1e-15, 30.0))
    _at_the_end(axes, errors, t)
    axes.set(xlabel="time [s]", title=title)


def _at_the_end(axes: Axes, errors: Mapping[FeedForward, Array], t: Array) -> None:
    """Write the name of each line next to its end, without overlaps."""
    axes.set_xlim(0.0, t[-1])
    order = sorted(errors, key=lambda f: -float(np.median(errors[f][-len(t) // 8 :])))
    least, last = 1.2, np.inf  # decades between two names
    for feedforward in order:
        level = min(float(np.log10(np.median(errors[feedforward][-len(t) // 8 :]))), last - least)
        annotate(axes, NAMES[feedforward], (1.0, 10.0**level), (4, 0), xycoords=("axes fraction", "data"), va="center",
                 color=COLOUR[feedforward], annotation_clip=False)  # fmt: skip
        last = level


def _log(axes: Axes, limits: tuple[float, float]) -> None:
    axes.set_yscale("log")
    axes.set_ylim(*limits)
    axes.yaxis.set_major_locator(LogLocator(numticks=9))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _values(axes: Axes, runs: Mapping[FeedForward, ObserverRun]) -> None:
    for feedforward in PAIR:
        run = runs[feedforward]
        V, Q = run.value[:, 0], np.sqrt(2.0 * run.value[:, 1])
        axes.plot(run.t, np.maximum(V, LEAST), color=COLOUR[feedforward], lw=1.5)
        axes.plot(run.t, np.maximum(Q, LEAST), color=COLOUR[feedforward], lw=1.1, ls=":")
    for label, style in (("$V_\\rho$ [m²]", "-"), ("|Q| [m²/s]", ":")):
        axes.plot([], [], color=INK, ls=style, lw=1.4, label=label)
    _log(axes, (1e-15, 1e4))
    t = runs["s"].t
    _at_the_end(axes, {name: np.sqrt(2.0 * runs[name].value[:, 1]) for name in PAIR}, t)
    axes.set(xlabel="time [s]", title="(e) what it descends on")
    axes.legend(fontsize=8, loc="upper left", ncols=2)


def _plane(axes: Axes, runs: Mapping[FeedForward, ObserverRun]) -> None:
    for feedforward in PAIR:
        run = runs[feedforward]
        axes.plot(run.z[:, 0], run.z[:, 1], color=COLOUR[feedforward], lw=1.2)
        axes.plot(*run.z[0, :2], "o", ms=4.5, color=COLOUR[feedforward])
    truth = runs["s"].z_true
    axes.plot(truth[:, 0], truth[:, 1], color=TRUTH, lw=1.6, ls=(0, (4, 2)))
    axes.plot(*truth[0, :2], "o", ms=4.5, color=TRUTH)
    axes.set(xlabel="$s_1$ [rad]", ylabel="$s_2$ [rad]", title="(f) in Z, with 5 % range noise (C.7)")
    _legend(axes, columns=1)


def _noise_errors(axes: Axes, runs: Mapping[FeedForward, ObserverRun]) -> None:
    for feedforward, run in runs.items():
        axes.plot(run.t, run.position, color=COLOUR[feedforward], lw=1.5)
        axes.plot(run.t, np.abs(run.error[:, 2]), color=COLOUR[feedforward], lw=0.9, ls=":")
    for label, style in (("position [m]", "-"), ("heading [rad]", ":")):
        axes.plot([], [], color=INK, ls=style, lw=1.4, label=label)
    _log(axes, (1e-4, 30.0))
    _at_the_end(axes, {f: run.position for f, run in runs.items()}, runs["s"].t)
    axes.set(xlabel="time [s]", title="(h) errors with 5 % range noise")
    axes.legend(fontsize=8, loc="upper right", ncols=2)


def _shares(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw the share of runs that keep lock, by input and feed-forward, with the median error."""
    for i, motion in enumerate(MOTIONS):
        for j, feedforward in enumerate(NAMES):
            own = chosen(rows, what=THESIS, motion=motion, feedforward=feedforward)
            share = locked(own) / len(own)
            colour = to_rgb(SHARES(share))
            axes.fill([j, j + 1, j + 1, j], [i, i, i + 1, i + 1], facecolor=colour, edgecolor="white", lw=1.4)
            axes.text(j + 0.5, i + 0.5, f"{share:.0%}\n{median(own):.2g} m", ha="center", va="center", fontsize=8,
                      color=readable_on(colour))  # fmt: skip
    axes.set(xlim=(0, len(NAMES)), ylim=(len(MOTIONS), 0))
    axes.set_xticks(np.arange(len(NAMES)) + 0.5, list(NAMES.values()))
    axes.set_yticks(np.arange(len(MOTIONS)) + 0.5, list(MOTIONS))
    axes.tick_params(length=0)
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_title("(i) lock kept from the thesis' start, and RMS error")


def _by_gain(axes: Axes, rows: Sequence[Row]) -> None:
    for sensors, colour in SET_COLOURS.items():
        found, fast = (by_gain(rows, what, sensors) for what in (DRAWN, FAST))
        axes.plot(list(found), list(found.values()), "o-", color=colour, ms=4)
        axes.plot(list(fast), list(fast.values()), "o--", color=colour, ms=4.5, mfc="white", lw=1.1)
        x, y = (list(fast.items()) or list(found.items()))[-1]
        annotate(axes, sensors, (x, y), (8, {"3": 7, "4": -9}.get(sensors, 0)), va="center", color=colour,
                 weight="bold")  # fmt: skip
    for label, face, style in (("100 readings a second", INK, "-"), ("1000", "white", "--")):
        axes.plot([], [], f"o{style}", color=INK, mfc=face, ms=4, lw=1.1, label=label)
    axes.legend(fontsize=8, loc="lower left")
    axes.axhline(POSITION, color=INK, ls=":", lw=1.1)
    annotate(axes, "above, lock is lost", (3e5, POSITION), (0, 4), ha="right", fontsize=8)
    k = np.array([3.0, 300.0])
    axes.plot(k, 0.03 / k, color=INK, lw=0.9)
    annotate(axes, "1/k", (k[0], 0.03 / k[0]), (-3, -4), ha="right", va="top")
    axes.set(xscale="log", xlabel="gain k = $k_V$ = $k_Q$", ylabel="position error, median RMS [m]",
             title="(j) as printed, by its gain, from the truth", xlim=(0.6, 4e5), yscale="log")  # fmt: skip
    axes.xaxis.set_minor_formatter(NullFormatter())
