"""Overlay of a picture: position and speed of the vehicle, the latest event, the meaning of the colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mathnavi.renders.film import Frame
from mathnavi.renders.palette import COLOURS, Colour, Picture, SceneElement

WHITE, SOFT, PANEL = (255, 255, 255, 255), (205, 214, 224, 255), (16, 24, 36, 176)
DOTS, DASHES, ARROWS, RINGS, CIRCLES = (
    (
        SceneElement.RADAR,
        SceneElement.BEACON,
        SceneElement.ESTIMATE,
        SceneElement.HYPOTHESIS,
        SceneElement.BELIEVED,
        SceneElement.REFERENCE,
    ),
    (SceneElement.COMPLETION, SceneElement.LOST_RAY),
    (SceneElement.FORCE, SceneElement.VELOCITY, SceneElement.TRUE_VELOCITY, SceneElement.FOUND_VELOCITY),
    (SceneElement.TARGET,),
    (SceneElement.SPREAD, SceneElement.IMAGE),
)  # how a part is drawn; else a line
TILE = 128  # [pixels] side of the squares in which an overlay is pasted
ENLARGED = 2.0  # factor of the size of letters in a brief overlay
MOVED, CLEAR = 48, 3  # [pixels] by which a name may be moved from its place, and between it and what it is clear of
RING_COLOURS = ((242, 242, 237), (212, 33, 26), (242, 242, 237))  # of a target, from its edge to its middle


@dataclass(frozen=True)
class Label:
    """Name next to a place of the picture."""

    text: str
    column: float  # [pixels]
    row: float  # [pixels]
    small: bool = False  # a scale, say
    beside: bool = False  # to the right of its place, not above it


@dataclass(frozen=True)
class Key:
    """Line of a legend with its colour."""

    text: str
    colour: Colour


@dataclass(frozen=True)
class Overlay:
    """Text and legend over a picture."""

    title: Sequence[str]  # lines, the first one larger
    numbers: Sequence[tuple[str, str, str]]  # (name, value, note); the first two are those of a brief overlay
    state: str  # what is being done
    legend: Sequence[SceneElement | Key]


def pace(frame: Frame, duration: float) -> str:
    """Rate of time in a frame as text; in a still, the length of the run [s]."""
    if frame.rate <= 0.0:
        return f"of {duration:.1f} s"
    if frame.rate < 0.95:
        return f"{frame.rate:.2f}× real time"
    return f"{frame.rate:.0f}× real time" if frame.rate >= 1.95 else f"{frame.rate:.1f}× real time"


class OverlayWriter:
    """Writer on pictures of one size; sizes are given for pictures 720 pixels high.

    A ``brief`` one has two numbers and a strip of a legend in letters that can still be read in a thumbnail.
    """

    def __init__(self, width: int, height: int, *, brief: bool = False) -> None:
        self.width, self.height = width, height
        self._brief = brief
        self._unit = height / 720.0 * (ENLARGED if brief else 1.0)
        import matplotlib  # its letters only; a run without pictures does not wait for it

        folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._plain = {n: ImageFont.truetype(str(folder / "DejaVuSans.ttf"), self._px(n)) for n in (13, 15, 17)}
        self._bold = {n: ImageFont.truetype(str(folder / "DejaVuSans-Bold.ttf"), self._px(n)) for n in (16, 26)}
        self._title_corner = (0.0, 0.0)  # right and lower edge of the title of the picture being written on
        self._taken: list[tuple[float, float, float, float]] = []  # left, top, right, bottom of panels and labels

    def write(
        self,
        picture: Picture,
        overlay: Overlay,
        annotation: str = "",
        progress: float = 0.0,
        marks: Sequence[float] = (),
        labels: Sequence[Label] = (),
    ) -> Picture:
        """Write on a picture.

        Args:
            picture: (height, width, 3).
            overlay: title, numbers and legend.
            annotation: latest event.
            progress: share of the run that is over, in [0, 1].
            marks: shares of the run at which something happened.
            labels: names next to places of the picture.

        Returns:
            (height, width, 3) another picture.
        """
        canvas = Image.fromarray(picture)
        layer = Image.new("RGBA", canvas.size, (0, 0, 0, 0))
        self._taken.clear()
        draw = ImageDraw.Draw(layer)
        if self._brief:
            self._two_numbers(draw, overlay.numbers[:2])
            self._strip(draw, overlay.legend)
        else:
            self._title(draw, overlay.title)
            self._numbers(draw, overlay)
            self._legend(draw, overlay.legend)
            self._progress(draw, progress, marks)
        self._annotation(draw, annotation)
        for label in labels:  # last, so that nothing covers them
            self._label(draw, label)
        _paste(canvas, layer)
        return np.asarray(canvas)

    def _px(self, n: float) -> int:
        return max(1, round(n * self._unit))

    def _panel(self, draw: ImageDraw.ImageDraw, box: tuple[float, float, float, float]) -> None:
        self._taken.append(box)
        draw.rounded_rectangle(box, radius=self._px(9), fill=PANEL)

    def _label(self, draw: ImageDraw.ImageDraw, label: Label) -> None:
        """Write a name above its place or next to it, inside the picture and clear of panels and of other names.

        It is moved up or down where it would cover one, and left out where it would be too far from its place; in a
        brief overlay, the letters of which are large, it is left out at once.
        """
        font = self._plain[13] if label.small else self._bold[16]
        half, gap = font.getlength(label.text) / 2 + self._px(6), self._px(0 if label.small or label.beside else 20)
        middle = min(max(label.column + half * label.beside, half), self.width - half)
        right, bottom = self._title_corner
        tall = self._px(10)
        least = bottom + gap if middle - half < right else gap
        row = self._free_row(middle, max(label.row - gap, least), half, tall)
        if row is None:
            return
        self._taken.append((middle - half, row - tall, middle + half, row + tall))
        draw.text((middle, row), label.text, WHITE, font, "mm", stroke_width=self._px(2), stroke_fill=(16, 24, 36, 210))

    def _free_row(self, middle: float, row: float, half: float, tall: float) -> float | None:
        """The row nearest to ``row`` at which a name of a half width and a half height covers nothing; None if that is
        too far away.
        """
        clear = tall + self._px(CLEAR)
        beside = [] if self._brief else [each for box in self._taken for each in (box[1] - clear, box[3] + clear)]
        for each in sorted([row, *beside], key=lambda other: abs(other - row)):
            inside = each == row or tall <= each <= self.height - tall
            if abs(each - row) > self._px(MOVED):
                return None
            box = (middle - half, each - tall, middle + half, each + tall)
            if inside and not any(_overlap(box, other) for other in self._taken):
                return each
        return None

    def _title(self, draw: ImageDraw.ImageDraw, title: Sequence[str]) -> None:
        pad, edge, row = self._px(11), self._px(18), self._px(24)
        lines = [(text, 13 if k else 15, SOFT if k else WHITE) for k, text in enumerate(title)]
        wide = max(self._plain[size].getlength(text) for text, size, _ in lines)
        self._title_corner = edge + 2 * pad + wide, edge + self._px(10) + row * len(lines)
        self._panel(draw, (edge, edge, *self._title_corner))
        for k, (text, size, colour) in enumerate(lines):
            draw.text((edge + pad, edge + self._px(17) + k * row), text, colour, self._plain[size], "lm")

    def _numbers(self, draw: ImageDraw.ImageDraw, overlay: Overlay) -> None:
        left, right, step = self._px(18), self._px(276), self._px(54)
        pad = self._px(14)
        top = self.height - self._px(30) - len(overlay.numbers) * step - self._px(44)
        self._panel(draw, (left, top, right, self.height - self._px(30)))
        for k, (name, value, note) in enumerate(overlay.numbers):
            y = top + self._px(18) + k * step
            draw.text((left + pad, y), name, SOFT, self._plain[13], "lm")
            draw.text((left + pad, y + self._px(23)), value, WHITE, self._bold[26], "lm")
            draw.text((right - pad, y + self._px(26)), note, SOFT, self._plain[13], "rm")
        font = self._plain[15]
        state = _cut(overlay.state, font, right - left - 2 * pad)
        draw.text((left + pad, self.height - self._px(48)), state, WHITE, font, "lm")

    def _two_numbers(self, draw: ImageDraw.ImageDraw, numbers: Sequence[tuple[str, str, str]]) -> None:
        """Write the first two numbers in the corner of the title."""
        edge, pad, gap = self._px(8), self._px(9), self._px(16)
        widths = [max(self._plain[13].getlength(name), self._bold[26].getlength(value)) for name, value, _ in numbers]
        self._title_corner = edge + sum(widths) + gap * (len(numbers) - 1) + 2 * pad, edge + self._px(52)
        self._panel(draw, (edge, edge, *self._title_corner))
        left = float(edge + pad)
        for wide, (name, value, _) in zip(widths, numbers, strict=True):
            draw.text((left, edge + self._px(13)), name, SOFT, self._plain[13], "lm")
            draw.text((left, edge + self._px(35)), value, WHITE, self._bold[26], "lm")
            left += wide + gap

    def _strip(self, draw: ImageDraw.ImageDraw, parts: Sequence[SceneElement | Key]) -> None:
        """A legend along the lower edge, in as many rows as it takes."""
        font, high, swatch, gap, edge = self._plain[13], self._px(20), self._px(35), self._px(11), self._px(8)
        rows: list[list[tuple[SceneElement | Key, float]]] = [[]]
        left = float(edge)
        for part in parts:
            wide = swatch + font.getlength(_name(part)) + gap
            if left + wide > self.width - edge + gap and rows[-1]:
                rows.append([])
                left = float(edge)
            rows[-1].append((part, left))
            left += wide
        top = self.height - high * len(rows) - self._px(4)
        draw.rectangle((0, top, self.width, self.height), PANEL)
        for k, row in enumerate(rows):
            y = top + self._px(2) + high * (k + 0.5)
            for part, x in row:
                self._swatch(draw, part, x, y)
                draw.text((x + swatch, y), _name(part), WHITE, font, "lm")

    def _legend(self, draw: ImageDraw.ImageDraw, parts: Sequence[SceneElement | Key]) -> None:
        font, pad, row = self._plain[15], self._px(13), self._px(22)
        names = [_name(part) for part in parts]
        wide = max(font.getlength(name) for name in names) + self._px(42) + 2 * pad
        right, bottom = self.width - self._px(18), self.height - self._px(30)
        top = bottom - row * len(parts) - pad
        self._panel(draw, (right - wide, top, right, bottom))
        for k, (part, name) in enumerate(zip(parts, names, strict=True)):
            y = top + pad / 2 + row * (k + 0.5)
            x = right - wide + pad
            self._swatch(draw, part, x, y)
            draw.text((x + self._px(42), y), name, WHITE, font, "lm")

    def _swatch(self, draw: ImageDraw.ImageDraw, part: SceneElement | Key, x: float, y: float) -> None:
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

    def _annotation(self, draw: ImageDraw.ImageDraw, text: str) -> None:
        if text:
            font, middle, top = self._bold[16], self.width / 2, float(self._px(66))
            half = font.getlength(text) / 2 + self._px(16)
            right, bottom = self._title_corner
            if self._brief:  # beside the title, where there is room
                middle, top = self.width - self._px(8) - half, float(self._px(14))
            if middle - half < right:
                top = max(top, bottom + self._px(8))
            box = (middle - half, top, middle + half, top + self._px(40))
            self._panel(draw, box)
            draw.text((middle, top + self._px(20)), text, (255, 214, 102, 255), font, "mm")

    def _progress(self, draw: ImageDraw.ImageDraw, progress: float, marks: Sequence[float]) -> None:
        left, right, y = self._px(18), self.width - self._px(18), self.height - self._px(14)
        draw.line((left, y, right, y), (16, 24, 36, 150), self._px(5))
        flown = (*(round(255 * channel) for channel in COLOURS[SceneElement.FLOWN]), 255)
        draw.line((left, y, left + progress * (right - left), y), flown, self._px(5))
        for share in marks:
            x = left + share * (right - left)
            draw.line((x, y - self._px(4), x, y + self._px(4)), WHITE, self._px(2))


def _paste(canvas: Image.Image, layer: Image.Image) -> None:
    """Put a layer on a picture, tile by tile: most of them are empty, and to see that is much faster than to blend."""
    for top in range(0, layer.height, TILE):
        for left in range(0, layer.width, TILE):
            box = (left, top, min(left + TILE, layer.width), min(top + TILE, layer.height))
            part = layer.crop(box)
            if part.getbbox():
                canvas.paste(part, box, part)


def _overlap(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    """True if two boxes (left, top, right, bottom) have a point in common."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _name(part: SceneElement | Key) -> str:
    return part.text if isinstance(part, Key) else part.value


def _cut(text: str, font: ImageFont.FreeTypeFont, width: float) -> str:
    """The text, cut where it is longer than ``width`` [pixels]."""
    if font.getlength(text) <= width:
        return text
    kept = text
    while kept and font.getlength(f"{kept}…") > width:
        kept = kept[:-1].rstrip()
    return f"{kept}…"
