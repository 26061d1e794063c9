"""The child process that draws: a job as JSON on standard input, raw pictures on standard output.

Drawing has a process of its own for two reasons: OpenGL's backend must be chosen before mujoco is imported, and
two processes draw a video on two cores. ``mathnavi.renders.video`` starts it.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import BinaryIO

from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.film import Frame
from mathnavi.sim.plugin.trust import trusting


def draw(job: dict[str, object], output: BinaryIO) -> None:
    """Write the pictures of a job's frames to ``output``, in order."""
    directory = Path(str(job["directory"]))
    with trusting(bool(job["trusted"])):
        drawing = drawing_of(directory)
    width, height, samples = (int(str(job[name])) for name in ("width", "height", "samples"))
    frames = job["frames"]
    assert isinstance(frames, list)
    with drawing.painter(drawing.load_run(directory), width, height, samples) as painter:
        for fields in frames:
            output.write(painter.paint(Frame(*fields)).tobytes())
            output.flush()


def main() -> None:
    """Draw the job on standard input."""
    # Libraries print what they like: keep standard output for pictures alone.
    pictures = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    draw(json.load(sys.stdin), pictures)
