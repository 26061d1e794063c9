"""Matrix Lie groups of poses, SO(3), SE(2) and SE_2(3), with the maps that an invariant filter needs.

An element X is a matrix, an element xi (n,) of the Lie algebra a vector. With the bracket [xi^, eta^] = (ad_xi eta)^,

    Exp(xi) = e^(xi^),   X Exp(xi) X^-1 = Exp(Ad_X xi),
    Exp(xi + d) = Exp(J_l d) Exp(xi) = Exp(xi) Exp(J_r d)   to first order in d,
    J_l(xi) = sum_k ad_xi^k / (k + 1)!,   J_r(xi) = J_l(-xi).

The eigenvalues of ad are 0 and +-i theta, theta the angle of rotation, so the sum ends: ad^3 = -theta^2 ad on SO(3) and
SE(2), and ad^5 = -2 theta^2 ad^3 - theta^4 ad on SE_2(3).
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np

from mathnavi.interfaces.signals import Array

_SMALL = 0.05  # [rad] below which the coefficients are Taylor series, truncated below 1e-14


class SO3:
    """Rotations: X (3, 3), xi (3,) [rad] the rotation vector."""

    dimension: ClassVar[int] = 3

    @staticmethod
    def bracket(xi: Array) -> Array:
        """ad_xi (3, 3), the matrix of the cross product with xi (3,)."""
        x, y, z = xi
        return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])

    @staticmethod
    def exp(xi: Array) -> Array:
        """Rotation (3, 3) by |xi| [rad] about xi (3,)."""
        theta, ad = _length(xi), SO3.bracket(xi)
        sine = (
            1.0 - theta**2 / 6.0 + theta**4 / 120.0 - theta**6 / 5040.0 if theta < _SMALL else math.sin(theta) / theta
        )
        X: Array = np.eye(3) + sine * ad + _versine(theta) * ad @ ad
        return X

    @staticmethod
    def log(X: Array) -> Array:
        """Rotation vector xi (3,) [rad] of a rotation X (3, 3), |xi| <= pi."""
        q = quaternion(X)
        sine = _length(q[1:])
        angle: Array = (2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, q[0]) / sine) * q[1:]
        return angle

    @staticmethod
    def adjoint(X: Array) -> Array:
        """Ad_X (3, 3), the rotation itself."""
        return X.copy()

    @staticmethod
    def left_jacobian(xi: Array) -> Array:
        """J_l (3, 3) at xi (3,)."""
        return _cubic(SO3.bracket(xi), _length(xi))

    @staticmethod
    def right_jacobian(xi: Array) -> Array:
        """J_r (3, 3) at xi (3,)."""
        return SO3.left_jacobian(-np.asarray(xi))


class SE2:
    """Poses in the plane: X (3, 3), xi = (forward [m], left [m], turned [rad])."""

    dimension: ClassVar[int] = 3

    @staticmethod
    def from_pose(pose: Array) -> Array:
        """Element (3, 3) of a pose (x_1, x_2, phi) (3,) [m, m, rad]."""
        c, s = math.cos(pose[2]), math.sin(pose[2])
        return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])

    @staticmethod
    def pose(X: Array) -> Array:
        """Pose (3,) [m, m, rad] of an element X (3, 3), the heading within (-pi, pi]."""
        return np.array([X[0, 2], X[1, 2], math.atan2(X[1, 0], X[0, 0])])

    @staticmethod
    def bracket(xi: Array) -> Array:
        """ad_xi (3, 3)."""
        x, y, phi = xi
        return np.array([[0.0, -phi, y], [phi, 0.0, -x], [0.0, 0.0, 0.0]])

    @staticmethod
    def exp(xi: Array) -> Array:
        """Element (3, 3) reached from the identity after 1 s at the constant body velocity xi (3,): an arc."""
        X = SE2.from_pose(np.array([0.0, 0.0, xi[2]]))
        X[:2, 2] = _arc(float(xi[2])) @ np.asarray(xi)[:2]
        return X

    @staticmethod
    def log(X: Array) -> Array:
        """Body velocity xi (3,) whose arc leads to X (3, 3) in 1 s, turning by pi at most."""
        phi = math.atan2(X[1, 0], X[0, 0])
        return np.array([*np.linalg.solve(_arc(phi), X[:2, 2]), phi])

    @staticmethod
    def adjoint(X: Array) -> Array:
        """Ad_X (3, 3)."""
        Ad = np.eye(3)
        Ad[:2, :2], Ad[0, 2], Ad[1, 2] = X[:2, :2], X[1, 2], -X[0, 2]
        return Ad

    @staticmethod
    def left_jacobian(xi: Array) -> Array:
        """J_l (3, 3) at xi (3,)."""
        return _cubic(SE2.bracket(xi), abs(float(xi[2])))

    @staticmethod
    def right_jacobian(xi: Array) -> Array:
        """J_r (3, 3) at xi (3,)."""
        return SE2.left_jacobian(-np.asarray(xi))


class SE23:
    """Extended poses SE_2(3): X (5, 5) = [R v p; 0 I], xi (9,) the parts of attitude [rad], velocity and position."""

    dimension: ClassVar[int] = 9

    @staticmethod
    def from_parts(R: Array, v: Array, p: Array) -> Array:
        """Element (5, 5) of an attitude R (3, 3), a velocity v (3,) and a position p (3,)."""
        X = np.eye(5)
        X[:3, :3], X[:3, 3], X[:3, 4] = R, v, p
        return X

    @staticmethod
    def inverse(X: Array) -> Array:
        """Inverse (5, 5) of X (5, 5)."""
        R = X[:3, :3].T
        return SE23.from_parts(R, -R @ X[:3, 3], -R @ X[:3, 4])

    @staticmethod
    def bracket(xi: Array) -> Array:
        """ad_xi (9, 9)."""
        ad, turn = np.zeros((9, 9)), SO3.bracket(xi[:3])
        for k in (0, 3, 6):
            ad[k : k + 3, k : k + 3] = turn
        ad[3:6, :3], ad[6:, :3] = SO3.bracket(xi[3:6]), SO3.bracket(xi[6:])
        return ad

    @staticmethod
    def exp(xi: Array) -> Array:
        """Element (5, 5) of xi (9,)."""
        J = SO3.left_jacobian(xi[:3])
        return SE23.from_parts(SO3.exp(xi[:3]), J @ xi[3:6], J @ xi[6:])

    @staticmethod
    def log(X: Array) -> Array:
        """xi (9,) of an element X (5, 5), its rotation by pi at most."""
        turn = SO3.log(X[:3, :3])
        return np.concatenate([turn, *np.linalg.solve(SO3.left_jacobian(turn), X[:3, 3:]).T])

    @staticmethod
    def adjoint(X: Array) -> Array:
        """Ad_X (9, 9)."""
        Ad, R = np.zeros((9, 9)), X[:3, :3]
        for k in (0, 3, 6):
            Ad[k : k + 3, k : k + 3] = R
        Ad[3:6, :3], Ad[6:, :3] = SO3.bracket(X[:3, 3]) @ R, SO3.bracket(X[:3, 4]) @ R
        return Ad

    @staticmethod
    def left_jacobian(xi: Array) -> Array:
        """J_l (9, 9) at xi (9,)."""
        theta, ad = _length(xi[:3]), SE23.bracket(xi)
        t = theta * theta
        if theta < _SMALL:  # the series up to ad^4, and what ad^5 to ad^8 add by the minimal polynomial
            a_1, a_2 = 0.5 - t * t / 720.0, 1.0 / 6.0 - t * t / 5040.0
            a_3, a_4 = 1.0 / 24.0 - t / 360.0 + t * t / 13440.0, 1.0 / 120.0 - t / 2520.0 + t * t / 120960.0
        else:
            c, s = math.cos(theta), math.sin(theta)
            a_1 = (4.0 - theta * s - 4.0 * c) / (2.0 * t)
            a_2 = (4.0 * theta - 5.0 * s + theta * c) / (2.0 * t * theta)
            a_3 = (2.0 - theta * s - 2.0 * c) / (2.0 * t * t)
            a_4 = (2.0 * theta - 3.0 * s + theta * c) / (2.0 * t * t * theta)
        square = ad @ ad
        J: Array = np.eye(9) + a_1 * ad + a_2 * square + a_3 * ad @ square + a_4 * square @ square
        return J

    @staticmethod
    def right_jacobian(xi: Array) -> Array:
        """J_r (9, 9) at xi (9,)."""
        return SE23.left_jacobian(-np.asarray(xi))


def quaternion(R: Array) -> Array:
    """Unit quaternion (4,), scalar first and not negative, of a rotation R (3, 3): from its largest component."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    squares = np.array([trace, R[0, 0], R[1, 1], R[2, 2]])
    k = int(np.argmax(squares))
    q = np.empty(4)
    if k == 0:
        q[:] = 1.0 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    else:
        i, j, m = k - 1, k % 3, (k + 1) % 3
        q[0], q[1 + i] = R[m, j] - R[j, m], 1.0 + 2.0 * R[i, i] - trace
        q[1 + j], q[1 + m] = R[j, i] + R[i, j], R[m, i] + R[i, m]
    q /= _length(q)
    unit: Array = -q if q[0] < 0.0 else q
    return unit


def _length(xi: Array) -> float:
    return math.sqrt(float(np.dot(xi, xi)))


def _sinc(theta: float) -> float:
    """Ratio sin theta / theta."""
    if abs(theta) < _SMALL:
        return 1.0 - theta**2 / 6.0 + theta**4 / 120.0 - theta**6 / 5040.0
    return math.sin(theta) / theta


def _versine(theta: float) -> float:
    """Ratio (1 - cos theta) / theta^2."""
    if abs(theta) < _SMALL:
        return 0.5 - theta**2 / 24.0 + theta**4 / 720.0 - theta**6 / 40320.0
    return (1.0 - math.cos(theta)) / theta**2


def _cubic(ad: Array, theta: float) -> Array:
    """J_l where ad^3 = -theta^2 ad."""
    if theta < _SMALL:
        third = 1.0 / 6.0 - theta**2 / 120.0 + theta**4 / 5040.0
    else:
        third = (theta - math.sin(theta)) / theta**3
    J: Array = np.eye(len(ad)) + _versine(theta) * ad + third * ad @ ad
    return J


def _arc(phi: float) -> Array:
    """Mean (2, 2) of the rotations from 0 to phi [rad]."""
    a, b = _sinc(phi), phi * _versine(phi)
    return np.array([[a, -b], [b, a]])
