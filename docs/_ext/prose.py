"""Conversion of docstrings, plain prose with ``literals`` and **strong** heads, to reStructuredText.

An indented paragraph is a formula or a sketch and is shown verbatim; one whose lines start with ``*`` or ``-`` is a
list; any other is prose, in which only double backquotes and pairs of double asterisks have a meaning.
"""

from __future__ import annotations

import inspect
import re

_BULLET = re.compile(r"[*-] +")
_NUMBER = re.compile(r"\d+[.)] +")
_MARKED = re.compile(r"(``.+?``|(?<![\w*])\*\*(?=[^\s*])[^*`]*[^\s*]\*\*(?![\w*]))")


def prose(text: str | None) -> list[str]:
    """Return lines of reStructuredText, with an empty one after each paragraph."""
    lines: list[str] = []
    for paragraph in re.split(r"\n\s*\n", inspect.cleandoc(text or "")):
        if paragraph.strip():
            lines += [*_paragraph(paragraph.splitlines()), ""]
    return lines


def inline(text: str) -> str:
    """Return a paragraph as one line, in which only ``literals`` and **strong** words are marked up."""
    parts = _MARKED.split(" ".join(text.split()))
    for k, part in enumerate(parts):
        if k % 2 == 0:
            parts[k] = _escaped(part)
        elif part.startswith("**"):
            parts[k] = f"**{_escaped(part[2:-2])}**"
        else:  # a literal begins and ends beside a space or a sign; beside a letter, reST needs an escaped space
            before, after = parts[k - 1][-1:], parts[k + 1][:1]
            parts[k] = "\\ " * before.isalnum() + part + "\\ " * after.isalnum()
    return "".join(parts)


def _escaped(text: str) -> str:
    return re.sub(r"([\\*`|_]|(?<!http)(?<!https):(?=\S))", r"\\\1", text)


def _paragraph(lines: list[str]) -> list[str]:
    first = lines[0]
    if first.startswith(" ") and not _BULLET.match(first.strip()):
        return ["::", "", *(f"   {line}" for line in lines)]
    for marker, sign in ((_BULLET, "* "), (_NUMBER, "#. ")):
        if marker.match(first.strip()):
            return [f"{sign}{inline(item)}" for item in _items(lines, marker)]
    head = [k for k, line in enumerate(lines) if _BULLET.match(line.strip())]
    if head and lines[head[0] - 1].rstrip().endswith(":"):  # a list right below the sentence that announces it
        return [*_paragraph(lines[: head[0]]), "", *_paragraph(lines[head[0] :])]
    sketch = next((k for k, line in enumerate(lines) if line.startswith("  ")), None)
    if sketch is not None and all(line.startswith("  ") for line in lines[sketch:]):
        return [_sentence(lines[:sketch]), "", "::", "", *(f"   {line}" for line in lines[sketch:])]
    return [_sentence(lines)]


def _sentence(lines: list[str]) -> str:
    text = inline(" ".join(lines))
    marked = text.startswith(("``", "**"))
    return rf"\{text}" if re.match(r"[-+*.:=~^\"'#>(]|\w+[.)] |>>>", text) and not marked else text


def _items(lines: list[str], marker: re.Pattern[str]) -> list[str]:
    """Return the text of each item; lines without a marker continue the item above."""
    depth = len(lines[0]) - len(lines[0].lstrip())
    items: list[str] = []
    for line in lines:
        if marker.match(line.strip()) and len(line) - len(line.lstrip()) <= depth:
            items.append(marker.sub("", line.strip(), count=1))
        else:
            items[-1] += f" {line.strip()}"
    return items
