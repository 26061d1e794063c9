"""``mathnavi log import``: the folder of a run from a recorded log, with its faults of stamps and gaps."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console

from mathnavi.commands.advised_flags import as_flags
from mathnavi.commands.arguments import FlagGroup, given, parse
from mathnavi.commands.errors import BadInputError, bad_input, worded
from mathnavi.commands.estimate_log import pairs
from mathnavi.commands.output import run_folder
from mathnavi.commands.replacing import install_run
from mathnavi.commands.summary import summary_table
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import LogError
from mathnavi.interfaces.field_table import TOGETHER, Positional, ValueName
from mathnavi.interfaces.reading.files import opened
from mathnavi.interfaces.reading.table_format import names_in
from mathnavi.sim.logs.formats import read
from mathnavi.sim.logs.imported import Selection, imported
from mathnavi.sim.logs.recorded_log import Disorder, RecordedLog
from mathnavi.sim.plugin.registry import PluginSpec
from mathnavi.sim.records.run_folder import write_run_files

_MOST_BYTES, _CHUNK = 1 << 40, 1 << 20  # of a log, and of what is read of it at once


@configuration
class LogImportOptions:
    """Flags of ``log import``: the log, and what is taken of it."""

    file: Annotated[Path, Positional("FILE")]
    """log, as of `mathnavi log show`"""
    out: Path
    """folder of the run"""
    readings: Annotated[tuple[str, ...], TOGETHER, ValueName("SENSOR=SIGNALS...")] = ()
    """signals of each sensor by its name, with commas between them; each channel that is read if not given"""
    inputs: Annotated[str, ValueName("SIGNALS")] = ""
    """signals of the input, with commas between them; none if not given"""
    reference: Annotated[str, ValueName("SIGNALS")] = ""
    """signals that another system found, as motion capture does, with commas between them; none if not given"""
    reference_names: Annotated[str, ValueName("NAMES")] = ""
    """names of the reference with units, "x [m],y [m],heading [rad]"; those of its signals if not given"""
    signal_units: Annotated[tuple[str, ...], TOGETHER, ValueName("SIGNAL=UNIT...")] = ()
    """units of signals, as deg or mm; those that the file states, else SI units, if not given"""
    spread: Annotated[tuple[str, ...], TOGETHER, ValueName("SIGNAL=BY...")] = ()
    """signals that become a channel with a column for each value of the signal BY, which says whose reading it is"""
    rates: Annotated[tuple[str, ...], TOGETHER, ValueName("CHANNEL...")] = ()
    """channels or signals of increments from row to row, as of a distance: each is divided by the time since the row
    before"""
    delays: Annotated[tuple[str, ...], TOGETHER, ValueName("CHANNEL=SECONDS...")] = ()
    """delays by which the stamps of a channel are too early, as of commands that act later [s]"""
    disorder: Disorder = "refuse"
    """treatment of stamps that do not increase: the log is refused, or its readings are sorted by them with a note"""
    format: str | None = None
    """format, the name of a plug-in or MODULE:Class; that which the file has by its name or its first bytes if not
    given"""


_LISTS = ("readings", "signal_units", "spread", "rates", "delays")


def import_log(words: Sequence[str], plugin: Any) -> int:
    """Write the folder of a run from the log that the words name, in the format of a plug-in; return the exit code."""
    groups = FlagGroup(LogImportOptions), FlagGroup(plugin.Config, default=plugin.Config())
    purpose = "Write the folder of a run from a log: its readings, inputs, reference, and where it is from."
    options, config = parse(words, "mathnavi log import", purpose, *groups)
    for name in _LISTS:
        flag = f"--{name.replace('_', '-')}"
        if flag in given(words) and not getattr(options, name):
            raise BadInputError(f"{flag} without a value; allowed: one or more, or not this flag")
    with bad_input():
        check_spares(options.out, [options.file], "--out")
    try:
        log = read(options.file, PluginSpec(plugin, config))
    except (ValueError, OSError) as error:
        raise BadInputError(as_flags(worded(error))) from error
    try:
        log = _changed(log, options)
        made = imported(log, _selection(log, options), digest_of(options.file))
    except (ValueError, OSError) as error:
        raise BadInputError(as_flags(worded(error)).replace("--units", "--signal-units")) from error
    with run_folder(options.out) as claim:
        write_run_files(claim.new, made.config, made.summary, made.recording)
        install_run(claim, options.out, Console(stderr=True, markup=False, emoji=False))
    console = Console(markup=False, emoji=False, highlight=False)
    console.print(f"{log.source}: {log.format}", style="bold", soft_wrap=True)
    console.print(summary_table(made.summary, made.recording.events))
    for event in made.recording.events:
        console.print(f"{event.t:.6g} s  {event.message}", soft_wrap=True)
    console.print(f"run     {options.out}", soft_wrap=True)
    return 0


def _changed(log: RecordedLog, options: LogImportOptions) -> RecordedLog:
    """The log with the channels that the flags make of it."""
    divided: set[tuple[str, int]] = set()
    for name in options.rates:
        places = log.places(name)
        if twice := divided.intersection(places):
            channel, k = min(twice)
            signal = f"{channel}:{log.channels[channel].signals[k]}"
            raise BadInputError(f"--rates = {name}: the rate of {signal} is taken twice; allowed: once")
        divided |= set(places)
        log = log.rates(name)
    for channel, seconds in pairs("--delays", options.delays).items():
        try:
            log = log.delayed(channel, float(seconds))
        except ValueError as error:
            raise BadInputError(f"--delays = {channel}={seconds}; allowed: a channel and a time [s]") from error
    for signal, by in pairs("--spread", options.spread).items():
        log = log.spread(signal, by)
    return log


def _selection(log: RecordedLog, options: LogImportOptions) -> Selection:
    readings: dict[str, Sequence[str]] = {
        name: names_in(signals) for name, signals in pairs("--readings", options.readings).items()
    }
    if not readings:
        taken = {channel for channel, _ in log.places([*names_in(options.inputs), *names_in(options.reference)])}
        readings = {
            name: (name,) for name, each in log.channels.items() if each.role == "reading" and name not in taken
        }
    return Selection(
        readings,
        names_in(options.inputs),
        names_in(options.reference),
        names_in(options.reference_names),
        pairs("--signal-units", options.signal_units),
        options.disorder,
    )


def digest_of(path: Path) -> str:
    """SHA-256 of a file, or of the files in a folder in the order of their names, each behind its name."""
    digest = hashlib.sha256()
    files = [path] if path.is_file() else sorted(each for each in path.rglob("*") if each.is_file())
    for file in files:
        if file != path:
            digest.update(str(file.relative_to(path)).encode())
        with opened(file, LogError, _MOST_BYTES) as opened_file:
            while chunk := opened_file.read(_CHUNK):
                digest.update(chunk)
    return digest.hexdigest()
