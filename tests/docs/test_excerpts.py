"""Pages show pieces of the code: a piece that was renamed must not wait for `make docs` to be missed."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.docs.test_site import PAGES

pytest.importorskip("sphinx", reason="the extra [docs] is not installed")

from sphinx.config import Config
from sphinx.directives.code import LiteralIncludeReader

EXCERPT = re.compile(r"^(`{3,})\{literalinclude\} (\S+)\n(.*?)^\1$", re.DOTALL | re.MULTILINE)


def excerpts(page: Path) -> Iterator[LiteralIncludeReader]:
    """Readers of the pieces of files that a page shows."""
    for _, target, block in EXCERPT.findall(page.read_text(encoding="utf-8")):
        marks = dict(re.findall(r"^:(pyobject|start-at|end-at): (.*)$", block, re.MULTILINE))
        options = {name: value.strip("'\"") for name, value in marks.items()}
        yield LiteralIncludeReader(str(page.parent / target), options, Config())


@pytest.mark.parametrize(
    "page", [page for page in PAGES if EXCERPT.search(page.read_text(encoding="utf-8"))], ids=lambda p: p.stem
)
def test_the_code_that_a_page_shows_is_there(page: Path) -> None:
    for excerpt in excerpts(page):
        text, lines = excerpt.read()
        assert lines, excerpt.filename
        assert text.strip(), excerpt.filename


def test_code_that_is_gone_is_missed(tmp_path: Path) -> None:
    (tmp_path / "file.py").write_text("a = 1\nb = 2\n", encoding="utf-8")
    page = tmp_path / "page.md"
    page.write_text('```{literalinclude} file.py\n:start-at: "c = "\n:end-at: b\n```\n', encoding="utf-8")
    (excerpt,) = excerpts(page)
    with pytest.raises(ValueError, match="start-at pattern not found: c ="):
        excerpt.read()
