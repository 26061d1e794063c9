"""The blocks of the pages under docs/ and of README.md (``docs/_ext/page_blocks.py``), run as shown.

The blocks of a page are run in order, in one folder that is empty at first. A block that is a file is written, or added
to the file where an earlier block has begun it.

A command that ends in a backslash goes on in the next line. Every one ends with exit status 0; after a first line
"# exit N" the last of its block ends with N. Of what is printed, a line "..." stands for any lines and "..." within a
line for any characters; how many blanks stand between words does not count. A "mathnavi" without anything for a shell
to do runs in this process, which has imported it already; all else in bash. Trials run in this process too. After
"cd FOLDER" the page goes on in that folder.

README.md's ```sh blocks are not run, and its Python is run in test_readme.py, which checks its results.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
import shlex
import subprocess
import sys
import types
from pathlib import Path

import pytest
from numba.core.event import trigger_event
from rich.console import Console

from mathnavi.commands.cli import main
from mathnavi.commands.progress import COMPILING, DURATION, flight_progress
from tests.docs.extensions import load
from tests.renders.drawn import needs_opengl

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
EXTENSION = load("page_blocks")
Block, EXIT, blocks_of, commands_of = EXTENSION.Block, EXTENSION.EXIT, EXTENSION.blocks_of, EXTENSION.commands_of
NOTICES = re.compile(
    rf"^{re.escape(COMPILING)}\s+\({re.escape(DURATION)}\)\n|^compiled \d+ kernels? in \d+ s, outside .*\n",
    re.MULTILINE,
)
"""what is printed where kernels are compiled, as on a machine's first run"""


def shown(page: Path) -> list[Block]:
    """The blocks of a page that are run here."""
    blocks = blocks_of(page.read_text(encoding="utf-8"))
    return [block for block in blocks if page != README or block.kind == "console"]


def draws(page: Path) -> bool:
    """True for a page whose commands draw pictures."""
    return any("mathnavi render " in block.text for block in shown(page) if block.kind == "console")


PAGES = [page for page in (README, *sorted((ROOT / "docs").rglob("*.md"))) if shown(page)]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, worked in as in a terminal of 80 columns."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    return tmp_path


@pytest.mark.usefixtures("trials_here")  # tests/sim/sweep has sweeps in child processes
@pytest.mark.parametrize(
    "page",
    [pytest.param(page, marks=needs_opengl if draws(page) else ()) for page in PAGES],
    ids=[page.relative_to(ROOT).as_posix() for page in PAGES],
)
def test_a_page_does_what_it_shows(page: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_page(shown(page), page.relative_to(ROOT).as_posix(), monkeypatch)


def run_page(blocks: list[Block], name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    module = types.ModuleType("page")
    monkeypatch.setitem(sys.modules, "page", module)  # where dataclasses and plug-ins look their names up
    printed = ""
    for block in blocks:
        importlib.invalidate_caches()  # a block may have written a module
        if block.file:
            with Path(block.file).open("a", encoding="utf-8") as file:
                file.write(block.text)
            sys.modules.pop(Path(block.file).stem, None)  # read anew
        elif block.kind == "python":
            with contextlib.redirect_stdout(io.StringIO()) as out:
                exec(compile("\n" * (block.line - 1) + block.text, name, "exec"), module.__dict__)
            printed = out.getvalue()
        elif block.kind == "output":
            assert_prints(printed, block.text.splitlines(), f"{name}:{block.line}")
        else:
            run_console(block, name)


def run_console(block: Block, name: str) -> None:
    wanted = EXIT.match(block.text)
    commands = list(commands_of(block.text[wanted.end() :] if wanted else block.text))
    assert commands, f"{name}:{block.line}: a console block without a line that begins with $"
    for k, (command, output) in enumerate(commands):
        status, printed = run(command)
        expected = int(wanted[1]) if wanted and k == len(commands) - 1 else 0
        assert status == expected, f"{name}:{block.line}: $ {command} ended with {status}:\n{printed}"
        assert_prints(printed, output, f"{name}:{block.line}: $ {command}")


def run(command: str) -> tuple[int, str]:
    """Exit status, and what is printed on standard output and standard error."""
    if command.startswith("cd ") and not set(command) & set("|&;<>$`*?~"):
        os.chdir(command.removeprefix("cd "))  # for the blocks that follow, too
        return 0, ""
    if command.startswith("mathnavi ") and not set(command) & set("|&;<>$`*?~"):
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            return main(shlex.split(command)[1:]), out.getvalue()
    done = subprocess.run(
        ["bash", "-c", command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120
    )
    return done.returncode, done.stdout


def assert_prints(printed: str, shown: list[str], where: str) -> None:
    same = matches(NOTICES.sub("", printed).splitlines(), shown)
    assert same, f"{where}\nprints\n{printed}\nand the page shows\n" + "\n".join(shown)


def matches(lines: list[str], shown: list[str]) -> bool:
    lines, shown = ([" ".join(line.split()) for line in each] for each in (lines, shown))
    patterns = [
        r"(?:.*\n)*" if line == "..." else ".*".join(map(re.escape, line.split("..."))) + r"\n" for line in shown
    ]
    return re.fullmatch("".join(patterns), "".join(f"{line}\n" for line in lines)) is not None


def test_a_page_is_the_same_where_the_kernels_are_compiled_first() -> None:
    errors = Console(file=io.StringIO(), width=80)
    with flight_progress(errors), trigger_event("numba:compile"):
        errors.print("the run")
    printed = errors.file.getvalue()
    assert len(printed.splitlines()) == 4
    assert_prints(printed, ["the run"], "page.md:1")


@pytest.mark.parametrize(
    ("printed", "shown", "same"),
    [
        ("one\ntwo  \n", "one\ntwo", True),
        ("one\ntwo\nthree\n", "one\n...\nthree", True),
        ("one\nthree\n", "one\n...\nthree", True),
        ("arrived after 3.1 s\n", "arrived after ... s", True),
        ("a  wide   table\n", "a wide table", True),
        ("", "", True),
        ("one\ntwo\n", "one", False),
        ("one\n", "o.e", False),
        ("one\ntwo\n", "... two", False),
    ],
)
def test_an_ellipsis_stands_for_lines_or_for_characters(printed: str, shown: str, same: bool) -> None:
    assert matches(printed.splitlines(), shown.splitlines()) is same


def test_a_page_that_shows_something_else_is_reported(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def checked(page: str) -> None:
        run_page(blocks_of(page), "page.md", monkeypatch)

    checked("```python\nx = 2\nprint(x)\n```\n\n```output\n2\n```\n```python\nopen('made', 'w').close()\nx += 1\n```\n")
    checked("```console\n$ ls \\\n    -1\nmade\n$ mathnavi --version\nmathnavi ...\n```\n")
    checked("```python\n# shown.py\ny = 3\n```\n```python\n# shown.py\ny += 1\n```\n")
    checked("```python\nimport shown\nprint(shown.y)\n```\n```output\n4\n```\n```sh\nfalse\n```\n")
    checked("```console\n# exit 2\n$ mathnavi terrain show nowhere\nmathnavi: ...nowhere...\n```\n")
    for page in (
        "```python\nprint(1)\n```\n```output\n2\n```\n",
        "```console\n$ echo 1\n2\n```\n",
        "```console\n$ false\n```\n",
        "```console\n# exit 1\n$ true\n```\n",
        "```console\nls\n```\n",
    ):
        with pytest.raises(AssertionError, match=r"page\.md:"):
            checked(page)
    with pytest.raises(ZeroDivisionError):
        checked("```python\n1 / 0\n```\n")
