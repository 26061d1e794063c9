"""``mathnavi estimate``: an estimator over the measurements and inputs of a finished run, or over a log in a file.

The scenario is built again with this estimator, which names the sensors that it needs; their readings and the commands
come from the log. Truth, plans and the events of the other components are kept. ``smoother`` in place of the
estimator's name is the smoother of the recorded Kalman filter, over all readings of the run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mathnavi.commands.arguments import FlagGroup, given, parse
from mathnavi.commands.command_line import CommandLine, prepare
from mathnavi.commands.deadline import WallDeadline, watched
from mathnavi.commands.errors import BadInputError, bad_input, bad_plugin
from mathnavi.commands.estimate_log import beside, estimate_log
from mathnavi.commands.output import run_folder
from mathnavi.commands.progress import flight_progress
from mathnavi.commands.provenance import note_environment
from mathnavi.commands.recorded_spec import RecordedSpec
from mathnavi.commands.replacing import install_run
from mathnavi.commands.run import build, fly
from mathnavi.commands.summary import print_timing, verdict
from mathnavi.commands.wrapping import wrapped
from mathnavi.estimators.stagewise.recorded_smoother import Smoothing
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.signal_names import difference
from mathnavi.interfaces.signals import Array
from mathnavi.sim.logs.imported import is_imported
from mathnavi.sim.plugin.registry import PluginSpec, called, names
from mathnavi.sim.plugin.trust import trusting
from mathnavi.sim.records.run_folder import RunLog, read_log
from mathnavi.sim.records.run_spec import RunSpec
from mathnavi.sim.scenarios.closed_loop import ClosedLoop, RunData
from mathnavi.sim.scenarios.declared_signals import true_values
from mathnavi.sim.scenarios.played_back import SMOOTHER, played_back

USAGE = """usage: mathnavi estimate ESTIMATOR DIR [OPTIONS]
       mathnavi estimate ESTIMATOR FILE --mission FILE.py:NAME --readings SENSOR=COLUMNS... [OPTIONS]

ESTIMATOR: {}

DIR is the folder of a run, FILE a log of your own as a text file with a table.

mathnavi estimate ESTIMATOR DIR --help lists the options of either."""
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
        of_log = folder.is_file() or "--mission" in given(words) or is_imported(folder)
    if of_log:
        return estimate_log(estimator, folder, words)
    with bad_input():
        log = read_log(folder)
    with trusting("--trust" in given(words)):
        recorded = RecordedSpec.read(folder, argv)
    line = _command_line(estimator, recorded, words)
    out = line.options.out or beside(folder, estimator)
    with bad_input():
        check_spares(out, [folder], "--out")
    errors = Console(stderr=True, markup=False, emoji=False)
    with run_folder(out) as claim, flight_progress(errors) as progress:
        playback = _playback(line, recorded, log, estimator)
        note_environment(errors, recorded)
        with line.failures("a run"):
            result = fly(playback, progress, lambda: _playback(line, recorded, log, estimator))
        result.write_files(claim.new)
        install_run(claim, out, errors)
    console = Console(markup=False, emoji=False)
    console.print(f"{estimator} over {folder}: {verdict(result, 'estimator')}", style="bold", highlight=False)
    console.print(_comparison(line.spec, estimator, recorded.spec, log, result))
    print_timing(console, result.timing)
    console.print(f"run     {out}", soft_wrap=True, highlight=False)
    return 0 if result.success else 1


def _places(argv: Sequence[str]) -> tuple[str, Path, Sequence[str]]:
    """Split the arguments into ESTIMATOR, DIR or FILE, and the flags."""
    wanted = ("ESTIMATOR", ", ".join(_allowed())), ("DIR", "folder of a run, or FILE of a log")
    for k, (place, allowed) in enumerate(wanted):
        if len(argv) <= k or not argv[k] or argv[k].startswith("-"):
            raise BadInputError(f"{place} is missing; allowed: {allowed}")
    return argv[0], Path(argv[1]), argv[2:]


def _allowed() -> tuple[str, ...]:
    return (*names("estimators"), SMOOTHER)


def _estimator(name: str, recorded: RecordedSpec) -> PluginSpec:
    """Return the plug-in with this name, or the smoother of the recorded one."""
    if name != SMOOTHER:
        with bad_plugin():
            return recorded.spec.with_plugins(estimator=name).estimator
    with bad_input():
        return PluginSpec.with_fields(Smoothing(recorded.spec.estimator.plugin, recorded.spec.estimator.config))


def _command_line(name: str, recorded: RecordedSpec, words: Sequence[str]) -> CommandLine:
    """Read ``words`` for the recorded run with another estimator, or with the same one; flags replace its fields."""
    estimator = _estimator(name, recorded)
    groups = (
        FlagGroup(EstimateOptions),
        FlagGroup(type(estimator.config), "estimator", estimator.config, f"Fields of estimator {name}."),
    )
    known = tuple(flag for group in groups for flag in group.section.flags)
    prog = f"mathnavi estimate {name}"
    purpose = (estimator.plugin.__doc__ or "").strip().partition("\n")[0]
    options, fields = parse(words, prog, purpose, *groups)
    spec = replace(recorded.spec, estimator=PluginSpec(estimator.plugin, fields))
    return CommandLine(prog, spec, options, known)


def _playback(line: CommandLine, recorded: RecordedSpec, log: RunLog, estimator: str) -> ClosedLoop:
    closed_loop = build(line, recorded)
    with bad_input():
        return played_back(closed_loop, log, estimator, recorded.spec.estimator)


def _comparison(spec: RunSpec, estimator: str, recorded: RunSpec, log: RunLog, result: RunData) -> Table | str:
    """Print the root mean square errors of the recorded and of the new estimates, if the scenario defines any."""
    ((_, states),) = result.recording.state_names.items()
    found = [
        _errors(spec, states, run["estimate.t"], run["estimate.x"], log) if "estimate.x" in run else {}
        for run in (log.arrays, result.arrays)
    ]
    table = Table(title="errors, root mean square", title_justify="left", box=None, padding=(0, 2, 0, 0))
    table.add_column("of", style="dim")
    for who in (f"recorded: {called('estimators', recorded.estimator.name)}", estimator):
        table.add_column(who, justify="right")
        table.add_column("last quarter", justify="right")
    for name in found[1]:
        table.add_row(Text(name), *(cell for errors in found for cell in errors.get(name, ("-", "-"))))
    return table if found[1] else f"{spec.scenario} does not say how estimates and its truth compare"


def _errors(spec: RunSpec, states: tuple[str, ...], t: Array, x: Array, log: RunLog) -> Mapping[str, tuple[str, str]]:
    """Return root mean square errors by name with unit: over the whole run, and over its last quarter.

    The errors are those that the scenario computes, or those of its estimands, or state by state.
    """
    truth = log.x[np.searchsorted(log.t, t - 1e-9)]
    if hasattr(spec.scenario_class, "errors"):
        errors = spec.scenario_class.errors(spec.config, x, truth)
    elif x.shape == truth.shape:
        errors = {name: x[:, k] - truth[:, k] for k, name in enumerate(states)}
    elif hasattr(spec.scenario_class, "estimands"):
        values = true_values(partial(spec.scenario_class.estimands, spec.config), truth)
        if x.shape[1:] != (len(values),):
            return {}
        errors = {name: difference(name, x[:, k], each) for k, (name, each) in enumerate(values.items())}
    else:
        return {}
    late = t >= LATE * log.t[-1]
    return {name: (_rms(error), _rms(error[late])) for name, error in errors.items()}


def _rms(values: Array) -> str:
    return f"{float(np.sqrt(np.mean(np.square(values)))):.3g}"
