"""Drawing of fleets of aerial vehicles (``mathnavi.renders.drawing``): shots, annotations, overlay.

The long way is shown by the overview and the top view; the last half minute, in which all arrive, has a third of the
tour and its own camera.
"""

from __future__ import annotations

import numpy as np

from mathnavi.renders.drawing import Drawing
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, consecutive
from mathnavi.renders.fleet.run_data import FleetRun, load_run
from mathnavi.renders.overlay import Key, Overlay, pace
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.relief import EXAGGERATION

CAMERAS = ("overview", "top", "arrival")
CLOSING = 30.0  # [s] before the end from which on the arrival is filmed
MOST_CLOSING = 0.3  # share of the run that the arrival is at most
TURN = 0.8  # [degrees/s of video] at which overview and arrival turn
LAST_MOMENT = 2.4  # [s of video] for which the last moment stays
# Cameras, lengths [s of video] and ends [share of the time until the arrival is filmed] of the shots before that.
LONG_WAY = (("overview", 4.0, 0.3), ("top", 4.6, 0.72), ("overview", 3.4, 1.0))
CLOSING_LENGTH = 6.4  # [s of video]
FORCED_LENGTH = 18.4  # [s of video] before the last moment, where one camera films everything
ANNOTATED = {  # kinds of events that a video shows; the rest is for the report
    "guarantee-lost": "guarantee lost",
    "deadline-lost": "deadline lost",
    "ground-contact": "ground contact",
}
MOST_NAMED = 8  # vehicles that the legend names; of more the numbers in the picture have to do
PALE = (0.9, 0.93, 0.96)
FLOWN, PLAN_AHEAD = Key("thick: flown", PALE), Key("thin: plan ahead", PALE)


def highlight(run: FleetRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see: while all arrive."""
    return run.duration - min(CLOSING, MOST_CLOSING * run.duration), run.duration


def verdict(run: FleetRun) -> str:
    """Return the outcome of the run in a few words."""
    count = len(run.flights)
    if run.everybody_arrived:
        return f"all {count} arrived within {run.spread:.2f} s"
    return f"{run.arrived(run.duration)} of {count} arrived"


def annotations_of(run: FleetRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time; of each kind of event only the first."""
    found = {verdict(run): run.duration}
    for event in run.events:
        if event.kind in ANNOTATED:
            found.setdefault(f"{ANNOTATED[event.kind]}: {event.agent}", event.t)
    agreed = [
        (t, f"agreed to {'arrive' if k == 0 else 'arrive now'} at {arrival:.1f} s")
        for k, (t, arrival) in enumerate(run.agreements)
    ]
    return sorted(agreed + [(t, text) for text, t in found.items()])


def shot_list(run: FleetRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole run."""
    end = run.duration
    if direction != TOUR:
        return consecutive((0.0, end, end), ((direction, FORCED_LENGTH), (direction, LAST_MOMENT)))
    closing = highlight(run)[0]
    cuts = (0.0, *(share * closing for _, _, share in LONG_WAY), end, end)
    arrival = (("arrival", CLOSING_LENGTH), ("arrival", LAST_MOMENT))
    return consecutive(cuts, (*((camera, length) for camera, length, _ in LONG_WAY), *arrival))


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


drawing = Drawing(
    cameras=CAMERAS,
    still_camera="overview",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.fleet.scene:fleet_scene", overlay, annotations_of),
    report="mathnavi.renders.fleet.report:report",
    web="mathnavi.renders.fleet.scene:fleet_scene",
    figure="mathnavi.renders.fleet.report:map_figure",
    turn=TURN,
)
