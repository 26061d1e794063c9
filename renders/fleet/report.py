"""A fleet's run on one page: who arrived when and how near to each other, on the map, over time and in the scene."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace

from mathnavi.renders import page
from mathnavi.renders.fleet import figures
from mathnavi.renders.fleet.run_data import FleetRun
from mathnavi.renders.fleet.shot_list import highlight, verdict
from mathnavi.renders.fleet.web import web_scene
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.renders.report import Headline, event_figures, run_page, solve_figures, still_block, why
from mathnavi.renders.web.document import scene_block
from mathnavi.renders.web.elements import Layer, Mark
from mathnavi.sim.records.figure_names import SHORTFALL

MOST_NAMED = 8  # starts that have a name in the scene: of more they hide each other


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
    return Headline(run.title, f"Of the fleet {verdict(run)}{why(summary)}.", SHORTFALL not in summary, tiles)


def _scene(run: FleetRun) -> Markup:
    scene, named = web_scene(run), len(run.vehicles) <= MOST_NAMED
    starts = [
        Mark(name, colour, flight.mission.start, layer=Layer(name, colour))
        for (name, flight), colour in zip(run.vehicles.items(), run.colours, strict=True)
    ]
    label = f"The flights over {run.terrain.name} in three dimensions, with starts, slots and radars"
    scene = replace(scene, marks=[*(starts if named else ()), *scene.marks])
    return scene_block(scene, label, f"{run.terrain.name}; {scene.note}.")


def _pictures(run: FleetRun) -> list[Markup]:
    middle, way = sum(highlight(run)) / 2.0, 0.6 * run.duration
    return [
        still_block(
            run.directory, "overview", way,
            f"The whole map of {run.terrain.name} seen from the south, with the fleet on its way.",
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
        ("map", figures.map_figure(run), f"Map of {run.terrain.name} with all paths, and the slots from above."),
        (
            "to-go",
            figures.to_go_figure(run),
            "Distance of every vehicle to its slot: they start far apart and arrive at one time. Dashed: the time that "
            "they agreed on last.",
        ),
        (
            "separation",
            figures.separation_figure(run),
            f"Distance of every vehicle to the nearest other one; the least is {separation}. Log scale.",
        ),
        (
            "clearance",
            figures.clearance_figure(run),
            f"Heights of every vehicle; the least clearance is {clearance}, on the exact triangles. The clearance has "
            "a log scale.",
        ),
    ]
    return [*drawn, *solve_figures(run.summary), *event_figures(run, run.duration, ", of all vehicles")]
