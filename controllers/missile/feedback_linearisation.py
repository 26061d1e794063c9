"""Feedback linearisation: the inverse dynamics turn the missile into double integrators, one on each joint.

With joint coordinates j (places and angles), e = j^ - j_ref and the plan's acceleration j_ref'',

    F = F(x^, j_ref'' - k_d e' - k_p e - k_i ∫ e) - d^,     (s + omega)^3 = s^3 + k_d s^2 + k_p s + k_i,

F(x, j'') the inverse dynamics of the declared body and d^ the disturbance of the input where the estimator observes
it. The integral compensates a wrong mass or a gust. On the plan F is the plan's mean input over the tick, to rounding.
Where the thrusters are at their limits, the integral is led back by the acceleration they lack (back-calculation).
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.missile.autopilot import checked_state, disturbance, feed_forward
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.angles import wrapped
from mathnavi.models.missile.mission import MissileMission


class FeedbackLinearisation:
    """Autopilot whose errors from the plan decay at ``bandwidth`` omega [rad/s]."""

    def __init__(self, mission: MissileMission, bandwidth: float) -> None:
        self.period = mission.control_period
        self._mission, self._omega = mission, bandwidth
        self._k_d, self._k_p, self._k_i = 3.0 * bandwidth, 3.0 * bandwidth**2, bandwidth**3
        coordinates = mission.coordinates
        self._joints = len(coordinates.joints)
        self._angles = np.array([k for k, name in enumerate(coordinates.joints) if name in ("theta", "psi")])
        self._input_max = np.array(mission.input_max)
        self._integral = np.zeros(self._joints)  # [m s, rad s] of e

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        coordinates, body = self._mission.coordinates, self._mission.body
        x, external = checked_state(estimate, self._mission), disturbance(estimate, len(self._input_max))
        reference = coordinates.state_at(plan, t, body)
        e, e_rate = self._error(x, reference)
        planned = coordinates.joint_acceleration(reference, feed_forward(plan, t, self.period), body)
        demanded = planned - self._k_d * e_rate - self._k_p * e - self._k_i * self._integral
        u = coordinates.inverse_dynamics(x, demanded, body) - external
        applied = np.clip(u, -self._input_max, self._input_max)
        lacking = np.zeros(self._joints)
        if (applied != u).any():
            lacking = demanded - coordinates.joint_acceleration(x, applied + external, body)
        self._integral += self.period * (e + lacking / self._k_p)
        return u

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """State (nx,) at t [s]: the error decays with its poles; the integral already holds lasting disturbances.

        With e'' = -k_d e' - k_p e at first, e = (e + c_1 tau + c_2 tau^2) exp(-omega tau).
        """
        coordinates, body = self._mission.coordinates, self._mission.body
        now, then = coordinates.state_at(plan, np.array([estimate.t, t]), body)
        e, e_rate = self._error(checked_state(estimate, self._mission), now)
        omega, tau = self._omega, t - estimate.t
        c_1, c_2 = e_rate + omega * e, -0.5 * omega * e_rate - omega**2 * e
        decay = math.exp(-omega * tau)
        after = (e + (c_1 + c_2 * tau) * tau) * decay
        rate = (c_1 + 2.0 * c_2 * tau) * decay - omega * after
        return coordinates.from_joints(coordinates.to_joints(then) + np.concatenate([after, rate]))

    def _error(self, x: Array, reference: Array) -> tuple[Array, Array]:
        """Errors e and e' (nj,) of the joint coordinates, angles wrapped."""
        error = self._mission.coordinates.to_joints(x) - self._mission.coordinates.to_joints(reference)
        error[self._angles] = wrapped(error[self._angles])
        return error[: self._joints], error[self._joints :]
