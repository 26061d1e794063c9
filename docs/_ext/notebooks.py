"""A notebook of every page whose Python is run, ``PAGE.ipynb`` next to it, with a link on the page.

The cells are the page's blocks (``page_blocks``), which the tests run, and the prose between them: Python as it stands,
a file as ``%%writefile``, commands as ``%%bash``; what the page shows as printed is their output. The first cell goes
into a new folder, as the page begins in an empty one. jupytext and MyST-NB do not know blocks that are files or
commands, and sphinx-gallery's notebooks, of which the examples have theirs, begin from scripts.

Where MATHNAVI_REPOSITORY is set when the pages are built, a second link opens the notebook in Colab, and the notebook
begins by installing mathnavi from there. It is https://github.com/OWNER/NAME; its branch gh-pages holds the pages.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from page_blocks import EXIT, Block, blocks_of, commands_of
from sphinx.application import Sphinx
from sphinx.errors import ConfigError

ROOT = Path(__file__).resolve().parents[2]
VARIABLE = "MATHNAVI_REPOSITORY"
BRANCH = "gh-pages"  # of the repository, which holds the built pages
FOLDERS = ("how-to/", "exercises/")
FOLDER = """import os, sys, tempfile

os.environ["PATH"] = os.path.dirname(sys.executable) + os.pathsep + os.environ["PATH"]  # for the command mathnavi
os.chdir(tempfile.mkdtemp(prefix="mathnavi-"))  # a new folder, for all that is written
sys.path.insert(0, os.getcwd())"""
LINK = '<p class="pdf"><a href="{0}.ipynb" download>This page as a notebook</a>{1}</p>\n'
COLAB = ' · <a href="https://colab.research.google.com/github/{}/blob/{}/{}.ipynb">open it in Colab</a>'


def repository() -> str:
    """Return OWNER/NAME of MATHNAVI_REPOSITORY, "" if it is not set; ConfigError for another address."""
    given = os.environ.get(VARIABLE, "")
    found = re.fullmatch(r"https://github\.com/([\w-]+/[\w.-]+?)(?:\.git)?/?", given)
    if given and not found:
        raise ConfigError(f"{VARIABLE} = {given}; allowed: https://github.com/OWNER/NAME")
    return found[1] if found else ""


def has_notebook(name: str, text: str) -> bool:
    """True for the tour, how-to pages and exercises with Python that is run."""
    here = name == "tour" or name.startswith(FOLDERS)
    return here and any(block.kind == "python" and not block.file for block in blocks_of(text))


def notebook(name: str, text: str, github: str = "") -> dict[str, Any]:
    """Return a page as a notebook, in the format nbformat 4.5; GITHUB is OWNER/NAME, or ""."""
    cells = [_markdown(f"*The page docs/{name}.md of mathnavi, to be run from top to bottom.*")]
    if github:
        cells.append(_code(f"%pip install --quiet git+https://github.com/{github}"))
    cells += [_code(FOLDER), *_cells(name, text, github)]
    return {
        "nbformat": 4,
        "nbformat_minor": 5,
        "metadata": {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        },
        "cells": [{"id": f"cell-{k}", **cell} for k, cell in enumerate(cells)],
    }


def _cells(name: str, text: str, github: str) -> Iterator[dict[str, Any]]:
    """Yield the cells of a page, each block with what it prints."""
    end, run = 0, False
    written: dict[str, bool] = {}  # by file: whether an earlier cell may have imported it
    stale: list[str] = []  # modules that a cell may have imported and another has written since
    blocks = blocks_of(text)
    for k, block in enumerate(blocks):
        if prose := _prose(text[end : block.place[0]], name, github):
            yield _markdown(prose)
        end = block.place[1]
        if block.file:
            if written.get(block.file) and block.file.endswith(".py"):
                stale.append(Path(block.file).stem)
            yield _code(f"%%writefile {'-a ' if block.file in written else ''}{block.file}\n{block.text}")
            written[block.file] = False
        elif block.kind == "python":
            again = "".join(f'sys.modules.pop("{module}", None)  # its file has grown\n' for module in stale)
            printed = blocks[k + 1].text if k + 1 < len(blocks) and blocks[k + 1].kind == "output" else ""
            yield _code(again + block.text, printed)
            written, stale, run = dict.fromkeys(written, True), [], True
        elif block.kind == "console":
            yield from _commands(block)
        elif not run:
            raise ValueError(f"{name}:{block.line}: output without Python before it")
    if prose := _prose(text[end:], name, github):
        yield _markdown(prose)


def _commands(block: Block) -> Iterator[dict[str, Any]]:
    """Yield a cell for each command: a change of folder is for the cells after it too."""
    wanted = EXIT.match(block.text)
    commands = list(commands_of(block.text[wanted.end() :] if wanted else block.text))
    for k, (command, printed) in enumerate(commands):
        fails = wanted is not None and k == len(commands) - 1
        output = "".join(f"{line}\n" for line in printed)
        if command.startswith("cd "):
            yield _code(f"%{command}", output)
        else:
            yield _code(f"%%bash{' --no-raise-error' * fails}\n{command}", output)


def _prose(text: str, name: str, github: str) -> str:
    """Return the prose of a page in Jupyter's Markdown: roles as code, directives as their titles."""
    text = re.sub(r"^:{3,}\{[\w-]+\} *(.*)$", r"**\1**", text, flags=re.MULTILINE)
    text = re.sub(r"^:{3,}$", "", text, flags=re.MULTILINE)
    text = re.sub(r"^```\{literalinclude\} (?:\.\./)*(\S+)\n.*?^```$", r"`\1`", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"\{(?:py:)?\w+\}`~?(?:[\w.]+\.)?([\w-]+)`", r"`\1`", text)
    text = re.sub(r"^\{\.?[\w .#-]+\}$", "", text, flags=re.MULTILINE)

    def target(found: re.Match[str]) -> str:
        return f"]({_address(found[1], name, github)})"

    return re.sub(r"\]\(([^)\s]+)\)", target, text).strip("\n")


def _address(target: str, name: str, github: str) -> str:
    """Return where a link of a page leads from its notebook: in the repository, or in the built pages."""
    parts = urlsplit(target)
    if parts.scheme or not parts.path:
        return target
    path = os.path.relpath((ROOT / "docs" / name).parent / parts.path, ROOT)
    anchor = f"#{parts.fragment}" if parts.fragment else ""
    if github:
        return f"https://github.com/{github}/{'raw' if _is_picture(path) else 'blob'}/HEAD/{path}{anchor}"
    return re.sub(r"\.md(?=#|$)", ".html", target)


def _is_picture(path: str) -> bool:
    return path.endswith((".png", ".webp", ".svg", ".mp4"))


def _markdown(text: str) -> dict[str, Any]:
    return {"cell_type": "markdown", "metadata": {}, "source": text}


def _code(text: str, printed: str = "") -> dict[str, Any]:
    outputs = [{"output_type": "stream", "name": "stdout", "text": printed}] if printed else []
    return {
        "cell_type": "code", "execution_count": None, "metadata": {}, "outputs": outputs, "source": text.rstrip("\n"),
    }  # fmt: skip


def _text_of(app: Sphinx, name: str) -> str:
    """Return the text of a page; "" for a page that is not one of ours, in Markdown."""
    path = Path(app.env.doc2path(name)) if name in app.env.found_docs else None
    return path.read_text(encoding="utf-8") if path is not None and path.suffix == ".md" else ""


def add_link(app: Sphinx, name: str, template: str, context: dict[str, Any], document: Any) -> None:
    """Link a page to its notebook, and to Colab."""
    if app.builder.format == "html" and has_notebook(name, _text_of(app, name)):
        github = repository()
        context["body"] = (
            LINK.format(name.rpartition("/")[2], COLAB.format(github, BRANCH, name) if github else "")
            + (context["body"])
        )


def write(app: Sphinx, error: Exception | None) -> None:
    """Write the notebooks of all pages."""
    if error is not None or app.builder.format != "html":
        return
    for name in sorted(app.env.found_docs):
        if has_notebook(name, text := _text_of(app, name)):
            made = json.dumps(notebook(name, text, repository()), indent=1, ensure_ascii=False)
            (Path(app.outdir) / f"{name}.ipynb").write_text(f"{made}\n", encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("html-page-context", add_link)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
