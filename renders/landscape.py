"""Ground for pictures, in two worlds of one model, and airframes over it that are visible from afar.

One world is the true one, for cameras near a vehicle; in the other, for the overview and the top view, the heights
above the lowest ground are multiplied by ``relief.EXAGGERATION``. On a map of 82 km nothing could be seen at its
true size, so airframes are drawn at a size in shares of the picture.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

import mathnavi.models.aerial
from mathnavi.interfaces.reading.mechanisms import read_spec
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import RadarTrack
from mathnavi.renders.framing import Box, framing
from mathnavi.renders.palette import COLOURS, Colour, SceneElement
from mathnavi.renders.relief import EXAGGERATION, relief, resampled, roughened
from mathnavi.renders.stage import HORIZON, NADIR, Optics, Stage, View

GROUND_NODES, TEXTURE_PIXELS = 257, 1025  # along the longer side
DETAIL = 4  # texture pixels painted for each pixel of the relief, unless the picture is small
SMALL = 360  # [pixels] height of a small picture
# The extent is half the side of the map. The top view is taken from far away, so that it looks like a map.
OPTICS = {"overview": Optics(30.0, 0.05, 12.0), "top": Optics(8.0, 1.0, 30.0)}
TRUE_WORLD, TALL_WORLD, AIRFRAME = 0, 1, 2  # geom groups
WORLDS = ((TRUE_WORLD, "true", 1.0), (TALL_WORLD, "tall", EXAGGERATION))  # group, name, factor of heights
TRUE_SPAN = 12.0  # [m] of the airframe as drawn
BASE = 0.02  # share of the width: thickness of the slab under the lowest ground
FILL = {"overview": 0.97, "top": 0.95}  # share of the picture that the map takes
ELEVATION, SIDEWAYS = -36.0, 24.0  # [degrees] of the overview, and off north-up


@dataclass(frozen=True, eq=False)
class Landscape:
    """Places in the tall world, and the views that show all of the map."""

    terrain: HeightField

    @property
    def low(self) -> float:
        """[m] the height that is the same in both worlds."""
        return float(self.terrain.z.min())

    def tall(self, points: Array) -> Array:
        """(..., 3) map points [m] in the tall world."""
        heights = self.low + EXAGGERATION * (points[..., 2:] - self.low)
        return np.concatenate([points[..., :2], heights], axis=-1, dtype=np.float64)

    def view(self, camera: str, course: Array, turn: float, aspect: float) -> View:
        """The "overview" or the "top" view, whose picture of that width over height the map fills.

        The overview is turned a little from north-up, to the side from which a course (3,) crosses the picture, and
        by ``turn`` [degrees].
        """
        sight = (90.0, -89.9)
        if camera == "overview":
            sight = (90.0 + (SIDEWAYS if course[0] * course[1] >= 0.0 else -SIDEWAYS) + turn, ELEVATION)
        terrain = self.terrain
        heights = (self.low - BASE * terrain.width / EXAGGERATION, 0.6 * float(terrain.z.max()) + 0.4 * self.low)
        corners = np.array([[x, y, z] for x in (0.0, terrain.width) for y in (0.0, terrain.depth) for z in heights])
        edges = 0.5 - 0.5 * FILL[camera], 0.5 + 0.5 * FILL[camera]
        return framing(self.tall(corners), Box(*edges, *edges), OPTICS[camera], aspect, sight)


class Airframe:
    """An airframe of a model, in its place and size of a picture."""

    def __init__(self, model: Any, name: str) -> None:
        self._model = model
        body = model.body(name)
        self._mocap = int(body.mocapid[0])
        self._geoms = np.flatnonzero(model.geom_bodyid == body.id)
        self._size = model.geom_size[self._geoms].copy()
        self._pos = model.geom_pos[self._geoms].copy()
        self._alpha = model.geom_rgba[self._geoms, 3].copy()

    def place(self, stage: Stage, position: Array, quaternion: Array, span: float) -> None:
        """Place the airframe at a position (3,) of the world that is drawn, ``span`` [m] across."""
        self._put(stage, position, quaternion, span, self._alpha)

    def place_afar(self, stage: Stage, position: Array, quaternion: Array, span: float, eye: Array) -> None:
        """Place the airframe so that it can be seen from an eye (3,) far away."""
        # Drawn so large it would stick in the ground: it is seen at the tip of its path, but nearer to the camera.
        nearer = span / float(np.linalg.norm(eye - position))
        # The discs of the rotors, nearly clear beside the vehicle, are what can be seen from afar.
        self._put(stage, position + nearer * (eye - position), quaternion, (1.0 - nearer) * span, 1.0)

    def _put(self, stage: Stage, position: Array, quaternion: Array, span: float, alpha: Any) -> None:
        scale = span / TRUE_SPAN
        stage.data.mocap_pos[self._mocap], stage.data.mocap_quat[self._mocap] = position, quaternion
        self._model.geom_rgba[self._geoms, 3] = alpha
        self._model.geom_size[self._geoms] = scale * self._size
        self._model.geom_pos[self._geoms] = scale * self._pos


def landscape(terrain: HeightField, width: int, height: int, samples: int) -> Any:
    """An ``mjSpec`` of the ground in both worlds, for pictures of a size in pixels."""
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
    _add_ground(spec, terrain, detail=DETAIL if height > SMALL else 1)
    spec.add_material(name="airframe", emission=0.7, specular=0.3, shininess=0.5)
    return spec


def add_airframe(spec: Any, name: str, colour: Colour | None = None) -> None:
    """An airframe that is placed by ``Airframe``, in its own colours or all in one."""
    vehicle = read_spec(Path(mathnavi.models.aerial.__file__).parent / "airframe.xml", ValueError)
    body = spec.worldbody.add_body(name=name, mocap=True)
    for geom in vehicle.worldbody.geoms:
        rgba = geom.rgba if colour is None else [*colour, geom.rgba[3]]
        body.add_geom(
            type=geom.type, size=geom.size, pos=geom.pos, quat=geom.quat, fromto=geom.fromto, rgba=rgba,
            material="airframe", group=AIRFRAME, contype=0, conaffinity=0,
        )  # fmt: skip


def _add_ground(spec: Any, terrain: HeightField, detail: int) -> None:
    low, high = float(terrain.z.min()), float(terrain.z.max())
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
    for group, name, factor in WORLDS:
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


def add_domes(spec: Any, terrain: HeightField, radars: Sequence[RadarTrack]) -> None:
    """Add a dome for each radar in each world of an ``mjSpec``, still invisible."""
    if radars:
        spec.add_material(name="radar", emission=0.8, specular=0.0)
    land = Landscape(terrain)
    for k, track in enumerate(radars):
        radar = track.radar
        foot = np.array([radar.x, radar.y, float(terrain.height(radar.x, radar.y))])
        for group, name, factor in WORLDS:
            mesh = spec.add_mesh(name=f"radar {k} {name}", scale=[radar.radius, radar.radius, factor * radar.radius])
            mesh.make_sphere(subdivision=4)
            spec.worldbody.add_geom(
                name=f"radar {k} {name}", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name,
                pos=foot if factor == 1.0 else land.tall(foot), material="radar",
                rgba=[*COLOURS[SceneElement.RADAR], 0.0],
                group=group, contype=0, conaffinity=0,
            )  # fmt: skip


def place_domes(model: Any, terrain: HeightField, radars: Sequence[RadarTrack], t: float, opacity: float) -> None:
    """Place the domes of a model at the radars at ``t`` [s]; those of radars that are off are invisible."""
    land = Landscape(terrain)
    for k, track in enumerate(radars):
        radar = track.at(t, terrain)
        for _, name, factor in WORLDS:
            dome = model.geom(f"radar {k} {name}")
            dome.rgba[3] = 0.0 if radar is None else opacity
            if radar is not None:
                foot = np.array([radar.x, radar.y, float(terrain.height(radar.x, radar.y))])
                dome.pos = foot if factor == 1.0 else land.tall(foot)
