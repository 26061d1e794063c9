"""Every figure of a summary has a meaning, which its reports open at its name."""

from __future__ import annotations

import pytest

from mathnavi.renders import page
from mathnavi.sim.records.figure_definitions import DEFINITIONS, definition
from mathnavi.sim.records.figure_names import SUMMARY_GROUPS

FIGURES = [key for group in SUMMARY_GROUPS.values() for key in group]


def test_every_figure_of_every_group_has_one_and_nothing_else_has() -> None:
    assert sorted(DEFINITIONS) == sorted(FIGURES)


@pytest.mark.parametrize("key", FIGURES)
def test_a_meaning_is_sentences_and_says_more_than_the_name(key: str) -> None:
    text = definition(key)
    assert text.endswith(".")
    assert text[0].isupper() or text[0] in "|λ"
    assert len(text.split()) > 1
    assert text.rstrip(".").lower() != key.replace("_", " ")


def test_the_name_of_a_figure_opens_its_meaning() -> None:
    found = page.term("nees_mean")
    assert found.startswith('<details class="term"><summary>nees mean</summary><p>')
    assert "P⁻¹e" in found
    assert "e&#x27;P" in found  # escaped
    assert page.term("of_a_stranger") == "of a stranger"
