"""The safety filter around the commands of an episode, for the wrappers of Gymnasium and dm_env.

Each vehicle has a filter of its own (``mathnavi.controllers.flight.command_filter``), which sees its estimate and never
the truth. It guards a vehicle against the ground and the edge of the map; what it knows of the map is what is charted
at the start. It does not keep the vehicles of a fleet apart.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mathnavi.controllers.flight.command_filter import CommandFilter
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.interfaces.signals import Array


class EpisodeFilter:
    """Filter of the commands to all vehicles of an episode."""

    def __init__(self, episode: EpisodeRunner) -> None:
        """ValueError for a scenario that states no safety filter."""
        self._episode = episode
        self._filters: Mapping[str, CommandFilter] = episode.filters()
        self._interventions = dict.fromkeys(episode.names, 0)

    def begin(self) -> None:
        """Fresh filters, for a new episode."""
        self._filters = self._episode.filters()
        self._interventions = dict.fromkeys(self._episode.names, 0)

    def filtered(self, proposed: Any) -> tuple[Array, dict[str, Any]]:
        """The command (nu,), of a fleet (n, nu), in place of a proposed one, and what was decided.

        That is ``FilteredCommand.info``, with the number of "interventions" so far and what is "guarded"; of a fleet
        one for each vehicle, by its name. ValueError for a command of another shape or not finite.
        """
        commands, infos = [], {}
        for name, u in self._episode.checked(proposed).items():
            answer = self._filters[name].step(self._episode.t, self._episode.estimates[name], u)
            self._interventions[name] += answer.intervened
            commands.append(answer.u)
            infos[name] = {**answer.info(u), "interventions": self._interventions[name], "guarded": ("ground", "map")}
        return self._episode.rows(commands), infos if len(infos) > 1 else next(iter(infos.values()))
