"""``mathnavi export``: a run as a recording of Rerun, or as an MCAP file for Foxglove and others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from mathnavi.commands import opengl
from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.errors import bad_input
from mathnavi.commands.recorded_run import reading_run
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import checked_ending
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import Positional
from mathnavi.interfaces.writing import naming, whole_files

PURPOSE = "Write a run for other viewers: its scene, plans, estimates, readings, signals and events."


@configuration
class ExportOptions:
    """Flags of the command: the run to write, and the files."""

    folder: Annotated[Path, Positional("DIR")]
    """folder of a run"""
    rerun: Path | None = None
    """file to write for Rerun, .rrd; needs the extra rerun"""
    mcap: Path | None = None
    """file to write for Foxglove and all else that reads MCAP, .mcap; needs the extra mcap"""
    trust: bool = False
    """whether to import code that DIR names and that is not installed; it runs with your rights"""

    def __post_init__(self) -> None:
        if self.rerun is None and self.mcap is None:
            raise FieldError("--rerun and --mcap are missing; allowed: --rerun FILE.rrd, --mcap FILE.mcap, or both")
        if self.rerun is not None:
            checked_ending(self.rerun, (".rrd",), "--rerun")
        if self.mcap is not None:
            checked_ending(self.mcap, (".mcap",), "--mcap")


def main(argv: Sequence[str]) -> int:
    (options,) = parse(argv, "mathnavi export", PURPOSE, FlagGroup(ExportOptions))
    opengl.check_choice()
    from mathnavi.renders.export import mcap_file, rerun_file  # the drawing modules take a while to import
    from mathnavi.renders.export.contents import read_run

    wanted = {
        path: module for path, module in ((options.rerun, rerun_file), (options.mcap, mcap_file)) if path is not None
    }
    with bad_input():
        writers = [module.writer() for module in wanted.values()]  # before anything is read: a package may be missing
    with reading_run(options.folder, options.trust, {"--rerun": options.rerun, "--mcap": options.mcap}):
        run = read_run(options.folder)
        with whole_files(*wanted) as scratch:
            for write, path, made in zip(writers, wanted, scratch, strict=True):
                with naming(path):
                    write(made, run)
    for path in wanted:
        print(path)
    return 0
