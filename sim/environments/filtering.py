"""Safety filter of the commands of an episode, for the wrappers of Gymnasium and dm_env.

Each vehicle has its own filter (``mathnavi.controllers.flight.command_filter``), which sees its estimate and never
the truth. It guards a vehicle against the ground and the edge of the map; it knows only the part of the map that is
charted at the start. It does not keep the vehicles of a fleet apart.

To point masses an acceleration is proposed for each period of the tracker. To a quadrotor accelerations are proposed
too, for each period of its planner, and not thrusts: its tracker flies them, because from an arbitrary attitude no way
to rest can be certified.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from mathnavi.controllers.flight.command_filter import FilteredCommand
from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.loop import whole_ticks
from mathnavi.sim.environments.episode_runner import EpisodeRunner
from mathnavi.sim.scenarios.task import Inputs


class EpisodeFilter:
    """Filter of the commands to all vehicles of an episode."""

    def __init__(self, episode: EpisodeRunner) -> None:
        """Build the filters; ValueError for a scenario that defines no safety filter."""
        self._episode = episode
        self.begin()
        hold = next(iter(self._filters.values())).hold
        self.repeats = whole_ticks(hold, episode.period, "the time for which a command is held")
        """number of periods of the tracker for which a proposal is held"""

    def __reduce__(self) -> tuple[type[EpisodeFilter], tuple[EpisodeRunner]]:
        return EpisodeFilter, (self._episode,)  # a copy has the filters of a new episode

    @property
    def inputs(self) -> Inputs:
        """Inputs for the commands that may be proposed to each vehicle."""
        return self._episode.proposals

    def begin(self) -> None:
        """Make new filters for a new episode."""
        self._filters = self._episode.filters()
        self._interventions = dict.fromkeys(self._episode.names, 0)
        self._answers: dict[str, list[FilteredCommand]] = {name: [] for name in self._episode.names}

    def proposed(self, action: Any) -> Array:
        """Return an action as a proposal for several periods of the tracker; ArgumentError as of ``filtered``."""
        return self._episode.rows([*self._episode.checked(action, self.inputs).values()])

    def filtered(self, proposed: Any) -> Any:
        """Return the command (nu,) for the tracker's period, of a fleet (n, nu), in place of a proposed one.

        Raises ValueError for a proposal of another shape or not finite.
        """
        commands = []
        for name, u in self._episode.checked(proposed, self.inputs).items():
            answer = self._filters[name].step(self._episode.t, self._episode.estimates[name], u)
            self._answers[name].append(answer)
            commands.append(answer.u)
        return self._episode.rows(commands)

    def decided(self) -> dict[str, Any]:
        """Return the decisions since the last call, for one proposal; of a fleet by vehicle.

        That is ``FilteredCommand.info``, including all that was announced meanwhile, with the number of
        "interventions" so far and what is "guarded".
        """
        infos = {}
        for name, answers in self._answers.items():
            self._interventions[name] += answers[0].intervened
            worst = next((answer for answer in answers if answer.announced), answers[-1])
            whole = dataclasses.replace(worst, breach=any(answer.breach for answer in answers))
            infos[name] = {**whole.info(), "interventions": self._interventions[name], "guarded": ("ground", "map")}
            answers.clear()
        return infos if len(infos) > 1 else next(iter(infos.values()))
