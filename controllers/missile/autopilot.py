"""Autopilots: each flies the plan's mean input over a tick, and predicts where it will take the missile.

A planner that plans from an estimate needs the state at which its plan will take over, one period later. That depends
on how the autopilot acts on a deviation until then, so the autopilot predicts it: an autopilot is a tracker that
predicts. ``OpenLoop`` has no feedback: it flies the plan's inputs, regardless of the deviation.

**Delay compensation**, for thrusters with a known delay: it predicts the state at which its command will act.

With the declared delay delta and the inputs u that were commanded in the last delta,

    x^(t + delta) = x^(t) + ∫_t^(t + delta) f(x, u(s - delta) + d^) ds,

f the declared body and d^ the disturbance of the input where the estimator observes it. The autopilot inside steers
this state to the plan at t + delta (a Smith predictor with the nonlinear model). The prediction's error, for a body
that is not as declared, is seen delta later; it is filtered and added to the next predictions.

**Feedback linearisation**: the inverse dynamics turn the missile into double integrators, one on each joint.

With joint coordinates j (places and angles), e = j^ - j_ref and the plan's acceleration j_ref'',

    F = F(x^, j_ref'' - k_d e' - k_p e - k_i ∫ e) - d^,     (s + omega)^3 = s^3 + k_d s^2 + k_p s + k_i,

F(x, j'') the inverse dynamics of the declared body and d^ the disturbance of the input where the estimator observes
it. The integral compensates a wrong mass or a gust. On the plan F is the plan's mean input over the tick, to rounding.
Where the thrusters are at their limits, the integral is led back by the acceleration they lack (back-calculation).
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from typing import Protocol

import numpy as np

from mathnavi.controllers.missile.optimiser import flown
from mathnavi.controllers.missile.shooting import mean_between
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.angles import wrapped
from mathnavi.models.missile.input_history import InputHistory
from mathnavi.models.missile.mission import MissileMission
from mathnavi.models.tolerances import TIME_TOLERANCE


class Autopilot(Protocol):
    """A ``mathnavi.interfaces.protocols.Tracker`` of a missile."""

    period: float  # [s]

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        """The input (nu,) [N, N m] to hold until t + period."""
        ...

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """The state (nx,) at t [s] of a missile that is at the estimate now and flies the plan."""
        ...


def feed_forward(plan: Plan, t: float, period: float) -> Array:
    """Mean input (nu,) of a plan over [t, t + period] [s]: an arc may end within a tick."""
    mean: Array = mean_between(plan.t, plan.u, np.array([t, t + period]))[0]
    return mean


def disturbance(estimate: Estimate, size: int) -> Array:
    """Disturbance (nu,) of the input [N, N m] as the estimator observes it; zero if it does not."""
    return estimate.extra.get("disturbance", np.zeros(size))


def checked_state(estimate: Estimate, mission: MissileMission) -> Array:
    """The estimate's state (nx,); ArgumentError for any other shape, which compiled code would read beyond."""
    if estimate.x.shape != (mission.coordinates.state_size,):
        raise ArgumentError(
            f"the estimate's state has shape {estimate.x.shape}; allowed: ({mission.coordinates.state_size},)"
        )
    return estimate.x


class OpenLoop:
    """Autopilot without feedback: the plan's mean input over each tick."""

    def __init__(self, mission: MissileMission) -> None:
        self.period = mission.control_period
        self._mission = mission

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        return feed_forward(plan, t, self.period)

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """State (nx,) at t [s] of the declared body, flown from the estimate with the plan's inputs."""
        x, now = checked_state(estimate, self._mission), estimate.t
        inner = plan.t[(plan.t > now) & (plan.t < t)]
        breaks = np.concatenate([[now], inner, [t]])
        u = np.array([self._mission.coordinates.input_at(plan, float(begin)) for begin in breaks[:-1]])
        end: Array = flown(x, breaks, u, self._mission.coordinates, self._mission.body)[-1]
        return end


SMOOTHING = 0.2
"""time constant [s] of the filter of the prediction errors"""


class DelayCompensation:
    """An ``Autopilot`` that lets another one act on the state of ``mission.input_delay`` [s] later."""

    def __init__(self, autopilot: Autopilot, mission: MissileMission) -> None:
        self.period, self._inside, self._mission = autopilot.period, autopilot, mission
        self._sent = InputHistory(mission.input_delay, mission.coordinates.input_size)
        self._input_max = np.array(mission.input_max)
        self._predictions: deque[tuple[float, Array]] = deque()  # (t [s], state (nx,) by the declared body alone)
        self._lack = np.zeros(mission.coordinates.state_size)

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        x = checked_state(estimate, self._mission)
        self._learn(t, x)
        modelled = self._flown(estimate, t + self._sent.delay)
        self._predictions.append((t + self._sent.delay, modelled))
        there = dataclasses.replace(estimate, t=t + self._sent.delay, x=modelled + self._lack)
        u = self._inside.command(there.t, there, plan)
        self._sent.note(t, np.clip(u, -self._input_max, self._input_max))
        return u

    def predict(self, estimate: Estimate, plan: Plan, t: float) -> Array:
        """State at t [s]: by the inputs under way as far as they reach, then as the autopilot inside predicts it."""
        reached = estimate.t + self._sent.delay
        if t <= reached:
            return self._flown(estimate, t)
        there = dataclasses.replace(estimate, t=reached, x=self._flown(estimate, reached) + self._lack)
        return self._inside.predict(there, plan, t)

    def _flown(self, estimate: Estimate, t: float) -> Array:
        """State (nx,) at t [s] of the declared body from an estimate, under the inputs on their way."""
        coordinates, body = self._mission.coordinates, self._mission.body
        x = checked_state(estimate, self._mission)
        acting = list(self._sent.acting(estimate.t, t))
        if not acting:
            return x
        inputs = np.array([u for _, u in acting]) + disturbance(estimate, len(self._input_max))
        return coordinates.flow_through(x, inputs, [duration for duration, _ in acting], body)

    def _learn(self, t: float, x: Array) -> None:
        """Update the filtered prediction error from the prediction for t [s]."""
        while self._predictions and self._predictions[0][0] <= t + TIME_TOLERANCE:
            at, predicted = self._predictions.popleft()
            if abs(at - t) <= TIME_TOLERANCE and np.isfinite(x).all():
                lack = x - predicted
                lack[self._mission.coordinates.angles] = wrapped(lack[self._mission.coordinates.angles])
                self._lack += (1.0 - math.exp(-self.period / SMOOTHING)) * (lack - self._lack)


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
