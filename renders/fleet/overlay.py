"""Overlay of the pictures of a fleet."""

from __future__ import annotations

import numpy as np

from mathnavi.renders.film import Frame
from mathnavi.renders.fleet.run_data import FleetRun
from mathnavi.renders.fleet.shot_list import verdict
from mathnavi.renders.overlay import Key, Overlay, pace
from mathnavi.renders.relief import EXAGGERATION

MOST_NAMED = 8  # vehicles that the legend names; of more the numbers in the picture have to do
PALE = (0.9, 0.93, 0.96)
FLOWN, PLAN_AHEAD = Key("thick: flown", PALE), Key("thin: plan ahead", PALE)


def metres(length: float) -> str:
    """A length [m] with the digits that a viewer can use."""
    return f"{length:.0f} m" if length < 1e3 else f"{length / 1e3:.2f} km" if length < 1e4 else f"{length / 1e3:.1f} km"


def _agreement(run: FleetRun, t: float) -> tuple[str, str]:
    """Return the agreed time of arrival of the vehicles, and the time left until then."""
    agreed = run.agreed(t)
    known = agreed[np.isfinite(agreed)]
    if len(known) < len(agreed):
        return "–", f"known to {len(known)} of {len(agreed)}"
    low, high = float(known.min()), float(known.max())
    if high - low > 0.1:
        return f"{high:.1f} s", f"some: {low:.1f} s"
    return f"{high:.1f} s", f"in {high - t:.0f} s" if high - t > 0.5 else ""


def _legend(run: FleetRun) -> list[Key]:
    if len(run.vehicles) > MOST_NAMED:
        return [FLOWN, PLAN_AHEAD]
    return [*(Key(name, colour) for name, colour in zip(run.vehicles, run.colours, strict=True)), PLAN_AHEAD]


def overlay(run: FleetRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    count = len(run.flights)
    over = frame.t >= run.duration
    title = [f"mathnavi · {run.config['scenario']} · {run.terrain.name} · seed {run.config['seed']}"]
    if frame.camera == "arrival":
        title.append("vehicles and slots larger than life")
    else:
        title.append(f"vehicles and heights not to scale: heights × {EXAGGERATION}")
    return Overlay(
        title=title,
        numbers=(
            ("TIME", f"{frame.t:.1f} s", pace(frame, run.duration)),
            ("AGREED ARRIVAL", *_agreement(run, frame.t)),
            ("ARRIVED", f"{run.arrived(frame.t)} of {count}", f"within {run.flights[0].mission.arrival_radius:g} m"),
            ("LEAST DISTANCE NOW", metres(run.nearest(frame.t)), f"at least {run.separation:g} m"),
        ),
        state=verdict(run) if over else "on the way to one time",
        legend=_legend(run),
    )
