"""A study's page shows every claim with its verdict in words, every number, every figure and the command."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from mathnavi.renders.study_report import StudyPage, Table, report
from mathnavi.renders.terrain_view import Track
from mathnavi.sim.records.claims import Claim
from tests.renders.reading import Page, check_identifiers, check_stands_alone
from tests.renders.synthetic import ridges

PATH = np.array([[1e3, 1e3, 2500.0], [9e3, 8e3, 2600.0]])


def drawing() -> Figure:
    figure = Figure()
    figure.add_subplot().plot([0.0, 1.0])
    return figure


def claim(name: str, kind: str, holds: bool | None) -> Claim:
    return Claim(name, kind, f"{name} & all", "Table A.1", f"{name} < 3", f"{name}: 2.9", holds)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def study() -> StudyPage:
    return StudyPage(
        name="horizon",
        title="Horizon, ridges",
        summary=["Flown with <four> horizons.", "The unit is unknown."],
        tables=[
            Table("Table A.1", ("T_p", "path [m]", "printed"), [("5 s", "73,169", "71,080"), ("10 s", 69_953, None)])
        ],
        figures=[("horizon", drawing(), "Medians."), ("paths", drawing(), "Paths.")],
        claims=[claim("A.path", "printed", False), claim("A.effort", "printed", True), claim("fast", "target", None)],
        terrain=ridges(33),
        tracks=[Track("T_p = 5 s", PATH, "#c2183b")],
        command="mathnavi study horizon",
        places={"start": PATH[0]},
        radars=[(3e3, 3e3, 2000.0, 1e3)],
    )


@pytest.mark.usefixtures("laid_out")
def test_everything_that_was_found_is_shown(study: StudyPage) -> None:
    source = report(study)
    check_stands_alone(source)
    check_identifiers(source)
    page = Page(source)
    for one in study.claims:
        for word in (one.id, one.kind, one.statement, one.source, one.expected, one.measured, one.verdict):
            assert word in page.words
    for word in (*study.summary, "Table A.1", "73,169", "71,080", "69953", "–", "Medians.", "Paths.", study.command):
        assert word in page.words
    assert sum(tag == "svg" for tag, _ in page.attributes) == 2
    assert "<h1>Horizon, ridges: 1 of 3 claims holds, 1 does not, 1 was not measured</h1>" in source
    assert "T_p = 5 s" in {layer["name"] for layer in page.scenes[0]["layers"]}
    assert len(source.encode()) < 2e6


def tones(source: str) -> list[str | None]:
    """Tones of the headline, then of each verdict in the table of claims."""
    headline = next(attributes for tag, attributes in Page(source).attributes if tag == "p")
    verdicts = [attributes for tag, attributes in Page(source).attributes if tag == "span"]
    return [headline.get("class"), *(verdict.get("class") for verdict in verdicts if verdict.get("class") != "whole")]


@pytest.mark.parametrize(
    ("kind", "holds", "expected"),
    [("printed", True, ["good", "good"]), ("printed", False, [None, "bad"]), ("printed", None, [None, None]),
     ("target", False, ["bad", "bad"])],
)  # fmt: skip
def test_a_headline_is_good_where_all_holds_and_bad_where_a_target_fails(
    study: StudyPage, kind: str, holds: bool | None, expected: list[str | None]
) -> None:
    assert tones(report(replace(study, claims=[claim("x", kind, holds)]))) == expected


@pytest.mark.parametrize("holds", [True, False])
def test_a_first_look_says_so_and_judges_nothing(study: StudyPage, holds: bool) -> None:
    claims = [claim("x", "target", holds)]
    source = report(replace(study, claims=claims, first_look="seeds 2 instead of 20"))
    assert "A first look, seeds 2 instead of 20: too little to judge by." in Page(source).text
    assert tones(source) == [None]


def test_without_a_terrain_there_is_none_on_the_page(study: StudyPage) -> None:
    source = report(replace(study, terrain=None, tracks=(), places={}, radars=()))
    check_stands_alone(source)
    page = Page(source)
    assert "Over the terrain" not in page.words
    assert not page.scenes
    assert "<script" not in source
