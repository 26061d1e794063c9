"""Report of a run on one page, which is self-contained and needs no network; the skeleton of such a page.

Every report has a headline, figures of merit, summary, wall-clock times of the components, figures, events and
configuration; a drawing fills them (``run_page``). It contains pictures of the scene if OpenGL is available, else one
line that says why not.
"""

from __future__ import annotations

import json
import shlex
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from mathnavi.interfaces.innovations import INNOVATION_STD, INNOVATIONS
from mathnavi.interfaces.signals import Array, Event
from mathnavi.interfaces.writing import write_text
from mathnavi.models import opengl
from mathnavi.renders import figures, page
from mathnavi.renders.child import DrawingFailedError
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.video import write_still
from mathnavi.sim.plugin.trust import uninstalled
from mathnavi.sim.records.documents import LOG_SCENARIO
from mathnavi.sim.records.event_kinds import event_definition, with_origin
from mathnavi.sim.records.figure_names import (
    PLANNER_STATUS,
    SHORTFALL,
    SUMMARY_GROUPS,
    is_wall_clock,
    label,
    rest_heading,
)
from mathnavi.sim.records.run_folder import described
from mathnavi.sim.records.timing import LATENCY, read_timing, slow_components, timing_table

MOST_EVENTS = 200  # rows of the table; the rest is counted


class ReportedRun(Protocol):
    """Records of a run, of one vehicle or of a fleet, that every report shows."""

    @property
    def directory(self) -> Path: ...
    @property
    def config(self) -> Mapping[str, Any]: ...
    @property
    def summary(self) -> Mapping[str, Any]: ...
    @property
    def events(self) -> Sequence[Event]: ...


@dataclass(frozen=True)
class Headline:
    """Head of a report: title, verdict and the most important figures."""

    title: str
    verdict: str  # what came out, in a sentence
    good: bool | None  # None where that is neither good nor bad
    tiles: Mapping[str, object]  # the few figures that matter most, by name


def write_report(run_dir: str | Path, path: Path | None = None) -> Path:
    """Write the page of a run whole or not at all, to ``report.html`` in its folder if no ``path`` is given; return the
    path.

    Raises FileNotFoundError or ValueError for a run that is missing or broken.
    """
    directory = Path(run_dir)
    path = directory / "report.html" if path is None else path
    write_text(path, report_page(directory))
    return path


def report_page(directory: Path) -> Markup:
    """The page of the run in a folder; errors as of ``write_report``."""
    drawing = drawing_of(directory)
    opengl.import_mujoco()  # which the scene of a page needs; what draws is another process
    return drawing.page(drawing.load_run(directory))


def run_page(
    run: ReportedRun,
    headline: Headline,
    opening: Sequence[Markup],
    closing: Sequence[Markup] = (),
    *,
    by_vehicle: bool = False,
) -> Markup:
    """The page of a run.

    Args:
        run: its records.
        headline: what it says first.
        opening: blocks before the summary.
        closing: blocks between the summary and the events.
        by_vehicle: whether the events name the vehicle they happened to.
    """
    return page.document(
        headline.title,
        page.heading(headline.title, headline.verdict, headline.good),
        *_part_of(run.config),
        page.tiles(headline.tiles),
        *opening,
        page.section("Summary", summary_cards(run.summary)),
        *timing_section(run.directory),
        *closing,
        *events_sections(run.events, run.config, by_vehicle=by_vehicle),
        page.section("Do it again", *again(run.directory, run.config)),
        page.footer(rest(run.summary)),
    )


def _part_of(config: Mapping[str, Any]) -> tuple[Markup, ...]:
    """Link to the page of the search that a run belongs to."""
    whole = config.get("part_of")
    if not isinstance(whole, Mapping):
        return ()
    return (page.paragraph(Markup(f"A run of {page.link(str(whole.get('page')), str(whole.get('name')))}.")),)


def solve_figures(summary: Mapping[str, Any]) -> list[Drawn]:
    """The figure of solve times, where plans were optimised."""
    if summary.get("solve_ms_mean") is None:
        return []
    return [("solve", figures.solve_figure(summary), "Thread CPU time of one optimisation.")]


def innovation_figures(arrays: Mapping[str, Array], duration: float) -> list[Drawn]:
    """The figure of the innovations, from the arrays of a vehicle's log, where its estimator has published some."""
    t, nu, deviation = (arrays.get(f"estimate.{name}") for name in ("t", INNOVATIONS, INNOVATION_STD))
    if t is None or nu is None or deviation is None or nu.ndim != 2 or nu.shape != deviation.shape:
        return []
    if not np.isfinite(nu).any():
        return []
    caption = (
        "Squares of what the readings are off from the estimator's predictions, over the variances that it expects, on "
        "average over the numbers read within each hundredth of the run: 1 where all is as declared."
    )
    return [("innovations", figures.innovations_figure(t, nu, deviation, duration), caption)]


def event_figures(run: ReportedRun, duration: float, of_all: str = "") -> list[Drawn]:
    """The figure of the events up to ``duration`` [s], where there were any; ``of_all`` follows its caption."""
    if not run.events:
        return []
    caption = f"The times at which each kind of event happened{of_all}."
    return [("events", figures.events_figure(run.events, duration), caption)]


def still_block(directory: Path, camera: str, t: float, alt: str, caption: str) -> Markup:
    """A picture of the run at time ``t`` [s]."""
    with tempfile.TemporaryDirectory() as scratch:
        try:
            opengl.backend()  # raises before the run is read for nothing
            still = write_still(directory, camera, Path(scratch) / f"{camera}.png", t=t)
        except (opengl.NoOpenGLError, DrawingFailedError) as error:
            return page.paragraph(f"No picture of the scene: {error}.")
        return page.picture_block(still, alt, caption)


def summary_cards(summary: Mapping[str, Any]) -> Markup:
    """The figures of the summary in their groups."""
    shown = {name: [key for key in group if key in summary] for name, group in SUMMARY_GROUPS.items()}
    shown[rest_heading(summary)] = _own_figures(summary)
    return page.columns(
        {
            name.capitalize(): page.table((), [(page.term(key), quantity(key, summary[key])) for key in keys])
            for name, keys in shown.items()
            if keys
        }
    )


def timing_section(directory: Path) -> tuple[Markup, ...]:
    """How long the answers of the run's components took, and which were slower than real time; nothing if unknown."""
    timing = read_timing(directory)
    if timing is None:
        return ()
    slow = (page.paragraph(f"{component}: {words}.") for component, words in slow_components(timing).items())
    return (page.section("Wall time", *slow, page.card(page.table(*timing_table(timing)))),)


def events_sections(
    events: Sequence[Event], config: Mapping[str, Any], *, by_vehicle: bool = False
) -> tuple[Markup, ...]:
    """The events of a run; those of the flight, or of the log, apart where an estimator ran over its readings."""
    if config.get("recorded") is None:
        return (page.section("Events", events_card(events, by_vehicle=by_vehicle)),)
    origins = with_origin(events, config)
    what, note = "flight", f"As they were recorded in {config['recorded']}, with the estimator that flew it."
    if config["scenario"] == LOG_SCENARIO:
        what, note = "log", "As they were found when the log was imported."
    sections = {
        "Events of the estimate": ([event for event, origin in origins if origin == "estimate"], ""),
        f"Events of the {what}": ([event for event, origin in origins if origin == what], note),
    }
    return tuple(
        page.section(title, *([page.paragraph(note)] if note else []), events_card(of_one, by_vehicle=by_vehicle))
        for title, (of_one, note) in sections.items()
    )


def events_card(events: Sequence[Event], *, by_vehicle: bool = False) -> Markup:
    """Table of the events, in order; with ``by_vehicle``, a column names their vehicle."""
    if not events:
        return page.paragraph("Nothing happened that is worth a line.")
    columns = ("time", *(["vehicle"] if by_vehicle else []), "kind", "message")
    shown, rows, named = events[:MOST_EVENTS], [], set()
    for event in shown:
        kind, message = described(event)
        meaning = "" if event.kind in named else event_definition(event.kind)  # at the first one of each kind
        named.add(event.kind)
        rows.append((f"{event.t:.2f} s", *([event.agent] if by_vehicle else []), page.meant(kind, meaning), message))
    more = len(events) - MOST_EVENTS
    counted = page.paragraph(f"{more} more in events.jsonl.") if more > 0 else Markup("")
    title = f"{len(events)} event{'s' if len(events) > 1 else ''}"
    return page.card(page.details(title, page.table(columns, rows), counted, is_open=True))


def again(directory: Path, config: Mapping[str, Any]) -> tuple[Markup, ...]:
    """The command that repeats a run, and its configuration."""
    text = json.dumps(config, indent=2, ensure_ascii=False, default=str)
    if config["scenario"] == LOG_SCENARIO:
        return *_estimated_again(config), page.card(page.details("config.json", page.preformatted(text)))
    folder = f"./{directory}" if str(directory).startswith("-") else str(directory)
    command = shlex.join(["mathnavi", "run", str(config["scenario"]), "--from", folder])
    foreign = uninstalled(_plugins(config))
    caution = (
        f"Not an installed plug-in: {', '.join(foreign)}. Add --trust, and run the command in the folder that has the "
        "code."
    )
    return (
        page.paragraph(_repetition(config)),
        page.card(page.preformatted(command)),
        *([page.paragraph(caution)] if foreign else []),
        page.card(page.details("config.json", page.preformatted(text))),
    )


def _estimated_again(config: Mapping[str, Any]) -> tuple[Markup, ...]:
    """The command that runs the estimator of a log over it again; where it is from if none has run."""
    fields, estimator = config.get("fields", {}), config.get("estimator")
    if not isinstance(estimator, Mapping) or config.get("recorded") is None:
        digest = config.get("inputs", {}).get("file", "not recorded")
        return (page.paragraph(f"Imported from {fields.get('file')}, whose SHA-256 digest is {digest}."),)
    words = ["mathnavi", "estimate", str(estimator.get("name")), str(config["recorded"])]
    words += ["--mission", str(estimator.get("mission"))]
    return (
        page.paragraph("With the estimator's fields below, the same log and the same mission give the same estimates."),
        page.card(page.preformatted(shlex.join(words))),
    )


def _repetition(config: Mapping[str, Any]) -> str:
    """Result of the command that repeats a run."""
    if config.get("recorded") is not None:
        return (
            f"Its estimator ran over the readings and inputs of {config['recorded']}. This command simulates the "
            "scenario with that estimator in the loop, so its log is another one."
        )
    given = " and the delays of the plans as they were measured give" if LATENCY in config else " gives"
    return (
        f"The same seed{given} the same log: bit for bit on the same kind of processor with the same versions, to "
        "rounding elsewhere."
    )


def _plugins(config: Mapping[str, Any]) -> Iterator[str]:
    """Scenario and plug-ins of a run as its configuration records them, by name or by place."""
    yield str(config["scenario"])
    for part in ("controller", "estimator"):
        yield str(config.get(part, {}).get("name", ""))
    yield str(config.get("fields", {}).get("consensus", ""))


def why(summary: Mapping[str, Any]) -> str:
    """Return the shortfall of a run in brackets, to follow the verdict; "" without one."""
    return f" ({summary[SHORTFALL]})" if SHORTFALL in summary else ""


def _own_figures(summary: Mapping[str, Any]) -> list[str]:
    """Figures of no group: those that a scenario has made itself."""
    grouped = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    return [key for key in summary if not (key in grouped or _is_provenance(key) or key in (SHORTFALL, PLANNER_STATUS))]


def _is_provenance(key: str) -> bool:
    return key in ("seed", "version") or is_wall_clock(key)


def rest(summary: Mapping[str, Any]) -> str:
    """Figures of the summary that its cards leave out: seed, version, how fast it ran."""
    grouped = {key for keys in SUMMARY_GROUPS.values() for key in keys}
    shown = [key for key in summary if _is_provenance(key) and key not in grouped]
    others = (f" · {label(key)[0]} {quantity(key, summary[key])}" for key in shown)
    return f"mathnavi{''.join(others)}"
