"""Check every link of the built pages, and fail with one line for each broken link.

    python docs/check_links.py docs/_build/html

A link within the site must lead to an existing file and, behind ``#``, to an element of that name in it. Of an external
link only the form is checked: no network is used. Scripts, styles, pictures and fonts of a page must be files of the
site.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

NEEDED = {"img": "src", "script": "src", "source": "src", "video": "src", "iframe": "src", "link": "href"}
NOT_SHOWN = {"canonical", "next", "prev", "index", "search", "author", "help"}  # links of a head that load nothing


class Page(HTMLParser):
    """Links of one page, and the names to which links may lead."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.links: list[tuple[int, str, bool]] = []  # line, target, whether the page needs it to be shown
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        given = {name: value for name, value in attributes if value is not None}
        self.names |= {given[name] for name in ("id", "name") if name in given}
        shown = tag in NEEDED and given.get("rel", "") not in NOT_SHOWN
        target = given.get("href" if tag == "a" else NEEDED.get(tag, ""))
        if target is not None:
            self.links.append((self.getpos()[0], target, shown))


def check(site: Path) -> tuple[list[str], int, int]:
    """Return the faults, the number of pages, and the number of links."""
    pages = {path: Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    wrong = [
        f"{path.relative_to(site)}:{line}: {target}: {error}"
        for path, page in pages.items()
        for line, target, shown in page.links
        if (error := _wrong(path, target, shown, site, pages))
    ]
    wrong += list(_styles(site))
    return wrong, len(pages), sum(len(page.links) for page in pages.values())


def _wrong(path: Path, target: str, shown: bool, site: Path, pages: dict[Path, Page]) -> str:
    """Return why a link is broken; "" if it is not."""
    if target.startswith("data:"):
        return ""
    parts = urlsplit(target)
    if parts.scheme or parts.netloc:
        if shown:
            return "is needed to show the page, and lies elsewhere"
        well_formed = parts.scheme in ("http", "https") and re.fullmatch(r"[\w-]+(\.[\w-]+)+(:\d+)?", parts.netloc)
        return "" if well_formed or parts.scheme == "mailto" else "is not the address of anything"
    there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not there.is_relative_to(site):
        return "leads out of the site"
    if not there.is_file():
        return "there is no such file"
    if parts.fragment and there in pages and unquote(parts.fragment) not in pages[there].names:
        return f"nothing is called {unquote(parts.fragment)} there"
    return ""


def _styles(site: Path) -> Iterator[str]:
    """Return the files that a style sheet uses and that are external or missing."""
    for path in sorted(site.rglob("*.css")):
        for target in re.findall(r"url\(\s*[\"']?([^\"')]+)", path.read_text(encoding="utf-8")):
            if not target.startswith(("data:", "#")) and not (path.parent / target.partition("?")[0]).is_file():
                yield f"{path.relative_to(site)}: {target}: is needed to show the pages, and is not there"


def main() -> int:
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        print(f"usage: check_links.py FOLDER; given: {' '.join(sys.argv[1:]) or 'nothing'}", file=sys.stderr)
        return 2
    wrong, pages, links = check(Path(sys.argv[1]).resolve())
    for line in wrong:
        print(line, file=sys.stderr)
    print(f"{pages} pages, {links} links, {len(wrong)} of them lead nowhere")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
