"""The child process that draws: a job as JSON on standard input, raw pictures on standard output.

Drawing has a process of its own for two reasons: OpenGL's backend must be chosen before mujoco is imported, and
two processes draw a video on two cores. ``renders.video`` starts it.
"""

from __future__ import annotations

import json
import os
import sys
from typing import BinaryIO

import numpy as np

from renders.caption import Caption
from renders.palette import Part
from renders.run_data import RunData, load_run
from renders.scene import Scene
from renders.storyboard import Frame
from sim.signals import Array


def label_places(run: RunData, t: float) -> tuple[list[str], Array]:
    """Names and map points (n, 3) [m] of what is labelled."""
    names, points = [Part.START.value, Part.TARGET.value], [run.mission.start, run.mission.target]
    for number, radar in enumerate(run.mission.radars, start=1):
        if t >= radar.time:
            names.append(Part.RADAR.value if len(run.mission.radars) == 1 else f"{Part.RADAR.value} {number}")
            points.append(np.array([radar.x, radar.y, float(run.terrain.height(radar.x, radar.y))]))
    return names, np.array(points)


def draw(job: dict[str, object], output: BinaryIO) -> None:
    """Write the pictures of a job's frames to ``output``, in order."""
    run = load_run(str(job["directory"]))
    width, height, samples = (int(str(job[name])) for name in ("width", "height", "samples"))
    caption = Caption(run, width, height)
    frames = job["frames"]
    assert isinstance(frames, list)
    with Scene(run, width, height, samples) as scene:
        for fields in frames:
            frame = Frame(*fields)
            picture = scene.draw(frame.t, frame.camera, frame.turn)
            labels = []
            if frame.camera != "chase":
                names, places = label_places(run, frame.t)
                pixels = scene.pixels(places, frame.camera)
                labels = [(name, float(c), float(r)) for name, (c, r, _) in zip(names, pixels, strict=True)]
            output.write(caption.write(picture, frame, labels).tobytes())
            output.flush()


if __name__ == "__main__":
    # Libraries print what they like: keep standard output for pictures alone.
    pictures = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    draw(json.load(sys.stdin), pictures)
