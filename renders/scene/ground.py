"""The ground of a scene under its relief, as a model of MuJoCo and as surfaces for the browser.

MuJoCo's model holds it once for each factor of heights by which a camera shows it, in separate geom groups: the
true one for cameras near a vehicle, and a taller one for those that show the whole map.

Import ``mathnavi.models.opengl`` and choose the backend before this module, which imports mujoco.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from PIL import Image

from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.palette import Colour
from mathnavi.renders.relief import EXAGGERATION, relief, resampled, roughened
from mathnavi.renders.scene.bodies import FLOOR_COLOUR, grid_faces, grid_sides
from mathnavi.renders.scene.elements import Surface
from mathnavi.renders.stage import add_sky, set_size

NODES, PIXELS = 257, 1025  # of the ground and of its picture, along the longer side
QUALITY = 82  # of that picture, a JPEG, in the browser
EARTH: Colour = (0.36, 0.32, 0.27)  # of the sides of the map
SHADOWED = 3.0  # extents around the middle in which shadows fall; at its edge the floor would shade itself
SUNLIGHT = np.array([-0.35, 0.45, -0.85])  # direction of the light; it comes from where it shines on the middle
BASE = 0.02  # share of the width: thickness of the slab under the lowest ground
DETAIL = 4  # texture pixels painted for each pixel of the relief, unless the picture is small
SMALL = 360  # [pixels] height of a small picture


def ground_surfaces(terrain: HeightField) -> list[Surface]:
    """The ground and the sides of the map."""
    z = resampled(terrain, min(max(terrain.z.shape), NODES), order=1)
    rows, columns = z.shape
    east, north = np.meshgrid(np.linspace(0.0, terrain.width, columns), np.linspace(0.0, terrain.depth, rows))
    vertices = np.column_stack([east.ravel(), north.ravel(), z.ravel()])
    picture = io.BytesIO()
    Image.fromarray(relief(terrain, PIXELS)).save(picture, "JPEG", quality=QUALITY)
    base = float(terrain.z.min()) - BASE * max(terrain.width, terrain.depth) / EXAGGERATION
    return [
        Surface(
            vertices, grid_faces(rows, columns), (0.6, 0.6, 0.58), glow=0.9, tall=True, picture=picture.getvalue(),
            picture_box=(0.0, 0.0, terrain.width, terrain.depth),
        ),
        Surface(*grid_sides(vertices, rows, columns, base), EARTH, smooth=False, tall=True),
    ]  # fmt: skip


def ground_model(
    terrain: HeightField,
    factors: Sequence[float],
    width: int,
    height: int,
    samples: int,
    nodes: int = NODES,
    detail: int = DETAIL,
) -> Any:
    """An ``mjSpec`` of the ground by factors of its heights, each a geom group, for pictures of a size in pixels.

    ``nodes`` are those along its longer side, ``detail`` the pixels that are painted for each one of its relief, unless
    the pictures are small.
    """
    spec = mujoco.MjSpec()
    side = max(terrain.width, terrain.depth)
    low, high = float(terrain.z.min()), float(terrain.z.max())
    spec.stat.extent = 0.5 * side
    spec.stat.center = [0.5 * terrain.width, 0.5 * terrain.depth, 0.5 * (low + high)]
    set_size(spec, width, height, samples)
    spec.visual.map.fogstart, spec.visual.map.fogend = 0.25, 2.6
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
    add_sky(spec)
    _add_ground(spec, terrain, factors, nodes, detail=detail if height > SMALL else 1)
    return spec


def floor_model(points: Array, floors: Sequence[Surface], width: int, height: int, samples: int) -> Any:
    """An ``mjSpec`` of level floors, under a light that shines on the middle of points (m, 3) [m] around what moves."""
    spec = mujoco.MjSpec()
    middle, extent = 0.5 * (points.min(axis=0) + points.max(axis=0)), max(float(np.ptp(points, axis=0).max()), 1e-3)
    spec.stat.extent, spec.stat.center = extent, middle
    set_size(spec, width, height, samples)
    spec.visual.quality.shadowsize, spec.visual.map.shadowclip = 4096, SHADOWED
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.25] * 3
    spec.visual.headlight.specular = [0.0] * 3
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=middle - 4.0 * extent * SUNLIGHT, dir=SUNLIGHT,
        diffuse=[0.6] * 3, specular=[0.15] * 3,
    )  # fmt: skip
    add_sky(spec)
    spec.add_texture(
        name="floor", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[1.0, 1.0, 1.0], rgb2=[0.90, 0.90, 0.90], width=256, height=256,
    )  # fmt: skip
    for k, floor in enumerate(floors):
        name, texture, repeat = f"floor {k}", "floor", [0.5 / floor.checker] * 2
        if floor.tiled:
            west, south, east, north = floor.picture_box
            texture, repeat = name, [1.0 / (east - west), 1.0 / (north - south)]
            picture = np.asarray(Image.open(io.BytesIO(floor.picture)).convert("RGB"))[::-1]  # row 0 in the south
            made = spec.add_texture(
                name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=picture.shape[1], height=picture.shape[0],
                nchannel=3,
            )  # fmt: skip
            made.data = picture.tobytes()
        material = spec.add_material(name=name, texuniform=True, texrepeat=repeat, specular=0.0)
        if not floor.tiled and floor.colour != FLOOR_COLOUR:
            material.rgba = [*floor.colour, 1.0]
        material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = texture
        corner, east, _, north = floor.vertices
        sides = np.array([east - corner, north - corner])
        size = np.linalg.norm(sides, axis=1)
        x, y = sides / size[:, None]
        quat = np.empty(4)
        mujoco.mju_mat2Quat(quat, np.column_stack([x, y, np.cross(x, y)]).ravel())
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_PLANE, pos=floor.vertices.mean(axis=0), quat=quat, size=[*(0.5 * size), 1.0],
            material=name, contype=0, conaffinity=0,
        )  # fmt: skip
    return spec


def _add_ground(spec: Any, terrain: HeightField, factors: Sequence[float], size: int, detail: int) -> None:
    low, high = float(terrain.z.min()), float(terrain.z.max())
    nodes = resampled(terrain, size, order=1)
    picture = roughened(relief(terrain, PIXELS), detail, contrast=0.05)
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
    for group, factor in enumerate(factors):
        spec.add_hfield(
            name=f"ground {group}",
            nrow=nodes.shape[0],
            ncol=nodes.shape[1],
            size=[0.5 * terrain.width, 0.5 * terrain.depth, factor * max(high - low, 1.0), BASE * terrain.width],
            userdata=((nodes - low) / max(high - low, 1.0)).ravel(),
        )
        spec.worldbody.add_geom(
            name=f"ground {group}",
            type=mujoco.mjtGeom.mjGEOM_HFIELD,
            hfieldname=f"ground {group}",
            pos=[0.5 * terrain.width, 0.5 * terrain.depth, low],
            material="ground",
            group=group,
            contype=0,
            conaffinity=0,
        )
