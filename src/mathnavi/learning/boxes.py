"""Observations of any scenario as boxes of float32: VecNormalize, and much else, takes nothing else.

The status of an estimate is a number that counts nothing: it becomes four numbers, of which one is 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import VectorEnv

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.learning.observed import ObservedEnv, ObservedVectorEnv
from mathnavi.sim.environments.episode_runner import STATUSES

STATUS = "status"
_ONE_HOT = np.eye(len(STATUSES), dtype=np.float32)


class BoxObservations(ObservedEnv):
    """One environment whose observations are a dictionary of boxes of float32; ``status`` is (4,), one of them 1."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        """Wrap an environment; ArgumentError for one without a dictionary of observations."""
        super().__init__(env, as_boxes, boxes_of(env.observation_space))


class BoxVectorObservations(ObservedVectorEnv):
    """Many environments at once whose observations are dictionaries of boxes of float32."""

    def __init__(self, envs: VectorEnv[Any, Any, Any]) -> None:
        """Wrap environments; ArgumentError for those without a dictionary of observations."""
        super().__init__(envs, as_boxes, boxes_of(envs.single_observation_space))


def as_boxes(observation: Mapping[str, Any]) -> dict[str, Any]:
    """The observation of an environment, or of n of them, in float32."""
    return {
        name: _ONE_HOT[np.asarray(value)] if name == STATUS else np.asarray(value, np.float32)
        for name, value in observation.items()
    }


def boxes_of(space: spaces.Space[Any]) -> spaces.Dict:
    """The space of what ``as_boxes`` returns; ArgumentError for a space that is no dictionary of numbers."""
    if not isinstance(space, spaces.Dict):
        raise ArgumentError(f"env = an environment of {space}; allowed: one of a scenario, with a Dict of observations")
    return spaces.Dict({name: _box(name, each) for name, each in space.spaces.items()})


def _box(name: str, space: spaces.Space[Any]) -> spaces.Box:
    assert space.shape is not None
    if name == STATUS:
        return spaces.Box(0.0, 1.0, (*space.shape, len(STATUSES)), np.float32)
    return spaces.Box(-np.inf, np.inf, space.shape, np.float32)
