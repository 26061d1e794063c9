"""A missile's run drawn by MuJoCo: the missile with its plumes, the path flown, the plan ahead, the target.

The model is the one that was flown, with a sky, a light and a ground to look at. From the side the whole path is in the
picture, and the missile, the target and the force are drawn larger than they are.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.entity import build_spec
from mathnavi.renders.framing import Box, framing
from mathnavi.renders.missile.drawing import TO_SCALE
from mathnavi.renders.missile.ground import PIXELS, TILE, ground_picture
from mathnavi.renders.missile.run_data import MissileRun
from mathnavi.renders.overlay import Label
from mathnavi.renders.palette import COLOURS, Picture, SceneElement
from mathnavi.renders.stage import Optics, Stage, Staged, View, add_sky, set_size

GROUND, DRAWN = 1, 2  # geom groups
EXTENT = 500.0  # [m]
SPAN = 3.81  # [m] of the missile
SIDE_SPAN = 0.11  # of the picture's height: the missile as it is drawn from the side
SIDE_RINGS = 1.6  # how much larger than it is the target is drawn there
TARGET_RINGS = 0.4  # likewise beside the target from afar, of how much larger the missile is
TARGET_RADIUS = 6.0  # [m]
ARROW = {"chase": 4.2, "side": 9.0, "target": 6.0}  # [m] where the missile is to scale: the largest force
PLUME = 0.8  # [m] at a thrust of m g; it grows with the square root
LONGEST_PLUME = 3.2  # [m]
NOSE, TAIL = 1.1, -1.85  # [m] along X_b: where plumes leave
PLAN_POINTS = 90
NEAR = 60  # samples back up to which the path flown is drawn through each
MINUTE = {"chase": 3.0, "side": 3.2, "target": 3.4}  # [pixels] width of lines at a picture 720 pixels high
RULER = 50.0  # [m] of height between the lines in the side view
FLAME, CORE = (1.0, 0.42, 0.05), (1.0, 0.88, 0.55)
OPTICS = {"chase": Optics(40.0, 1e-3, 40.0), "side": Optics(22.0, 0.05, 60.0), "target": Optics(48.0, 1e-3, 40.0)}
SIDE_BOX = Box(0.07, 0.93, 0.13, 0.60)  # what the path takes of the picture; a low one lies on its lower edge
SIDE_ELEVATION = -5.0  # [degrees]
CHASE_DISTANCE = 11.5  # [m]
TARGET_AZIMUTH, TARGET_ELEVATION = 54.0, -9.0  # [degrees]
TARGET_DISTANCE = 24.0  # [m] at least
TARGET_SHARE = 0.62  # of the picture's height: what lies between the target and the missile


class MissileScene(Staged):
    """Scene as a context manager, see ``Staged``."""

    def __init__(self, run: MissileRun, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        self.run = run
        self.model = _model(run, width, height, samples)
        self.stage = Stage(self.model, width, height, glow=0.2)
        self._side = side_view(run, width / height)
        drawn = [g for g in range(self.model.ngeom) if self.model.geom(g).name.startswith("missile/")]
        rings = [g for g in range(self.model.ngeom) if self.model.geom(g).name.startswith("ring_")]
        self._scaled = [_Scaled(self.model, np.array(geoms)) for geoms in (drawn, rings)]
        force = np.linalg.norm(run.coordinates.input_in_space(run.u)[:, :3], axis=1)
        self._largest_force = max(float(force.max()), run.weight)

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]; ``turn`` [degrees] turns the chase camera."""
        run, stage = self.run, self.stage
        view = self._side
        if camera != "side":
            view = chase_view(run, t, turn) if camera == "chase" else target_view(run, t)
        stage.look(view, OPTICS[camera], (GROUND, DRAWN))
        missile, rings = self._scaled
        scale = self._scale(camera, t)
        missile.to(scale)
        rings.to(SIDE_RINGS if camera == "side" else max(1.0, TARGET_RINGS * scale))
        half = len(run.coordinates.joints)
        stage.data.qpos[:] = run.joints(t)[:half]
        stage.data.mocap_pos[0] = run.target_at(t)
        stage.begin(fog=True, shadows=camera != "side")
        if camera == "side":
            self._add_ruler()
        self._add_lines(t, camera, scale)
        self._add_target(t, camera)
        if camera != "side":
            self._add_plumes(t)
        self._add_force(t, camera, scale)
        return stage.end(sky=True)

    def labels(self, t: float, camera: str) -> list[Label]:
        """Return the names of the elements in view of the picture drawn last."""
        run, unit = self.run, self.stage.unit
        target, here = run.target_at(t), run.place(t)
        named: list[tuple[str, Array, bool]] = []  # text, place, whether it is small
        if camera == "side":
            apex, (left, right) = float(run.path[:, 2].max()), self._ruler_ends()
            heights = np.arange(RULER, apex + 0.6 * RULER, RULER)
            named += [(f"{height:.0f} m", np.array([left, 0.0, height]), True) for height in heights]
            far = float(max(run.path[:, 0].max(), run.target_at(run.duration)[0]))
            steps = np.arange(100.0 * math.ceil(run.path[0, 0] / 100.0), far + 50.0, 100.0)
            named += [(f"{x:.0f} m", np.array([x, 0.0, 0.0]), True) for x in steps if len(steps) < 16]
            named.append((SceneElement.TARGET.value, target + np.array([SIDE_RINGS * TARGET_RADIUS, 0.0, 0.0]), False))
            clear = here[0] - left > 0.1 * (right - left)  # of the numbers at the left ends of the lines
            if clear and run.distance(t) > 0.5 * RULER:
                named.append((f"{here[2]:.0f} m", here + _up(0.5 * self._scale(camera, t) * SPAN), False))
        if camera == "chase":
            lift = 26.0 * unit * float(self.stage.metres_per_pixel(target[None])[0])
            named.append((SceneElement.TARGET.value, target + _up(lift), False))
        found = [self.stage.inside(place[None]) for _, place, _ in named]
        return [
            Label(
                text, float(at[0, 0]), float(at[0, 1]) + 12.0 * unit * (small and place[2] == 0.0), small,
                beside=camera == "side" and text == SceneElement.TARGET.value,
            )
            for (text, place, small), at in zip(named, found, strict=True)
            if len(at)
        ]  # fmt: skip

    def _scale(self, camera: str, t: float) -> float:
        """Factor by which the missile is drawn larger than it is."""
        if camera == "side":
            return SIDE_SPAN * 2.0 * self._side.distance * self.stage.tangent() / SPAN
        return 1.0 if camera == "chase" else max(1.0, self.run.distance(t) / TO_SCALE)

    # ---- what is added

    def _add_lines(self, t: float, camera: str, scale: float) -> None:
        run, width = self.run, MINUTE[camera]
        here = self.run.place(t)
        now = run.index(t)
        if now > 0:
            near = max(now - NEAR, 0)
            flown = run.path[np.unique(np.r_[np.linspace(0, near, 160).astype(int), near : now + 1])]
            clear = np.linalg.norm(flown - here, axis=1) > 2.2 * scale  # a line must not run through the missile
            flown = np.vstack([flown, here]) if camera == "side" else flown[clear]
            self.stage.line(flown, COLOURS[SceneElement.FLOWN], width)
        ahead = run.plan_ahead(t, PLAN_POINTS)
        if len(ahead) > 1:
            if camera != "side":
                ahead = ahead[np.linalg.norm(ahead - here, axis=1) > 2.4 * scale]
            self.stage.line(ahead, COLOURS[SceneElement.PLAN], width)
        if camera == "side":  # a plumb line shows how high it is
            self.stage.line(np.array([here * (1.0, 1.0, 0.0), here]), COLOURS[SceneElement.FLOWN], 1.2)

    def _add_target(self, t: float, camera: str) -> None:
        """Add the path and the velocity of the target."""
        run, target, velocity = self.run, self.run.target_at(t), self.run.target_velocity(t)
        lift = _up(0.3)
        moved = [run.target_at(s) for s in np.linspace(0.0, t, 30)]
        if float(np.linalg.norm(moved[-1] - moved[0])) > 1.0:
            self.stage.line(np.array(moved) + lift, COLOURS[SceneElement.TARGET_PATH], 2.0)
        if float(np.linalg.norm(velocity)) > 0.1:
            seconds, thick = (2.5, 0.0022 * self._side.distance) if camera == "side" else (0.4, 0.35)
            start = target + _up(1.5 * thick)
            self.stage.arrow(start, start + seconds * velocity, thick, COLOURS[SceneElement.VELOCITY])

    def _input(self, t: float) -> Array:
        """(5,) F_x, F_y, F_z [N], M, N [N m] of the thrusters."""
        return self.run.coordinates.input_in_space(self.run.u[min(self.run.index(t), len(self.run.u) - 2)])

    def _add_force(self, t: float, camera: str, scale: float) -> None:
        force = self.run.axes(t) @ self._input(t)[:3]
        if float(np.linalg.norm(force)) < 0.01 * self._largest_force or t >= self.run.approach.t:
            return
        long = ARROW[camera] * scale * force / self._largest_force
        here = self.run.place(t)
        start = here + 0.35 * scale * force / float(np.linalg.norm(force))
        self.stage.arrow(
            start, start + long, 0.07 * scale * (1.6 if camera == "side" else 1.0), COLOURS[SceneElement.FORCE]
        )

    def _add_plumes(self, t: float) -> None:
        """Gas leaves on the side from which the thrusters push."""
        axes, here = self.run.axes(t), self.run.place(t)
        ahead, right, down = axes.T
        F_x, F_y, F_z, M, N = self._input(t) / self.run.weight
        arm = 1.5  # [m] of the thrusters that turn
        pushes = [(TAIL if F_x > 0.0 else NOSE, ahead, F_x), (0.0, right, F_y), (0.0, down, F_z)]
        # A moment nose-up pushes the nose up, against Z_b, and the tail down; one to the right likewise along Y_b.
        for at, sign in ((NOSE, 1.0), (0.9 * TAIL, -1.0)):
            pushes += [(at, down, -sign * 0.5 * M / arm), (at, right, sign * 0.5 * N / arm)]
        for at, axis, push in pushes:
            length = min(PLUME * math.sqrt(abs(push)), LONGEST_PLUME)
            if length < 0.12:
                continue
            out = -math.copysign(1.0, push) * axis
            start = here + at * ahead + (0.0 if axis is ahead else 0.10) * out
            wide = 0.055 + 0.035 * length
            self.stage.ellipsoid(start + 0.5 * length * out, out, (wide, 0.55 * length), (*FLAME, 0.40))
            self.stage.ellipsoid(start + 0.3 * length * out, out, (0.5 * wide, 0.33 * length), (*CORE, 0.75))

    def _ruler_ends(self) -> tuple[float, float]:
        """[m] x of the left and the right end of the lines of equal height."""
        low, high = self.run.path[:, 0].min(), max(self.run.path[:, 0].max(), self.run.target_at(0.0)[0])
        wide = float(high - low)
        return float(low) - 0.03 * wide, float(high) + 0.03 * wide

    def _add_ruler(self) -> None:
        left, right = self._ruler_ends()
        apex = float(self.run.path[:, 2].max())
        for height in np.arange(RULER, apex + 0.6 * RULER, RULER):
            ends = np.array([[left, 30.0, height], [right, 30.0, height]])
            self.stage.line(ends, (1.0, 1.0, 1.0), 1.4)


def _up(height: float) -> Array:
    return np.array([0.0, 0.0, height])


class _Scaled:
    """Geoms that are drawn larger than they are."""

    def __init__(self, model: Any, geoms: Array) -> None:
        self._model, self._geoms = model, geoms
        self._size, self._pos = model.geom_size[geoms].copy(), model.geom_pos[geoms].copy()

    def to(self, scale: float) -> None:
        self._model.geom_size[self._geoms] = scale * self._size
        self._model.geom_pos[self._geoms] = scale * self._pos


# ---- the model


def _model(run: MissileRun, width: int, height: int, samples: int) -> Any:
    spec = build_spec(run.coordinates, run.input_max.tolist())
    spec.stat.extent = EXTENT
    spec.stat.center = [0.5 * float(run.path[:, 0].max()), 0.0, 50.0]
    set_size(spec, width, height, samples)
    spec.visual.map.fogstart, spec.visual.map.fogend = 1.5, 9.0
    spec.visual.quality.shadowsize = 4096
    spec.visual.map.shadowclip = 0.06
    spec.visual.headlight.active = 0
    for light in list(spec.worldbody.lights):
        spec.delete(light)
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[0.45, 0.55, -0.9], diffuse=[0.62, 0.60, 0.56],
        ambient=[0.42, 0.43, 0.46], specular=[0.25, 0.25, 0.25],
    )  # fmt: skip
    add_sky(spec)
    texture = spec.texture("ground")
    texture.builtin = mujoco.mjtBuiltin.mjBUILTIN_NONE
    texture.mark = mujoco.mjtMark.mjMARK_NONE
    texture.width = texture.height = PIXELS
    texture.nchannel = 3
    texture.data = ground_picture().tobytes()
    material = spec.material("ground")
    material.texrepeat, material.texuniform = [1.0 / TILE, 1.0 / TILE], True
    return spec.compile()


def chase_view(run: MissileRun, t: float, turn: float) -> View:
    """Return the view behind and next to the missile; the steeper it flies, the more from above. ``turn`` is in
    degrees.
    """
    window = np.linspace(max(0.0, t - 0.5), min(run.duration, t + 0.5), 11)
    pitch = float(np.mean([run.joints(s)[run.coordinates.joints.index("theta")] for s in window]))
    down = max(0.0, -pitch) / (0.5 * math.pi)
    lookat = run.place(t) + np.array([0.9, 0.0, -0.2 * down])
    return View(lookat, CHASE_DISTANCE, 58.0 + turn, -8.0 - 54.0 * down)


def target_view(run: MissileRun, t: float) -> View:
    """Return the view next to the target, with it and the missile in the picture: the camera comes nearer as the
    missile does.
    """
    tall = 2.0 * math.tan(math.radians(OPTICS["target"].field_of_view) / 2.0) * TARGET_SHARE
    distance = max(run.distance(t) / tall, TARGET_DISTANCE)
    lookat = 0.5 * (run.target_at(t) + run.place(t)) + np.array([0.0, 0.0, 2.0])
    return View(lookat, distance, TARGET_AZIMUTH, TARGET_ELEVATION)


def side_view(run: MissileRun, aspect: float) -> View:
    """View from the side, so that path and target fill the free part of a picture of that width over height."""
    ends = np.array([run.target_at(t) for t in (0.0, run.duration)])
    points = np.vstack([run.path, ends, *(run.plan_ahead(plan.t_start, 40) for plan in run.log.plans[:1])])
    low, high = points.min(axis=0), points.max(axis=0)
    box = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0.0, high[2])])
    return framing(box, SIDE_BOX, OPTICS["side"].field_of_view, aspect, (90.0, SIDE_ELEVATION), low=True)
