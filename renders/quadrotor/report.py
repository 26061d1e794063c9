"""A quadrotor's flight on one page: in the canyon, over the ground, near its plan, and what its rotors did."""

from __future__ import annotations

from dataclasses import replace

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from mathnavi.models.quadrotor.dynamics import ROTORS
from mathnavi.renders import page
from mathnavi.renders.figures import BOUND, STYLE, canvas, thinned
from mathnavi.renders.flight.report import found, map_figure, profile_figure
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.palette import COLOURS, VEHICLES, SceneElement, hexadecimal
from mathnavi.renders.quadrotor.drawing import highlight
from mathnavi.renders.quadrotor.run_data import QuadrotorRun
from mathnavi.renders.quadrotor.scene import quadrotor_scene
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

_LINE = hexadecimal(COLOURS[SceneElement.OPTIMISED])


def report(run: QuadrotorRun) -> Markup:
    """Return the report's HTML."""
    flight = page.section("The flight", *page.figure_blocks(_figures(run)))
    return run_page(run.flight, _headline(run), (_scene(run), *_pictures(run)), (flight,))


def _headline(run: QuadrotorRun) -> Headline:
    flight = run.flight
    summary, least = flight.summary, flight.mission.clearance_min
    arrived, clearance = bool(summary.get("arrived")), summary.get("min_clearance_m")
    safe = clearance is not None and clearance >= least and not summary.get("ground_contacts")
    verdict = ("arrived" if arrived else "did not arrive") + (
        f", no part of it ever nearer than {least:g} m above the ground"
        if safe
        else ", and came too close to the ground"
    )
    error, bound = (quantity(key, summary.get(key)) for key in ("tracking_error_max_m", "tracking_bound_m"))
    tiles = {
        f"arrival (deadline {quantity('deadline_s', summary.get('deadline_s'))})": quantity(
            "arrival_time_s", summary.get("arrival_time_s") if arrived else None
        ),
        f"least clearance (allowed {least:g} m)": quantity("min_clearance_m", clearance),
        f"farthest off its plan (bound {bound})": error,
        "greatest tilt": quantity("tilt_max_deg", summary.get("tilt_max_deg")),
        "path flown": f"{flight.travelled[-1]:.0f} m",
    }
    good = arrived and safe and SHORTFALL not in summary
    return Headline(
        f"{flight.title}: {found(flight, run.clearance)}", f"The quadrotor {verdict}{why(summary)}.", good, tiles
    )


def _scene(run: QuadrotorRun) -> Markup:
    scene, name = quadrotor_scene(run), run.flight.terrain.name
    caption = (
        f"{name}. The first plan's way to rest leads over the plateau; the plans after it find a shorter one. "
        "Seen from afar, the vehicle is drawn far larger than it is."
    )
    label = f"The flight over {name} in three dimensions, with the first plan, start and target"
    return scene_block(replace(scene, lines=[*scene.lines, *first_plan(run.flight.log.plans)]), label, caption)


def _pictures(run: QuadrotorRun) -> list[Markup]:
    flight = run.flight
    middle = sum(highlight(run)) / 2.0
    return [
        still_block(
            flight.directory, "chase", middle, "The quadrotor in the canyon, its path behind and its plan ahead.",
            f"At {middle:.1f} s, where the ground is nearest in mid-flight: the vehicle in its true size and attitude.",
        ),
        still_block(
            flight.directory, "overview", flight.duration, f"The whole of {flight.terrain.name} with the path flown.",
            "The end of the flight. Heights are true; the vehicle is drawn far larger than it is.",
        ),
    ]  # fmt: skip


def _figures(run: QuadrotorRun) -> list[Drawn]:
    flight, summary = run.flight, run.flight.summary
    least = quantity("min_clearance_m", summary.get("min_clearance_m"))
    drawn = [
        (
            "map",
            map_figure(flight),
            f"Hill-shaded map of {flight.terrain.name} with the path, start and target.",
        ),
        (
            "profile",
            profile_figure(flight),
            "Height of the vehicle's centre and of the ground along its path. The clearance has a log scale.",
        ),
        (
            "clearance",
            clearance_figure(run),
            f"Clearance over time of the part that is nearest to the ground, {run.reach:g} m from the centre at most: "
            f"the least is {least}, on the exact triangles. Below, the speed.",
        ),
        (
            "tracking",
            tracking_figure(run),
            "Distance of the centre from the plan being flown, across and along the vertical, against the bound in "
            "the certificate.",
        ),
        (
            "rotors",
            rotors_figure(run),
            "Tilt of the thrust, and the thrust asked of each rotor between nothing and its greatest.",
        ),
    ]
    drawn += innovation_figures(flight.log.arrays, flight.duration)
    return [*drawn, *solve_figures(summary), *event_figures(flight, flight.duration)]


def clearance_figure(run: QuadrotorRun) -> Figure:
    """Clearance of the nearest part of the vehicle, and the speed, over time against their bounds."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 4.0)
        upper, lower = figure.subplots(2, 1, sharex=True)
        mission, t = run.flight.mission, run.flight.t
        lowest = int(np.nanargmin(run.clearance)) if np.isfinite(run.clearance).any() else 0
        i = thinned(len(t), lowest)
        upper.plot(t[i], run.clearance[i], color=hexadecimal(COLOURS[SceneElement.FLOWN]))
        upper.plot(t[lowest], run.clearance[lowest], "o", ms=4.0, color=BOUND)
        speed = np.linalg.norm(run.flight.x[:, 3:], axis=1)
        lower.plot(t[i], speed[i], color=_LINE)
        for axes, least, name in ((upper, mission.clearance_min, "h_min"), (lower, mission.speed_max, "bound")):
            axes.axhline(least, color=BOUND, ls=":", lw=1.2)
            axes.annotate(f"{name} {least:g}", (1.0, least), (0, 3), xycoords=("axes fraction", "data"),
                          textcoords="offset points", ha="right", color=BOUND)  # fmt: skip
        upper.set(ylabel="clearance [m]", ylim=(0.0, None), title="Clearance of the whole vehicle, and speed")
        lower.set(xlabel="time [s]", ylabel="speed [m/s]", xlim=(0.0, run.duration))
        lower.set_ylim(0.0, 1.15 * max(mission.speed_max, float(speed.max())))
    return figure


def tracking_figure(run: QuadrotorRun) -> Figure:
    """Distance of the centre from the plan being flown, across and along the vertical, with the certified bound."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 3.9)
        panels = figure.subplots(2, 1, sharex=True)
        for axes, error, name in zip(panels, run.tracking_error.T, run.bound, strict=True):
            i = thinned(len(run.flight.t), int(np.argmax(np.nan_to_num(error))))
            axes.plot(run.flight.t[i], 100.0 * error[i], color=_LINE, lw=1.0)
            axes.axhline(100.0 * run.bound[name], color=BOUND, ls=":", lw=1.2)
            axes.set(
                ylabel=f"{name} [cm]", ylim=(0.0, 115.0 * max(run.bound[name], float(np.nanmax(error, initial=0.0))))
            )
        panels[0].set_title("Off the plan, against the bound in the certificate (dotted)")
        panels[1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def rotors_figure(run: QuadrotorRun) -> Figure:
    """The tilt, and the thrust asked of each rotor between nothing and its most."""
    with matplotlib.rc_context(STYLE):
        figure = canvas(9.4, 4.2)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.5))
        i = thinned(len(run.flight.t), int(np.argmax(run.tilt)))
        upper.plot(run.flight.t[i], run.tilt[i], color=_LINE, lw=1.1)
        upper.set(ylabel="tilt [°]", ylim=(0.0, None), title="Tilt, and the thrusts asked of the rotors")
        for k, name in enumerate(ROTORS):
            lower.plot(run.flight.t[i], run.thrusts[i, k], lw=0.9, color=hexadecimal(VEHICLES[k]),
                       label=name.replace("_", " "))  # fmt: skip
        for limit in (0.0, run.thrust_max):
            lower.axhline(limit, color=BOUND, ls=":", lw=1.2)
        lower.set(xlabel="time [s]", ylabel="thrust [N]", xlim=(0.0, run.duration), ylim=(-0.3, 1.05 * run.thrust_max))
        lower.legend(ncols=4, loc="upper right", fontsize=8.0)
    return figure
