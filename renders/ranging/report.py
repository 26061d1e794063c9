"""A run of a robot that localises itself on one page: whether it did, its path, pictures, time histories."""

from __future__ import annotations

import math

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import chi2

from mathnavi.interfaces.signals import Array
from mathnavi.models.angles import wrapped
from mathnavi.renders import page
from mathnavi.renders.figures import BOUND, INK, STYLE, canvas, thinned
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.renders.ranging.beliefs import FADED
from mathnavi.renders.ranging.drawing import decided, highlight, verdict
from mathnavi.renders.ranging.field_figure import field_figure
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.renders.report import Headline, event_figures, innovation_figures, run_page, still_block
from mathnavi.sim.metrics.ranging import HEADING, POSITION

DRIVEN, ESTIMATE, HYPOTHESIS, READ = (
    hexadecimal(COLOURS[part])
    for part in (SceneElement.DRIVEN, SceneElement.ESTIMATE, SceneElement.HYPOTHESIS, SceneElement.RAY)
)
FIRST = 2.5  # times as long as until it was decided is shown enlarged
SMALLEST = 1e-12  # [m], [deg] that a logarithmic axis shows
CONFIDENCE = 0.95
_TAILS = (0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE))
WINDOW = 50  # updates over which NIS is averaged
MOST_SENSORS = 8  # whose ranges are drawn
DOTS = 400  # readings drawn of each sensor
MARGIN = 1.25  # of what an axis has to show


def report(run: RangingRun) -> Markup:
    """Return the report's HTML."""
    config = run.log.config
    title = f"{config['scenario']}, {run.curve.name}, seed {config['seed']}"
    path = page.section("The path", page.figure_block(field_figure(run), "path", _path_caption(run)))
    course = page.section("The run", *page.figure_blocks(_figures(run)))
    return run_page(run, _headline(run, title), (path, *_pictures(run)), (course,))


def _headline(run: RangingRun, title: str) -> Headline:
    summary = run.log.summary
    good = bool(summary.get("converged")) and not summary.get("touched_wall")
    tiles: dict[str, object] = {
        "converged": bool(summary.get("converged")),
        f"position RMS, last quarter (allowed {POSITION:g} m)": quantity(
            "position_rms_m", summary.get("position_rms_m")
        ),
        f"heading RMS, last quarter (allowed {math.degrees(HEADING):.1f} deg)": quantity(
            "heading_rms_deg", summary.get("heading_rms_deg")
        ),
        "found itself after": quantity("convergence_time_s", summary.get("convergence_time_s")),
    }
    if summary.get("nees_mean") is not None:
        tiles["mean NEES, last quarter (3 if consistent)"] = page.number(summary["nees_mean"])
    if "beacon_places" in summary:
        tiles["beacons at unknown places"] = summary["beacon_places"]
    if summary.get("efficiency") is not None:
        tiles["position error over the Cramér-Rao bound"] = page.number(summary["efficiency"])
    symmetric = " The wall is symmetric: errors are those modulo its rotations." if run.symmetry != 1 else ""
    after = summary.get("convergence_time_s") if summary.get("converged") else None
    late = "" if after is None else f" after {quantity('convergence_time_s', after)}"
    return Headline(f"{title}: {verdict(run)}{late}", f"The robot {verdict(run)}.{symmetric}", good, tiles)


def _path_caption(run: RangingRun) -> str:
    words = "The path driven and the estimate, marked at times that are the denser the earlier; on the right its end."
    if run.beliefs.covariance is not None:
        words += " The ellipses are those of three standard deviations."
    if run.beacon_beliefs is not None:
        words += " A cross with an ellipse is where a beacon at an unknown place is estimated in the end."
    if run.image:
        words += " The estimate follows the dashed path, from the poses along which the robot would read the same."
    return words


def _pictures(run: RangingRun) -> list[Markup]:
    moment, later = sum(highlight(run)) / 2.0, 0.5 * run.duration
    return [
        still_block(
            run.directory, "top", moment, f"The robot in its field from above, {moment:.2f} s after its start.",
            f"After {moment:.2f} s: the robot, its rays, and the poses at which its estimator sees it.",
        ),
        still_block(
            run.directory, "chase", later, f"The robot from behind, {later:.1f} s after its start.",
            f"After {later:.1f} s, from behind the robot.",
        ),
    ]  # fmt: skip


def _figures(run: RangingRun) -> list[Drawn]:
    beliefs = run.beliefs
    drawn: list[Drawn] = []
    stated = "" if beliefs.covariance is None else ", and the bands in which the estimator expects them"
    if run.initialised.any():
        drawn += [
            ("errors", errors_figure(run), "The errors on logarithmic axes; dotted what counts as found."),
            ("bands", bands_figure(run), f"The errors of each coordinate{stated}."),
            ("pose", pose_figure(run), "The pose and the estimate over time."),
        ]
    if beliefs.left is not None and beliefs.left.any():
        words = "How much less than the best each hypothesis explains; a cross where it is dropped."
        drawn.append(("hypotheses", hypotheses_figure(run), words))
    if beliefs.nis is not None:
        words = (
            "The normalised innovation squared over its degrees of freedom, and the normalised error squared: "
            "1 and 3 on average if the filter is consistent, and then within the dotted bounds "
            f"{100.0 * CONFIDENCE:g} % of the time."
        )
        drawn.append(("consistency", consistency_figure(run), words))
    else:
        drawn += innovation_figures(run.log.arrays, run.duration)
    if beliefs.value is not None:
        words = "Vρ is 0 where all rays say that the robot is in the same place, Q where their rates agree."
        drawn.append(("value", value_figure(run), words))
    drawn += [
        ("ranges", ranges_figure(run), _ranges_caption(run)),
        ("inputs", inputs_figure(run), "Speed and turn rate as commanded and as the wheels say."),
    ]
    return [*drawn, *event_figures(run, run.duration)]


def _ranges_caption(run: RangingRun) -> str:
    words = "What each sensor read, and what it would have read without errors."
    more = run.mission.sensors - MOST_SENSORS
    return f"{words} {more} more sensors are not drawn." if more > 0 else words


def errors_figure(run: RangingRun) -> Figure:
    """Errors of position and heading on a logarithmic axis, at the start and over the whole run."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 4.4)
        drawn = figure.subplots(2, 2, sharex="col", sharey="row", width_ratios=(1.0, 1.7))
        first = min(FIRST * decided(run), run.duration)
        rows = (
            (run.position_error, 0, 1.0, POSITION, "position [m]"),
            (run.heading_error, 1, 180.0 / math.pi, HEADING, "heading [deg]"),
        )
        for axes, (error, part, factor, limit, name) in zip(drawn, rows, strict=True):
            for panel, end in zip(axes, (first, run.duration), strict=True):
                _draw_error(panel, run, factor * error, part, factor, end)
                panel.axhline(factor * limit, color=BOUND, ls=":", lw=1.1)
                panel.set(yscale="log", xlim=(0.0, end))
            small = factor * error[run.initialised & (error > 0.0)]
            if len(small):
                axes[0].set_ylim(bottom=min(0.4 * float(np.quantile(small, 0.05)), 0.7 * factor * limit))
            axes[0].set_ylabel(name)
            axes[1].annotate("found itself below", (1.0, factor * limit), (-2, 3), ha="right", color=BOUND,
                             xycoords=("axes fraction", "data"), textcoords="offset points")  # fmt: skip
        drawn[0, 0].set_title("Errors: at the start")
        drawn[0, 1].set_title("over the whole run")
        drawn[0, 1].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
        for panel in drawn[1]:
            panel.set_xlabel("time [s]")
    return figure


def _draw_error(axes: Axes, run: RangingRun, error: Array, part: int, factor: float, end: float) -> None:
    """``part`` 0 is the position and 1 the heading, whose deviations are shown times ``factor``."""
    shown = np.flatnonzero(run.initialised & (run.beliefs.t <= end))
    i = shown[thinned(len(shown), 0)] if len(shown) else shown
    t = run.beliefs.t[i]
    axes.plot(t, np.maximum(error[i], SMALLEST), color=INK, lw=1.1, label="error")
    if run.deviation is not None:
        axes.plot(t, 3.0 * factor * run.deviation[part][i], color=ESTIMATE, lw=1.4, label="3σ as the estimator says")
    if run.least_deviation is not None:
        least = factor * run.least_deviation[part][i]
        axes.plot(t, least, color=BOUND, lw=1.1, label="σ of the Cramér-Rao bound")


def bands_figure(run: RangingRun) -> Figure:
    """The errors of each coordinate once it was found, with bands of three standard deviations."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 4.6)
        drawn = figure.subplots(3, 1, sharex=True)
        begin = run.found if run.found is not None else decided(run)
        late = np.flatnonzero(run.initialised & (run.beliefs.t >= begin))
        P = run.beliefs.covariance
        for row, (axes, name, factor) in enumerate(
            zip(drawn, ("x₁ [cm]", "x₂ [cm]", "φ [deg]"), (1e2, 1e2, 180.0 / math.pi), strict=True)
        ):
            i = late[thinned(len(late), 0)] if len(late) else late
            t, error = run.beliefs.t[i], factor * run.difference[i, row]
            axes.axhline(0.0, color=INK, lw=0.6)
            axes.plot(t, error, color=INK, lw=1.0, label="error")
            sizes = np.abs(error)
            if P is not None and len(i):
                band = 3.0 * factor * np.sqrt(np.maximum(P[i, row, row], 0.0))
                axes.fill_between(t, -band, band, color=ESTIMATE, alpha=0.2, lw=0, label="±3σ")
                sizes = np.maximum(sizes, band)
            if len(i):
                settled = sizes[np.linspace(0, len(i) - 1, len(i)) >= 0.1 * len(i)]
                reach = MARGIN * float(np.nanmax(settled)) if len(settled) else 1.0
                axes.set_ylim(-max(reach, 1e-6), max(reach, 1e-6))
            axes.set_ylabel(name)
        drawn[0].set_title("Errors of each coordinate, once it was found" if run.found is not None else "Errors")
        drawn[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
        drawn[-1].set(xlabel="time [s]", xlim=(begin, run.duration))
    return figure


def pose_figure(run: RangingRun) -> Figure:
    """The pose over time, and the estimate; where that is nearest to an image of the truth at last, that image."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 4.2)
        drawn = figure.subplots(3, 1, sharex=True)
        i = np.flatnonzero(run.initialised)
        i = i[thinned(len(i), 0)] if len(i) else i
        t = run.beliefs.t[i]
        for row, (axes, name, factor) in enumerate(
            zip(drawn, ("x₁ [m]", "x₂ [m]", "φ [deg]"), (1.0, 1.0, 180.0 / math.pi), strict=True)
        ):
            error = run.beliefs.x[i, row] - run.mirrored[i, row]
            if row == 2:
                error = wrapped(error)
            true = factor * run.mirrored[i, row]
            axes.plot(t, true, color=DRIVEN, lw=2.4, label="image of the truth" if run.image else "true")
            axes.plot(t, true + factor * error, color=ESTIMATE, lw=1.4, label="estimate")
            axes.set_ylabel(name)
        drawn[0].set_title("Pose")
        drawn[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
        drawn[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def consistency_figure(run: RangingRun) -> Figure:
    """NIS over its degrees of freedom as a running mean, and NEES, with what they keep if the filter is consistent."""
    with matplotlib.rc_context(STYLE):
        stated = run.beliefs.covariance is not None
        figure = canvas(9.4, 4.4 if stated else 2.8)
        drawn = np.atleast_1d(figure.subplots(1 + stated, 1, sharex=True))
        _draw_nis(drawn[0], run)
        if stated:
            _draw_nees(drawn[1], run)
        drawn[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def _draw_nees(axes: Axes, run: RangingRun) -> None:
    i = np.flatnonzero(run.initialised & np.isfinite(run.nees))
    i = i[thinned(len(i), 0)] if len(i) else i
    axes.plot(run.beliefs.t[i], np.maximum(run.nees[i], SMALLEST), color=INK, lw=1.1)
    for share in _TAILS:
        axes.axhline(chi2.ppf(share, 3), color=BOUND, ls=":", lw=1.2)
    axes.set(ylabel="NEES", yscale="log")
    if len(i):
        axes.set_ylim(bottom=min(0.1, max(float(np.quantile(run.nees[i], 0.02)), SMALLEST)))


def _draw_nis(axes: Axes, run: RangingRun) -> None:
    nis = run.beliefs.nis
    axes.set(ylabel="NIS / degrees of freedom", title="Consistency", ylim=(0.0, 3.0))
    if nis is None:
        return
    known = np.isfinite(nis).all(axis=1) & (nis[:, 1] > 0.0)
    t, value, freedom = run.beliefs.t[known], nis[known, 0], nis[known, 1]
    if len(t) < WINDOW:
        return
    i = thinned(len(t), 0)
    axes.plot(t[i], (value / freedom)[i], ".", ms=2.0, color=ESTIMATE, alpha=0.35, label="NIS of each update")
    ones = np.ones(WINDOW)
    total, degrees = np.convolve(value, ones, "valid"), np.convolve(freedom, ones, "valid")
    k = thinned(len(total), 0)
    at, mean = t[WINDOW - 1 :][k], (total / degrees)[k]
    for share in _TAILS:
        axes.plot(at, chi2.ppf(share, degrees[k]) / degrees[k], color=BOUND, ls=":", lw=1.2)
    axes.plot(at, mean, color=INK, lw=1.3, label=f"mean of {WINDOW}")
    axes.set_ylim(0.0, max(3.0, 1.2 * float(np.quantile(mean, 0.98))))
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2, markerscale=4.0)


def hypotheses_figure(run: RangingRun) -> Figure:
    """Log-likelihood of each hypothesis less that of the best one, until it is dropped."""
    scores, left = run.beliefs.scores, run.beliefs.left
    assert scores is not None
    assert left is not None
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 3.0)
        axes = figure.add_subplot()
        changes = np.flatnonzero(np.diff(left)) + 1
        end = min(1.15 * float(run.beliefs.t[changes[-1]]) + 0.1, run.duration) if len(changes) else run.duration
        shown = np.flatnonzero(run.beliefs.t <= end)
        i = shown[thinned(len(shown), 0)]
        t = run.beliefs.t[i]
        for column in scores[i].T:
            known = np.flatnonzero(np.isfinite(column))
            if len(known):
                survives = known[-1] == len(column) - 1
                axes.plot(t, column, color=ESTIMATE if survives else HYPOTHESIS, lw=1.6 if survives else 1.0)
                if not survives:
                    axes.plot(t[known[-1]], column[known[-1]], "x", ms=6, mew=1.6, color=HYPOTHESIS)
        axes.set(xlabel="time [s]", ylabel="log-likelihood below the best", xlim=(0.0, end), ylim=(-1.1 * FADED, 1.0))
        axes.set_title("Hypotheses")
    return figure


def inputs_figure(run: RangingRun) -> Figure:
    """Commands of the drive, and the odometry's measurements."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 3.4)
        drawn = figure.subplots(2, 1, sharex=True)
        i, few = thinned(len(run.t), 0), np.linspace(0, len(run.t) - 1, min(DOTS, len(run.t))).astype(int)
        limits = (run.mission.speed_max, run.mission.turn_rate_max)
        for row, (axes, name) in enumerate(zip(drawn, ("u₁ [m/s]", "u₂ [rad/s]"), strict=True)):
            axes.plot(run.t[few], run.odometry[few, row], ".", ms=2.6, color=READ, label="odometry")
            axes.step(run.t[i], run.log.u[i, row], where="post", color=DRIVEN, lw=1.4, label="command")
            largest = float(np.abs(run.log.u[:, row]).max())
            if largest > 0.7 * limits[row]:
                for side in (limits[row], -limits[row]):
                    axes.axhline(side, color=BOUND, ls=":", lw=1.1)
            axes.set_ylabel(name)
        drawn[0].set_title("Inputs")
        drawn[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
        drawn[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def ranges_figure(run: RangingRun) -> Figure:
    """Draw the true ranges and the readings."""
    with matplotlib.rc_context(STYLE):
        shown = min(run.mission.sensors, MOST_SENSORS)
        figure = canvas(9.4, 0.6 + 1.15 * shown)
        drawn = np.atleast_1d(figure.subplots(shown, 1, sharex=True))
        i, few = thinned(len(run.t), 0), np.linspace(0, len(run.t) - 1, min(DOTS, len(run.t))).astype(int)
        for row, axes in enumerate(drawn):
            axes.plot(run.t[few], run.ranges[few, row], ".", ms=2.6, color=READ, label="read")
            axes.plot(run.t[i], run.true_ranges[i, row], color=INK, lw=1.1, label="true")
            axes.set_ylabel(f"{math.degrees(run.mission.angles[row]):+.0f}° [m]")
            axes.set_ylim(bottom=0.0)
        drawn[0].set_title("Ranges")
        drawn[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
        drawn[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def value_figure(run: RangingRun) -> Figure:
    """V_rho and |Q|^2 / 2, which the observer (C.5) descends."""
    value = run.beliefs.value
    assert value is not None
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 2.8)
        axes = figure.add_subplot()
        i = thinned(len(run.beliefs.t), 0)
        for row, (name, colour) in enumerate((("Vρ [m²]", ESTIMATE), ("|Q|²/2 [m⁴/s²]", HYPOTHESIS))):
            positive = np.where(value[i, row] > 0.0, value[i, row], np.nan)
            axes.plot(run.beliefs.t[i], positive, color=colour, lw=1.2, label=name)
        axes.set(xlabel="time [s]", xlim=(0.0, run.duration), yscale="log", title="What the observer makes small")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.2)
    return figure
