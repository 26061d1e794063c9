"""Step of a mechanism with all forces, implicit in the velocity: MuJoCo's integrator, on separate memory.

    (M - h dF/dv) (v^+ - v) = h F(q, v, u) + h M delta,        q^+ = q + h v^+,

F being actuators, springs, dampers, the drag of a medium and gravity, and the forces of the constraints: contacts,
limits, friction loss and equalities. It is stable for any damping and any gain of a servo. delta is an acceleration
that the model lacks. Where the model is integrated by RK4, whose positions are of a higher order, q^+ is instead
q + h (v + v^+) / 2.
"""

from __future__ import annotations

import math

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.geometry import evaluated, mass_matrix

_STIFF = 0.05
_FASTEST = 1e9  # [rad/s, m/s] beyond which there is no step: MuJoCo's own limit is 1e10


class ImplicitStep:
    """Implicit step of a model; what it returns depends on its arguments only."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = evaluated(model)
        self._mean_velocity = int(model.opt.integrator) == int(mujoco.mjtIntegrator.mjINT_RK4)
        self._longest = float(model.opt.timestep)  # [s]
        self._model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
        self._data = data = mujoco.MjData(self._model)
        self._qpos, self._qvel, self._ctrl = data.qpos, data.qvel, data.ctrl
        self._applied, self._warm_start = data.qfrc_applied, data.qacc_warmstart
        self.constraint_acceleration: Array = np.zeros(model.nv)
        """acceleration (nv,) [rad/s^2, m/s^2] by which the constraints acted in the last step"""
        self.touching = int(_may_touch(model) or bool(model.jnt_limited.any() or model.tendon_limited.any()))
        """number of constraints of contacts and limits in the last step; before the first, 1 if there may be any"""

    def __call__(self, q: Array, v: Array, u: Array, h: float, delta: Array | None = None) -> tuple[Array, Array]:
        """Return (q^+ (nq,), v^+ (nv,)) after h [s] with u (nu,) and delta (nv,) held, in steps of at most the model's.

        Raises FloatingPointError for a state that is not finite or faster than 1e9 rad/s.
        """
        count = max(1, math.ceil(h / self._longest - 1e-6))
        self._model.opt.timestep = h / count
        self._qpos[:], self._qvel[:], self._ctrl[:] = q, v, u
        for _ in range(count):
            self._step(h / count, delta)
        return self._qpos.copy(), self._qvel.copy()

    def _step(self, h: float, delta: Array | None) -> None:
        model, data = self._model, self._data
        if not (np.abs(self._qvel) < _FASTEST).all() or not np.isfinite(self._qpos).all():
            raise FloatingPointError(f"velocities of a mechanism = {self._qvel.tolist()}; allowed: below {_FASTEST:g}")
        before = (self._qpos.copy(), self._qvel.copy()) if self._mean_velocity else None
        mujoco.mj_fwdPosition(model, data)
        if delta is None:
            self._applied[:] = 0.0
        else:
            mujoco.mj_mulM(model, data, self._applied, delta)
        mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_fwdActuation(model, data)
        mujoco.mj_fwdAcceleration(model, data)
        self._warm_start[:] = 0.0
        mujoco.mj_fwdConstraint(model, data)
        self.constraint_acceleration, self.touching = data.qacc - data.qacc_smooth, data.nefc - data.ne - data.nf
        mujoco.mj_implicit(model, data)
        if before is not None:
            q, v = before
            mujoco.mj_integratePos(model, q, 0.5 * (v + self._qvel), h)
            self._qpos[:] = q


def needs_implicit_step(model: mujoco.MjModel) -> bool:
    """True if a model has forces for which their values at the ends of a step are not enough.

    These are servos, drag, damping that is stiff, d (M^-1)_jj h >= 0.05 at qpos0 in a joint j, and MuJoCo's
    constraints: limits, friction, contacts, equalities.
    """
    servo = model.actuator_biastype != int(mujoco.mjtBias.mjBIAS_NONE)
    acts = (
        servo, model.dof_dampingpoly, model.tendon_damping, model.tendon_dampingpoly,
        model.actuator_damping, model.actuator_dampingpoly, model.opt.density, model.opt.viscosity,
        model.jnt_limited, model.tendon_limited, model.dof_frictionloss, model.tendon_frictionloss, model.neq,
    )  # fmt: skip
    return any(bool(np.any(each)) for each in acts) or _may_touch(model) or _is_stiff(model)


def _is_stiff(model: mujoco.MjModel) -> bool:
    """True if the damping of a joint stops it within few steps; the mass matrix has to be positive definite."""
    M = mass_matrix(model, mujoco.MjData(model))
    decay = model.dof_damping * np.diag(np.linalg.inv(M)) * model.opt.timestep
    return bool((decay >= _STIFF).any())


def _may_touch(model: mujoco.MjModel) -> bool:
    """True if geoms of two bodies may be in contact."""
    if model.npair:
        return True
    collide = (model.geom_contype[:, None] & model.geom_conaffinity[None, :]) != 0
    apart = model.geom_bodyid[:, None] != model.geom_bodyid[None, :]
    joined = model.body_parentid[model.geom_bodyid][:, None] == model.geom_bodyid[None, :]
    world = model.geom_bodyid[None, :] == 0
    return bool((collide & apart & (~joined | world) & ~joined.T).any())
