"""Encoding of a video: the ending of its file says the format, MP4, WebM, GIF or animated WebP.

A picture is shown for 1/rate seconds, a rational number. GIF counts time in hundredths of a second, WebM and WebP in
thousandths: there each picture begins at the nearest one, so that what is rounded does not add up.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal

import av
import av.filter
import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.renders.palette import Picture

LEAST_SIZE, LARGEST_SIZE = 16, 8192  # [pixels]
FINEST_RATE = 1001  # largest denominator of a rate: those of television have it

Codec = Literal["h264", "av1", "vp9"]
ENCODERS: dict[str, tuple[str, dict[str, str]]] = {
    "h264": ("libx264", {"crf": "20", "preset": "veryfast"}),  # x264 is under the GPL
    "av1": ("libsvtav1", {"crf": "30", "preset": "10"}),  # SVT-AV1,
    "vp9": ("libvpx-vp9", {"crf": "31", "b:v": "0", "deadline": "good", "cpu-used": "5"}),  # libvpx
    "webp": ("libwebp_anim", {"quality": "80", "compression_level": "4"}),  # and libwebp under BSD licences
    "gif": ("gif", {}),
}  # of FFmpeg, with their options, those of the films all of about the same quality
# Every picture has colours of its own. Dithering would make flat skies flicker, and the file half as large again.
PALETTE, DITHER = "stats_mode=single", "new=1:dither=none"


@dataclass(frozen=True)
class VideoFormat:
    """Format of a video: its codecs, and its default size and rate."""

    container: str  # of FFmpeg
    options: dict[str, str]  # of the container
    default: str  # codec, if none is given
    codecs: tuple[Codec, ...] = ()  # that may be given
    size: tuple[int, int] = (1280, 720)  # [pixels] width and height
    fps: int = 24  # [1/s]
    fastest: int = 240  # [1/s]


_FOREVER = {"loop": "0"}
FORMATS = {
    ".mp4": VideoFormat("mp4", {"movflags": "+faststart"}, "h264", ("h264", "av1", "vp9")),
    ".webm": VideoFormat("webm", {}, "vp9", ("av1", "vp9")),
    # Browsers show a picture that is to stay for 10 ms or less for 100 ms.
    ".gif": VideoFormat("gif", _FOREVER, "gif", size=(640, 360), fps=12, fastest=50),
    ".webp": VideoFormat("webp", _FOREVER, "webp", size=(640, 360), fps=12, fastest=50),
}
"""formats by the endings of their files; GIF and WebP play in a loop, by default as a clip"""


def checked_codec(codec: str | None, ending: str) -> str:
    """Return a codec of a format, its default if none is given.

    Raises ArgumentError for one that the format does not hold, or whose encoder this FFmpeg lacks.
    """
    form = FORMATS[ending]
    if codec is not None and codec not in form.codecs:
        raise ArgumentError(f"codec = {codec!r}; allowed in {ending}: {', '.join(form.codecs) or 'none'}")
    chosen = codec or form.default
    if not _encodes(ENCODERS[chosen][0]):
        known = [name for name in form.codecs if _encodes(ENCODERS[name][0])]
        raise ArgumentError(
            f"codec = {chosen!r}; allowed with the FFmpeg that PyAV has here: {', '.join(known) or 'none'}"
        )
    return chosen


def _encodes(encoder: str) -> bool:
    try:
        av.Codec(encoder, "w")
    except ValueError:
        return False
    return True


def checked_size(width: Any, height: Any) -> tuple[int, int]:
    """Return a size [pixels] as Python's integers; ArgumentError for one in which no picture is drawn."""
    found = [int(side) if _is_whole(side) else side for side in (width, height)]
    if not all(_is_whole(side) and side % 2 == 0 and LEAST_SIZE <= side <= LARGEST_SIZE for side in found):
        raise ArgumentError(
            f"size = {found[0]!r} x {found[1]!r}; allowed: even numbers from {LEAST_SIZE} to {LARGEST_SIZE}"
        )
    return found[0], found[1]


def checked_rate(fps: Any, fastest: int) -> Fraction:
    """Return a rate [1/s] as a fraction; ArgumentError for one at which no pictures are shown."""
    given = fps.item() if isinstance(fps, np.generic) else fps
    number = isinstance(given, (int, float, Fraction)) and not isinstance(given, bool)
    if not number or not math.isfinite(given) or not 1 <= given <= fastest:
        raise ArgumentError(f"fps = {given!r}; allowed: a number from 1 to {fastest}")
    return Fraction(given).limit_denominator(FINEST_RATE)


def _is_whole(value: Any) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def starts(count: int, rate: Fraction, ticks: int) -> list[int]:
    """Return the times at which ``count`` pictures begin, and at which the last one ends, in ``ticks`` of a second."""
    return [round(ticks * k / rate) for k in range(count + 1)]


def encode(
    path: Path, pictures: Iterable[Picture], size: tuple[int, int], rate: Fraction, form: VideoFormat, codec: str
) -> None:
    """Write pictures (height, width, 3) to a file, each shown for 1/rate [s]."""
    (width, height), (encoder, options) = size, ENCODERS[codec]
    frames: Iterable[av.VideoFrame] = (av.VideoFrame.from_ndarray(picture, format="rgb24") for picture in pictures)
    with av.open(str(path), "w", format=form.container, options=form.options) as container:
        stream = container.add_stream(encoder, rate=rate, options=options)
        assert isinstance(stream, av.VideoStream)
        stream.width, stream.height, stream.pix_fmt = width, height, "pal8" if codec == "gif" else "yuv420p"
        for frame in _with_palettes(frames, width, height, rate) if codec == "gif" else frames:
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _with_palettes(
    frames: Iterable[av.VideoFrame], width: int, height: int, rate: Fraction
) -> Generator[av.VideoFrame]:
    """Yield frames of 256 colours, each with those that it needs."""
    graph = av.filter.Graph()
    source = graph.add_buffer(width=width, height=height, format=av.VideoFormat("rgb24"), time_base=1 / rate)
    both, palette = graph.add("split"), graph.add("palettegen", PALETTE)
    painted, sink = graph.add("paletteuse", DITHER), graph.add("buffersink")
    source.link_to(both)
    both.link_to(painted, 0, 0)
    both.link_to(palette, 1, 0)
    palette.link_to(painted, 0, 1)
    painted.link_to(sink)
    graph.configure()
    for k, frame in enumerate(frames):
        frame.pts, frame.time_base = k, 1 / rate
        graph.push(frame)
        made = graph.pull()
        assert isinstance(made, av.VideoFrame)
        yield made
