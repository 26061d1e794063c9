"""Autopilot for thrusters with a known delay: it predicts the state at which its command will act.

With the declared delay delta and the inputs u that were commanded in the last delta,

    x^(t + delta) = x^(t) + ∫_t^(t + delta) f(x, u(s - delta) + d^) ds,

f the declared body and d^ the disturbance of the input where the estimator observes it. The autopilot inside steers
this state to the plan at t + delta (a Smith predictor with the nonlinear model). The prediction's error, for a body
that is not as declared, is seen delta later; it is filtered and added to the next predictions.
"""

from __future__ import annotations

import dataclasses
import math
from collections import deque

import numpy as np

from mathnavi.controllers.missile.autopilot import Autopilot, checked_state, disturbance
from mathnavi.interfaces.signals import Array, Estimate, Plan
from mathnavi.models.angles import wrapped
from mathnavi.models.missile.input_history import InputHistory
from mathnavi.models.missile.mission import MissileMission
from mathnavi.models.tolerances import TIME_TOLERANCE

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
