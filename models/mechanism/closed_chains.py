"""Closed kinematic chains: equality constraints between the bodies, joints or tendons of one mechanism.

Where the chains are closed, r(q) = 0, velocities satisfy J v = 0, J = dr/dq. MuJoCo closes them by forces that are
stiff and not rigid: a position that is off by the noise of encoders is a spring that is wound, and the velocities that
it causes are those of no motion. What is read is therefore projected onto what the chains allow,

    tangent    c - J^+ J c    of a displacement or a velocity c,
    nearest    q - J^+ r      of a position q, a few times, while r becomes smaller,

where ^+ is the pseudoinverse: of a planar linkage, a third of the rows says nothing. The metric is that of the
encoders, which err alike, and not that of the masses: by it, the error of a heavy link would move the light ones.

**J is that of a chain that is closed.** MuJoCo takes the two points that a connection joins each where it is. While
they are r apart, a joint on which both of them ride, as those of an arm that carries a gripper, turns r, and so has an
entry of about |r| in J, in the directions too in which a planar linkage has no other: a row of J that says nothing but
that the arm stands. Where the chain is closed these entries are none, and they are left out.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.mechanism.geometry import evaluated

Flags = NDArray[np.bool_]

_CLOSING = tuple(int(getattr(mujoco.mjtEq, f"mjEQ_{kind}")) for kind in ("CONNECT", "WELD", "JOINT", "TENDON"))
_STEPS = 6  # of ``nearest``
_AT_BODIES = tuple(int(getattr(mujoco.mjtEq, f"mjEQ_{kind}")) for kind in ("CONNECT", "WELD"))
_SITE = int(mujoco.mjtObj.mjOBJ_SITE)
_DEPENDENT = 1e-6
"""share of the greatest eigenvalue of J J', of rows of length 1, below which rows say nothing: axes of files and chains
that are a bit open are off by less than a thousandth"""


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
        self._common = common_joints(model)

    @staticmethod
    def of(model: mujoco.MjModel) -> ClosedChains | None:
        """The closed chains of a model; None where it has none."""
        closing = np.isin(model.eq_type, _CLOSING) & (model.eq_active0 > 0)
        switched_off = model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_EQUALITY)
        return None if switched_off or not closing.any() else ClosedChains(model)

    def tangent(self, q: Array, c: Array) -> Array:
        """Displacement or velocity (nv,) that the chains allow at q (nq,), the nearest to c (nv,), or those (nv, k)
        that are the nearest to the columns of c (nv, k).
        """
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
        of = data.efc_id[:m]
        J = closed_jacobian(data.efc_J[: m * n].reshape(m, n), of, self._common)
        scale = lengths_of(J, of)
        J, r = J / scale[:, np.newaxis], data.efc_pos[:m] / scale
        return J, pseudoinverse(J), r


def common_joints(model: mujoco.MjModel) -> Flags:
    """True (neq, nv) for degrees of freedom on which both of the points ride that an equality connects or welds."""
    moves = np.zeros((model.nbody, model.nv), dtype=np.bool_)
    for body in range(1, model.nbody):  # parents come first
        moves[body] = moves[model.body_parentid[body]]
        first = int(model.body_dofadr[body])
        moves[body, first : first + int(model.body_dofnum[body])] = True
    common = np.zeros((model.neq, model.nv), dtype=np.bool_)
    for i in np.flatnonzero(np.isin(model.eq_type, _AT_BODIES)):
        ends = [int(model.eq_obj1id[i]), int(model.eq_obj2id[i])]
        one, other = (int(model.site_bodyid[end]) for end in ends) if model.eq_objtype[i] == _SITE else ends
        common[i] = moves[one] & moves[other]
    return common


def closed_jacobian(J: Array, of: Integers, common: Flags) -> Array:
    """J (m, nv) of equalities ``of`` (m,), without the entries that they have only as long as they are not closed;
    ``common`` (neq, nv) are those of ``common_joints``.
    """
    closed: Array = np.where(common[of], 0.0, J)
    return closed


def lengths_of(J: Array, of: Integers) -> Array:
    """Lengths (m,) of the longest row of J (m, nv) of each row's equality ``of`` (m,); 1 where all are zero.

    By them metres and radians are compared, and a row that says nothing beside the others of its equality stays short.
    """
    lengths = np.linalg.norm(J, axis=1)
    longest = np.zeros(int(of.max(initial=-1)) + 1)
    np.maximum.at(longest, of, lengths)
    found: Array = np.where(longest[of] > 0.0, longest[of], 1.0)
    return found


def pseudoinverse(J: Array) -> Array:
    """J^+ (nv, m) of J (m, nv) without what rows repeat."""
    across: Array = J.T @ np.linalg.pinv(J @ J.T, rcond=_DEPENDENT, hermitian=True)
    return across
