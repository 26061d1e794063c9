"""The index of plug-ins: it holds what the plug-ins declare, notices changes, and never fails a command."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import pytest

from mathnavi.sim.plugin import index
from mathnavi.sim.plugin.groups import GROUPS, PICTURES, installed
from mathnavi.sim.plugin.index import COMMAND, Description, Index, docstring, imported, sourced

POINTS = [(kind, point) for kind in GROUPS for point in installed(kind)]
Describe = Callable[[], Description]

BASE = '''
from dataclasses import dataclass
from typing import Literal

Shape = Literal["round", "square"]

@dataclass(frozen=True)
class Fields:
    first: float = 1.0
    """the first [m]"""
    second: str = ""  # a text
'''
PLUGIN = '''
from dataclasses import dataclass, field
from typing import ClassVar

from strange_units import Unit

from .base import Fields, Shape

print("imported")

@dataclass(frozen=True)
class Inner:
    deep: bool = True

@dataclass(frozen=True)
class Own(Fields):
    kind: ClassVar[str] = "strange"
    shape: Shape = "round"
    unit: Unit = "m"
    inner: Inner = Inner()
    third: tuple[tuple[int, float], ...] = ()

class Wanted:
    """It plans.

    And says more."""
    Config = Own
    controller = "flight"
'''


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of a stranger that no other process knows; the index is kept in a folder of its own."""
    folder = tmp_path / "strange_package"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "base.py").write_text(BASE)
    (folder / "plugin.py").write_text(PLUGIN)
    (tmp_path / "strange_units.py").write_text('from typing import Literal\n\nUnit = Literal["m", "km"]\n')
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return folder


@pytest.fixture
def wanted(package: Path) -> Describe:
    """The description of the stranger's class, kept like those of a command's own flags."""
    place = "strange_package.plugin:Wanted"
    return lambda: Index.read().describe((COMMAND, EntryPoint(place, place, "")))[0]


@pytest.fixture
def children(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """Imports of each process that is started to import something."""
    started: list[list[str]] = []
    run = subprocess.run

    def counted(*arguments: object, **named: object) -> object:
        started.append(json.loads(str(named["input"]))["places"])
        return run(*arguments, **named)  # type: ignore[call-overload]

    monkeypatch.setattr(subprocess, "run", counted)
    return started


def test_the_index_says_what_the_plugins_say() -> None:
    for (_, point), described in zip(POINTS, Index.read().describe(*POINTS), strict=True):
        plugin = point.load()
        assert not described.error
        assert described.first_line == (plugin.__doc__ or "").strip().partition("\n")[0]
        assert point.dist is not None
        assert described.distribution == f"{point.dist.name} {point.dist.version}"
        config = getattr(plugin, "Config", None)
        fields = [field.name for field in dataclasses.fields(config)] if config else []
        assert list(dict.fromkeys(field.path.partition(".")[0] for field in described.fields)) == fields


def test_a_source_says_what_its_import_says() -> None:
    for kind, point in POINTS:
        read, plugin = sourced(kind, point), imported(kind, point)
        assert (read.first_line, read.error, read.distribution) == (plugin.first_line, "", plugin.distribution)


@pytest.mark.parametrize(
    ("source", "name", "expected"),
    [
        ('"""Of the module."""', "", "Of the module."),
        ("import os", "", ""),
        (
            '# a comment\n\nclass Other:\n    """No."""\n\nclass Plan(dict,\n  list):  # and\n    r"""Yes: \\alpha."""',
            "Plan",
            r"Yes: \alpha.",
        ),
        ('async def plan() -> None:\n    "Yes."', "plan", "Yes."),
        ('class Plan: pass\n\nclass Other:\n    """No."""', "Plan", ""),
        ("from json.decoder import JSONDecoder as Plan", "Plan", "Simple JSON <https://json.org> decoder"),
        ("from .there import Plan", "Plan", "There."),
        ("Plan = dict", "Plan", ""),
    ],
)
def test_a_docstring_is_read_from_the_source(package: Path, source: str, name: str, expected: str) -> None:
    (package / "here.py").write_text(source)
    (package / "there.py").write_text('class Plan:\n    """There."""')
    assert docstring(f"strange_package.here:{name}".rstrip(":")).partition("\n")[0] == expected
    assert not [loaded for loaded in sys.modules if loaded.startswith("strange_package")]


def test_what_is_found_apart_is_what_is_found_here() -> None:
    assert Index.read().describe(*POINTS[:12]) == [imported(*point) for point in POINTS[:12]]


def test_every_field_is_there_with_its_choices(wanted: Describe) -> None:
    described = wanted()
    assert described.first_line == "It plans."
    assert described.stated == {"controller": "flight"}
    fields = {field.path: field for field in described.fields}
    assert list(fields) == ["first", "second", "shape", "unit", "inner.deep", "third"]
    assert (fields["first"].help, fields["first"].default) == ("the first [m]", "1.0")
    assert fields["shape"].choices == ("round", "square")
    assert fields["inner.deep"].switch
    assert not [name for name in sys.modules if name.startswith("strange_package")]


def test_what_has_not_changed_is_imported_once(wanted: Describe, children: list[list[str]]) -> None:
    assert wanted() == wanted()
    assert children == [[[COMMAND, "strange_package.plugin:Wanted"]]]


@pytest.mark.parametrize(
    ("file", "before", "after"),
    [
        ("plugin.py", "It plans.", "It plans well."),
        ("base.py", "second", "other"),
        ("base.py", "the first [m]", "the first [km]"),
        ("base.py", '"square"]', '"square", "flat"]'),  # the type of a field, which is defined elsewhere
        ("../strange_units.py", '"km"]', '"km", "mile"]'),
    ],
)
def test_an_edited_plugin_is_seen(
    wanted: Describe, package: Path, children: list[list[str]], file: str, before: str, after: str
) -> None:
    old = wanted()
    text = (package / file).read_text()
    (package / file).write_text(text.replace(before, after))
    new = wanted()
    assert new != old
    assert after.strip('"]').split('"')[-1] in str(new)
    assert wanted() == new
    assert len(children) == 2


@pytest.mark.honoured("plug-in", "module:Class of the present folder")
def test_one_name_in_two_folders_is_two_plugins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for line in ("It plans.", "It waits."):
        (tmp_path / line).mkdir()
        (tmp_path / line / "mine.py").write_text(f'class Mine:\n    """{line}"""')
        monkeypatch.chdir(tmp_path / line)
        (described,) = Index.read().describe((COMMAND, EntryPoint("mine", "mine:Mine", "")))
        assert described.first_line == line


@pytest.mark.parametrize("place", ["mine:", ":Mine", "a:b:c", "a-b:c", ":"])
def test_a_place_that_names_no_class_is_described_by_its_error(place: str) -> None:
    point = (COMMAND, EntryPoint(place, place, ""))
    nothing = Index({}, {})
    assert not nothing.holds(point)
    assert nothing.describe(point)[0].error


def test_a_plugin_that_cannot_be_imported_is_tried_again(wanted: Describe, package: Path) -> None:
    (package / "base.py").rename(package / "elsewhere.py")
    assert wanted().error == "No module named 'strange_package.base'"
    (package / "elsewhere.py").rename(package / "base.py")
    assert wanted().first_line == "It plans."


@pytest.mark.refused("plug-in", "an import that ends its process")
@pytest.mark.parametrize("ending", ["import os; os._exit(3)", "raise SystemExit(3)"])
def test_an_import_that_ends_its_process_hides_no_other(wanted: Describe, package: Path, ending: str) -> None:
    (package / "deadly.py").write_text(ending)
    deadly = EntryPoint("deadly", "strange_package.deadly:Planner", "g")
    other = EntryPoint("other", "strange_package.plugin:Wanted", "g")
    broken, sound = Index.read().describe(("controllers", deadly), ("controllers", other))
    assert "3" in broken.error
    assert sound.first_line == "It plans."


def test_a_damaged_index_is_made_anew(wanted: Describe, tmp_path: Path) -> None:
    described = wanted()
    (file,) = (tmp_path / "cache" / "mathnavi").iterdir()
    saved = file.read_text()
    for damage in ("", "{", "\x00", saved[:-1], saved.partition("\n")[2], saved.replace("the first", "the last")):
        file.write_text(damage)
        assert wanted() == described, damage
        assert file.read_text() == saved, damage


def test_a_source_that_is_newer_than_this_process_is_not_taken_for_what_was_imported(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    point = (COMMAND, EntryPoint("wanted", "strange_package.plugin:Wanted", ""))
    for name in ("strange_package", "strange_package.base", "strange_package.plugin", "strange_units"):
        monkeypatch.setitem(sys.modules, name, None)  # so that what is imported here goes afterwards
        monkeypatch.delitem(sys.modules, name)
    for begun, kept in ((0, False), (2 * time.time_ns(), True)):
        monkeypatch.setattr(index, "_BEGUN", begun)
        (described,) = Index.read().describe(point, apart=False)
        assert described.first_line == "It plans."
        assert Index.read().holds(point) == kept


def test_without_a_folder_to_write_to_it_is_made_every_time(
    wanted: Describe, children: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(index, "cache_folder", lambda: None)
    assert wanted() == wanted()
    assert len(children) == 2


def test_two_processes_may_make_it_at_once(wanted: Describe, tmp_path: Path) -> None:
    script = (
        "from importlib.metadata import EntryPoint; from mathnavi.sim.plugin import index;"
        "place = 'strange_package.plugin:Wanted';"
        "print(index.Index.read().describe(('commands', EntryPoint(place, place, '')))[0].first_line)"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    started = [
        subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True, env=environment)
        for _ in range(3)
    ]
    assert [process.communicate()[0] for process in started] == ["It plans.\n"] * 3
    assert len([*(tmp_path / "cache" / "mathnavi").iterdir()]) == 1
    assert wanted().first_line == "It plans."


def test_the_groups_are_those_that_are_installed() -> None:
    assert {group for group in entry_points().groups if group.startswith("mathnavi.")} == {*GROUPS.values(), PICTURES}
