"""Which moment of a fleet's run each frame of its video shows, from where.

The long way is told by the overview and the top view; the last half minute, in which all arrive, has a third of the
tour and a camera of its own.
"""

from __future__ import annotations

from mathnavi.renders.drawing import TOUR, checked_camera
from mathnavi.renders.film import Frame, Shot, frames_of
from mathnavi.renders.fleet.run_data import FleetRun

CAMERAS = ("overview", "top", "arrival")
CLOSING = 30.0  # [s] before the end from which on the arrival is filmed
MOST_CLOSING = 0.3  # share of the run that the arrival is at most
TURN = 0.8  # [degrees/s of video] at which overview and arrival turn
LAST_LOOK = 2.4  # [s of video] for which the last moment stays
# Cameras, lengths [s of video] and ends [share of the time until the arrival is filmed] of the shots before that.
LONG_WAY = (("overview", 4.0, 0.3), ("top", 4.6, 0.72), ("overview", 3.4, 1.0))
CLOSING_LENGTH = 6.4  # [s of video]
FORCED_LENGTH = 18.4  # [s of video] before the last look, where one camera films everything
TOLD = {  # kinds of events that a video tells of; the rest is for the report
    "guarantee-lost": "guarantee lost",
    "deadline-lost": "deadline lost",
    "ground-contact": "ground contact",
}


def highlight(run: FleetRun) -> tuple[float, float]:
    """From when to when [s] there is most to see: while all arrive."""
    return run.duration - min(CLOSING, MOST_CLOSING * run.duration), run.duration


def verdict(run: FleetRun) -> str:
    """How the run ended."""
    count = len(run.flights)
    if run.everybody_arrived:
        return f"all {count} arrived within {run.spread:.2f} s"
    return f"{run.arrived(run.duration)} of {count} arrived"


def notices(run: FleetRun) -> list[tuple[float, str]]:
    """(time [s], text) of what a viewer should be told, in order of time; of each kind of event only the first."""
    found = {verdict(run): run.duration}
    for event in run.events:
        if event.kind in TOLD:
            found.setdefault(f"{TOLD[event.kind]}: {event.agent}", event.t)
    agreed = [
        (t, f"agreed to {'arrive' if k == 0 else 'arrive now'} at {arrival:.1f} s")
        for k, (t, arrival) in enumerate(run.agreements)
    ]
    return sorted(agreed + [(t, text) for text, t in found.items()])


def shots(run: FleetRun, direction: str = TOUR) -> list[Shot]:
    """The shots of the video of a run, in order; they cover the whole run."""
    end = run.duration
    if direction != TOUR:
        return [Shot(checked_camera(direction, CAMERAS), 0.0, end, FORCED_LENGTH), Shot(direction, end, end, LAST_LOOK)]
    filmed, begin, closing = [], 0.0, highlight(run)[0]
    for camera, length, share in LONG_WAY:
        filmed.append(Shot(camera, begin, share * closing, length))
        begin = share * closing
    return [*filmed, Shot("arrival", closing, end, CLOSING_LENGTH), Shot("arrival", end, end, LAST_LOOK)]


def storyboard(run: FleetRun, direction: str = TOUR, fps: int = 24) -> list[Frame]:
    """The frames of the video of a run, 1/fps seconds apart."""
    return frames_of(shots(run, direction), notices(run), fps, TURN)
