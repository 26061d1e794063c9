"""Report of a flight on one page: the overview if OpenGL is available, and a terrain that can be turned."""

from __future__ import annotations

from dataclasses import replace

from mathnavi.renders import figures, page
from mathnavi.renders.flight.figures import map_figure, motion_figure, profile_figure
from mathnavi.renders.flight.run_data import FlightRun
from mathnavi.renders.flight.web import web_scene
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.renders.report import Headline, event_figures, run_page, solve_figures, still_block, why
from mathnavi.renders.web.document import scene_block
from mathnavi.renders.web.landscape import first_plan
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
    good = arrived and safe and SHORTFALL not in summary
    return Headline(run.title, f"The vehicle {verdict}{why(summary)}.", good, tiles)


def _scene(run: FlightRun) -> Markup:
    scene = web_scene(run)
    label = f"The flight over {run.terrain.name} in three dimensions, with the first plan, radars, start and target"
    note = " Radars weigh on the optimised part of a plan only; its way to rest may lead through one."
    caption = f"{run.terrain.name}; {scene.note}.{note if run.mission.radars else ''}"
    return scene_block(replace(scene, lines=[*scene.lines, *first_plan(run.log.plans)]), label, caption)


def _overview(run: FlightRun) -> Markup:
    return still_block(
        run.directory,
        "overview",
        run.duration,
        f"The whole map of {run.terrain.name} seen from the south, with the path flown from start to target.",
        f"The end of the flight. Heights are drawn {EXAGGERATION} times as tall as they are, the vehicle far larger.",
    )


def _figures(run: FlightRun) -> list[Drawn]:
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
    if run.log.plans:
        drawn.append(
            (
                "cost",
                figures.cost_figure(run.log.plans, run.log.adopted, run.duration),
                "Composite cost of the plan being flown, over time.",
            )
        )
    return [*drawn, *solve_figures(run.summary), *event_figures(run, run.duration)]
