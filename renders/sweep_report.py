"""Report of a sweep on one page: rates with exact limits, medians with bootstrap bands, every failure."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.short_tables import counted
from mathnavi.interfaces.writing import write_text
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders import page
from mathnavi.renders.page import UNKNOWN, Markup, number, quantity
from mathnavi.renders.statistics_figures import (
    SERIES,
    bands_figure,
    distribution_figure,
    medians_figure,
    rates_figure,
    scatter_figure,
)
from mathnavi.renders.terrain_view import Track, terrain_view
from mathnavi.sim.records.computing_environment import environment, environment_digest
from mathnavi.sim.records.figure_names import PLANNER_STATUS, SHORTFALL, label
from mathnavi.sim.records.statistics import Band, Proportion, percent
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import (
    CLEARANCE,
    CLEARANCE_BOUND,
    Sweep,
    TrialGroup,
    figures,
    format_numbers,
    format_value,
    grouped,
    is_number,
    planned_by_none,
    shared,
)

MOST_TILES = 5
MOST_DRAWN = 30  # groups in a forest plot
MOST_PANELS = 6  # figures of the summary that are drawn; the table has all
MOST_FAILURES = 200  # in a list; the rest is counted
DECADES = 20.0  # ratio of the 90th to the 10th percentile from which an axis has a log scale


def write_sweep_report(
    path: Path,
    records: Sequence[Record],
    varied: Sequence[str],
    terrain: HeightField | None,
    tracks: Sequence[Track],
    command: str,
    worst: Markup | None = None,
) -> Path:
    """Write the page, whole or not at all, and return its path.

    ``varied`` are the names of fields as in ``Record.fields``, ``worst`` a section with links to single runs. Raises
    ValueError if there are no records, and for a field that no record has.
    """
    write_text(path, report(Sweep(records, varied), terrain, tracks, command, worst))
    return path


def report(
    sweep: Sweep, terrain: HeightField | None, tracks: Sequence[Track], command: str, worst: Markup | None = None
) -> Markup:
    """Return the page's HTML."""
    scenarios = ", ".join(dict.fromkeys(record.scenario for record in sweep.records))
    title = f"{scenarios}: {_found(sweep)}"
    return page.document(
        title,
        *_headline(title, sweep),
        *([worst] if worst else []),
        page.section("Rates", *_rates(sweep)),
        page.section("Medians", *_medians(sweep)),
        *_clearance(sweep),
        *(page.section(f"Over {name}", *_over(sweep, name)) for name in sweep.continuous),
        *([page.section("Over the terrain", terrain_view(terrain, tracks))] if terrain else []),
        *_failures(sweep),
        page.section("Times", _times(sweep)),
        page.section("Do it again", *_again(sweep, command)),
        page.footer(f"Code: {', '.join(sorted({record.code for record in sweep.records}))}"),
    )


def _found(sweep: Sweep) -> str:
    """Title of a sweep's page: how many trials succeeded, and the least clearance of flights with its seed."""
    succeeded = sum(record.status == "ok" and record.success is True for record in sweep.records)
    words = f"{succeeded:,} of {counted(len(sweep.records), 'trial')} succeeded"
    known = [
        (float(value), record.seed, k)
        for k, record in enumerate(sweep.records)
        if is_number(value := record.summary.get(CLEARANCE)) and not np.isposinf(value)
    ]
    if not known:
        return words
    least, seed, k = min(known)
    of_fields = "".join(f", {name} {format_value(sweep.records[k].fields.get(name))}" for name in sweep.varied)
    if lost := sum(np.isneginf(clearance) for clearance, *_ in known):
        return f"{words}; a vehicle left the map in {lost:,} (as with seed {seed}{of_fields})"
    return f"{words}; least clearance {quantity(CLEARANCE, least)} (seed {seed}{of_fields})"


def _headline(title: str, sweep: Sweep) -> tuple[Markup, Markup]:
    everything = TrialGroup("all", (), sweep.records)
    failed = sum(record.status != "ok" for record in sweep.records)
    missed = sum(record.status == "ok" and not record.success for record in sweep.records)
    counts = {
        f"of the missions {_were(missed)} unsuccessful": missed,
        "of the trials did not run to their end": failed,
    }
    faults = [f"{count:,} {words}" for words, count in counts.items() if count]
    alone = sum(map(planned_by_none, sweep.records))
    sentences = [
        *([f"{', '.join(faults)}."] if faults else []),
        *([f"{alone:,} of the missions {_were(alone)} flown without the planner."] if alone else []),
    ]
    faulty = bool(sentences)
    verdict = " ".join(sentences or ["Every mission succeeded."])
    tiles: dict[str, object] = {"trials": f"{len(sweep.records):,}"}
    for kind, happened in sweep.events.items():
        found = everything.rate(happened)
        if found is not None and len(tiles) < MOST_TILES:
            tiles[f"{kind}: {_limits(found)}"] = f"{found.events:,} of {found.trials:,}"
    return page.heading(title, verdict, not faulty), page.tiles(tiles)


def _limits(found: Proportion) -> str:
    confidence = f"{100.0 * found.confidence:g} %"
    if found.events == 0:
        return f"at most {percent(found.upper)} % ({confidence})"
    return f"{percent(found.low)} to {percent(found.high)} % ({confidence})"


def _rates(sweep: Sweep) -> list[Markup]:
    rates = {kind: [group.rate(happened) for group in sweep.groups] for kind, happened in sweep.events.items()}
    rows = {kind: [UNKNOWN if found is None else found.text() for found in row] for kind, row in rates.items()}
    table = _by_group(
        sweep, rows, "Exact (Clopper-Pearson) 95 % limits. A rate of zero states its one-sided 95 % upper bound."
    )
    drawn = {kind: row[:MOST_DRAWN] for kind, row in _undecided(rates).items()}
    if not drawn:
        return [table]
    figure = rates_figure([group.name for group in sweep.groups[:MOST_DRAWN]], drawn)
    words = _drawn("Rates, with their 95 % limits, of what happened in some trials and not in others", sweep)
    return [table, page.figure_block(figure, "rates", words)]


def _undecided(rates: Mapping[str, Sequence[Proportion | None]]) -> dict[str, list[Proportion]]:
    """The rates that there is something to see of: known in every group, and neither 0 nor 1 in all of them."""
    known = {kind: [found for found in row if found] for kind, row in rates.items() if None not in row}
    return {kind: row for kind, row in known.items() if 0 < sum(r.events for r in row) < sum(r.trials for r in row)}


def _drawn(what: str, sweep: Sweep) -> str:
    by = f" by {', '.join(sweep.listed)}" if sweep.listed else ""
    rest = len(sweep.groups) - MOST_DRAWN
    return f"{what}{by}{f'; the first {MOST_DRAWN} groups, {rest} more are in the table' if rest > 0 else ''}."


def _medians(sweep: Sweep) -> list[Markup]:
    bands = {key: [group.band(key) for group in sweep.groups] for key in sweep.figures}
    if not bands:
        return [page.paragraph("No figure of the summary differs from trial to trial.")]
    sizes = [len(group.records) for group in sweep.groups]
    rows: dict[str, list[str]] = {
        page.term(key, unit=True): [_band_text(band, size) for band, size in zip(row, sizes, strict=True)]
        for key, row in bands.items()
    }
    table = _by_group(
        sweep, rows, "Medians with 95 % bootstrap bands, from six trials on; n where not every trial has the figure."
    )
    figure = _medians_drawn(sweep)
    caption = _drawn("Medians with their 95 % bootstrap bands", sweep) + _at_the_edge(sweep)
    return [table, page.figure_block(figure, "medians", caption)] if len(sweep.groups) > 1 else [table]


def _at_the_edge(sweep: Sweep) -> str:
    """Addition to a caption where some figures are infinite."""
    infinite = any(np.isinf(figures(sweep.records, key)).any() for key in sweep.figures[:MOST_PANELS])
    return " What is infinite stands at the edge." if infinite else ""


def _medians_drawn(sweep: Sweep) -> Figure:
    """Draw medians over a numeric field if the other fields leave few enough curves, else as a forest plot."""
    keys = sweep.figures[:MOST_PANELS]
    numeric = [name for name in sweep.listed if all(map(is_number, sweep.values(name)))]
    if numeric:
        along = max(numeric, key=lambda name: len(set(sweep.values(name))))
        x = sorted(set(sweep.values(along)))
        curves = grouped(sweep.records, [name for name in sweep.listed if name != along])
        if len(curves) <= len(SERIES):
            at = [{group.values[0]: group for group in grouped(curve.records, [along])} for curve in curves]
            panels = {
                _named(key): {
                    curve.name: [points[value].band(key) if value in points else None for value in x]
                    for curve, points in zip(curves, at, strict=True)
                }
                for key in keys
            }
            return bands_figure(x, panels, along, log=_spans_decades(x))
    drawn = sweep.groups[:MOST_DRAWN]
    return medians_figure(
        [group.name for group in drawn], {_named(key): [group.band(key) for group in drawn] for key in keys}
    )


def _by_group(sweep: Sweep, rows: dict[str, list[str]], caption: str) -> Markup:
    """A table with the shorter side across: the groups, or their figures."""
    sizes = [f"n = {len(group.records)}" for group in sweep.groups]
    if len(sweep.groups) < len(rows):
        heads = [f"{group.name} ({size})" for group, size in zip(sweep.groups, sizes, strict=True)]
        return page.card(page.table(["", *heads], [(name, *cells) for name, cells in rows.items()], caption))
    across = zip(sweep.groups, sizes, zip(*rows.values(), strict=True), strict=True)
    lines = [(group.name, size.replace(" ", "\u00a0"), *cells) for group, size, cells in across]
    return page.card(page.table([", ".join(sweep.listed), "", *rows], lines, caption))


def _clearance(sweep: Sweep) -> list[Markup]:
    if CLEARANCE not in sweep.figures:
        return []
    few = len(sweep.groups) <= len(SERIES)
    groups = sweep.groups if few else [TrialGroup("", (), sweep.records)]
    samples = {group.name if len(groups) > 1 else "": figures(group.records, CLEARANCE) for group in groups}
    samples = {name: sample[~np.isnan(sample)] for name, sample in samples.items()}
    bounds = {record.fields[CLEARANCE_BOUND] for record in sweep.records if CLEARANCE_BOUND in record.fields}
    bound = bounds.pop() if len(bounds) == 1 else None
    figure = distribution_figure(
        {name: sample for name, sample in samples.items() if len(sample)},
        _named(CLEARANCE),
        bound,
        f"allowed {bound:g} m" if bound is not None else "",
    )
    everything = np.concatenate(list(samples.values()))
    least = number(everything.min())
    words = f"Share of the trials whose least clearance is below each value; the smallest of all is {least} m."
    if lost := int(np.isneginf(everything).sum()):
        words += f" It is {number(-np.inf)} where a vehicle left the map, as in {lost} of {len(everything)} trials; "
        words += "the curve begins with their share, at the left edge."
    return [page.section("Clearance", page.figure_block(figure, "clearance", words))]


def _over(sweep: Sweep, name: str) -> list[Markup]:
    """Figures over a continuous field."""
    bins = sweep.bins(name)
    drawn = _undecided({kind: [part.rate(happened) for part in bins] for kind, happened in sweep.events.items()})
    ordered = [record for part in bins for record in part.records]
    x = np.array([float(record.fields[name]) for record in ordered])
    panels = {
        _named(key): (figures(ordered, key), [part.band(key) for part in bins]) for key in sweep.figures[:MOST_PANELS]
    }
    blocks = []
    if drawn:
        figure = rates_figure([part.name for part in bins], drawn)
        words = f"Rates, with their 95 % limits, in bins of {name}, of what happened in some trials and not in others."
        blocks.append(page.figure_block(figure, f"rates-{name}", words))
    if panels:
        ends: list[Any] = [part.values for part in bins]
        edges = [ends[0][0], *(0.5 * (below + above) for (_, below), (above, _) in pairwise(ends)), ends[-1][1]]
        figure = scatter_figure(x, panels, edges, name, log=_spans_decades(x))
        words = f"Each trial over {name}, and medians of bins with their 95 % bootstrap bands.{_at_the_edge(sweep)}"
        blocks.append(page.figure_block(figure, f"over-{name}", words))
    return blocks or [page.paragraph("Nothing differs from trial to trial.")]


def _failures(sweep: Sweep) -> list[Markup]:
    """The trials that did not run to their end, and missions without success or without their planner."""
    failed = [record for record in sweep.records if record.status != "ok"]
    missed = [record for record in sweep.records if record.status == "ok" and not record.success]
    blocks = []
    if failed:
        rows = [
            (record.status, str(record.seed), *_varied(sweep, record), _error(record))
            for record in failed[:MOST_FAILURES]
        ]
        table = page.table(("status", "seed", *sweep.varied, "error"), rows)
        blocks.append(page.section(f"Recorded failures ({len(failed)})", page.card(table), *_more(failed)))
    for title, said, records in (
        ("Missions without success", SHORTFALL, missed),
        ("Missions flown without the planner", PLANNER_STATUS, list(filter(planned_by_none, sweep.records))),
    ):
        if records:
            table = _missions(sweep, records[:MOST_FAILURES], said)
            blocks.append(page.section(f"{title} ({len(records)})", page.card(table), *_more(records)))
    return blocks


def _missions(sweep: Sweep, records: Sequence[Record], said: str) -> Markup:
    """Missions with a text of their summaries and their first figures."""
    keys = sweep.figures[:MOST_PANELS]
    rows = [
        (
            str(record.seed),
            *_varied(sweep, record),
            str(record.summary.get(said, UNKNOWN)),
            *(page.quantity(key, _whole(figures([record], key)[0])) for key in keys),
        )
        for record in records
    ]
    return page.table(("seed", *sweep.varied, label(said)[0], *(page.term(key) for key in keys)), rows)


def _varied(sweep: Sweep, record: Record) -> list[str]:
    return [format_value(record.fields[name]) if name in record.fields else UNKNOWN for name in sweep.varied]


def _error(record: Record) -> Markup:
    lines = (record.error or "it gave no reason").strip().splitlines()
    if len(lines) == 1:
        return page.text(lines[0])
    return page.details(lines[-1], page.preformatted("\n".join(lines)))


def _more(records: Sequence[Record]) -> list[Markup]:
    rest = len(records) - MOST_FAILURES
    return [page.paragraph(f"{rest} more are in the store.")] if rest > 0 else []


def _times(sweep: Sweep) -> Markup:
    everything = TrialGroup("all", (), sweep.records)
    rows = [(page.term(key, unit=True), _band_text(everything.band(key), len(sweep.records))) for key in sweep.timings]
    return page.card(
        page.table((), rows, "What depends on the machine and its load: medians with 95 % bootstrap bands.")
    )


def _were(number: int) -> str:
    return "was" if number == 1 else "were"


def _origins(sweep: Sweep) -> str:
    """Sentence on the environments that the trials were run in."""
    others = sum(record.origin.digest != environment_digest() for record in sweep.records)
    made = ", ".join(f"{name} {value}" for name, value in environment().items())
    if not others:
        return f"All were run with {made}."
    where = f"{others} of {len(sweep.records)} {_were(others)} run in another environment"
    return f"{where} than the others, which had {made}."


def _again(sweep: Sweep, command: str) -> tuple[Markup, ...]:
    same = json.dumps(shared(sweep.records), indent=2, ensure_ascii=False, default=str)
    return (
        page.paragraph(
            "The same trials with the same code give the same results, in whatever order they are run: bit for bit on "
            "the same kind of processor with the same versions, to rounding elsewhere."
        ),
        page.paragraph(_origins(sweep)),
        page.card(page.preformatted(command)),
        page.card(page.details("fields that all trials share", page.preformatted(same))),
    )


def _named(key: str) -> str:
    name, unit = label(key)
    return f"{name} [{unit}]" if unit else name


def _band_text(band: Band | None, size: int) -> str:
    if band is None:
        return UNKNOWN
    return f"{_with_limits(band)}{f' (n = {band.n})' if band.n != size else ''}"


def _with_limits(band: Band) -> str:
    if math.isnan(band.low):
        return format_numbers(band.median)[0]
    median, low, high = format_numbers(band.median, band.low, band.high)
    return f"{median} [{low}, {high}]"


def _whole(value: float) -> float:
    """A number without decimals where it has none: most medians of counts are counts."""
    return int(value) if float(value).is_integer() else float(value)


def _spans_decades(values: Iterable[float]) -> bool:
    """True if values are spread like those of a logarithm: evenly spread ones have a ratio of 9 here."""
    low, high = np.quantile(list(values), [0.1, 0.9])
    return bool(0.0 < DECADES * low <= high)
