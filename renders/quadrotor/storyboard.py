"""Which moment of a quadrotor's flight each frame of its video shows, from where.

The vehicle is a metre wide and its way half a kilometre long: most of the video goes behind it, the overview and the
top view say where in the canyon that is.
"""

from __future__ import annotations

from mathnavi.renders.drawing import TOUR, checked_camera
from mathnavi.renders.film import Frame, Shot, frames_of
from mathnavi.renders.flight import storyboard as flights
from mathnavi.renders.quadrotor.run_data import QuadrotorRun

CAMERAS = ("chase", "overview", "top")
TURN = 1.2  # [degrees/s of video] at which the overview turns
LAST_LOOK = 1.6  # [s of video] for which the last moment stays
# Cameras, lengths [s of video] and ends [share of the flight] of the tour's shots.
SHOTS = (
    ("overview", 2.6, 0.05),
    ("chase", 7.6, 0.42),
    ("top", 2.4, 0.55),
    ("chase", 7.0, 0.90),
    ("overview", 1.8, 1.0),
)
FORCED_LENGTH = 20.0  # [s of video] before the last look, where one camera films everything


def highlight(run: QuadrotorRun) -> tuple[float, float]:
    """From when to when [s] to look closely: about the moment at which the ground is closest in mid-flight."""
    return flights.highlight(run.flight)


def notices(run: QuadrotorRun) -> list[tuple[float, str]]:
    """(time [s], text) of what a viewer should be told, in order of time."""
    return flights.notices(run.flight)


def shots(run: QuadrotorRun, direction: str = TOUR) -> list[Shot]:
    """The shots of the video of a run, in order; they cover the whole flight."""
    end = run.duration
    if direction != TOUR:
        return [Shot(checked_camera(direction, CAMERAS), 0.0, end, FORCED_LENGTH), Shot(direction, end, end, LAST_LOOK)]
    filmed, begin = [], 0.0
    for camera, length, share in SHOTS:
        filmed.append(Shot(camera, begin, share * end, length))
        begin = share * end
    return [*filmed, Shot("overview", end, end, LAST_LOOK)]


def storyboard(run: QuadrotorRun, direction: str = TOUR, fps: int = 24) -> list[Frame]:
    """The frames of the video of a run, 1/fps seconds apart."""
    return frames_of(shots(run, direction), notices(run), fps, TURN)
