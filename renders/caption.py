"""What is written on a picture: where, how fast, what just happened, what the colours mean: the ``Words`` of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from renders.film import Frame
from renders.palette import COLOURS, Colour, Part, Picture

WHITE, SOFT, PANEL = (255, 255, 255, 255), (205, 214, 224, 255), (16, 24, 36, 176)
DOTS, DASHES, ARROWS, RINGS, CIRCLES = (
    (Part.RADAR, Part.ESTIMATE, Part.HYPOTHESIS, Part.BELIEVED, Part.REFERENCE),
    (Part.COMPLETION, Part.LOST_RAY),
    (Part.FORCE, Part.VELOCITY, Part.TRUE_VELOCITY, Part.FOUND_VELOCITY),
    (Part.TARGET,),
    (Part.SPREAD, Part.IMAGE),
)  # how a part is drawn; else a line
RING_COLOURS = ((242, 242, 237), (212, 33, 26), (242, 242, 237))  # of a target, from its edge to its middle


@dataclass(frozen=True)
class Label:
    """A name beside a place of the picture."""

    text: str
    column: float  # [pixels]
    row: float  # [pixels]
    small: bool = False  # a scale, say
    beside: bool = False  # to the right of its place, not above it


@dataclass(frozen=True)
class Key:
    """A line of a colour of its own in a legend."""

    text: str
    colour: Colour


@dataclass(frozen=True)
class Words:
    """What a picture says."""

    title: Sequence[str]  # lines, the first one larger
    numbers: Sequence[tuple[str, str, str]]  # (name, value, note)
    state: str  # what is being done
    legend: Sequence[Part | Key]
    notice: str  # what just happened
    share: float  # of the run that is over
    moments: Sequence[float]  # shares of the run at which something happened
    labels: Sequence[Label]


def pace(frame: Frame, duration: float) -> str:
    """How fast time passes in a frame; in a still, how long the run takes [s]."""
    if frame.rate <= 0.0:
        return f"of {duration:.1f} s"
    if frame.rate < 0.95:
        return f"{frame.rate:.2f}× real time"
    return f"{frame.rate:.0f}× real time" if frame.rate >= 1.95 else f"{frame.rate:.1f}× real time"


class Caption:
    """Writes on pictures of one size; sizes are given for pictures 720 pixels high."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self._unit = height / 720.0
        folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._plain = {n: ImageFont.truetype(str(folder / "DejaVuSans.ttf"), self._px(n)) for n in (13, 15, 17)}
        self._bold = {n: ImageFont.truetype(str(folder / "DejaVuSans-Bold.ttf"), self._px(n)) for n in (16, 26)}
        self._title_corner = (0.0, 0.0)  # right and lower edge of the title of the picture being written on

    def write(self, picture: Picture, words: Words) -> Picture:
        """The picture with words on it."""
        canvas = Image.fromarray(picture).convert("RGBA")
        layer = Image.new("RGBA", canvas.size, (0, 0, 0, 0))
        draw = ImageDraw.Draw(layer)
        self._title(draw, words.title)
        self._numbers(draw, words)
        self._legend(draw, words.legend)
        self._notice(draw, words.notice)
        self._progress(draw, words)
        for label in words.labels:  # last, so that nothing covers them
            self._label(draw, label)
        return np.asarray(Image.alpha_composite(canvas, layer).convert("RGB"))

    def _px(self, n: float) -> int:
        return max(1, round(n * self._unit))

    def _panel(self, draw: ImageDraw.ImageDraw, box: tuple[float, float, float, float]) -> None:
        draw.rounded_rectangle(box, radius=self._px(9), fill=PANEL)

    def _label(self, draw: ImageDraw.ImageDraw, label: Label) -> None:
        """A name above its place or beside it, inside the picture and clear of the title."""
        font = self._plain[13] if label.small else self._bold[16]
        half, gap = font.getlength(label.text) / 2 + self._px(6), self._px(0 if label.small or label.beside else 20)
        middle = min(max(label.column + half * label.beside, half), self.width - half)
        right, bottom = self._title_corner
        least = bottom + gap if middle - half < right else gap
        draw.text(
            (middle, max(label.row - gap, least)), label.text, WHITE, font, "mm",
            stroke_width=self._px(2), stroke_fill=(16, 24, 36, 210),
        )  # fmt: skip

    def _title(self, draw: ImageDraw.ImageDraw, title: Sequence[str]) -> None:
        pad, edge, row = self._px(11), self._px(18), self._px(24)
        lines = [(text, 13 if k else 15, SOFT if k else WHITE) for k, text in enumerate(title)]
        wide = max(self._plain[size].getlength(text) for text, size, _ in lines)
        self._title_corner = edge + 2 * pad + wide, edge + self._px(10) + row * len(lines)
        self._panel(draw, (edge, edge, *self._title_corner))
        for k, (text, size, colour) in enumerate(lines):
            draw.text((edge + pad, edge + self._px(17) + k * row), text, colour, self._plain[size], "lm")

    def _numbers(self, draw: ImageDraw.ImageDraw, words: Words) -> None:
        left, right, step = self._px(18), self._px(276), self._px(54)
        pad = self._px(14)
        top = self.height - self._px(30) - len(words.numbers) * step - self._px(44)
        self._panel(draw, (left, top, right, self.height - self._px(30)))
        for k, (name, value, note) in enumerate(words.numbers):
            y = top + self._px(18) + k * step
            draw.text((left + pad, y), name, SOFT, self._plain[13], "lm")
            draw.text((left + pad, y + self._px(23)), value, WHITE, self._bold[26], "lm")
            draw.text((right - pad, y + self._px(26)), note, SOFT, self._plain[13], "rm")
        draw.text((left + pad, self.height - self._px(48)), words.state, WHITE, self._plain[15], "lm")

    def _legend(self, draw: ImageDraw.ImageDraw, parts: Sequence[Part | Key]) -> None:
        font, pad, row = self._plain[15], self._px(13), self._px(22)
        names = [part.text if isinstance(part, Key) else part.value for part in parts]
        wide = max(font.getlength(name) for name in names) + self._px(42) + 2 * pad
        right, bottom = self.width - self._px(18), self.height - self._px(30)
        top = bottom - row * len(parts) - pad
        self._panel(draw, (right - wide, top, right, bottom))
        for k, (part, name) in enumerate(zip(parts, names, strict=True)):
            y = top + pad / 2 + row * (k + 0.5)
            x = right - wide + pad
            self._swatch(draw, part, x, y)
            draw.text((x + self._px(42), y), name, WHITE, font, "lm")

    def _swatch(self, draw: ImageDraw.ImageDraw, part: Part | Key, x: float, y: float) -> None:
        shown = part.colour if isinstance(part, Key) else COLOURS[part]
        colour = tuple(round(255 * channel) for channel in shown)
        thick, long = self._px(4), self._px(30)
        if part in DOTS:
            draw.ellipse((x + long / 2 - 2 * thick, y - 2 * thick, x + long / 2 + 2 * thick, y + 2 * thick), colour)
        elif part in RINGS:
            for colour, radius in zip(RING_COLOURS, (2.2 * thick, 1.5 * thick, 0.7 * thick), strict=True):
                draw.ellipse((x + long / 2 - radius, y - radius, x + long / 2 + radius, y + radius), colour)
        elif part in CIRCLES:
            box = (x + long / 2 - 2.3 * thick, y - 2.3 * thick, x + long / 2 + 2.3 * thick, y + 2.3 * thick)
            draw.ellipse(box, outline=colour, width=max(1, thick // 2))
        elif part in DASHES:
            for k in range(3):
                draw.line((x + k * long * 0.37, y, x + k * long * 0.37 + long * 0.24, y), colour, thick)
        elif part in ARROWS:
            draw.line((x, y, x + 0.6 * long, y), colour, thick)
            draw.polygon(
                [(x + 0.55 * long, y - 1.8 * thick), (x + long, y), (x + 0.55 * long, y + 1.8 * thick)], colour
            )
        else:
            draw.line((x, y, x + long, y), colour, thick)

    def _notice(self, draw: ImageDraw.ImageDraw, text: str) -> None:
        if text:
            font, middle, top = self._bold[16], self.width / 2, float(self._px(66))
            half = font.getlength(text) / 2 + self._px(16)
            right, bottom = self._title_corner
            if middle - half < right:
                top = max(top, bottom + self._px(8))
            self._panel(draw, (middle - half, top, middle + half, top + self._px(40)))
            draw.text((middle, top + self._px(20)), text, (255, 214, 102, 255), font, "mm")

    def _progress(self, draw: ImageDraw.ImageDraw, words: Words) -> None:
        left, right, y = self._px(18), self.width - self._px(18), self.height - self._px(14)
        draw.line((left, y, right, y), (16, 24, 36, 150), self._px(5))
        flown = (*(round(255 * channel) for channel in COLOURS[Part.FLOWN]), 255)
        draw.line((left, y, left + words.share * (right - left), y), flown, self._px(5))
        for share in words.moments:
            x = left + share * (right - left)
            draw.line((x, y - self._px(4), x, y + self._px(4)), WHITE, self._px(2))
