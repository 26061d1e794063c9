"""Environments of all scenarios as ``gymnasium.Env``, in two versions.

    import gymnasium, mathnavi.sim.environments
    env = gymnasium.make("mathnavi/SafeFlight-v1", seed=3, terrain="jacksboro", render_mode="rgb_array")

v1, ``LearningEnv``, is for learning: rewards, observations and terminations are those of
``mathnavi.sim.environments.learning``, and actions are bounded. v0, ``ScenarioEnv``, is the scenario itself: actions,
observations and rewards are those of ``mathnavi.sim.environments.dm``, ``terminated`` when the mission ends and
``truncated`` when the time is up. Both return in ``info`` the ``outcome`` of the mission, "" while it goes on, the
``clearance`` [m] of the true state if there is something to touch, and the kinds of the ``events`` of the step.

``render_mode="rgb_array"`` draws a picture of ``width`` x ``height`` pixels when ``render`` is called, "human" shows a
window from the first step on (``mathnavi.sim.environments.pictures``).

A copy, by ``pickle`` or ``copy.deepcopy``, is rebuilt from the fields and the seed. Its next episodes are those that
come next here; it has no present one until ``reset``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

try:
    import gymnasium
    from gymnasium import spaces
    from gymnasium.utils import RecordConstructorArgs
except ImportError as error:
    raise ImportError("Gymnasium is not installed; allowed: after pip install 'gymnasium>=1.4,<1.5'") from error

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.sim.environments.episode_runner import STATUSES, EpisodeRunner, EpisodeStep, Observation, drawn_seed
from mathnavi.sim.environments.filtering import EpisodeFilter
from mathnavi.sim.environments.learning import LearningEpisode
from mathnavi.sim.environments.pictures import FPS, HEIGHT, RENDER_MODES, WIDTH, checked_mode, checked_size, pictures
from mathnavi.sim.environments.resets import checked_options
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.task import Inputs


class ScenarioEnv(gymnasium.Env[Observation, Array]):
    """Environment of one mission of a scenario; the seeds of its episodes are drawn from ``np_random``."""

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FPS}  # noqa: RUF012  Gymnasium's

    def __init__(
        self,
        scenario: str,
        seed: int = 0,
        estimator: PluginSpec | str | None = None,
        render_mode: str | None = None,
        width: int = WIDTH,
        height: int = HEIGHT,
        **fields: Any,
    ) -> None:
        """Build the scenario with these fields, its mission drawn from ``seed``, its pictures ``width`` x ``height``
        pixels.

        Raises ValueError for names that are unknown, fields that are wrong, and a scenario with nothing to command.
        """
        self.render_mode = checked_mode(render_mode)
        self._size = checked_size(width, height)
        self._pictures = pictures(*self._size)
        self.episode = EpisodeRunner(RunSpec.of(scenario, seed, estimator=estimator, fields=fields))
        """mission, run in one episode after the other"""
        self.action_space = self.space_of(self.episode.inputs)
        self.observation_space = _observation_space(self.episode.example)

    def space_of(self, inputs: Inputs) -> spaces.Space[Any]:
        """Return the space of the commands to these inputs of every vehicle."""
        n = len(self.episode.names)
        low, high = (self.episode.rows([bound] * n) for bound in (inputs.low, inputs.high))
        return spaces.Box(low, high, dtype=np.float64)

    @property
    def mission(self) -> dict[str, Any]:
        """Start, target and bounds, as in a run's config.json."""
        return self.episode.mission

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; ``info["seed"]`` is its seed. There are no options: ArgumentError for any."""
        checked_options(options)
        super().reset(seed=seed)
        drawn = drawn_seed(self.np_random)
        return self._begun(drawn)

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold an action.

        Raises ValueError for one of another shape or not finite, and if no episode has begun or it is over.
        """
        made = self._made(action)
        if self.render_mode == "human":
            self._pictures.show(self.episode)
        return made.observation, made.reward, made.terminated, made.truncated, made.info

    def render(self) -> Any:
        """Return picture (height, width, 3) of the present state, uint8, for "rgb_array"; None for the other modes."""
        return self._pictures.drawn(self.episode) if self.render_mode == "rgb_array" else None

    def close(self) -> None:
        """Close the window and free the renderer."""
        self._pictures.close()

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_pictures"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__ |= state
        self._pictures = pictures(*self._size)  # a process and windows, which no copy can share

    def _begun(self, seed: int) -> tuple[Observation, dict[str, Any]]:
        return self.episode.begin(seed), {"seed": seed, **self.episode.info(0)}

    def _made(self, action: Array) -> EpisodeStep:
        return self.episode.step(action)


class LearningEnv(ScenarioEnv):
    """Environment for learning of one mission of a scenario; the seeds of its episodes are drawn from ``np_random``."""

    def __init__(
        self,
        scenario: str,
        seed: int = 0,
        estimator: PluginSpec | str | None = None,
        render_mode: str | None = None,
        width: int = WIDTH,
        height: int = HEIGHT,
        hold: float | None = None,
        discount: float = 1.0,
        covariance: bool = False,
        **fields: Any,
    ) -> None:
        """Build a ``LearningEpisode`` with ``hold`` [s], ``discount`` and ``covariance``; the rest as of a
        ``ScenarioEnv``.

        Raises ValueError as those do.
        """
        super().__init__(scenario, seed, estimator, render_mode, width, height, **fields)
        self._learning = LearningEpisode(self.episode, hold, discount, covariance)
        self.action_space = self.space_of(self._learning.inputs)
        self.observation_space = _observation_space(self._learning.example)

    @property
    def hold(self) -> float:
        """Time [s] for which an action is held."""
        return self._learning.hold

    def _begun(self, seed: int) -> tuple[Observation, dict[str, Any]]:
        return self._learning.begin(seed)

    def _made(self, action: Array) -> EpisodeStep:
        return self._learning.step(action)


class SafetyFilterWrapper(gymnasium.Wrapper[Observation, Array, Observation, Array], RecordConstructorArgs):
    """Wrapper that filters commands before they are held: no proposed command leads into the ground.

        env = SafetyFilterWrapper(gymnasium.make("mathnavi/SafeFlight-v0"))

    ``info["filter"]`` holds the decision (``mathnavi.sim.environments.filtering``). It wraps the environment itself,
    inside of wrappers that change actions.
    """

    def __init__(self, env: gymnasium.Env[Observation, Array]) -> None:
        """Wrap an environment; ArgumentError for one of another kind than a scenario, or without a safety filter."""
        RecordConstructorArgs.__init__(self)  # so that an EnvSpec holds it
        gymnasium.Wrapper.__init__(self, env)
        if type(env.unwrapped) is not ScenarioEnv:
            raise ArgumentError(f"env = a {type(env.unwrapped).__name__}; allowed: a ScenarioEnv, version 0")
        self._filter = EpisodeFilter(env.unwrapped.episode)
        self.action_space = env.unwrapped.space_of(self._filter.inputs)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode, with new filters."""
        begun = self.env.reset(seed=seed, options=options)
        self._filter.begin()
        return begun

    def step(self, action: Array) -> tuple[Observation, Any, bool, bool, dict[str, Any]]:
        """Hold the filtered action for a period; the reward is that of the whole period."""
        total, proposed = 0.0, self._filter.proposed(action)
        for _ in range(self._filter.repeats):
            observation, reward, terminated, truncated, info = self.env.step(self._filter.filtered(proposed))
            total += float(reward)
            if terminated or truncated:
                break
        return observation, total, terminated, truncated, {**info, "filter": self._filter.decided()}


def _observation_space(example: Observation) -> spaces.Dict:
    return spaces.Dict({name: _space(name, value) for name, value in example.items()})


def _space(name: str, value: Any) -> spaces.Space[Any]:
    if name != "status":
        return spaces.Box(-np.inf, np.inf, np.shape(value), np.float64)
    count = len(STATUSES)
    return spaces.MultiDiscrete(np.full(np.shape(value), count)) if np.ndim(value) else spaces.Discrete(count)
