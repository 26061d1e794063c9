"""Visible part of a run in MuJoCo: the shapes of its model, and where each body was, sample by sample.

It is self-contained: drawing the run needs neither its scenario nor the files of its model, and nothing in it is
executed. ``scene.npz`` in the run's folder holds it, array by array:

| array | content |
|---|---|
| ``t`` | (n,) [s] |
| ``bodies`` | (nb,) names; 0 is the world |
| ``pos``, ``quat`` | (n, nb, 3) [m], (n, nb, 4) poses of the bodies |
| ``estimate.pos``, ``estimate.quat`` | the same from the estimate, NaN before the first; absent if not defined |
| ``vehicles``, ``vehicle_bodies`` | (nv,) names, and the body that shows the position of each |
| ``geom.*`` | of shapes: ``body``, ``type``, ``size``, ``pos``, ``quat``, ``rgba``, ``data`` (which mesh or field) |
| ``geom.texture``, ``geom.repeat`` | of planes with a picture: which ``texture.K``, or -1; (2,) [1/m] its repetitions |
| ``texture.K`` | (rows, columns, 3) red, green, blue; row 0 in the south |
| ``mesh.K.vertices``, ``mesh.K.faces`` | (m, 3) [m], (f, 3) |
| ``field.K.heights``, ``field.K.size`` | (rows, columns) in [0, 1]; (4,) [m] |
| ``camera.*`` | of nc cameras of the model: ``names``, ``body``, ``pos``, ``quat``, ``field_of_view`` [degrees] |
| ``plan.VEHICLE.*`` | ``t`` [s] and ``pos`` [m] at breakpoints, ``offsets`` (p + 1,), ``adopted`` (p,) [s] |

Replay of a finished run in its MuJoCo model, with the poses of the bodies sample by sample.

A vehicle that is a point has a body ``NAME/airframe`` in the model, which physics does not move; it is placed at the
point, and tilted as the input requires.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signal_names import SignalNames, name_and_unit
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.plant import MujocoPlant


class RecordedMotion:
    """Plant of a run, with the logged motion of its vehicles."""

    def __init__(self, plant: Plant, t: Array, states: Mapping[str, Array], inputs: Mapping[str, Array]) -> None:
        """Set ``t`` (n,) [s], and for each vehicle of the plant its true states (n, nx) and its inputs (n, nu).

        Raises ArgumentError for a plant without bodies in MuJoCo, and for states that are not those of its vehicles.
        """
        body = plant.plant if isinstance(plant, Disturbed) else plant
        if not isinstance(body, MujocoPlant):
            raise ArgumentError("it has no body in MuJoCo, its states are numbers alone; allowed: runs of bodies")
        if set(states) != set(body.names):
            raise ArgumentError(f"it logged {', '.join(states)}; allowed: {', '.join(body.names)}")
        for name, x in states.items():
            size = len(body.state_names(name))
            if x.shape != (len(t), size):
                raise ArgumentError(f"truth.x of {name} is {x.shape}; allowed: {(len(t), size)}")
        self.plant, self.t, self.states, self.inputs = body, t, states, inputs
        bodies = {body.model.body(b).name: b for b in range(body.model.nbody)}
        self._airframes = {name: bodies[f"{name}/airframe"] for name in states if f"{name}/airframe" in bodies}

    @property
    def duration(self) -> float:
        """Duration [s] of the run."""
        return float(self.t[-1])

    def show(self, t: float) -> None:
        """Set the pose of every vehicle at the last sample at or before ``t`` [s]."""
        self.show_sample(max(int(np.searchsorted(self.t, t + TIME_TOLERANCE, side="right")) - 1, 0))

    def show_sample(self, row: int) -> None:
        """Set the pose of every vehicle at a sample."""
        for name in self.states:
            self._place(name, row)

    def body(self, name: str) -> int:
        """Return body that shows the position of a vehicle: its airframe, or the body that its first joint moves."""
        if name in self._airframes:
            return self._airframes[name]
        model = self.plant.model
        first = next(j for j in range(model.njnt) if model.joint(j).name.startswith(f"{name}/"))
        return int(model.jnt_bodyid[first])

    def path(self, name: str, count: int) -> Array:
        """Return the path (k, 3) [m] of that body, at most ``count`` samples, evenly spread."""
        rows = np.unique(np.linspace(0, len(self.t) - 1, min(count, len(self.t))).astype(np.int64))
        at, points = self.body(name), []
        for row in rows:
            self._place(name, int(row))
            points.append(self.plant.data.xpos[at].copy())
        return np.array(points)

    def place(self, name: str, x: Array) -> Array:
        """Return the position (3,) [m] of the body of a vehicle in a state (nx,), without the effect of its input."""
        self._put(name, x, np.zeros(self.inputs[name].shape[1]))
        found: Array = self.plant.data.xpos[self.body(name)].copy()
        return found

    def _place(self, name: str, row: int) -> None:
        self._put(name, self.states[name][row], self.inputs[name][row])

    def _put(self, name: str, x: Array, u: Array) -> None:
        model, data = self.plant.model, self.plant.data
        if name in self._airframes:
            k = int(model.body_mocapid[self._airframes[name]])
            data.mocap_pos[k], data.mocap_quat[k] = airframe_pose(x[:3], x[3:], u)
        self.plant.place(name, x)


RATE = 60.0  # [1/s] of the poses, at most
MOST_SAMPLES = 6000
MESH, FIELD = int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_HFIELD)
PLANE = int(mujoco.mjtGeom.mjGEOM_PLANE)
MOST_PIXELS = 256  # along a side of the picture of a plane
_SHOWN_GROUPS = (0, 1, 2)  # of geoms, as MuJoCo's viewer shows them


def scene_arrays(plant: Plant, recording: Recording) -> dict[str, Array] | None:
    """Return the arrays of a run's scene; None if the plant has no bodies in MuJoCo, or the run no samples."""
    arrays = recording.arrays()
    inputs = {name: _of_vehicle(arrays, name, "command.u") for name in recording.truths}
    if not recording.length or any(u is None for u in inputs.values()):
        return None
    states = {name: x[: recording.length] for name, x in recording.truths.items()}
    finite = _finite(list(states.values()))
    count = len(finite) if finite.all() else int(finite.argmin())
    if count == 0:
        return None
    t, u = recording.t[:count], {name: each[:count] for name, each in inputs.items() if each is not None}
    try:
        motion = RecordedMotion(plant, t, {name: x[:count] for name, x in states.items()}, u)
    except ValueError:
        return None
    rows = _rows(t)
    found = {"t": t[rows], **shapes(motion.plant.model), **_poses(motion, rows, "")}
    names = list(states)
    found["vehicles"] = np.array(names)
    found["vehicle_bodies"] = np.array([motion.body(name) for name in names])
    for name in names:
        plans = _plans(motion, name, arrays)
        if not plans and (signals := recording.signals.get(name)) is not None:
            path = found["pos"][:, motion.body(name)].astype(float)
            plans = _named_plans(name, arrays, signals, found["t"], path)
        found |= plans
    return found | _estimates(motion, rows, arrays)


def _finite(states: list[Array]) -> NDArray[np.bool_]:
    """Return (n,) whether all states of a sample are finite."""
    return np.asarray(np.isfinite(np.hstack(states)).all(axis=1))


def _of_vehicle(arrays: dict[str, Array], vehicle: str, name: str) -> Array | None:
    return arrays.get(name, arrays.get(f"{vehicle}.{name}"))


def _rows(t: Array) -> Integers:
    """Return the indices of the samples that are kept."""
    count = min(len(t), MOST_SAMPLES, int(RATE * float(t[-1] - t[0])) + 2)
    rows: Integers = np.unique(np.linspace(0, len(t) - 1, count).round().astype(np.int64))
    return rows


def shapes(model: mujoco.MjModel, groups: Sequence[int] = _SHOWN_GROUPS) -> dict[str, Array]:
    """Return the geoms of some groups, with their meshes and fields, and the cameras."""
    shown = np.flatnonzero(np.isin(model.geom_group, groups) & (model.geom_type <= MESH))
    material, rgba = model.geom_matid[shown], model.geom_rgba[shown].copy()
    rgba[material >= 0] = model.mat_rgba[material[material >= 0]]
    found = {
        "bodies": np.array([model.body(b).name for b in range(model.nbody)]),
        "geom.body": model.geom_bodyid[shown],
        "geom.type": model.geom_type[shown],
        "geom.size": model.geom_size[shown],
        "geom.pos": model.geom_pos[shown],
        "geom.quat": model.geom_quat[shown],
        "geom.rgba": rgba,
        "geom.data": model.geom_dataid[shown],
        **_pictured(model, shown),
        "camera.names": np.array([model.camera(c).name for c in range(model.ncam)], dtype=np.str_),
        "camera.body": model.cam_bodyid,
        "camera.pos": model.cam_pos,
        "camera.quat": model.cam_quat,
        "camera.field_of_view": model.cam_fovy,
    }
    return {name: np.array(values) for name, values in (*found.items(), *_surfaces(model, shown))}


def _pictured(model: mujoco.MjModel, shown: Integers) -> dict[str, Array]:
    """Return which planes have a picture, and the pictures, with ``MOST_PIXELS`` along a side at most."""
    textures, repeats, found = np.full(len(shown), -1), np.zeros((len(shown), 2)), {}
    for k in np.flatnonzero((model.geom_type[shown] == PLANE) & (model.geom_matid[shown] >= 0)).tolist():
        material, size = int(model.geom_matid[shown[k]]), model.geom_size[shown[k]][:2]
        texture = int(model.mat_texid[material, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
        if texture < 0 or int(model.tex_type[texture]) != int(mujoco.mjtTexture.mjTEXTURE_2D):
            continue
        repeat = model.mat_texrepeat[material].astype(float)
        if not model.mat_texuniform[material]:  # so often on the whole plane
            repeat = np.where(size > 0.0, repeat / (2.0 * np.maximum(size, 1e-9)), repeat)
        rows, columns, channels = (
            int(each[texture]) for each in (model.tex_height, model.tex_width, model.tex_nchannel)
        )
        if not (repeat > 0.0).all() or channels < 3:
            continue
        first = int(model.tex_adr[texture])
        picture = model.tex_data[first : first + rows * columns * channels].reshape(rows, columns, channels)[..., :3]
        steps = [-(-side // MOST_PIXELS) for side in (rows, columns)]
        textures[k], repeats[k] = texture, repeat
        found[f"texture.{texture}"] = picture[:: steps[0], :: steps[1]].copy()
    return {"geom.texture": textures, "geom.repeat": repeats, **found} if found else {}


def _surfaces(model: mujoco.MjModel, shown: Integers) -> Iterator[tuple[str, Array]]:
    kinds, data = model.geom_type[shown], model.geom_dataid[shown]
    for k in np.unique(data[kinds == MESH]).tolist():
        mesh = model.mesh(k)
        vertices, faces = int(mesh.vertadr[0]), int(mesh.faceadr[0])
        yield f"mesh.{k}.vertices", model.mesh_vert[vertices : vertices + int(mesh.vertnum[0])]
        yield f"mesh.{k}.faces", model.mesh_face[faces : faces + int(mesh.facenum[0])]
    for k in np.unique(data[kinds == FIELD]).tolist():
        rows, columns, first = int(model.hfield_nrow[k]), int(model.hfield_ncol[k]), int(model.hfield_adr[k])
        yield f"field.{k}.heights", model.hfield_data[first : first + rows * columns].reshape(rows, columns)
        yield f"field.{k}.size", model.hfield_size[k]


def _poses(motion: RecordedMotion, rows: Integers, prefix: str) -> dict[str, Array]:
    """Return the poses of all bodies at the samples."""
    data, count = motion.plant.data, motion.plant.model.nbody
    pos: Any = np.empty((len(rows), count, 3), np.float32)
    quat: Any = np.empty((len(rows), count, 4), np.float32)
    for k, row in enumerate(rows):
        motion.show_sample(int(row))
        pos[k], quat[k] = data.xpos, data.xquat
    return {f"{prefix}pos": pos, f"{prefix}quat": quat}


def _estimates(motion: RecordedMotion, rows: Integers, arrays: dict[str, Array]) -> dict[str, Array]:
    """Return the poses of the vehicles in the newest estimate; nothing if its states are not those of the vehicles."""
    believed = {}
    for name, x in motion.states.items():
        times, values = (_of_vehicle(arrays, name, f"estimate.{part}") for part in ("t", "x"))
        if times is None or values is None or values.shape[1:] != x.shape[1:]:
            return {}
        newest = np.searchsorted(times, motion.t + TIME_TOLERANCE, side="right") - 1
        usable = (newest >= 0) & _finite([values])[np.maximum(newest, 0)]
        believed[name] = np.where(usable[:, None], values[np.maximum(newest, 0)], np.nan)
    known = _finite(list(believed.values()))[rows]
    safe = {name: np.where(np.isfinite(values), values, motion.states[name]) for name, values in believed.items()}
    try:
        found = _poses(RecordedMotion(motion.plant, motion.t, safe, motion.inputs), rows, "estimate.")
    except ValueError:  # not a state of the vehicle: for example a quaternion that is not of length 1
        return {}
    for values in found.values():
        values[~known] = np.nan
    return found


_NEAR = 0.25  # of the extent of a path, within which what is called a position is where the vehicle is
_AXES = (  # names of a position's numbers, without units
    frozenset(("x", "x 1", "east", "position x")),
    frozenset(("y", "x 2", "north", "position y")),
    frozenset(("z", "x 3", "up", "height", "altitude", "position z")),
)


def _named_plans(name: str, arrays: dict[str, Array], signals: SignalNames, at: Array, path: Array) -> dict[str, Array]:
    """Return the positions along the plans of a vehicle whose plans have the numbers of its estimate, not its states.

    Which of these are a position is known by their names; a height that is not among them is that of the vehicle,
    ``path`` (n, 3) [m] at times ``at`` (n,) [s]. Nothing if the plans have no position, or if what they call so is not
    where the vehicle is, by the true values of what there is to estimate.
    """
    t, x, offsets, adopted = (_of_vehicle(arrays, name, f"plan.{part}") for part in ("t", "x", "offsets", "adopted"))
    if t is None or x is None or offsets is None or adopted is None:
        return {}
    named = [name_and_unit(words) for words in signals.of_estimate(x.shape[1])]
    columns = [next((k for k, (own, unit) in enumerate(named) if unit == "m" and own in axis), None) for axis in _AXES]
    if columns[0] is None or columns[1] is None or not _are_positions(name, arrays, signals, named, columns, at, path):
        return {}
    places: Any = np.column_stack(
        [np.interp(t, at, path[:, axis]) if k is None else x[:, k] for axis, k in enumerate(columns)]
    ).astype(np.float32)
    prefix = f"plan.{name}"
    return {f"{prefix}.t": t, f"{prefix}.pos": places, f"{prefix}.offsets": offsets, f"{prefix}.adopted": adopted}


def _are_positions(
    name: str,
    arrays: dict[str, Array],
    signals: SignalNames,
    named: Sequence[tuple[str, str]],
    columns: Sequence[int | None],
    at: Array,
    path: Array,
) -> bool:
    """True if the true values of the estimands that are called a position are near the path of the vehicle."""
    t, true = _of_vehicle(arrays, name, "t"), _of_vehicle(arrays, name, "truth.estimands")
    if t is None or true is None:
        return True
    places = {name_and_unit(words): k for k, words in enumerate(signals.estimands)}
    near = _NEAR * max(float(np.ptp(path, axis=0).max()), 1.0)
    return all(
        np.abs(np.interp(at, t, true[: len(t), places[named[k]]]) - path[:, axis]).max() <= near
        for axis, k in enumerate(columns)
        if k is not None and named[k] in places
    )


def _plans(motion: RecordedMotion, name: str, arrays: dict[str, Array]) -> dict[str, Array]:
    """Return the positions of a vehicle's body along its plans; nothing if a plan's states are not the vehicle's."""
    t, x, offsets, adopted = (_of_vehicle(arrays, name, f"plan.{part}") for part in ("t", "x", "offsets", "adopted"))
    if t is None or x is None or offsets is None or adopted is None or x.shape[1:] != motion.states[name].shape[1:]:
        return {}
    places: Any = np.full((len(t), 3), np.nan, np.float32)
    try:
        for k in np.flatnonzero(_finite([x])):
            places[k] = motion.place(name, x[k])
    except ValueError:  # states that no vehicle can have, as above
        return {}
    prefix = f"plan.{name}"
    return {f"{prefix}.t": t, f"{prefix}.pos": places, f"{prefix}.offsets": offsets, f"{prefix}.adopted": adopted}
