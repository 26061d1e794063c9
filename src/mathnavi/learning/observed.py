"""Wrappers of environments, one or many at once, that change what is observed, in an episode's last step too."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv, VectorWrapper
from gymnasium.vector.utils import batch_space

from mathnavi.interfaces.signals import Array

FINAL = "final_obs"  # key of ``info`` for the last observations of episodes whose next one has begun

Observed = Callable[[Any], Any]
"""function from the observation of an environment, or of n of them, to what is shown in its place"""


class ObservedEnv(gymnasium.Wrapper[Any, Any, Any, Any]):
    """One environment whose observations are changed."""

    def __init__(self, env: gymnasium.Env[Any, Any], observed: Observed, space: spaces.Space[Any]) -> None:
        """Show ``observed(observation)``, which is in ``space``."""
        super().__init__(env)
        self._observed = observed
        self.observation_space = space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        return self._observed(observation), info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Hold an action."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        return self._observed(observation), reward, terminated, truncated, info


class ObservedVectorEnv(VectorWrapper):
    """Many environments at once whose observations are changed."""

    def __init__(self, envs: VectorEnv[Any, Any, Any], observed: Observed, space: spaces.Space[Any]) -> None:
        """Show ``observed(observations)``; a row of it is in ``space``."""
        super().__init__(envs)
        self._observed = observed
        self.single_observation_space = space
        self.observation_space = batch_space(space, envs.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        observations, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]  # lists too
        return self._observed(observations), self._with_final(info)

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Hold an action in every row."""
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        return self._observed(observations), rewards, terminated, truncated, self._with_final(info)

    def _with_final(self, info: dict[str, Any]) -> dict[str, Any]:
        """``info`` with the last observations changed too."""
        if FINAL not in info:
            return info
        shown = np.full(self.num_envs, None, dtype=object)
        for i, last in enumerate(info[FINAL]):
            if last is not None:
                shown[i] = first_row(self._observed(in_a_row(last)))
        return info | {FINAL: shown}


def in_a_row(observation: Mapping[str, Any]) -> dict[str, Array]:
    """An observation as that of a single row."""
    return {name: np.asarray(value)[np.newaxis] for name, value in observation.items()}


def first_row(observations: Any) -> Any:
    """The observation of the first row."""
    return {k: v[0] for k, v in observations.items()} if isinstance(observations, dict) else observations[0]
