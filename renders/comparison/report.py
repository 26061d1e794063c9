"""Page of a comparison: ``FILE.html``, which is self-contained and needs no network."""

from __future__ import annotations

from pathlib import Path

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.reading.files import read_text
from mathnavi.interfaces.writing import write_text
from mathnavi.renders import page
from mathnavi.renders.comparison.comparison import Comparison
from mathnavi.renders.comparison.runs import compare_runs
from mathnavi.renders.comparison.studies import compare_studies, documents
from mathnavi.renders.comparison.sweeps import compare_sweeps
from mathnavi.renders.page import Markup
from mathnavi.sim.records.table import Table

MARK = "Written by mathnavi compare."  # by which such a page is recognised
COMPARED = {"run": compare_runs, "sweep": compare_sweeps, "study": compare_studies}
KINDS = {"run": "the run of a scenario", "sweep": "the store of a sweep", "study": "a study"}


def kind_of(path: Path) -> str:
    """Return the kind of result at a place: "run", "sweep" or "study"; ArgumentError for any other."""
    if not path.exists():
        raise ArgumentError(
            f"{path} does not exist; allowed: the folder of a run or of studies, or the store of a sweep"
        )
    if path.is_dir() and (path / "config.json").is_file():
        return "run"
    if documents(path):
        return "study"
    if path.is_file():
        return "sweep"  # whether it is a store comes to light when it is read
    raise ArgumentError(
        f"{path} holds neither a run nor a study; allowed: the folder of a run or of studies, or a store"
    )


def compare(left: Path, right: Path) -> Comparison:
    """Compare two results of one kind.

    Raises ArgumentError or FileNotFoundError if one is missing or broken, and for two that cannot be compared.
    """
    kinds = [kind_of(path) for path in (left, right)]
    if kinds[0] != kinds[1]:
        raise ArgumentError(f"{left} is {KINDS[kinds[0]]} and {right} {KINDS[kinds[1]]}; allowed: two of one kind")
    return COMPARED[kinds[0]](left, right)


def write_comparison(path: Path, comparison: Comparison) -> None:
    """Write the page, whole or not at all."""
    write_text(path, report(comparison))


def is_comparison(path: Path) -> bool:
    """True if a file is such a page."""
    try:
        return path.is_file() and MARK in read_text(path, ValueError)
    except ValueError:
        return False


def report(comparison: Comparison) -> Markup:
    """Return the page's HTML."""
    places = page.table((), list(zip(comparison.names, (comparison.left, comparison.right), strict=True)))
    figures = page.figure_blocks(comparison.draw())
    first, *others = comparison.tables
    return page.document(
        comparison.title,
        page.heading(comparison.title, comparison.verdict, None),
        page.section("What is compared", page.card(places), _card(first)),
        *([page.section("Figures", *figures)] if figures else []),
        page.section("Numbers", *map(_card, others)),
        page.footer(MARK),
    )  # fmt: skip


def _card(table: Table) -> Markup:
    return page.card(page.table(table.columns, table.rows, table.title))
