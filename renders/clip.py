"""Clip of a few seconds of a run as a small animated WebP, which a README or a page plays by itself, repeatedly.

It has one camera, one stretch of the run, no cuts; its overlay is brief (``film.Frame.brief``). The last picture
stays for a moment before it begins again.
"""

from __future__ import annotations

import io
from contextlib import closing
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from PIL import Image

from mathnavi.interfaces.checks import check, checked_ending
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.writing import write_bytes
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.encoding import FORMATS, checked_rate, checked_size, starts
from mathnavi.renders.film import Shot, checked_camera, frames_of
from mathnavi.renders.video import STILL_SAMPLES, counted, draw

WIDTH, HEIGHT, FPS = 640, 360, 12
LENGTH, LAST_MOMENT = 5.0, 1.0  # [s] of the clip: while time passes, and for which its last picture stays
LONGEST = 60.0  # [s]
MOST_BYTES = 1_200_000
QUALITIES = (80, 70, 60, 50, 40, 30)  # of WebP, in [0, 100]: the first that keeps to that


def write_clip(
    run_dir: str | Path,
    camera: str | None = None,
    *,
    begin: float | None = None,
    end: float | None = None,
    path: str | Path | None = None,
    width: int = WIDTH,
    height: int = HEIGHT,
    fps: float = FPS,
    length: float = LENGTH,
    progress: bool = False,
) -> Path:
    """Write a clip of a run, ``CAMERA.webp`` in its folder if no ``path`` to a .webp is given, whole or not at all.

    It shows the run from ``begin`` to ``end`` [s], by default those of its highlight, or of the run if that is one
    moment, within ``length`` [s]. Raises as ``video.write_video`` does, ValueError for moments outside of the run or
    out of order, and RuntimeError if even the lowest quality takes more than ``MOST_BYTES``.
    """
    if path is not None:
        checked_ending(path, (".webp",))
    width, height = checked_size(width, height)
    rate = checked_rate(fps, FORMATS[".webp"].fastest)
    check(length, "length", float(1 / rate), LONGEST)
    directory, drawing = Path(run_dir), drawing_of(run_dir)
    run = drawing.load_run(directory)
    shown = drawing.still_camera if camera is None else checked_camera(camera, drawing.cameras)
    first, last = _stretch(drawing.highlight(run), run.duration, begin, end)
    if not 0.0 <= first < run.duration:
        raise ArgumentError(f"begin = {first:g} s; allowed: 0 to less than {run.duration:g} s, the length of the run")
    if not first < last <= run.duration:
        raise ArgumentError(f"end = {last:g} s; allowed: more than {first:g}, where it begins, to {run.duration:g} s")
    seen = [annotation for annotation in drawing.annotations(run) if first <= annotation[0] <= last]
    shots = (Shot(shown, first, last, length), Shot(shown, last, last, float(1 / rate)))
    frames = [replace(frame, brief=True) for frame in frames_of(shots, seen, float(rate), 0.0)]
    with closing(draw(directory, frames, width, height, STILL_SAMPLES)) as drawn:
        pictures = [Image.fromarray(picture) for picture in counted(drawn, "clip", len(frames), progress)]
    target = Path(path) if path is not None else directory / f"{shown}.webp"
    write_bytes(target, _encoded(pictures, rate))
    return target


def _stretch(
    highlight: tuple[float, float], duration: float, begin: float | None, end: float | None
) -> tuple[float, float]:
    """Return beginning and end of a clip [s]: those that are given, else those of the highlight.

    They are those of the run if that leaves nothing: a highlight may be one moment, the last one for example.
    """
    first, last = highlight
    first = begin if begin is not None else first if first < (last if end is None else end) else 0.0
    return first, end if end is not None else last if first < last else duration


def _encoded(pictures: list[Image.Image], rate: Fraction) -> bytes:
    """Return an animated WebP that repeats, with the best quality that is small enough."""
    begun = starts(len(pictures) - 1, rate, 1000)
    lengths = [*np.diff(begun).tolist(), round(1000.0 * LAST_MOMENT)]  # [ms]
    for quality in QUALITIES:
        file = io.BytesIO()
        pictures[0].save(
            file, format="WEBP", save_all=True, append_images=pictures[1:], duration=lengths, loop=0,
            quality=quality, method=4, minimize_size=False,
        )  # fmt: skip
        if file.tell() <= MOST_BYTES:
            return file.getvalue()
    raise RuntimeError(f"the clip takes {file.tell()} bytes at the lowest quality; allowed: at most {MOST_BYTES}")
