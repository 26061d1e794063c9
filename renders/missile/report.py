"""A missile's run on one page: how it ended, its path and time histories, two pictures of the scene."""

from __future__ import annotations

import math

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.renders import page
from mathnavi.renders.figures import BOUND, GRID, INK, STYLE, canvas, cost_figure, thinned
from mathnavi.renders.missile.drawing import highlight, verdict
from mathnavi.renders.missile.run_data import TO_WORLD, MissileRun
from mathnavi.renders.page import Drawn, Markup, number, quantity
from mathnavi.renders.palette import COLOURS, SceneElement, hexadecimal
from mathnavi.renders.report import (
    Headline,
    event_figures,
    innovation_figures,
    run_page,
    solve_figures,
    still_block,
    why,
)

TICKS = 16  # velocities marked along a path
LAST = 1.0  # [s] before the closest approach: the end, as the target sees it
CLOSE_BY = 10.0  # times what counts as a hit, or the miss: from there on the distance is shown
LENGTHS = {"m": 1.0, "cm": 1e2, "mm": 1e3, "µm": 1e6, "nm": 1e9}  # units for what may be a metre or next to nothing
NAMES = {  # (name, unit, factor) of what is drawn of a state
    "u": ("u, along the nose", "m/s", 1.0),
    "v": ("v, to the right", "m/s", 1.0),
    "w": ("w, to the belly", "m/s", 1.0),
    "q": ("q, pitch rate", "deg/s", math.degrees(1.0)),
    "r": ("r, yaw rate", "deg/s", math.degrees(1.0)),
    "theta": ("θ, pitch", "deg", math.degrees(1.0)),
    "psi": ("ψ, yaw", "deg", math.degrees(1.0)),
}
INPUTS = {
    "F_x": ("F_x, axial", "kN", 1e-3),
    "F_y": ("F_y, to the right", "kN", 1e-3),
    "F_z": ("F_z, to the belly", "kN", 1e-3),
    "M": ("M, pitching", "kN m", 1e-3),
    "N": ("N, yawing", "kN m", 1e-3),
}


def report(run: MissileRun) -> Markup:
    """Return the report's HTML."""
    title = ", ".join(filter(None, (run.log.config["scenario"], run.case, f"seed {run.log.config['seed']}")))
    path = page.section("The path", page.figure_block(path_figure(run), "path", _path_caption(run)))
    flight = page.section("The flight", *page.figure_blocks(_figures(run)))
    return run_page(run, _headline(run, title), (path, *_pictures(run)), (flight,))


def _headline(run: MissileRun, title: str) -> Headline:
    summary, allowed = run.log.summary, run.aspect_allowed
    aspect, hit = summary.get("aspect_error_deg"), run.approach.miss <= run.miss_allowed
    good = hit and aspect is not None and (allowed is None or aspect <= allowed)
    within = "" if allowed is None else f" (allowed {allowed:g} deg)"
    turned = f"its nose {quantity('aspect_error_deg', aspect)} off {math.degrees(run.aspect_angle):g} deg"
    tiles = {
        f"miss (allowed {run.miss_allowed:g} m)": quantity("miss_m", run.approach.miss),
        f"aspect angle error{within}": quantity("aspect_error_deg", aspect),
        "impact speed": quantity("impact_speed_m_s", summary.get("impact_speed_m_s")),
        f"flight (planned {quantity('planned_time_s', summary.get('planned_time_s'))})": quantity(
            "impact_time_s", summary.get("impact_time_s")
        ),
        f"cost (planned {page.number(summary.get('planned_cost'))})": page.number(summary.get("cost")),
    }
    words = "hit" if hit else "missed"
    found = f"{words}, {quantity('miss_m', run.approach.miss)} off after {run.approach.t:.1f} s; {turned}"
    return Headline(f"{title}: {found}", f"The missile {verdict(run)}, {turned}{why(summary)}.", good, tiles)


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
        ("approach", approach_figure(run), end),
        ("states", states_figure(run), "Velocities along the body's axes, rates and angles, and the plan's."),
        ("inputs", inputs_figure(run), "Forces and moments of the thrusters, the plan's, and their limits."),
        ("angles", angles_figure(run), "Speed, angle of attack and the distance from the plan being flown."),
    ]
    if log.plans:
        cost = cost_figure(log.plans, log.adopted, run.duration)
        drawn.append(("cost", cost, "The objective of the plan being flown, from its start to the target, over time."))
    drawn += innovation_figures(log.arrays, run.duration)
    return [*drawn, *solve_figures(log.summary), *event_figures(run, run.duration)]


def _colour(part: SceneElement) -> str:
    return hexadecimal(COLOURS[part])


FLOWN, PLAN = _colour(SceneElement.FLOWN), _colour(SceneElement.PLAN)


def path_figure(run: MissileRun) -> Figure:
    """The path from the side with the velocities along it, the first plan and the target; in space also from above."""
    with matplotlib.rc_context(STYLE):
        views = ((2, "height [m]"), (1, "to the left [m]"))[: 2 if run.coordinates.name == "spatial" else 1]
        moved = run.target.at(np.linspace(0.0, run.duration, 100)) * TO_WORLD
        planned = run.plan_ahead(run.log.plans[0].t_start, 200) if run.log.plans else run.path[:1]
        everything = np.vstack([run.path, moved, planned])
        low, high = everything.min(axis=0), everything.max(axis=0)
        margin = 0.05 * float(high[0] - low[0])
        low, high = low - margin, high + margin
        tall = [float(high[across] - low[across]) for across, _ in views]
        figure = canvas(9.4, 1.1 + 8.4 * sum(tall) / float(high[0] - low[0]))
        drawn = np.atleast_1d(figure.subplots(len(views), 1, sharex=True, height_ratios=tall))
        for axes, (across, name) in zip(drawn, views, strict=True):
            axes.plot(planned[:, 0], planned[:, across], "--", color=PLAN, label="first plan")
            axes.plot(moved[:, 0], moved[:, across], color=_colour(SceneElement.VELOCITY), lw=1.2)
            _draw_path(axes, run, across)
            axes.plot(
                moved[-1, 0],
                moved[-1, across],
                "o",
                ms=8,
                mfc=_colour(SceneElement.TARGET),
                mec=INK,
                label="target at the end",
            )
            axes.set(ylabel=name, xlim=(low[0], high[0]), ylim=(low[across], high[across]), aspect="equal")
        drawn[0].set_title("Path")
        drawn[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.2)
        drawn[-1].set(xlabel="distance ahead [m]")
    return figure


def _draw_path(axes: Axes, run: MissileRun, across: int) -> None:
    """The path, and from dots at equal times the way of the next quarter of a second at the velocity there."""
    i = thinned(len(run.t), 0)
    axes.plot(run.path[i, 0], run.path[i, across], color=FLOWN, lw=2.0, label="flown")
    velocity = run.coordinates.velocity(run.x) * TO_WORLD
    for k in np.linspace(0, len(run.t) - 1, TICKS).astype(int):
        end = run.path[k] + 0.25 * velocity[k]
        axes.plot([run.path[k, 0], end[0]], [run.path[k, across], end[across]], ".-", color=INK, lw=0.9, markevery=[0])


def states_figure(run: MissileRun) -> Figure:
    """The state over time, and that of the plan being flown."""
    with matplotlib.rc_context(STYLE):
        shown = [name for name in NAMES if name in run.coordinates.states]
        figure = canvas(9.4, 1.35 * len(shown) + 0.4)
        drawn = figure.subplots(len(shown), 1, sharex=True)
        i = thinned(len(run.t), 0)
        for axes, state in zip(drawn, shown, strict=True):
            name, unit, factor = NAMES[state]
            k = run.coordinates.index(state)
            axes.plot(run.t[i], factor * run.x[i, k], color=FLOWN, lw=2.0, label="flown")
            axes.plot(run.t[i], factor * run.reference[i, k], "--", color=PLAN, lw=1.1, label="plan being flown")
            axes.set_ylabel(f"{state} [{unit}]".replace("theta", "θ").replace("psi", "ψ"))
            axes.set_title(name, loc="right", size=8.0, weight="normal")
        drawn[0].set_title("State")
        drawn[0].legend(loc="lower left", bbox_to_anchor=(0.12, 1.0), ncols=2, borderaxespad=0.2)
        drawn[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def inputs_figure(run: MissileRun) -> Figure:
    """Commands of the thrusters, inputs of the plan, and the limits where they are near."""
    with matplotlib.rc_context(STYLE):
        coordinates = run.coordinates
        figure = canvas(9.4, 1.45 * coordinates.input_size + 0.4)
        drawn = figure.subplots(coordinates.input_size, 1, sharex=True)
        i = thinned(len(run.t) - 1, 0)
        planned = _planned(run, coordinates)
        for k, (axes, name) in enumerate(zip(drawn, coordinates.inputs, strict=True)):
            text, unit, factor = INPUTS[name]
            axes.step(run.t[i], factor * run.u[i, k], where="post", color=FLOWN, lw=1.4, label="thrusters")
            axes.step(run.t[i], factor * planned[i, k], where="post", color=PLAN, ls="--", lw=1.0, label="plan")
            largest, limit = float(np.abs(run.u[:-1, k]).max()), float(run.input_max[k])
            if largest > 0.4 * limit:
                for side in (limit, -limit):
                    axes.axhline(factor * side, color=BOUND, ls=":", lw=1.1)
            axes.set_ylabel(f"{name.replace('_', '')} [{unit}]")
            axes.set_title(f"{text}; limit {factor * limit:g} {unit}", loc="right", size=8.0, weight="normal")
        drawn[0].set_title("Inputs")
        drawn[0].legend(loc="lower left", bbox_to_anchor=(0.12, 1.0), ncols=2, borderaxespad=0.2)
        drawn[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def _planned(run: MissileRun, coordinates: Coordinates) -> Array:
    """(n, nu) the input of the plan being flown; NaN before the first."""
    out = np.full((len(run.t), coordinates.input_size), np.nan)
    for k, t in enumerate(run.t):
        plan = run.plan(float(t))
        if plan is not None:
            out[k] = coordinates.input_at(plan, float(t))
    return out


def angles_figure(run: MissileRun) -> Figure:
    """Speed, angle of attack, and how far the missile is from the plan being flown."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 4.6)
        speed, attack, error = figure.subplots(3, 1, sharex=True)
        i = thinned(len(run.t), int(np.argmax(run.attack)))
        speed.plot(run.t[i], run.speed[i], color=FLOWN)
        speed.set(ylabel="speed [m/s]", title="Speed, angle of attack, distance from the plan")
        attack.plot(run.t[i], np.degrees(run.attack[i]), color=FLOWN)
        attack.set(ylabel="attack [deg]")
        distance = np.linalg.norm(run.coordinates.place(run.x) - run.coordinates.place(run.reference), axis=1)
        largest = float(np.nanmax(distance, initial=0.0))
        unit = next((unit for unit, factor in LENGTHS.items() if factor * largest >= 1.0), "m")
        error.set(ylabel=f"off the plan [{unit}]", xlabel="time [s]", xlim=(0.0, run.duration))
        if run.log.plans:
            i = thinned(len(run.t), int(np.nanargmax(distance)))
            error.plot(run.t[i], LENGTHS[unit] * distance[i], color=FLOWN)
            error.set_ylim(bottom=0.0)
    return figure


def approach_figure(run: MissileRun) -> Figure:
    """The last metres: the distance to the target; and the path of the last second as the target sees it."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 3.4)
        distance, path = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
        _draw_distance(distance, run)
        late = run.t >= run.approach.t - LAST
        relative = run.path[late] - run.target.at(run.t[late]) * TO_WORLD
        path.plot(relative[:, 0], relative[:, 2], color=FLOWN, lw=2.0)
        path.plot(0.0, 0.0, "o", ms=8, mfc=_colour(SceneElement.TARGET), mec=INK)
        ahead = math.cos(run.aspect_angle) * math.cos(run.azimuth)
        direction = np.array([ahead, math.sin(run.aspect_angle)])
        wide = max(float(np.abs(relative[:, [0, 2]]).max()), 1.0)
        path.plot([-wide * direction[0], 0.0], [-wide * direction[1], 0.0], color=GRID, ls="--", lw=1.2, zorder=0)
        path.set(xlabel="ahead of the target [m]", ylabel="above it [m]", title="As the target sees it")
        path.set_aspect("equal", adjustable="datalim")
    return figure


def _draw_distance(axes: Axes, run: MissileRun) -> None:
    """The distance to the target at the samples and, between two of them, where it is least."""
    end = run.approach
    distance = np.linalg.norm(run.path - run.target.at(run.t) * TO_WORLD, axis=1)
    k = int(np.searchsorted(run.t, end.t))
    t, distance = np.insert(run.t, k, end.t) - end.t, np.insert(distance, k, end.miss)
    limit = CLOSE_BY * max(run.miss_allowed, end.miss)
    far = np.flatnonzero(distance[: k + 1] > limit)
    begin = float(t[far[-1]]) if len(far) else float(t[0])
    axes.plot(t, distance, color=FLOWN)
    axes.plot(0.0, end.miss, "o", color=INK, ms=4, clip_on=False)
    axes.axhline(run.miss_allowed, color=BOUND, ls=":", lw=1.1)
    axes.annotate(f"a hit: {run.miss_allowed:g} m", (0.0, run.miss_allowed), (4, 4),
                  xycoords=("axes fraction", "data"), textcoords="offset points", color=BOUND)  # fmt: skip
    axes.set(xlabel="time to the closest approach [s]", ylabel="distance [m]", ylim=(0.0, limit))
    axes.set_xlim(begin, max(float(t[-1]), -0.02 * begin))
    axes.set_title(f"Distance to the target: {number(end.miss)} m at last")
