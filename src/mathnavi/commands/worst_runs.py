"""Worst runs of a sweep or a search: chosen, flown again into one folder each, and linked."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from mathnavi.commands.errors import print_error, worded
from mathnavi.interfaces.errors import RunFolderError
from mathnavi.sim.plugin.trust import trusting
from mathnavi.sim.records.figure_names import SHORTFALL, label
from mathnavi.sim.records.files import inside
from mathnavi.sim.records.run_folder import NothingToDrawError
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import format_value, is_number
from mathnavi.sim.sweep.trial import Trial

if TYPE_CHECKING:
    from mathnavi.renders.page import Markup

# What runs are ordered by, the first figure that they have; True where the largest value is the worst.
JUDGED = {
    "clearance_margin_m": False, "miss_m": True, "position_rms_m": True, "attitude_rms_rad": True,
    "velocity_rms": True, "error_rms": True,
}  # fmt: skip


def worst(records: Mapping[str, Record], count: int) -> list[str]:
    """Return the names of at most ``count`` runs that ended, the worst first: without success, then by their figure."""
    flown = {name: record for name, record in records.items() if record.status == "ok"}
    key = _judged(flown)

    def badness(name: str) -> tuple[bool, float]:
        record = flown[name]
        value = None if key is None else record.summary.get(key)
        if key is None or value is None:
            return bool(record.success), 0.0
        return bool(record.success), -float(value) if JUDGED[key] else float(value)

    return sorted(flown, key=badness)[:count]


def worst_section(
    records: Mapping[str, Record], varied: Sequence[str], linked: Callable[[str, str], Markup], count: int, caption: str
) -> Markup:
    """Return a section with the worst runs, an empty text if none ran to its end.

    ``linked(name, words)`` is the link to the run of a name.
    """
    from mathnavi.renders.page import UNKNOWN, Markup, card, quantity, section, table  # slow to import

    names = worst(records, count)
    if not names:
        return Markup("")
    key = _judged({name: records[name] for name in names})
    called = run_names([records[name] for name in names], varied)
    rows = [
        (
            linked(name, words),
            *(format_value(record.fields.get(field, UNKNOWN)) for field in varied),
            "yes" if record.success else str(record.summary.get(SHORTFALL, "no")),
            *([] if key is None else [quantity(key, record.summary.get(key))]),
        )
        for name, words, record in ((name, words, records[name]) for name, words in zip(names, called, strict=True))
    ]
    heads = ("run", *varied, "success", *([] if key is None else [label(key)[0]]))
    return section("Worst runs", card(table(heads, rows, caption)))


def run_names(records: Sequence[Record], varied: Sequence[str]) -> list[str]:
    """Return a name for each run, of what differs among them: the seed, the ``varied`` fields, else their place."""
    seeds = [f"seed {record.seed}" for record in records]
    if len(set(seeds)) == len(seeds):
        return seeds
    of_fields = [[f"{field} {format_value(record.fields.get(field))}" for record in records] for field in varied]
    differing = [words for words in (seeds, *of_fields) if len(set(words)) > 1]
    names = [", ".join(words) for words in zip(*differing, strict=True)] or seeds
    if len(set(names)) < len(names):
        names = [f"{name}, {k} of {len(names)}" for k, name in enumerate(names, 1)]
    return names


def fly_again(trials: Sequence[tuple[str, Trial]], folder: Path, page: Path | None = None) -> list[Path]:
    """Fly trials again, each into its own folder, worst-1, worst-2, ..., and return these.

    ``trials`` have the name of what each is part of; with a ``page`` of that, its report links to it.
    """
    written = []
    for k, (name, trial) in enumerate(trials, 1):
        own, run = inside(folder, folder / f"worst-{k}"), trial.flown()
        if page is not None:
            part_of = {"name": name, "page": os.path.relpath(page.resolve(), own.resolve())}
            run = replace(run, config={**run.config, "part_of": part_of})
        written.append(run.save(own))
    return written


def write_reports(folders: Sequence[Path]) -> None:
    """Write the report of each run into its folder; one that cannot be drawn is named on standard error."""
    from mathnavi.renders.report import write_report  # slow to import

    for folder in folders:
        try:
            with trusting():  # its drawing is the one of the scenario that has been flown
                write_report(folder)
        except (NothingToDrawError, RunFolderError) as error:
            print_error(f"no report of {folder}: {worded(error)}")


def report_link(page: Path, folder: Path, words: str) -> Markup:
    """Return a link from a page to the report in a run's folder, its words alone if there is none."""
    from mathnavi.renders.page import link  # slow to import

    report = folder / "report.html"
    if not report.is_file():
        return link("", words)
    return link(os.path.relpath(report.resolve(), page.resolve().parent), words)


def _judged(flown: Mapping[str, Record]) -> str | None:
    """Name of the figure by which runs are ordered, None if they have none of them."""
    first = next(iter(flown.values()), None)
    return None if first is None else next((name for name in JUDGED if is_number(first.summary.get(name))), None)
