"""Triangles of MuJoCo's shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import mujoco
import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.scene_record import FIELD, MESH

AROUND, LEVELS = 24, 12  # of a round shape
Triangles = tuple[Array, NDArray[np.int64], bool]  # (m, 3) vertices [m], (f, 3) faces, whether it is smooth


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
