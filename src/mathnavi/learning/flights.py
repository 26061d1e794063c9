"""Environments of ``safe-flight`` in which a velocity is chosen: wrappers of Gymnasium for one mission and for many."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv
from gymnasium.vector.utils import batch_space

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.learning.observed import ObservedEnv, ObservedVectorEnv, first_row, in_a_row
from mathnavi.learning.velocity import FEATURES, VelocityControl, features

OBSERVED = spaces.Box(-np.inf, np.inf, (FEATURES,), np.float32)
CHOSEN = spaces.Box(-1.0, 1.0, (3,), np.float32)


class VelocityFlight(ObservedEnv):
    """One mission: features (42,) are observed, and an action (3,) from -1 to 1 is a velocity over the fastest."""

    def __init__(self, env: gymnasium.Env[Any, Any], control: VelocityControl | None = None) -> None:
        """Wrap an environment; ArgumentError for one that is not a flight of one point mass, for learning."""
        _check(env.observation_space, env.action_space)
        super().__init__(env, lambda observation: first_row(features(in_a_row(observation))), OBSERVED)
        self.action_space = CHOSEN
        self._control = VelocityControl() if control is None else control
        self._last: dict[str, Array] = {}

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._last = in_a_row(observation)
        return self._observed(observation), info

    def step(self, action: Array) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Accelerate towards the velocity; ArgumentError before ``reset``."""
        u = self._control.accelerations(np.asarray(action)[np.newaxis], self._last)[0]
        observation, reward, terminated, truncated, info = self.env.step(u)
        self._last = in_a_row(observation)
        return self._observed(observation), reward, terminated, truncated, info


class VelocityFlights(ObservedVectorEnv):
    """Many missions at once: features (n, 42) are observed, and actions (n, 3) are velocities over the fastest."""

    def __init__(self, envs: VectorEnv[Any, Any, Any], control: VelocityControl | None = None) -> None:
        """Wrap environments; ArgumentError for those that are not flights of one point mass each, for learning."""
        _check(envs.single_observation_space, envs.single_action_space)
        super().__init__(envs, features, OBSERVED)
        self.single_action_space, self.action_space = CHOSEN, batch_space(CHOSEN, envs.num_envs)
        self._control = VelocityControl() if control is None else control
        self._last: dict[str, Array] = {}

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin episodes."""
        self._last, info = self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]  # lists too
        return self._observed(self._last), self._with_final(info)

    def step(self, actions: Array) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Accelerate towards the velocities; ArgumentError before ``reset``."""
        u = self._control.accelerations(actions, self._last)
        self._last, rewards, terminated, truncated, info = self.env.step(u)
        return self._observed(self._last), rewards, terminated, truncated, self._with_final(info)


def _check(observed: spaces.Space[Any], commanded: spaces.Space[Any]) -> None:
    """Raise ArgumentError for the spaces of anything but a flight of one point mass."""
    parts = set(observed.spaces) if isinstance(observed, spaces.Dict) else set()
    if not {"horizon", "slope_ahead", "target"} <= parts or "attitude" in parts or commanded.shape != (3,):
        raise ArgumentError(
            f"env = an environment of {observed} and {commanded}; allowed: mathnavi/SafeFlight-v1, of one vehicle"
        )
