"""Video or still of a run: drawn by child processes (``mathnavi.renders.worker``), encoded here.

The frames are dealt to the processes in turn and collected in turn, so the result does not depend on their number.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import tempfile
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, nullcontext, suppress
from dataclasses import astuple
from fractions import Fraction
from pathlib import Path
from typing import IO, Any

import numpy as np
from PIL import Image
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from mathnavi.interfaces.checks import checked_ending
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.writing import naming, whole_files, write_bytes
from mathnavi.models import opengl
from mathnavi.renders.child import DrawingFailedError, child_command, last_line
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.encoding import FORMATS, Codec, checked_codec, checked_rate, checked_size, encode
from mathnavi.renders.film import TOUR, Frame, checked_camera
from mathnavi.renders.heartbeat import lines_of_progress
from mathnavi.renders.palette import Picture
from mathnavi.sim.plugin.trust import is_trusted

VIDEO_SAMPLES, STILL_SAMPLES = 0, 4  # per pixel: a video blurs its edges by moving
MOST_WORKERS = 4

STILLS: dict[str, tuple[str, dict[str, Any]]] = {
    ".png": ("PNG", {"optimize": True}),
    ".jpg": ("JPEG", {"quality": 90}),
    ".jpeg": ("JPEG", {"quality": 90}),
    ".webp": ("WEBP", {"quality": 90}),
}
"""formats of a still by the endings of their files, with Pillow's options"""


def write_video(
    run_dir: str | Path,
    camera: str = TOUR,
    *,
    path: str | Path | None = None,
    width: int | None = None,
    height: int | None = None,
    fps: float | Fraction | None = None,
    progress: bool = True,
    codec: Codec | None = None,
) -> Path:
    """Write the video of a run, ``video.mp4`` in its folder if ``path`` is not given, whole or not at all.

    12 to 25 s for a whole run; "tour" cuts between the cameras, the others stay. The ending of ``path`` says the
    format: .mp4, .webm, .gif or .webp. ``width`` and ``height`` [pixels] are 1280 x 720, ``fps`` 24 pictures a second,
    of a GIF or WebP 640 x 360 and 12, if not given. ``codec``: H.264, in MP4 only, plays everywhere; AV1 and VP9 are
    encoded without a library under the GPL. Raises FileNotFoundError or ArgumentError for a run that is missing or
    broken, for an unknown camera, another ending, and a codec that the format does not hold or FFmpeg here does not
    encode, ``opengl.NoOpenGLError`` if OpenGL is not available.
    """
    with video_begun(
        run_dir, camera, path=path, width=width, height=height, fps=fps, progress=progress, codec=codec
    ) as finish:
        return finish()


@contextmanager
def video_begun(
    run_dir: str | Path,
    camera: str = TOUR,
    *,
    path: str | Path | None = None,
    width: int | None = None,
    height: int | None = None,
    fps: float | Fraction | None = None,
    progress: bool = True,
    codec: Codec | None = None,
) -> Iterator[Callable[[], Path]]:
    """Begin the video that ``write_video`` writes, with the same arguments and errors; what is yielded finishes it.

    The processes that draw make the scene in between. They end with the block.
    """
    directory = Path(run_dir)
    target = directory / "video.mp4" if path is None else path
    ending = checked_ending(target, FORMATS)
    form, chosen = FORMATS[ending], checked_codec(codec, ending)
    size = checked_size(form.size[0] if width is None else width, form.size[1] if height is None else height)
    rate = checked_rate(form.fps if fps is None else fps, form.fastest)
    target, drawing = Path(target), drawing_of(run_dir)
    frames = drawing.frames(drawing.load_run(directory), camera, float(rate))
    with closing(draw(directory, frames, *size, VIDEO_SAMPLES)) as pictures:

        def finish() -> Path:
            with whole_files(target) as (scratch,), naming(target):
                encode(scratch, counted(pictures, "video", len(frames), progress), size, rate, form, chosen)
            return target

        yield finish


def counted(pictures: Iterable[Picture], name: str, total: int, shown: bool) -> Generator[Picture]:
    """The pictures as they come, counted on standard error if ``shown``: by a bar, or by lines without a terminal."""
    console = Console(stderr=True, markup=False, emoji=False)
    bar = Progress(
        TextColumn(name), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        console=console, disable=not (shown and console.is_terminal),
    )  # fmt: skip
    number = 0
    with bar, lines_of_progress(console, lambda: f"{name}: {number} of {total} frames") if shown else nullcontext():
        for picture in bar.track(pictures, total=total):
            yield picture
            number += 1


def write_still(
    run_dir: str | Path,
    camera: str | None = None,
    path: str | Path | None = None,
    *,
    t: float | None = None,
    width: int = 1280,
    height: int = 720,
) -> Path:
    """Write a picture of a run, ``CAMERA.png`` in its folder if ``path`` is not given.

    It shows the moment ``t`` [s], by default the middle of the run's highlight. The ending of ``path`` says the
    format: .png, .jpg, .jpeg or .webp. Errors as of ``write_video``.
    """
    ending = ".png" if path is None else checked_ending(path, STILLS)
    width, height = checked_size(width, height)
    directory, drawing = Path(run_dir), drawing_of(run_dir)
    run = drawing.load_run(directory)
    if t is not None and not 0.0 <= t <= run.duration:
        raise ArgumentError(f"time = {t:g} s; allowed: 0 to {run.duration:g} s, the length of the run")
    moment = sum(drawing.highlight(run)) / 2.0 if t is None else t
    shown = drawing.still_camera if camera is None else checked_camera(camera, drawing.cameras)
    target = Path(path) if path is not None else directory / f"{shown}.png"
    with closing(draw(directory, [Frame(moment, shown, 0.0, 0.0)], width, height, STILL_SAMPLES)) as pictures:
        picture = next(pictures)
    file = io.BytesIO()
    form, options = STILLS[ending]
    Image.fromarray(picture).save(file, format=form, **options)
    write_bytes(target, file.getvalue())
    return target


def draw(directory: Path, frames: Sequence[Frame], width: int, height: int, samples: int) -> Generator[Picture]:
    """The pictures (height, width, 3) of the frames, in order; close the iterator to stop the processes that draw.

    They begin at once, before the first picture is requested.
    """
    pictures = _drawn(directory, frames, width, height, samples)
    next(pictures)
    return pictures


def _drawn(directory: Path, frames: Sequence[Frame], width: int, height: int, samples: int) -> Generator[Picture]:
    """An empty picture as soon as the processes that draw have been started, then those of the frames."""
    environment = opengl.environment()
    count = max(1, min(len(os.sched_getaffinity(0)), MOST_WORKERS, len(frames)))
    if count > 1:
        environment |= {"LP_NUM_THREADS": "1"}  # Mesa's software renderer would use every core in each process
    job = {
        "directory": str(directory.resolve()), "trusted": is_trusted(), "width": width, "height": height,
        "samples": samples,
    }  # fmt: skip
    # What draws with a graphics card must not fork.
    forks, starts = (count, 1) if opengl.draws_by_software() else (1, count)
    with ExitStack() as stack:
        crew = [
            stack.enter_context(
                _Artists(job | {"frames": [astuple(frame) for frame in frames[k::starts]]}, forks, environment)
            )
            for k in range(starts)
        ]
        yield np.empty((0, 0, 3), np.uint8)
        for k in range(len(frames)):
            data = crew[k % starts].read(k // starts % forks, 3 * width * height)
            yield np.frombuffer(data, np.uint8).reshape(height, width, 3)


class _Artists:
    """A process that draws, and those that it forks; they end with the context."""

    def __init__(self, job: dict[str, object], count: int, environment: dict[str, str]) -> None:
        self._errors: list[IO[bytes]] = [tempfile.TemporaryFile() for _ in range(count)]  # noqa: SIM115
        pipes = [os.pipe() for _ in range(count)]
        self._pictures = [os.fdopen(read, "rb") for read, _ in pipes]
        outputs, errors = [write for _, write in pipes], [file.fileno() for file in self._errors]
        self._process = subprocess.Popen(
            child_command("mathnavi.renders.worker"),
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=self._errors[0],
            env=environment,
            pass_fds=(*outputs, *errors),
            process_group=0,
        )
        for output in outputs:
            os.close(output)
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(job | {"outputs": outputs, "errors": errors}).encode())
        self._process.stdin.close()

    def __enter__(self) -> _Artists:
        return self

    def __exit__(self, *_: object) -> None:
        for pictures in self._pictures:
            pictures.close()
        with suppress(ProcessLookupError):  # they have all ended
            os.killpg(self._process.pid, signal.SIGTERM)
        self._process.wait()
        for errors in self._errors:
            errors.close()

    def read(self, artist: int, size: int) -> bytes:
        """Read a number of bytes of an artist's pictures; DrawingFailedError with its last error if it has ended."""
        data = self._pictures[artist].read(size)
        if len(data) == size:
            return data
        raise DrawingFailedError(f"the process that draws ended: {last_line(self._errors[artist])}")
