"""A small map in the corner of a picture: where in the canyon the vehicle is, and where it is going.

It says which mark is what, which way is north, and how long a stretch on it is; in pictures in which that could not be
read it is without words.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from mathnavi.interfaces.signals import Array
from mathnavi.renders.palette import COLOURS, Picture, SceneElement
from mathnavi.renders.quadrotor.run_data import QuadrotorRun
from mathnavi.renders.quadrotor.scene import quadrotor_scene
from mathnavi.renders.relief import relief
from mathnavi.renders.scene.landscape import plan_pieces
from mathnavi.renders.scene.mujoco import MujocoScene

SIZE, EDGE = 208, 18  # [pixels] at a picture 720 pixels high: of the longer side, and from the picture's edge
SHARPER = 3  # it is drawn so many times as large
LETTERS, LEAST_LETTERS = 13, 9.0  # [pixels] at a picture 720 pixels high, and in any: size of the words
BAR = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)  # [m] lengths of the scale
BAR_SHARE = 0.35  # of the map's width that the scale takes at most


class QuadrotorPictures(MujocoScene):
    """Pictures of a run; those of the camera that follows the vehicle have a small map."""

    def __init__(self, run: QuadrotorRun, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        super().__init__(quadrotor_scene(run), width, height, samples)
        self._inset = Inset(run, height)

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]; ``turn`` [degrees] turns the overview."""
        picture = super().draw(t, camera, turn)
        return self._inset.put(picture, t) if camera == "chase" else picture


class Inset:
    """Draws on pictures of one height."""

    def __init__(self, run: QuadrotorRun, height: int) -> None:
        self._run = run
        self._unit = height / 720.0
        side = max(16, round(SIZE * self._unit))
        self._ground = Image.fromarray(relief(run.flight.terrain, side * SHARPER))
        terrain = run.flight.terrain
        self._scale = np.array([self._ground.width / terrain.width, self._ground.height / terrain.depth])
        self._font = None
        if LETTERS * self._unit >= LEAST_LETTERS:
            face = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans-Bold.ttf"
            self._font = ImageFont.truetype(str(face), round(LETTERS * self._unit * SHARPER))
            self._add_scale(terrain.width)

    def put(self, picture: Picture, t: float) -> Picture:
        """The picture with the map at time ``t`` [s] in its upper right corner."""
        run, chart = self._run.flight, self._ground.copy()
        draw, pixel = ImageDraw.Draw(chart), SHARPER * self._unit
        plan = run.plan(t)
        if plan is not None and t < run.duration:
            for part, (_, points) in plan_pieces(plan, t):
                self._line(draw, points, part, 1.6 * pixel)
        if run.index(t) > 0:
            self._line(draw, run.x[: run.index(t) + 1 : 20, :3], SceneElement.FLOWN, 2.4 * pixel)
        for place, part, radius in (
            (run.mission.start, SceneElement.START, 3.0),
            (run.mission.target, SceneElement.TARGET, 3.6),
            (run.state(t), SceneElement.FLOWN, 4.4),
        ):
            (column, row), r = self._pixels(place[None])[0], radius * pixel
            draw.ellipse((column - r, row - r, column + r, row + r), _colour(part), "white", max(1, round(1.4 * pixel)))
            if part is not SceneElement.FLOWN:
                self._write(draw, part.value, (column, row - r - 9.0 * pixel))
        width = max(1, round(1.5 * pixel))
        draw.rectangle((0, 0, chart.width - 1, chart.height - 1), outline="white", width=width)
        small = chart.resize((chart.width // SHARPER, chart.height // SHARPER), Image.Resampling.LANCZOS)
        edge = round(EDGE * self._unit)
        shown = picture.copy()
        right = shown.shape[1] - edge
        shown[edge : edge + small.height, right - small.width : right] = np.asarray(small)
        return shown

    def _add_scale(self, wide: float) -> None:
        """Draw a scale bar with its length, and north, on a map ``wide`` [m] across."""
        draw, pixel = ImageDraw.Draw(self._ground), SHARPER * self._unit
        length = max((metres for metres in BAR if metres <= BAR_SHARE * wide), default=BAR[0])
        left, row = 12.0 * pixel, self._ground.height - 14.0 * pixel
        right = left + length * float(self._scale[0])
        draw.line((left, row, right, row), "white", round(3.0 * pixel))
        self._write(draw, f"{length} m", (0.5 * (left + right), row - 11.0 * pixel))
        self._write(draw, "N ↑", (self._ground.width - 22.0 * pixel, self._ground.height - 16.0 * pixel))

    def _write(self, draw: ImageDraw.ImageDraw, text: str, place: tuple[float, float]) -> None:
        """Write a text about a place, but within the map."""
        if self._font is not None:
            half = 0.5 * self._font.getlength(text) + 5.0 * SHARPER * self._unit
            column = min(max(place[0], half), self._ground.width - half)
            stroke = round(2.0 * SHARPER * self._unit)
            draw.text((column, place[1]), text, "white", self._font, "mm", stroke_width=stroke, stroke_fill="#101824")

    def _pixels(self, points: Array) -> Array:
        """(n, 2) column and row of points (n, 2 or more) [m]; north is up."""
        placed: Array = points[:, :2] * self._scale
        placed[:, 1] = self._ground.height - placed[:, 1]
        return placed

    def _line(self, draw: ImageDraw.ImageDraw, points: Array, part: SceneElement, width: float) -> None:
        if len(points) > 1:
            pixels = [(float(column), float(row)) for column, row in self._pixels(points)]
            draw.line(pixels, _colour(part), max(1, round(width)), joint="curve")


def _colour(part: SceneElement) -> tuple[int, int, int]:
    red, green, blue = (round(255 * channel) for channel in COLOURS[part])
    return red, green, blue
