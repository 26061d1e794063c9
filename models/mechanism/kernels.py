"""Geometry of a mass matrix, compiled, for ``geometry.MechanismManifold``.

With c(v) the velocity-dependent part of MuJoCo's inverse dynamics (``mj_rne`` without gravity), which is quadratic,

    Gamma(v, v) = M^-1 c(v),      Gamma(u, w) = M^-1 [c(u + w) - c(u - w)] / 4 + [u, w] / 2,

where [u, w] = u x w in every ball joint, whose velocities are those of a frame that turns, and zero elsewhere. u is
the direction: nabla_u w = d_u w + Gamma(u, w).

**MuJoCo's functions, called from compiled code**: in a tenth of a microsecond where its Python bindings take three.

They are the functions of the library that the bindings load, on the memory of the same ``mujoco.MjModel`` and
``mujoco.MjData``; an argument that is a pointer in C is an address here.
"""

from __future__ import annotations

import ctypes
import math
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numba import types
from numba.core.types import ExternalFunction
from numpy.typing import NDArray

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array

ADDRESS, INTEGER, NUMBER = types.intp, types.intc, types.float64


def _library() -> ctypes.CDLL:
    folder = Path(mujoco.__file__).parent
    found = [file for kind in ("libmujoco*.so*", "libmujoco*.dylib", "mujoco.dll") for file in folder.glob(kind)]
    if len(found) != 1:
        raise ImportError(f"MuJoCo's library in {folder}: {[file.name for file in found]}; allowed: exactly one")
    return ctypes.CDLL(str(found[0]), ctypes.RTLD_GLOBAL)  # global: that is where compiled code looks for names


_LIBRARY = _library()


def function(name: str, *arguments: Any) -> Any:
    """MuJoCo's function of that name, which returns nothing, for compiled code; ImportError if it does not exist."""
    if not hasattr(_LIBRARY, name):
        raise ImportError(f"MuJoCo {mujoco.__version__} has no function {name}; allowed: a version that has")
    return ExternalFunction(name, types.void(*arguments))


def address(of: mujoco.MjModel | mujoco.MjData) -> int:
    """Address of a model or its data, for compiled code."""
    found: int = of._address  # the bindings have no public name for it
    return found


kinematics = function("mj_kinematics", ADDRESS, ADDRESS)
com_pos = function("mj_comPos", ADDRESS, ADDRESS)
make_m = function("mj_makeM", ADDRESS, ADDRESS)
factor_m = function("mj_factorM", ADDRESS, ADDRESS)
com_vel = function("mj_comVel", ADDRESS, ADDRESS)
rne = function("mj_rne", ADDRESS, ADDRESS, INTEGER, ADDRESS)
solve_m = function("mj_solveM", ADDRESS, ADDRESS, ADDRESS, ADDRESS, INTEGER)
mul_m = function("mj_mulM", ADDRESS, ADDRESS, ADDRESS, ADDRESS)
integrate_pos = function("mj_integratePos", ADDRESS, ADDRESS, ADDRESS, NUMBER)
differentiate_pos = function("mj_differentiatePos", ADDRESS, ADDRESS, NUMBER, ADDRESS, ADDRESS)

_STEP = 1e-5  # [rad, m] of central differences: their error is about as large as that of rounding, 1e-10


class Mechanism(NamedTuple):
    """A model without gravity and the memory it is evaluated in."""

    model: int  # address
    data: int  # address
    qpos: Array  # (nq,) of data; the rest of data belongs to it
    qvel: Array  # (nv,) of data
    balls: NDArray[np.int64]  # where ball joints have their first velocity


@inner_njit()
def contiguous(a: Array, size: int) -> Array:
    """Copy a (size,) into a contiguous array, as C expects it.

    Raises ValueError for another size.
    """
    if len(a) != size:
        raise ValueError("a point or a vector of another size than that of the mechanism")
    copy = np.empty(size)
    copy[:] = a
    return copy


@njit(cache=True)
def locate(at: Mechanism, q: Array) -> None:
    """Compute M and its factors at q (nq,), unless they are already those at q."""
    same = len(q) == len(at.qpos)
    for k in range(min(len(q), len(at.qpos))):
        same = same and at.qpos[k] == q[k]
    if not same:
        at.qpos[:] = q
        kinematics(at.model, at.data)
        com_pos(at.model, at.data)
        make_m(at.model, at.data)
        factor_m(at.model, at.data)


@njit(cache=True)
def integrate(at: Mechanism, q: Array, step: Array, share: float) -> Array:
    """Integrate q (nq,) along a share of a step (nv,) in the joints, as MuJoCo does: (nq,)."""
    after, by = contiguous(q, len(at.qpos)), contiguous(step, len(at.qvel))
    integrate_pos(at.model, after.ctypes.data, by.ctypes.data, share)
    return after


@njit(cache=True)
def difference(at: Mechanism, p: Array, q: Array) -> Array:
    """Step in the joints (nv,) from p (nq,) to q (nq,)."""
    step, start, end = np.empty(len(at.qvel)), contiguous(p, len(at.qpos)), contiguous(q, len(at.qpos))
    differentiate_pos(at.model, step.ctypes.data, 1.0, start.ctypes.data, end.ctypes.data)
    return step


@njit(cache=True)
def bias(at: Mechanism, v: Array) -> Array:
    """Velocity-dependent part c(v) (nv,) of inverse dynamics at v (nv,), at the current configuration."""
    c = np.empty(len(at.qvel))
    at.qvel[:] = v
    com_vel(at.model, at.data)
    rne(at.model, at.data, 0, c.ctypes.data)
    return c


@inner_njit()
def solve_mass(at: Mechanism, c: Array) -> Array:
    """Solve M w = c (nv,) for w (nv,), at the current configuration."""
    w = np.empty(len(c))
    solve_m(at.model, at.data, w.ctypes.data, c.ctypes.data, 1)
    return w


@njit(cache=True)
def bracket(at: Mechanism, u: Array, w: Array) -> Array:
    """Lie bracket [u, w] (nv,) of u, w (nv,): u x w in every ball joint, zero elsewhere."""
    turned = np.zeros(len(u))
    for k in at.balls:
        turned[k] = u[k + 1] * w[k + 2] - u[k + 2] * w[k + 1]
        turned[k + 1] = u[k + 2] * w[k] - u[k] * w[k + 2]
        turned[k + 2] = u[k] * w[k + 1] - u[k + 1] * w[k]
    return turned


@njit(cache=True)
def spray(at: Mechanism, v: Array) -> Array:
    """Gamma(v, v) (nv,) of v (nv,), at the current configuration."""
    return solve_mass(at, bias(at, v))


@njit(cache=True)
def connection(at: Mechanism, u: Array, w: Array) -> Array:
    """Gamma(u, w) (nv,) of u, w (nv,), at the current configuration."""
    symmetric = solve_mass(at, 0.25 * (bias(at, u + w) - bias(at, u - w)))
    return symmetric + 0.5 * bracket(at, u, w)


@njit(cache=True)
def norm(at: Mechanism, w: Array) -> float:
    """Length |w|_g of w (nv,), at the current configuration."""
    v, momentum = contiguous(w, len(at.qvel)), np.empty(len(at.qvel))
    mul_m(at.model, at.data, momentum.ctypes.data, v.ctypes.data)
    return math.sqrt(max(float(v @ momentum), 0.0))


@njit(cache=True)
def norm_at(at: Mechanism, p: Array, w: Array) -> float:
    """Length |w|_g of w (nv,) at p (nq,)."""
    locate(at, p)
    return norm(at, w)


@njit(cache=True)
def bounded(at: Mechanism, correction: Array, w: Array, share: float) -> Array:
    """Shorten a correction (nv,) of w (nv,) to a share of the length of w, if it is longer.

    So the result stays bounded where a series diverges.
    """
    much, most = norm(at, correction), share * norm(at, w)
    return correction if much <= most else correction * (most / much)


@njit(cache=True)
def exponential(at: Mechanism, p: Array, w: Array) -> Array:
    """Exponential map: the geodesic v' = -Gamma(v, v) from v = w; its mean acceleration is that at a third of it: with

        a = -Gamma_p(w, w),    b = -Gamma_{p + w/3}(w + a/3, w + a/3),    p + (w + b/2 + [w, a]/12).

    The last term is that of a frame which turns while the velocity in it changes.
    """
    locate(at, p)
    a = bounded(at, -spray(at, w), w, 1.0)
    locate(at, integrate(at, p, w, 1.0 / 3.0))
    correction = -0.5 * spray(at, w + a / 3.0) + bracket(at, w, a) / 12.0
    return integrate(at, p, w + bounded(at, correction, w, 0.5), 1.0)


@njit(cache=True)
def logarithm(at: Mechanism, p: Array, q: Array) -> Array:
    """Logarithm (nv,) of q (nq,) at p (nq,): ``exponential`` solved for w to the third order in d = q - p."""
    d = difference(at, p, q)
    locate(at, p)
    G = bounded(at, spray(at, d), d, 1.0)
    locate(at, integrate(at, p, d, 1.0 / 3.0))
    correction = 0.5 * spray(at, d + G / 6.0) + bracket(at, d, G) / 12.0
    return d + bounded(at, correction, d, 0.5)


@njit(cache=True)
def transport(at: Mechanism, p: Array, q: Array, w: Array) -> Array:
    """Parallel transport (nv,) of w (nv,) from p (nq,) to q (nq,), rescaled to the length of w.

    w - Gamma_m(d, w - Gamma_m(d, w) / 2),    d = q - p, m half-way
    """
    d = difference(at, p, q)
    before = norm_at(at, p, w)
    locate(at, integrate(at, p, d, 0.5))
    there = w - connection(at, d, w - 0.5 * connection(at, d, w))
    after = norm_at(at, q, there)
    return there * (before / after) if after > 0.0 else there


@njit(cache=True)
def curvature(at: Mechanism, p: Array, X: Array, Y: Array) -> Array:
    """R(X, Y) X = d_X Gamma(Y, X) - d_Y Gamma(X, X) + Gamma(X, Gamma(Y, X)) - Gamma(Y, Gamma(X, X)) - Gamma([X, Y], X).

    Evaluated for directions of length 1 in the joints, being quadratic in X and linear in Y.
    """
    large, far = np.abs(X).max(), np.abs(Y).max()
    if large == 0.0 or far == 0.0:
        return np.zeros(len(X))
    x, y = X / large, Y / far
    locate(at, integrate(at, p, x, _STEP))
    along = connection(at, y, x)
    locate(at, integrate(at, p, x, -_STEP))
    along = along - connection(at, y, x)
    locate(at, integrate(at, p, y, _STEP))
    across = spray(at, x)
    locate(at, integrate(at, p, y, -_STEP))
    across = across - spray(at, x)
    locate(at, p)
    R: Array = (along - across) / (2.0 * _STEP)
    R += connection(at, x, connection(at, y, x)) - connection(at, y, spray(at, x))
    if len(at.balls):
        R -= connection(at, bracket(at, x, y), x)
    R *= large * large * far
    return R
