"""Write the tables of inputs, docs/reference/inputs.md, from docs/inputs.toml and the markers of the tests.

    python docs/list_inputs.py           writes the page; lists what lacks a test, and exits with 1 if anything does
    python docs/list_inputs.py --check   the same, without writing

docs/inputs.toml has what the standard of each kind of file lets a file say, feature by feature. A test that shows one
bears ``@pytest.mark.honoured(kind, feature)`` or ``@pytest.mark.refused(kind, feature)``: on the function, on its
class, or in the ``marks`` of one of its cases. The text outside of the tables is written by hand.
"""

from __future__ import annotations

import importlib
import re
import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "inputs.md"
FEATURES = ROOT / "docs" / "inputs.toml"
TESTS = ROOT / "tests"
TABLES = re.compile(r"(<!-- inputs -->\n).*(<!-- end -->)", re.DOTALL)
VERDICTS = ("honoured", "refused")


@dataclass(frozen=True)
class Marker:
    """A marker of a test: what the product does with a feature of a kind of file."""

    verdict: str
    kind: str
    feature: str
    test: str  # path::name


@dataclass(frozen=True)
class Kind:
    """A kind of file: its standard, and what that lets a file say."""

    standard: str
    features: Mapping[str, Sequence[str]]  # by group

    @property
    def all(self) -> list[str]:
        """Features of all groups."""
        return [feature for group in self.features.values() for feature in group]


def kinds() -> dict[str, Kind]:
    """Return the kinds of files of docs/inputs.toml; ValueError for a feature that stands there twice."""
    tables = tomllib.loads(FEATURES.read_text(encoding="utf-8"))
    found = {name: Kind(table["standard"], table["features"]) for name, table in tables.items()}
    for name, kind in found.items():
        twice = {feature for feature in kind.all if kind.all.count(feature) > 1}
        if twice:
            raise ValueError(f"{FEATURES.name}: {name}: {', '.join(sorted(twice))} twice; allowed: once")
    return found


def markers(folder: Path = TESTS) -> list[Marker]:
    """Return all markers of the tests in a folder, in their order. Only files that have any are imported."""
    found = []
    for path in sorted(folder.rglob("test_*.py")):
        if any(f"mark.{verdict}" in path.read_text(encoding="utf-8") for verdict in VERDICTS):
            module = _imported(path.relative_to(folder.parent), folder.parent)
            found += list(_of_scope(vars(module), path.relative_to(folder.parent).as_posix(), module.__name__))
    return found


def _imported(path: Path, root: Path) -> ModuleType:
    if str(root) not in sys.path:
        sys.path.insert(0, str(root))
    return importlib.import_module(".".join(path.with_suffix("").parts))


def _of_scope(scope: Mapping[str, Any], place: str, module: str, around: Sequence[Any] = ()) -> Iterator[Marker]:
    """Markers of the tests that a module or a class has; ``around`` are those of the class."""
    for name, item in scope.items():
        marks = [*around, *getattr(item, "pytestmark", ())]
        if getattr(item, "__module__", "") != module:
            continue
        if isinstance(item, type) and name.startswith("Test"):
            yield from _of_scope(vars(item), f"{place}::{name}", module, marks)
        elif callable(item) and name.startswith("test"):
            yield from _of_test(marks, f"{place}::{name}")


def _of_test(marks: Sequence[Any], test: str) -> Iterator[Marker]:
    cases = [case for mark in marks if mark.name == "parametrize" for case in mark.args[1]]
    of_cases = [mark for case in cases for mark in getattr(case, "marks", ())]
    for mark in dict.fromkeys((each.name, each.args) for each in (*marks, *of_cases) if each.name in VERDICTS):
        verdict, words = mark
        if len(words) != 2 or not all(isinstance(word, str) for word in words):
            raise ValueError(f"{test}: {verdict}{words}; allowed: {verdict}(kind, feature), two texts")
        yield Marker(verdict, *words, test)


def faults(listed: Mapping[str, Kind], marked: Sequence[Marker]) -> list[str]:
    """Return a line for each feature that no test shows, and for each marker of a feature that is not listed."""
    shown = {(marker.kind, marker.feature) for marker in marked}
    lines = [
        f"{kind}: {feature}: neither honoured nor refused by any test"
        for kind, table in listed.items()
        for feature in table.all
        if (kind, feature) not in shown
    ]
    known = {(kind, feature) for kind, table in listed.items() for feature in table.all}
    lines += [
        f"{marker.kind}: {marker.feature}: not in {FEATURES.name}, {marker.verdict} in {marker.test}"
        for marker in marked
        if (marker.kind, marker.feature) not in known
    ]
    return lines


def tables(listed: Mapping[str, Kind], marked: Sequence[Marker]) -> str:
    """Return one table for each kind of file, a row for each feature."""
    tests: dict[tuple[str, str, str], list[str]] = {}
    for marker in marked:
        named = tests.setdefault((marker.verdict, marker.kind, marker.feature), [])
        if marker.test not in named:
            named.append(marker.test)
    parts = []
    for kind, table in listed.items():
        parts.append(f"## {kind}\n\n{table.standard}\n\n{{.data}}\n| feature | honoured | refused |\n|---|---|---|\n")
        for group, features in table.features.items():
            parts.append(f"| **{group}** | | |\n")
            for feature in features:
                cells = (_cell(tests.get((verdict, kind, feature), ())) for verdict in VERDICTS)
                parts.append(f"| {_escaped(feature)} | {' | '.join(cells)} |\n")
        parts.append("\n")
    return "".join(parts)


def _cell(tests: Sequence[str]) -> str:
    return "<br>".join(f"`{test.removeprefix('tests/')}`" for test in tests)


def _escaped(text: str) -> str:
    return re.sub(r"([\\*_`|<>\[\]$#{}])", r"\\\1", text)


def written() -> str:
    """Return the page with the present tables."""
    text = PAGE.read_text(encoding="utf-8")
    return TABLES.sub(lambda found: f"{found[1]}\n{tables(kinds(), markers())}{found[2]}", text)


def main(argv: Sequence[str]) -> int:
    if argv not in ([], ["--check"]):
        print("usage: python docs/list_inputs.py [--check]", file=sys.stderr)
        return 2
    lines = faults(kinds(), markers())
    for line in lines:
        print(line)
    page = written()
    if not argv:
        PAGE.write_text(page, encoding="utf-8")
    elif page != PAGE.read_text(encoding="utf-8"):
        lines.append(f"{PAGE.name}: python docs/list_inputs.py")
        print(lines[-1])
    return 1 if lines else 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
