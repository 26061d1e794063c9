"""``mathnavi log show``: contents of a recorded log, with rates, gaps and ranges, before an estimator uses it;
``mathnavi log import``: the folder of a run from it (``log_import``)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from rich.table import Table

from mathnavi.commands.advised_flags import as_flags
from mathnavi.commands.arguments import FlagGroup, given, parse
from mathnavi.commands.errors import BadInputError, bad_plugin, worded
from mathnavi.commands.wrapping import wrapped
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.field_table import Positional
from mathnavi.interfaces.short_tables import counted
from mathnavi.interfaces.signals import Array
from mathnavi.sim.logs.formats import KIND, format_of, read
from mathnavi.sim.logs.recorded_log import Channel, RecordedLog
from mathnavi.sim.logs.timing import GAP, longest_constant
from mathnavi.sim.plugin.registry import PluginSpec, load, names

USAGE = """usage: mathnavi log show FILE [--format NAME] [OPTIONS]
       mathnavi log import FILE --out DIR [--format NAME] [--readings SENSOR=SIGNALS...] [OPTIONS]

FILE: a log, or the folder of a ROS 2 bag; NAME: {}

mathnavi log show FILE --help lists the options of the format of FILE."""
FORMAT = "--format"
FAMILY = 6  # signals with one name and a number each that stand in one row
_NUMBERED = re.compile(r"(.*?)(\d+)( \[.*\])?")
_MOST_ROWS = 60  # of signals of a channel


@configuration
class LogShowOptions:
    """Flags of ``log show``: the log to show."""

    file: Annotated[Path, Positional("FILE")]
    """log: a text file with a table, .npz, .mat, log of CARMEN, .bag, .db3 or folder of ROS, .ulg or .mcap"""
    format: str | None = None
    """format, the name of a plug-in or MODULE:Class; that which the file has by its name or its first bytes if not
    given"""
    facts: bool = False
    """whether to print what the file says of the vehicle and of each sensor, too"""


def main(argv: Sequence[str]) -> int:
    if not argv or argv[0] in ("-h", "--help"):
        if not argv:
            raise BadInputError("log: no command; allowed: show, import")
        print(wrapped(USAGE.format(", ".join(names(KIND)))))
        return 0
    if argv[0] == "import":
        from mathnavi.commands.log_import import import_log

        return import_log(argv[1:], _format(argv[1:]))
    if argv[0] != "show":
        raise BadInputError(f"log {argv[0]}: not a command; allowed: show, import")
    words = argv[1:]
    plugin = _format(words)
    groups = FlagGroup(LogShowOptions), FlagGroup(plugin.Config, default=plugin.Config())
    purpose = "Print the contents of a log: channels, stamps, gaps, ranges."
    options, config = parse(words, "mathnavi log show", purpose, *groups)
    try:
        log = read(options.file, PluginSpec(plugin, config))
    except (ValueError, OSError) as error:
        raise BadInputError(as_flags(worded(error))) from error
    _print(log, facts=options.facts)
    return 0


def _format(words: Sequence[str]) -> Any:
    """The plug-in that is named, or the one of the file's format; for help without a file that of tables."""
    with bad_plugin():
        if FORMAT in given(words):
            place = next(k for k, word in enumerate(words) if word.partition("=")[0] == FORMAT)
            named = words[place].partition("=")[2] or next(iter(words[place + 1 :]), "")
            return load(KIND, named or "table")  # without a value it is refused with the other flags
        if {*words} & {"-h", "--help"} and words[0].startswith("-"):
            return load(KIND, "table")
    if not words or words[0].startswith("-"):
        raise BadInputError("FILE is missing; allowed: a log, before the flags")
    try:
        return format_of(Path(words[0]))
    except (ValueError, OSError) as error:
        raise BadInputError(as_flags(worded(error))) from error


@dataclass(frozen=True)
class _Family:
    """Signals that stand in one row."""

    name: str
    unit: str
    values: Array  # (n, m)


def _print(log: RecordedLog, *, facts: bool) -> None:
    console = Console(markup=False, emoji=False, highlight=False)
    console.print(f"{log.source}: {log.format}", style="bold", soft_wrap=True)
    last = max(float(channel.t.max()) for channel in log.channels.values())
    since = f", from {log.start:f} s of the file's clock on" if log.start else ""
    console.print(f"clock   {log.clock}; {last:.6g} s{since}", soft_wrap=True)
    for note in log.notes:
        console.print(f"note    {note}", soft_wrap=True)
    console.print()
    console.print(_stamps(log))
    for line in _irregular(log):
        console.print(line, soft_wrap=True)
    for name, channel in log.channels.items():
        console.print()
        console.print(_signals(name, channel))
    if facts:
        for name, known in (("log", log.facts), *((name, channel.facts) for name, channel in log.channels.items())):
            for key, value in known.items():
                console.print(f"{name}  {key} = {value}", soft_wrap=True)


def _stamps(log: RecordedLog) -> Table:
    table = Table(title="stamps", title_justify="left", title_style="bold", box=None, padding=(0, 1, 0, 0))
    table.add_column("channel", no_wrap=True)
    for heading in ("readings", "from [s]", "to [s]", "rate [Hz]", "jitter [ms]", "late", "doubled", "missing"):
        table.add_column(heading, justify="right", no_wrap=" " not in heading)
    for name, channel in log.channels.items():
        timing = channel.timing
        numbers = (timing.first, timing.last, timing.rate, 1e3 * timing.jitter)
        counts = [str(count) if count else "-" for count in (timing.late, timing.doubled, timing.missing)]
        table.add_row(name, str(timing.count), *(f"{each:.4g}" for each in numbers), *counts)
    return table


def _irregular(log: RecordedLog) -> Iterator[str]:
    """Lines that say where the stamps of a channel are irregular."""
    for name, channel in log.channels.items():
        timing = channel.timing
        if timing.first_late is not None:
            k = timing.first_late
            before = float(channel.t[:k].max())
            yield f"{name}: reading {k} is late, at {channel.t[k]:.6g} s after {before:.6g} s"
        if timing.gaps:
            longest = f"the longest {timing.longest_gap:.3g} s, from {timing.longest_gap_at:.6g} s on"
            yield f"{name}: {counted(timing.gaps, 'gap')} of more than {GAP:g} periods, {longest}"


def _signals(name: str, channel: Channel) -> Table:
    about = ", ".join([channel.role, *([f"frame {channel.frame!r}"] if channel.frame else [])])
    table = Table(title=f"{name} ({about})", title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
    table.add_column("signal", no_wrap=True)
    table.add_column("unit")
    for heading in ("least", "median", "largest", "missing", "held for [s]", "from [s]"):
        table.add_column(heading, justify="right")
    families = list(_families(channel))
    for family in families[:_MOST_ROWS]:
        there = family.values[np.isfinite(family.values)]
        range_ = [f"{each:.4g}" for each in np.quantile(there, [0.0, 0.5, 1.0])] if there.size else ["-"] * 3
        missing = int(family.values.size - there.size)
        constant, at = max(longest_constant(channel.t, column) for column in family.values.T)
        table.add_row(
            family.name, family.unit, *range_, str(missing) if missing else "-",
            *([f"{constant:.3g}", f"{at:.6g}"] if constant else ["-", "-"]),
        )  # fmt: skip
    if len(families) > _MOST_ROWS:
        table.add_row(f"and {len(families) - _MOST_ROWS} more")
    return table


def _families(channel: Channel) -> Iterator[_Family]:
    """Signals in their order; ``FAMILY`` or more with one name and unit and a number each as one."""

    def stem(k: int) -> tuple[str, str]:
        found = _NUMBERED.fullmatch(channel.signals[k])
        return (found[1], found[3] or "") if found else (channel.signals[k], "alone")

    for _, own in groupby(range(len(channel.signals)), stem):
        columns = list(own)
        if len(columns) >= FAMILY:
            first, unit = _parts(channel.signals[columns[0]])
            last, _ = _parts(channel.signals[columns[-1]])
            yield _Family(f"{first} to {last}", unit, channel.values[:, columns])
            continue
        for k in columns:
            name, unit = _parts(channel.signals[k])
            yield _Family(name, unit, channel.values[:, [k]])


def _parts(signal: str) -> tuple[str, str]:
    """Name and unit of a signal."""
    name, _, unit = signal.partition(" [")
    return name, unit.removesuffix("]")
