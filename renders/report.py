"""A run on one page: ``report.html``, which needs nothing beside itself and no network.

The overview is a PNG in the page where OpenGL is at hand, and one line that says how to install it where not; the
terrain that can be turned needs none.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from models.terrain.visibility import Radar
from renders import figures, opengl, page
from renders.page import Markup, quantity
from renders.palette import COLOURS, Part, hexadecimal
from renders.run_data import RunData, described, load_run, plan_arcs
from renders.storyboard import EXAGGERATION
from renders.terrain_view import Track, script, terrain_view
from renders.video import write_still
from sim.log import write_text
from sim.metrics import SUMMARY_GROUPS, label

MOST_EVENTS = 200  # rows of the table; the rest is counted
PLAN_STEP = 0.5  # [s] between the points of a plan that is drawn


def write_report(run_dir: str | Path) -> Path:
    """Write ``report.html`` into the run's folder, whole or not at all, and return its path.

    Raises FileNotFoundError or ValueError for a run that is not there or broken.
    """
    run = load_run(run_dir)
    path = run.directory / "report.html"
    write_text(path, report(run))
    return path


def report(run: RunData) -> Markup:
    """The report's HTML."""
    return page.document(
        run.title,
        *_headline(run),
        _terrain(run),
        _overview(run),
        page.section("Summary", _summary(run.summary)),
        page.section("The flight", *_figures(run)),
        page.section("Events", _events(run)),
        page.section("Do it again", *_again(run)),
        page.footer(_rest(run.summary)),
        script=script(),
    )


def _headline(run: RunData) -> tuple[Markup, Markup]:
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
    return page.heading(run.title, f"The vehicle {verdict}.", arrived and safe), page.tiles(tiles)


def _terrain(run: RunData) -> Markup:
    mission, ground = run.mission, run.terrain
    tracks = [Track(Part.FLOWN.value, run.x[:, :3], hexadecimal(COLOURS[Part.FLOWN]))]
    if run.plans:
        first = run.plans[0]
        arcs = [points for _, points in plan_arcs(first, first.t_start, PLAN_STEP)]
        colour = hexadecimal(COLOURS[Part.COMPLETION])
        tracks.append(Track("first plan, to rest", np.vstack(arcs), colour, dashed=True))
    places = {Part.START.value: mission.start, Part.TARGET.value: mission.target}
    antennas = [Radar(site.x, site.y, site.radius, site.weight) for site in mission.radars]
    radars = [(*antenna.position(ground).tolist(), antenna.radius) for antenna in antennas]
    return terrain_view(ground, tracks, places, radars)


def _overview(run: RunData) -> Markup:
    if opengl.available() is None:
        return page.paragraph(f"No picture of the scene: {opengl.HOW_TO_INSTALL}.")
    with tempfile.TemporaryDirectory() as scratch:
        still = write_still(run.directory, "overview", Path(scratch) / "overview.png", t=run.duration)
        return page.picture_block(
            still,
            f"The whole map of {run.terrain.name} seen from the south, with the path flown from start to target.",
            f"The end of the flight. Heights are drawn {EXAGGERATION} times as tall as they are, "
            "the vehicle far larger.",
        )


def _summary(summary: Mapping[str, Any]) -> Markup:
    shown = {name: [key for key in group if key in summary] for name, group in SUMMARY_GROUPS.items()}
    return page.columns(
        {
            name.capitalize(): page.table((), [(label(key)[0], quantity(key, summary[key])) for key in keys])
            for name, keys in shown.items()
            if keys
        }
    )


def _figures(run: RunData) -> list[Markup]:
    least = quantity("min_clearance_m", run.summary.get("min_clearance_m"))
    drawn = [
        (
            "map",
            figures.map_figure(run),
            f"Hill-shaded map of {run.terrain.name} with the path, radars, start and target.",
        ),
        (
            "profile",
            figures.profile_figure(run),
            f"Height of the path and of the ground along it; the least clearance is {least}, on the exact triangles. "
            "The clearance has a log scale.",
        ),
        ("motion", figures.motion_figure(run), "Speed and commanded acceleration over time with their bounds."),
    ]
    if run.plans:
        drawn.append(("cost", figures.cost_figure(run), "Composite cost of the plan being flown, over time."))
    if run.summary.get("solve_ms_mean") is not None:
        drawn.append(("solve", figures.solve_figure(run.summary), "Thread CPU time of one optimisation."))
    if run.events:
        drawn.append(("events", figures.events_figure(run), "The times at which each kind of event happened."))
    return [page.figure_block(figure, name, alt) for name, figure, alt in drawn]


def _events(run: RunData) -> Markup:
    if not run.events:
        return page.paragraph("Nothing happened that is worth a line.")
    rows = [(f"{event.t:.2f} s", *described(event)) for event in run.events[:MOST_EVENTS]]
    rest = len(run.events) - MOST_EVENTS
    more = page.paragraph(f"{rest} more in events.jsonl.") if rest > 0 else Markup("")
    title = f"{len(run.events)} event{'s' if len(run.events) > 1 else ''}"
    return page.card(page.details(title, page.table(("time", "kind", "message"), rows), more, is_open=True))


def _again(run: RunData) -> tuple[Markup, ...]:
    config = json.dumps(run.config, indent=2, ensure_ascii=False, default=str)
    command = f"mathnavi run {run.config['scenario']} --from {run.directory}"
    return (
        page.paragraph("The same seed on the same machine gives the same log, bit for bit."),
        page.card(page.preformatted(command)),
        page.card(page.details("config.json", page.preformatted(config))),
    )


def _rest(summary: Mapping[str, Any]) -> str:
    """What the summary's cards do not show: seed, version, how fast it ran."""
    named = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    rest = (f" · {label(key)[0]} {quantity(key, summary[key])}" for key in summary if key not in named)
    return f"mathnavi{''.join(rest)}"
