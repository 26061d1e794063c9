"""Pictures drawn in this process, which spares the start of another, or in one of their own; where two of them differ,
and some of a video's.

Every scene is drawn here by the code that a process which draws runs (``mathnavi.renders.worker``); that such a process
draws the same, and closes its renderer, is tested once, with a flight.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Generator, Mapping, Sequence
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from mathnavi.interfaces.signals import Array
from mathnavi.models import opengl
from mathnavi.renders import video, worker
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.film import TOUR, Frame
from mathnavi.renders.palette import Picture
from mathnavi.sim.plugin.trust import is_trusted

SCRIPT = Path(__file__).with_name("draw_and_leave_out.py")
needs_opengl = pytest.mark.skipif(opengl.available() is None, reason="no OpenGL makes a context here")
draw_apart = video.draw  # by processes of their own, as for a user


def draw_here(directory: Path, frames: Sequence[Frame], width: int, height: int, samples: int) -> Generator[Picture]:
    """The pictures (height, width, 3) that ``mathnavi.renders.video.draw`` yields, drawn in this process."""
    opengl.environment()  # raises where there is nothing to draw with
    job = {
        "directory": str(directory.resolve()), "trusted": is_trusted(), "width": width, "height": height,
        "samples": samples,
    }  # fmt: skip
    output = io.BytesIO()
    worker.draw(json.loads(json.dumps(job | {"frames": [astuple(frame) for frame in frames]})), output)
    yield from np.frombuffer(output.getbuffer(), np.uint8).reshape(-1, height, width, 3)


def drawn(kind: str, folder: Path, *runs: Path) -> Mapping[str, Array]:
    """Pictures of runs of a kind, with and without parts of what they show, drawn into ``folder``."""
    from tests.renders import draw_and_leave_out  # imports mujoco, which reads the backend then

    out = folder / "out.npz"
    draw_and_leave_out.main(kind, str(out), *map(str, runs))
    return dict(np.load(out))


def drawn_apart(kind: str, folder: Path, *runs: Path) -> Mapping[str, Array]:
    """The pictures of ``drawn``, by a process of their own, which has nothing to complain of when it ends."""
    out = folder / "out.npz"
    environment = opengl.environment() | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, str(SCRIPT), kind, str(out), *map(str, runs)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""  # an unclosed renderer complains at exit
    return dict(np.load(out))


def differing(one: Array, other: Array, least: int = 12) -> tuple[Array, Array]:
    """Rows and columns of the pixels of which a channel differs by more than ``least``."""
    rows, columns = np.nonzero(np.abs(one.astype(int) - other.astype(int)).max(axis=-1) > least)
    return rows, columns


def video_pictures(run: Path) -> tuple[int, list[Array]]:
    """Number of the pictures of a video of one picture a second, and the first four and the last (90, 160, 3).

    How pictures become a video is tested with a flight.
    """
    drawing = drawing_of(run)
    frames = drawing.frames(drawing.load_run(run), TOUR, 1)
    pictures = list(draw_here(run, [*frames[:4], frames[-1]], 160, 90, video.VIDEO_SAMPLES))
    assert min(picture.std() for picture in pictures) > 10.0
    return len(frames), pictures
