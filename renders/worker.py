"""Child process that draws: a job as JSON on standard input, raw pictures to the files that the job names.

Drawing has a separate process for two reasons: OpenGL's backend must be chosen before mujoco is imported, and
two processes draw a video on two cores. ``mathnavi.renders.video`` starts it. With several files it makes the scene,
the ground's texture above all, and then forks: one process a file, each with its share of the frames.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.film import Frame
from mathnavi.sim.plugin.trust import trusting


def draw(job: dict[str, Any], output: BinaryIO) -> None:
    """Write the pictures of a job's frames to ``output``, in order."""
    with _painter(job) as painter:
        _paint(painter, job["frames"], output)


@contextmanager
def _painter(job: dict[str, Any]) -> Iterator[Any]:
    directory = Path(job["directory"])
    with trusting(job["trusted"]):
        drawing = drawing_of(directory)
    with drawing.painter(drawing.load_run(directory), job["width"], job["height"], job["samples"]) as painter:
        yield painter


def _paint(painter: Any, frames: Sequence[Sequence[Any]], output: BinaryIO) -> None:
    for fields in frames:
        output.write(painter.paint(Frame(*fields)).tobytes())
        output.flush()


def main() -> None:
    """Draw the job on standard input; process k writes every ``count``-th picture, from number k on, to its output."""
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # libraries print what they like
    job = json.load(sys.stdin)
    outputs, errors = job["outputs"], job["errors"]
    with _painter(job) as painter:
        own = _forked(len(outputs))
        os.dup2(errors[own], sys.stderr.fileno())
        for k, output in enumerate(outputs):
            if k != own:
                os.close(output)
        # Not closed before the process ends: the reader sees the end only when all errors have been written.
        _paint(painter, job["frames"][own :: len(outputs)], open(outputs[own], "wb", closefd=False))  # noqa: SIM115
    for _ in range(1, len(outputs) if own == 0 else 1):
        os.wait()


def _forked(count: int) -> int:
    """Fork into ``count`` processes; the number of this one, 0 for the first."""
    return next((k for k in range(1, count) if os.fork() == 0), 0)
