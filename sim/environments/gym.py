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
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.plugin.registry import PluginSpec


class ScenarioEnv(gymnasium.Env[Observation, Array]):
    """A mission of a scenario; the seeds of its episodes are drawn from ``np_random``."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  as Gymnasium declares it

    def __init__(self, scenario: str, seed: int = 0, estimator: PluginSpec | str | None = None, **fields: Any) -> None:
        """The scenario with these fields, its mission drawn from ``seed``.

        ValueError for what is unknown or wrong, and for a scenario with nothing to command.
        """
        self._episode = EpisodeRunner(scenario, seed, estimator, fields)
        inputs, n = self._episode.inputs, len(self._episode.names)
        low, high = (self._episode.rows([bound] * n) for bound in (inputs.low, inputs.high))
        self.action_space = spaces.Box(low, high, dtype=np.float64)
        self.observation_space = spaces.Dict(
            {name: _space(name, value) for name, value in self._episode.example.items()}
        )

    @property
    def mission(self) -> dict[str, Any]:
        """Start, target and bounds, as a run's config.json has them."""
        return self._episode.mission

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; ``info["seed"]`` is its own. There are no options."""
        super().reset(seed=seed)
        drawn = drawn_seed(self.np_random)
        return self._episode.begin(drawn), {"seed": drawn}

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Hold an action for a period.

        ValueError for one of another shape or not finite, and where no episode has begun or it is over.
        """
        made = self._episode.step(action)
        return made.observation, made.reward, made.terminated, made.truncated, {}


def _space(name: str, value: Any) -> spaces.Space[Any]:
    if name != "status":
        return spaces.Box(-np.inf, np.inf, np.shape(value), np.float64)
    return spaces.MultiDiscrete(np.full(np.shape(value), len(STATUSES))) if np.ndim(value) else spaces.Discrete(3)
