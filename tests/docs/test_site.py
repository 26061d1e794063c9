"""Checks of the documentation that need no build; `make docs` does the rest."""

from __future__ import annotations

import fnmatch
import re
import runpy
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
BUILT = ("_build", "reference/api")  # not there in a fresh clone
SCENES = DOCS / "_static" / "scenes"  # nor there
PAGES = [
    page
    for page in sorted(DOCS.rglob("*.md"))
    if not page.relative_to(DOCS).as_posix().startswith(tuple(f"{folder}/" for folder in BUILT))
]
OTHERS = ("README.md", "ARCHITECTURE.md", "CHANGELOG.md", "benchmarks/README.md", "renders/gallery/README.md")
CODE = re.compile(r"^(`{3,}|~{3,}).*?^\1|``.+?``|`[^`\n]+`", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)|(?:src|href)=\"([^\"]+)\"")


def listed(page: Path) -> Iterator[str]:
    """Entries of the toctrees of a page, from the folder of all pages."""
    for tree in re.findall(
        r"^`{3,}\{toctree\}\n(.*?)^`{3,}", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    ):
        for line in tree.splitlines():
            if line and not line.startswith(":"):
                yield (page.parent.relative_to(DOCS) / line).as_posix()


def links(text: str) -> Iterator[str]:
    """Targets of links and pictures that lie in the repository."""
    for inline, html in LINK.findall(CODE.sub("", text)):
        target = (inline or html).partition("#")[0]
        if target and not re.match(r"[a-z]+:", target):
            yield target


def test_the_configuration_is_read_without_what_the_pages_are_built_with() -> None:
    settings = runpy.run_path(str(DOCS / "conf.py"))
    assert settings["project"] == "mathnavi"
    extensions = {path.stem for path in (DOCS / "_ext").glob("*.py")}
    assert extensions & set(settings["extensions"]), "the project's own extensions are asked for"
    assert all((DOCS / folder).is_dir() for folder in settings["html_static_path"])


def test_every_page_is_in_the_contents() -> None:
    patterns = {entry for page in PAGES for entry in listed(page)}
    names = {page.relative_to(DOCS).with_suffix("").as_posix() for page in PAGES}
    lost = {name for name in names if not any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)}
    assert lost == {"index"}
    missing = {entry for entry in patterns if "*" not in entry and entry not in names}
    assert missing == {"examples/index"}  # which the build makes of examples/gallery


def test_every_link_of_a_page_leads_to_a_file() -> None:
    lost = {}
    for page in (*PAGES, *(ROOT / name for name in OTHERS)):
        wanted = {(page.parent / target).resolve() for target in links(page.read_text(encoding="utf-8"))}
        if missing := {target for target in wanted if not target.exists() and not target.is_relative_to(SCENES)}:
            lost[page] = missing
    assert lost == {}


def test_a_link_in_code_is_none_and_one_to_elsewhere_is_not_followed() -> None:
    page = '[a](b.md#c) `[d](e)` [f](https://g.org) ![h](i.png)\n```\n[j](k)\n```\n<img src="l.png"> [m](#n)\n'
    assert list(links(page)) == ["b.md", "i.png", "l.png"]


TRANSLATED = re.compile(
    r"\b(anew|likewise|nought|whoever|thereof|whence|of one's own|so many|so much|the one door|it goes on\."
    r"|none of its business|go wrong besides|did what it should|somebody|anybody|nobody|, for one(?=[,.;:])"
    r"|in the place of|most of them by the network)\b|(?<![\w.\]\[/*\\:$}{])\.\d",
    re.IGNORECASE,
)
"""words that no page needs, and a decimal without its zero"""


def odd(text: str) -> list[str]:
    """What reads as translated in the prose of a page, which is all but code, mathematics and links."""
    prose = re.sub(r"\$\$.*?\$\$|\$[^$\n]+\$|\]\([^)]*\)", "", CODE.sub("", text), flags=re.DOTALL)
    return [prose[max(0, found.start() - 40) : found.end() + 40] for found in TRANSLATED.finditer(prose)]


def test_pages_are_plain_english() -> None:
    pages = {*PAGES, *(ROOT / name for name in (*OTHERS, "CONTRIBUTING.md"))}
    pages -= {DOCS / "CLAIMS.md", ROOT / "CHANGELOG.md"}  # the thesis' words, and what was
    found = {page.name: each for page in sorted(pages) if (each := odd(page.read_text(encoding="utf-8")))}
    assert not found
    assert len(odd("It is made anew in .5 s; `anew`, [a](b.5) and $.5$ are none of its business.\n")) == 3
    assert len(odd("Somebody, for one, stands in the place of nobody.\n")) == 4


def test_the_page_of_the_browser_shows_the_runs_that_it_embeds() -> None:
    scenes = runpy.run_path(str(DOCS / "_ext" / "scenes.py"))["SCENES"]
    page = (DOCS / "how-to" / "browser.md").read_text(encoding="utf-8")
    for name, words in scenes.items():
        assert f"scenes/{name}.html" in page
        assert f"mathnavi run {' '.join(words)}\n" in page
