"""A mechanism with a motor on each joint, whose gain, rotor, friction and offset are given: what a log identifies."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.joint_states import HINGE, SLIDE
from mathnavi.interfaces.reading.mechanisms import read_spec
from mathnavi.models.mechanism.entity import file_of
from mathnavi.models.mechanism.geometry import checked


@dataclass(frozen=True)
class DrivenJoint:
    """Motor and friction of a joint: the torque is gain u + offset."""

    gain: float  # [N m or N, per unit of u]
    armature: float  # [kg m^2, kg]
    damping: float  # [N m s/rad, N s/m]
    friction: float  # [N m, N]
    offset: float  # [N m, N]


def mechanism_alone(mechanism: str | Path) -> mujoco.MjModel:
    """Compile the model of a mechanism without an arena, whose joints are hinges and slides, each of which moves mass.

    Raises FieldError for a file that does not exist or that MuJoCo cannot read, and for other joints.
    """
    return _compiled(_named_spec(mechanism), mechanism)


def joint_names(model: mujoco.MjModel) -> tuple[str, ...]:
    """Names (nv,) of the joints of a model."""
    return tuple(model.joint(j).name for j in range(model.njnt))


def driven_spec(mechanism: str | Path, joints: tuple[DrivenJoint, ...]) -> Any:
    """Return the ``mujoco.MjSpec`` of a mechanism whose only actuators are one motor for each of its joints, in order.

    The control of a motor is u. Sensors of the former actuators are left out, and the controls of keyframes are zero.

    Raises FieldError as ``mechanism_alone`` does.
    """
    spec = _named_spec(mechanism)
    model = _compiled(spec, mechanism)
    of_actuators = mujoco.mjtObj.mjOBJ_ACTUATOR
    for sensor in [each for each in spec.sensors if each.objtype == of_actuators]:
        spec.delete(sensor)
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for name, own in zip(joint_names(model), joints, strict=True):
        joint = spec.joint(name)
        joint.armature, joint.frictionloss = own.armature, own.friction
        joint.damping[:] = 0.0
        joint.damping[0] = own.damping
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
        motor = spec.add_actuator(name=f"motor_{name}", target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        # The file's defaults for actuators, as the gains and ranges of servos, are not those of a motor.
        motor.dyntype, motor.gaintype = mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtGain.mjGAIN_FIXED
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.gear[:], motor.gainprm[:], motor.biasprm[:] = np.eye(6)[0], 0.0, 0.0
        motor.gainprm[0], motor.biasprm[0] = own.gain, own.offset
        motor.ctrllimited = motor.forcelimited = mujoco.mjtLimited.mjLIMITED_FALSE
    for key in spec.keys:
        key.ctrl = np.zeros(len(joints))
    folder = file_of(mechanism).resolve().parent
    spec.meshdir, spec.texturedir = str(folder / spec.meshdir), str(folder / spec.texturedir)
    return spec


def _named_spec(mechanism: str | Path) -> Any:
    spec = read_spec(file_of(mechanism), FieldError)
    taken = {joint.name for joint in spec.joints}
    for k, joint in enumerate(spec.joints):
        if not joint.name:
            joint.name = next(name for name in (f"joint_{k}{'_' * n}" for n in range(k + 2)) if name not in taken)
            taken.add(joint.name)
    return spec


def _compiled(spec: Any, mechanism: str | Path) -> mujoco.MjModel:
    try:
        model = spec.compile()
        checked(model)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise FieldError(f"mechanism = {str(mechanism)!r}; allowed: one that MuJoCo can read ({reason})") from None
    if not np.isin(model.jnt_type, (HINGE, SLIDE)).all():
        raise FieldError(f"mechanism = {str(mechanism)!r}; allowed here: hinges and slides only, no free base, no ball")
    return model
