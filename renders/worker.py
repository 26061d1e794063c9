"""The child process that draws: a job as JSON on standard input, raw pictures on standard output.

Drawing has a process of its own for two reasons: OpenGL's backend must be chosen before mujoco is imported, and
two processes draw a video on two cores. ``renders.video`` starts it.
"""

from __future__ import annotations

import json
import os
import sys
from typing import BinaryIO

from renders.caption import Caption
from renders.run_data import load_run
from renders.scene import Scene
from renders.storyboard import Frame


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
            output.write(caption.write(picture, frame, scene.labels(frame.t, frame.camera)).tobytes())
            output.flush()


if __name__ == "__main__":
    # Libraries print what they like: keep standard output for pictures alone.
    pictures = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    draw(json.load(sys.stdin), pictures)
