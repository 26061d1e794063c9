"""Recorded run of one vehicle as a closed loop with another estimator, over its measurements and inputs.

Truth, plans, the events of the other components and the figures of the flight are those of the log: an estimator that
did not fly has no part in them, and its quality, on which a tracking bound rests, was not that of the flight.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mathnavi.estimators.stagewise.recorded_smoother import RecordedSmoother
from mathnavi.interfaces.boundary import guest
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.fields import plain
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.answer_times import ESTIMATOR
from mathnavi.sim.engine.log import Recording, names_of
from mathnavi.sim.engine.playback import RecordedInputs, RecordedPlant, RecordedRun
from mathnavi.sim.plugin.registry import PluginSpec, of_stranger
from mathnavi.sim.records.event_kinds import SIGN, of_estimator
from mathnavi.sim.records.figure_names import SUMMARY_GROUPS
from mathnavi.sim.records.run_folder import ARRAYS, RunLog
from mathnavi.sim.scenarios.closed_loop import ClosedLoop
from mathnavi.sim.scenarios.declared_signals import with_inputs

SMOOTHER = "smoother"
"""name of the smoother of the recorded estimator, over all readings of the run, and its key in config.json"""
_OF_ESTIMATES = ("estimate", "bound", "readings")  # groups of figures; all others are of the flight, as it was flown
_NOT_OF_FLIGHTS = {key for group in _OF_ESTIMATES for key in SUMMARY_GROUPS[group]}
_OF_FLIGHTS = {key for keys in SUMMARY_GROUPS.values() for key in keys} - _NOT_OF_FLIGHTS


def played_back(closed_loop: ClosedLoop, log: RunLog, name: str, recorded: PluginSpec) -> ClosedLoop:
    """Return the run in ``log`` as a closed loop with the estimator of ``closed_loop``, which messages call ``name``.

    ``closed_loop`` is the recorded scenario, built with this estimator; ``recorded`` is the estimator that was flown.
    Raises ArgumentError for a log of another scenario, for an estimator of another period or with sensors that the
    log does not have, and for one that cannot smooth the run.
    """
    ((vehicle, agent),) = closed_loop.agents.items()
    plant = closed_loop.plant
    fresh = plant.state(vehicle), np.zeros(agent.input_size)
    if (log.x.shape[1:], log.u.shape[1:]) != (fresh[0].shape, fresh[1].shape):
        raise ArgumentError(
            f"{log.directory / ARRAYS}: truth.x {log.x.shape} and command.u {log.u.shape} do not fit "
            f"{closed_loop.config['scenario']}; allowed: (n, {len(fresh[0])}) and (n, {len(fresh[1])})"
        )
    period = float(log.t[1] - log.t[0])
    if abs(agent.estimator.period - period) > 1e-9:
        raise ArgumentError(
            f"ESTIMATOR = {name}: it estimates every {agent.estimator.period:g} s; allowed: every {period:g} s, as "
            f"{log.directory} was run"
        )
    readings = {
        name.removeprefix("measurement."): rows for name, rows in log.arrays.items() if name.startswith("measurement.")
    }
    names = with_inputs(names_of(plant, vehicle), closed_loop.task, vehicle, agent.input_size)
    run = RecordedRun(log.t, log.x, log.u, readings, names)
    try:
        past = RecordedPlant(vehicle, run, plant.dt, plant.sensors(vehicle))
    except ValueError as error:
        raise ArgumentError(f"ESTIMATOR = {name} over {log.directory}: {error}") from error
    made: dict[str, Any] = {"recorded": str(log.directory)}
    if sign := guest(agent.estimator):
        made |= {SIGN: sign}
    if "mission" in log.config:  # with the tracking bound of the estimator that was flown
        made |= {"mission": log.config["mission"]}
    if isinstance(agent.estimator, RecordedSmoother):
        try:
            with of_stranger(recorded.plugin, f"{SMOOTHER} over {log.directory}: its filter failed:"):
                agent.estimator.smooth(past.samples())
        except (ValueError, ArithmeticError) as error:  # LinAlgError is a ValueError
            raise ArgumentError(f"{SMOOTHER} over {log.directory}: {error}") from error
        made |= {"estimator": {"name": recorded.name, "fields": plain(recorded.config)}}
        made |= {SMOOTHER: closed_loop.config["estimator"]["fields"]}

    def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
        _restore(recording, log, vehicle, agent)
        summary, success = closed_loop.summarise(recording, wall_seconds)
        flown = {key: log.summary[key] for key in summary if key in _OF_FLIGHTS and key in log.summary}
        return {**summary, **flown}, success

    inputs = RecordedInputs(run, period)
    return ClosedLoop(
        past,
        {vehicle: Agent(agent.estimator, inputs, inputs, agent.input_size, sensors=agent.sensors)},
        float(log.t[-1]),
        lambda t, truths: False,
        summarise,
        closed_loop.config | made,
        estimands=closed_loop.estimands,
        timed=() if isinstance(agent.estimator, RecordedSmoother) else (ESTIMATOR,),
    )


def _restore(recording: Recording, log: RunLog, vehicle: str, flown: Agent) -> None:
    """Copy the plans of the recorded run, and all events but those of its estimator, into the log of the new one."""
    agent = recording.agents[vehicle]
    agent.plans[:] = zip(log.adopted.tolist(), log.plans, strict=True)
    agent.requests = agent.answers = int(log.summary.get("replans", len(log.plans)))  # another run's planner
    guests = guest(flown.planner), guest(flown.tracker)
    kept = [event for event in log.events if not of_estimator(event, guests)]
    recording.events[:] = sorted([*kept, *recording.events], key=lambda event: event.t)
