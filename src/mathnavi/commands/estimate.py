"""``mathnavi estimate``: an estimator over the measurements and inputs of a finished run.

The scenario is built again with this estimator, which names the sensors that it needs; their readings and the commands
come from the log. Truth, plans and the events of the other components are kept. ``smoother`` in place of the
estimator's name is the smoother of the recorded Kalman filter, over all readings of the run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mathnavi.commands.arguments import FlagGroup, HelpPrinted, flags, given, parse
from mathnavi.commands.deadline import WallDeadline, watched
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.commands.output import run_folder
from mathnavi.commands.progress import flight_progress
from mathnavi.commands.provenance import note_environment
from mathnavi.commands.run import build, fly
from mathnavi.commands.run_config import RunConfig
from mathnavi.commands.run_request import CommonOptions, RunRequest, loaded, prepare, restored_plugin
from mathnavi.commands.summary import verdict
from mathnavi.commands.wrapping import wrapped
from mathnavi.estimators.stagewise.recorded_smoother import RecordedSmoother, Sample, Smoothing
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.fields import plain
from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.playback import RecordedInputs, RecordedPlant, RecordedRun
from mathnavi.sim.plugin.registry import PluginSpec, called, names
from mathnavi.sim.plugin.trust import trusting
from mathnavi.sim.records.run_folder import ARRAYS, RunLog, read_log
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, RunResult

SMOOTHER = "smoother"
USAGE = """usage: mathnavi estimate ESTIMATOR DIR [OPTIONS]

ESTIMATOR: {}

mathnavi estimate ESTIMATOR DIR --help lists the options."""
ESTIMATOR_EVENTS = ("estimator-status", "estimate-unusable", "sensor-unused")
LATE = 0.75  # of a run, from which on its last quarter lasts


@configuration
class EstimateOptions:
    """Flags of the command."""

    out: Path | None = None
    """folder of the new run; DIR-ESTIMATOR next to DIR if not given"""
    wall_deadline: WallDeadline | None = None
    """limit of wall-clock time [s], after which the command is ended; none if not given"""
    trust: bool = False
    """whether to import code that DIR names and that is not installed; it runs with your rights"""


def main(argv: Sequence[str]) -> int:
    if (code := watched("estimate", argv)) is not None:
        return code
    if {"-h", "--help"} & set(argv[:2]):
        print(wrapped(USAGE.format(", ".join(_allowed()))))
        return 0
    estimator, folder, words = _places(argv)
    prepare()
    with bad_input():
        log = read_log(folder)
    with trusting("--trust" in given(words)):
        run_config = RunConfig.read(folder, argv)
    try:
        request = _request(estimator, run_config, words)
    except HelpPrinted:
        return 0
    out = request.options.out or folder.with_name(f"{folder.resolve().name}-{estimator.replace(':', '.')}")
    with bad_input():
        check_spares(out, [folder], "--out")
    errors = Console(stderr=True, markup=False)
    with run_folder(out) as claim, flight_progress(errors) as progress:
        playback = _playback(request, run_config, log)
        note_environment(errors, run_config)
        with request.failures("a run"):
            result = fly(playback, progress, lambda: _playback(request, run_config, log))
        result.write_files(claim.new)
        claim.install()
    console = Console(markup=False)
    console.print(f"{estimator} over {folder}: {verdict(result, 'estimator')}", style="bold", highlight=False)
    console.print(_comparison(request, run_config, log, result))
    console.print(f"run     {out}", soft_wrap=True, highlight=False)
    return 0 if result.success else 1


def _places(argv: Sequence[str]) -> tuple[str, Path, Sequence[str]]:
    """Split the arguments into ESTIMATOR, DIR and the flags."""
    for k, (place, allowed) in enumerate((("ESTIMATOR", ", ".join(_allowed())), ("DIR", "folder of a run"))):
        if len(argv) <= k or argv[k].startswith("-"):
            raise BadInputError(f"{place} is missing; allowed: {allowed}")
    return argv[0], Path(argv[1]), argv[2:]


def _allowed() -> tuple[str, ...]:
    return (*names("estimators"), SMOOTHER)


def _estimator(name: str, run_config: RunConfig) -> PluginSpec:
    """Return the plug-in with this name, or the smoother of the recorded one."""
    if name != SMOOTHER:
        return restored_plugin("estimators", name, run_config)
    recorded = restored_plugin("estimators", run_config.estimator, run_config)
    with bad_input():
        return PluginSpec.with_fields(Smoothing(recorded.plugin, recorded.config))


def _request(name: str, run_config: RunConfig, words: Sequence[str]) -> RunRequest:
    """Return the recorded run with another estimator, or with the same one; flags replace its recorded fields."""
    scenario = loaded("scenarios", run_config.scenario)
    controller = restored_plugin("controllers", run_config.controller, run_config)
    estimator = _estimator(name, run_config)
    config = run_config.restored(scenario.Config, run_config.fields, "fields")
    groups = (
        FlagGroup(EstimateOptions),
        FlagGroup(type(estimator.config), "estimator", estimator.config, f"Fields of estimator {name}."),
    )
    known = tuple(flag for group in groups for flag, _ in flags(group.schema, group.prefix))
    prog = f"mathnavi estimate {name}"
    purpose = (estimator.plugin.__doc__ or "").strip().partition("\n")[0]
    options, fields = parse(words, prog, purpose, *groups)
    common = CommonOptions(run_config.seed, run_config.controller, name)
    return RunRequest(
        prog,
        run_config.scenario,
        scenario,
        common,
        options,
        config,
        controller,
        PluginSpec(estimator.plugin, fields),
        known,
    )


def _playback(request: RunRequest, run_config: RunConfig, log: RunLog) -> ClosedLoop:
    """Return the recorded run as a closed loop with the requested estimator."""
    closed_loop = build(request, run_config)
    ((vehicle, agent),) = closed_loop.agents.items()
    fresh = closed_loop.plant.state(vehicle), np.zeros(agent.input_size)
    if (log.x.shape[1:], log.u.shape[1:]) != (fresh[0].shape, fresh[1].shape):
        raise BadInputError(
            f"{log.directory / ARRAYS}: truth.x {log.x.shape} and command.u {log.u.shape} do not fit "
            f"{run_config.scenario}; allowed: (n, {len(fresh[0])}) and (n, {len(fresh[1])})"
        )
    readings = {
        name.removeprefix("measurement."): rows for name, rows in log.arrays.items() if name.startswith("measurement.")
    }
    run = RecordedRun(log.t, log.x, log.u, readings, closed_loop.plant.state_names(vehicle))
    period = float(log.t[1] - log.t[0])
    if abs(agent.estimator.period - period) > 1e-9:
        raise BadInputError(
            f"ESTIMATOR = {request.common.estimator}: it estimates every {agent.estimator.period:g} s; allowed: every "
            f"{period:g} s, as {log.directory} was run"
        )
    try:
        plant = RecordedPlant(vehicle, run, closed_loop.plant.dt, closed_loop.plant.sensors(vehicle))
    except ValueError as error:
        raise BadInputError(f"ESTIMATOR = {request.common.estimator} over {log.directory}: {error}") from error
    inputs = RecordedInputs(run, period)
    made: dict[str, Any] = {"recorded": str(log.directory)}
    if isinstance(agent.estimator, RecordedSmoother):
        made |= _smoothed(agent.estimator, plant, log, request, run_config)
        plant = RecordedPlant(vehicle, run, closed_loop.plant.dt, closed_loop.plant.sensors(vehicle))

    def summarise(recording: Recording, wall_seconds: float) -> tuple[dict[str, Any], bool]:
        _restore(recording, log, vehicle)
        return closed_loop.summarise(recording, wall_seconds)

    return ClosedLoop(
        plant,
        {vehicle: Agent(agent.estimator, inputs, inputs, agent.input_size, sensors=agent.sensors)},
        float(log.t[-1]),
        lambda t, truths: False,
        summarise,
        closed_loop.config | made,
    )


def _smoothed(
    smoother: RecordedSmoother, plant: RecordedPlant, log: RunLog, request: RunRequest, run_config: RunConfig
) -> dict[str, Any]:
    """Smooth the whole run; return its config.json, with the estimator as recorded."""

    def samples() -> Iterator[Sample]:
        (name,) = plant.names
        for k, t in enumerate(log.t.tolist()):
            yield t, plant.sense(name), log.u[k - 1] if k else np.zeros_like(log.u[0])
            if k + 1 < len(log.t):
                plant.step({}, round((log.t[k + 1] - t) / plant.dt))

    try:
        smoother.smooth(samples())
    except (ValueError, ArithmeticError) as error:  # LinAlgError is a ValueError
        raise BadInputError(f"{SMOOTHER} over {log.directory}: {error}") from error
    recorded = {"name": run_config.estimator, "fields": run_config.estimator_fields}
    return {"estimator": recorded, SMOOTHER: plain(request.estimator.config)}


def _restore(recording: Recording, log: RunLog, vehicle: str) -> None:
    """Copy the plans of the recorded run, and all events but those of its estimator, into the log of the new one."""
    agent = recording.agents[vehicle]
    agent.plans[:] = zip(log.adopted.tolist(), log.plans, strict=True)
    agent.requests = agent.answers = int(log.summary.get("replans", len(log.plans)))  # another run's planner
    kept = [event for event in log.events if event.kind not in ESTIMATOR_EVENTS]
    recording.events[:] = sorted([*kept, *recording.events], key=lambda event: event.t)


def _comparison(request: RunRequest, run_config: RunConfig, log: RunLog, result: RunResult) -> Table | str:
    """Print the root mean square errors of the recorded and of the new estimates, if the scenario defines any."""
    ((_, states),) = result.recording.state_names.items()
    found = [
        _errors(request, states, run["estimate.t"], run["estimate.x"], log) if "estimate.x" in run else {}
        for run in (log.arrays, result.arrays)
    ]
    table = Table(title="errors, root mean square", title_justify="left", box=None, padding=(0, 2, 0, 0))
    table.add_column("of", style="dim")
    for who in (f"recorded: {called('estimators', run_config.estimator)}", request.common.estimator):
        table.add_column(who, justify="right")
        table.add_column("last quarter", justify="right")
    for name in found[1]:
        table.add_row(Text(name), *(cell for errors in found for cell in errors.get(name, ("-", "-"))))
    return table if found[1] else f"{request.name} does not say how estimates and its truth compare"


def _errors(
    request: RunRequest, states: tuple[str, ...], t: Array, x: Array, log: RunLog
) -> Mapping[str, tuple[str, str]]:
    """Return root mean square errors by name with unit: over the whole run, and over its last quarter.

    The errors are those that the scenario computes, or state by state.
    """
    truth = log.x[np.searchsorted(log.t, t - 1e-9)]
    if hasattr(request.scenario, "errors"):
        errors = request.scenario.errors(request.config, x, truth)
    elif x.shape == truth.shape:
        errors = {name: x[:, k] - truth[:, k] for k, name in enumerate(states)}
    else:
        return {}
    late = t >= LATE * log.t[-1]
    return {name: (_rms(error), _rms(error[late])) for name, error in errors.items()}


def _rms(values: Array) -> str:
    return f"{float(np.sqrt(np.mean(np.square(values)))):.3g}"
