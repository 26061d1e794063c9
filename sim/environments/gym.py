"""Every scenario as a ``gymnasium.Env``: actions, observations and rewards are those of
``mathnavi.sim.environments.dm``.

    import gymnasium, mathnavi.sim.environments
    env = gymnasium.make("mathnavi/SafeFlight-v0", seed=3, terrain="jacksboro")

An episode is ``terminated`` where the mission itself ends and ``truncated`` where the time is up. There is no render
mode: a picture of a scenario is drawn from a whole run.
"""

from __future__ import annotations

from typing import Any

import numpy as np

try:
    import gymnasium
    from gymnasium import spaces
except ImportError as error:
    raise ImportError("Gymnasium is not installed; allowed: after pip install 'gymnasium>=1.4,<1.5'") from error

from mathnavi.sim.environments.episode_runner import STATUSES, EpisodeRunner, Observation, drawn_seed
from mathnavi.sim.environments.filtering import EpisodeFilter
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.scenarios.task import Inputs


class ScenarioEnv(gymnasium.Env[Observation, Array]):
    """A mission of a scenario; the seeds of its episodes are drawn from ``np_random``."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  as Gymnasium declares it

    def __init__(self, scenario: str, seed: int = 0, estimator: PluginSpec | str | None = None, **fields: Any) -> None:
        """The scenario with these fields, its mission drawn from ``seed``.

        ValueError for what is unknown or wrong, and for a scenario with nothing to command.
        """
        self.episode = EpisodeRunner(scenario, seed, estimator, fields)
        """the mission, one episode after the other"""
        self.action_space = self.space_of(self.episode.inputs)
        self.observation_space = spaces.Dict(
            {name: _space(name, value) for name, value in self.episode.example.items()}
        )

    def space_of(self, inputs: Inputs) -> spaces.Space[Any]:
        """Space of the commands to such inputs of every vehicle."""
        n = len(self.episode.names)
        low, high = (self.episode.rows([bound] * n) for bound in (inputs.low, inputs.high))
        return spaces.Box(low, high, dtype=np.float64)

    @property
    def mission(self) -> dict[str, Any]:
        """Start, target and bounds, as a run's config.json has them."""
        return self.episode.mission

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; ``info["seed"]`` is its own. There are no options."""
        super().reset(seed=seed)
        drawn = drawn_seed(self.np_random)
        return self.episode.begin(drawn), {"seed": drawn}

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold an action for a period.

        ValueError for one of another shape or not finite, and where no episode has begun or it is over.
        """
        made = self.episode.step(action)
        return made.observation, made.reward, made.terminated, made.truncated, {}


class SafetyFilterWrapper(gymnasium.Wrapper[Observation, Array, Observation, Array]):
    """Commands that are filtered before they are held: nothing that is proposed leads into the ground.

        env = SafetyFilterWrapper(gymnasium.make("mathnavi/SafeFlight-v0"))

    ``info["filter"]`` says what was decided (``mathnavi.sim.environments.filtering``). It stands around the environment
    itself, within wrappers that change actions.
    """

    def __init__(self, env: gymnasium.Env[Observation, Array]) -> None:
        """ValueError for an environment that is no scenario, or whose scenario states no safety filter."""
        super().__init__(env)
        if not isinstance(env.unwrapped, ScenarioEnv):
            raise ValueError(f"env = a {type(env.unwrapped).__name__}; allowed: a ScenarioEnv")
        self._filter = EpisodeFilter(env.unwrapped.episode)
        self.action_space = env.unwrapped.space_of(self._filter.inputs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, with fresh filters."""
        begun = self.env.reset(seed=seed, options=options)
        self._filter.begin()
        return begun

    def step(self, action: Array) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """Hold the filtered action for a period; the reward is that of the whole period."""
        total = 0.0
        for _ in range(self._filter.repeats):
            observation, reward, terminated, truncated, info = self.env.step(self._filter.filtered(action))
            total += float(reward)
            if terminated or truncated:
                break
        return observation, total, terminated, truncated, {**info, "filter": self._filter.decided()}


def _space(name: str, value: Any) -> spaces.Space[Any]:
    if name != "status":
        return spaces.Box(-np.inf, np.inf, np.shape(value), np.float64)
    return spaces.MultiDiscrete(np.full(np.shape(value), len(STATUSES))) if np.ndim(value) else spaces.Discrete(3)
