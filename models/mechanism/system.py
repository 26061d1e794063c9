"""Mechanisms as Euler-Lagrange systems (D.2.2): x' = v, D_t v = M^-1 (actuators + springs and dampers - gravity).

**Actuators** by their own transmission and bias give the acceleration as an affine function of the controls:

    D_t v = M^-1 (passive - gravity + J' b) + M^-1 J' diag(g) u,        f_i = g_i u_i + b_i,

J (nu, nv) being the moments of the transmissions, and g and b MuJoCo's gain and bias at the length and velocity of each
actuator: of a position servo g = k_p and b = -k_p l - k_v l'. Ranges are left out: a servo far from its set point is
saturated, and a probe of its control would find no effect.

Steps are those of ``implicit_step``, where forces at the ends of a step are not enough.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

import mujoco
import numpy as np

from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.joint_states import HINGE, SLIDE, state_names
from mathnavi.interfaces.model_signals import input_names
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.system import (
    MODEL_FREE_ESTIMATORS,
    AffineInputLaw,
    AffineInputs,
    integrate,
    require_modelled,
)
from mathnavi.models.mechanism import forces
from mathnavi.models.mechanism.closed_chains import ClosedChains
from mathnavi.models.mechanism.floating_base import FloatingBase
from mathnavi.models.mechanism.geometry import MechanismManifold, evaluated
from mathnavi.models.mechanism.implicit_step import ImplicitStep, needs_implicit_step
from mathnavi.models.mechanism.parameters import MechanismParameters

_NAMED = 4  # actuators in a message
_FIXED, _UNBIASED = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_NONE)
_AFFINE = int(mujoco.mjtGain.mjGAIN_AFFINE), int(mujoco.mjtBias.mjBIAS_AFFINE)
_JOINT_EQUALITY = int(mujoco.mjtEq.mjEQ_JOINT)


class MechanismSystem:
    """A ``LagrangianSystem`` of a model whose joints each move mass, with the state (qpos, qvel) and the input ctrl.

    Actuators are MuJoCo's and act within their ranges of control and force; springs, dampers, tendons, gravity
    compensation and the drag of a medium are MuJoCo's too. Of actuators with their own states or a delay, as muscles
    and filters are, nothing but the names is known here (``unmodelled``), and there is no force. ``force`` leaves out
    MuJoCo's constraints: contacts, limits of joints and tendons, friction loss and equalities. Where the model
    has any of these, servos, drag or stiff damping, ``implicit`` is true, and ``flow`` and ``step`` are MuJoCo's
    implicit step, with the forces of the constraints. ``closure`` projects onto what closed chains allow; None without.

    Raises ValueError for what ``geometry.checked`` refuses, for plug-ins, for flexible parts, and for a ``constant`` or
    ``amplitude`` that is not one finite number for each input. If not given, ``constant`` is the control of the model's
    first keyframe, without one zero, and ``amplitude`` is zero.
    """

    def __init__(self, model: mujoco.MjModel, constant: Sequence[float] = (), amplitude: Sequence[float] = ()) -> None:
        self.manifold = MechanismManifold(model)
        wrong = {"plug-ins": model.nplugin > 0, "flexible parts": model.nflex > 0}
        if found := [what for what, is_so in wrong.items() if is_so]:
            raise ArgumentError(f"model = one with {', '.join(found)}; allowed: rigid bodies and MuJoCo's own elements")
        self.unmodelled = _actuators_with_states(model)
        self._model = evaluated(model)
        self._data = mujoco.MjData(self._model)
        self._at = forces.actuated(self._model, self._data)
        self.states = state_names(model, range(model.njnt))
        self.inputs = tuple(name for i in range(model.nactuator) for name in input_names(model, i))
        given = constant if len(constant) or not model.nkey else model.key_ctrl[0].tolist()
        self.constant, self.amplitude = self._given("constant", given), self._given("amplitude", amplitude)
        self.velocity_dependent = _depends_on_velocity(model)
        self.implicit = needs_implicit_step(model)
        self._step = ImplicitStep(model)
        self.closure = ClosedChains.of(self._model)
        # joints that follow others
        self.coupled = int((model.eq_type[model.eq_active0 > 0] == _JOINT_EQUALITY).sum())

    def __reduce__(self) -> tuple[type[MechanismSystem], tuple[mujoco.MjModel, tuple[float, ...], tuple[float, ...]]]:
        """Make a copy allocate its own memory: addresses are valid only as long as the object that they belong to."""
        return type(self), (self._model, self.constant, self.amplitude)

    def force(self, x: Array, v: Array, u: Array) -> Array:
        """Acceleration D_t v (nv,) [m/s^2, rad/s^2] at x (nq,), v (nv,) under the controls u (nu,).

        Raises FieldError, as ``flow`` and ``step`` do, for a system that is not modelled whole.
        """
        self._require_modelled()
        F: Array = forces.acceleration(self._at, x, v, u)
        return F

    def flow(self, state: Array, u: Array, h: float) -> Array:
        """State (nq + nv,) after h [s] from ``state`` with the controls u (nu,) held."""
        self._require_modelled()
        if not self.implicit:
            return integrate(self, state, u, h)
        n = self.manifold.size
        return np.concatenate(self._step(state[:n], state[n:], u, h))

    def step(self, x: Array, v: Array, u: Array, h: float, delta: Array | None = None) -> tuple[Array, Array]:
        """State x (nq,), v (nv,) after h [s] with u (nu,) and the missing acceleration delta (nv,) held.

        Raises FloatingPointError for a state that is not finite or faster than any mechanism.
        """
        self._require_modelled()
        return self._step(x, v, u, h, delta)

    @property
    def constraint_acceleration(self) -> Array:
        """Acceleration (nv,) [rad/s^2, m/s^2] by which constraints, such as contacts, acted in the last step."""
        return self._step.constraint_acceleration

    @property
    def touching(self) -> int:
        """Number of constraints of contacts and limits in the last step; before the first, 1 if there may be any."""
        return self._step.touching

    def parameters(self) -> MechanismParameters | None:
        """Parameters that the file may have wrong; None where they cannot be learned.

        That is so with ball joints or a free base, and where the system is not stepped by its own steps or not modelled
        whole.
        """
        if not self.implicit or self.manifold.quaternions or self.unmodelled:
            return None
        return MechanismParameters(self._model)

    def _require_modelled(self) -> None:
        if self.unmodelled:
            require_modelled(self, "model of a mechanism", MODEL_FREE_ESTIMATORS)

    @property
    def joint_ranges(self) -> Array:
        """Least and greatest positions (2, nq) [m, rad] within the joints' limits; infinite without a limit."""
        ranges = np.tile([[-np.inf], [np.inf]], (1, self.manifold.size))
        for j in np.flatnonzero(self._model.jnt_limited):
            if self._model.jnt_type[j] in (SLIDE, HINGE):
                ranges[:, self._model.jnt_qposadr[j]] = self._model.jnt_range[j]
        return ranges

    @property
    def floating_base(self) -> FloatingBase:
        """Floating base with its IMU. Raises FieldError for a model without one."""
        return FloatingBase.from_model(self._model)

    def affine_inputs(self) -> AffineInputLaw | None:
        """Inputs by the actuators' transmission and bias; None where all are motors, whose controls are forces.

        Raises FieldError for muscles and actuators with a user-defined law.
        """
        motors = (self._model.actuator_biastype == _UNBIASED) & (self._model.actuator_gaintype == _FIXED)
        return None if motors.all() else Actuation(self._model)

    def _given(self, name: str, values: Sequence[float]) -> tuple[float, ...]:
        n = len(self.inputs)
        if len(values) not in (0, n) or not all(map(math.isfinite, values)):
            raise FieldError(f"{name} = {tuple(values)!r}; allowed: {n} finite numbers, of {', '.join(self.inputs)}")
        return tuple(map(float, values)) or (0.0,) * n


def heavier(model: mujoco.MjModel, factor: float) -> mujoco.MjModel:
    """Copy a model, the mass and inertia of the body on its last joint times ``factor`` > 0: a load, or an error."""
    check(factor, "factor", 0.0, open_low=True)
    other = copy.copy(model)
    if factor == 1.0:  # what follows from the masses is computed anew below, and not all of it has to be: meaninertia
        return other
    link = int(model.jnt_bodyid[-1])
    other.body_mass[link] *= factor
    other.body_inertia[link] *= factor
    mujoco.mj_setConst(other, mujoco.MjData(other))
    return other


def _actuators_with_states(model: mujoco.MjModel) -> str:
    """Actuators whose force does not follow from position, velocity and control, in words; "" if nothing does."""
    found = np.flatnonzero((model.actuator_actnum > 0) | (model.actuator_delay > 0.0)).tolist()
    names = [model.actuator(i).name.partition("/")[2] or model.actuator(i).name or str(i) for i in found[:_NAMED]]
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return f"states or delays of the actuators {', '.join(names)}{more}" if found else ""


def _depends_on_velocity(model: mujoco.MjModel) -> bool:
    """True if any force may depend on the velocity."""
    gain, bias = model.actuator_gaintype == _AFFINE[0], model.actuator_biastype == _AFFINE[1]
    known = (gain | (model.actuator_gaintype == _FIXED)) & (bias | (model.actuator_biastype == _UNBIASED))
    coefficients = (
        model.dof_damping, model.dof_dampingpoly, model.tendon_damping, model.tendon_dampingpoly,
        model.actuator_damping, model.actuator_dampingpoly, model.opt.density, model.opt.viscosity,
        gain * model.actuator_gainprm[:, 2], bias * model.actuator_biasprm[:, 2],
    )  # fmt: skip
    return not known.all() or any(bool(np.any(each)) for each in coefficients)


class Actuation:
    """The affine inputs of a model; FieldError for muscles and actuators with a user-defined law."""

    def __init__(self, model: mujoco.MjModel) -> None:
        known = np.isin(model.actuator_gaintype, (_FIXED, _AFFINE[0]))
        known &= np.isin(model.actuator_biastype, (_UNBIASED, _AFFINE[1])) & (model.actuator_ctrlnum == 1)
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
        affine = model.actuator_gaintype == _AFFINE[0]
        self._gain[affine] = model.actuator_gainprm[affine, :3]
        self._bias = model.actuator_biasprm[:, :3] * (model.actuator_biastype == _AFFINE[1])[:, None]

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
