"""Figures of a quadrotor's flight: how near it stays to its plan, how it tilts, what its rotors push."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from mathnavi.models.quadrotor.dynamics import ROTORS
from mathnavi.renders.figures import BOUND, STYLE, canvas, thinned
from mathnavi.renders.palette import COLOURS, VEHICLES, SceneElement, hexadecimal
from mathnavi.renders.quadrotor.run_data import QuadrotorRun

_LINE = hexadecimal(COLOURS[SceneElement.OPTIMISED])


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
