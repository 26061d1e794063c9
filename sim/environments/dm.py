"""Environments of all scenarios as ``dm_env.Environment``.

    from mathnavi.sim.environments.dm import load, load_learning
    environment = load("safe-flight", seed=3, terrain="jacksboro")
    environment = load_learning("safe-flight", seed=3, terrain="jacksboro")

``load_learning`` makes one for learning, v1 in Gymnasium: rewards, observations and terminations are those of
``mathnavi.sim.environments.learning``. The rest of this text is on ``load``, v0.

An action commands the actuators for one period of the scenario's tracker; it has the bounds of the scenario's inputs,
and is unbounded where they have none. The observation is the estimate
(``mathnavi.sim.environments.episode_runner``). The reward is minus the scenario's stage cost over the step, int L dt
with

    safe-flight            |a|^2 + beta, the running cost of (A.2), beta = 100 m^2/s^4
    simultaneous-arrival   the same, summed over the vehicles
    quadrotor-canyon       the same with the acceleration of the vehicle, beta at its scale
    missile-guidance       the running cost of its case (B.4)
    range-localisation     the squared error of the estimated pose, modulo symmetry, [m^2] and [rad^2] added (C.5)
    attitude-tracking      the squared angle to the reference [rad^2]
    arm-velocity           |Delta v|^2, the squared error of the estimated velocity (D.5, D.6), as of sphere-observer
    textbook-observer      |x^ - x|^2, the squared error of the estimate (Definition 2.2)

The discount is 0 when the mission terminates: the vehicle arrives, touches something or leaves every bound. When the
time is up it is 1, which is a truncation. A failure, a crash for example, costs nothing but the steps until then: a
wrapper decides what it costs.

A copy, by ``pickle`` or ``copy.deepcopy``, is rebuilt from the fields and the seed. Its next episodes are those that
come next here; it has no present one until ``reset``.
"""

from __future__ import annotations

from typing import Any

import dm_env
import numpy as np
from dm_env import specs

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.environments.episode_runner import STATUSES, EpisodeRunner, EpisodeStep, Observation, drawn_seed
from mathnavi.sim.environments.filtering import EpisodeFilter
from mathnavi.sim.environments.learning import LearningEpisode
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.task import Inputs


def load(scenario: str, *, seed: int = 0, estimator: PluginSpec | str | None = None, **fields: Any) -> Environment:
    """Make an environment of a scenario with these fields, with the estimator given or the scenario's default.

    ``seed`` draws the mission, and a generator of the same seed the seeds of the episodes. Nested fields are mappings,
    ``noise={"position": 5.0}``. Raises ValueError for names that are unknown, fields that are wrong, and a scenario
    with nothing to command.
    """
    return environment_of(RunSpec.of(scenario, seed, estimator=estimator, fields=fields))


def environment_of(spec: RunSpec) -> Environment:
    """Make an environment of a run, otherwise as ``load``."""
    return Environment(EpisodeRunner(spec), np.random.default_rng(spec.seed))


def load_learning(
    scenario: str,
    *,
    seed: int = 0,
    estimator: PluginSpec | str | None = None,
    hold: float | None = None,
    discount: float = 1.0,
    covariance: bool = False,
    **fields: Any,
) -> LearningEnvironment:
    """Make an environment for learning of a scenario with these fields, otherwise as ``load``.

    ``hold`` [s], ``discount`` and ``covariance`` are those of a ``LearningEpisode``. Raises ValueError as ``load``.
    """
    episode = EpisodeRunner(RunSpec.of(scenario, seed, estimator=estimator, fields=fields))
    return LearningEnvironment(LearningEpisode(episode, hold, discount, covariance), np.random.default_rng(seed))


class Environment(dm_env.Environment):
    """Environment of one mission: a sequence of episodes, each with a seed drawn from ``seeds``."""

    def __init__(self, episode: EpisodeRunner, seeds: np.random.Generator) -> None:
        self.episode, self._seeds = episode, seeds
        self.fresh = True
        """whether the next step begins an episode"""
        self.episode_seed: int | None = None
        """seed of the present episode; a run of the scenario with it has the same noise and the same gusts"""
        self.info: dict[str, Any] = {}
        """information on the last step: outcome, clearance and events (``EpisodeRunner.info``)"""
        self._observation_spec = _specs(episode.example)

    @property
    def mission(self) -> dict[str, Any]:
        """Start, target and bounds, as in a run's config.json."""
        return self.episode.mission

    @property
    def recording(self) -> Recording:
        """Return the log of the present episode, including the truth."""
        return self.episode.recording

    def reset(self) -> dm_env.TimeStep:
        """Begin the next episode."""
        self.fresh = False
        self.episode_seed = drawn_seed(self._seeds)
        return dm_env.restart(self._begun(self.episode_seed))

    def step(self, action: Any) -> dm_env.TimeStep:
        """Hold an action for a period; before the first episode and after the end of one, begin the next instead.

        Raises ValueError for an action of another shape or not finite.
        """
        if self.fresh:
            return self.reset()
        made = self._made(action)
        self.fresh, self.info = made.last, made.info
        if made.terminated:
            return dm_env.termination(made.reward, made.observation)
        if made.truncated:
            return dm_env.truncation(made.reward, made.observation)
        return dm_env.transition(made.reward, made.observation)

    def action_spec(self) -> specs.Array:
        """Return the spec of the action (nu,), of a fleet (n, nu); its name holds the commands with units."""
        return self.spec_of(self.episode.inputs)

    def spec_of(self, inputs: Inputs) -> specs.Array:
        """Return the spec of the commands to these inputs of every vehicle."""
        low, high = (self.episode.rows([bound] * len(self.episode.names)) for bound in (inputs.low, inputs.high))
        name = ", ".join(inputs.names)
        if np.isinf(low).any() or np.isinf(high).any():
            return specs.Array(low.shape, np.float64, name)
        return specs.BoundedArray(low.shape, np.float64, low, high, name)

    def observation_spec(self) -> dict[str, specs.Array]:
        """Return the specs of the observation, by name."""
        return self._observation_spec

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "fresh": True, "episode_seed": None, "info": {}}

    def _begun(self, seed: int) -> Observation:
        observation = self.episode.begin(seed)
        self.info = self.episode.info(0)
        return observation

    def _made(self, action: Any) -> EpisodeStep:
        return self.episode.step(action)


class LearningEnvironment(Environment):
    """Environment for learning of one mission: a sequence of episodes, each with a seed drawn from ``seeds``."""

    def __init__(self, learning: LearningEpisode, seeds: np.random.Generator) -> None:
        super().__init__(learning.runner, seeds)
        self._learning = learning
        self._observation_spec = _specs(learning.example)

    def action_spec(self) -> specs.Array:
        """Return the spec of the action (nu,), of a fleet (n, nu), bounded; its name holds the commands with units."""
        return self.spec_of(self._learning.inputs)

    def _begun(self, seed: int) -> Observation:
        observation, self.info = self._learning.begin(seed)
        return observation

    def _made(self, action: Any) -> EpisodeStep:
        return self._learning.step(action)


class FilteredEnvironment(dm_env.Environment):
    """Environment whose commands are filtered before they are held: no proposed command leads into the ground.

    environment = FilteredEnvironment(load("safe-flight"))
    """

    def __init__(self, environment: Environment) -> None:
        """Wrap an environment; ArgumentError for one for learning, and for a scenario that defines no safety filter."""
        if isinstance(environment, LearningEnvironment):
            raise ArgumentError("environment = a LearningEnvironment; allowed: one that load() made")
        self.environment = environment
        self.info: dict[str, Any] = {}
        """decision of the filter at the last step (``mathnavi.sim.environments.filtering``)"""
        self._filter = EpisodeFilter(environment.episode)

    def reset(self) -> dm_env.TimeStep:
        """Begin the next episode, with fresh filters."""
        begun = self.environment.reset()
        self._filter.begin()
        self.info = {}
        return begun

    def step(self, action: Any) -> dm_env.TimeStep:
        """Hold the filtered action for a period; before the first episode and after the end of one, begin the next."""
        if self.environment.fresh:
            return self.reset()
        reward, proposed = 0.0, self._filter.proposed(action)
        for _ in range(self._filter.repeats):
            made = self.environment.step(self._filter.filtered(proposed))
            reward += made.reward
            if made.last():
                break
        self.info = self._filter.decided()
        return made._replace(reward=reward)

    def action_spec(self) -> specs.Array:
        """Return the spec of the commands that may be proposed."""
        return self.environment.spec_of(self._filter.inputs)

    def observation_spec(self) -> dict[str, specs.Array]:
        """Return the specs of the observation."""
        return self.environment.observation_spec()


def _specs(example: Observation) -> dict[str, specs.Array]:
    return {name: _spec(name, value) for name, value in example.items()}


def _spec(name: str, value: Any) -> specs.Array:
    if name != "status":
        return specs.Array(np.shape(value), np.float64, name)
    return specs.BoundedArray(np.shape(value), np.int64, 0, len(STATUSES) - 1, name)
