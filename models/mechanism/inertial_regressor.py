"""Inverse dynamics of a mechanism as a linear function of the inertial parameters of its bodies.

The torque that moves and carries a mechanism is linear in mass m, first moment m c and inertia I of each body, about
the origin of the body's frame and along its axes,

    M(q) a + c(q, v)  =  Y(q, v, a) theta,      theta_b = (m, m c_x, m c_y, m c_z, I_xx, I_yy, I_zz, I_xy, I_xz, I_yz).

Each column of Y is MuJoCo's recursive Newton-Euler algorithm with one parameter of one body set to 1, all others zero.
The inertia of rotors (``armature``) is not part of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.geometry import evaluated

PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
"""names of the inertial parameters of a body, in their order"""
UNITS = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
COUNT = len(PARAMETERS)


def inertial_parameters(model: mujoco.MjModel, body: int) -> Array:
    """Inertial parameters (10,) of a body of a model."""
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, model.body_iquat[body])
    R = turned.reshape(3, 3)
    m, c = float(model.body_mass[body]), model.body_ipos[body]
    J = R @ np.diag(model.body_inertia[body]) @ R.T + m * (c @ c * np.eye(3) - np.outer(c, c))
    return np.concatenate([[m], m * c, [J[i, j] for i, j in _PAIRS]])


class InertialRegressor:
    """Regressors Y of a model; it depends on its arguments only."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = evaluated(model)
        self._data = mujoco.MjData(self._model)

    def torque(self, q: Array, v: Array, a: Array) -> Array:
        """Torque (n, nv) [N m, N] by the model's own inertial parameters at q (n, nq), v, a (n, nv), less that of its
        springs and of its compensation of gravity.
        """
        data, torque = self._data, np.zeros((len(q), self._model.nv))
        for k in range(len(q)):
            data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
            mujoco.mj_fwdPosition(self._model, data)
            mujoco.mj_fwdVelocity(self._model, data)
            mujoco.mj_rne(self._model, data, 1, torque[k])
            torque[k] -= data.qfrc_spring + data.qfrc_gravcomp
        return torque

    def __call__(self, q: Array, v: Array, a: Array, bodies: Sequence[int]) -> Array:
        """Regressor Y (n, nv, 10 len(bodies)) at q (n, nq), v, a (n, nv)."""
        model, data = self._model, self._data
        Y = np.zeros((len(q), model.nv, COUNT * len(bodies)))
        torque = np.zeros(model.nv)
        for k in range(len(q)):
            self._move(q[k], v[k], a[k])
            for j, body in enumerate(bodies):
                rows = self._unit_inertias(body)
                data.cinert[:] = 0.0
                for p in range(COUNT):
                    data.cinert[body] = rows[p]
                    mujoco.mj_rne(model, data, 1, torque)
                    Y[k, :, COUNT * j + p] = torque
        return Y

    def _move(self, q: Array, v: Array, a: Array) -> None:
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)

    def _unit_inertias(self, body: int) -> Array:
        """Rows (10, 10) of MuJoCo's ``cinert`` for each parameter: inertia about the centre of mass of the tree that
        the body belongs to, m times the place of the body's centre from there, and m, along the world's axes.
        """
        model, data = self._model, self._data
        R = data.xmat[body].reshape(3, 3)
        r = data.xpos[body] - data.subtree_com[model.body_rootid[body]]
        rows = np.zeros((COUNT, 10))
        for p in range(COUNT):
            m, h, J = float(p == 0), np.zeros(3), np.zeros((3, 3))
            if 1 <= p <= 3:
                h = R[:, p - 1]
            elif p > 3:
                i, j = _PAIRS[p - 4]
                J[i, j] = J[j, i] = 1.0
                J = R @ J @ R.T
            J = J + (m * (r @ r) + 2.0 * (r @ h)) * np.eye(3) - m * np.outer(r, r) - np.outer(r, h) - np.outer(h, r)
            rows[p] = [*(J[i, j] for i, j in _PAIRS), *(h + m * r), m]
        return rows
