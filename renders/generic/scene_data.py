"""Validated arrays of a scene (``mathnavi.sim.engine.scene_record``): forged data in a file reach no library."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import RunFolderError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.scene_record import FIELD, MESH, MOST_PIXELS, PLANE
from mathnavi.sim.records.run_folder import SCENE

MOST_SIZE = 1e7  # [m] of a shape, and of its distance
PATH_POINTS = 240
UNIT = 1e-3  # by which the length of a quaternion may be off
Refused = Callable[[str], RunFolderError]  # makes the error of a file from what is wrong with it
_SHAPES: Mapping[str, tuple[str | int, ...]] = {
    "t": ("samples",),
    "bodies": ("bodies",),
    "pos": ("samples", "bodies", 3),
    "quat": ("samples", "bodies", 4),
    "vehicles": ("vehicles",),
    "vehicle_bodies": ("vehicles",),
    "geom.body": ("geoms",),
    "geom.type": ("geoms",),
    "geom.size": ("geoms", 3),
    "geom.pos": ("geoms", 3),
    "geom.quat": ("geoms", 4),
    "geom.rgba": ("geoms", 4),
    "geom.data": ("geoms",),
    "camera.names": ("cameras",),
    "camera.body": ("cameras",),
    "camera.pos": ("cameras", 3),
    "camera.quat": ("cameras", 4),
    "camera.field_of_view": ("cameras",),
}
_PICTURED: Mapping[str, tuple[str | int, ...]] = {"geom.texture": ("geoms",), "geom.repeat": ("geoms", 2)}
_TEXTS = ("bodies", "vehicles", "camera.names")
_QUATERNIONS = ("quat", "geom.quat", "camera.quat")
_INDICES = ("geom.body", "geom.type", "geom.data", "camera.body", "vehicle_bodies")


@dataclass(frozen=True)
class PlanPaths:
    """Paths of a vehicle's plans."""

    t: Array  # (k,) [s] of breakpoints of all plans, one plan after the other
    pos: Array  # (k, 3) [m]
    offsets: Array  # (p + 1,) of the plans
    adopted: Array  # (p,) [s]


@dataclass(frozen=True, eq=False)
class SceneData:
    """Scene whose arrays are consistent."""

    arrays: Mapping[str, Array]
    plans: Mapping[str, PlanPaths]  # by vehicle

    @property
    def t(self) -> Array:
        """(n,) [s]."""
        return self.arrays["t"]

    @property
    def vehicles(self) -> dict[str, int]:
        """The body that shows where each vehicle is."""
        names, bodies = self.arrays["vehicles"].tolist(), self.arrays["vehicle_bodies"].tolist()
        return dict(zip(names, bodies, strict=True))

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the model's own cameras."""
        return tuple(name for name in self.arrays["camera.names"].tolist() if name)

    @property
    def moving(self) -> NDArray[np.bool_]:
        """(nb,) whether a body moves."""
        pos, quat = self.arrays["pos"], self.arrays["quat"]
        return np.asarray((np.ptp(pos, axis=0) > 1e-6).any(axis=1) | (np.ptp(quat, axis=0) > 1e-6).any(axis=1))

    @cached_property
    def extent(self) -> float:
        """[m] the longest side of the box around all that moves."""
        return max(float(np.ptp(swept(self), axis=0).max()), 1e-3)

    def has_ghost(self) -> bool:
        """True if the estimate can be drawn."""
        return "estimate.pos" in self.arrays


def scene_data(arrays: Mapping[str, Array], where: str) -> SceneData:
    """Return the scene in a file's arrays; RunFolderError, with the place ``where`` it was read, for wrong arrays."""

    def refused(why: str) -> RunFolderError:
        return RunFolderError(f"{where}/{SCENE}: {why}")

    sizes: dict[str, int] = {}
    optional = {f"estimate.{name}": _SHAPES[name] for name in ("pos", "quat") if f"estimate.{name}" in arrays}
    pictured = _PICTURED if "geom.texture" in arrays else {}  # a scene of a former version has none
    for name, shape in {**_SHAPES, **optional, **pictured}.items():
        if name not in arrays:
            raise refused(f"{name} is missing")
        values = arrays[name]
        if values.ndim != len(shape):
            raise refused(f"{name} has shape {values.shape}; allowed: {len(shape)} axes")
        for size, axis in zip(values.shape, shape, strict=True):
            expected = axis if isinstance(axis, int) else sizes.setdefault(axis, size)
            if size != expected:
                raise refused(f"{name} has shape {values.shape}; allowed: {expected} for {axis}")
        if (values.dtype.kind == "U") != (name in _TEXTS):
            raise refused(f"{name} holds {values.dtype}; allowed: {'texts' if name in _TEXTS else 'numbers'}")
        bounded = name in _TEXTS or name in optional or (np.isfinite(values) & (np.abs(values) <= MOST_SIZE)).all()
        if not bounded:
            raise refused(f"{name} holds values that are not finite, or beyond {MOST_SIZE:g}")
    if not (sizes["samples"] >= 1 and sizes["vehicles"] >= 1 and (np.diff(arrays["t"]) > 0.0).all()):
        raise refused("t does not increase, or there is no vehicle; allowed: times in order, and one vehicle at least")
    for name in _INDICES:
        most = {"geom.type": MESH + 1, "geom.data": 10_000}.get(name, sizes["bodies"])
        least = -1 if name == "geom.data" else 0
        if not ((arrays[name] >= least) & (arrays[name] < most) & (arrays[name] % 1 == 0)).all():
            raise refused(f"{name} holds indices that do not exist; allowed: whole numbers from {least} to {most - 1}")
    if len(optional) == 1:
        raise refused(f"{next(iter(optional))} is there alone; allowed: estimate.pos and estimate.quat")
    for name in _QUATERNIONS:
        if not (np.abs(np.linalg.norm(arrays[name], axis=-1) - 1.0) < UNIT).all():
            raise refused(f"{name} holds quaternions that are not of length 1")
    _check_surfaces(arrays, refused)
    if pictured:
        _check_pictures(arrays, refused)
    names = arrays["vehicles"].tolist()
    return SceneData(dict(arrays), {name: plan for name in names if (plan := _plan(arrays, name, refused))})


def _check_surfaces(arrays: Mapping[str, Array], refused: Refused) -> None:
    """Refuse meshes and fields that are not there or not whole."""
    for kind, data in zip(arrays["geom.type"].tolist(), arrays["geom.data"].tolist(), strict=True):
        if kind == MESH:
            vertices, faces = (arrays.get(f"mesh.{data}.{part}") for part in ("vertices", "faces"))
            whole = vertices is not None and faces is not None and _is_mesh(vertices, faces)
        elif kind == FIELD:
            heights, size = (arrays.get(f"field.{data}.{part}") for part in ("heights", "size"))
            whole = heights is not None and size is not None and _is_field(heights, size)
        else:
            continue
        if not whole:
            raise refused(f"the {'mesh' if kind == MESH else 'field'} {data} is missing or not whole")


def _check_pictures(arrays: Mapping[str, Array], refused: Refused) -> None:
    """Refuse pictures of planes that are not there or not whole."""
    for texture, repeat in zip(arrays["geom.texture"].tolist(), arrays["geom.repeat"], strict=True):
        if texture == -1:
            continue
        if not (isinstance(texture, int) and texture >= 0):
            raise refused("geom.texture holds indices that do not exist; allowed: whole numbers from -1 on")
        picture = arrays.get(f"texture.{texture}")
        whole = picture is not None and picture.dtype == np.uint8 and picture.ndim == 3 and picture.shape[2] == 3
        if picture is None or not whole or not (min(picture.shape) > 0 and max(picture.shape) <= MOST_PIXELS):
            raise refused(f"the texture {texture} is missing or not whole")
        if not (repeat > 0.0).all():
            raise refused("geom.repeat holds numbers that are not positive")


def _is_mesh(vertices: Array, faces: Array) -> bool:
    if vertices.ndim != 2 or faces.ndim != 2 or vertices.shape[1] != 3 or faces.shape[1] != 3 or len(vertices) < 4:
        return False
    numbers = np.isfinite(vertices).all() and (np.abs(vertices) <= MOST_SIZE).all()
    return bool(numbers and faces.dtype.kind in "iu" and (faces >= 0).all() and (faces < len(vertices)).all())


def _is_field(heights: Array, size: Array) -> bool:
    if heights.ndim != 2 or min(heights.shape) < 2 or size.shape != (4,):
        return False
    whole = np.isfinite(heights).all() and np.isfinite(size).all()
    return bool(whole and (heights >= 0.0).all() and (size > 0.0).all() and (size <= MOST_SIZE).all())


def _plan(arrays: Mapping[str, Array], name: str, refused: Refused) -> PlanPaths | None:
    """Return the paths of a vehicle's plans; None without plans."""
    parts = [arrays.get(f"plan.{name}.{part}") for part in ("t", "pos", "offsets", "adopted")]
    if any(part is None for part in parts):
        return None
    t, pos, offsets, adopted = (np.asarray(part) for part in parts)
    fits = t.ndim == offsets.ndim == adopted.ndim == 1 and pos.shape == (len(t), 3) and len(offsets) == len(adopted) + 1
    if not (fits and offsets.dtype.kind in "iu" and offsets[0] == 0 and offsets[-1] == len(t)):
        raise refused(f"the plans of {name} do not fit together")
    if not ((np.diff(offsets) >= 0).all() and (np.diff(adopted) >= 0.0).all()):
        raise refused(f"the plans of {name} are not in order")
    return PlanPaths(t, pos, offsets, adopted)


def reach(scene: SceneData) -> Array:
    """(nb,) [m] how far the shapes of each body reach from its middle; planes and fields aside."""
    a = scene.arrays
    found = np.zeros(len(a["bodies"]))
    for body, kind, size, pos, data in zip(
        *(a[f"geom.{part}"] for part in ("body", "type", "size", "pos", "data")), strict=True
    ):
        if int(kind) in (PLANE, FIELD):
            continue
        own = float(np.linalg.norm(size))
        if int(kind) == MESH:
            own = float(np.linalg.norm(a[f"mesh.{int(data)}.vertices"], axis=1).max())
        found[int(body)] = max(found[int(body)], own + float(np.linalg.norm(pos)))
    return found


def swept(scene: SceneData) -> Array:
    """(m, 3) [m] points around the paths of the vehicles, and of all else that moves."""
    pos, moving, sizes = scene.arrays["pos"], scene.moving, reach(scene)
    bodies = np.union1d(np.flatnonzero(moving & (sizes > 0.0)), list(scene.vehicles.values()))
    rows = np.unique(np.linspace(0, len(pos) - 1, min(PATH_POINTS, len(pos))).astype(np.int64))
    points = pos[rows][:, bodies].astype(float)
    around = 0.7 * sizes[bodies][None, :, None]
    return np.concatenate([points - around, points + around]).reshape(-1, 3)
