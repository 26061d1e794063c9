"""Attitudes as unit quaternions, their velocities as body rates: S^3 with two points to every rotation.

A body with the inertia I the same about every axis moves, without torque, along geodesics of

    |omega|_g = |omega| / 2,        q' = q (0, omega) / 2,

the round metric of the unit sphere, kappa = 1. q and -q are the same attitude: of the two the one nearer to the other
point counts, so that attitudes nearer than pi / 2, half a turn of the body, are joined by one shortest geodesic.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64

from mathnavi.interfaces.compiled import Signature, njit
from mathnavi.interfaces.joint_states import with_unit_quaternions
from mathnavi.interfaces.kernel_types import ONE
from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold import kernels
from mathnavi.models.manifold.constant_curvature import sphere
from mathnavi.models.manifold.kernels import distance, inner, project
from mathnavi.models.manifold.manifold import CutLocusError, unrounded

_S3 = sphere(3)
_ROUNDING = 1e-12  # of p'p that the sphere takes as it is
_OPPOSITE = 1e-12  # |<p, q>| of attitudes half a turn apart


@njit(cache=True, nogil=True)
def product(p: Array, q: Array) -> Array:
    """Quaternion product p q (4,) of p, q (4,), scalar first."""
    return np.array(
        [
            p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
            p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
            p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
            p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
        ]
    )


@njit(cache=True, nogil=True)
def ambient(p: Array, omega: Array) -> Array:
    """Rate q' = p (0, omega) / 2 (4,) of the quaternion p (4,) at the body rate omega (3,) [rad/s]."""
    return 0.5 * product(p, np.array([0.0, omega[0], omega[1], omega[2]]))


@njit(cache=True, nogil=True)
def body_rate(p: Array, w: Array) -> Array:
    """Body rate omega (3,) [rad/s] of a tangent vector w (4,) at p (4,)."""
    conjugate = np.array([p[0], -p[1], -p[2], -p[3]])
    return 2.0 * product(conjugate, w)[1:]


@njit(cache=True, nogil=True)
def nearer(p: Array, q: Array) -> Array:
    """The nearer to p (4,) of q (4,) and -q."""
    return q.copy() if p @ q >= 0.0 else -q


@njit(cache=True, nogil=True)
def _transported(p: Array, q: Array, omega: Array) -> Array:
    q = nearer(p, q)
    return body_rate(q, kernels.transport(1.0, p, q, ambient(p, omega)))


@njit(cache=True, nogil=True)
def _exponential(p: Array, omega: Array) -> Array:
    return kernels.exponential(1.0, p, ambient(p, omega))


@njit(cache=True, nogil=True)
def _logarithm(p: Array, q: Array) -> Array:
    return body_rate(p, kernels.logarithm(1.0, p, nearer(p, q)))


@njit(cache=True, nogil=True)
def _curvature(eta: Array, G: Array) -> Array:
    return 0.25 * kernels.curvature(1.0, eta, G)


class Attitude:
    """A ``Manifold``: points are unit quaternions (4,), vectors body rates (3,) [rad/s]."""

    name = "the attitudes"
    dimension = 3
    size = 4
    vector_size = 3
    kappa = 1.0
    injectivity_radius = 0.5 * math.pi
    quaternions = (slice(0, 4),)
    turns = (0,)

    @property
    def origin(self) -> Array:
        """Identity quaternion (1, 0, 0, 0) (4,)."""
        return np.array([1.0, 0.0, 0.0, 0.0])

    def check(self, p: Array) -> Array:
        """Return the unit quaternion p (4,), normalised.

        Raises ValueError if its length is off by more than rounding to few decimals.
        """
        point = np.asarray(p, dtype=np.float64)
        if point.shape == (4,) and np.isfinite(point).all() and not abs(point.dot(point) - 1.0) <= _ROUNDING:
            point = with_unit_quaternions(point, (slice(0, 4),), "point")
        return _S3.check(point)

    def exp(self, p: Array, w: Array) -> Array:
        """Attitude (4,) after 1 s at the constant body rate w (3,) [rad/s] from p (4,)."""
        q: Array = _exponential(p, w)
        return q

    def log(self, p: Array, q: Array) -> Array:
        """Rotation vector (3,) [rad] from p (4,) to q (4,), in the body frame of p.

        Raises CutLocusError half a turn apart.
        """
        self._require_unique(p, q)
        w: Array = _logarithm(p, q)
        return w

    def distance(self, p: Array, q: Array) -> float:
        """Half the angle [rad] between two attitudes p, q (4,)."""
        return float(kernels.distance(1.0, p, nearer(p, q)))

    def norm(self, p: Array, w: Array) -> float:
        """|w|_g = |w| / 2 of a body rate w (3,) [rad/s] at p (4,)."""
        return 0.5 * math.sqrt(w.dot(w))

    def transport(self, p: Array, q: Array, w: Array) -> Array:
        """Parallel transport of a body rate w (3,) [rad/s] from p (4,) to q (4,).

        Raises CutLocusError half a turn apart.
        """
        self._require_unique(p, q)
        moved: Array = _transported(p, q, w)
        return moved

    def curvature(self, p: Array, eta: Array, G: Array) -> Array:
        """R(eta, G) eta (3,) of body rates eta, G (3,) [rad/s] at p (4,)."""
        R: Array = _curvature(eta, G)
        return R

    def coordinates(self, p: Array, q: Array) -> Array:
        """Rotation vector (3,) [rad] from p (4,) to q (4,), in the body frame of p."""
        return self.log(p, q)

    def point(self, p: Array, c: Array) -> Array:
        """Attitude (4,) at the rotation vector c (3,) [rad] from p (4,)."""
        return self.exp(p, c)

    def components(self, p: Array, w: Array) -> Array:
        """Copy of the body rate w (3,) [rad/s], which is its own components."""
        return w.copy()

    def vector(self, p: Array, c: Array) -> Array:
        """Copy of the components c (3,) [rad/s], which are the body rate itself."""
        return c.copy()

    def rounded(self, p: Array, bits: int) -> Array:
        """Return p (4,) unchanged: there are no encoders.

        Raises FieldError unless ``bits`` is 0.
        """
        return unrounded(self.name, p, bits)

    def _require_unique(self, p: Array, q: Array) -> None:
        if abs(float(p @ q)) < _OPPOSITE:
            raise CutLocusError(
                f"{p.tolist()} and {q.tolist()} are half a turn apart; allowed: attitudes nearer than that"
            )


# Kernels that are compiled before a run (``sim.engine.compilation``), for arguments of these types.
KERNELS: tuple[Signature, ...] = (
    (_transported, (ONE, ONE, ONE)),
    (_logarithm, (ONE, ONE)),
    (_exponential, (ONE, ONE)),
    (_curvature, (ONE, ONE)),
    (nearer, (ONE, ONE)),
    (distance, (float64, ONE, ONE)),
    (inner, (float64, ONE, ONE)),
    (project, (float64, ONE)),
)
