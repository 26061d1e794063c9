"""``mathnavi identify LOG``: the joints of an arm from its log, in a table, as JSON and as an MJCF file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from rich.table import Table

from mathnavi.commands.advised_flags import as_flags
from mathnavi.commands.arguments import FlagGroup, given, parse, with_flag
from mathnavi.commands.errors import BadInputError, bad_input, bad_plugin, print_note, worded
from mathnavi.commands.output import output_folder
from mathnavi.commands.wrapping import wrapped
from mathnavi.estimators.identification.identify import Identification, IdentificationConfig
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.field_table import TOGETHER, Positional, ValueName
from mathnavi.interfaces.reading.table_format import names_in
from mathnavi.interfaces.writing import write_together
from mathnavi.sim.logs.formats import KIND, format_of, read
from mathnavi.sim.logs.identification import identify
from mathnavi.sim.logs.recorded_log import Disorder, RecordedLog
from mathnavi.sim.plugin.registry import PluginSpec, load

USAGE = """usage: mathnavi identify LOG --mechanism NAME|FILE.xml
                         --position SIGNALS --inputs SIGNALS [OPTIONS]

LOG: a log with the positions of the joints, and currents or torques of their motors

mathnavi identify LOG --help lists the options, with those of the format of LOG."""
PARAMETERS, MODEL = "identified.json", "identified.xml"


@configuration
class IdentifyOptions:
    """Flags of the command: the log, the mechanism, and the signals of its joints."""

    log: Annotated[Path, Positional("LOG")]
    """log that is fitted"""
    mechanism: Annotated[str, ValueName("NAME|FILE.xml")]
    """name of a mechanism, menagerie:NAME, or MJCF file; its links keep their inertial parameters"""
    position: Annotated[str, ValueName("SIGNALS")]
    """signals of the positions of the joints, in the order of the model, with commas between them"""
    inputs: Annotated[str, ValueName("SIGNALS")]
    """signals of currents or torques of the motors, in the same order, with commas between them"""
    also: Annotated[tuple[Path, ...], TOGETHER, ValueName("LOG...")] = ()
    """further logs that are fitted"""
    test: Annotated[tuple[Path, ...], TOGETHER, ValueName("LOG...")] = ()
    """logs that the parameters are tested on; the end of each log if not given"""
    format: str | None = None
    """format of the logs, the name of a plug-in or MODULE:Class; that which LOG has by its name or its first bytes if
    not given"""
    disorder: Disorder = "refuse"
    """treatment of stamps that do not increase"""
    out: Path | None = None
    """folder of the results; LOG-identified next to LOG if not given"""


def main(argv: Sequence[str]) -> int:
    if not argv or argv[0] in ("-h", "--help"):
        if not argv:
            raise BadInputError("LOG is missing; allowed: a log, before the flags")
        print(wrapped(USAGE))
        return 0
    plugin = _format(argv)
    groups = (
        FlagGroup(IdentifyOptions),
        FlagGroup(IdentificationConfig, default=IdentificationConfig()),
        FlagGroup(plugin.Config, default=plugin.Config()),
    )
    purpose = "Identify the joints of an arm from its log: gains, rotors, friction."
    options, config, form = parse(argv, "mathnavi identify", purpose, *groups)
    known = [flag for group in groups for flag in group.section.flags]
    out = options.out or options.log.with_name(f"{options.log.stem}-identified")
    files = [out / PARAMETERS, out / MODEL]
    logs = [options.log, *options.also, *options.test]
    with bad_input():
        for file in files:
            check_spares(file, logs, "--out")
    spec = PluginSpec(plugin, form)
    errors = Console(stderr=True, markup=False, emoji=False)
    with output_folder(out):
        try:
            recorded = [read(each, spec) for each in logs]
            for each in recorded:
                for note in each.notes:
                    print_note(errors, f"{each.source}: {note}")
            found = _identified(recorded, options, config)
            content = json.dumps(found.document(), indent=2).encode(), found.spec().to_xml().encode()
        except (ValueError, OSError) as error:
            raise BadInputError(as_flags(with_flag(worded(error), known))) from error
        write_together(dict(zip(files, content, strict=True)))
    _print(found)
    print(f"parameters  {files[0]}\nmodel       {files[1]}")
    return 0


def _format(words: Sequence[str]) -> Any:
    """The plug-in that is named, or the one of the first log's format; for help without a log that of tables."""
    with bad_plugin():
        if "--format" in given(words):
            place = next(k for k, word in enumerate(words) if word.partition("=")[0] == "--format")
            named = words[place].partition("=")[2] or next(iter(words[place + 1 :]), "")
            return load(KIND, named or "table")
        if words[0].startswith("-"):
            if {*words} & {"-h", "--help"}:
                return load(KIND, "table")
            raise BadInputError("LOG is missing; allowed: a log, before the flags")
    try:
        return format_of(Path(words[0]))
    except (ValueError, OSError) as error:
        raise BadInputError(as_flags(worded(error))) from error


def _identified(
    recorded: Sequence[RecordedLog], options: IdentifyOptions, config: IdentificationConfig
) -> Identification:
    fitted = 1 + len(options.also)
    return identify(
        recorded[:fitted],
        options.mechanism,
        position=names_in(options.position),
        inputs=names_in(options.inputs),
        test=recorded[fitted:],
        disorder=options.disorder,
        **{name: getattr(config, name) for name in config.__dataclass_fields__},
    )


def _print(found: Identification) -> None:
    console = Console(markup=False, emoji=False, highlight=False)
    parameters = Table(title=f"joints of {found.mechanism}", title_justify="left", title_style="bold", box=None)
    for heading in ("joint", "parameter"):
        parameters.add_column(heading, no_wrap=True)
    for heading in ("value", "± (95 %)"):
        parameters.add_column(heading, justify="right", no_wrap=True)
    parameters.add_column("unit", no_wrap=True)
    for row in found.rows():
        parameters.add_row(*row)
    left = Table(title="what they leave of the inputs", title_justify="left", title_style="bold", box=None)
    left.add_column("motion")
    left.add_column("joint", no_wrap=True)
    left.add_column("left [N m, N]", justify="right")
    left.add_column("explained [%]", justify="right")
    for row in found.residual_rows():
        left.add_row(*row)
    console.print(parameters)
    console.print()
    console.print(left)
    console.print()
    for remark in found.remarks():
        console.print(remark, soft_wrap=True)
