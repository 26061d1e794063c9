"""A recorded scene drawn by MuJoCo: its shapes where they were, the paths, the plans ahead, ghosts of the estimates.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.framing import Box, framing
from mathnavi.renders.generic.drawing import camera_name
from mathnavi.renders.generic.run_data import GenericRun, index
from mathnavi.renders.generic.scene_data import PATH_POINTS, reach, swept
from mathnavi.renders.overlay import Label
from mathnavi.renders.palette import COLOURS, Picture, SceneElement, vehicle_colour
from mathnavi.renders.stage import Optics, Stage, Staged, View, add_sky, set_size
from mathnavi.sim.engine.scene_record import FIELD, MESH

FIELD_OF_VIEW = 36.0  # [degrees]
FREE = Box(0.25, 0.90, 0.16, 0.84)  # of a picture, in which all that moves is
SIGHTS = {"fixed": (50.0, -24.0), "top": (90.0, -89.0)}  # azimuth and elevation [degrees] of the cameras
TRACK_ELEVATION, TRACK_AZIMUTH = -20.0, 40.0
TRACK_DISTANCE = 7.0  # of the tracking camera, in sizes of the vehicle
PATH_WIDTH, PLAN_WIDTH = 3.2, 2.6  # [pixels] at a picture 720 pixels high
CLEAR = 0.42  # opacity of a ghost that is apart
SEPARATE = 0.25  # sizes of the vehicle by which it is then apart
LEAST_SHOWN = 0.1  # of that: a ghost that is nearer would only spot the vehicle
GHOST_SIZE = 1.04
SMALLEST = 0.05  # of the way's extent: a vehicle that is smaller is seen from as far as if it were so large
GROUND_SIZE = 0.5  # of a plane that is endless: half its side, in extents
SHADOWED = 3.0  # extents around the middle in which shadows fall; at its edge the ground would shade itself
SUNLIGHT = np.array([-0.35, 0.45, -0.85])  # direction of the light; it comes from where it shines on the middle
_KINDS = {int(kind): kind for kind in mujoco.mjtGeom.__members__.values()}
_GROUP = 1


class GenericScene(Staged):
    """Scene as a context manager, see ``Staged``."""

    def __init__(self, run: GenericRun, width: int = 1280, height: int = 720, samples: int = 0) -> None:
        assert run.scene is not None
        self.run, self._scene = run, run.scene
        a = self._scene.arrays
        self._reach = reach(self._scene)
        self._points = swept(self._scene)
        self._extent = self._scene.extent
        self.model = self._model(width, height, samples)
        self.stage = Stage(self.model, width, height, glow=0.25)
        self._optics = Optics(FIELD_OF_VIEW, 0.002, 60.0)
        self._views = {
            name: framing(self._points, FREE, self._optics, width / height, sight) for name, sight in SIGHTS.items()
        }
        self._moved = np.flatnonzero(self._scene.moving)
        self._bodies = {
            int(b): frozenset(np.flatnonzero(self._geom_body == b).tolist())
            for b in self._moved
            if (self._geom_body == b).any()
        }
        self._own: dict[str, int] = {}
        for k, name in enumerate(a["camera.names"].tolist()):
            self._own.setdefault(camera_name(name), k)

    def draw(self, t: float, camera: str, turn: float = 0.0) -> Picture:
        """Draw the picture at time ``t`` [s]; ``turn`` [degrees] turns the tracking camera."""
        stage, k = self.stage, index(self._scene.t, t)
        pos, quat = self._pose("", k)
        stage.data.mocap_pos[:], stage.data.mocap_quat[:] = pos[1:], quat[1:]
        if camera in self._views:
            stage.look(self._views[camera], self._optics, (_GROUP,))
        elif camera == "track":
            stage.look(self._tracking(k, turn), self._optics, (_GROUP,))
        else:
            stage.look_through(self._own[camera], self._optics, (_GROUP,))
        stage.begin(fog=False, shadows=True)
        self._add_paths(k)
        self._add_plans(t)
        self._add_ghosts(k)
        return stage.end(sky=False)

    def labels(self, t: float, camera: str) -> list[Label]:
        """Names of the vehicles, where there are several."""
        vehicles = self._scene.vehicles
        if len(vehicles) < 2:
            return []
        pos, _ = self._pose("", index(self._scene.t, t))
        found = ((name, self.stage.inside(pos[body][None])) for name, body in vehicles.items())
        return [Label(name, float(at[0, 0]), float(at[0, 1]), small=True) for name, at in found if len(at)]

    # ---- what is added

    def _add_paths(self, k: int) -> None:
        several = len(self._scene.vehicles) > 1
        rows = np.unique(np.linspace(0, k, min(PATH_POINTS, k + 1)).astype(np.int64))
        for number, body in enumerate(self._scene.vehicles.values()):
            path = self._scene.arrays["pos"][rows, body].astype(float)
            if len(path) > 1 and float(np.ptp(path, axis=0).max()) > 1e-3 * self._extent:
                colour = vehicle_colour(number) if several else COLOURS[SceneElement.FLOWN]
                self.stage.line(path, colour, PATH_WIDTH)

    def _add_plans(self, t: float) -> None:
        for plan in self._scene.plans.values():
            ahead = plan.ahead(t)
            if ahead is not None and float(np.ptp(ahead, axis=0).max()) > 1e-3 * self._extent:
                self.stage.line(ahead.astype(float), COLOURS[SceneElement.PLAN], PLAN_WIDTH)

    def _add_ghosts(self, k: int) -> None:
        """Add copies of what moves where the estimate has it; they grow clearer the farther it is off."""
        if not self._scene.has_ghost():
            return
        pos, quat = self._pose("estimate.", k)
        for b, geoms in self._bodies.items():
            if not (np.isfinite(pos[b]).all() and np.isfinite(quat[b]).all()):
                continue
            true = self.stage.data.xmat[b].reshape(3, 3)
            ghost = np.empty(9)
            mujoco.mju_quat2Mat(ghost, quat[b])
            rotation = ghost.reshape(3, 3) @ true.T
            shift = pos[b] - rotation @ self.stage.data.xpos[b]
            apart = float(np.linalg.norm(pos[b] - self.stage.data.xpos[b]))
            turned = math.acos(np.clip(0.5 * (np.trace(rotation) - 1.0), -1.0, 1.0))
            share = min((apart / max(float(self._reach[b]), 1e-9) + turned) / SEPARATE, 1.0)
            colour = (*COLOURS[SceneElement.ESTIMATE], CLEAR * share)
            if share > LEAST_SHOWN:
                self.stage.copy(geoms, rotation, shift, colour, GHOST_SIZE)

    # ---- where things are

    def _pose(self, prefix: str, k: int) -> tuple[Array, Array]:
        a = self._scene.arrays
        return a[f"{prefix}pos"][k].astype(float), a[f"{prefix}quat"][k].astype(float)

    def _tracking(self, k: int, turn: float) -> View:
        """View of the vehicle, or of the middle of all of them."""
        bodies = list(self._scene.vehicles.values())
        window = slice(max(0, k - 15), k + 16)
        pos = self._scene.arrays["pos"][window][:, bodies].astype(float).mean(axis=0)
        apart = float(np.ptp(pos, axis=0).max())
        size = max(max(self._reach[body] for body in bodies), SMALLEST * self._extent, 0.5 * apart)
        return View(pos.mean(axis=0), TRACK_DISTANCE * size, TRACK_AZIMUTH + turn, TRACK_ELEVATION)

    # ---- the model

    def _model(self, width: int, height: int, samples: int) -> Any:
        spec, a = mujoco.MjSpec(), self._scene.arrays
        middle = 0.5 * (self._points.min(axis=0) + self._points.max(axis=0))
        spec.stat.extent, spec.stat.center = self._extent, middle
        set_size(spec, width, height, samples)
        spec.visual.quality.shadowsize = 4096
        spec.visual.map.shadowclip = SHADOWED
        spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.25] * 3
        spec.visual.headlight.specular = [0.0] * 3
        spec.worldbody.add_light(
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=middle - 4.0 * self._extent * SUNLIGHT,
            dir=SUNLIGHT, diffuse=[0.6] * 3, specular=[0.15] * 3,
        )  # fmt: skip
        add_sky(spec)
        _ground_material(spec, self._extent)
        used = {(kind, data) for kind, data in zip(a["geom.type"].tolist(), a["geom.data"].tolist(), strict=True)}
        for kind, data in sorted(used):
            if kind == MESH:
                _add_mesh(spec, f"mesh {data}", a[f"mesh.{data}.vertices"], a[f"mesh.{data}.faces"])
            elif kind == FIELD:
                _add_field(spec, f"field {data}", a[f"field.{data}.heights"], a[f"field.{data}.size"])
        bodies = [spec.worldbody, *(spec.worldbody.add_body(mocap=True) for _ in range(len(a["bodies"]) - 1))]
        self._geom_body = self._add_geoms(bodies)
        cameras = (a[f"camera.{part}"] for part in ("body", "pos", "quat", "field_of_view"))
        for body, pos, quat, degrees in zip(*cameras, strict=True):
            bodies[int(body)].add_camera(pos=pos, quat=quat, fovy=float(np.clip(degrees, 1.0, 170.0)))
        return spec.compile()

    def _add_geoms(self, bodies: list[Any]) -> Array:
        """Add the shapes; returns the body (ng,) of each geom in the order of the compiled model."""
        a, order = self._scene.arrays, np.argsort(self._scene.arrays["geom.body"], kind="stable")
        for k in order.tolist():
            kind, data, size = int(a["geom.type"][k]), int(a["geom.data"][k]), a["geom.size"][k].astype(float)
            geom = bodies[int(a["geom.body"][k])].add_geom(
                type=_KINDS[kind], pos=a["geom.pos"][k], quat=a["geom.quat"][k], contype=0, conaffinity=0, group=_GROUP
            )
            if kind == MESH:
                geom.meshname = f"mesh {data}"
            elif kind == FIELD:
                geom.hfieldname = f"field {data}"
            elif kind == int(mujoco.mjtGeom.mjGEOM_PLANE):
                endless = size[:2] <= 0.0
                geom.size = [*np.where(endless, 40.0 * self._extent, size[:2]), max(size[2], 1e-3)]
                geom.material = "ground"
            else:
                geom.size = np.maximum(size, 1e-9)
            geom.rgba = np.clip(a["geom.rgba"][k], 0.0, 1.0)
        return a["geom.body"][order]


def _ground_material(spec: Any, extent: float) -> None:
    """A checkerboard whose squares are a round number of metres, a tenth of the extent or so."""
    spec.add_texture(
        name="ground", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[1.0, 1.0, 1.0], rgb2=[0.90, 0.90, 0.90], width=256, height=256,
    )  # fmt: skip
    square = 10.0 ** math.floor(math.log10(0.2 * extent))
    material = spec.add_material(name="ground", texuniform=True, texrepeat=[0.5 / square] * 2, specular=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "ground"


def _add_mesh(spec: Any, name: str, vertices: Array, faces: Array) -> None:
    mesh = spec.add_mesh(name=name)
    mesh.uservert, mesh.userface = vertices.astype(float).ravel(), faces.astype(np.int32).ravel()
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL


def _add_field(spec: Any, name: str, heights: Array, size: Array) -> None:
    field = spec.add_hfield(name=name, size=size.astype(float))
    field.nrow, field.ncol = heights.shape
    field.userdata = heights.astype(np.float32).ravel()
