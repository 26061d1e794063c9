"""A fleet's run on one page: who arrived when and how near to each other, on the map, over time and in the scene."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from mathnavi.interfaces.signals import Array
from mathnavi.renders import page
from mathnavi.renders.figures import (
    BOUND,
    INK,
    LOWEST_DRAWN,
    STYLE,
    canvas,
    draw_map,
    log_lengths,
    name_place,
    name_to_the_left,
    thinned,
)
from mathnavi.renders.fleet.drawing import highlight, verdict
from mathnavi.renders.fleet.run_data import FleetRun
from mathnavi.renders.fleet.scene import fleet_scene
from mathnavi.renders.flight.report import draw_changes
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.palette import hexadecimal
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.renders.report import Headline, event_figures, run_page, solve_figures, still_block, why
from mathnavi.renders.web.document import scene_block
from mathnavi.sim.records.figure_names import SHORTFALL

_FEWEST_COLUMNS, _MOST_ROWS = 4, 4  # of a legend


def report(run: FleetRun) -> Markup:
    """Return the report's HTML."""
    opening = (
        _scene(run),
        *_pictures(run),
        page.section("The vehicles", _vehicles(run)),
        page.section("The flight", *page.figure_blocks(_figures(run))),
    )
    return run_page(run, _headline(run), opening, by_vehicle=True)


def _headline(run: FleetRun) -> Headline:
    summary, least = run.summary, run.flights[0].mission.clearance_min
    shown = {
        key: quantity(key, summary.get(key))
        for key in ("spread_s", "arrival_time_s", "deadline_s", "separation_min_m", "min_clearance_m")
    }
    pair = f", {summary['nearest_pair']}" if summary.get("nearest_pair") else ""
    tiles = {
        "between the first and the last arrival": shown["spread_s"],
        f"last arrival (deadline {shown['deadline_s']})": shown["arrival_time_s"],
        f"least separation (allowed {run.separation:g} m{pair})": shown["separation_min_m"],
        f"least clearance (allowed {least:g} m)": shown["min_clearance_m"],
        "plans not admitted by the others": page.number(summary.get("plans_not_admitted")),
    }
    apart = summary.get("separation_min_m")
    nearest = "" if apart is None else f"; least separation {quantity('separation_min_m', apart)}"
    title = f"{run.title}: {verdict(run)}{nearest}"
    return Headline(title, f"Of the fleet {verdict(run)}{why(summary)}.", SHORTFALL not in summary, tiles)


def _scene(run: FleetRun) -> Markup:
    scene = fleet_scene(run)
    label = f"The flights over {run.terrain.name} in three dimensions, with starts, slots and radars"
    return scene_block(scene, label, f"{run.terrain.name}; {scene.note}.")


def _pictures(run: FleetRun) -> list[Markup]:
    middle, way = sum(highlight(run)) / 2.0, 0.6 * run.duration
    return [
        still_block(
            run.directory, "overview", way,
            f"The map of {run.terrain.name} about the fleet, seen from the south, with the fleet on its way.",
            f"On the way, at {way:.0f} s: path flown, plan ahead. Heights are drawn {EXAGGERATION} times "
            "as tall as they are, the vehicles far larger.",
        ),
        still_block(
            run.directory, "arrival", middle, "The slots and the vehicles that come to them.",
            f"The arrival, at {middle:.0f} s: every vehicle has a slot of its own. Both are drawn larger than life.",
        ),
    ]  # fmt: skip


def _vehicles(run: FleetRun) -> Markup:
    refused = Counter(event.agent for event in run.events if event.kind == "not-admitted")
    rows = []
    for (name, flight), arrival in zip(run.vehicles.items(), run.arrivals.tolist(), strict=True):
        straight = math.dist(flight.mission.start, flight.mission.target)
        rows.append(
            (
                name,
                page.UNKNOWN if math.isnan(arrival) else f"{arrival:.2f} s",
                f"{straight / 1e3:.1f} km",
                f"{flight.travelled[-1] / 1e3:.1f} km",
                f"{flight.travelled[-1] / flight.duration:.0f} m/s",
                len(flight.log.plans),
                refused[name],
            )
        )
    head = ("vehicle", "arrival", "straight line", "path flown", "mean speed", "plans adopted", "plans not admitted")
    return page.card(page.table(head, rows))


def _figures(run: FleetRun) -> list[Drawn]:
    separation = quantity("separation_min_m", run.summary.get("separation_min_m"))
    clearance = quantity("min_clearance_m", run.summary.get("min_clearance_m"))
    drawn = [
        ("map", map_figure(run), f"Map of {run.terrain.name} with all paths, and the slots from above."),
        (
            "to-go",
            to_go_figure(run),
            "Distance of every vehicle to its slot: they start far apart and arrive at one time. Dashed: the time that "
            "they agreed on last.",
        ),
        (
            "separation",
            separation_figure(run),
            f"Distance of every vehicle to the nearest other one; the least is {separation}. Log scale.",
        ),
        (
            "clearance",
            clearance_figure(run),
            f"Heights of every vehicle; the least clearance is {clearance}, on the exact triangles. The clearance has "
            "a log scale.",
        ),
    ]
    return [*drawn, *solve_figures(run.summary), *event_figures(run, run.duration, ", of all vehicles")]


def map_figure(run: FleetRun) -> Figure:
    """Draw the hill-shaded map with all paths, and next to it the slots with the paths that reach them."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 6.9)
        whole, close = figure.subplots(1, 2, width_ratios=(1.6, 1.0))
        flown = [flight.x[:, :2] for flight in run.flights]
        draw_map(whole, run.terrain, np.vstack([*flown, run.slots[:, :2]]))
        draw_changes(whole, run.flights[0])
        outline = [patheffects.withStroke(linewidth=3.0, foreground="white", alpha=0.85)]
        for number, (flight, colour, name) in enumerate(_each(run), start=1):
            path = flight.x[thinned(len(run.t), 0), :2] / 1e3
            whole.plot(*path.T, color=colour, lw=1.8, label=name, path_effects=outline)
            whole.plot(*path[0], "o", ms=6, mfc=colour, mec="#101824")
            left = name_to_the_left(whole, path[0, 0])
            name_place(
                whole, str(number), (path[0, 0], path[0, 1]), (-7 if left else 7, 0), "right" if left else "left"
            )
        middle = run.slots[:, :2].mean(axis=0) / 1e3
        reach = _slots(close, run, middle) / 1e3
        corner = middle - reach
        whole.add_patch(Rectangle((corner[0], corner[1]), 2.0 * reach, 2.0 * reach, fill=False, ec="#101824", lw=1.4))
        whole.set_title(f"Paths over {run.terrain.name}")
        close.set_title("The slots")
        figure.legend(*whole.get_legend_handles_labels(), loc="outside lower center", ncols=_columns(run))
    return figure


def _slots(axes: Axes, run: FleetRun, middle: Array) -> float:
    """Paths about the slots, as seen from above; circles are the arrival radius. Half the side [m] of what is shown."""
    slots = [1e3 * (flight.mission.target[:2] / 1e3 - middle) for flight in run.flights]
    reach = 1.7 * max(float(np.abs(each).max()) for each in slots) + 100.0
    angle = np.linspace(0.0, 2.0 * np.pi, 73)
    for place, (flight, colour, _) in zip(slots, _each(run), strict=True):
        path = flight.x[:, :2] - 1e3 * middle
        shown = np.flatnonzero((np.abs(path) < 3.0 * reach).all(axis=1))
        if len(shown):
            near = np.arange(shown[0], len(path))
            axes.plot(*path[near[thinned(len(near), 0)]].T, color=colour)
        radius = flight.mission.arrival_radius
        axes.plot(place[0] + radius * np.cos(angle), place[1] + radius * np.sin(angle), color=colour, lw=1.0)
        axes.plot(*place, "o", ms=7, mfc="none", mec=colour)  # however large the fleet
    axes.set(xlabel="east [m]", ylabel="north [m]", xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    return reach


def to_go_figure(run: FleetRun) -> Figure:
    """Distance of every vehicle to its slot: over the whole time, and in the last seconds."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 4.4)
        whole, end = figure.subplots(1, 2, width_ratios=(1.5, 1.0))
        begin = _last_seconds(run)
        late = np.flatnonzero(run.t >= begin)
        for flight, colour, name in _each(run):
            distance = np.linalg.norm(flight.x[:, :3] - flight.mission.target, axis=1)
            i = thinned(len(run.t), 0)
            whole.plot(run.t[i], distance[i] / 1e3, color=colour, label=name)
            k = late[thinned(len(late), 0)]
            end.plot(run.t[k], distance[k], color=colour)
        radius = run.flights[0].mission.arrival_radius
        end.axhline(radius, color=BOUND, ls=":", lw=1.0)
        end.annotate(f"arrived within {radius:g} m", (0.02, radius), (0, 3), xycoords=("axes fraction", "data"),
                     textcoords="offset points", color=BOUND)  # fmt: skip
        agreed = run.agreed(run.duration)
        if np.isfinite(agreed).any():
            last = float(np.nanmax(agreed))
            for axes in (whole, end):
                axes.axvline(last, color=INK, ls="--", lw=0.9)
            whole.annotate(
                f"agreed {last:.1f} s", (last, 0.97), (-4, 0), xycoords=("data", "axes fraction"),
                textcoords="offset points", ha="right", va="top",
            )  # fmt: skip
        whole.set(xlabel="time [s]", ylabel="to the slot [km]", title="Distance to go", xlim=(0.0, 1.01 * run.duration))
        whole.set_ylim(0.0)
        end.set(xlabel="time [s]", ylabel="to the slot [m]", title="The last seconds")
        end.set_xlim(begin, run.duration + 0.02 * (run.duration - begin))
        end.set_ylim(0.0)
        figure.legend(*whole.get_legend_handles_labels(), loc="outside lower center", ncols=_columns(run))
    return figure


def separation_figure(run: FleetRun) -> Figure:
    """Distance of every vehicle to the nearest other one, over time, with the least one allowed."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 3.4)
        axes = figure.add_subplot()
        least = run.neighbours.min(axis=0)
        lowest = int(np.argmin(least))
        i = thinned(len(run.t), lowest)
        for row, (_, colour, name) in zip(run.neighbours, _each(run), strict=True):
            axes.plot(run.t[i], np.maximum(row[i], LOWEST_DRAWN), color=colour, lw=1.1, label=name)
        _bound(axes, run.separation, "allowed")
        _mark(axes, run, lowest, max(float(least[lowest]), LOWEST_DRAWN), "separation_min_m")
        log_lengths(axes, max(0.6 * min(run.separation, float(least[lowest])), LOWEST_DRAWN))
        axes.set(xlabel="time [s]", ylabel="to the nearest other [m]", xlim=(0.0, run.duration))
        axes.set_title("Separation")
    return figure


def clearance_figure(run: FleetRun) -> Figure:
    """Heights above sea level and above the ground of every vehicle over time."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 5.0)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.2))
        above = np.array([flight.above_ground for flight in run.flights])
        known = np.where(np.isfinite(above), above, np.inf)
        lowest = int(np.argmin(known.min(axis=0)))
        i = thinned(len(run.t), lowest)
        for (flight, colour, _), heights in zip(_each(run), above, strict=True):
            upper.plot(run.t[i], flight.x[i, 2], color=colour)
            lower.plot(run.t[i], np.maximum(heights[i], LOWEST_DRAWN), color=colour)
        least, found = run.flights[0].mission.clearance_min, float(known.min())
        _bound(lower, least, "least height")
        if np.isfinite(found):
            _mark(lower, run, lowest, max(found, LOWEST_DRAWN), "min_clearance_m")
        log_lengths(lower, max(0.6 * min(least, found), LOWEST_DRAWN))
        upper.set(ylabel="height [m]", title="Heights above sea level and above the ground")
        lower.set(xlabel="time [s]", ylabel="clearance [m]", xlim=(0.0, run.duration))
    return figure


def _each(run: FleetRun) -> Sequence[tuple[FlightRun, str, str]]:
    """Flight, colour and name of every vehicle."""
    colours = [hexadecimal(colour) for colour in run.colours]
    return list(zip(run.flights, colours, run.vehicles, strict=True))


def _columns(run: FleetRun) -> int:
    return max(min(len(run.flights), _FEWEST_COLUMNS), -(-len(run.flights) // _MOST_ROWS))


def _last_seconds(run: FleetRun) -> float:
    """[s] from when on the last seconds are shown: a third of what the arrival's camera shows."""
    begin, end = highlight(run)
    return end - (end - begin) / 3.0


def _bound(axes: Axes, value: float, name: str) -> None:
    axes.axhline(value, color=BOUND, ls=":", lw=1.2)
    axes.annotate(f"{name} {value:g} m", (1.0, value), (0, 3), xycoords=("axes fraction", "data"),
                  textcoords="offset points", ha="right", color=BOUND)  # fmt: skip


def _mark(axes: Axes, run: FleetRun, k: int, value: float, key: str) -> None:
    """Mark the least of all samples, with the figure of the summary."""
    recorded = run.summary.get(key)
    late = run.t[k] > 0.8 * run.duration  # the label would leave the axes
    axes.plot(run.t[k], value, "o", ms=4.0, color=INK)
    axes.annotate(
        f"least {value if recorded is None else recorded:.1f} m", (float(run.t[k]), value), (-8 if late else 8, 0),
        textcoords="offset points", ha="right" if late else "left", va="center",
    )  # fmt: skip
