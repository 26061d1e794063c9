"""Episode for learning: a reward under which arriving is best and crashing worst, and an observation of the terrain
ahead.

An action is held for ``hold`` [s]. With the stage cost L, at most L_max, and the deadline T of the mission

    r_k = -1/(L_max T) int min(L, L_max) dt + gamma Phi(x_k+1) - Phi(x_k) - C(outcome),    Phi(x) = -Psi(x) / Psi(x_0),

where the integral is over the hold, L counts as L_max while a bound of the mission is violated (h_min and v_max of a
flight), Psi is the cost-to-go of the mission, Phi = 0 once it has ended, and C is the cost of its outcome:

    0   arrived; completed, for a mission without a target whose time is up
    1   late, missed
    2   crashed, off the map, diverged

**Order.** An episode lasts T at most, so its stage costs add up to 0 to 1; the terms of the potential, with gamma = 1,
add up to Psi(x_0) / Psi(x_0) = 1 for every policy. So the return is 0 to 1 for arriving, -1 to 0 for being late and -2
to -1 for a crash, for an episode of any length: ending early saves less than it costs.

**Shaping.** A difference of potentials leaves the optimal policy unchanged (A. Y. Ng, D. Harada, S. Russell, Policy
invariance under reward transformations, ICML 1999), if gamma is the learner's discount; 1 if not given. A difference
is paid when the vehicle comes nearer to the target along the way over the ground, and not only at the end.

**Time.** The deadline belongs to the mission, so being late is a termination and not a truncation: ``time_left`` is
observed.

The observation, with a row for each vehicle of a fleet, is

    time_left    [s] until the deadline
    status       0 ok, 1 initialising, 2 lost, 3 degraded
    covariance   of the estimate, only if requested

and the observation of the mission: ``mathnavi.sim.scenarios.flight_view`` of a flight, with attitude and rate of a
quadrotor; the estimate x and the way to the target of a missile; x of the others.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.loop import whole_ticks
from mathnavi.sim.environments.episode_runner import EpisodeRunner, EpisodeStep, Observation
from mathnavi.sim.scenarios.task import Inputs, Outcome

END_COSTS = {
    Outcome.ARRIVED: 0.0,
    Outcome.COMPLETED: 0.0,
    Outcome.LATE: 1.0,
    Outcome.MISSED: 1.0,
    Outcome.CRASHED: 2.0,
    Outcome.OFF_MAP: 2.0,
    Outcome.DIVERGED: 2.0,
}
"""cost C of each outcome"""


def checked_discount(discount: float) -> float:
    """Return gamma; ArgumentError for a value that is not a discount."""
    if not 0.0 < discount <= 1.0:
        raise ArgumentError(f"discount = {discount!r}; allowed: > 0 and <= 1")
    return float(discount)


class LearningEpisode:
    """Learning episodes of an ``EpisodeRunner``, one after the other."""

    def __init__(
        self, runner: EpisodeRunner, hold: float | None = None, discount: float = 1.0, covariance: bool = False
    ) -> None:
        """Build the episodes; ValueError for a scenario without learning terms, for a hold [s] that is not a whole
        number of periods of the tracker, for a wrong discount, and for a covariance that no estimator has.
        """
        wanted = runner.terms.hold if hold is None else hold
        self.hold = runner.period if wanted is None else wanted
        """time [s] for which an action is held"""
        self._repeats = whole_ticks(self.hold, runner.period, "hold") * runner.control_steps
        self._discount = checked_discount(discount)
        if covariance and not runner.has_covariance:
            raise ArgumentError("covariance = True; allowed: False, because the estimator has none")
        self.runner, self._covariance = runner, covariance
        self.inputs: Inputs = runner.inputs.bounded
        """inputs of each vehicle, within finite bounds"""
        self.example = self._observation()
        """example of an observation, for the shapes"""

    def begin(self, seed: int) -> tuple[Observation, dict[str, Any]]:
        """Begin a new episode; return its first observation, and ``info``."""
        self.runner.begin(seed)
        self._potential = self._of_state()
        return self._observation(), {"seed": seed, **self.runner.info(0)}

    def step(self, action: Any) -> EpisodeStep:
        """Hold an action (nu,), of a fleet (n, nu), clipped to its bounds.

        Raises ValueError for one of another shape or not finite, and if no episode has begun or it is over.
        """
        runner, inputs = self.runner, self.inputs
        runner.check_goes_on()
        terms = runner.terms
        self._check_outcome()
        commands = {name: np.clip(u, inputs.low, inputs.high) for name, u in runner.checked(action, inputs).items()}
        cost, events = 0.0, runner.events
        for _ in range(self._repeats):
            before = runner.t
            spent = runner.advance(commands)
            most = terms.cost_max * (runner.t - before)
            cost += most if terms.violated(runner.t, runner.truths) else min(spent, most)
            if runner.outcome is None and runner.t >= terms.deadline - TIME_TOLERANCE:
                runner.outcome = terms.at_deadline
            if runner.outcome is not None:
                break
        reward = -cost / (terms.cost_max * terms.deadline) - self._potential
        self._potential = self._of_state()
        reward += self._discount * self._potential
        if runner.outcome is not None:
            reward -= END_COSTS[runner.outcome]
        return EpisodeStep(self._observation(), reward, runner.outcome is not None, False, runner.info(events))

    def _check_outcome(self) -> None:
        if self.runner.outcome is not None:
            raise ArgumentError(f"step() at {self.runner.t:.6g} s: the episode is over; allowed: after reset()")

    def _of_state(self) -> float:
        """Return Phi of the present state."""
        if self.runner.outcome is not None:
            return 0.0
        return 0.0 - self.runner.terms.potential(self.runner.t, self.runner.truths)

    def _observation(self) -> Observation:
        """Return the observation in new arrays, which nothing that follows changes."""
        runner = self.runner
        views = [runner.terms.view(runner.t, name, runner.estimates[name]) for name in runner.names]
        left = np.array([max(runner.terms.deadline - runner.t, 0.0)])
        observation: Observation = {
            "time_left": runner.rows([left] * len(views)),
            **{part: runner.rows([view[part] for view in views]) for part in views[0]},
            "status": runner.status,
        }
        return observation | ({"covariance": runner.covariance} if self._covariance else {})
