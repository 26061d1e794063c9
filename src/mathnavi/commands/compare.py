"""``mathnavi compare``: two runs, two sweeps or two studies side by side, on the terminal and on one page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.table import Table as Printed
from rich.text import Text

from mathnavi.commands.arguments import FlagGroup, parse
from mathnavi.commands.errors import BadInputError, bad_input
from mathnavi.commands.output import output_folder
from mathnavi.interfaces.checks import check_spares
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import Positional

OUT = Path("renders/out/comparison.html")
DESCRIPTION = (
    "Two runs, two sweeps or two studies side by side: what was requested, and what came out, with difference and "
    "ratio. Signals and paths of two runs or more are compared by `mathnavi view DIR DIR... --web`."
)

Place = Annotated[Path, Positional("DIR")]


@dataclass(frozen=True)
class CompareOptions:
    """Runs, sweeps or studies to compare."""

    left: Place
    """folder of a run or of studies, a study's .json, or the store of a sweep (.db)"""
    right: Place
    """second one, of the same kind"""
    out: Path = OUT
    """page to write, .html"""

    def __post_init__(self) -> None:
        if self.out.suffix != ".html":
            raise FieldError(f"out = {self.out}; allowed: a name that ends in .html")


def main(argv: Sequence[str]) -> int:
    (options,) = parse(argv, "mathnavi compare", DESCRIPTION, FlagGroup(CompareOptions))
    from mathnavi.renders.comparison.report import (  # the drawing modules take long to import
        compare,
        is_comparison,
        write_comparison,
    )

    out = options.out
    with bad_input():
        check_spares(out, [options.left, options.right], "--out")
    with bad_input():
        if out.exists() and not is_comparison(out):
            raise BadInputError(
                f"--out = {out} exists and is not a comparison; allowed: a new file, or an earlier comparison"
            )
        comparison = compare(options.left, options.right)
    console = Console(markup=False, emoji=False)
    console.print(f"{comparison.title}. {comparison.verdict}", style="bold", highlight=False)
    for name, place in zip(comparison.names, (comparison.left, comparison.right), strict=True):
        console.print(f"{name}: {place}", soft_wrap=True, highlight=False)
    for table in comparison.tables:
        printed = Printed(title=table.title, title_justify="left", title_style="bold", box=None, padding=(0, 2, 0, 0))
        for column in table.columns:
            printed.add_column(
                column, overflow="fold", justify="right" if column in ("difference", "ratio") else "left"
            )
        for row in table.rows:
            printed.add_row(*(Text(str(cell)) for cell in row))
        console.print()
        console.print(printed)
    with output_folder(out.parent), bad_input():
        write_comparison(out, comparison)
    console.print(f"\nreport  {out}", soft_wrap=True, highlight=False)
    return 0
