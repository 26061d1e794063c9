"""Report of a flight on one page: the overview if OpenGL is available, and a terrain that can be turned."""

from __future__ import annotations

from dataclasses import replace

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from mathnavi.interfaces.signals import Array
from mathnavi.renders import figures, page
from mathnavi.renders.figures import (
    BOUND,
    GROUND,
    INK,
    LOWEST_DRAWN,
    STYLE,
    canvas,
    colour_of,
    draw_map,
    log_lengths,
    name_place,
    name_to_the_left,
    thinned,
)
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.flight.scene import flight_scene
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.renders.report import (
    Headline,
    event_figures,
    innovation_figures,
    run_page,
    solve_figures,
    still_block,
    why,
)
from mathnavi.renders.scene.landscape import first_plan
from mathnavi.renders.web.document import scene_block
from mathnavi.sim.records.figure_names import SHORTFALL


def report(run: FlightRun) -> Markup:
    """Return the report's HTML."""
    flight = page.section("The flight", *page.figure_blocks(_figures(run)))
    return run_page(run, _headline(run), (_scene(run), _overview(run)), (flight,))


def _headline(run: FlightRun) -> Headline:
    summary, mission = run.summary, run.mission
    arrived, clearance = bool(summary.get("arrived")), summary.get("min_clearance_m")
    safe = clearance is not None and clearance >= mission.clearance_min and not summary.get("ground_contacts")
    verdict = ("arrived" if arrived else "did not arrive") + (
        f", never below {mission.clearance_min:g} m over the ground" if safe else ", and came too close to the ground"
    )
    shown = {key: quantity(key, summary.get(key)) for key in ("deadline_s", "min_clearance_m", "radar_exposure_s")}
    tiles = {
        "arrival": quantity("arrival_time_s", summary.get("arrival_time_s") if arrived else None),
        "deadline": shown["deadline_s"],
        f"least clearance (allowed {mission.clearance_min:g} m)": shown["min_clearance_m"],
        "path flown": f"{run.travelled[-1] / 1e3:.2f} km",
        "radar exposure": shown["radar_exposure_s"],
    }
    if "beacon_places" in summary:
        tiles["beacons at unknown places"] = summary["beacon_places"]
    good = arrived and safe and SHORTFALL not in summary
    return Headline(
        f"{run.title}: {found(run, run.above_ground)}", f"The vehicle {verdict}{why(summary)}.", good, tiles
    )


def found(run: FlightRun, clearance: Array) -> str:
    """Return the outcome of a flight in a few words; the time of its least clearance is that of ``clearance`` (n,)."""
    summary = run.summary
    arrived = (
        f"arrived after {run.duration:.1f} s" if summary.get("arrived") else f"not arrived in {run.duration:.1f} s"
    )
    if summary.get("min_clearance_m") is None or not np.isfinite(clearance).any():
        return arrived
    least = quantity("min_clearance_m", summary["min_clearance_m"])
    return f"{arrived}; least clearance {least} at {run.t[np.nanargmin(clearance)]:.0f} s"


def _scene(run: FlightRun) -> Markup:
    scene = flight_scene(run)
    label = f"The flight over {run.terrain.name} in three dimensions, with the first plan, radars, start and target"
    note = " Radars weigh on the optimised part of a plan only; its way to rest may lead through one."
    caption = f"{run.terrain.name}; {scene.note}.{note if run.mission.radars else ''}"
    return scene_block(replace(scene, lines=[*scene.lines, *first_plan(run.log.plans)]), label, caption)


def _overview(run: FlightRun) -> Markup:
    return still_block(
        run.directory,
        "overview",
        run.duration,
        f"The map of {run.terrain.name} about the flight, seen from the south, with the path from start to target.",
        f"The end of the flight. Heights are drawn {EXAGGERATION} times as tall as they are, the vehicle far larger.",
    )


def _figures(run: FlightRun) -> list[Drawn]:
    least = quantity("min_clearance_m", run.summary.get("min_clearance_m"))
    drawn = [
        (
            "map",
            map_figure(run),
            f"Hill-shaded map of {run.terrain.name} about the path, with radars, start and target.{_shorter(run)}",
        ),
        (
            "profile",
            profile_figure(run),
            f"Height of the path and of the ground along it; the least clearance is {least}, on the exact triangles. "
            "The clearance has a log scale.",
        ),
        ("motion", motion_figure(run), "Speed and commanded acceleration over time with their bounds."),
    ]
    if run.log.plans:
        drawn.append(
            (
                "cost",
                figures.cost_figure(run.log.plans, run.log.adopted, run.duration),
                "Composite cost of the plan being flown, over time.",
            )
        )
    if len(run.mission.beacons) and {"estimate.innovations", "estimate.left_out"} <= run.log.arrays.keys():
        drawn.append(
            (
                "beacons",
                beacons_figure(run),
                "Error of the estimated position with three of its standard deviations, and innovations of the "
                "readings over theirs; a beacon that is left out has none.",
            )
        )
    else:
        drawn += innovation_figures(run.log.arrays, run.duration)
    return [*drawn, *solve_figures(run.summary), *event_figures(run, run.duration)]


def _shorter(run: FlightRun) -> str:
    """Sentence on why the path is shorter than the straight line to the target; "" where it is not."""
    straight = run.summary.get("straight_line_m")
    if straight is None or run.travelled[-1] >= straight or not run.summary.get("arrived"):
        return ""
    return (
        f" The flight ends within {run.mission.arrival_radius:g} m of the target, which counts as arrival, so its path "
        "is shorter than the straight line to the target."
    )


def map_figure(run: FlightRun) -> Figure:
    """The hill-shaded map with the path flown, the first plan, radars, start and target."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(7.6, 7.2)
        axes = figure.add_subplot()
        ends = np.vstack([run.mission.start, run.mission.target, run.mission.target_at(run.duration)])[:, :2]
        draw_map(axes, run.terrain, np.vstack([run.x[:, :2], ends, run.mission.beacons[:, :2]]))
        outline = [patheffects.withStroke(linewidth=3.4, foreground="white", alpha=0.85)]
        draw_changes(axes, run)
        draw_beacons(axes, run)
        if run.log.plans:
            first = run.log.plans[0]
            axes.plot(
                first.x[:, 0] / 1e3, first.x[:, 1] / 1e3, "--", color=colour_of(SceneElement.COMPLETION),
                label="first plan, to rest",
                path_effects=[patheffects.withStroke(linewidth=2.6, foreground="white", alpha=0.6)],
            )  # fmt: skip
        i = thinned(len(run.t), 0)
        x, y = run.x[i, :2].T / 1e3
        axes.plot(x, y, color=colour_of(SceneElement.FLOWN), lw=2.0, label="flown", path_effects=outline)
        for part, place in ((SceneElement.START, run.mission.start), (SceneElement.TARGET, run.mission.target)):
            axes.plot(*place[:2] / 1e3, "o", ms=8, mfc=colour_of(part), mec="#101824", mew=1.4)
            left = name_to_the_left(axes, place[0] / 1e3)
            if part is SceneElement.TARGET and len(run.mission.target_path):
                way = np.vstack([place, run.mission.target_path[:, 1:]])[:, :2] / 1e3
                axes.plot(way[:, 0], way[:, 1], "--", color=colour_of(part), lw=1.6, path_effects=outline)
                axes.plot(*run.mission.target_at(run.duration)[:2] / 1e3, "s", ms=7, mfc=colour_of(part), mec="#101824")
            name_place(
                axes, part.value, (place[0] / 1e3, place[1] / 1e3), (-9 if left else 9, 0), "right" if left else "left"
            )
        axes.set_title(f"Path over {run.terrain.name}")
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=2)
    return figure


def draw_beacons(axes: Axes, run: FlightRun) -> None:
    """The beacons with their numbers on a map [km]."""
    for k, place in enumerate(run.mission.beacons[:, :2] / 1e3):
        axes.plot(*place, "^", ms=8, mfc=colour_of(SceneElement.BEACON), mec="#101824", mew=1.2)
        name_place(axes, f"beacon {k}", (place[0], place[1]), (0, 9), "center")


def draw_changes(axes: Axes, run: FlightRun) -> None:
    """Radars, where they are and where they drive to, and hills that the map did not show, on a map [km]."""
    for number, track in enumerate(run.mission.radars, start=1):
        radar, last = track.radar, track.at(min(track.until, run.duration) - 1e-6, run.terrain)
        centre = (radar.x / 1e3, radar.y / 1e3)
        colour = colour_of(SceneElement.RADAR)
        axes.add_patch(Circle(centre, radar.radius / 1e3, facecolor=colour, alpha=0.25, edgecolor="none"))
        axes.add_patch(Circle(centre, radar.radius / 1e3, fill=False, edgecolor=colour, linewidth=1.2))
        when = "from the start" if track.time <= 0.0 else f"from {track.time:.0f} s"
        until = f" to {track.until:.0f} s" if track.until < run.duration else ""
        name_place(axes, f"radar {number}, {when}{until}", centre, (0, 0), "center")
        if last is not None and (last.x, last.y) != (radar.x, radar.y):
            end = (last.x / 1e3, last.y / 1e3)
            axes.annotate("", end, centre, arrowprops={"arrowstyle": "->", "color": colour, "lw": 1.6})
            axes.add_patch(Circle(end, radar.radius / 1e3, fill=False, edgecolor=colour, lw=1.2, ls="--"))
    for hill in run.mission.hills:
        top = (hill.x / 1e3, hill.y / 1e3)
        axes.add_patch(Circle(top, hill.radius / 1e3, fill=False, edgecolor="white", lw=1.4, ls=":"))
        name_place(axes, f"not on the map until {run.mission.charted_at:.0f} s", top, (0, 0), "center")


def profile_figure(run: FlightRun) -> Figure:
    """Heights of the path and of the ground below it over the distance flown, and the least clearance."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 5.2)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.8))
        known = np.isfinite(run.above_ground)
        lowest = int(np.argmin(np.where(known, run.above_ground, np.inf)))
        i = thinned(len(run.t), lowest)
        i = i[known[i]]
        distance = run.travelled[i] / 1e3
        ground = run.x[i, 2] - run.above_ground[i]
        upper.fill_between(distance, ground.min() - 0.03 * np.ptp(ground) - 1.0, ground, color=GROUND, alpha=0.75, lw=0)
        upper.plot(distance, run.x[i, 2], color=colour_of(SceneElement.FLOWN), label="flown")
        least = run.mission.clearance_min
        upper.plot(distance, ground + least, ":", color=BOUND, lw=1.0, label=f"least height, {least:g} m above ground")
        upper.set(ylabel="height [m]", title="Height over the ground")
        upper.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, frameon=False, borderaxespad=0.2)
        lower.plot(distance, np.maximum(run.above_ground[i], LOWEST_DRAWN), color=colour_of(SceneElement.FLOWN))
        lower.axhline(least, color=BOUND, ls=":", lw=1.0)
        lower.set(xlabel="distance flown [km]", ylabel="clearance [m]")
        log_lengths(lower, max(0.6 * min(least, float(run.above_ground[lowest])), LOWEST_DRAWN))
        lower.set_xlim(distance[0], max(distance[-1], distance[0] + 1e-3))  # it may have stood still
        here = (run.travelled[lowest] / 1e3, max(float(run.above_ground[lowest]), LOWEST_DRAWN))
        late = here[0] > 0.8 * distance[-1]  # the label would leave the axes
        lower.plot(*here, "o", ms=4.0, color=INK)
        lower.annotate(
            f"least {run.summary.get('min_clearance_m', run.above_ground[lowest]):.1f} m", here, (-8 if late else 8, 0),
            textcoords="offset points", ha="right" if late else "left", va="center",
        )  # fmt: skip
    return figure


def beacons_figure(run: FlightRun) -> Figure:
    """Error of the estimated position over time with three deviations, and the innovations of each beacon over theirs,
    with the times at which it was left out.
    """
    arrays = run.log.arrays
    t, x = arrays["estimate.t"], arrays["estimate.x"]
    truth = np.column_stack([np.interp(t, run.t, column) for column in run.x[:, :3].T])
    error = np.linalg.norm(x[:, :3] - truth, axis=1)
    spread = 3.0 * np.linalg.norm(arrays["estimate.deviation"][:, :3], axis=1)
    ratio, n = arrays["estimate.innovations"] / arrays["estimate.innovation_std"], len(run.mission.beacons)
    out = arrays.get("estimate.left_out", np.zeros_like(ratio))[:, :n] > 0.0
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 5.0)
        upper, lower = figure.subplots(2, 1, sharex=True)
        i = thinned(len(t), int(np.nanargmax(error)))
        upper.plot(t[i], error[i], color=colour_of(SceneElement.FLOWN), lw=1.1, label="error")
        upper.plot(t[i], spread[i], ":", color=BOUND, lw=1.2, label="three standard deviations")
        upper.set(ylabel="position [m]", title="Estimate of the position by beacons", ylim=(0.0, None))
        upper.set_ylim(0.0, 1.2 * upper.get_ylim()[1])  # room for the legend
        upper.legend(loc="upper left", ncols=2)
        for row, column in enumerate(ratio.T):  # the numbers of all sensors, each of all beacons
            read, k = np.isfinite(column), row % n
            lower.plot(t[read], k + 0.1 * np.clip(column[read], -5.0, 5.0), color=colour_of(SceneElement.RAY), lw=0.6)
        for k in range(n):
            lower.fill_between(t, k - 0.5, k + 0.5, where=out[:, k], color=BOUND, alpha=0.25, lw=0)
        lower.set(
            xlabel="time [s]", ylabel="beacon", xlim=(0.0, run.duration), yticks=range(n),
            title="Innovations of the readings, ten deviations from one beacon to the next; shaded: left out",
        )  # fmt: skip
    return figure


def motion_figure(run: FlightRun) -> Figure:
    """Speed and commanded acceleration over time against their bounds."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 3.9)
        upper, lower = figure.subplots(2, 1, sharex=True)
        curves = (
            (upper, np.linalg.norm(run.x[:, 3:], axis=1), run.mission.speed_max, "speed [m/s]"),
            (lower, np.linalg.norm(run.u, axis=1), run.mission.acceleration_max, "acceleration [m/s²]"),
        )
        for axes, size, bound, name in curves:
            i = thinned(len(run.t), int(np.argmax(size)))
            axes.plot(run.t[i], size[i], color=colour_of(SceneElement.OPTIMISED), lw=1.1)
            axes.axhline(bound, color=BOUND, ls=":", lw=1.2)
            axes.annotate(f"bound {bound:g}", (1.0, bound), (0, 3), xycoords=("axes fraction", "data"),
                          textcoords="offset points", ha="right", color=BOUND)  # fmt: skip
            axes.set(ylabel=name, ylim=(0.0, 1.15 * max(bound, float(size.max()))))
        upper.set_title("Speed and acceleration against their bounds")
        lower.set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure
