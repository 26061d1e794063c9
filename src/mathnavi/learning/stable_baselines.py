"""Many missions at once as Stable-Baselines3 wants them: a ``VecEnv`` over a vector environment of Gymnasium."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

try:
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import VecEnv
except ModuleNotFoundError as error:
    if error.name not in ("stable_baselines3", "torch"):
        raise
    raise ImportError("Stable-Baselines3 is not installed; allowed: after pip install 'mathnavi[learn]'") from error

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array
from mathnavi.learning.episodes import Episodes, check_resets, of_row


class StableBaselinesEnv(VecEnv):
    """Environments of Gymnasium, many at once, for a learner of Stable-Baselines3.

    The return and the length of an episode are in ``info["episode"]`` of its last step, as by SB3's Monitor, and what
    it observed last in ``info["terminal_observation"]``.
    """

    def __init__(self, envs: VectorEnv[Any, Any, Any]) -> None:
        """Wrap environments; ArgumentError unless each begins its next episode in the step that ends the last."""
        check_resets(envs)
        self.envs = envs
        self._episodes, self._actions = Episodes(envs.num_envs), np.empty(0)
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> Any:
        """Begin an episode everywhere, from the seeds that ``seed`` has set."""
        seeds: Any = None if all(seed is None for seed in self._seeds) else list(self._seeds)
        observations, info = self.envs.reset(seed=seeds)
        self._reset_seeds()
        self._episodes.begin()
        self.reset_infos = [of_row(info, i) for i in range(self.num_envs)]
        return observations

    def step_async(self, actions: Array) -> None:
        """Keep the actions for ``step_wait``."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Array, Array, list[dict[str, Any]]]:
        """Hold the actions."""
        observations, rewards, terminated, truncated, info = self.envs.step(self._actions)
        over = terminated | truncated
        infos = [of_row(info, i) for i in range(self.num_envs)]
        for i, episode in self._episodes.step(rewards, over).items():
            infos[i] = {
                **of_row(info["final_info"], i),
                "terminal_observation": info["final_obs"][i],
                "TimeLimit.truncated": bool(truncated[i] and not terminated[i]),
                "episode": episode,
            }
        return observations, np.asarray(rewards, np.float32), over, infos

    def close(self) -> None:
        """Close the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """An attribute of the environments, or of what is wrapped in them, once for each row asked for."""
        owner = self.envs if hasattr(self.envs, attr_name) else self.envs.unwrapped
        return [getattr(owner, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: int | Iterable[int] | None = None) -> None:
        """Refused: the rows are one environment."""
        raise ArgumentError(f"set_attr({attr_name!r}): the rows are one environment; allowed: its own arguments")

    def env_method(
        self, method_name: str, *args: Any, indices: int | Iterable[int] | None = None, **kwargs: Any
    ) -> list[Any]:
        """Refused: the rows are one environment."""
        called = f"env_method({method_name!r})"
        raise ArgumentError(f"{called}: the rows are one environment; allowed: methods of .envs")

    def env_is_wrapped(self, wrapper_class: type[Any], indices: int | Iterable[int] | None = None) -> list[bool]:
        """True for a Monitor, whose words these environments say themselves."""
        return [issubclass(wrapper_class, Monitor)] * len(list(self._get_indices(indices)))

    def get_images(self) -> Sequence[Any]:
        """No pictures: environments that are many at once draw none."""
        return [None] * self.num_envs
