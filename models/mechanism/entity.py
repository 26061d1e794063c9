"""Mechanisms of this package, or of any MJCF file, above a floor and under a sky.

    rigid-body       a body on a ball joint, the same inertia about every axis: S^3
    cart-pendulum    a slide and a hinge: a flat metric
    two-link         two hinges in a vertical plane
    seven-joint      an arm of seven hinges

with a torque motor on each joint, on the ball joint one about each axis of the body, and arms with stiff position
servos, limits, damping, armature and friction:

    servo-six        six hinges
    servo-seven      seven hinges, with links of little inertia
    servo-gripper    seven hinges and two fingers, coupled, which one servo drives by a tendon

and two with a free base:

    swimmer          six links in a plane, in a viscous fluid, with a torque motor on each of five hinges
    quadruped        four legs of two hinges each, with position servos, an IMU on the trunk and switches in the feet
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Annotated, Any, get_args

import dm_control
import mujoco
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.input_files import InputFile
from mathnavi.interfaces.joint_states import FREE
from mathnavi.interfaces.reading.mechanisms import read_spec
from mathnavi.models.mechanism.files import files_digest
from mathnavi.models.mechanism.geometry import checked
from mathnavi.models.mechanism.menagerie import PREFIX, menagerie_file
from mathnavi.models.mechanism.names import FloatingName, MechanismName, ServoArmName
from mathnavi.models.vehicle_names import check_vehicle_name

_HERE = Path(__file__).parent
_SUITE = "dm_control:"
_BELOW = 0.1  # of its extent: a mechanism that reaches lower than this below zero has the floor this far beneath it


def file_of(mechanism: MechanismName | str | Path) -> Path:
    """MJCF file of a mechanism: by name, of dm_control's suite, of MuJoCo Menagerie, or at a path.

    Raises FieldError if no such file exists.
    """
    if str(mechanism).startswith(PREFIX):
        return menagerie_file(str(mechanism))
    names = (*get_args(MechanismName), *get_args(ServoArmName), *get_args(FloatingName))
    own = {name: _HERE / f"{name.replace('-', '_')}.xml" for name in names}
    suite = {f"{_SUITE}{file.stem}": file for file in (Path(dm_control.__file__).parent / "suite").glob("*.xml")}
    path = (own | suite).get(str(mechanism), Path(mechanism))
    if not path.is_file():
        raise FieldError(
            f"mechanism = {str(mechanism)!r}; allowed: {', '.join(own)}, {_SUITE}NAME of its suite "
            f"({', '.join(sorted(file.stem for file in suite.values()))}), {PREFIX}NAME of MuJoCo Menagerie, or the "
            "path of an MJCF file"
        )
    return path


def mechanism_digest(mechanism: str) -> str:
    """Digest of the files that a mechanism is read from; FieldError as for ``file_of``."""
    return files_digest(file_of(mechanism))


def place_of(mechanism: str) -> str:
    """Name or path that means the same mechanism from any folder: a name stays, a path becomes absolute."""
    path = file_of(mechanism)
    return str(path.resolve()) if path == Path(mechanism) else mechanism


MechanismPlace = Annotated[str, InputFile(mechanism_digest)]
"""type of a field that names a mechanism, or an MJCF file: the files it includes are part of the key of its runs"""


def build_spec(mechanism: MechanismName | str | Path, *, name: str = "mechanism") -> Any:
    """Build the ``mujoco.MjSpec`` of a mechanism in its arena, not compiled yet.

    Everything in the file has its name after ``NAME/``, for instance the joint ``NAME/elbow``; bodies, joints and
    actuators without a name get one, for instance ``NAME/joint_0``. Its options are kept, and its floor if it has one.

    Raises ValueError for what ``file_of`` and ``geometry.checked`` refuse, for a file that MuJoCo cannot read, and for
    a name that is empty or contains "/".
    """
    check_vehicle_name(name)
    path = file_of(mechanism)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # deprecated elements of a file concern its author
            own = read_spec(path, FieldError)
            alone = own.copy().compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise FieldError(
            f"mechanism = {str(mechanism)!r}; allowed: an MJCF file that MuJoCo can read ({reason})"
        ) from None
    try:
        checked(alone)
    except ValueError as error:
        raise FieldError(f"mechanism = {str(mechanism)!r}: {error}") from None
    for kind, elements in (("body", own.bodies), ("joint", own.joints), ("actuator", own.actuators)):
        _name(kind, elements)
    arena = read_spec(_HERE / "arena.xml", FieldError)
    # The options of an arena override those of what is attached to it: it takes the file's, and keeps its light.
    _copy(own.option, arena.option)
    _copy(arena.visual, own.visual)
    arena.memory, arena.njmax, arena.nconmax = own.memory, own.njmax, own.nconmax
    arena.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # a state that diverges has to be visible
    arena.stat.center, arena.stat.extent = alone.stat.center, alone.stat.extent
    sun = arena.light("sun")  # its shadows are sharp, and there, around where it hangs
    sun.pos = alone.stat.center - 1.5 * alone.stat.extent * np.array(sun.dir) / np.linalg.norm(sun.dir)
    if (alone.geom_type == int(mujoco.mjtGeom.mjGEOM_PLANE)).any():
        arena.delete(arena.geom("floor"))
    else:
        arena.geom("floor").pos = (0.0, 0.0, _floor(alone))
    frame = arena.worldbody.add_frame()
    if (alone.jnt_type == FREE).any():  # they are allowed on top of the world only
        arena.attach(own, prefix=f"{name}/", frame=frame)
    else:
        frame.attach_body(own.worldbody, f"{name}/", "")
    return arena


def build_model(mechanism: MechanismName | str | Path, *, name: str = "mechanism") -> mujoco.MjModel:
    """Compile the ``mujoco.MjModel`` of ``build_spec``."""
    return build_spec(mechanism, name=name).compile()


def _name(kind: str, elements: Sequence[Any]) -> None:
    """Name the elements without a name."""
    taken = {element.name for element in elements}
    for k, element in enumerate(elements):
        if not element.name:
            element.name = next(name for name in (f"{kind}_{k}{'_' * n}" for n in count()) if name not in taken)


def _copy(source: Any, target: Any) -> None:
    """Copy every value of a MuJoCo structure."""
    for name in dir(source):
        value = getattr(source, name)
        if name.startswith("_") or callable(value):
            continue
        if isinstance(value, np.ndarray):
            getattr(target, name)[:] = value
        elif isinstance(value, (bool, int, float)):
            setattr(target, name, value)
        else:
            _copy(value, getattr(target, name))


def _floor(model: mujoco.MjModel) -> float:
    """Height [m] of the floor."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    down = data.geom_xmat.reshape(-1, 3, 3)[:, 2]  # (ngeom, 3) the world's vertical in the frame of each geom
    heights = data.geom_xpos[:, 2] + (down * model.geom_aabb[:, :3]).sum(axis=1)
    lowest = float((heights - (np.abs(down) * model.geom_aabb[:, 3:]).sum(axis=1)).min(initial=0.0))
    return 0.0 if lowest > -_BELOW * model.stat.extent else lowest - _BELOW * model.stat.extent
