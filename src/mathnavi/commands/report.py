"""``mathnavi report``: the page of a run, at any time after it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from rich.console import Console

from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.deadline import WallDeadline, watched
from mathnavi.commands.recorded_run import reading_run
from mathnavi.interfaces.bounds import configuration
from mathnavi.interfaces.checks import PAGES, checked_ending
from mathnavi.interfaces.field_table import Positional


@configuration
class ReportOptions:
    """Flags of the command: the run, and the file of its page."""

    folder: Annotated[Path, Positional("DIR")]
    """folder of a run"""
    out: Path | None = None
    """file of the page, .html or .htm; report.html in DIR if not given"""
    wall_deadline: WallDeadline | None = None
    """limit of wall-clock time [s], after which the command is ended; none if not given"""
    trust: bool = False
    """whether to import code that DIR names and that is not installed; it runs with your rights"""

    def __post_init__(self) -> None:
        if self.out is not None:
            checked_ending(self.out, PAGES, "--out")


def main(argv: Sequence[str]) -> int:
    if (code := watched("report", argv)) is not None:
        return code
    purpose = "Write the page of a run, which needs no network: the one that `mathnavi run --report` writes."
    (options,) = parse(argv, "mathnavi report", purpose, FlagGroup(ReportOptions))
    from mathnavi.renders.report import write_report  # the drawing modules take a while to import

    writing = Console(stderr=True).status("writing the report")  # visible only at a terminal
    with reading_run(options.folder, options.trust, {"--out": options.out}), writing:
        path = write_report(options.folder, options.out)
    print(path)
    return 0
