"""Signatures with one parameter a line, as lists: Sphinx writes a ``<dl>`` without terms, which is no valid HTML."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

LINES = re.compile(r"<dl>\n((?:<dd>(?:(?!<dl|</dl>|</dd>).)*</dd>\n)+)</dl>", re.DOTALL)


def _as_list(found: re.Match[str]) -> str:
    lines = found[1].replace("<dd>", '<span class="sig-line" role="listitem">').replace("</dd>", "</span>")
    return f'<span role="list">\n{lines}</span>'


def _rewritten(app: Sphinx, page: str, template: str, context: dict[str, Any], tree: nodes.document | None) -> None:
    if "body" in context:
        context["body"] = LINES.sub(_as_list, context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", _rewritten)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
