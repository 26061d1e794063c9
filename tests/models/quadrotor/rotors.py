"""Thrusts of the rotors of a quadrotor in MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.quadrotor.dynamics import ROTORS


def rotor_thrusts(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> Array:
    """(4,) [N] with which the rotors of a vehicle push now."""
    pushes = []
    for rotor in ROTORS:
        actuator = model.actuator(f"{name}/{rotor}")
        pushes.append(float(data.act[actuator.actadr[0]]) + float(actuator.biasprm[0]))
    return np.array(pushes)
