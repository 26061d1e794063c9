"""A run on one page: ``report.html``, which needs nothing beside itself and no network; and what any such page has.

What is on the page is for the run's drawing to say. Pictures of the scene are in it where OpenGL is at hand, and one
line that says how to install it where not.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mathnavi.renders import opengl, page
from mathnavi.renders.drawing import drawing_of
from mathnavi.renders.page import Markup, quantity
from mathnavi.renders.video import write_still
from mathnavi.sim.engine.log import write_text
from mathnavi.sim.interfaces.signals import Event
from mathnavi.sim.records.figure_names import SHORTFALL, SUMMARY_GROUPS, label
from mathnavi.sim.records.run_log import described

MOST_EVENTS = 200  # rows of the table; the rest is counted


def write_report(run_dir: str | Path) -> Path:
    """Write ``report.html`` into the run's folder, whole or not at all, and return its path.

    Raises FileNotFoundError or ValueError for a run that is not there or broken.
    """
    directory, drawing = Path(run_dir), drawing_of(run_dir)
    path = directory / "report.html"
    write_text(path, drawing.report(drawing.load_run(directory)))
    return path


def still_block(directory: Path, camera: str, t: float, alt: str, caption: str) -> Markup:
    """A picture of the run at time ``t`` [s]."""
    if opengl.available() is None:
        return page.paragraph(f"No picture of the scene: {opengl.HOW_TO_INSTALL}.")
    with tempfile.TemporaryDirectory() as scratch:
        still = write_still(directory, camera, Path(scratch) / f"{camera}.png", t=t)
        return page.picture_block(still, alt, caption)


def summary_cards(summary: Mapping[str, Any]) -> Markup:
    """The figures of the summary in their groups."""
    shown = {name: [key for key in group if key in summary] for name, group in SUMMARY_GROUPS.items()}
    return page.columns(
        {
            name.capitalize(): page.table((), [(label(key)[0], quantity(key, summary[key])) for key in keys])
            for name, keys in shown.items()
            if keys
        }
    )


def events_card(events: Sequence[Event], *, who: bool = False) -> Markup:
    """What happened, in order; with ``who``, to whom."""
    if not events:
        return page.paragraph("Nothing happened that is worth a line.")
    rows = [(f"{event.t:.2f} s", *([event.agent] if who else []), *described(event)) for event in events[:MOST_EVENTS]]
    more = len(events) - MOST_EVENTS
    counted = page.paragraph(f"{more} more in events.jsonl.") if more > 0 else Markup("")
    title = f"{len(events)} event{'s' if len(events) > 1 else ''}"
    return page.card(
        page.details(
            title, page.table(("time", *(["vehicle"] if who else []), "kind", "message"), rows), counted, is_open=True
        )
    )


def again(directory: Path, config: Mapping[str, Any]) -> tuple[Markup, ...]:
    """How to make the run once more."""
    text = json.dumps(config, indent=2, ensure_ascii=False, default=str)
    command = f"mathnavi run {config['scenario']} --from {directory}"
    return (
        page.paragraph("The same seed on the same machine gives the same log, bit for bit."),
        page.card(page.preformatted(command)),
        page.card(page.details("config.json", page.preformatted(text))),
    )


def why(summary: Mapping[str, Any]) -> str:
    """What a run did not do that it should have done, to follow the sentence that says so; "" if nothing."""
    return f" ({summary[SHORTFALL]})" if SHORTFALL in summary else ""


def rest(summary: Mapping[str, Any]) -> str:
    """What the summary's cards do not show: seed, version, how fast it ran."""
    named = {key for keys in SUMMARY_GROUPS.values() for key in keys} | {SHORTFALL}
    others = (f" · {label(key)[0]} {quantity(key, summary[key])}" for key in summary if key not in named)
    return f"mathnavi{''.join(others)}"
