"""Elements of a scene, free of any renderer: motions, surfaces, lines, marks, cameras and charts.

Lengths are metres, times seconds, the frame is the world's with z up. ``mathnavi.renders.web.document`` packs a scene
for the browser, ``mathnavi.renders.scene.mujoco`` draws it with MuJoCo.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.palette import COLOURS, Colour, SceneElement

if TYPE_CHECKING:  # it imports mujoco
    from mathnavi.renders.framing import Box

ALWAYS = ((-math.inf, math.inf),)
MOST_POSES = 1500  # of a motion, which is interpolated between them
SLACK = 1e-6  # [s] by which a time may be missed
PATTERNS = ("-", "--", ":", "-.")  # of curves, as Matplotlib writes them
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
class Pose:
    """Place of a frame."""

    pos: Array  # (3,) [m]
    quat: Array  # (4,)
    ground: float | None  # [m] height of the ground below it, to which a plumb line is drawn


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

    def at(self, t: float) -> Pose | None:
        """The pose at ``t`` [s], linear between the samples; None while it is not shown."""
        if not any(begin - SLACK <= t <= end + SLACK for begin, end in self.shown):
            return None
        k, following, share = _between(self.t, t)
        quat = np.array([1.0, 0.0, 0.0, 0.0])
        if self.quat is not None:
            one, other = self.quat[k], self.quat[following]
            quat = (1.0 - share) * one + share * (other if one @ other >= 0.0 else -other)
            quat = quat / np.linalg.norm(quat)
        ground = None if self.ground is None else float(_mixed(self.ground, k, following, share))
        return Pose(_mixed(self.pos, k, following, share), quat, ground)


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
    tiled: bool = False  # the picture repeats beyond the box; else its rim does
    shadow: bool = False  # it casts one on the floor
    spin: float = 0.0  # [rad/s] at which a video turns it about ``axle``, along the z axis of its motion
    axle: tuple[float, float] = (0.0, 0.0)  # [m] of its motion's frame


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

    def at(self, t: float) -> list[Array]:
        """The polylines (m, 3) [m] that are shown at ``t`` [s], cut at the present."""
        numbers = self._shown(t)
        polylines = [(int(self.offsets[k]), int(self.offsets[k + 1])) for k in numbers]
        if not self.cut:
            return [self.points[first:after] for first, after in polylines]
        assert self.times is not None
        found = []
        for first, after in polylines:
            times, points = self.times[first:after], self.points[first:after]
            i = last_at(times, t)
            if self.cut == "past" and i >= 0:
                begin = max(last_at(times, t - self.trail), 0)
                found.append(np.vstack([points[begin : i + 1], _mixed(points, *_between(times, t))]))
            elif self.cut == "ahead" and i < len(times) - 1:
                here = points[:0] if i < 0 else _mixed(points, *_between(times, t))[None]
                found.append(np.vstack([here, points[i + 1 :]]))
        return found

    def opacities_at(self, t: float) -> list[float]:
        """The opacity of each of the polylines ``at`` a time ``t`` [s]."""
        shown = self._shown(t) if self.opacities is not None else ()
        return [float(self.opacities[k]) for k in shown] if self.opacities is not None else [1.0] * len(self.at(t))

    def _shown(self, t: float) -> range:
        """Numbers of the polylines of the frame at ``t`` [s]."""
        if self.frames is None:
            return range(len(self.offsets) - 1)
        assert self.starts is not None
        k = last_at(self.starts, t)
        shown = k >= 0 and t <= self.end - (SLACK if self.cut == "ahead" else -SLACK)  # at the end nothing is ahead
        return range(int(self.frames[k]), int(self.frames[k + 1])) if shown else range(0)


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
    brief: str = ""  # text in a video, where there is less room
    ring: float = 0.0  # [m] radius of the ring that marks it in a video seen from nearby
    filled: float = math.inf  # [s] time from which that ring is filled


@dataclass(frozen=True, eq=False)
class Framed:
    """Points that fill a part of a picture, whatever its shape."""

    points: Array  # (m, 3) [m]
    box: Box  # of the picture
    motions: Sequence[str] = ()  # that are in the box too, wherever they are


@dataclass(frozen=True)
class Camera:
    """A view that the reader can choose, turn and leave, or by which a video is filmed."""

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
    shot: str = ""  # name of the camera in videos; empty where it films none
    framed: Framed | None = None  # in videos, in the place of target and distance
    clear: float = 0.0  # [m] over the ground between itself and what it follows, at least, in videos
    dashed: bool = True  # whether it shows dashed lines, in videos
    mounted: Pose | None = None  # in the frame of what it follows, or in the world; of one that nobody turns


@dataclass(frozen=True, eq=False)
class Series:
    """A curve of a chart."""

    name: str
    colour: Colour
    t: Array  # (n,) [s]
    y: Array  # (n,)
    step: bool = False
    pattern: int = 0  # of its dashes, in ``PATTERNS``
    band: Array | None = None  # (n,) half the height of the band about it


@dataclass(frozen=True, eq=False)
class Chart:
    """Curves over time."""

    title: str
    unit: str
    series: Sequence[Series]
    bounds: Sequence[float] = ()
    logarithmic: bool = False


@dataclass(frozen=True, eq=False)
class Scene:
    """Scene of a run, with all that its page shows."""

    title: str
    duration: float  # [s]
    cameras: Sequence[Camera]
    motions: Mapping[str, Motion] = field(default_factory=dict)
    surfaces: Sequence[Surface] = ()
    lines: Sequence[Lines] = ()
    marks: Sequence[Mark] = ()
    charts: Sequence[Chart] = ()
    events: Sequence[tuple[float, str, bool]] = ()  # time [s], words, and whether it is an alarm
    facts: Sequence[tuple[str, str]] = ()  # name, value with its unit
    ground: HeightField | None = None
    floor: float | None = None  # [m] height of the level floor that shadows fall on
    note: str = ""
    speed: float | None = None  # times as fast as it was; None: so that it is shown in about half a minute

    @property
    def low(self) -> float:
        """[m] the height that stays where heights are multiplied."""
        return 0.0 if self.ground is None else float(self.ground.z.min())


def raised(points: Array, low: float, tall: float) -> Array:
    """Points (..., 3) [m] where their heights above ``low`` [m] are multiplied by ``tall``."""
    found: Array = np.concatenate([points[..., :2], low + tall * (points[..., 2:] - low)], axis=-1, dtype=np.float64)
    return found


def last_at(times: Array, t: float) -> int:
    """Index of the last of the times (n,) [s] at or before ``t``; -1 before the first."""
    return int(np.searchsorted(times, t + SLACK, side="right")) - 1


def _between(times: Array, t: float) -> tuple[int, int, float]:
    """Indices of the samples about ``t`` [s], and how far between them it is."""
    k = min(max(last_at(times, t), 0), len(times) - 1)
    following = min(k + 1, len(times) - 1)
    share = (t - times[k]) / (times[following] - times[k]) if following > k else 0.0
    return k, following, min(max(float(share), 0.0), 1.0)


def _mixed(values: Array, k: int, following: int, share: float) -> Array:
    """Values (n, ...) between two samples."""
    found: Array = values[k] + share * (values[following] - values[k])
    return found
