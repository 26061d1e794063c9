"""Reads a report as a browser does: its tags, what it would fetch, its words."""

from __future__ import annotations

import base64
import json
import re
import zlib
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mathnavi.renders import figures
from mathnavi.renders.report import write_report
from mathnavi.sim.records.figure_names import SHORTFALL, label

VOID = {"meta", "img", "br", "link", "input"}
lay_out = figures.lay_out  # as for a user
FETCHED = ("src", "href", "xlink:href", "srcset", "poster", "action")


class Page(HTMLParser):
    """Collects tags, attributes and text; checks that tags are closed in order."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.attributes: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.scripts: list[tuple[str | None, str]] = []  # type, content
        self.styles: list[str] = []
        self._open: list[tuple[str, str | None]] = []
        self.feed(source)
        self.close()
        assert self._open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes.append((tag, dict(attrs)))
        if tag not in VOID:
            self._open.append((tag, dict(attrs).get("type")))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop()[0] == tag

    def handle_data(self, data: str) -> None:
        tag, kind = self._open[-1] if self._open else ("", None)
        if tag == "script":
            self.scripts.append((kind, data))
        elif tag == "style":
            self.styles.append(data)
        else:
            self.words.append(data)

    @property
    def text(self) -> str:
        """Everything there is to read."""
        return " ".join(self.words)

    @property
    def scenes(self) -> list[dict[str, Any]]:
        """The scenes that a reader can turn, their arrays unpacked as the viewer does."""
        return [unpacked(json.loads(content)) for kind, content in self.scripts if kind == "application/json"]


def unpacked(scene: dict[str, Any]) -> dict[str, Any]:
    """A scene of a page with arrays in the place of the references to its block of bytes."""
    block = zlib.decompress(base64.b64decode(scene.pop("block")))

    def with_arrays(value: Any) -> Any:
        if isinstance(value, list):
            return [with_arrays(each) for each in value]
        if not isinstance(value, dict):
            return value
        if {"at", "kind"} <= value.keys():
            array = np.frombuffer(block, f"<{value['kind']}", value["count"], value["at"])
            stride = value["stride"]
            return array.reshape(-1, stride).cumsum(axis=0, dtype=array.dtype).ravel() if stride else array
        return {name: with_arrays(each) for name, each in value.items()}

    return with_arrays(scene)  # type: ignore[no-any-return]


def lines_named(scene: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """The lines of a scene in the layer of a name, their points (n, 3) [m]."""
    layer = next((k for k, each in enumerate(scene["layers"]) if each["name"] == name), None)
    return [each | {"points": each["points"].reshape(-1, 3)} for each in scene["lines"] if each["layer"] == layer]


def check_stands_alone(source: str) -> None:
    """Nothing in the page is fetched, and the page forbids it; nothing follows another's style sheet or script."""
    page = Page(source)
    for tag, attributes in page.attributes:
        assert tag not in {"link", "iframe", "object", "embed", "base"}
        for name in FETCHED:
            value = attributes.get(name)
            assert value is None or value.startswith(("data:", "#")), (tag, name, value[:60])
    styles = "".join(page.styles) + " ".join(attributes.get("style") or "" for _, attributes in page.attributes)
    assert not re.search(r"url\((?!['\"]?#)|@import", styles)
    policy = next(a["content"] for t, a in page.attributes if t == "meta" and a.get("http-equiv"))
    assert policy is not None
    assert "default-src 'none'" in policy
    assert "http" not in policy


def check_identifiers(source: str) -> None:
    """Every identifier is its element's own, and every one that is used is there."""
    page = Page(source)
    identifiers = [attributes["id"] for _, attributes in page.attributes if "id" in attributes]
    assert len(identifiers) == len(set(identifiers))
    markup = re.sub(r"<script.*?</script>", "", source, flags=re.DOTALL)
    used = set(re.findall(r"url\(#([^)]+)\)", markup)) | set(re.findall(r'href="#([^"]+)"', markup))
    assert used <= set(identifiers)


def checked_report(run: Path) -> tuple[str, Page]:
    """The report of a run as a user gets it, source and page: it stands alone, its title says what was found, and it
    names every figure of the summary.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "lay_out", lay_out)
        path = write_report(run)
    source = path.read_text(encoding="utf-8")
    path.unlink()
    check_stands_alone(source)
    check_identifiers(source)
    page = Page(source)
    title = re.search("<h1>(.*?)</h1>", source)
    assert title is not None
    assert re.search("seed [0-9]+: .*[0-9]", title[1]), title[1]
    for key in json.loads((run / "summary.json").read_text(encoding="utf-8")).keys() - {SHORTFALL}:
        assert any(label(key)[0] in word for word in page.words), key
    return source, page
