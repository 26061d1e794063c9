"""A robot that localises itself, drawn by MuJoCo: its field, its rays, and the poses that its estimator holds likely.

The model is the one that was driven, with a floor, a light and walls to look at. What is believed is drawn as ghosts of
the robot: the estimate with its standard deviations, the hypotheses the paler the less they explain, and outlined the
poses from which the robot would read the same.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.field.arena import DRAWN_GROUP, FLOOR_GROUP, SENSOR_HEIGHT, WALL_HEIGHT, WALL_THICKNESS
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.entity import FLOOR, build_spec
from mathnavi.renders.overlay import Label
from mathnavi.renders.palette import COLOURS, Picture, SceneElement
from mathnavi.renders.ranging import shapes
from mathnavi.renders.ranging.floor import OUTSIDE, extent, floor_picture, pale
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.renders.stage import Optics, Stage, Staged, View, set_size
from mathnavi.sim.records.run_folder import last_at

ROBOT_GROUP = 2  # of the geoms of the robot that eyes see
LIGHT, DIFFUSE = (-0.35, -0.30, 0.9), 0.42  # where it comes from, and how strong it is
WALL = (0.34, 0.41, 0.50, 1.0)
LINE = {"top": 2.4, "chase": 3.0}  # [pixels] width of lines at a picture 720 pixels high
PATH, MARKS = 0.004, 0.006  # [m] height above the floor of paths, and of what is drawn around poses
ABOVE = 0.20  # [m] likewise in the top view, where a robot would hide it
PATH_POINTS = 260
JUMP = 0.25  # [m] between two estimates over which no path is drawn
SHADE, SHADE_RADIUS, SHADE_HEIGHT = (0.10, 0.12, 0.16, 0.22), 0.135, 0.0015  # under the robot; [m]
TURRET, DASHED = 0.035, 20  # [m] radius; points of a ray that may be dashed
FAN = 0.62  # [m] radius of the sector of headings
SHOWN, FAINT = 0.38, 0.08  # opacity of the estimate's ghost, of the faintest hypothesis that is left
MERGED, LEAST = 0.3, 0.3  # [m] from what it lies on, within which a ghost is drawn fainter; down to this share
LIFT = 0.002  # [m] of a ghost, so that its nose and that of a robot in the same place do not flicker
DEVIATIONS = 3.0  # of the ellipse of a beacon
APART = 0.3  # [m] between robot and estimate from which on both are named
# The backdrop stands at 0.57 of the far plane, which therefore is far.
OPTICS = {"top": Optics(11.0, 2.0, 150.0), "chase": Optics(42.0, 0.1, 40.0)}
# Left, right, top and bottom of the parts of a picture that are free of words: above the panels, between them.
FREE = ((0.02, 0.98, 0.13, 0.745), (0.222, 0.805, 0.11, 0.95))
CHASE_DISTANCE, CHASE_ELEVATION = 2.7, -38.0  # [m], [degrees]
CHASE_MEMORY = 2.0  # [s] before and after, over which the camera behind the robot takes the mean of its headings
CHASE_AHEAD = 0.15  # [m] point of aim of that camera in front of the robot


class RangingScene(Staged):
    """Scene as a context manager, see ``Staged``."""

    def __init__(self, run: RangingRun, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        self.run = run
        self.model = _model(run, width, height, samples)
        self.stage = Stage(self.model, width, height, glow=0.1)
        self._top = top_view(np.concatenate((run.curve.polyline, run.beacons)), width / height)
        robot = np.flatnonzero(self.model.geom_group == ROBOT_GROUP).tolist()
        nose = [g for g in robot if self.model.geom(g).name.endswith("/nose")]
        self._nose, self._body = frozenset(nose), frozenset(robot) - frozenset(nose)
        self._height = 0.0  # [m] of marks around poses, in the picture being drawn

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]; ``turn`` [degrees] turns the camera behind the robot."""
        run, stage = self.run, self.stage
        view = self._top if camera == "top" else chase_view(run, t, turn)
        stage.look(view, OPTICS[camera], (FLOOR_GROUP, DRAWN_GROUP, ROBOT_GROUP))
        self._height = ABOVE if camera == "top" else MARKS
        stage.data.qpos[:] = run.joints(t)[: len(stage.data.qpos)]
        stage.begin(fog=False)
        stage.disc(np.array([*stage.data.qpos[:2], SHADE_HEIGHT]), np.full(2, SHADE_RADIUS), 0.0, SHADE)
        self._add_paths(t, camera)
        if run.reads_walls:
            self._add_rays(t, camera)
        self._add_beacons(t, camera)
        self._add_images(t, camera)
        self._add_hypotheses(t, camera)
        self._add_estimate(t, camera)
        return stage.end(sky=False)

    def labels(self, t: float, camera: str) -> list[Label]:
        """Return the names of the elements in view of the picture drawn last."""
        run = self.run
        here, k = run.joints(t)[:3], run.belief(t)
        named = [("robot", here[:2])]
        if k >= 0 and float(np.linalg.norm(run.beliefs.x[k, :2] - here[:2])) > APART:
            more = " (indistinguishable)" if run.indistinguishable[k] else ""
            named.append((SceneElement.ESTIMATE.value + more, run.beliefs.x[k, :2]))
        lift = 30.0 * self.stage.unit
        found = [self.stage.inside(np.array([[*place, ABOVE]])) for _, place in named]
        return [
            Label(text, float(at[0, 0]), float(at[0, 1]) - lift)
            for (text, _), at in zip(named, found, strict=True)
            if len(at)
        ]

    # ---- what is added

    def _add_paths(self, t: float, camera: str) -> None:
        run, width = self.run, LINE[camera]
        driven = run.pose[: run.index(t) + 1, :2]
        known = run.beliefs.x[: last_at(run.beliefs.t, t) + 1][run.initialised[: last_at(run.beliefs.t, t) + 1]]
        self._add_path(known[:, :2], SceneElement.ESTIMATE, PATH, 0.75 * width)
        self._add_path(np.vstack([driven, run.joints(t)[:2]]), SceneElement.DRIVEN, 0.5 * PATH, width)

    def _add_path(self, places: Array, part: SceneElement, height: float, width: float) -> None:
        """A line through places (n, 2), but for jumps."""
        jumps = np.linalg.norm(np.diff(places, axis=0), axis=1) > JUMP
        for piece in np.split(places, np.flatnonzero(jumps) + 1):
            count = max(2, round(PATH_POINTS * len(piece) / max(len(places), 1)))
            chosen = np.unique(np.linspace(0, len(piece) - 1, min(count, len(piece))).round().astype(int))
            if len(chosen) > 1:
                self.stage.line(_lifted(piece[chosen], height), pale(COLOURS[part], 0.8), width)

    def _add_rays(self, t: float, camera: str) -> None:
        """Add rays from the turret to the wall, with a dot at each reading; dashed and grey where it was lost."""
        run, stage = self.run, self.stage
        pose = run.joints(t)[:3]
        mission, read = run.mission, run.ranges[run.index(t)]
        rays = zip(mission.angles, mission.origins(pose), mission.ranges(pose), read, strict=True)
        for angle, begin, rho, reading in rays:
            if not math.isfinite(rho):
                continue
            along = np.array([math.cos(pose[2] + angle), math.sin(pose[2] + angle)])
            ray = _lifted(begin + np.linspace(TURRET, rho, DASHED)[:, None] * along, SENSOR_HEIGHT)
            lost = not math.isfinite(reading)
            colour = COLOURS[SceneElement.LOST_RAY if lost else SceneElement.RAY]
            stage.line(ray if lost else ray[[0, -1]], colour, 0.65 * LINE[camera], dashed=lost)
            if not lost:
                self._add_dot(begin + reading * along, SceneElement.RAY, 6.0)

    def _add_beacons(self, t: float, camera: str) -> None:
        """Add each beacon, and a line to it from the robot."""
        here = self.run.joints(t)[:2]
        for place in self.run.beacons:
            line = _lifted(np.array([here, place]), SENSOR_HEIGHT)
            self.stage.line(line, pale(COLOURS[SceneElement.RAY], 0.6), 0.65 * LINE[camera])
            self._add_dot(place, SceneElement.BEACON, 16.0)
        for place, P in self.run.beacons_believed(self.run.belief(t)).values():
            axes, direction = shapes.half_axes(P, DEVIATIONS)
            ring = _lifted(shapes.ellipse(place, axes, direction), self._height)
            self.stage.line(ring, COLOURS[SceneElement.ESTIMATE], 0.6 * LINE[camera])
            self._add_dot(place, SceneElement.ESTIMATE, 8.0)

    def _add_images(self, t: float, camera: str) -> None:
        """The outline of the robot wherever it would read the same."""
        for image in self.run.images(self.run.joints(t)[:3])[1:]:
            points = _lifted(shapes.outline(image), self._height)
            self.stage.line(points, COLOURS[SceneElement.IMAGE], 0.6 * LINE[camera])

    def _add_hypotheses(self, t: float, camera: str) -> None:
        """All but the one that is the estimate."""
        beliefs, k = self.run.beliefs, self.run.belief(t)
        if k < 0 or beliefs.hypotheses is None:
            return
        strengths = beliefs.strengths(k)
        for j in np.argsort(strengths):
            pose = beliefs.hypotheses[k, j]
            if np.isfinite(pose).all() and strengths[j] > 0.0 and not np.allclose(pose, beliefs.x[k]):
                self._add_ghost(pose, SceneElement.HYPOTHESIS, float(strengths[j]), LINE[camera], beliefs.x[k])

    def _add_estimate(self, t: float, camera: str) -> None:
        """The ghost, its heading, what it is unsure of; of the observer (C.5) where it believes that the rays end."""
        run, k = self.run, self.run.belief(t)
        if k < 0:
            return
        x, P, width = run.beliefs.x[k], run.beliefs.covariance, LINE[camera]
        colour = COLOURS[SceneElement.ESTIMATE]
        if run.status(t) is Status.LOST:
            colour = pale(colour, 0.45)
        self._add_ghost(x, SceneElement.ESTIMATE, 1.0, width, self.stage.data.qpos)
        if P is not None and np.isfinite(P[k]).all():
            for deviations, opacity in ((3.0, 0.16), (1.0, 0.26)):
                axes, direction = shapes.half_axes(P[k], deviations)
                self.stage.disc(np.array([*x[:2], self._height]), axes, direction, (*colour, opacity))
                if deviations > 1.0:
                    points = _lifted(shapes.ellipse(x[:2], axes, direction), self._height)
                    self.stage.line(points, colour, 0.6 * width)
            spread = 3.0 * math.sqrt(max(float(P[k, 2, 2]), 0.0))
            self.stage.line(_lifted(shapes.fan(x, spread, FAN), self._height), colour, 0.6 * width)
        if run.beliefs.z is not None and isinstance(run.curve, Curve):
            believed = run.curve.points(run.beliefs.z[k, :-1])
            for place in believed:
                ray = _lifted(x[:2] + np.linspace(0.0, 1.0, DASHED)[:, None] * (place - x[:2]), SENSOR_HEIGHT)
                self.stage.line(ray, colour, 0.45 * width, dashed=True)
                self._add_dot(place, SceneElement.BELIEVED, 8.0)

    def _add_ghost(self, pose: Array, part: SceneElement, strength: float, width: float, other: Array) -> None:
        """The robot once more, at a pose (3,), and its outline; paler with less ``strength`` in [0, 1].

        It gives way to what is at the place ``other`` (2 or more,) where the two lie on one another.
        """
        here = self.stage.data.qpos[:3]
        c, s = math.cos(pose[2] - here[2]), math.sin(pose[2] - here[2])
        rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        shift = np.array([*pose[:2], LIFT]) - rotation @ np.array([*here[:2], 0.0])
        clear = min(1.0, max(LEAST, math.dist(pose[:2], other[:2]) / MERGED))
        opacity = clear * (FAINT + (SHOWN - FAINT) * strength)
        self.stage.copy(self._body, rotation, shift, (*COLOURS[part], opacity))
        self.stage.copy(self._nose, rotation, shift, (*COLOURS[part], 2.0 * opacity))
        outline = _lifted(shapes.outline(pose), self._height)
        self.stage.line(outline, pale(COLOURS[part], 0.25 + 0.75 * strength), 0.9 * width)

    def _add_dot(self, place: Array, part: SceneElement, pixels: float) -> None:
        """Add a ball at a place (2,) in the plane of the sensors, its width in pixels of a picture 720 pixels high."""
        centre = np.array([*place, SENSOR_HEIGHT])
        radius = 0.5 * pixels * float(self.stage.metres_per_pixel(centre[None])[0]) * self.stage.unit
        self.stage.capsule(centre, centre + np.array([0.0, 0.0, 0.002]), radius, COLOURS[part])


def _lifted(places: Array, height: float) -> Array:
    """(n, 3) points of places (n, 2) at a height [m] above the floor."""
    return np.column_stack([places, np.full(len(places), height)])


# ---- the model


def _model(run: RangingRun, width: int, height: int, samples: int) -> Any:
    spec = build_spec(run.curve, run.mission.rays, run.drive, run.friction)
    spec.stat.extent, spec.stat.center = 1.0, [*extent(run.curve)[0], 0.0]
    set_size(spec, width, height, samples)
    spec.visual.headlight.active = 0
    for light in list(spec.worldbody.lights):
        spec.delete(light)
    ambient = 1.0 - DIFFUSE * LIGHT[2] / math.hypot(*LIGHT)  # what is level is as bright as it is painted
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[-part for part in LIGHT], diffuse=[DIFFUSE] * 3,
        ambient=[ambient] * 3, specular=[0.0, 0.0, 0.0],
    )  # fmt: skip
    for geom in spec.geoms:
        if geom.name.startswith("wall_"):
            geom.rgba = WALL
    _paint(spec, run)
    return spec.compile()


def _paint(spec: Any, run: RangingRun) -> None:
    """The floor, and beyond it what has the colour of its edge."""
    picture = floor_picture(run.curve)
    centre, half = extent(run.curve)
    texture = spec.texture("floor")
    texture.builtin, texture.mark = mujoco.mjtBuiltin.mjBUILTIN_NONE, mujoco.mjtMark.mjMARK_NONE
    texture.height, texture.width, texture.nchannel = picture.shape
    texture.data = np.ascontiguousarray(picture).tobytes()
    material = spec.material("floor")
    material.texrepeat, material.texuniform = [1.0, 1.0], False
    floor = spec.geom(FLOOR)
    floor.pos, floor.size = [*centre, 0.0], [*half, 1.0]
    beyond = [channel / 255.0 for channel in OUTSIDE]
    spec.add_texture(
        name="backdrop", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        rgb1=beyond, rgb2=beyond, width=64, height=64 * 6,
    )  # fmt: skip


def top_view(points: Array, aspect: float) -> View:
    """View from above in which points (n, 2) [m], of the wall and the beacons, fill the free part of a picture of that
    width over height.
    """
    reach = 2.0 * WALL_THICKNESS
    low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
    wide, tall = high - low
    tangent = math.tan(math.radians(OPTICS["top"].field_of_view) / 2.0)
    heights = [max(wide / ((right - left) * aspect), tall / (bottom - top)) for left, right, top, bottom in FREE]
    k = int(np.argmin(heights))
    left, right, top, bottom = FREE[k]
    seen = heights[k]  # [m] from the lower to the upper edge of the picture
    middle = 0.5 * (low + high) - seen * np.array([(0.5 * (left + right) - 0.5) * aspect, 0.5 - 0.5 * (top + bottom)])
    return View(np.array([*middle, WALL_HEIGHT]), 0.5 * seen / tangent, 90.0, -89.99)


def chase_view(run: RangingRun, t: float, turn: float) -> View:
    """Behind the robot, slower to turn than it is; ``turn`` is in degrees."""
    times = np.linspace(max(0.0, t - CHASE_MEMORY), min(run.duration, t + CHASE_MEMORY), 41)
    headings = np.array([run.pose[run.index(float(s)), 2] for s in times])
    azimuth = math.atan2(float(np.sin(headings).mean()), float(np.cos(headings).mean()))
    ahead = CHASE_AHEAD * np.array([math.cos(azimuth), math.sin(azimuth)])
    lookat = np.array([*(run.joints(t)[:2] + ahead), 0.1])
    return View(lookat, CHASE_DISTANCE, math.degrees(azimuth) + turn, CHASE_ELEVATION)
