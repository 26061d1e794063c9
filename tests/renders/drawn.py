"""Pictures that another process draws (``draw_and_leave_out.py``), where two of them differ, and those of a video."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import av
import numpy as np
import pytest

from mathnavi.renders import opengl, video
from mathnavi.renders.video import write_video
from mathnavi.sim.interfaces.signals import Array

SCRIPT = Path(__file__).with_name("draw_and_leave_out.py")
needs_opengl = pytest.mark.skipif(opengl.available() is None, reason=opengl.HOW_TO_INSTALL)


def drawn(kind: str, folder: Path, *runs: Path) -> Mapping[str, Array]:
    """Pictures of runs of a kind, with and without parts of what they show, drawn into ``folder``."""
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


def video_pictures(run: Path, folder: Path, monkeypatch: pytest.MonkeyPatch, fps: int = 2) -> list[Array]:
    """Pictures (90, 160, 3) of a small video written into an empty folder, which has the size and rate asked for."""
    monkeypatch.setattr(video, "MOST_WORKERS", 1)  # a start costs more than these few pictures
    path = write_video(run, path=folder / "run.mp4", width=160, height=90, fps=fps, progress=False)
    assert [file.name for file in folder.iterdir()] == ["run.mp4"]
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(stream)]
        assert (stream.width, stream.height, stream.average_rate) == (160, 90, fps)
    assert min(picture.std() for picture in pictures) > 10.0
    return pictures
