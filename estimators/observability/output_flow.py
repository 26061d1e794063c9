"""States with the same output flow (Definition C.11, Proposition C.1), and indistinguishable states.

Under an input u(.) a state x_1 is output flow equivalent to x_0 if, for all t in some [0, T],

    h(x(t, x_1, u)) - h(x_1) = h(x(t, x_0, u)) - h(x_0).

``mismatch`` is the largest difference of the two sides over a given T; where the wall is analytic it vanishes for one T
only if it does for all. Its derivative at t = 0 is y'(x_1) = y'(x_0), which Q = 0 as printed says:

    Q_i = theta'(s_i)^T R_{phi + alpha_i} e_2 (y_i'(x_0) - y_i'(x_1)),

so {Q = 0} contains the set and is larger: an output flow determines more than its first derivative.

The feasible states with the same output flow are those that read the same all along the motion.

**Indistinguishable states**, which no input distinguishes, at all or within a time T (Definitions C.1, C.8), are
searched for by the readings under several inputs, stacked: poses with the same readings are found by least squares from
many starts, drawn all over the field; poses that fit are clustered. The poses found are indistinguishable *under
these inputs*; the more exciting the inputs, the fewer poses remain. In a field that m rotations map onto itself m
always remain.

Definition C.8 requires of a state x_1 that for any x_2 and T > 0 an input distinguishes the two by T. As printed it
does not except x_2 = x_1, which no input distinguishes; here x_2 = x_1 is excepted. For the weak property x_2 is in a
neighbourhood of x_1 only.

**Q of C.4 as printed, derived by CasADi**: the reference for the compiled observer.

With the letters of ``observer_kernels``,

    Q_i = theta'(s_i)' R_phi (u_1 e_2 + rho_dot_i R_{alpha_i} e_2 - rho_i u_2 R_{alpha_i} e_1),

and the state z is equivalent to the truth in output flow only where Q = 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi
import numpy as np

from mathnavi.estimators.observability.continuation import Equations
from mathnavi.estimators.observability.feasible_set import FeasibleSet
from mathnavi.estimators.observability.range_outputs import (
    DEFICIENT,
    Input,
    RangeOutputs,
    different_poses,
    motion_under,
    pose_difference,
)
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.field.curve import Curve

_SAME = 1e-5  # two states of the intersection are the same
_DIFFERENCE = 1e-6  # step of central differences


def mismatch(outputs: RangeOutputs, x_1: Array, x_0: Array, motion: Array) -> float:
    """Largest difference [m] of the output flows of states x_1, x_0 (3,) along a motion (K, 3); infinite across the
    wall.
    """
    largest = float(np.abs(_flow(outputs, x_1, motion) - _flow(outputs, x_0, motion)).max())
    return largest if math.isfinite(largest) else math.inf


def equal_rates(outputs: RangeOutputs, x_0: Array, u: tuple[float, float]) -> Equations:
    """Equations y'(x) = y'(x_0) of {Q = 0} under the input u, with their derivative, to be followed from x_0 (3,)."""
    wanted = outputs.rate(x_0, u)

    def equations(x: Array) -> tuple[Array, Array]:
        columns = [
            (outputs.rate(x + e, u) - outputs.rate(x - e, u)) / (2.0 * _DIFFERENCE) for e in _DIFFERENCE * np.eye(3)
        ]
        return outputs.rate(x, u) - wanted, np.column_stack(columns)

    return equations


@dataclass(frozen=True)
class Intersection:
    """Intersection of FS_y and OF, relative to x_0."""

    others: Array  # (k, 3) its states without x_0, if they are isolated
    nearest: float  # from x_0 to another of its states; infinite without one, zero where x_0 is not isolated
    isolation: float  # least singular value of d(outputs along the motion) / dx at x_0 [m per metre or radian]

    @property
    def is_singleton(self) -> bool:
        """True if x_0 is the whole set within some neighbourhood N(x_0): (C.1)."""
        return self.nearest > 0.0


def intersection(outputs: RangeOutputs, x_0: Array, motion: Array, feasible: FeasibleSet) -> Intersection:
    """Intersection of FS_y and OF^u of a state x_0 (3,), under the input of ``motion`` (K, 3), searched along FS_y.

    ``feasible`` is the feasible set of h(x_0). States of it whose outputs nearly follow those of x_0 are moved to where
    they follow exactly; a state that cannot be moved there is left out. Raises ArgumentError if the motion from x_0
    leaves the field.
    """
    y, J = outputs.along(x_0, motion)
    if not np.isfinite(y).all():
        raise ArgumentError(f"x_0 = {np.asarray(x_0).tolist()}: the motion leaves the field; allowed: one within it")
    isolation = float(np.linalg.svd(J, compute_uv=False)[-1])
    if isolation < DEFICIENT:
        return Intersection(np.empty((0, 3)), 0.0, isolation)
    starts = [feasible.points]
    for curve in feasible.curves:
        error = np.array([mismatch(outputs, x, x_0, motion) for x in curve.points])
        before, after = np.roll(error, 1), np.roll(error, -1)
        if not curve.closed:
            before[0], after[-1] = math.inf, math.inf
        starts.append(curve.points[(error <= before) & (error <= after) & np.isfinite(error)])
    found = [x for start in np.vstack(starts) if (x := outputs.fit(y, start, motion)) is not None]
    states = different_poses(np.array([np.asarray(x_0, np.float64), *found]), _SAME)
    others = states[1:]
    nearest = min((float(np.linalg.norm(pose_difference(x, x_0))) for x in others), default=math.inf)
    return Intersection(others, nearest, isolation)


def _flow(outputs: RangeOutputs, x: Array, motion: Array) -> Array:
    """h(x(t)) - h(x) at the instants of a motion, (K, l) [m]."""
    y = outputs.along(x, motion)[0].reshape(len(motion), outputs.sensors)
    flow: Array = y - outputs.at(x)[0]
    return flow


_APART = 1e-4  # clusters are farther apart


@dataclass(frozen=True)
class Indistinguishable:
    """States with the same readings as a given one."""

    states: Array  # (k, 3), that one first
    hits: Integers  # (k,) number of starts from which each was found: if few, others may have been missed


@dataclass(frozen=True)
class SmallTime:
    """Small-time observability at one state and for one T (Definition C.8)."""

    others: Array  # (k, 3) states that none of the inputs distinguishes from x_1 by T
    nearest: float  # to the nearest of them; infinite without one, zero where they reach x_1

    @property
    def observable(self) -> bool:
        """True if x_1 is small-time observable, x_2 = x_1 excepted."""
        return self.nearest == math.inf

    @property
    def weakly_observable(self) -> bool:
        """True if x_1 is weakly small-time observable: no state near x_1 reads the same."""
        return self.nearest > 0.0


def indistinguishable_states(
    outputs: RangeOutputs, x: Array, motions: Sequence[Array], rng: np.random.Generator, starts: int = 200
) -> Indistinguishable:
    """States that read the same as x (3,) [m, m, rad] along every one of ``motions`` (K_j, 3) (Definition C.1).

    If they are not isolated, as in a circle or at rest, each start may end at another one. Raises
    ArgumentError where a motion from x leaves the field.
    """
    motion = np.vstack(motions)
    y, _ = outputs.along(x, motion)
    if not np.isfinite(y).all():
        raise ArgumentError(f"x = {np.asarray(x).tolist()}: a motion leaves the field; allowed: ones within it")
    found = [pose for _ in range(starts) if (pose := outputs.fit(y, outputs.curve.draw(rng), motion)) is not None]
    states = different_poses(np.array([np.asarray(x, np.float64), *found]), _APART)
    hits = np.zeros(len(states), dtype=np.int64)
    for pose in found:
        hits[np.argmin(np.linalg.norm(pose_difference(states, pose), axis=1))] += 1
    return Indistinguishable(states, hits)


def small_time(
    outputs: RangeOutputs,
    x: Array,
    T: float,
    inputs: Sequence[Input],
    rng: np.random.Generator,
    starts: int = 200,
) -> SmallTime:
    """Small-time observability at x (3,) (Definition C.8), and the states that none of ``inputs`` distinguishes from x
    by T [s].

    These are the states that read the same as x under each of the inputs. If x is not isolated among them, the least
    singular value of the outputs' derivative is zero.
    """
    motions = [motion_under(u, T) for u in inputs]
    isolation = np.linalg.svd(outputs.along(x, np.vstack(motions))[1], compute_uv=False)[-1]
    others = indistinguishable_states(outputs, x, motions, rng, starts).states[1:]
    if isolation < DEFICIENT:
        return SmallTime(others, 0.0)
    nearest = min((float(np.linalg.norm(pose_difference(other, x))) for other in others), default=math.inf)
    return SmallTime(others, nearest)


@lru_cache(maxsize=16)
def output_flow(curve: Curve, angles: tuple[float, ...]) -> casadi.Function:
    """Function (z (l + 1,), rho (l,), rho_dot (l,), u (2,)) -> Q (l,) [m^2/s], J_q (l, l + 1)."""
    l = len(angles)  # noqa: E741
    z, rho, rho_dot = casadi.SX.sym("z", l + 1), casadi.SX.sym("rho", l), casadi.SX.sym("rho_dot", l)
    u, s = casadi.SX.sym("u", 2), casadi.SX.sym("s")
    tangent = casadi.Function("tangent", [s], [casadi.jacobian(curve.symbolic(s), s)])
    Q = []
    for i, angle in enumerate(angles):
        ahead, across = _direction(angle), _direction(angle + 0.5 * math.pi)  # R_alpha e_1, R_alpha e_2
        w = u[0] * casadi.DM([0.0, 1.0]) + rho_dot[i] * across - rho[i] * u[1] * ahead
        Q.append(tangent(z[i]).T @ _rotation(z[l]) @ w)
    stacked = casadi.vertcat(*Q)
    return casadi.Function("output_flow", [z, rho, rho_dot, u], [stacked, casadi.jacobian(stacked, z)])


def _direction(angle: casadi.SX | float) -> casadi.SX:
    return casadi.vertcat(casadi.cos(angle), casadi.sin(angle))


def _rotation(angle: casadi.SX) -> casadi.SX:
    c, s = casadi.cos(angle), casadi.sin(angle)
    return casadi.vertcat(casadi.horzcat(c, -s), casadi.horzcat(s, c))
