"""Forces on a mechanism, compiled: M^-1 (actuators + springs, dampers and the like - gravity), by MuJoCo."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numba import float64, int64

from mathnavi.interfaces.compiled import Signature, njit
from mathnavi.interfaces.kernel_types import ONE, array, named
from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.kernels import (
    ADDRESS,
    Mechanism,
    address,
    com_pos,
    com_vel,
    connection,
    curvature,
    difference,
    exponential,
    factor_m,
    function,
    integrate,
    kinematics,
    locate,
    logarithm,
    make_m,
    norm_at,
    rne,
    solve_m,
    transport,
)

tendon = function("mj_tendon", ADDRESS, ADDRESS)
transmission = function("mj_transmission", ADDRESS, ADDRESS)
fwd_velocity = function("mj_fwdVelocity", ADDRESS, ADDRESS)
fwd_actuation = function("mj_fwdActuation", ADDRESS, ADDRESS)


class Actuated(NamedTuple):
    """A model and the memory it is evaluated in, which never contains constraints."""

    model: int  # address
    data: int  # address
    qpos: Array  # (nq,) of data; the rest of data belongs to it
    qvel: Array  # (nv,)
    ctrl: Array  # (nu,)
    passive: Array  # (nv,) qfrc_passive
    actuated: Array  # (nv,) qfrc_actuator


def actuated(model: mujoco.MjModel, data: mujoco.MjData) -> Actuated:
    """Pass a model and its memory to compiled code; both have to outlive the result."""
    return Actuated(
        address(model), address(data), data.qpos, data.qvel, data.ctrl, data.qfrc_passive, data.qfrc_actuator
    )


@njit(cache=True)
def acceleration(at: Actuated, q: Array, v: Array, u: Array) -> Array:
    """Acceleration D_t v (nv,) [m/s^2, rad/s^2] at (q (nq,), v (nv,)) under the controls u (nu,)."""
    m, d, n = at.model, at.data, len(at.qvel)
    at.qpos[:], at.qvel[:], at.ctrl[:] = q, v, u
    kinematics(m, d)
    com_pos(m, d)
    tendon(m, d)
    make_m(m, d)
    factor_m(m, d)
    transmission(m, d)
    fwd_velocity(m, d)
    fwd_actuation(m, d)
    force = at.passive + at.actuated
    # Inverse dynamics at rest is gravity: the rest of it at v is the connection, which belongs to D_t.
    at.qvel[:] = 0.0
    com_vel(m, d)
    weight = np.empty(n)
    rne(m, d, 0, weight.ctypes.data)
    force -= weight
    F = np.empty(n)
    solve_m(m, d, F.ctypes.data, force.ctypes.data, 1)
    return F


# Kernels that are compiled before a run (``sim.engine.compilation``), for arguments of these types.
MECHANISM = named(Mechanism, int64, int64, ONE, ONE, array(1, int64))
KERNELS: tuple[Signature, ...] = (
    (curvature, (MECHANISM, ONE, ONE, ONE)),
    (logarithm, (MECHANISM, ONE, ONE)),
    (transport, (MECHANISM, ONE, ONE, ONE)),
    (exponential, (MECHANISM, ONE, ONE)),
    (difference, (MECHANISM, ONE, ONE)),
    (connection, (MECHANISM, ONE, ONE)),
    (integrate, (MECHANISM, ONE, ONE, float64)),
    (norm_at, (MECHANISM, ONE, ONE)),
    (locate, (MECHANISM, ONE)),
    (acceleration, (named(Actuated, int64, int64, ONE, ONE, ONE, ONE, ONE), ONE, ONE, ONE)),
)
