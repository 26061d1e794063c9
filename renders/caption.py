"""What is written on a picture: where, how fast, how high, what just happened, what the colours mean."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from renders.palette import COLOURS, Part, Picture
from renders.run_data import RunData
from renders.storyboard import EXAGGERATION, Frame, notices
from sim.signals import Phase

WHITE, SOFT, PANEL = (255, 255, 255, 255), (205, 214, 224, 255), (16, 24, 36, 176)
LEGEND = (Part.FLOWN, Part.OPTIMISED, Part.MANOEUVRE, Part.COMPLETION, Part.RADAR)
PHASES = {
    Phase.OPTIMISED: "flying the optimised plan",
    Phase.MANOEUVRE: "flying the safety manoeuvre",
    Phase.HOVER: "hovering",
    Phase.CLIMB: "completion path: climb",
    Phase.CRUISE: "completion path: cruise",
    Phase.DESCENT: "completion path: descent",
}


def phase_name(run: RunData, t: float) -> str:
    """What the plan being flown is doing at ``t`` [s]."""
    plan = run.plan(t)
    if plan is None:
        return "no plan yet"
    if t >= plan.t_end:
        return "at rest"
    k = int(np.clip(np.searchsorted(plan.t, t + 1e-9, side="right") - 1, 0, len(plan.phase) - 1))
    return PHASES[Phase(int(plan.phase[k]))]


class Caption:
    """Writes on pictures of one size; sizes are given for pictures 720 pixels high."""

    def __init__(self, run: RunData, width: int, height: int) -> None:
        self.run = run
        self.width, self.height = width, height
        self._unit = height / 720.0
        folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
        self._plain = {n: ImageFont.truetype(str(folder / "DejaVuSans.ttf"), self._px(n)) for n in (13, 15, 17)}
        self._bold = {n: ImageFont.truetype(str(folder / "DejaVuSans-Bold.ttf"), self._px(n)) for n in (16, 26)}
        self._speed = np.linalg.norm(run.x[:, 3:], axis=1)
        self._notices = notices(run)
        self._title_corner = (0.0, 0.0)  # right and lower edge of the title of the picture being written on

    def write(self, picture: Picture, frame: Frame, labels: list[tuple[str, float, float]]) -> Picture:
        """The picture with the caption of a frame and ``labels`` (text, column, row) beside places."""
        canvas = Image.fromarray(picture).convert("RGBA")
        layer = Image.new("RGBA", canvas.size, (0, 0, 0, 0))
        draw = ImageDraw.Draw(layer)
        self._title(draw, frame)
        self._numbers(draw, frame)
        self._legend(draw)
        self._notice(draw, frame.notice)
        self._progress(draw, frame)
        for text, column, row in labels:  # last, so that nothing covers them
            self._label(draw, text, column, row)
        return np.asarray(Image.alpha_composite(canvas, layer).convert("RGB"))

    def _px(self, n: float) -> int:
        return max(1, round(n * self._unit))

    def _panel(self, draw: ImageDraw.ImageDraw, box: tuple[float, float, float, float]) -> None:
        draw.rounded_rectangle(box, radius=self._px(9), fill=PANEL)

    def _label(self, draw: ImageDraw.ImageDraw, text: str, column: float, row: float) -> None:
        """A name above its place, inside the picture and clear of the title."""
        half, gap = self._bold[16].getlength(text) / 2 + self._px(6), self._px(20)
        middle = min(max(column, half), self.width - half)
        right, bottom = self._title_corner
        least = bottom + gap if middle - half < right else gap
        draw.text(
            (middle, max(row - gap, least)), text, WHITE, self._bold[16], "mm",
            stroke_width=self._px(2), stroke_fill=(16, 24, 36, 210),
        )  # fmt: skip

    def _title(self, draw: ImageDraw.ImageDraw, frame: Frame) -> None:
        run, pad, edge, row = self.run, self._px(11), self._px(18), self._px(24)
        lines = [(f"mathnavi · {run.config['scenario']} · {run.terrain.name} · seed {run.config['seed']}", 15, WHITE)]
        if frame.camera != "chase":
            lines.append((f"vehicle and heights not to scale: heights × {EXAGGERATION}", 13, SOFT))
        wide = max(self._plain[size].getlength(text) for text, size, _ in lines)
        self._title_corner = edge + 2 * pad + wide, edge + self._px(10) + row * len(lines)
        self._panel(draw, (edge, edge, *self._title_corner))
        for k, (text, size, colour) in enumerate(lines):
            draw.text((edge + pad, edge + self._px(17) + k * row), text, colour, self._plain[size], "lm")

    def _numbers(self, draw: ImageDraw.ImageDraw, frame: Frame) -> None:
        run = self.run
        i = run.index(frame.t)
        ground = run.above_ground[i]
        rate = f"{frame.rate:.0f}× real time" if frame.rate >= 1.95 else f"{frame.rate:.1f}× real time"
        rows = (
            ("TIME", f"{frame.t:.1f} s", rate if frame.rate > 0.0 else f"of {run.duration:.1f} s"),
            ("SPEED", f"{self._speed[i]:.0f} m/s", f"bound {run.mission.speed_max:.0f} m/s"),
            (
                "ABOVE GROUND",
                f"{ground:.0f} m" if np.isfinite(ground) else "off the map",
                f"at least {run.mission.clearance_min:.0f} m",
            ),
        )
        left, right, step = self._px(18), self._px(276), self._px(54)
        pad = self._px(14)
        top = self.height - self._px(30) - len(rows) * step - self._px(44)
        self._panel(draw, (left, top, right, self.height - self._px(30)))
        for k, (name, value, note) in enumerate(rows):
            y = top + self._px(18) + k * step
            draw.text((left + pad, y), name, SOFT, self._plain[13], "lm")
            draw.text((left + pad, y + self._px(23)), value, WHITE, self._bold[26], "lm")
            draw.text((right - pad, y + self._px(26)), note, SOFT, self._plain[13], "rm")
        draw.text((left + pad, self.height - self._px(48)), phase_name(run, frame.t), WHITE, self._plain[15], "lm")

    def _legend(self, draw: ImageDraw.ImageDraw) -> None:
        parts = [part for part in LEGEND if part is not Part.RADAR or self.run.mission.radars]
        font, pad, row = self._plain[15], self._px(13), self._px(22)
        wide = max(font.getlength(part.value) for part in parts) + self._px(42) + 2 * pad
        right, bottom = self.width - self._px(18), self.height - self._px(30)
        top = bottom - row * len(parts) - pad
        self._panel(draw, (right - wide, top, right, bottom))
        for k, part in enumerate(parts):
            y = top + pad / 2 + row * (k + 0.5)
            x = right - wide + pad
            self._swatch(draw, part, x, y)
            draw.text((x + self._px(42), y), part.value, WHITE, font, "lm")

    def _swatch(self, draw: ImageDraw.ImageDraw, part: Part, x: float, y: float) -> None:
        colour = tuple(round(255 * channel) for channel in COLOURS[part])
        thick, long = self._px(4), self._px(30)
        if part is Part.RADAR:
            draw.ellipse((x + long / 2 - 2 * thick, y - 2 * thick, x + long / 2 + 2 * thick, y + 2 * thick), colour)
        elif part is Part.COMPLETION:
            for k in range(3):
                draw.line((x + k * long * 0.37, y, x + k * long * 0.37 + long * 0.24, y), colour, thick)
        else:
            draw.line((x, y, x + long, y), colour, thick)

    def _notice(self, draw: ImageDraw.ImageDraw, text: str) -> None:
        if text:
            font, middle, top = self._bold[16], self.width / 2, self._px(66)
            half = font.getlength(text) / 2 + self._px(16)
            self._panel(draw, (middle - half, top, middle + half, top + self._px(40)))
            draw.text((middle, top + self._px(20)), text, (255, 214, 102, 255), font, "mm")

    def _progress(self, draw: ImageDraw.ImageDraw, frame: Frame) -> None:
        left, right, y = self._px(18), self.width - self._px(18), self.height - self._px(14)
        share = frame.t / self.run.duration
        draw.line((left, y, right, y), (16, 24, 36, 150), self._px(5))
        flown = (*(round(255 * channel) for channel in COLOURS[Part.FLOWN]), 255)
        draw.line((left, y, left + share * (right - left), y), flown, self._px(5))
        for t, _ in self._notices:
            x = left + t / self.run.duration * (right - left)
            draw.line((x, y - self._px(4), x, y + self._px(4)), WHITE, self._px(2))
