"""Which moment of a flight each frame of its video shows, from where.

A whole flight lasts four minutes or more, its video twenty seconds. The tour spends most of them beside the vehicle: at
the start, where something happens, and at the arrival; the overview and the top view cover the long ways between.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from renders.run_data import RunData

Camera = Literal["chase", "overview", "top"]
Direction = Literal["tour", "chase", "overview", "top"]

EXAGGERATION = 1.7  # of heights in the overview and the top view
TURN = 0.8  # [degrees/s] at which the overview turns around the map
NOTICE_LENGTH = 1.6  # [s] of video for which an event stays in sight
MANY = 12  # events of one kind, of which a video cannot tell each
LAST_LOOK = 1.0  # [s] of video for which the last moment stays
SHOT_LENGTHS = (2.2, 3.8, 3.2, 4.6, 2.6, 3.6)  # [s] of video: the tour's shots before the last look
FORCED_LENGTH = 19.0  # [s] of video before the last look, where one camera films everything


@dataclass(frozen=True)
class Shot:
    """A stretch of the flight filmed by one camera."""

    camera: Camera
    begin: float  # [s] of flight
    end: float  # [s] of flight
    length: float  # [s] of video

    @property
    def rate(self) -> float:
        """Seconds of flight for each second of video."""
        return (self.end - self.begin) / self.length


@dataclass(frozen=True)
class Frame:
    """One picture of the video."""

    t: float  # [s] of flight
    camera: Camera
    turn: float  # [degrees] of the overview
    rate: float  # seconds of flight for each second of video; 0 where time stands still
    notice: str = ""  # what just happened


def highlight(run: RunData) -> float:
    """The moment [s] that deserves a close look: a radar pops up, or the ground is closest in mid-flight."""
    late_radars = [radar.time for radar in run.mission.radars if 0.0 < radar.time < run.duration]
    if late_radars:
        return min(late_radars)
    middle = (run.t >= 0.25 * run.duration) & (run.t <= 0.75 * run.duration)
    heights = np.where(middle & np.isfinite(run.above_ground), run.above_ground, np.inf)
    return float(run.t[np.argmin(heights)])


def notices(run: RunData) -> list[tuple[float, str]]:
    """(time [s], text) of what happened, in order of time; of a kind that happens all the time only the first event."""
    count = Counter(event.kind for event in run.events)
    told: set[str] = set()
    found = [(radar.time, "radar on") for radar in run.mission.radars if radar.time > 0.0]
    for event in run.events:
        if event.kind == "message":  # the radar that it announces is on the list already
            continue
        text = event.kind.replace("-", " ")
        if count[event.kind] > MANY:
            text += f", {count[event.kind]} times in this flight"
        elif event.message:
            text += f": {event.message}"
        if event.kind not in told or count[event.kind] <= MANY:
            told.add(event.kind)
            found.append((event.t, text if len(text) <= 76 else text[:75] + "…"))
    return sorted(found)


def shots(run: RunData, direction: Direction = "tour") -> list[Shot]:
    """The shots of the video of a run, in order; they cover the whole flight."""
    if direction not in get_args(Direction):
        raise ValueError(f"camera {direction!r} is not known; allowed are {', '.join(get_args(Direction))}")
    end = run.duration
    if direction != "tour":
        return [Shot(direction, 0.0, end, FORCED_LENGTH), Shot(direction, end, end, LAST_LOOK)]
    close = float(np.clip(highlight(run) / end - 0.02, 0.18, 0.80))
    cuts = np.array([0.0, 0.03, 0.10, close, close + 0.08, 0.94, 1.0]) * end
    cameras: tuple[Camera, ...] = ("overview", "chase", "overview", "chase", "top", "chase")
    filmed = [
        Shot(camera, float(a), float(b), length)
        for camera, a, b, length in zip(cameras, cuts[:-1], cuts[1:], SHOT_LENGTHS, strict=True)
    ]
    return [*filmed, Shot("overview", end, end, LAST_LOOK)]


def storyboard(run: RunData, direction: Direction = "tour", fps: int = 24) -> list[Frame]:
    """The frames of the video of a run, 1/fps seconds apart."""
    if fps < 1:
        raise ValueError(f"fps is {fps}; allowed is a whole number of at least 1")
    frames: list[Frame] = []
    total = sum(shot.length for shot in shots(run, direction))
    coming = notices(run)
    notice, shown = "", 0.0  # the latest, and since when [s] of video
    for shot in shots(run, direction):
        count = round(shot.length * fps)
        for k in range(count):
            now = len(frames) / fps
            t = shot.begin + (shot.end - shot.begin) * k / count
            while coming and coming[0][0] <= t + 1e-6:
                (_, notice), shown = coming.pop(0), now
            lately = notice if now - shown < NOTICE_LENGTH else ""
            frames.append(Frame(t, shot.camera, TURN * (now - 0.5 * total), shot.rate, lately))
    return frames
