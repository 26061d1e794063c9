"""Actuators of a mechanism by their own transmission and bias: the acceleration as an affine function of the controls.

    D_t v = M^-1 (passive - gravity + J' b) + M^-1 J' diag(g) u,        f_i = g_i u_i + b_i,

J (nu, nv) being the moments of the transmissions, and g and b MuJoCo's gain and bias at the length and velocity of each
actuator: of a position servo g = k_p and b = -k_p l - k_v l'. Ranges are left out: a servo far from its set point is
saturated, and a probe of its control would find no effect.
"""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.system import AffineInputs
from mathnavi.models.mechanism import forces

_FIXED, _AFFINE = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtGain.mjGAIN_AFFINE)
_NONE, _AFFINE_BIAS = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)


class Actuation:
    """The affine inputs of a model; FieldError for muscles and actuators with a user-defined law."""

    def __init__(self, model: mujoco.MjModel) -> None:
        known = np.isin(model.actuator_gaintype, (_FIXED, _AFFINE)) & np.isin(
            model.actuator_biastype, (_NONE, _AFFINE_BIAS)
        )
        if not known.all():
            names = [model.actuator(int(i)).name or str(i) for i in np.flatnonzero(~known)]
            raise FieldError(f"actuators = {', '.join(names)}; allowed for tracking: fixed or affine laws")
        self._model = copy.copy(model)
        self._model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
        self._data = mujoco.MjData(self._model)
        self._at = forces.actuated(self._model, self._data)
        self._none = np.zeros(model.nu)
        self._range = np.where(model.actuator_ctrllimited[:, None], model.actuator_ctrlrange, (-np.inf, np.inf)).T
        self._gain = model.actuator_gainprm[:, :3] * np.array([1.0, 0.0, 0.0])
        self._gain[model.actuator_gaintype == _AFFINE] = model.actuator_gainprm[model.actuator_gaintype == _AFFINE, :3]
        self._bias = model.actuator_biasprm[:, :3] * (model.actuator_biastype == _AFFINE_BIAS)[:, None]

    def __call__(self, x: Array, v: Array) -> AffineInputs:
        """Return the affine inputs at x (nq,), v (nv,)."""
        model, data = self._model, self._data
        without = forces.acceleration(self._at, x, v, self._none)
        moment, solved = np.zeros((model.nu, model.nv)), np.zeros((model.nu, model.nv))
        mujoco.mju_sparse2dense(
            moment, data.actuator_moment.ravel(), data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
        mujoco.mj_solveM(model, data, solved, moment)
        state = np.stack([np.ones(model.nu), data.actuator_length, moment @ v])
        gain, bias = (self._gain * state.T).sum(axis=1), (self._bias * state.T).sum(axis=1)
        return AffineInputs(without + solved.T @ bias, solved.T * gain, *self._range)
