"""Shots and frames, of which every video is made.

A shot list is a sequence of shots without gaps over the time of a run; a frame is one picture of one of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from mathnavi.interfaces.errors import ArgumentError

TOUR = "tour"  # the direction that cuts between the cameras
ANNOTATION_LENGTH = 1.8  # [s] of video for which an event stays in sight, unless a cut comes first

Annotation = tuple[float, str]  # time [s] of the run, and what a viewer should know from then on


@dataclass(frozen=True)
class Shot:
    """Stretch of the flight filmed by one camera."""

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
    """Picture of the video."""

    t: float  # [s] of flight
    camera: str
    turn: float  # [degrees] by which a camera that turns has turned, zero in the middle of the video
    rate: float  # seconds of flight for each second of video; 0 where time stands still
    annotation: str = ""  # what just happened
    brief: bool = False  # whether it has to be read at the size of a thumbnail: few words, in large letters


def consecutive(cuts: Sequence[float], shots: Sequence[tuple[str, float]]) -> list[Shot]:
    """Shots from cut to cut.

    Args:
        cuts: (n + 1,) times [s] of flight; two equal ones hold a moment.
        shots: (n,) camera and length [s] of video of each shot.
    """
    return [
        Shot(camera, begin, end, length) for (camera, length), (begin, end) in zip(shots, pairwise(cuts), strict=True)
    ]


def checked_camera(camera: str, cameras: Sequence[str]) -> str:
    """Return ``camera`` if it is one of ``cameras``; ArgumentError names them if it is not."""
    if camera not in cameras:
        raise ArgumentError(f"camera = {camera!r}; allowed: {', '.join(cameras)}")
    return camera


def frames_of(shots: Sequence[Shot], annotations: Sequence[Annotation], fps: float, turn: float) -> list[Frame]:
    """The frames of a video, 1/fps seconds apart.

    Args:
        shots: the shot list, in order.
        annotations: in order of time.
        fps: frames a second; ArgumentError for less than one.
        turn: [degrees/s of video] at which the cameras that turn do.
    """
    if fps < 1:
        raise ArgumentError(f"fps = {fps:g}; allowed: at least 1")
    frames: list[Frame] = []
    total = sum(shot.length for shot in shots)
    coming = list(annotations)
    for shot in shots:
        shown: list[tuple[float, str]] = []  # (time [s] of video, text) since the cut
        count = round(shot.length * fps)
        for k in range(count):
            now = len(frames) / fps
            t = shot.begin + (shot.end - shot.begin) * k / count
            while coming and coming[0][0] <= t + 1e-6:
                shown.append((now, coming.pop(0)[1]))
            recent = " · ".join(text for begun, text in shown if now - begun < ANNOTATION_LENGTH)
            frames.append(Frame(t, shot.camera, turn * (now - 0.5 * total), shot.rate, recent))
    return frames
