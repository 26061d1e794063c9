"""The notebook of a page holds the blocks of the page, which test_blocks.py runs, in a form that Jupyter reads."""

from __future__ import annotations

import contextlib
import io
import os
import re
import sys
import tempfile
import types
from pathlib import Path
from typing import Any

import pytest

from tests.docs.extensions import load
from tests.docs.test_blocks import assert_prints, blocks_of, commands_of, folder, run  # noqa: F401
from tests.docs.test_site import DOCS, PAGES

load("page_blocks")
NOTEBOOKS = load("notebooks")
NAMES = [page.relative_to(DOCS).with_suffix("").as_posix() for page in PAGES]
TEXTS = {name: (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in NAMES}
WITH = [name for name in NAMES if NOTEBOOKS.has_notebook(name, TEXTS[name])]
MAGIC = re.compile(r"%%(writefile|bash)(?: (-a|--no-raise-error))?(?: ([\w-]+\.\w+))?\n|%cd (\S+)$")
AGAIN = re.compile(r"(?:sys\.modules\.pop\(.*\n)+")


def cells_of(name: str, github: str = "") -> list[dict[str, Any]]:
    """The cells of a page's notebook after the first code cell, which goes into a new folder."""
    cells = NOTEBOOKS.notebook(name, TEXTS[name], github)["cells"]
    first = next(k for k, cell in enumerate(cells) if cell["source"] == NOTEBOOKS.FOLDER)
    return cells[first + 1 :]


def code(name: str) -> list[dict[str, Any]]:
    return [cell for cell in cells_of(name) if cell["cell_type"] == "code"]


@pytest.mark.parametrize("name", WITH)
def test_the_cells_of_a_notebook_are_the_blocks_of_its_page(name: str) -> None:
    held, shown = [], []
    for cell in code(name):
        source, printed = cell["source"], "".join(output["text"] for output in cell["outputs"])
        magic = MAGIC.match(source)
        if magic is None:
            held += [("python", AGAIN.sub("", source).strip())]
        elif magic[1] == "writefile":
            held += [(magic[3], source[magic.end() :].strip())]
        else:
            held += [("$", f"cd {magic[4]}" if magic[4] else source[magic.end() :])]
        held += [("output", printed)] if printed else []
    for block in blocks_of(TEXTS[name]):
        if block.kind == "console":
            for command, printed in commands_of(re.sub(r"\A# exit \d+\n", "", block.text)):
                shown += [("$", command), *([("output", "".join(f"{line}\n" for line in printed))] if printed else [])]
        else:
            shown += [(block.file or block.kind, block.text if block.kind == "output" else block.text.strip())]
    assert held == shown


@pytest.mark.parametrize("name", WITH)
def test_a_notebook_has_the_form_of_nbformat_4_5(name: str) -> None:
    for github in ("", "someone/mathnavi"):
        assert_form(NOTEBOOKS.notebook(name, TEXTS[name], github))


def assert_form(made: dict[str, Any]) -> None:
    """Assert what the schema of nbformat 4.5 asks of a notebook without other outputs than printed text."""
    assert set(made) == {"nbformat", "nbformat_minor", "metadata", "cells"}
    assert (made["nbformat"], made["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in made["cells"]}) == len(made["cells"])
    for cell in made["cells"]:
        assert re.fullmatch(r"[a-zA-Z0-9_-]{1,64}", cell["id"])
        assert all(isinstance(line, str) for line in cell["source"])
        assert cell["source"]
        wanted = {"id", "cell_type", "metadata", "source"}
        assert set(cell) == (wanted if cell["cell_type"] == "markdown" else wanted | {"execution_count", "outputs"})
        for output in cell.get("outputs", ()):
            assert set(output) == {"output_type", "name", "text"}
            assert (output["output_type"], output["name"]) == ("stream", "stdout")


@pytest.mark.parametrize("name", WITH)
def test_the_prose_of_a_notebook_has_no_directive_and_no_link_to_a_source(name: str) -> None:
    for github in ("", "someone/mathnavi"):
        for cell in cells_of(name, github):
            if cell["cell_type"] == "markdown":
                assert not re.search(r"^(:::|```\{)|\{(py:)?\w+\}`", cell["source"], re.MULTILINE), cell["source"]
                targets = re.findall(r"\]\(([^)\s#]+)", cell["source"])
                assert all(target.startswith("https://") or (not github and ".md" not in target) for target in targets)


def test_the_tour_pages_and_exercises_have_notebooks_and_pages_without_python_have_none() -> None:
    assert {"tour", "how-to/vehicle", "how-to/terrain", "how-to/rover", "exercises/flight"} <= set(WITH)
    assert not {"how-to/index", "how-to/browser", "reference/inputs", "CLAIMS"} & set(WITH)


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", ["how-to/sensors", "how-to/monitor"])
def test_a_notebook_runs_from_top_to_bottom(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    run_cells(NOTEBOOKS.notebook(name, TEXTS[name])["cells"], monkeypatch)
    assert [path.name[:9] for path in tmp_path.iterdir()] == ["mathnavi-"]


def test_a_module_that_grows_is_read_again(
    folder: Path,  # noqa: F811
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    page = (
        "```python\n# grown.py\nx = 1\n```\n```python\nfrom grown import x\n```\n"
        "```python\n# grown.py\ny = 2\n```\n```python\nfrom grown import y\n\nprint(x + y)\n```\n```output\n3\n```\n"
        "```console\n$ mkdir there\n$ cd there\n```\n```console\n# exit 1\n$ false\n```\n"
    )
    cells = NOTEBOOKS.notebook("how-to/some", page)["cells"]
    run_cells(cells, monkeypatch)
    assert Path.cwd().name == "there"
    cells[-3]["source"] = cells[-3]["source"].replace("mkdir", "rmdir")
    with pytest.raises(AssertionError):
        run_cells(cells, monkeypatch)


def run_cells(cells: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the code cells in one module, as IPython does; AssertionError where one fails or prints something else."""
    module = types.ModuleType("__main__")
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(tempfile, "tempdir", os.getcwd())
    for k, cell in enumerate(cell for cell in cells if cell["cell_type"] == "code"):
        magic, printed = MAGIC.match(cell["source"]), ""
        text = cell["source"][magic.end() if magic else 0 :]
        if magic is None:
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile(text, f"cell {k}", "exec"), module.__dict__)
            printed = out.getvalue()
        elif magic[4]:
            os.chdir(magic[4])
        elif magic[1] == "bash":
            status, printed = run(text)
            assert status == 0 or magic[2] == "--no-raise-error", printed
        else:
            with Path(magic[3]).open("a" if magic[2] else "w", encoding="utf-8") as file:
                file.write(f"{text}\n")
        for output in cell["outputs"]:
            assert_prints(printed, output["text"].splitlines(), f"cell {k}")


def test_colab_opens_what_the_repository_of_the_build_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    app = types.SimpleNamespace(
        builder=types.SimpleNamespace(format="html"),
        env=types.SimpleNamespace(found_docs={"how-to/monitor"}, doc2path=lambda name: DOCS / f"{name}.md"),
    )

    def body() -> str:
        context = {"body": "<h1>"}
        NOTEBOOKS.add_link(app, "how-to/monitor", "page.html", context, None)
        return context["body"]

    monkeypatch.delenv(NOTEBOOKS.VARIABLE, raising=False)
    assert 'href="monitor.ipynb"' in body()
    assert "colab" not in body()
    monkeypatch.setenv(NOTEBOOKS.VARIABLE, "https://github.com/someone/mathnavi.git")
    assert "https://colab.research.google.com/github/someone/mathnavi/blob/gh-pages/how-to/monitor.ipynb" in body()
    made = NOTEBOOKS.notebook("how-to/monitor", TEXTS["how-to/monitor"], NOTEBOOKS.repository())
    assert made["cells"][1]["source"] == "%pip install --quiet git+https://github.com/someone/mathnavi"
    monkeypatch.setenv(NOTEBOOKS.VARIABLE, "someone/mathnavi")
    with pytest.raises(NOTEBOOKS.ConfigError, match="allowed: https://github"):
        body()
