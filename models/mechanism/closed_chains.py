"""Closed kinematic chains: equality constraints between the bodies, joints or tendons of one mechanism.

Where the chains are closed, r(q) = 0, velocities satisfy J v = 0, J = dr/dq. MuJoCo closes them by forces that are
stiff and not rigid: a position that is off by the noise of encoders is a spring that is wound, and the velocities that
it causes are those of no motion. What is read is therefore projected onto what the chains allow,

    tangent    c - J^+ J c    of a displacement or a velocity c,
    nearest    q - J^+ r      of a position q, a few times, while r becomes smaller,

where ^+ is the pseudoinverse: of a planar linkage, a third of the rows says nothing. The metric is that of the
encoders, which err alike, and not that of the masses: by it, the error of a heavy link would move the light ones.
"""

from __future__ import annotations

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.geometry import evaluated

_CLOSING = tuple(int(getattr(mujoco.mjtEq, f"mjEQ_{kind}")) for kind in ("CONNECT", "WELD", "JOINT", "TENDON"))
_STEPS = 6  # of ``nearest``
_DEPENDENT = 1e-9  # of the greatest eigenvalue of J J', below which rows say nothing


class ClosedChains:
    """The closed chains of a model; it depends on its arguments only."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = evaluated(model)
        flags = (mujoco.mjtDisableBit.mjDSBL_CONTACT, mujoco.mjtDisableBit.mjDSBL_LIMIT)
        for flag in (*flags, mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS):
            self._model.opt.disableflags |= int(flag)
        self._model.opt.jacobian = int(mujoco.mjtJacobian.mjJAC_DENSE)
        self._data = mujoco.MjData(self._model)
        self._data.eq_active[:] &= np.isin(model.eq_type, _CLOSING)

    @staticmethod
    def of(model: mujoco.MjModel) -> ClosedChains | None:
        """The closed chains of a model; None where it has none."""
        closing = np.isin(model.eq_type, _CLOSING) & (model.eq_active0 > 0)
        switched_off = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        return None if switched_off or not closing.any() else ClosedChains(model)

    def tangent(self, q: Array, c: Array) -> Array:
        """Displacement or velocity (nv,) that the chains allow at q (nq,), the nearest to c (nv,)."""
        J, across, _ = self._rows(q)
        allowed: Array = c - across @ (J @ c)
        return allowed

    def nearest(self, q: Array) -> Array:
        """Position (nq,) at which the chains are closed, near q (nq,); nearer to it, at least, where q is far off."""
        found = q.copy()
        _, across, r = self._rows(found)
        for _ in range(_STEPS):
            closer = found.copy()
            mujoco.mj_integratePos(self._model, closer, -(across @ r), 1.0)
            _, across, left = self._rows(closer)
            if not left @ left < r @ r:
                break
            found, r = closer, left
        return found

    def _rows(self, q: Array) -> tuple[Array, Array, Array]:
        """J (m, nv), J^+ (nv, m) and r (m,) at q (nq,)."""
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:] = q, 0.0
        mujoco.mj_fwdPosition(model, data)
        m, n = int(data.ne), model.nv
        J, r = data.efc_J[: m * n].reshape(m, n).copy(), data.efc_pos[:m].copy()
        return J, J.T @ np.linalg.pinv(J @ J.T, rcond=_DEPENDENT, hermitian=True), r
