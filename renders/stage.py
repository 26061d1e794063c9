"""Base of every scene over MuJoCo's renderer: a camera, lines of a width in pixels, places in the picture.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from types import TracebackType
from typing import Any, Self

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.palette import Colour, Picture

MAX_GEOMS = 4000
DASH = 11.0  # [pixels] at a picture 720 pixels high: length of a dash and of the gap after it
FINEST = 4.0  # [pixels] likewise: between two points of a line
# For a pixel of a picture 720 pixels high there are so many in a small one, or so many times its share of the height if
# that is less: else lines would be too thin to be seen.
LEAST_UNIT, MOST_ENLARGED = 0.75, 1.5
DISC_HEIGHT = 5e-4  # [m]
COPY_SIZE = 1.02  # of a copy: where it lies on the original it covers it
MOST_PIXELS = 300.0  # that a piece of a line counts for: behind the camera it would count for any number
HORIZON, ZENITH, NADIR = (0.82, 0.88, 0.93), (0.20, 0.42, 0.74), (0.46, 0.55, 0.66)  # sky; fog is as the horizon


@dataclass(frozen=True)
class View:
    """Pose of MuJoCo's free camera."""

    lookat: Array  # (3,) [m] in the world that is drawn
    distance: float  # [m]
    azimuth: float  # [degrees] of the line of sight, from east, counter-clockwise
    elevation: float  # [degrees] of the line of sight, negative downwards

    @property
    def eye(self) -> Array:
        """(3,) [m] where the camera is."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        return self.lookat - self.distance * np.array(
            [math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)]
        )

    @staticmethod
    def between(eye: Array, lookat: Array) -> View:
        """View from one point (3,) [m] to another."""
        sight = lookat - eye
        distance = float(np.linalg.norm(sight))
        azimuth = math.degrees(math.atan2(sight[1], sight[0]))
        return View(lookat, distance, azimuth, math.degrees(math.asin(sight[2] / distance)))


@dataclass(frozen=True)
class Optics:
    """Field of view and clipping planes of a camera."""

    field_of_view: float  # [degrees] vertical
    near: float  # plane, in units of the model's extent
    far: float  # plane, likewise


class Stage:
    """A model, and its picture that is being drawn; close it, or OSMesa complains when the process ends."""

    def __init__(self, model: Any, width: int, height: int, glow: float) -> None:
        """``glow`` is the emission of what is added to the pictures: with the light of the model it makes up 1."""
        self.model, self.data = model, mujoco.MjData(model)
        self.width, self.height = width, height
        self._glow = glow
        self._camera = mujoco.MjvCamera()
        self._options = mujoco.MjvOption()
        self._backdrops: dict[tuple[float, float], Picture] = {}  # by elevation and field of view [degrees]
        self._backdrop: Picture | None = None  # of the picture that is being drawn, where it is added at the end

    @property
    def _blends(self) -> bool:
        """True if a pixel is the mean of several samples."""
        return bool(self.model.vis.quality.offsamples > 0)

    @cached_property
    def _renderer(self) -> Any:
        """MuJoCo's renderer, begun with the first picture: before it the process may fork."""
        return mujoco.Renderer(self.model, self.height, self.width, max_geom=MAX_GEOMS)

    def close(self) -> None:
        """Free the renderer."""
        if "_renderer" in self.__dict__:
            self._renderer.close()

    @property
    def unit(self) -> float:
        """Pixels here for a pixel of a picture 720 pixels high."""
        share = self.height / 720.0
        return max(share, min(LEAST_UNIT, MOST_ENLARGED * share))

    def look(self, view: View, optics: Optics, groups: Sequence[int]) -> None:
        """Put the camera in its place and show these groups of geoms; ``place`` what moves before the scene begins."""
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FREE
        self._camera.lookat[:] = view.lookat
        self._camera.distance = view.distance
        self._camera.azimuth, self._camera.elevation = view.azimuth, view.elevation
        self._set_optics(optics, optics.field_of_view, groups)

    def look_through(self, camera: int, optics: Optics, groups: Sequence[int]) -> None:
        """Look through a camera of the model, with its own field of view."""
        self._camera.type, self._camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, camera
        self._set_optics(optics, float(self.model.cam_fovy[camera]), groups)

    def _set_optics(self, optics: Optics, field_of_view: float, groups: Sequence[int]) -> None:
        visual = self.model.vis
        visual.global_.fovy, visual.map.znear, visual.map.zfar = field_of_view, optics.near, optics.far
        self._options.geomgroup[:] = 0
        self._options.geomgroup[list(groups)] = 1

    def begin(self, *, fog: bool, shadows: bool = False) -> None:
        """The geoms of the model; what is added from now on is of this picture only."""
        mujoco.mj_forward(self.model, self.data)
        free = self._camera.type == mujoco.mjtCamera.mjCAMERA_FREE
        self._backdrop = self._drawn_backdrop() if free and not fog and not self._blends else None
        self._renderer.update_scene(self.data, self._camera, self._options)
        flags = self._renderer.scene.flags
        flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadows
        flags[mujoco.mjtRndFlag.mjRND_FOG] = fog
        flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = self._blends or not (fog or free)

    def _drawn_backdrop(self) -> Picture:
        """The model's sky, which is the same in all directions, as a camera of this elevation sees it; drawn once.

        Behind every picture it would take a quarter of the time.
        """
        seen = float(self._camera.elevation), float(self.model.vis.global_.fovy)
        if seen not in self._backdrops:
            azimuth, self._camera.azimuth = self._camera.azimuth, 0.0
            self._renderer.update_scene(self.data, self._camera, self._options)
            self._camera.azimuth = azimuth
            self._renderer.scene.ngeom = 0
            flags = self._renderer.scene.flags
            flags[mujoco.mjtRndFlag.mjRND_FOG], flags[mujoco.mjtRndFlag.mjRND_SKYBOX] = False, True
            self._backdrops[seen] = self._renderer.render()
        return self._backdrops[seen]

    def end(self, *, sky: bool) -> Picture:
        """The picture; with ``sky``, which needs fog, it is blue above the horizon."""
        picture: Picture = self._renderer.render()
        if self._backdrop is not None:
            empty = self._empty()
            for k in range(3):  # by channel: much faster than by pixel
                np.copyto(picture[..., k], self._backdrop[..., k], where=empty)
        if sky:
            self._clear_sky(picture)
        return picture

    def _clear_sky(self, picture: Picture) -> None:
        """Paint the sky: blue above the horizon, below it the colour of the fog.

        The sky is what nothing was drawn on, and what the fog covers wholly. So MuJoCo's own sky, which would be drawn
        behind all of the picture, is not needed, unless edges are blended with what is behind them.
        """
        _, forward, up = self.eye()
        rows = (1.0 - (2.0 * np.arange(picture.shape[0]) + 1.0) / picture.shape[0]) * self.tangent()
        sight = forward + rows[:, None] * up
        sine = sight[:, 2] / np.linalg.norm(sight, axis=1)
        horizon = np.count_nonzero(sine > 0.0)
        clear = (np.clip(sine[:horizon] / 0.5, 0.0, 1.0) ** 0.8)[:, None]
        colours = (255.0 * (np.array(HORIZON) * (1.0 - clear) + np.array(ZENITH) * clear)).astype(np.uint8)
        haze = np.round(255.0 * np.array(HORIZON)).astype(np.uint8)
        red, green, blue = np.moveaxis(picture, -1, 0)  # by channel: much faster than by pixel
        empty = self._empty()
        hazy = [channel[:horizon] - (haze[k] - 1) <= 2 for k, channel in enumerate((red, green, blue))]  # of unsigned
        sky = empty[:horizon] | (hazy[0] & hazy[1] & hazy[2])
        for k, channel in enumerate((red, green, blue)):
            np.copyto(channel[:horizon], colours[:, k, None], where=sky)
            np.copyto(channel[horizon:], haze[k], where=empty[horizon:])

    def _empty(self) -> Array:
        """(height, width) True where nothing was drawn."""
        empty: Array = self.nearness() == 0.0
        return empty

    def nearness(self) -> Array:
        """(height, width) depth of the picture drawn last, see ``nearness``."""
        return nearness(self._renderer, self.width, self.height)

    # ---- where things are in the picture

    def eye(self) -> tuple[Array, Array, Array]:
        """Position [m], line of sight and upward direction of the camera of the picture drawn last."""
        left, right = self._renderer.scene.camera
        return 0.5 * (left.pos + right.pos).astype(float), left.forward.astype(float), left.up.astype(float)

    def tangent(self) -> float:
        """Half the picture's height over the distance, for the picture drawn last."""
        return math.tan(math.radians(float(self.model.vis.global_.fovy)) / 2.0)

    def pixels(self, points: Array) -> Array:
        """(n, 3) column, row and depth [m] of points (n, 3) in the picture drawn last; depth <= 0 is behind."""
        eye, forward, up = self.eye()
        ahead = points - eye
        depth = ahead @ forward
        scale = self.height / (2.0 * self.tangent()) / np.maximum(depth, 1e-6)
        column = self.width / 2.0 + ahead @ np.cross(forward, up) * scale
        row = self.height / 2.0 - ahead @ up * scale
        return np.column_stack([column, row, depth])

    def inside(self, points: Array) -> Array:
        """(m, 2) column and row of those of the points (n, 3) that are in the picture."""
        column, row, depth = self.pixels(points).T
        shown = (depth > 0.0) & (column >= 0) & (column < self.width) & (row >= 0) & (row < self.height)
        found: Array = np.column_stack([column, row])[shown]
        return found

    def metres_per_pixel(self, points: Array) -> Array:
        """(n,) [m] that a pixel spans at points (n, 3)."""
        eye, forward, _ = self.eye()
        depth = np.maximum((points - eye) @ forward, 1.0)
        span: Array = 2.0 * depth * self.tangent() / self.height
        return span

    # ---- what is added to a picture

    def line(self, points: Array, colour: Colour, width: float, *, dashed: bool = False) -> None:
        """Add a line through points (n, 3), ``width`` pixels wide everywhere, in a picture 720 pixels high."""
        if dashed:
            points = _resample(points, self.metres_per_pixel(points), DASH * self.unit)
        radii = 0.5 * width * self.metres_per_pixel(0.5 * (points[:-1] + points[1:])) * self.unit
        for k, (a, b) in enumerate(pairwise(points)):
            if not dashed or k % 2 == 0:
                self.capsule(a, b, float(radii[k]), colour)

    def drawable(self, points: Array) -> list[Array]:
        """The parts before the camera of a line through points (n, 3), without points that no picture could show."""
        before = self.pixels(points)[:, 2] > 0.0
        kept = before | np.append(before[1:], False) | np.append(False, before[:-1])
        found = []
        for rows in np.split(np.arange(len(points)), np.flatnonzero(np.diff(kept)) + 1):
            part = points[rows]
            if len(part) > 1 and kept[rows[0]]:
                along = _pixels_along(part, self.metres_per_pixel(part)) / (FINEST * self.unit)
                chosen = np.unique(along.astype(np.int64), return_index=True)[1]
                found.append(part[np.unique(np.append(chosen, len(part) - 1))])
        return found

    def capsule(self, a: Array, b: Array, radius: float, colour: Colour) -> None:
        """Add a capsule from one point (3,) to another, of a radius [m]."""
        geom = self._geom(mujoco.mjtGeom.mjGEOM_CAPSULE, a, b, (*colour, 1.0))
        if geom is not None:
            mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_CAPSULE, radius, a, b)
            geom.emission = self._glow

    def pin(self, foot: Array, place: Array, height: float, colour: Colour) -> None:
        """Add a pin from a foot (3,) through a place (3,) to a head ``height`` pixels above it (at 720 pixels high)."""
        pixel = float(self.metres_per_pixel(place[None])[0]) * self.unit
        head = place + np.array([0.0, 0.0, height * pixel])
        self.capsule(foot, head, 2.0 * pixel, colour)
        self.dot(head, 6.0, colour)

    def dot(self, place: Array, radius: float, colour: Colour) -> None:
        """Add a ball about a place (3,), its radius in pixels (at 720 pixels high)."""
        pixel = float(self.metres_per_pixel(place[None])[0]) * self.unit
        self.capsule(place, place + np.array([0.0, 0.0, 0.1 * pixel]), radius * pixel, colour)

    def arrow(self, a: Array, b: Array, radius: float, colour: Colour, opacity: float = 1.0) -> None:
        """Add an arrow from one point (3,) to another, its shaft of a radius [m]."""
        geom = self._geom(mujoco.mjtGeom.mjGEOM_ARROW, a, b, (*colour, opacity))
        if geom is not None:
            mujoco.mjv_connector(geom, mujoco.mjtGeom.mjGEOM_ARROW, radius, a, b)
            geom.emission = self._glow

    def ellipsoid(self, centre: Array, axis: Array, radii: tuple[float, float], colour: Sequence[float]) -> None:
        """A glowing one around ``axis`` (3,), of unit length, with radii [m] across and along; red to opacity."""
        geom = self._geom(mujoco.mjtGeom.mjGEOM_ELLIPSOID, centre, centre + axis, colour)
        if geom is not None:
            quaternion, rotation = np.empty(4), np.empty(9)
            mujoco.mju_quatZ2Vec(quaternion, axis)
            mujoco.mju_quat2Mat(rotation, quaternion)
            geom.size[:] = (radii[0], radii[0], radii[1])
            geom.pos[:], geom.mat[:] = centre, rotation.reshape(3, 3)
            geom.emission = 0.8

    def disc(self, centre: Array, half_axes: Array, angle: float, colour: Sequence[float]) -> None:
        """A flat, level ellipse about ``centre`` (3,), its first half-axis [m] at ``angle`` [rad]; red to opacity."""
        geom = self._added(mujoco.mjtGeom.mjGEOM_ELLIPSOID, colour)
        if geom is not None:
            c, s = math.cos(angle), math.sin(angle)
            geom.size[:] = (*half_axes, DISC_HEIGHT)
            geom.pos[:], geom.mat[:] = centre, ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
            geom.emission = self._glow

    def mesh(self, mesh: int, place: Array, rotation: Array, size: float, colour: Sequence[float], glow: float) -> None:
        """A mesh of the model at a place (3,), turned by a rotation (3, 3), ``size`` times as large; red to opacity.

        It casts a shadow unless it is clear.
        """
        geom = self._added(mujoco.mjtGeom.mjGEOM_MESH, colour)
        if geom is not None:
            own = np.empty(9)  # MuJoCo keeps a mesh about its centre, along its axes of inertia
            mujoco.mju_quat2Mat(own, self.model.mesh_quat[mesh])
            geom.dataid = 2 * mesh  # of each mesh and then of its convex hull
            geom.pos[:] = place + size * rotation @ self.model.mesh_pos[mesh]
            geom.mat[:] = size * rotation @ own.reshape(3, 3)
            geom.emission = glow
            if colour[3] == 1.0:
                geom.category = mujoco.mjtCatBit.mjCAT_DYNAMIC

    def copy(
        self, geoms: Collection[int], rotation: Array, shift: Array, colour: Sequence[float], size: float = COPY_SIZE
    ) -> None:
        """Geoms of the model once more: what is at p at ``rotation`` p + ``shift``, in one colour, red to opacity.

        They are drawn ``size`` times their true size.
        """
        scene = self._renderer.scene
        for original in scene.geoms[: scene.ngeom]:
            if original.objtype == mujoco.mjtObj.mjOBJ_GEOM and original.objid in geoms:
                geom = self._added(original.type, colour)
                if geom is not None:
                    geom.dataid = original.dataid  # of a mesh
                    geom.size[:] = size * original.size
                    geom.pos[:], geom.mat[:] = rotation @ original.pos + shift, rotation @ original.mat

    def _geom(self, kind: Any, a: Array, b: Array, colour: Sequence[float]) -> Any:
        """A new geom of the picture, or None where there is no room or nothing to draw."""
        return None if float(np.linalg.norm(b - a)) < 1e-3 else self._added(kind, colour)

    def _added(self, kind: Any, colour: Sequence[float]) -> Any:
        """A new geom of the picture, or None where there is no room."""
        scene = self._renderer.scene
        if scene.ngeom >= scene.maxgeom:
            return None
        geom = scene.geoms[scene.ngeom]
        rgba = np.array(colour, np.float32)
        mujoco.mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), rgba)
        geom.category = mujoco.mjtCatBit.mjCAT_DECOR  # casts no shadow
        scene.ngeom += 1
        return geom


def nearness(renderer: Any, width: int, height: int) -> Array:
    """(height, width) depth of the picture that a renderer drew last: towards the eye, 0 where nothing was drawn.

    Between two cameras of the same clipping planes [m] and fields of view the larger depth is the nearer one.
    """
    depth: Any = np.empty((height, width), np.float32)
    # The context has no public name, and the renderer's public depth costs another drawing of the scene.
    mujoco.mjr_readPixels(None, depth, mujoco.MjrRect(0, 0, width, height), renderer._mjr_context)
    nearer: Array = depth[::-1]
    return nearer


def set_size(spec: Any, width: int, height: int, samples: int) -> None:
    """Prepare an ``mjSpec`` for pictures of a size in pixels, each of which is the mean of some samples, or of one."""
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.quality.offsamples = samples


def add_sky(spec: Any) -> None:
    """Add a sky that is darker below the horizon, and fog in its colour."""
    spec.visual.rgba.fog = [*HORIZON, 1.0]
    spec.add_texture(
        name="backdrop", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=HORIZON, rgb2=NADIR, width=256, height=256 * 6,
    )  # fmt: skip


class Staged:
    """A scene on a stage, as a context manager: its end closes the renderer, or OSMesa complains at exit."""

    stage: Stage

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stage.close()


def _resample(points: Array, span: Array, step: float) -> Array:
    """The line through points (n, 3), where a pixel spans ``span`` (n,) [m], ``step`` pixels from point to point."""
    along = _pixels_along(points, span)
    stops = np.linspace(0.0, along[-1], max(2, math.ceil(along[-1] / step) + 1))
    return np.column_stack([np.interp(stops, along, points[:, k]) for k in range(3)])


def _pixels_along(points: Array, span: Array) -> Array:
    """(n,) length in pixels of the line through points (n, 3) up to each, where a pixel spans ``span`` (n,) [m]."""
    pixels = np.linalg.norm(np.diff(points, axis=0), axis=1) / (0.5 * (span[:-1] + span[1:]))
    found: Array = np.concatenate([[0.0], np.cumsum(np.minimum(pixels, MOST_PIXELS))])
    return found
