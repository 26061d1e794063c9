"""Report of a study on one page: its configuration, its claims, the thesis' numbers next to ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders import page
from mathnavi.renders.page import Drawn, Markup
from mathnavi.renders.terrain_view import Track, terrain_view
from mathnavi.sim.records.claims import Claim, tally
from mathnavi.sim.records.table import Table as Table

MOST_MISSED = 3  # targets that a title names


@dataclass(frozen=True, eq=False)
class StudyPage:
    """Contents of the page of a study."""

    name: str
    title: str
    summary: Sequence[str]  # paragraphs
    tables: Sequence[Table]
    figures: Sequence[Drawn]
    claims: Sequence[Claim]
    command: str  # that repeats it
    first_look: str = ""  # how it is smaller than the full study
    terrain: HeightField | None = None  # what it was done on, if anything
    tracks: Sequence[Track] = ()
    places: Mapping[str, Array] = field(default_factory=dict)  # (3,) [m] map frame
    radars: Sequence[tuple[float, float, float, float]] = ()  # x, y, z, radius [m]


def report(study: StudyPage) -> Markup:
    """Return the page's HTML."""
    view = () if study.terrain is None else (_over(study.terrain, study),)
    return page.document(
        _title(study),
        _headline(study),
        *(page.paragraph(words) for words in study.summary),
        page.section("Claims", page.card(_claims(study))),
        page.section("Numbers", *(page.card(page.table(t.columns, t.rows, t.title)) for t in study.tables)),
        page.section("Figures", *page.figure_blocks(study.figures)),
        *view,
        page.section("Do it again", page.card(page.preformatted(study.command))),
    )


def _title(study: StudyPage) -> str:
    """Name of the study and what it found: how many of its claims hold, and which targets are missed."""
    if study.first_look or not study.claims:
        return study.title
    missed = [claim.id for claim in study.claims if claim.holds is False and claim.kind == "target"]
    named = f"; missed: {', '.join(missed)}" if 0 < len(missed) <= MOST_MISSED else ""
    return f"{study.title}: {tally(study.claims)}{named}"


def _headline(study: StudyPage) -> Markup:
    """Good if every claim holds, bad if a target is missed; else neither, as where there is too little to judge."""
    if study.first_look:
        words = f"A first look, {study.first_look}: too little to judge by. {tally(study.claims)}."
        return page.heading(_title(study), words, None)
    missed = any(claim.holds is False for claim in study.claims if claim.kind == "target")
    good = False if missed else True if all(claim.holds for claim in study.claims) else None
    return page.heading(_title(study), f"{tally(study.claims)}.", good)


def _over(terrain: HeightField, study: StudyPage) -> Markup:
    return page.section("Over the terrain", terrain_view(terrain, study.tracks, study.places, study.radars))


def _claims(study: StudyPage) -> Markup:
    columns = ("claim", "statement", "where", "expected", "measured", "holds")
    return page.table(
        columns,
        [
            (
                Markup(f'<span class="whole">{page.text(claim.id)}</span><br><small>{claim.kind}</small>'),
                claim.statement,
                claim.source,
                claim.expected,
                claim.measured,
                claim.verdict if study.first_look else _verdict(claim),
            )
            for claim in study.claims
        ],
    )


def _verdict(claim: Claim) -> Markup:
    tones = {True: ' class="good"', False: ' class="bad"', None: ""}
    return Markup(f"<span{tones[claim.holds]}>{claim.verdict}</span>")
