"""Common style of all reports: a self-contained page, which needs no network.

Blocks are pieces of HTML (``Markup``); everything else on a page is text and is escaped. Figures are SVG
inside the page, so that they follow the reader's light or dark theme and print sharply. The page forbids the browser
all requests, so a report that opens here opens anywhere.
"""

from __future__ import annotations

import base64
import html
import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import matplotlib
from matplotlib.figure import Figure

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.reading.files import read_text
from mathnavi.interfaces.reading.pictures import read_picture
from mathnavi.renders import figures
from mathnavi.sim.records.figure_definitions import definition
from mathnavi.sim.records.figure_names import label

STYLE_SHEET = Path(__file__).with_name("page.css")
# What a page may use: what stands in it.
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
UNKNOWN = "–"
COLUMN, ROW = 'th scope="col"', 'th scope="row"'
NUMBER = re.compile(rf"{UNKNOWN}|[<≤+−-]?\s?[\d.,]+(e[+-]?\d+)?\s?[^\W\d]{{0,3}}(/s²?)?%?")  # with or without a unit


Drawn = tuple[str, Figure, str]  # name, drawing, caption


class Markup(str):
    """A piece of HTML; a plain string is text."""

    __slots__ = ()


def document(title: str, *blocks: Markup) -> Markup:
    """The whole page."""
    return Markup(
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{text(title)}</title>\n<style>\n{read_text(STYLE_SHEET, ValueError)}</style>\n"
        f"</head>\n<body>\n<main>\n{joined(blocks)}</main>\n</body>\n</html>\n"
    )


def text(value: object) -> Markup:
    """Return a value as text of the page: a number with the digits that a reader can use, markup unchanged."""
    if isinstance(value, Markup):
        return value
    return Markup(html.escape(value if isinstance(value, str) else number(value), quote=True))


def joined(blocks: Sequence[Markup]) -> Markup:
    """Blocks one after the other."""
    return Markup("".join(blocks))


def number(value: object) -> str:
    """Return a figure of a summary with the digits that a reader can use; a dash if it is missing."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, float):
        return str(value)
    size = abs(value)
    if 0.0 < value < 1e-3:
        return "< 0.001"
    if size < 1.0:
        return f"{value:#.2g}" if value else "0"
    return f"{value:.2f}" if size < 10.0 else f"{value:.1f}" if size < 1e3 else f"{value:,.0f}"


def quantity(key: str, value: object) -> str:
    """The figure under a key of a summary with its unit."""
    shown = number(value)
    return shown if shown == UNKNOWN else f"{shown} {label(key)[1]}".strip()


def heading(title: str, verdict: str, good: bool | None) -> Markup:
    """The page's title and, in one sentence, what came out; None where that is neither good nor bad."""
    tone = {True: ' class="good"', False: ' class="bad"', None: ""}[good]
    return Markup(f"<header><h1>{text(title)}</h1>\n<p{tone}>{text(verdict)}</p></header>\n")


def section(title: str, *blocks: Markup) -> Markup:
    """Blocks under a title."""
    return Markup(f"<h2>{text(title)}</h2>\n{joined(blocks)}")


def paragraph(content: str) -> Markup:
    """A paragraph of text."""
    return Markup(f"<p>{text(content)}</p>\n")


def link(place: str, content: str) -> Markup:
    """A link to another page, by its place relative to this one; its text alone for any other place.

    A folder of runs may be someone else's: an address with a scheme, as a script has one, is no link.
    """
    if not place or ":" in place or place.startswith(("/", "\\")):
        return text(content)
    return Markup(f'<a href="{html.escape(quote(place), quote=True)}">{text(content)}</a>')


def tiles(values: Mapping[str, object]) -> Markup:
    """The few figures that matter most, by name."""
    boxes = (
        f'<div class="card"><b>{text(value)}</b><span>{text(name)}</span></div>\n' for name, value in values.items()
    )
    return Markup(f'<div class="tiles">\n{"".join(boxes)}</div>\n')


def term(key: str, *, unit: bool = False) -> Markup:
    """Name of a figure of a summary, with its ``unit`` in brackets if there is one, which opens what it means."""
    (shown, measure), meaning = label(key), definition(key)
    return meant(f"{shown} [{measure}]" if unit and measure else shown, meaning)


def meant(name: str, meaning: str) -> Markup:
    """A name that opens its meaning, if it has one."""
    if not meaning:
        return text(name)
    return Markup(f'<details class="term"><summary>{text(name)}</summary><p>{text(meaning)}</p></details>')


def table(columns: Sequence[str], rows: Sequence[Sequence[object]], caption: str = "") -> Markup:
    """Rows under their columns' names (none: no head); the first cell names its row, numbers stand to the right.

    Raises ArgumentError for rows of unequal length.
    """
    widths = {len(row) for row in rows} | ({len(columns)} if columns else set())
    if len(widths) > 1:
        raise ArgumentError(f"rows and columns have {', '.join(map(str, sorted(widths)))} cells; allowed: equally many")
    right = [False, *(_are_numbers(column) for column in list(zip(*rows, strict=True))[1:])]
    right += [False] * (max(widths, default=0) - len(right))  # without rows
    heads = "".join(_cell(COLUMN, *pair) for pair in zip(columns, right, strict=False))
    body = ""
    for first, *others in rows:
        cells = (_cell("td", *pair) for pair in zip(others, right[1:], strict=True))
        body += f"<tr>{_cell(ROW, first, False)}{''.join(cells)}</tr>\n"
    title = f"<caption>{text(caption)}</caption>" if caption else ""
    head = f"<thead><tr>{heads}</tr></thead>" if columns else ""
    named = f' role="group" aria-label="{text(caption)}"' if caption else ""
    table_of = f"<table>{title}{head}<tbody>\n{body}</tbody></table>"
    return Markup(f'<div class="wide" tabindex="0"{named}>{table_of}</div>\n')  # the keyboard moves it sideways


def _are_numbers(column: Sequence[object]) -> bool:
    """True if most of the cells are numbers."""
    return sum(not isinstance(cell, str) or bool(NUMBER.fullmatch(cell)) for cell in column) > 0.5 * len(column)


def _cell(tag: str, content: object, right: bool) -> str:
    kind = ' class="number"' if right else ""
    return f"<{tag}{kind}>{text(content)}</{tag[:2]}>"


def card(*blocks: Markup) -> Markup:
    """Return a card: blocks on a separate background."""
    return Markup(f'<div class="card">{joined(blocks)}</div>\n')


def columns(blocks: Mapping[str, Markup]) -> Markup:
    """Titled cards side by side as far as there is room."""
    cards = (card(Markup(f"<h3>{text(title)}</h3>"), block) for title, block in blocks.items())
    return Markup(f'<div class="columns">\n{"".join(cards)}</div>\n')


def details(title: str, *blocks: Markup, is_open: bool = False) -> Markup:
    """Blocks that a reader folds out."""
    state = " open" if is_open else ""
    return Markup(f"<details{state}><summary>{text(title)}</summary>\n{joined(blocks)}</details>\n")


def preformatted(content: str) -> Markup:
    """Return a block with a command or a file, unchanged."""
    return Markup(f"<pre>{text(content)}</pre>")


def footer(content: str) -> Markup:
    """The last lines of the page."""
    return Markup(f"<footer>{text(content)}</footer>\n")


def figure_block(figure: Figure, name: str, alt: str) -> Markup:
    """A drawing with its description below; ``name`` is its own on the page."""
    width = 96.0 * figure.get_size_inches()[0]
    return Markup(
        f'<figure class="card" tabindex="0" style="--width: {1.12 * width:.0f}">{inline_svg(figure, name, alt)}'
        f"<figcaption>{text(alt)}</figcaption></figure>\n"
    )


def figure_blocks(figures: Sequence[Drawn]) -> tuple[Markup, ...]:
    """Drawings one after the other, each with its description below."""
    return tuple(figure_block(figure, name, caption) for name, figure, caption in figures)


def picture_block(file: Path, alt: str, caption: str) -> Markup:
    """A picture in the page, as JPEG: a fifth of a PNG's size for what a camera sees."""
    buffer = io.BytesIO()
    picture, _ = read_picture(file, ValueError)
    picture.convert("RGB").save(buffer, "JPEG", quality=90)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return Markup(
        f'<figure class="card"><img src="data:image/jpeg;base64,{data}" alt="{text(alt)}">'
        f"<figcaption>{text(caption)}</figcaption></figure>\n"
    )


def inline_svg(figure: Figure, name: str, alt: str) -> Markup:
    """A figure as an SVG element in the page's theme; ``name`` keeps its identifiers apart from the others'."""
    buffer = io.StringIO()
    figures.lay_out(figure)
    with matplotlib.rc_context({"svg.hashsalt": name, "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{name}-", svg)
    svg = svg.replace(figures.INK, "currentColor").replace(figures.GRID, "var(--grid)")
    return Markup(svg.replace("<svg", f'<svg role="img" aria-label="{text(alt)}"', 1))
