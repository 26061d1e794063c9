"""A page escapes what is text, holds all it needs, and shows numbers with the digits that a reader can use."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from PIL import Image

from mathnavi.renders import page
from mathnavi.renders.page import Markup
from tests.renders.reading import Page, check_identifiers, check_stands_alone

EVIL = '<img src="http://example.org/x.png" onerror="alert(1)"> & \'"'


def drawing() -> Figure:
    figure = Figure(figsize=(3.0, 2.0))
    axes = figure.add_subplot()
    axes.plot([0.0, 1.0], [0.0, 2.0], clip_on=True)
    axes.set_title("a < b & c")
    return figure


@pytest.mark.parametrize(
    "block",
    [
        page.heading(EVIL, EVIL, True),
        page.section(EVIL, page.paragraph(EVIL)),
        page.tiles({EVIL: EVIL}),
        page.table((EVIL, "b"), [(EVIL, EVIL)], EVIL),
        page.columns({EVIL: page.paragraph("b")}),
        page.details(EVIL, page.preformatted(EVIL)),
        page.footer(EVIL),
        page.figure_block(drawing(), "drawing", EVIL),
    ],
)
def test_text_is_never_markup(block: Markup) -> None:
    source = page.document(EVIL, block)
    check_stands_alone(source)
    parsed = Page(source)
    assert "img" not in {tag for tag, _ in parsed.attributes}
    assert EVIL in parsed.words


def test_markup_is_kept_and_plain_text_is_escaped() -> None:
    assert page.text(Markup("<b>x</b>")) == "<b>x</b>"
    assert page.text("<b>x</b>") == "&lt;b&gt;x&lt;/b&gt;"


def test_figures_on_one_page_keep_their_identifiers_apart() -> None:
    blocks = [page.figure_block(drawing(), name, "a line") for name in ("one", "two")]
    source = page.document("two figures", *blocks)
    check_identifiers(source)
    check_stands_alone(source)


def test_a_figure_is_the_same_text_every_time_and_in_the_readers_ink() -> None:
    svg = page.inline_svg(drawing(), "drawing", "a line")
    assert svg == page.inline_svg(drawing(), "drawing", "a line")
    assert 'role="img" aria-label="a line"' in svg


def test_a_picture_lies_in_the_page(tmp_path: Path) -> None:
    Image.new("RGB", (40, 30), "#336699").save(tmp_path / "picture.png")
    source = page.document("a picture", page.picture_block(tmp_path / "picture.png", "blue", "all blue"))
    check_stands_alone(source)
    assert "data:image/jpeg;base64," in source


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, "–"), (math.nan, "–"), (True, "yes"), (False, "no"), (17, "17"), ("as it is", "as it is"), (0.0, "0"),
        (3e-10, "< 0.001"), (0.28123, "0.28"), (7.0, "7.00"), (276.43333, "276.4"), (76211.3, "76,211"),
        (-12.34, "-12.3"),
    ],
)  # fmt: skip
def test_numbers_have_the_digits_that_a_reader_can_use(value: object, shown: str) -> None:
    assert page.number(value) == shown


def test_quantities_have_the_unit_of_their_key_and_unknown_ones_none() -> None:
    assert page.quantity("path_length_m", 76211.3) == "76,211 m"
    assert page.quantity("arrival_time_s", None) == "–"


def test_numbers_of_a_table_stand_to_the_right_and_words_to_the_left() -> None:
    source = page.table(("name", "length", "word"), [("a", "1,234 m", "one"), ("b", 3.5, "two"), ("c", "–", "3 of 4")])
    right = [a.get("class") for tag, a in Page(source).attributes if tag == "td"]
    assert right == ["number", None] * 3


def test_rows_of_unequal_length_are_refused() -> None:
    with pytest.raises(ValueError, match="2, 3 cells"):
        page.table(("a", "b", "c"), [("1", "2", "3"), ("1", "2")])
    with pytest.raises(ValueError, match="1, 2 cells"):
        page.table(("a", "b"), [("1",)])


def test_a_table_without_rows_has_its_head_alone() -> None:
    assert Page(page.table(("a", "b"), [])).words == ["a", "b", "\n", "\n"]


@pytest.mark.parametrize(
    "place", ["javascript:alert(1)", "https://elsewhere", "//elsewhere", "/etc/passwd", "\\\\a", ""]
)
def test_a_link_leads_to_a_page_beside_and_nowhere_else(place: str) -> None:
    assert page.link(place, "<it>") == "&lt;it&gt;"
    assert page.link("../a b.html", "it") == '<a href="../a%20b.html">it</a>'
