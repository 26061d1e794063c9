"""A flight on one page: the overview as a picture where OpenGL is at hand, and the terrain that can be turned."""

from __future__ import annotations

import numpy as np

from mathnavi.renders import figures, page
from mathnavi.renders.flight.figures import map_figure, motion_figure, profile_figure
from mathnavi.renders.flight.run_data import RunData, antennas, plan_arcs
from mathnavi.renders.page import Markup, quantity
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.renders.report import again, events_card, rest, still_block, summary_cards, why
from mathnavi.renders.terrain_view import Track, script, terrain_view
from mathnavi.sim.records.figure_names import SHORTFALL

PLAN_STEP = 0.5  # [s] between the points of a plan that is drawn


def report(run: RunData) -> Markup:
    """The report's HTML."""
    return page.document(
        run.title,
        *_headline(run),
        _terrain(run),
        _overview(run),
        page.section("Summary", summary_cards(run.summary)),
        page.section("The flight", *_figures(run)),
        page.section("Events", events_card(run.events)),
        page.section("Do it again", *again(run.directory, run.config)),
        page.footer(rest(run.summary)),
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
    good = arrived and safe and SHORTFALL not in summary
    return page.heading(run.title, f"The vehicle {verdict}{why(summary)}.", good), page.tiles(tiles)


def _terrain(run: RunData) -> Markup:
    mission, ground = run.mission, run.terrain
    tracks = [Track(SceneElement.FLOWN.value, run.x[:, :3], hexadecimal(COLOURS[SceneElement.FLOWN]))]
    if run.plans:
        first = run.plans[0]
        arcs = [points for _, points in plan_arcs(first, first.t_start, PLAN_STEP)]
        colour = hexadecimal(COLOURS[SceneElement.COMPLETION])
        tracks.append(Track("first plan, to rest", np.vstack(arcs), colour, dashed=True))
    places = {SceneElement.START.value: mission.start, SceneElement.TARGET.value: mission.target_at(run.duration)}
    radars = antennas(run)
    note = "Radars weigh on the optimised part of a plan only; its way to rest may lead through one." if radars else ""
    return terrain_view(ground, tracks, places, radars, note)


def _overview(run: RunData) -> Markup:
    return still_block(
        run.directory,
        "overview",
        run.duration,
        f"The whole map of {run.terrain.name} seen from the south, with the path flown from start to target.",
        f"The end of the flight. Heights are drawn {EXAGGERATION} times as tall as they are, the vehicle far larger.",
    )


def _figures(run: RunData) -> list[Markup]:
    least = quantity("min_clearance_m", run.summary.get("min_clearance_m"))
    drawn = [
        (
            "map",
            map_figure(run),
            f"Hill-shaded map of {run.terrain.name} with the path, radars, start and target.",
        ),
        (
            "profile",
            profile_figure(run),
            f"Height of the path and of the ground along it; the least clearance is {least}, on the exact triangles. "
            "The clearance has a log scale.",
        ),
        ("motion", motion_figure(run), "Speed and commanded acceleration over time with their bounds."),
    ]
    if run.plans:
        drawn.append(
            (
                "cost",
                figures.cost_figure(run.plans, run.adopted, run.duration),
                "Composite cost of the plan being flown, over time.",
            )
        )
    if run.summary.get("solve_ms_mean") is not None:
        drawn.append(("solve", figures.solve_figure(run.summary), "Thread CPU time of one optimisation."))
    if run.events:
        drawn.append(
            (
                "events",
                figures.events_figure(run.events, run.duration),
                "The times at which each kind of event happened.",
            )
        )
    return [page.figure_block(figure, name, alt) for name, figure, alt in drawn]
