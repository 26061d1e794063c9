"""Every module has one name, though the repository's root on sys.path makes ``import models`` possible.

No source names a module by its bare name; and ``tests/conftest.py`` fails a run of tests in which one was loaded by it
nevertheless, by a plug-in's place or a pickle, after all that the tests run: the command line, every scenario with its
figure, the studies.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.one_name import FOLDERS, bare

ROOT = Path(__file__).resolve().parents[2]


CANDIDATE = re.compile(rf"\b(?:from|import)\s[\w\s.,\\()]*?(?<![.\w])(?:{'|'.join(FOLDERS)})\b")


def imported(source: str) -> Iterator[str]:
    """The modules that a source imports, at its top or within a function, by their whole names.

    A source without a folder's bare name in what may be an import is not parsed.
    """
    if not CANDIDATE.search(source):
        return
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield str(node.module)


@pytest.mark.parametrize("folder", [*FOLDERS, "src", "benchmarks", "docs", "examples", "tests"])
def test_no_source_imports_a_module_by_a_second_name(folder: str) -> None:
    sources = list((ROOT / folder).rglob("*.py"))
    assert sources
    assert {str(path): found for path in sources if (found := bare(imported(path.read_text(encoding="utf-8"))))} == {}


def test_a_second_name_is_recognised() -> None:
    assert bare(imported("def late():\n    import models.unicycle, mathnavi.models\n")) == ["models.unicycle"]
    assert bare(imported("import os, \\\n    sim as s")) == ["sim"]
    assert bare(imported("from sim import sweep\nfrom mathnavi.sim import sweep\nfrom .sim import sweep")) == ["sim"]
