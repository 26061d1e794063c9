"""From shots to frames: what every video is made of, whatever flew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

NOTICE_LENGTH = 1.8  # [s] of video for which an event stays in sight, unless a cut comes first


@dataclass(frozen=True)
class Shot:
    """A stretch of the flight filmed by one camera."""

    camera: str
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
    camera: str
    turn: float  # [degrees] by which a camera that turns has turned, zero in the middle of the video
    rate: float  # seconds of flight for each second of video; 0 where time stands still
    notice: str = ""  # what just happened
    brief: bool = False  # whether it has to be read at the size of a thumbnail: few words, in large letters


def frames_of(shots: Sequence[Shot], notices: Sequence[tuple[float, str]], fps: int, turn: float) -> list[Frame]:
    """The frames of a video, 1/fps seconds apart.

    ``notices`` are (time [s], text) in order of time, ``turn`` is in degrees a second of video.
    """
    if fps < 1:
        raise ValueError(f"fps = {fps}; allowed: a whole number of at least 1")
    frames: list[Frame] = []
    total = sum(shot.length for shot in shots)
    coming = list(notices)
    for shot in shots:
        told: list[tuple[float, str]] = []  # (time [s] of video, text) since the cut
        count = round(shot.length * fps)
        for k in range(count):
            now = len(frames) / fps
            t = shot.begin + (shot.end - shot.begin) * k / count
            while coming and coming[0][0] <= t + 1e-6:
                told.append((now, coming.pop(0)[1]))
            lately = " · ".join(text for shown, text in told if now - shown < NOTICE_LENGTH)
            frames.append(Frame(t, shot.camera, turn * (now - 0.5 * total), shot.rate, lately))
    return frames
