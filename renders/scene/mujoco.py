"""A scene drawn by MuJoCo: one model, and the picture at a time for a camera.

Over a ground a camera that follows a vehicle sees fog and a clear sky; over a level floor there are shadows.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.framing import framing
from mathnavi.renders.overlay import Label
from mathnavi.renders.palette import Colour, Picture
from mathnavi.renders.scene.elements import Camera, Mark, Motion, Pose, Scene, Surface, raised
from mathnavi.renders.scene.ground import floor_model, ground_model
from mathnavi.renders.stage import Optics, Stage, Staged, View

GLOW, FLOOR_GLOW = 0.75, 0.25  # over a ground of all but that; over a floor, where there are shadows, of lines
# Clipping planes: in distances of the camera, and in extents of the ground beyond two of those, for the sky is a cube
# between them.
NEAR, FAR, FLOOR_FAR = 0.02, 6.0, 60.0
NEAREST = 0.002  # extents: of a camera that is mounted on something
STEEP = -85.0  # [degrees] elevation below which a camera does not turn
WIDER = 1.15  # factor of the widths of lines, which a video blurs
PLUMB = 2.0  # [pixels] at a picture 720 pixels high: width of plumb lines
PIN = 34.0  # [pixels] likewise: height of the head of a pin over its place
DOT = 4.5  # [pixels] likewise: radius of a dot
RING = 27.0  # [pixels] likewise: least radius of a ring, around the vehicle in it
APART = 17.0  # [pixels] likewise: between two labels
CORNERS = np.linspace(0.0, 2.0 * math.pi, 25)  # of a ring
FILLING = 0.45  # opacity of what fills a ring
INSIDE = 0.67  # factor of opacities where the camera may be inside
RISE, AHEAD = 0.36, 0.55  # of a camera that follows, over the vehicle, and of its aim before that, in distances
WORLD = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), None)


class MujocoScene(Staged):
    """Pictures of a scene as a context manager, see ``Staged``."""

    def __init__(self, scene: Scene, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        self.scene, self._ground = scene, scene.ground
        self._cameras = {camera.shot: camera for camera in scene.cameras if camera.shot}
        self._factors = sorted({camera.tall for camera in self._cameras.values()})
        if self._ground is not None:
            spec = ground_model(self._ground, self._factors, width, height, samples)
        else:
            points = np.vstack([each.framed.points for each in self._cameras.values() if each.framed is not None])
            spec = floor_model(points, [each for each in scene.surfaces if _is_floor(each)], width, height, samples)
        for shot, camera in self._cameras.items():
            if camera.mounted is not None:
                body = spec.worldbody.add_body(name=shot, mocap=True)
                own = camera.mounted
                body.add_camera(name=shot, pos=own.pos, quat=own.quat, fovy=camera.field_of_view)
        for k, surface in enumerate(scene.surfaces):
            for factor in self._factors if surface.tall else (1.0,):
                low = scene.low if surface.motion is None else 0.0
                mesh = spec.add_mesh(name=f"{k} {factor}", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
                mesh.uservert = raised(surface.vertices, low, factor).ravel()
                mesh.userface = surface.faces.ravel()
        self.model: Any = spec.compile()
        self.stage = Stage(self.model, width, height, FLOOR_GLOW if self._ground is None else GLOW)
        self._aspect = width / height
        self._meshes = {self.model.mesh(k).name: k for k in range(self.model.nmesh)}
        self._colours: dict[str, Colour] = {
            each.motion: each.layer.colour for each in scene.surfaces if each.motion and each.layer
        }
        self._chases = {
            shot: ChaseCamera(scene.motions[camera.follow], camera, self._ground)
            for shot, camera in self._cameras.items()
            if camera.follow is not None and camera.behind > 0.0 and self._ground is not None
        }

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]; ``turn`` [degrees] turns cameras that see all from the side."""
        seen = self._cameras[camera]
        follows, poses = camera in self._chases, self._poses(t)
        self._look(camera, seen, poses, t, turn)
        self.stage.begin(fog=follows, shadows=self._ground is None)
        for k, surface in enumerate(self.scene.surfaces):
            pose = WORLD if surface.motion is None else poses.get(surface.motion)
            if pose is not None and (surface.layer is None or surface.layer.shown) and not _is_floor(surface):
                self._add_surface(k, surface, pose, seen, t)
        for lines in self.scene.lines:
            if lines.layer.shown and (seen.dashed or not lines.dashed):
                for points in lines.at(t):
                    self._add_line(self.world(points, camera), lines.colour, WIDER * lines.width, dashed=lines.dashed)
        for name, pose in poses.items():
            if self._ground is None or follows or name not in self._colours or pose.ground is None:
                continue
            if self._ground.contains(*pose.pos[:2]):
                ends = np.array([[*pose.pos[:2], pose.ground], pose.pos])
                self._add_line(self.world(ends, camera), self._colours[name], PLUMB)
        for mark in self.scene.marks:
            self._add_mark(mark, poses, camera, t)
        return self.stage.end(sky=follows)

    def world(self, points: Array, camera: str) -> Array:
        """(..., 3) points [m] of the scene where a camera shows them."""
        return raised(points, self.scene.low, self._cameras[camera].tall)

    def pixels(self, points: Array, camera: str) -> Array:
        """(n, 3) column, row and depth [m] of points (n, 3) in the picture drawn last; depth <= 0 is behind."""
        return self.stage.pixels(self.world(points, camera))

    def labels(self, t: float, camera: str) -> list[Label]:
        """Names of the marks in sight of the picture drawn last, as far as they do not hide each other."""
        found: list[Label] = []
        poses, (eye, _, _) = self._poses(t), self.stage.eye()
        for mark in self.scene.marks:
            place, foot = _place(mark, poses)
            text = mark.brief or mark.text
            if place is None or (foot is None and mark.motion is None) or self._is_ring(mark, camera):
                continue
            hiding = self._ground if camera in self._chases and foot is not None else None
            if hiding is not None and not hiding.line_of_sight(eye, place):
                continue
            shown = self.world(self._points_of(mark, place), camera)
            if mark.dot and foot is not None:
                shown[:, 2] += PIN * self.stage.unit * float(self.stage.metres_per_pixel(shown)[0])
            inside = self.stage.inside(shown)
            if len(inside):
                column, row = inside.mean(axis=0).tolist()
                apart = APART * self.stage.unit
                if all(o.text != text and math.hypot(column - o.column, row - o.row) > apart for o in found):
                    found.append(Label(text, column, row))
        return found

    # ---- where things are

    def _poses(self, t: float) -> Mapping[str, Pose]:
        """The poses of all motions that are shown."""
        found = {name: motion.at(t) for name, motion in self.scene.motions.items()}
        return {name: pose for name, pose in found.items() if pose is not None}

    def _look(self, shot: str, camera: Camera, poses: Mapping[str, Pose], t: float, turn: float) -> None:
        """Put a camera in its place."""
        group, far = (self._factors.index(camera.tall),), FAR if self._ground is not None else FLOOR_FAR
        if camera.mounted is not None:
            k, pose = int(self.model.body(shot).mocapid[0]), WORLD if camera.follow is None else poses[camera.follow]
            self.stage.data.mocap_pos[k], self.stage.data.mocap_quat[k] = pose.pos, pose.quat
            self.stage.look_through(self.model.camera(shot).id, Optics(camera.field_of_view, NEAREST, far), group)
            return
        view = self._chases[shot].view(t) if shot in self._chases else self._view(camera, poses, turn)
        beyond = view.distance / self.model.stat.extent
        self.stage.look(view, Optics(camera.field_of_view, NEAR * beyond, 2.0 * beyond + far), group)

    def _view(self, camera: Camera, poses: Mapping[str, Pose], turn: float) -> View:
        """The view that has in its box what the camera frames, or in its middle what it follows."""
        if camera.framed is None:
            about = poses[camera.follow].pos if camera.follow else 0.0
            return View(about + np.array(camera.target), camera.distance, camera.azimuth + turn, camera.elevation)
        moved = [poses[name].pos for name in camera.framed.motions if name in poses]
        points = raised(np.vstack([camera.framed.points, *moved]), self.scene.low, camera.tall)
        sight = camera.azimuth + (turn if camera.elevation > STEEP else 0.0), camera.elevation
        return framing(points, camera.framed.box, camera.field_of_view, self._aspect, sight)

    def _points_of(self, mark: Mark, place: Array) -> Array:
        """(m, 3) [m] what a mark names: a dome over the ground, only part of which is in sight next to a vehicle."""
        found = [each.vertices for each in self.scene.surfaces if each.motion == mark.motion and not each.span]
        if mark.motion is None or not mark.dot or not found:
            return place[None]
        shape = np.vstack(found)
        upper: Array = place + shape[shape[:, 2] > 0.25 * shape[:, 2].max()]
        return upper

    def _is_ring(self, mark: Mark, camera: str) -> bool:
        return mark.ring > 0.0 and self._cameras[camera].tall == 1.0

    # ---- what is drawn

    def _add_surface(self, k: int, surface: Surface, pose: Pose, camera: Camera, t: float) -> None:
        follows, opacity, quat, size = camera.shot in self._chases, surface.opacity, pose.quat, 1.0
        place = raised(pose.pos, self.scene.low, camera.tall) if surface.motion else pose.pos
        if surface.span > 0.0:
            eye, forward, _ = self.stage.eye()
            depth = max(float((place - eye) @ forward), 1e-6)
            wanted = camera.span * 2.0 * self.stage.tangent() * depth
            if wanted > surface.span:
                # Drawn so large it would stick in the ground: it is seen at the tip of its path, but nearer to the eye.
                nearer = min(wanted / depth, 0.5)
                place, size = place + nearer * (eye - place), (1.0 - nearer) * wanted / surface.span
                if not follows:
                    # Tilted, it could turn its edge to the camera, and the discs of its rotors are what can be seen.
                    quat, opacity = _level(quat), 1.0
        elif follows and opacity < 1.0:
            opacity *= INSIDE
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, quat)
        rotation: Array = matrix.reshape(3, 3)
        if surface.spin:
            c, s = math.cos(surface.spin * t), math.sin(surface.spin * t)
            turned, axle = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]), np.array([*surface.axle, 0.0])
            place, rotation = place + size * rotation @ (axle - turned @ axle), rotation @ turned
        mesh = self._meshes[f"{k} {camera.tall if surface.tall else 1.0}"]
        glow = GLOW if self._ground is not None else surface.glow
        self.stage.mesh(mesh, place, rotation, size, (*surface.colour, opacity), glow)

    def _add_line(self, points: Array, colour: Colour, width: float, *, dashed: bool = False) -> None:
        for part in self.stage.drawable(points):
            self.stage.line(part, colour, width, dashed=dashed)

    def _add_mark(self, mark: Mark, poses: Mapping[str, Pose], camera: str, t: float) -> None:
        """Add a dot, a pin on the ground below it, or a ring on a column, which is filled from its time on."""
        place, foot = _place(mark, poses)
        if place is None or not mark.dot:
            return
        if foot is None:
            if mark.motion is None:
                self.stage.dot(self.world(place, camera), DOT, mark.colour)
            return
        ends = self.world(np.array([[*place[:2], foot], place]), camera)
        if not self._is_ring(mark, camera):
            self.stage.pin(ends[0], ends[1], PIN, mark.colour)
            return
        radius = max(mark.ring, RING * self.stage.unit * float(self.stage.metres_per_pixel(place[None])[0]))
        rim = np.column_stack([np.cos(CORNERS), np.sin(CORNERS), np.zeros_like(CORNERS)])
        self.stage.line(place + radius * rim, mark.colour, 3.0)
        self.stage.line(ends, mark.colour, PLUMB)
        if mark.filled <= t:
            self.stage.disc(place, np.array([radius, radius]), 0.0, (*mark.colour, FILLING))


class ChaseCamera:
    """Behind and above a motion, on a smoothed path that stays clear of the ground."""

    def __init__(self, motion: Motion, camera: Camera, ground: HeightField) -> None:
        step, sigma, distance = camera.behind / 16.0, 10.0, camera.distance
        self.t = np.arange(motion.t[0], motion.t[-1] + step, step)
        position = np.column_stack([np.interp(self.t, motion.t, motion.pos[:, k]) for k in range(3)])
        course = position[-1, :2] - position[0, :2]
        # Where the vehicle hovers the course of all of its way stands in for a direction of flight.
        rate = np.gradient(position[:, :2], step, axis=0) + course / max(float(np.linalg.norm(course)), 1.0)
        rate = gaussian_filter1d(rate, 1.6 * sigma, axis=0, mode="nearest")
        heading = rate / np.maximum(np.linalg.norm(rate, axis=1, keepdims=True), 1e-9)
        climb = gaussian_filter1d(position[:, 2], sigma, mode="nearest")
        back = position[:, :2] - distance * heading
        # The camera clears the highest ground between itself and the vehicle, known a little in advance.
        line = np.linspace(0.0, 1.0, 9)[:, None, None]
        east, north = np.moveaxis(back + line * (position[:, :2] - back), -1, 0)
        below = ground.height(np.clip(east, 0.0, ground.width), np.clip(north, 0.0, ground.depth))
        least = maximum_filter1d(np.max(below, axis=0) + camera.clear, round(2.0 * sigma) | 1, mode="nearest")
        height = gaussian_filter1d(np.maximum(climb + RISE * distance, least), 0.7 * sigma, mode="nearest")
        self.eye = np.column_stack([back, height])
        aim = gaussian_filter1d(position[:, 2], 0.2 * sigma, mode="nearest")
        self.lookat = np.column_stack([position[:, :2] + AHEAD * distance * heading, aim])

    def view(self, t: float) -> View:
        eye, lookat = (
            np.array([np.interp(t, self.t, path[:, k]) for k in range(3)]) for path in (self.eye, self.lookat)
        )
        return View.between(eye, lookat)


def _is_floor(surface: Surface) -> bool:
    return surface.checker > 0.0 and surface.motion is None


def _level(quat: Array) -> Array:
    """The part (4,) about the vertical of a quaternion (4,); none of one that is upside down."""
    length = math.hypot(quat[0], quat[3])
    return np.array([quat[0], 0.0, 0.0, quat[3]]) / length if length > 1e-6 else WORLD.quat


def _place(mark: Mark, poses: Mapping[str, Pose]) -> tuple[Array | None, float | None]:
    """Place (3,) [m] of a mark and the height [m] of the ground below it, as far as known."""
    if mark.motion is None:
        return mark.place, mark.foot
    pose = poses.get(mark.motion)
    return (None, None) if pose is None else (pose.pos, pose.ground)
