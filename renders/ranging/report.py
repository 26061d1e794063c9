"""A run of a robot that localises itself on one page: whether it did, its path, pictures, time histories."""

from __future__ import annotations

import math

from mathnavi.renders import page
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.ranging import figures
from mathnavi.renders.ranging.field_figure import field_figure
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.renders.ranging.shot_list import highlight, verdict
from mathnavi.renders.report import Headline, event_figures, run_page, still_block
from mathnavi.sim.metrics.ranging import HEADING, POSITION


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
    if summary.get("efficiency") is not None:
        tiles["position error over the Cramér-Rao bound"] = page.number(summary["efficiency"])
    symmetric = " The wall is symmetric: errors are those modulo its rotations." if run.curve.symmetry != 1 else ""
    return Headline(title, f"The robot {verdict(run)}.{symmetric}", good, tiles)


def _path_caption(run: RangingRun) -> str:
    words = "The path driven and the estimate, marked at times that are the denser the earlier; on the right its end."
    if run.beliefs.covariance is not None:
        words += " The ellipses are those of three standard deviations."
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
            ("errors", figures.errors_figure(run), "The errors on logarithmic axes; dotted what counts as found."),
            ("bands", figures.bands_figure(run), f"The errors of each coordinate{stated}."),
            ("pose", figures.pose_figure(run), "The pose and the estimate over time."),
        ]
    if beliefs.left is not None and beliefs.left.any():
        words = "How much less than the best each hypothesis explains; a cross where it is dropped."
        drawn.append(("hypotheses", figures.hypotheses_figure(run), words))
    if beliefs.nis is not None:
        words = (
            "The normalised innovation squared over its degrees of freedom, and the normalised error squared: "
            "1 and 3 on average if the filter is consistent, and then within the dotted bounds "
            f"{100.0 * figures.CONFIDENCE:g} % of the time."
        )
        drawn.append(("consistency", figures.consistency_figure(run), words))
    if beliefs.value is not None:
        words = "Vρ is 0 where all rays say that the robot is in the same place, Q where their rates agree."
        drawn.append(("value", figures.value_figure(run), words))
    drawn += [
        ("ranges", figures.ranges_figure(run), _ranges_caption(run)),
        ("inputs", figures.inputs_figure(run), "Speed and turn rate as commanded and as the wheels say."),
    ]
    return [*drawn, *event_figures(run, run.duration)]


def _ranges_caption(run: RangingRun) -> str:
    words = "What each sensor read, and what it would have read without errors."
    more = run.mission.sensors - figures.MOST_SENSORS
    return f"{words} {more} more sensors are not drawn." if more > 0 else words
