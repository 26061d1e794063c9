"""Names and units of the inputs of actuators and of the readings of sensors in a MuJoCo model.

Names are without the vehicle's name before a "/".
"""

from __future__ import annotations

import mujoco
import numpy as np

from mathnavi.interfaces.joint_states import SLIDE, own_name
from mathnavi.interfaces.signal_names import numbered

_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)
_FIXED, _NO_BIAS = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_NONE)
_AFFINE_BIAS = int(mujoco.mjtBias.mjBIAS_AFFINE)
_UNITS = {
    "GYRO": "rad/s", "BALLANGVEL": "rad/s", "FRAMEANGVEL": "rad/s", "FRAMEANGACC": "rad/s^2",
    "ACCELEROMETER": "m/s^2", "FRAMELINACC": "m/s^2", "VELOCIMETER": "m/s", "FRAMELINVEL": "m/s",
    "SUBTREELINVEL": "m/s", "FRAMEPOS": "m", "RANGEFINDER": "m", "SUBTREECOM": "m", "GEOMDIST": "m", "TENDONPOS": "m",
    "TENDONVEL": "m/s", "TOUCH": "N", "FORCE": "N", "TORQUE": "N m", "CLOCK": "s",
    "MAGNETOMETER": "unit of magnetic",  # of <option magnetic="...">, which MuJoCo leaves to the model
}  # fmt: skip


def input_names(model: mujoco.MjModel, i: int) -> tuple[str, ...]:
    """Return the names of the inputs of an actuator, which are numbered if there are several.

    A motor of gain 1 on a joint has the unit of its force or torque, a servo the unit of the position or velocity that
    it holds; others have none.
    """
    name, count = own_name(model.actuator(i).name, i), int(model.actuator_ctrlnum[i])
    if count != 1:
        return tuple(f"{name}_{k} [-]" for k in range(count))
    return (f"{name} [{_input_unit(model, i) or '-'}]",)


def _input_unit(model: mujoco.MjModel, i: int) -> str:
    gear = float(np.linalg.norm(model.actuator_gear[i]))
    if int(model.actuator_trntype[i]) != _JOINT or int(model.actuator_gaintype[i]) != _FIXED:
        return ""
    slides = int(model.jnt_type[int(model.actuator_trnid[i, 0])]) == SLIDE
    gain, bias = float(model.actuator_gainprm[i, 0]), model.actuator_biasprm[i, :3]
    if int(model.actuator_biastype[i]) == _NO_BIAS:
        return ("N" if slides else "N m") if gain * gear == 1.0 else ""
    if int(model.actuator_biastype[i]) != _AFFINE_BIAS or gear != 1.0 or gain == 0.0 or bias[0] != 0.0:
        return ""
    length = "m" if slides else "rad"
    if bias[1] == -gain:
        return length
    return f"{length}/s" if bias[1] == 0.0 and bias[2] == -gain else ""


def reading_names(model: mujoco.MjModel, i: int) -> tuple[str, ...]:
    """Return the names of the numbers of a sensor's reading."""
    name = own_name(model.sensor(i).name, i)
    return numbered(name, int(model.sensor_dim[i]), reading_unit(model, i))


def reading_unit(model: mujoco.MjModel, i: int) -> str:
    """Return the unit of a sensor's reading, as MuJoCo's documentation has it; "" where it has none."""
    kind = mujoco.mjtSensor(int(model.sensor_type[i])).name.removeprefix("mjSENS_")
    if kind in ("JOINTPOS", "JOINTVEL"):
        slides = int(model.jnt_type[model.sensor_objid[i]]) == SLIDE
        return ("m" if slides else "rad") + ("/s" if kind == "JOINTVEL" else "")
    return _UNITS.get(kind, "")
