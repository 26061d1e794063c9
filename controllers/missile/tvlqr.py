"""TVLQR: the time-varying linear-quadratic regulator along the plan.

With e = x^ - x_ref, A and B the Jacobians of the declared dynamics along the plan (CasADi's), and weights Q, R, Q_T,

    F = F_ref - K e - d^,     K = R^-1 B' P,     -P' = A' P + P A - P B R^-1 B' P + Q,     P(t_end) = Q_T,

solved backwards in steps of at most ``STEP``, over each of which A and B are held (as the discrete-time equation of the
held input). A new plan needs a new solution, within milliseconds. A lasting deviation, from a gust or a wrong mass, is
reduced but not removed: there is no integral.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from mathnavi.controllers.missile.autopilot import checked_state, disturbance, feed_forward
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.angles import wrapped
from mathnavi.models.buffered_function import BufferedFunction
from mathnavi.models.missile.coordinates import Coordinates
from mathnavi.models.missile.dynamics import Body
from mathnavi.models.missile.mission import MissileMission

STEP = 0.025
"""longest step [s] of the Riccati equation"""
DEVIATIONS = {"m": 0.05, "m/s": 1.0, "rad": 0.01, "rad/s": 0.2}
"""deviations of the state that weigh 1"""
EFFORT = {"N": 2000.0, "N m": 500.0}
"""deviations of the input that weigh 1"""
AT_THE_END = {"m": 0.01, "m/s": 0.5, "rad": 0.002, "rad/s": 0.2}
"""deviations of the state that weigh 1 at the end"""


@dataclass(frozen=True, eq=False)
class RegulatorGains:
    """The regulator of one plan, step by step."""

    plan: Plan
    t: Array  # (S + 1,) [s] breaks of the steps
    K: Array  # (S, nu, nx)
    transition: Array  # (S, nx, nx) of e over a step, the loop closed

    def at(self, t: float) -> int:
        """The step that holds at t [s]; the first before the plan starts, the last after it ends."""
        return int(np.clip(np.searchsorted(self.t, t + 1e-9, side="right") - 1, 0, len(self.K) - 1))


class TimeVaryingLQR:
    """Autopilot that flies the plan with the regulator's gains."""

    def __init__(self, mission: MissileMission) -> None:
        self.period = mission.control_period
        self._mission = mission
        coordinates = mission.coordinates
        self._Q = np.diag([DEVIATIONS[unit] ** -2.0 for unit in coordinates.units])
        self._Q_T = np.diag([AT_THE_END[unit] ** -2.0 for unit in coordinates.units])
        units = ["N" if name.startswith("F") else "N m" for name in coordinates.inputs]
        self._R = np.diag([EFFORT[unit] ** -2.0 for unit in units])
        self._gains: RegulatorGains | None = None

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        gains, e = self._along(plan), self._error(estimate, plan)
        external = disturbance(estimate, len(self._R))
        u: Array = feed_forward(plan, t, self.period) - gains.K[gains.at(t)] @ e - external
        return u

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """State (nx,) at t [s]: the error follows the closed loop along the plan, in whole steps."""
        gains, e = self._along(plan), self._error(estimate, plan)
        for k in range(gains.at(estimate.t), gains.at(t)):
            e = gains.transition[k] @ e
        return self._mission.coordinates.state_at(plan, t, self._mission.body) + e

    def _along(self, plan: Plan) -> RegulatorGains:
        if self._gains is None or self._gains.plan is not plan:
            self._gains = gains(plan, self._mission.coordinates, self._mission.body, self._Q, self._R, self._Q_T)
        return self._gains

    def _error(self, estimate: Estimate, plan: Plan) -> Array:
        coordinates = self._mission.coordinates
        reference = coordinates.state_at(plan, estimate.t, self._mission.body)
        e: Array = checked_state(estimate, self._mission) - reference
        e[coordinates.angles] = wrapped(e[coordinates.angles])
        return e


def gains(plan: Plan, coordinates: Coordinates, body: Body, Q: Array, R: Array, Q_T: Array) -> RegulatorGains:
    """The regulator along a plan, with weights of state (nx, nx), input (nu, nu) and end (nx, nx)."""
    parts = np.maximum(1, np.ceil(np.diff(plan.t) / STEP - 1e-9)).astype(int)
    widths = np.repeat(np.diff(plan.t) / parts, parts)
    t = np.concatenate([[plan.t[0]], plan.t[0] + np.cumsum(widths)])
    x = coordinates.state_at(plan, 0.5 * (t[:-1] + t[1:]), body)
    A, B = _along(_jacobians(coordinates, body), x, np.repeat(plan.u, parts, axis=0))
    K, transition = _riccati(A, B, widths, Q, R, Q_T)
    return RegulatorGains(plan, t, K, transition)


@lru_cache(maxsize=8)
def _jacobians(coordinates: Coordinates, body: Body) -> ca.Function:
    """(x, u) -> (df/dx', df/du'), transposed: CasADi stores by columns."""
    x, u = ca.SX.sym("x", coordinates.state_size), ca.SX.sym("u", coordinates.input_size)
    rate = coordinates.dynamics(body)(x, u)
    derivatives = [ca.densify(ca.jacobian(rate, by).T) for by in (x, u)]
    return ca.Function("jacobians", [x, u], derivatives)


def _along(jacobians: ca.Function, x: Array, u: Array) -> tuple[Array, Array]:
    """A (S, nx, nx) and B (S, nx, nu) at states (S, nx) and inputs (S, nu)."""
    nx, nu = x.shape[1], u.shape[1]
    A, B = np.empty((len(x), nx, nx)), np.empty((len(x), nx, nu))
    here = np.empty(nx), np.empty(nu), np.empty((nx, nx)), np.empty((nx, nu))
    evaluate = BufferedFunction(jacobians, here[:2], here[2:])
    for k in range(len(x)):
        here[0][:], here[1][:] = x[k], u[k]
        evaluate()
        A[k], B[k] = here[2], here[3]
    return A, B


@njit(cache=True, nogil=True)
def _riccati(A: Array, B: Array, widths: Array, Q: Array, R: Array, Q_T: Array) -> tuple[Array, Array]:
    """K (S, nu, nx) and the closed loop's transitions (S, nx, nx)."""
    steps, nx, nu = len(A), A.shape[1], B.shape[2]
    K, transition = np.empty((steps, nu, nx)), np.empty((steps, nx, nx))
    P, one = Q_T.copy(), np.eye(nx)
    for k in range(steps - 1, -1, -1):
        h = widths[k]
        step = h * A[k]
        squared = step @ step
        F = one + step + 0.5 * squared + squared @ step / 6.0
        G = h * (one + 0.5 * step + squared / 6.0) @ B[k]
        PG = P @ G
        K[k] = np.linalg.solve(h * R + G.T @ PG, PG.T @ F)
        transition[k] = F - G @ K[k]
        P = h * Q + F.T @ P @ transition[k]
        P = 0.5 * (P + P.T)
    return K, transition
