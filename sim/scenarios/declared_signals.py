"""Names of the signals that a scenario and its estimator declare, and the true values of what there is to estimate.

A scenario may have ``estimands(config, truth)``, which returns by "name [unit]" an array (n,) of the true states
(n, nx): the east [m] and the heading [rad] of a rover whose estimator knows no more. An estimator may have ``numbers``,
the "name [unit]" of each number of its estimates; without them they are called as the states, or as the estimands,
whichever are as many. Its ``figures`` has the names of the numbers of ``Estimate.extra``, by its keys.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.short_tables import counted
from mathnavi.interfaces.signal_names import SignalNames, figure_names
from mathnavi.interfaces.signals import Array, Event
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.scenarios.task import Task

Estimands = Callable[[Array], Mapping[str, Array]]
"""function of true states (n, nx) to the true values (n,) of what there is to estimate, by "name [unit]" """


def check_declared(plant: Plant, agents: Mapping[str, Agent], estimands: Estimands | None) -> None:
    """Check the declarations before a run; ArgumentError for numbers without names, and for what is no estimand."""
    for vehicle, agent in agents.items():
        _numbers(vehicle, agent)
        figure_names(agent.estimator)
        if estimands is not None:
            true_values(estimands, plant.state(vehicle)[None])


def name_signals(
    recording: Recording, agents: Mapping[str, Agent], task: Task | None, estimands: Estimands | None
) -> None:
    """Write into the recording of a run the declared names and the estimands.

    Names of an estimate that are not as many as its numbers are an event, and not used.
    """
    for vehicle, agent in agents.items():
        names = with_inputs(recording.signals[vehicle], task, vehicle, agent.input_size)
        numbers = _numbers(vehicle, agent)
        sizes = {len(estimate.x) for estimate in recording.agents[vehicle].estimates}
        if numbers and sizes - {len(numbers)}:
            message = (
                f"the estimator names {counted(len(numbers), 'number')}; an estimate has {max(sizes - {len(numbers)})}"
            )
            recording.events.append(Event(float(recording.t[-1]), vehicle, "estimate-names", message))
        elif numbers:
            names = replace(names, estimates=numbers)
        if figures := figure_names(agent.estimator):
            names = replace(names, figures=figures)
        if estimands is not None:
            values = true_values(estimands, recording.truths[vehicle])
            names = replace(names, estimands=tuple(values))
            recording.estimands[vehicle] = np.column_stack(list(values.values()))
        recording.signals[vehicle] = names


def with_inputs(names: SignalNames, task: Task | None, vehicle: str, size: int) -> SignalNames:
    """Return the names with those that a task gives to the inputs (``size``,) of a vehicle, if it names them."""
    given = task.inputs[vehicle].names if task is not None and vehicle in task.inputs else ()
    return replace(names, inputs=given) if len(given) == size else names


def true_values(estimands: Estimands, truth: Array) -> dict[str, Array]:
    """Return the true values (n,) of what there is to estimate, of true states (n, nx); ArgumentError for others."""
    found = estimands(truth)
    if not (isinstance(found, Mapping) and found and all(isinstance(name, str) for name in found)):
        raise ArgumentError(f"estimands = {found!r:.80}; allowed: arrays (n,) by name")
    values = {name: np.asarray(each, dtype=np.float64) for name, each in found.items()}
    for name, each in values.items():
        if each.shape != (len(truth),):
            raise ArgumentError(f"estimands[{name!r}] has shape {each.shape}; allowed: {(len(truth),)}")
    return values


def _numbers(vehicle: str, agent: Agent) -> tuple[str, ...]:
    """Names that the estimator of a vehicle gives to the numbers of its estimates; none if it gives none."""
    names = getattr(agent.estimator, "numbers", ())
    if isinstance(names, str) or not all(isinstance(name, str) for name in names):
        raise ArgumentError(f"{vehicle}: the estimator has numbers = {names!r:.80}; allowed: a name for each number")
    return tuple(names)
