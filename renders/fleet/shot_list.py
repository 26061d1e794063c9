"""Shot list of the video of a fleet's run, and the annotations over it.

The long way is shown by the overview and the top view; the last half minute, in which all arrive, has a third of the
tour and its own camera.
"""

from __future__ import annotations

from mathnavi.renders.film import TOUR, Annotation, Shot, consecutive
from mathnavi.renders.fleet.run_data import FleetRun

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
