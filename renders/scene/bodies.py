"""Surfaces and motions of MuJoCo's bodies: of a recorded scene, or of a model and joint positions."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Collection, Mapping
from itertools import product
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from mathnavi.interfaces.signals import Array
from mathnavi.interfaces.stretches import stretches
from mathnavi.renders.palette import COLOURS, Colour, SceneElement
from mathnavi.renders.scene.elements import Layer, Motion, Surface
from mathnavi.sim.engine.scene_record import FIELD, MESH, PLANE, shapes

GHOST_OPACITY = 0.42
GHOST_SIZE = 0.95
FLOOR_COLOUR: Colour = (0.86, 0.88, 0.90)
UNPAINTED = (0.5, 0.5, 0.5, 1.0)  # colour of shapes whose file states none
MOST_SWEPT = 40  # poses of a motion
MOST_NODES = 257  # along the longer side of a field
AROUND, LEVELS = 24, 12  # of a round shape
Triangles = tuple[Array, NDArray[np.int64], bool]  # (m, 3) vertices [m], (f, 3) faces, whether it is smooth


def rotated(quat: Array, points: Array) -> Array:
    """Points (..., 3) turned by quaternions (..., 4)."""
    w, v = quat[..., :1], quat[..., 1:]
    twice = 2.0 * np.cross(v, points)
    turned: Array = points + w * twice + np.cross(v, twice)
    return turned


def multiplied(p: Array, q: Array) -> Array:
    """Products (..., 4) of quaternions p, q (..., 4)."""
    w = p[..., :1] * q[..., :1] - np.sum(p[..., 1:] * q[..., 1:], axis=-1, keepdims=True)
    return np.concatenate([w, p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])], -1)


def model_shapes(model: Any, groups: Collection[int]) -> dict[str, Array]:
    """The shapes of a model (``mathnavi.sim.engine.scene_record``) in some groups of geoms."""
    return shapes(model, tuple(groups))


def body_surfaces(
    a: Mapping[str, Array],
    motions: Mapping[int, str],
    still: tuple[Array, Array],
    *,
    endless: float,
    layer: Layer | None = None,
    glow: float = 0.0,
    colour: Colour | None = None,
    span: float = 0.0,
    floor: tuple[Colour, float] | None = None,
) -> list[Surface]:
    """Surfaces of the shapes ``a``; bodies without a motion stand where ``still`` has them, (nb, 3) and (nb, 4).

    Shapes of one motion, colour and kind are one surface. ``colour`` replaces that of the shapes; ``endless`` [m] is
    half the side of planes without a size; ``floor`` colour and side [m] of the squares of planes. Without it planes
    have their own picture or colour, and squares over a colour.
    """
    textures = a.get("geom.texture", np.full(len(a["geom.body"]), -1))
    ground, square = floor or (FLOOR_COLOUR, 10.0 ** np.floor(np.log10(max(0.005 * endless, 1e-6))))
    found: dict[tuple[Any, ...], list[tuple[Array, NDArray[np.int64]]]] = {}
    for k, (body, kind, data) in enumerate(zip(a["geom.body"], a["geom.type"], a["geom.data"], strict=True)):
        own = triangles(int(kind), a["geom.size"][k].astype(float), endless)
        vertices, faces, smooth = own if own is not None else _recorded(a, int(kind), int(data))
        vertices = rotated(a["geom.quat"][k].astype(float), vertices) + a["geom.pos"][k]
        motion = motions.get(int(body))
        if motion is None:
            pos, quat = still
            vertices = rotated(quat[int(body)].astype(float), vertices) + pos[int(body)]
        rgba = tuple(np.round(np.clip(a["geom.rgba"][k].astype(float), 0.0, 1.0), 3).tolist())
        if rgba[3] == 0.0:
            continue
        tile = None if floor is not None or textures[k] < 0 else (int(textures[k]), *a["geom.repeat"][k].tolist())
        found.setdefault((motion, rgba, smooth, int(kind) == PLANE, tile), []).append((vertices, faces))
    surfaces = []
    for (motion, rgba, smooth, is_floor, tile), parts in found.items():
        plain = ground if floor is not None or rgba == UNPAINTED else rgba[:3]
        counts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
        surfaces.append(
            Surface(
                np.vstack([vertices for vertices, _ in parts]),
                np.vstack([faces + first for (_, faces), first in zip(parts, counts, strict=False)]),
                plain if is_floor else (colour or rgba[:3]), rgba[3], motion, layer, smooth, glow, span,
                checker=float(square) if is_floor else 0.0,
                shadow=motion is not None and rgba[3] == 1.0,
                **({} if tile is None else _tiled(a[f"texture.{tile[0]}"], tile[1:], rgba[:3])),
            )
        )  # fmt: skip
    return surfaces


def _tiled(picture: Array, repeat: tuple[float, float], tint: Colour) -> dict[str, Any]:
    """Fields of a surface with a picture in a colour that repeats so often [1/m]."""
    file = io.BytesIO()
    Image.fromarray((picture[::-1] * np.asarray(tint)).round().astype(np.uint8)).save(file, "PNG")
    return {"picture": file.getvalue(), "picture_box": (0.0, 0.0, 1.0 / repeat[0], 1.0 / repeat[1]), "tiled": True}


def ghosts(
    surfaces: Collection[Surface], motions: Mapping[str, str], part: SceneElement, layer: Layer
) -> list[Surface]:
    """Copies of the surfaces that move, on other motions, in the colour of a part and see-through.

    They are a little smaller, so that one which is where the vehicle is lies hidden within.
    """
    return [
        Surface(
            _shrunk(each.vertices), each.faces, COLOURS[part], GHOST_OPACITY, motions[each.motion], layer, each.smooth,
            each.glow, each.span,
        )
        for each in surfaces
        if each.motion is not None and each.motion in motions
    ]  # fmt: skip


def _shrunk(vertices: Array) -> Array:
    """Corners (n, 3) [m] drawn together towards the middle of the box around them."""
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    drawn: Array = middle + GHOST_SIZE * (vertices - middle)
    return drawn


def motions_of(t: Array, pos: Array, quat: Array, bodies: Collection[int], prefix: str) -> dict[str, Motion]:
    """Motions of bodies from poses (n, nb, 3) and (n, nb, 4); where a pose is not finite it is not shown."""
    found = {}
    for body in bodies:
        known = np.isfinite(pos[:, body]).all(axis=1) & np.isfinite(quat[:, body]).all(axis=1)
        if not known.any():
            continue
        shown = [(float(t[first]), float(t[last])) for first, last in _runs(known)]
        whole = known.all()
        found[f"{prefix}{body}"] = Motion(
            t[known], pos[known, body].astype(float), quat[known, body].astype(float),
            ((-np.inf, np.inf),) if whole else shown,
        ).thinned()  # fmt: skip
    return found


def swept(surfaces: Collection[Surface], motions: Mapping[str, Motion]) -> Array:
    """(m, 3) [m] the corners of the boxes around surfaces that move, on their ways."""
    found = []
    for each in surfaces:
        if each.motion is None:
            continue
        motion = motions[each.motion]
        low, high = each.vertices.min(axis=0), each.vertices.max(axis=0)
        corners = np.array(list(product(*zip(low, high, strict=True))))
        for k in np.unique(np.linspace(0, len(motion.t) - 1, MOST_SWEPT).round().astype(np.int64)):
            quat = np.array([1.0, 0.0, 0.0, 0.0]) if motion.quat is None else motion.quat[k]
            found.append(rotated(np.broadcast_to(quat, (len(corners), 4)), corners) + motion.pos[k])
    return np.vstack(found)


def poses(model: Any, positions: Array) -> tuple[Array, Array]:
    """(n, nb, 3) [m] and (n, nb, 4) of all bodies at joint positions (n, nq); NaN where those are not finite."""
    data = mujoco.MjData(model)
    pos, quat = np.full((len(positions), model.nbody, 3), np.nan), np.full((len(positions), model.nbody, 4), np.nan)
    for k, each in enumerate(positions):
        if np.isfinite(each).all():
            data.qpos[:] = each
            mujoco.mj_kinematics(model, data)
            pos[k], quat[k] = data.xpos, data.xquat
    return pos, quat


def _runs(known: Any) -> list[tuple[int, int]]:
    """First and last index of each stretch of samples that are known."""
    return [(first, behind - 1) for first, behind in stretches(known).tolist()]


def _recorded(a: Mapping[str, Array], kind: int, data: int) -> Triangles:
    """Triangles of a mesh or of a field."""
    if kind == MESH:
        return a[f"mesh.{data}.vertices"].astype(float), a[f"mesh.{data}.faces"].astype(np.int64), False
    assert kind == FIELD
    heights, size = a[f"field.{data}.heights"].astype(float), a[f"field.{data}.size"].astype(float)
    rows, columns = (np.unique(np.linspace(0, n - 1, min(n, MOST_NODES)).round().astype(int)) for n in heights.shape)
    x = size[0] * (2.0 * columns / (heights.shape[1] - 1) - 1.0)
    y = size[1] * (2.0 * rows / (heights.shape[0] - 1) - 1.0)
    east, north = np.meshgrid(x, y)
    vertices = np.column_stack([east.ravel(), north.ravel(), (size[2] * heights[np.ix_(rows, columns)]).ravel()])
    sides, faces = grid_sides(vertices, len(rows), len(columns), -float(size[3]))
    top = grid_faces(len(rows), len(columns))
    return np.vstack([vertices, sides]), np.vstack([top, faces + len(vertices)]), True


def triangles(kind: int, size: Array, endless: float) -> Triangles | None:
    """Triangles of a primitive of a MuJoCo type and size (3,); None for a mesh or a field.

    ``endless`` [m] is half the side of a plane without a size.
    """
    if kind in (MESH, FIELD):
        return None
    if kind == int(mujoco.mjtGeom.mjGEOM_PLANE):
        x, y = (float(side) if side > 0.0 else endless for side in size[:2])
        corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
        return corners, np.array([[0, 1, 2], [0, 2, 3]]), True
    return _MADE[kind](size)


def _sphere(size: Array) -> Triangles:
    return _ellipsoid(np.full(3, size[0]))


def _ellipsoid(size: Array) -> Triangles:
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, LEVELS + 1)
    vertices, faces = revolved(np.cos(angle), np.sin(angle))
    return vertices * size, faces, True


def _capsule(size: Array) -> Triangles:
    radius, half = float(size[0]), float(size[1])
    angle = np.linspace(0.0, 0.5 * math.pi, LEVELS // 2 + 1)
    low = -half - radius * np.sin(angle[::-1])
    vertices, faces = revolved(
        radius * np.concatenate([np.cos(angle[::-1]), np.cos(angle)]), np.concatenate([low, -low[::-1]])
    )
    return vertices, faces, True


def _cylinder(size: Array) -> Triangles:
    radius, half = float(size[0]), float(size[1])
    # The edges are there twice, so that the normals of the side and of the ends are their own.
    parts = [
        revolved(np.array(r) * radius, np.array(z) * half)
        for r, z in (((0.0, 1.0), (-1.0, -1.0)), ((1.0, 1.0), (-1.0, 1.0)), ((1.0, 0.0), (1.0, 1.0)))
    ]
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    faces = [faces + first for (_, faces), first in zip(parts, counts, strict=False)]
    return np.vstack([vertices for vertices, _ in parts]), np.vstack(faces), True


def _box(size: Array) -> Triangles:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64) * size
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))]
    return corners, np.array(faces), False


_MADE: Mapping[int, Callable[[Array], Triangles]] = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): _sphere,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): _ellipsoid,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): _capsule,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): _cylinder,
    int(mujoco.mjtGeom.mjGEOM_BOX): _box,
}


def revolved(radius: Array, height: Array, around: int = AROUND) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and faces, outwards, of a profile (k,) from below, turned about z in a number of steps."""
    angle = np.linspace(0.0, 2.0 * math.pi, around, endpoint=False)
    vertices = np.column_stack(
        [np.outer(radius, np.cos(angle)).ravel(), np.outer(radius, np.sin(angle)).ravel(), np.repeat(height, around)]
    )
    level = np.arange(len(radius) - 1)[:, None] * around
    this, after = np.arange(around), np.roll(np.arange(around), -1)
    a, b, c, d = (each.ravel() for each in (level + this, level + after, level + around + after, level + around + this))
    return vertices, np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def grid_faces(rows: int, columns: int) -> NDArray[np.int64]:
    """Faces, upwards, of a grid of nodes row by row, each cell cut along (0, 0)-(1, 1)."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    across = first + columns + 1
    return np.concatenate(
        [np.column_stack([first, first + 1, across]), np.column_stack([first, across, first + columns])]
    )


def grid_sides(vertices: Array, rows: int, columns: int, base: float) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and faces, outwards, of the sides of a grid of nodes (rows * columns, 3) down to a height."""
    edge = np.concatenate(
        [np.arange(columns), np.arange(1, rows) * columns + columns - 1,
         (rows - 1) * columns + np.arange(columns - 1)[::-1], np.arange(1, rows - 1)[::-1] * columns, [0]]
    )  # fmt: skip
    rim = vertices[edge]
    lower = rim.copy()
    lower[:, 2] = base
    return np.vstack([lower, rim]), grid_faces(2, len(edge))
