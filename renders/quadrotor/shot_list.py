"""Shot list of the video of a quadrotor's flight, and the annotations over it.

The vehicle is a metre wide and its way half a kilometre long: most of the video goes behind it, the overview and the
top view say where in the canyon that is.
"""

from __future__ import annotations

from mathnavi.renders.film import TOUR, Annotation, Shot, consecutive
from mathnavi.renders.flight import shot_list as flights
from mathnavi.renders.quadrotor.run_data import QuadrotorRun

CAMERAS = ("chase", "overview", "top")
TURN = 1.2  # [degrees/s of video] at which the overview turns
LAST_MOMENT = 1.6  # [s of video] for which the last moment stays
# Cameras, lengths [s of video] and ends [share of the flight] of the tour's shots.
SHOTS = (
    ("overview", 2.6, 0.05),
    ("chase", 7.6, 0.42),
    ("top", 2.4, 0.55),
    ("chase", 7.0, 0.90),
    ("overview", 1.8, 1.0),
)
FORCED_LENGTH = 20.0  # [s of video] before the last moment, where one camera films everything


def highlight(run: QuadrotorRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see: about the moment at which the ground is closest in
    mid-flight.
    """
    return flights.highlight(run.flight)


def annotations_of(run: QuadrotorRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time."""
    return flights.annotations_of(run.flight)


def shot_list(run: QuadrotorRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole flight."""
    end = run.duration
    if direction != TOUR:
        return consecutive((0.0, end, end), ((direction, FORCED_LENGTH), (direction, LAST_MOMENT)))
    cuts = (0.0, *(share * end for _, _, share in SHOTS), end)
    return consecutive(cuts, (*((camera, length) for camera, length, _ in SHOTS), ("overview", LAST_MOMENT)))
