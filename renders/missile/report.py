"""A missile's run on one page: how it ended, its path and time histories, two pictures of the scene."""

from __future__ import annotations

import math

from mathnavi.renders import page
from mathnavi.renders.figures import cost_figure
from mathnavi.renders.missile import figures
from mathnavi.renders.missile.run_data import MissileRun
from mathnavi.renders.missile.shot_list import highlight, verdict
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.report import Headline, event_figures, run_page, solve_figures, still_block, why


def report(run: MissileRun) -> Markup:
    """Return the report's HTML."""
    case = run.log.config["mission"]["case"]["name"]
    title = f"{run.log.config['scenario']}, case {case}, seed {run.log.config['seed']}"
    path = page.section("The path", page.figure_block(figures.path_figure(run), "path", _path_caption(run)))
    flight = page.section("The flight", *page.figure_blocks(_figures(run)))
    return run_page(run, _headline(run, title), (path, *_pictures(run)), (flight,))


def _headline(run: MissileRun, title: str) -> Headline:
    summary, mission = run.log.summary, run.log.config["mission"]
    aspect, allowed = summary.get("aspect_error_deg"), float(mission["aspect_allowed"])
    hit = run.approach.miss <= run.miss_allowed
    good = hit and aspect is not None and aspect <= allowed
    turned = f"its nose {quantity('aspect_error_deg', aspect)} off {math.degrees(run.aspect_angle):g} deg"
    tiles = {
        f"miss (allowed {run.miss_allowed:g} m)": quantity("miss_m", run.approach.miss),
        f"aspect angle error (allowed {allowed:g} deg)": quantity("aspect_error_deg", aspect),
        "impact speed": quantity("impact_speed_m_s", summary.get("impact_speed_m_s")),
        f"flight (planned {quantity('planned_time_s', summary.get('planned_time_s'))})": quantity(
            "impact_time_s", summary.get("impact_time_s")
        ),
        f"cost (planned {page.number(summary.get('planned_cost'))})": page.number(summary.get("cost")),
    }
    return Headline(title, f"The missile {verdict(run)}, {turned}{why(summary)}.", good, tiles)


def _path_caption(run: MissileRun) -> str:
    words = "The path flown, a quarter of a second of its velocity at dots of equal times, and the first plan."
    moves = any(any(leg.velocity) for leg in run.target.legs)
    return f"{words} The target moves; the plan is made again on the way." if moves else words


def _pictures(run: MissileRun) -> list[Markup]:
    dive = sum(highlight(run)) / 2.0
    return [
        still_block(
            run.directory, "side", dive, f"The missile {dive:.1f} s after its start, seen from the side.",
            "From the side, 100 m from line to line on the ground; missile and target are drawn larger than they are.",
        ),
        still_block(
            run.directory, "chase", dive, f"The missile {dive:.1f} s after its start, seen from beside it.",
            "The same moment from beside the missile, to scale; gas leaves on the side from which the thrusters push.",
        ),
    ]  # fmt: skip


def _figures(run: MissileRun) -> list[Drawn]:
    log = run.log
    end = f"The last metres: the missile passes {quantity('miss_m', run.approach.miss)} from the target's middle."
    drawn = [
        ("approach", figures.approach_figure(run), end),
        ("states", figures.states_figure(run), "Velocities along the body's axes, rates and angles, and the plan's."),
        ("inputs", figures.inputs_figure(run), "Forces and moments of the thrusters, the plan's, and their limits."),
        ("angles", figures.angles_figure(run), "Speed, angle of attack and the distance from the plan being flown."),
    ]
    if log.plans:
        cost = cost_figure(log.plans, log.adopted, run.duration)
        drawn.append(("cost", cost, "The objective of the plan being flown, from its start to the target, over time."))
    return [*drawn, *solve_figures(log.summary), *event_figures(run, run.duration)]
