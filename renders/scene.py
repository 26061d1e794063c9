"""A run drawn by MuJoCo: the ground, the airframe, the path flown, the plan ahead, radars, start and target.

Two worlds stand in one model: the true one for the chase camera, and one for the overview and the top view, whose
heights above the lowest ground are multiplied by ``storyboard.EXAGGERATION``. On a map of 82 km nothing could be seen
at its true size, so vehicle, lines and beacons are drawn at a size in pixels.

Import ``renders.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from types import TracebackType
from typing import Any

import mujoco
import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

import models.aerial
from models.aerial.entity import airframe_pose
from renders.palette import COLOURS, Part, Picture, part_of
from renders.relief import relief, resampled, roughened
from renders.run_data import RunData, plan_arcs
from renders.stage import HORIZON, NADIR, Optics, Stage, View
from renders.storyboard import EXAGGERATION
from sim.signals import Array

GROUND_NODES, TEXTURE_PIXELS = 257, 1025  # along the longer side
DETAIL = 4  # texture pixels painted for each pixel of the relief, unless the picture is small
SMALL = 360  # [pixels] height of a small picture
# The extent is half the side of the map. The top view is taken from far away, so that it looks like a map.
OPTICS = {
    "chase": Optics(45.0, 2e-4, 5.0),
    "overview": Optics(30.0, 0.05, 12.0),
    "top": Optics(8.0, 1.0, 30.0),
}
TRUE_WORLD, TALL_WORLD, AIRFRAME = 0, 1, 2  # geom groups
TRUE_SPAN = 12.0  # [m] of the airframe as drawn
CHASE_DISTANCE = 1300.0  # [m] behind the vehicle
PIN = 34.0  # [pixels] at a picture 720 pixels high: height of the pins at start and target
BASE = 0.02  # share of the width: thickness of the slab under the lowest ground
_ANGLE, _RISE = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False), np.radians([15.0, 30.0, 50.0, 75.0]))
# (192, 3) points on the upper half of the unit sphere
DOME = np.stack([np.cos(_ANGLE) * np.cos(_RISE), np.sin(_ANGLE) * np.cos(_RISE), np.sin(_RISE)], -1).reshape(-1, 3)
FILL = {"overview": 0.97, "top": 0.95}  # share of the picture that the map takes


class Scene:
    """A context manager: the renderer is closed at its end, or OSMesa complains when the process ends."""

    def __init__(self, run: RunData, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        self.run = run
        self._low = float(run.terrain.z.min())
        self.model = _model(run, width, height, samples)
        airframe = self.model.body("airframe").id
        self._airframe_geoms = np.flatnonzero(self.model.geom_bodyid == airframe)
        self._airframe_size = self.model.geom_size[self._airframe_geoms].copy()
        self._airframe_pos = self.model.geom_pos[self._airframe_geoms].copy()
        self._airframe_alpha = self.model.geom_rgba[self._airframe_geoms, 3].copy()
        self._chase = ChaseCamera(run)
        self.stage = Stage(self.model, width, height, glow=0.75)

    def __enter__(self) -> Scene:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stage.close()

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """The picture at time ``t`` [s]; ``turn`` [degrees] turns the overview around the map."""
        view = self._chase.view(t) if camera == "chase" else self._map_view(camera, turn)
        self.stage.look(view, OPTICS[camera], (TRUE_WORLD if camera == "chase" else TALL_WORLD, AIRFRAME))
        self._place_airframe(t, camera, view)
        self.stage.begin(fog=camera == "chase")
        self._add_lines(t, camera)
        self._add_beacons(camera)
        return self.stage.end(sky=camera == "chase")

    def world(self, points: Array, camera: str) -> Array:
        """(..., 3) map points [m] where the camera's world shows them."""
        factor = 1.0 if camera == "chase" else EXAGGERATION
        return np.concatenate(
            [points[..., :2], self._low + factor * (points[..., 2:] - self._low)], axis=-1, dtype=np.float64
        )

    def pixels(self, points: Array, camera: str) -> Array:
        """(n, 3) column, row and depth [m] of map points (n, 3) in the picture drawn last; depth <= 0 is behind."""
        return self.stage.pixels(self.world(points, camera))

    def labels(self, t: float, camera: str) -> list[tuple[str, float, float]]:
        """(text, column, row) of what is in sight of the picture drawn last: start, target, radars that are on."""
        run = self.run
        lift = PIN * self.stage.unit
        found = []
        eye, _, _ = self.stage.eye()
        for part, place in ((Part.START, run.mission.start), (Part.TARGET, run.mission.target)):
            if camera == "chase" and not run.terrain.line_of_sight(eye, place):
                continue
            pin = np.array([0.0, 0.0, lift * float(self.stage.metres_per_pixel(self.world(place[None], camera))[0])])
            top = place + pin / (1.0 if camera == "chase" else EXAGGERATION)
            found.append((part.value, self.stage.inside(self.world(top[None], camera))))
        for number, radar in enumerate(run.mission.radars, start=1):
            if t >= radar.time:
                centre = np.array([radar.x, radar.y, float(run.terrain.height(radar.x, radar.y))])
                # Beside the vehicle only a part of the dome is in the picture.
                points = centre + (radar.radius * DOME if camera == "chase" else np.zeros((1, 3)))
                name = Part.RADAR.value if len(run.mission.radars) == 1 else f"{Part.RADAR.value} {number}"
                found.append((name, self.stage.inside(self.world(points, camera))))
        return [(name, *pixels.mean(axis=0).tolist()) for name, pixels in found if len(pixels)]

    # ---- cameras

    def _map_view(self, camera: str, turn: float) -> View:
        """The view from which the whole map fills the picture."""
        if camera == "top":
            return self._framed(90.0, -89.9, camera)
        # Turned a little from north-up, to the side from which the course to the target crosses the picture.
        course = self.run.mission.target - self.run.mission.start
        northward = 1.0 if course[0] * course[1] >= 0.0 else -1.0
        return self._framed(90.0 + 24.0 * northward + turn, -36.0, camera)

    def _framed(self, azimuth: float, elevation: float, camera: str) -> View:
        terrain = self.run.terrain
        a, e = math.radians(azimuth), math.radians(elevation)
        forward = np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])
        right = np.array([math.sin(a), -math.cos(a), 0.0])
        up = np.cross(right, forward)
        heights = (self._low - BASE * terrain.width / EXAGGERATION, 0.6 * float(terrain.z.max()) + 0.4 * self._low)
        corners = np.array([[x, y, z] for x in (0.0, terrain.width) for y in (0.0, terrain.depth) for z in heights])
        corners = self.world(corners, camera)
        tangent = math.tan(math.radians(OPTICS[camera].field_of_view) / 2.0)
        aspect = self.stage.width / self.stage.height
        lookat, distance = corners.mean(axis=0), max(terrain.width, terrain.depth)
        for _ in range(12):  # centre, then fill; perspective couples the two only weakly
            ahead = corners - (lookat - distance * forward)
            depth = ahead @ forward
            across, along = ahead @ right / depth, ahead @ up / depth
            middle = 0.5 * np.array([across.min() + across.max(), along.min() + along.max()])
            lookat = lookat + distance * (middle[0] * right + middle[1] * up)
            half = 0.5 * max(np.ptp(across) / aspect, np.ptp(along))
            distance *= half / (FILL[camera] * tangent)
        return View(lookat, distance, azimuth, elevation)

    # ---- what is drawn

    def _place_airframe(self, t: float, camera: str, view: View) -> None:
        near = camera == "chase"
        x = self.run.state(t)
        # From afar it is drawn level: tilted, it could turn its edge to the camera and be lost to sight.
        u = self.run.u[min(self.run.index(t), len(self.run.u) - 1)] if near else np.zeros(3)
        position, quaternion = airframe_pose(x[:3], x[3:], u)
        position = self.world(position, camera)
        span = 0.16 if near else 0.055  # of the picture's height
        scale = span * 2.0 * (CHASE_DISTANCE if near else view.distance) * self.stage.tangent() / TRUE_SPAN
        if not near:
            # Drawn so large it would stick in the ground: it is seen at the tip of its path, but nearer to the camera.
            nearer = scale * TRUE_SPAN / float(np.linalg.norm(view.eye - position))
            position, scale = position + nearer * (view.eye - position), (1.0 - nearer) * scale
        # The discs of the rotors, nearly clear beside the vehicle, are what is seen of it from afar.
        self.model.geom_rgba[self._airframe_geoms, 3] = self._airframe_alpha if near else 1.0
        self.stage.data.mocap_pos[0], self.stage.data.mocap_quat[0] = position, quaternion
        self.model.geom_size[self._airframe_geoms] = scale * self._airframe_size
        self.model.geom_pos[self._airframe_geoms] = scale * self._airframe_pos
        opacity = 0.16 if near else 0.24  # the chase camera often looks from inside
        for k, radar in enumerate(self.run.mission.radars):
            for world in ("true", "tall"):
                self.model.geom(f"radar {k} {world}").rgba[3] = opacity if t >= radar.time else 0.0

    def _add_lines(self, t: float, camera: str) -> None:
        width = 4.0 if camera == "chase" else 3.4  # [pixels] at a picture 720 pixels high
        for part, points in self._lines(t, camera):
            self.stage.line(self.world(points, camera), COLOURS[part], width, dashed=part is Part.COMPLETION)
        x = self.run.state(t)
        # A plumb line tells where over the ground the vehicle is.
        if camera != "chase" and self.run.terrain.contains(x[0], x[1]):
            foot = np.array([x[0], x[1], float(self.run.terrain.height(x[0], x[1]))])
            self.stage.line(self.world(np.array([foot, x[:3]]), camera), COLOURS[Part.FLOWN], 2.0)

    def _lines(self, t: float, camera: str) -> Iterator[tuple[Part, Array]]:
        run = self.run
        now = run.index(t)
        if now > 0:
            here = run.travelled[now]
            total = max(float(run.travelled[-1]), 1.0)
            fine, coarse = (60.0, total / 150.0) if camera == "chase" else (total / 260.0, total / 260.0)
            near = max(0.0, here - 6000.0)
            stops = np.concatenate([np.arange(0.0, near, coarse), np.arange(near, here, fine), [here]])
            yield Part.FLOWN, np.vstack([run.x[np.searchsorted(run.travelled, stops), :3], run.state(t)[:3]])
        plan = run.plan(t)
        if plan is not None and t < run.duration:  # at the end nothing is ahead
            for part, arcs in groupby(plan_arcs(plan, t, step=0.6), lambda arc: part_of(arc[0])):
                yield part, np.vstack([points for _, points in arcs])

    def _add_beacons(self, camera: str) -> None:
        for part, place in ((Part.START, self.run.mission.start), (Part.TARGET, self.run.mission.target)):
            ground = np.array([place[0], place[1], float(self.run.terrain.height(place[0], place[1]))])
            foot, top = self.world(np.array([ground, place]), camera)
            pixel = float(self.stage.metres_per_pixel(top[None])[0]) * self.stage.unit
            high = top + np.array([0.0, 0.0, PIN * pixel])
            self.stage.capsule(foot, high, 1.6 * pixel, COLOURS[part])
            self.stage.capsule(high, high + np.array([0.0, 0.0, 0.1 * pixel]), 6.0 * pixel, COLOURS[part])


class ChaseCamera:
    """Behind and above the vehicle, on a smoothed path that stays clear of the ground."""

    STEP = 0.25  # [s] between the precomputed places
    SMOOTHING = 2.5  # [s] standard deviation of the Gaussian that steadies the camera

    def __init__(self, run: RunData) -> None:
        self.t = np.arange(0.0, run.duration + self.STEP, self.STEP)
        position = np.array([run.state(float(t))[:3] for t in self.t])
        sigma = self.SMOOTHING / self.STEP
        course = run.mission.target[:2] - run.mission.start[:2]
        # Where the vehicle hovers the course to the target stands in for a direction of flight.
        rate = np.gradient(position[:, :2], self.STEP, axis=0) + course / max(float(np.linalg.norm(course)), 1.0)
        rate = gaussian_filter1d(rate, 1.6 * sigma, axis=0, mode="nearest")
        heading = rate / np.maximum(np.linalg.norm(rate, axis=1, keepdims=True), 1e-9)
        climb = gaussian_filter1d(position[:, 2], sigma, mode="nearest")
        back = position[:, :2] - CHASE_DISTANCE * heading
        # The camera clears the highest ground between itself and the vehicle, known a little in advance.
        line = np.linspace(0.0, 1.0, 9)[:, None, None]
        east, north = np.moveaxis(back + line * (position[:, :2] - back), -1, 0)
        ground = run.terrain.height(np.clip(east, 0.0, run.terrain.width), np.clip(north, 0.0, run.terrain.depth))
        least = maximum_filter1d(np.max(ground, axis=0) + 110.0, round(2.0 * sigma) | 1, mode="nearest")
        height = gaussian_filter1d(np.maximum(climb + 0.36 * CHASE_DISTANCE, least), 0.7 * sigma, mode="nearest")
        self.eye = np.column_stack([back, height])
        ahead = 0.55 * CHASE_DISTANCE * heading
        self.lookat = np.column_stack([position[:, :2] + ahead, gaussian_filter1d(position[:, 2], 2.0, mode="nearest")])

    def view(self, t: float) -> View:
        eye, lookat = (
            np.array([np.interp(t, self.t, path[:, k]) for k in range(3)]) for path in (self.eye, self.lookat)
        )
        return View.between(eye, lookat)


# ---- the model


def _model(run: RunData, width: int, height: int, samples: int) -> Any:
    terrain = run.terrain
    spec = mujoco.MjSpec()
    side = max(terrain.width, terrain.depth)
    low, high = float(terrain.z.min()), float(terrain.z.max())
    spec.stat.extent = 0.5 * side
    spec.stat.center = [0.5 * terrain.width, 0.5 * terrain.depth, 0.5 * (low + high)]
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.map.fogstart, spec.visual.map.fogend = 0.25, 2.6
    spec.visual.rgba.fog = [*HORIZON, 1.0]
    spec.visual.quality.offsamples = samples
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 20, 6  # a line has hundreds of capsules
    spec.visual.headlight.active = 0
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        dir=[0.55, -0.55, -0.75],
        diffuse=[0.26, 0.25, 0.23],
        ambient=[0.08, 0.08, 0.09],
        specular=[0.1, 0.1, 0.1],
        castshadow=False,
    )
    spec.add_texture(
        name="backdrop",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=HORIZON,
        rgb2=NADIR,
        width=256,
        height=256 * 6,
    )
    _add_ground(spec, run, low, high, detail=DETAIL if height > SMALL else 1)
    spec.add_material(name="radar", emission=0.8, specular=0.0)
    for k, radar in enumerate(run.mission.radars):
        foot = float(terrain.height(radar.x, radar.y))
        for group, name, factor in ((TRUE_WORLD, "true", 1.0), (TALL_WORLD, "tall", EXAGGERATION)):
            mesh = spec.add_mesh(name=f"radar {k} {name}", scale=[radar.radius, radar.radius, factor * radar.radius])
            mesh.make_sphere(subdivision=4)
            spec.worldbody.add_geom(
                name=f"radar {k} {name}",
                type=mujoco.mjtGeom.mjGEOM_MESH,
                meshname=mesh.name,
                pos=[radar.x, radar.y, low + factor * (foot - low)],
                rgba=[*COLOURS[Part.RADAR], 0.0],
                material="radar",
                group=group,
                contype=0,
                conaffinity=0,
            )
    vehicle = mujoco.MjSpec.from_file(str(Path(models.aerial.__file__).parent / "airframe.xml"))
    spec.add_material(name="airframe", emission=0.7, specular=0.3, shininess=0.5)
    body = spec.worldbody.add_body(name="airframe", mocap=True)
    for geom in vehicle.worldbody.geoms:
        _copy_geom(body, geom)
    return spec.compile()


def _copy_geom(body: Any, geom: Any) -> None:
    body.add_geom(
        type=geom.type, size=geom.size, pos=geom.pos, quat=geom.quat, fromto=geom.fromto, rgba=geom.rgba,
        material="airframe", group=AIRFRAME, contype=0, conaffinity=0,
    )  # fmt: skip


def _add_ground(spec: Any, run: RunData, low: float, high: float, detail: int) -> None:
    terrain = run.terrain
    nodes = resampled(terrain, GROUND_NODES, order=1)
    picture = roughened(relief(terrain, TEXTURE_PIXELS), detail, contrast=0.05)
    # A texture's row 0 is its northern edge in relief() and its southern one in MuJoCo.
    texture = spec.add_texture(
        name="relief",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        width=picture.shape[1],
        height=picture.shape[0],
        nchannel=3,
    )
    texture.data = picture.tobytes()
    ground = spec.add_material(name="ground", emission=0.86, specular=0.0, shininess=0.0)
    textures = [""] * len(ground.textures)
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "relief"
    ground.textures = textures
    for group, name, factor in ((TRUE_WORLD, "true", 1.0), (TALL_WORLD, "tall", EXAGGERATION)):
        spec.add_hfield(
            name=name,
            nrow=nodes.shape[0],
            ncol=nodes.shape[1],
            size=[0.5 * terrain.width, 0.5 * terrain.depth, factor * max(high - low, 1.0), BASE * terrain.width],
            userdata=((nodes - low) / max(high - low, 1.0)).ravel(),
        )
        spec.worldbody.add_geom(
            name=f"ground {name}",
            type=mujoco.mjtGeom.mjGEOM_HFIELD,
            hfieldname=name,
            pos=[0.5 * terrain.width, 0.5 * terrain.depth, low],
            material="ground",
            group=group,
            contype=0,
            conaffinity=0,
        )
