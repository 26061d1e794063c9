"""Mechanisms as Euler-Lagrange systems (D.2.2): x' = v, D_t v = M^-1 (actuators + springs and dampers - gravity)."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence

import mujoco
import numpy as np

from mathnavi.interfaces.checks import check
from mathnavi.interfaces.errors import ArgumentError, FieldError
from mathnavi.interfaces.joint_states import HINGE, SLIDE, state_names
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.system import AffineInputLaw, integrate
from mathnavi.models.mechanism import forces
from mathnavi.models.mechanism.actuation import Actuation
from mathnavi.models.mechanism.floating_base import FloatingBase
from mathnavi.models.mechanism.geometry import MechanismManifold
from mathnavi.models.mechanism.implicit_step import ImplicitStep, needs_implicit_step

_FIXED, _UNBIASED = int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_NONE)
_AFFINE = int(mujoco.mjtGain.mjGAIN_AFFINE), int(mujoco.mjtBias.mjBIAS_AFFINE)
_JOINT_EQUALITY = int(mujoco.mjtEq.mjEQ_JOINT)
_JOINT = int(mujoco.mjtTrn.mjTRN_JOINT)


class MechanismSystem:
    """A ``LagrangianSystem`` of a model whose joints each move mass, with the state (qpos, qvel) and the input ctrl.

    Actuators are MuJoCo's, of any kind without an internal state, and act within their ranges of control and force;
    springs, dampers, tendons, gravity compensation and the drag of a medium are MuJoCo's too. ``force`` leaves out
    MuJoCo's constraints: contacts, limits of joints and tendons, friction loss and equalities. Where the model
    has any of these, servos, drag or stiff damping, ``implicit`` is true, and ``flow`` and ``step`` are MuJoCo's
    implicit step, with the forces of the constraints; see ``implicit_step``.

    Raises ValueError for what ``geometry.checked`` refuses, for actuators with a state, a delay or a plug-in, for
    flexible parts, and for a ``constant`` or ``amplitude`` that is not one finite number for each input; zero if not
    given.
    """

    def __init__(self, model: mujoco.MjModel, constant: Sequence[float] = (), amplitude: Sequence[float] = ()) -> None:
        self.manifold = MechanismManifold(model)
        wrong = {
            "actuators with a state": model.na > 0,
            "actuators with a delay": bool(np.any(model.actuator_delay)),
            "plug-ins": model.nplugin > 0,
            "flexible parts": model.nflex > 0,
        }
        if found := [what for what, is_so in wrong.items() if is_so]:
            raise ArgumentError(f"model = one with {', '.join(found)}; allowed: actuators without internal dynamics")
        self._model = copy.copy(model)
        self._data = mujoco.MjData(self._model)
        self._at = forces.actuated(self._model, self._data)
        self.states = state_names(model, range(model.njnt))
        self.inputs = tuple(_input_name(model, i) for i in range(model.nu))
        self.constant, self.amplitude = self._given("constant", constant), self._given("amplitude", amplitude)
        self.velocity_dependent = _depends_on_velocity(model)
        self.implicit = needs_implicit_step(model)
        self._step = ImplicitStep(model)
        # joints that follow others
        self.coupled = int((model.eq_type[model.eq_active0 > 0] == _JOINT_EQUALITY).sum())

    def __reduce__(self) -> tuple[type[MechanismSystem], tuple[mujoco.MjModel, tuple[float, ...], tuple[float, ...]]]:
        """Make a copy allocate its own memory: addresses are valid only as long as the object that they belong to."""
        return type(self), (self._model, self.constant, self.amplitude)

    def force(self, x: Array, v: Array, u: Array) -> Array:
        """Acceleration D_t v (nv,) [m/s^2, rad/s^2] at x (nq,), v (nv,) under the controls u (nu,)."""
        F: Array = forces.acceleration(self._at, x, v, u)
        return F

    def flow(self, state: Array, u: Array, h: float) -> Array:
        """State (nq + nv,) after h [s] from ``state`` with the controls u (nu,) held."""
        if not self.implicit:
            return integrate(self, state, u, h)
        n = self.manifold.size
        return np.concatenate(self._step(state[:n], state[n:], u, h))

    def step(self, x: Array, v: Array, u: Array, h: float, delta: Array | None = None) -> tuple[Array, Array]:
        """State x (nq,), v (nv,) after h [s] with u (nu,) and the missing acceleration delta (nv,) held.

        Raises FloatingPointError for a state that is not finite or faster than any mechanism.
        """
        return self._step(x, v, u, h, delta)

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
    link = int(model.jnt_bodyid[-1])
    other.body_mass[link] *= factor
    other.body_inertia[link] *= factor
    mujoco.mj_setConst(other, mujoco.MjData(other))
    return other


def _input_name(model: mujoco.MjModel, i: int) -> str:
    """Name of an input, with the unit of its force or torque for a motor of gain 1 on a joint, else without a unit."""
    name = model.actuator(i).name.partition("/")[2] or model.actuator(i).name or str(i)
    joint = int(model.actuator_trnid[i, 0])
    is_motor = (int(model.actuator_gaintype[i]), int(model.actuator_biastype[i])) == (_FIXED, _UNBIASED)
    strength = float(model.actuator_gainprm[i, 0]) * float(np.linalg.norm(model.actuator_gear[i]))
    if not is_motor or int(model.actuator_trntype[i]) != _JOINT or strength != 1.0:
        return f"{name} [-]"
    return f"{name} [{'N' if model.jnt_type[joint] == SLIDE else 'N m'}]"


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
