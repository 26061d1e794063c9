"""The configurations of a mechanism that MuJoCo can load, with its mass matrix as the metric: g = M(q).

A point is qpos (nq,), a tangent vector a qvel (nv,): rates of slides [m/s] and hinges [rad/s], and of a ball joint, the
position of which is a unit quaternion, the rate [rad/s] in the frame of the body it carries; a free joint is three
slides along the axes of the world and a ball. Only inverse dynamics is needed from MuJoCo (``kernels``): no derivative
of M is needed for the Levi-Civita connection. The thesis leaves open how to go on where no closed form is known (D.6);
here, with d = q - p in the joints,

    exp_p w, log_p q    err by O(|w|^4), O(|d|^4)
    transport           errs by O(|d|^3), and keeps the length to rounding
    curvature           is that of central differences

in the joints' units. Where these series do not converge, for a reading that jumps by radians, exp and log are held:
they differ from w, or d, by at most half of its length, by M at a third of the way.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.joint_states import BALL, FREE, HINGE, SLIDE, quaternions, with_unit_quaternions
from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism import kernels

_SHORTEST = 1e-6  # [s] timestep
_SINGULAR = 1e-12  # least eigenvalue of M, of the greatest, with its diagonal scaled to 1


@dataclass(frozen=True)
class ScalarJoint:
    """Slide or hinge of a mechanism; a free joint has three slides."""

    name: str
    place: int  # in a point
    coordinate: int  # in a tangent vector
    hinge: bool
    low: float  # [rad, m] of its limits, infinite without
    high: float  # [rad, m]


class MechanismManifold:
    """A ``Manifold``. All but the inertia of a model, for instance gravity, does not matter here.

    The angles of hinges are not wrapped: a turn leads to another point. Raises ValueError for a model that is not a
    mechanism, see ``checked``.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = checked(model)
        self._model.opt.gravity[:] = 0.0
        self._data = mujoco.MjData(self._model)
        joints = range(model.njnt)
        rates = {BALL: 0, FREE: 3}  # velocities of a joint before those of its attitude
        balls = [int(model.jnt_dofadr[j]) + rates[int(model.jnt_type[j])] for j in joints if model.jnt_type[j] in rates]
        self.quaternions = quaternions(model, joints)
        """places of the quaternions in a point"""
        self.turns = tuple(balls)
        """first of the three components of the rate of each quaternion's attitude"""
        data = self._data
        self._at = kernels.Mechanism(
            kernels.address(self._model), kernels.address(data), data.qpos, data.qvel, np.array(balls, dtype=np.int64)
        )
        M = mass_matrix(self._model, data)
        data.qpos[:] = np.nan  # so that the factors of M are computed before the first use
        self.size, self.vector_size, self.dimension = model.nq, model.nv, model.nv
        names = [model.joint(j).name or str(j) for j in joints]
        self.name = f"the mechanism of the joints {', '.join(names)}"
        self.injectivity_radius = _half_turn(M, balls)
        self.scalars = tuple(each for j in joints for each in _scalars(model, j))
        """slides and hinges, those of free joints too"""
        self.hinges = tuple((each.place, each.low, each.high) for each in self.scalars if each.hinge)
        """place in a point, and limits [rad], of each hinge"""
        starts = [int(model.jnt_dofadr[j]) + k for j in joints for k in ((0, 3) if model.jnt_type[j] == FREE else (0,))]
        self.rate_starts = np.array(starts, dtype=np.intp)
        """first component of each joint's rate; a free joint has one in metres and one in radians"""
        self._slides = np.array([each.place for each in self.scalars if not each.hinge], dtype=np.intp)

    def __reduce__(self) -> tuple[type[MechanismManifold], tuple[mujoco.MjModel]]:
        """Make a copy allocate its own memory: addresses are valid only as long as the object that they belong to."""
        return type(self), (self._model,)

    @property
    def kappa(self) -> None:
        """None: the curvature is not the same everywhere."""

    @property
    def origin(self) -> Array:
        """Reference configuration (nq,) of the model: that of its first keyframe, or qpos0."""
        model = self._model
        return np.array(model.key_qpos[0] if model.nkey else model.qpos0, dtype=np.float64)

    def check(self, p: Array) -> Array:
        """Return p (nq,) with its quaternions normalised.

        Raises ArgumentError for another shape, and for numbers that are not finite or not a unit quaternion.
        """
        point = np.asarray(p, dtype=np.float64)
        if point.shape != (self.size,) or not np.isfinite(point).all():
            raise ArgumentError(f"point = {point.tolist()}; allowed on {self.name}: {self.size} finite numbers")
        return with_unit_quaternions(np.ascontiguousarray(point), self.quaternions, "point")

    def exp(self, p: Array, w: Array) -> Array:
        """exp_p w (nq,) of w (nv,) at p (nq,), to the fourth order in w; see ``kernels.exponential``."""
        q: Array = kernels.exponential(self._at, p, w)
        return q

    def log(self, p: Array, q: Array) -> Array:
        """log_p q (nv,) of q (nq,) at p (nq,), to the fourth order in q - p.

        Of ball joints half a turn apart, either of the two equally short ways is taken.
        """
        w: Array = kernels.logarithm(self._at, p, q)
        return w

    def distance(self, p: Array, q: Array) -> float:
        """Length of log_p q of p, q (nq,)."""
        return self.norm(p, self.log(p, q))

    def norm(self, p: Array, w: Array) -> float:
        """|w|_g = sqrt(w' M w) of w (nv,) at p (nq,)."""
        return float(kernels.norm_at(self._at, p, w))

    def transport(self, p: Array, q: Array, w: Array) -> Array:
        """Parallel transport (nv,) of w (nv,) from p (nq,) to q (nq,); it keeps the length."""
        parallel: Array = kernels.transport(self._at, p, q, w)
        return parallel

    def curvature(self, p: Array, eta: Array, G: Array) -> Array:
        """R(eta, G) eta (nv,) of eta, G (nv,) at p (nq,), by central differences."""
        R: Array = kernels.curvature(self._at, p, eta, G)
        return R

    def christoffel(self, p: Array, u: Array, w: Array) -> Array:
        """Gamma(u, w) (nv,) at p (nq,): nabla_u w of fields with constant components u, w (nv,)."""
        kernels.locate(self._at, p)
        G: Array = kernels.connection(self._at, u, w)
        return G

    def mass(self, p: Array) -> Array:
        """Mass matrix M (nv, nv) at p (nq,)."""
        kernels.locate(self._at, p)
        M = np.empty((self.dimension, self.dimension))
        mujoco.mj_fullM(self._model, self._data, M)
        return M

    def coordinates(self, p: Array, q: Array) -> Array:
        """Displacement of the joints (nv,) [m, rad] from p (nq,) to q (nq,); a rotation vector for a ball joint."""
        d: Array = kernels.difference(self._at, p, q)
        return d

    def point(self, p: Array, c: Array) -> Array:
        """Configuration (nq,) after a displacement c (nv,) [m, rad] of the joints from p (nq,)."""
        q: Array = kernels.integrate(self._at, p, c, 1.0)
        return q

    def components(self, p: Array, w: Array) -> Array:
        """Copy of the joint rates w (nv,), which are their own components."""
        return w.copy()

    def vector(self, p: Array, c: Array) -> Array:
        """Copy of the components c (nv,), which are the joint rates themselves."""
        return c.copy()

    def rounded(self, p: Array, bits: int) -> Array:
        """Round p (nq,) to 2 pi / 2^bits [rad] of a hinge and 1 / 2^bits [m] of a slide.

        The position of a free joint is read as of three slides; a quaternion has components of pi / 2^bits, a turn of
        2 pi / 2^bits [rad], and is brought to length 1 again.
        """
        if not bits:
            return p.copy()
        unit = np.full(self.size, 2.0 * math.pi / 2.0**bits)
        unit[self._slides] = 1.0 / 2.0**bits
        for each in self.quaternions:
            unit[each] *= 0.5
        q = unit * np.round(p / unit)
        for each in self.quaternions:
            q[each] /= np.linalg.norm(q[each])
        return q


def checked(model: mujoco.MjModel) -> mujoco.MjModel:
    """Return a copy of a model of slides, hinges, balls and free joints.

    Raises ArgumentError for a timestep below 1e-6 s, and otherwise names all that is not allowed: no joints, armature
    that depends on the configuration (of tendons, or of actuators that move anything but a slide or a hinge), or a mass
    matrix that is not positive definite at qpos0. Equality constraints are forces, not part of the metric.
    """
    if not model.opt.timestep >= _SHORTEST:
        raise ArgumentError(f"timestep of the model = {model.opt.timestep:g} s; allowed: at least {_SHORTEST:g} s")
    single = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    geared = [
        i
        for i in np.flatnonzero(model.actuator_armature).tolist()
        if int(model.actuator_trntype[i]) not in single or model.jnt_type[model.actuator_trnid[i, 0]] == BALL
    ]
    wrong = {
        "no joints": model.njnt == 0,
        "armature of tendons": bool(np.any(model.tendon_armature)),
        "armature of actuators that do not move one slide or hinge": bool(geared),
    }
    found = [what for what, is_so in wrong.items() if is_so]
    if not found and not _is_positive(mass_matrix(model, mujoco.MjData(model))):
        found = ["a mass matrix that is not positive definite at qpos0"]
    if found:
        raise ArgumentError(f"model = one with {', '.join(found)}; allowed: joints, each of which moves mass")
    return evaluated(model)


def evaluated(model: mujoco.MjModel) -> mujoco.MjModel:
    """Copy of a model to evaluate anywhere: no tree of bodies sleeps in it, as it might where the file allows that."""
    other = copy.copy(model)
    other.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return other


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> Array:
    """M (nv, nv) at data.qpos, by the bindings."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_makeM(model, data)
    M = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    return M


def _scalars(model: mujoco.MjModel, j: int) -> list[ScalarJoint]:
    kind, name = int(model.jnt_type[j]), model.joint(j).name.rpartition("/")[2] or str(j)
    place, coordinate = int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])
    if kind == FREE:
        ends = (-math.inf, math.inf)
        return [ScalarJoint(f"{name}_{axis}", place + k, coordinate + k, False, *ends) for k, axis in enumerate("xyz")]
    low, high = model.jnt_range[j].tolist() if model.jnt_limited[j] else (-math.inf, math.inf)
    return [ScalarJoint(name, place, coordinate, kind == HINGE, low, high)] if kind in (SLIDE, HINGE) else []


def _is_positive(M: Array) -> bool:
    scale = np.sqrt(np.diag(M))
    if not (np.isfinite(M).all() and (scale > 0.0).all()):
        return False
    return bool(np.linalg.eigvalsh(M / np.outer(scale, scale))[0] > _SINGULAR)


def _half_turn(M: Array, balls: Sequence[int]) -> float:
    """The length of half a turn of the ball joint that turns most easily, by M at qpos0; without one, infinite.

    It is compared with the distance over all joints, and M differs from that at qpos0: a guard, not a bound.
    """
    inverse = np.linalg.inv(M)
    softest = [np.linalg.eigvalsh(inverse[k : k + 3, k : k + 3])[-1] for k in balls]
    return math.pi / math.sqrt(max(softest)) if softest else math.inf
