"""Elements of a scene in the browser: motions, surfaces, lines, marks, cameras and charts.

Lengths are metres, times seconds, the frame is the world's with z up. ``mathnavi.renders.web.document`` packs them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array
from mathnavi.renders.palette import COLOURS, Colour, SceneElement

ALWAYS = ((-math.inf, math.inf),)
MOST_POSES = 1500  # of a motion: between them the browser interpolates
INK_COLOUR: Colour = (0.15, 0.19, 0.24)


@dataclass(frozen=True)
class Layer:
    """An entry of the legend, which shows or hides its elements."""

    name: str
    colour: Colour = INK_COLOUR
    dashed: bool = False
    shown: bool = True  # at first

    @staticmethod
    def for_element(part: SceneElement, *, dashed: bool = False, shown: bool = True) -> Layer:
        """The layer of a part of a picture, in its colour."""
        return Layer(part.value, COLOURS[part], dashed, shown)


@dataclass(frozen=True, eq=False)
class Motion:
    """A frame that moves."""

    t: Array  # (n,) [s]
    pos: Array  # (n, 3) [m]
    quat: Array | None = None  # (n, 4); None: it does not turn
    shown: Sequence[tuple[float, float]] = ALWAYS  # [s] from, until
    ground: Array | None = None  # (n,) [m] height below it, down to which a plumb line is drawn

    def thinned(self) -> Motion:
        """The motion with ``MOST_POSES`` poses at most."""
        rows = np.unique(np.linspace(0, len(self.t) - 1, min(len(self.t), MOST_POSES)).round().astype(np.int64))
        quat, ground = (None if each is None else each[rows] for each in (self.quat, self.ground))
        return Motion(self.t[rows], self.pos[rows], quat, self.shown, ground)


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles, in the frame of a motion or in the world."""

    vertices: Array  # (m, 3) [m]
    faces: NDArray[np.int64]  # (f, 3)
    colour: Colour
    opacity: float = 1.0
    motion: str | None = None
    layer: Layer | None = None
    smooth: bool = True  # normals are those of the vertices, else of the triangles
    glow: float = 0.0  # share of the light that does not depend on the normal
    span: float = 0.0  # [m] of what is drawn at a size in the picture (``Camera.span``), about its motion's origin
    tall: bool = False  # heights are multiplied as the ground's are (``Camera.tall``)
    checker: float = 0.0  # [m] side of the squares that it is painted with
    picture: bytes = b""  # JPEG or PNG, laid over it from above
    picture_box: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)  # west, south, east, north [m] of that
    shadow: bool = False  # it casts one on the floor


@dataclass(frozen=True, eq=False)
class Lines:
    """Polylines; those of one frame are shown from its time until the next one's.

    ``cut`` "past" shows of each what lies before the present, "ahead" what lies after it; both need ``times``.
    """

    layer: Layer
    points: Array  # (m, 3) [m] of all polylines, one after the other
    offsets: NDArray[np.int64]  # (p + 1,) where each begins
    colour: Colour
    width: float = 3.0  # [pixels]
    dashed: bool = False
    times: Array | None = None  # (m,) [s] of the points
    cut: Literal["", "past", "ahead"] = ""
    trail: float = math.inf  # [s] of the past that is shown
    frames: NDArray[np.int64] | None = None  # (k + 1,) which polylines each frame begins with; None: one frame
    starts: Array | None = None  # (k,) [s]
    end: float = math.inf  # [s] of the last frame
    motion: str | None = None  # the path of this motion, in the place of points
    plan: str | None = None  # name under which what follows a run finds new points for it
    opacities: Array | None = None  # (p,)


@dataclass(frozen=True, eq=False)
class Mark:
    """A dot with a name, at a place or on a motion."""

    text: str
    colour: Colour
    place: Array | None = None  # (3,) [m]
    motion: str | None = None
    layer: Layer | None = None
    foot: float | None = None  # [m] height of the ground from which a pin rises to it
    dot: bool = True


@dataclass(frozen=True)
class Camera:
    """A view that the reader can choose, turn and leave."""

    name: str
    target: tuple[float, float, float]  # [m]; of a camera that follows, the shift from what it follows
    distance: float  # [m]
    azimuth: float  # [degrees] of the line of sight, from east, counter-clockwise
    elevation: float  # [degrees] of the line of sight, negative downwards
    follow: str | None = None  # motion
    behind: float = 0.0  # [s] over which the course is averaged, behind which it stays; 0: it does not turn
    field_of_view: float = 36.0  # [degrees] vertical
    tall: float = 1.0  # factor of heights
    span: float = 0.06  # of the picture's height: what is drawn at a size in the picture


@dataclass(frozen=True, eq=False)
class Series:
    """A curve of a chart."""

    name: str
    colour: Colour
    t: Array  # (n,) [s]
    y: Array  # (n,)
    step: bool = False
    dashed: bool = False


@dataclass(frozen=True, eq=False)
class Chart:
    """Curves over time."""

    title: str
    unit: str
    series: Sequence[Series]
    bounds: Sequence[float] = ()
    logarithmic: bool = False


@dataclass(frozen=True, eq=False)
class WebScene:
    """Scene with all that the page of a run shows."""

    title: str
    duration: float  # [s]
    cameras: Sequence[Camera]
    motions: Mapping[str, Motion] = field(default_factory=dict)
    surfaces: Sequence[Surface] = ()
    lines: Sequence[Lines] = ()
    marks: Sequence[Mark] = ()
    charts: Sequence[Chart] = ()
    events: Sequence[tuple[float, str]] = ()
    facts: Sequence[tuple[str, str]] = ()  # name, value with its unit
    low: float = 0.0  # [m] the height that stays where heights are multiplied
    floor: float | None = None  # [m] height of the level floor that shadows fall on
    note: str = ""
    speed: float | None = None  # times as fast as it was; None: so that it is shown in about half a minute
