"""Parameters of a mechanism that its file may have wrong: gains, damping, friction and the last link's load.

With the position q, velocity v and acceleration a of the joints under the controls u, MuJoCo's inverse dynamics give
the torque that the model lacks, and what each parameter adds to it is linear,

    M a + c - passive - constraints - actuators  =  Phi(q, v, a, u) theta.

The columns of Phi (nv, p) are

    gain i       J_i' (g u_i + b_0 + b_1 l_i)       share of it, of a motor g u, of a servo k_p (u - l)
    rate gain i  J_i' b_2 l_i'                      share of it, of a servo - k_v l'
    damping j    - v_j                              [N m s/rad, N s/m], where no rate gain of joint j says the same
    friction j   - tanh(v_j / v_0)                  [N m, N]
    load         - (M a + c) of the last link       share of its mass and inertia

Nothing follows for a joint that an actuator moves whose force is near the end of its range: it may be at the end for a
part of the time over which a state is a mean. In a step of h the velocity is that at its end and the position that at
its start (``implicit_step``): at the position that is given, v is later by h / 2, and u is held from there on. In
contact, at limits and where chains are closed, both sides are projected onto the motions that these allow, along which
their forces do no work.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.closed_chains import closed_jacobian, common_joints, lengths_of, pseudoinverse
from mathnavi.models.mechanism.geometry import evaluated
from mathnavi.models.mechanism.implicit_step import ImplicitStep

Flags = NDArray[np.bool_]
_FIXED, _AFFINE_GAIN = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
_UNBIASED, _AFFINE_BIAS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
_FRICTION_ROWS = tuple(int(getattr(mujoco.mjtConstraint, f"mjCNSTR_FRICTION_{of}")) for of in ("DOF", "TENDON"))
_ON_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
_SHARE = 0.3  # standard deviation of a share before anything is known
_DAMPING, _FRICTION = 5.0, 1.0  # [1/s], [rad/s^2, m/s^2] times the inertia of a joint: those of damping and friction
_STANDING = 0.02  # [rad/s, m/s] v_0
_NEAR = 0.75  # of a force range
_DEPENDENT = 1e-6  # share below which a joint is not free
_BESIDE = 1e-3  # of its range, from a limit, within which a joint may touch it, by readings with errors
_NOTHING = 1e-12
_LEAST, _MOST = 0.1, 10.0  # of a nominal gain or load


class LackingTorque(NamedTuple):
    """Torque that a model lacks at one state, and what its parameters add to it."""

    torque: Array  # (nv,) [N m, N]
    effect: Array  # (nv, p) Phi
    share: Array  # (nv,) of each torque that says something: 0 where an actuator is near the end of its force


class MechanismParameters:
    """Parameters of a model of hinges and slides; it depends on its argument only."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._nominal, self._model = evaluated(model), evaluated(model)
        self._model.opt.jacobian = int(mujoco.mjtJacobian.mjJAC_DENSE)
        self._model.actuator_forcelimited[:] = 0
        self._model.jnt_actfrclimited[:] = 0
        self._model.jnt_margin[:] += _BESIDE * np.diff(model.jnt_range)[:, 0] * (model.jnt_limited != 0)
        self._data = mujoco.MjData(self._model)
        self._common = common_joints(model)
        self._link = int(model.jnt_bodyid[-1])
        self._load_model = evaluated(model)
        others = np.arange(model.nbody) != self._link
        self._load_model.body_mass[others] = 0.0
        self._load_model.body_inertia[others] = 0.0
        self._load_data = mujoco.MjData(self._load_model)
        known = np.isin(model.actuator_gaintype, (_FIXED, _AFFINE_GAIN)) & (model.actuator_ctrlnum == 1)
        known &= np.isin(model.actuator_biastype, (_UNBIASED, _AFFINE_BIAS)) & (model.actuator_actnum == 0)
        self._gains = np.flatnonzero(known & (model.actuator_gaintype == _FIXED))
        self._biased = model.actuator_biastype == _AFFINE_BIAS
        self._rate_gains = np.flatnonzero(known & self._biased & (model.actuator_biasprm[:, 2] != 0.0))
        on_joint = [i for i in self._rate_gains if int(model.actuator_trntype[i]) in _ON_JOINT]
        served = model.jnt_dofadr[model.actuator_trnid[on_joint, 0]] if on_joint else np.zeros(0, dtype=np.intp)
        self._damped = np.setdiff1d(np.arange(model.nv), served)
        inertia = model.dof_M0
        self.prior = np.concatenate([
            np.full(len(self._gains) + len(self._rate_gains), _SHARE),
            np.maximum(model.dof_damping, _DAMPING * inertia)[self._damped],
            np.maximum(model.dof_frictionloss, _FRICTION * inertia),
            [_SHARE],
        ])  # fmt: skip
        """standard deviations (p,) of the parameters before anything is known"""
        actuators = [model.actuator(i).name.rpartition("/")[2] or str(i) for i in range(model.nu)]
        joints = [model.joint(int(model.dof_jntid[j])).name.rpartition("/")[2] or str(j) for j in range(model.nv)]
        self.names = (
            *(f"gain of {actuators[i]}" for i in self._gains),
            *(f"rate gain of {actuators[i]}" for i in self._rate_gains),
            *(f"damping of {joints[j]}" for j in self._damped),
            *(f"friction of {joints[j]}" for j in range(model.nv)),
            "load",
        )
        """names (p,)"""
        mean_velocity = int(model.opt.integrator) == int(mujoco.mjtIntegrator.mjINT_RK4)
        self.delay = 0.0 if mean_velocity else 0.5 * float(model.opt.timestep)
        """time [s] from a position to the velocity and the middle of the input that go with it in a step"""

    def within(self, u: Array) -> Array:
        """Controls (nu,) within their ranges."""
        limited, (least, most) = self._model.actuator_ctrllimited != 0, self._model.actuator_ctrlrange.T
        clipped: Array = np.where(limited, np.clip(u, least, most), u)
        return clipped

    def lacking(self, q: Array, v: Array, a: Array, u: Array) -> LackingTorque:
        """Torque that the model lacks at q (nq,), v, a (nv,), with u (nu,) of ``delay`` later."""
        model, data = self._model, self._data
        v = v + self.delay * a
        data.qpos[:], data.qvel[:], data.qacc[:], data.ctrl[:] = q, v, a, u
        mujoco.mj_inverse(model, data)
        mujoco.mj_fwdActuation(model, data)
        moment = np.zeros((model.nu, model.nv))
        mujoco.mju_sparse2dense(
            moment, data.actuator_moment.ravel(), data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
        clear = self._clear(moment, data.qfrc_inverse)
        torque, effect = data.qfrc_inverse - data.qfrc_actuator, self._effect(moment, (q, v, a, u))
        holds = np.flatnonzero(~np.isin(data.efc_type[: data.nefc], _FRICTION_ROWS))
        if not len(holds):
            return LackingTorque(torque, effect, clear.astype(np.float64))
        J, of = data.efc_J[: data.nefc * model.nv].reshape(data.nefc, model.nv).copy(), data.efc_id[: data.nefc]
        equal, m = slice(0, data.ne), data.ne  # equalities come first
        J[equal] = closed_jacobian(J[equal], of[equal], self._common)
        J[equal] /= lengths_of(J[equal], of[equal])[:, np.newaxis]
        J[m:] /= np.maximum(np.linalg.norm(J[m:], axis=1), _NOTHING)[:, np.newaxis]
        J = J[holds]
        T = np.eye(model.nv) - pseudoinverse(J) @ J
        share = np.diag(T)
        return LackingTorque(T @ torque, T @ effect, np.where(share > _DEPENDENT, share * clear, 0.0))

    def _clear(self, moment: Array, torque: Array) -> Flags:
        """True (nv,) for a joint unless, by the ``torque`` (nv,) that moves the mechanism, an actuator acts on it whose
        force is near the end of its range.
        """
        nominal = self._nominal
        force = moment @ torque / np.maximum(np.square(moment).sum(axis=1), _NOTHING)
        least, most = _NEAR * nominal.actuator_forcerange.T
        near = (nominal.actuator_forcelimited != 0) & ((force <= least) | (force >= most))
        least, most = _NEAR * nominal.jnt_actfrcrange[nominal.dof_jntid].T
        at_joint = (nominal.jnt_actfrclimited[nominal.dof_jntid] != 0) & ((torque <= least) | (torque >= most))
        clear: Flags = ~(moment[near] != 0.0).any(axis=0) & ~at_joint
        return clear

    def _effect(self, moment: Array, at: tuple[Array, Array, Array, Array]) -> Array:
        model, data, (q, v, a, u) = self._model, self._data, at
        bias = model.actuator_biasprm[:, :3] * self._biased[:, np.newaxis]
        static = model.actuator_gainprm[:, 0] * self.within(u) + bias[:, 0] + bias[:, 1] * data.actuator_length
        rate = bias[:, 2] * data.actuator_velocity
        return np.column_stack([
            (moment * static[:, np.newaxis])[self._gains].T,
            (moment * rate[:, np.newaxis])[self._rate_gains].T,
            -np.diag(v)[:, self._damped],
            -np.diag(np.tanh(v / _STANDING)),
            -self._of_load(q, v, a),
        ])  # fmt: skip

    def _of_load(self, q: Array, v: Array, a: Array) -> Array:
        """Torque (nv,) that moves and carries the last link alone."""
        model, data = self._load_model, self._load_data
        data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        torque = np.zeros(model.nv)
        mujoco.mj_rne(model, data, 1, torque)
        return torque

    def applied(self, theta: Array) -> ImplicitStep:
        """Return the step of the model with theta (p,); gains and the load are a tenth to ten times the nominal."""
        model, first = copy.copy(self._nominal), 0

        def part(count: int) -> Array:
            nonlocal first
            first += count
            return theta[first - count : first]

        gain = np.clip(1.0 + part(len(self._gains)), _LEAST, _MOST)
        model.actuator_gainprm[self._gains, 0] *= gain
        model.actuator_biasprm[self._gains, :2] *= gain[:, np.newaxis]
        model.actuator_biasprm[self._rate_gains, 2] *= np.clip(1.0 + part(len(self._rate_gains)), _LEAST, _MOST)
        model.dof_damping[self._damped] = np.maximum(model.dof_damping[self._damped] + part(len(self._damped)), 0.0)
        model.dof_frictionloss[:] = np.maximum(model.dof_frictionloss + part(model.nv), 0.0)
        load = float(np.clip(1.0 + part(1)[0], _LEAST, _MOST))
        model.body_mass[self._link] *= load
        model.body_inertia[self._link] *= load
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return ImplicitStep(model)
