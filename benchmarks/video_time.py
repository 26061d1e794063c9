"""Time of the 1080p video of a mission, and of its parts.

    python -m benchmarks.video_time [--repetitions 2]

The mission of ``make fly`` is flown once; its video is written as by ``mathnavi render``, with one drawing process for
each core and one that encodes, and wall-clock time is measured. Then the parts are measured: the scene, made once; the
drawing of a frame, of which the bare scene is OpenGL's share (OSMesa, a software renderer, on one thread, if there is
no graphics card); the overlay; and the process that collects and encodes the frames.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any
from unittest import mock

import numpy as np
from annotated_types import Ge
from rich.console import Console
from rich.table import Table

from benchmarks import OPENGL
from benchmarks.arguments import read_arguments
from benchmarks.comparison import Comparison, alone, within
from benchmarks.mission_cost import MISSION, missions
from benchmarks.progress import progress
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models import opengl
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.encoding import FORMATS
from mathnavi.renders.film import TOUR
from mathnavi.renders.video import write_video

LIMIT = 10.0  # [s] of the whole video
PARTS = Path(__file__).with_name("video_parts.py")


@configuration
class Arguments:
    """Measure the time of the video of a mission."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    width: int = 1920
    """width of the video [pixels]"""
    height: int = 1080
    """height of the video [pixels]"""
    fps: int = FORMATS[".mp4"].fps
    """frame rate of the video [1/s]"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 2
    """number of videos"""
    frames: Annotated[int, Within(Ge(1), allowed=">= 1")] = 48
    """number of frames on which the parts are measured"""
    out: Path = Path("renders/out/video_time.json")
    """file of the figures"""


@dataclass(frozen=True, eq=False)
class VideoFindings:
    """Wall-clock time of the video, and CPU time of its parts."""

    size: tuple[int, int]  # [pixels]
    frames: int  # of the video
    wall: Array  # (R,) [s]
    parts: dict[str, float]  # [s] CPU time: "scene" once; "frame", "drawing", "bare", "encoding" of one frame

    @property
    def title(self) -> str:
        return f"video of a mission, {self.frames} frames of {self.size[0]} x {self.size[1]}"

    def comparisons(self) -> list[Comparison]:
        frame, bare = (np.array([1e3 * self.parts[name]]) for name in ("frame", "bare"))
        return [
            within("the whole", "s", self.wall, LIMIT),
            Comparison("a frame without encoding, CPU", "ms", frame, bare, "bare OpenGL", "ours / other"),
        ]

    def show(self, console: Console) -> None:
        parts = self.parts
        whole = parts["scene"] + self.frames * (parts["frame"] + parts["encoding"])
        shown = Table("part", title=f"CPU time of a video, {whole:.1f} s in all")
        for heading in ("a frame [ms]", "all [s]"):
            shown.add_column(heading, justify="right")
        shown.add_row("the scene, once", "", f"{parts['scene']:.2f}")
        for name, taken in (
            ("bare scene, by OpenGL", parts["bare"]),
            ("lines, sky, places", parts["drawing"] - parts["bare"]),
            ("overlay", parts["frame"] - parts["drawing"]),
            ("collecting and encoding", parts["encoding"]),
        ):
            shown.add_row(name, f"{1e3 * taken:.1f}", f"{self.frames * taken:.2f}")
        console.print(shown)

    def plain(self) -> dict[str, Any]:
        return {"frames": self.frames, "wall_s": self.wall.tolist(), "parts_s": self.parts}


def run(arguments: Arguments, console: Console, mission: dict[str, Any] = MISSION) -> VideoFindings:
    """Fly a mission, write its videos, and measure the parts of a video."""
    with mock.patch.dict(os.environ, MUJOCO_GL=OPENGL):
        return _run(arguments, console, mission)


def _run(arguments: Arguments, console: Console, mission: dict[str, Any]) -> VideoFindings:
    size = (arguments.width, arguments.height)
    wall, encoding = [], []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        missions(arguments.terrain, mission)[0].flown().save(folder / "run")
        drawing = drawing_of(folder / "run")
        count = len(drawing.frames(drawing.load_run(folder / "run"), TOUR, arguments.fps))
        with progress(console, "videos", arguments.repetitions) as report:
            for repetition in range(arguments.repetitions):
                before, began = time.process_time(), time.perf_counter()
                write_video(
                    folder / "run", path=folder / "video.mp4", width=size[0], height=size[1], fps=arguments.fps,
                    progress=False,
                )  # fmt: skip
                wall.append(time.perf_counter() - began)
                encoding.append((time.process_time() - before) / count)
                report(repetition + 1)
        parts = drawn(folder / "run", size, arguments.frames) | {"encoding": float(np.median(encoding))}
    return VideoFindings(size, count, np.array(wall), parts)


def drawn(directory: Path, size: tuple[int, int], frames: int) -> dict[str, float]:
    """Return the CPU time [s] of the drawn parts; RuntimeError if the drawing process fails."""
    root = Path(__file__).parents[1]
    environment = opengl.environment() | {"LP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""}
    done = subprocess.run(
        [sys.executable, "-m", f"benchmarks.{PARTS.stem}", str(directory), *map(str, size), str(frames)],
        cwd=root, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"{PARTS.name}: exit code {done.returncode}: {done.stderr[-2000:]}")
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def main(arguments: Arguments) -> None:
    alone("video_time", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
