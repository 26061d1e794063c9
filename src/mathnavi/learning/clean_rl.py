"""Many missions at once as the scripts of CleanRL read them, which are written for Gymnasium 0.29.

What has changed since is how the end of an episode is reported: there ``infos["final_info"]`` is a list with a
dictionary, or None, for each row, whose "episode" holds return and length, and ``infos["final_observation"]`` the last
observations. Its scripts need boxes, so ``VelocityFlights`` stands inside.
"""

from __future__ import annotations

from typing import Any

from gymnasium.vector import VectorEnv, VectorWrapper

from mathnavi.interfaces.signals import Array
from mathnavi.learning.episodes import Episodes, check_resets, of_row


class CleanRlEnv(VectorWrapper):
    """Environments of Gymnasium, many at once, for a script of CleanRL: ``envs = CleanRlEnv(...)``."""

    def __init__(self, envs: VectorEnv[Any, Any, Any]) -> None:
        """Wrap environments; ArgumentError unless each begins its next episode in the step that ends the last."""
        check_resets(envs)
        super().__init__(envs)
        self._episodes = Episodes(envs.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode everywhere."""
        self._episodes.begin()
        return self.env.reset(seed=seed, options=options)  # type: ignore[arg-type]  # lists too

    def step(self, actions: Array) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Hold an action in every row."""
        observations, rewards, terminated, truncated, info = self.env.step(actions)
        ended = self._episodes.step(rewards, terminated | truncated)
        if ended:
            final = [
                {**of_row(info["final_info"], i), "episode": ended[i]} if i in ended else None
                for i in range(self.num_envs)
            ]
            info = info | {"final_info": final, "final_observation": info["final_obs"]}
        return observations, rewards, terminated, truncated, info
