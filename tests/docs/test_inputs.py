"""Every feature of every kind of file is honoured or refused by a test, and the page says by which."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.programs import ROOT, program

list_inputs = program("docs/list_inputs.py")


def test_every_feature_has_a_test_every_marker_a_feature_and_the_page_is_the_present_one() -> None:
    """In a process of its own: what it imports, and from where, belongs to the version of the code of a sweep."""
    command = [sys.executable, "docs/list_inputs.py", "--check"]
    checked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr


SOURCE = """
import pytest

FEATURES = {"gz": 1, "zip": 2}

@pytest.mark.honoured("DEM", "rotation")
class TestPlace:
    @pytest.mark.refused("DEM", "no place")
    def test_it(self): ...

def packed(feature):
    return pytest.param(1, marks=pytest.mark.honoured("DEM", feature))

@pytest.mark.parametrize("case", [0, *map(packed, FEATURES)])
def test_cases(case): ...

def helper(): pytest.mark.honoured("DEM", "nothing")
"""


def markers_of(folder: Path, source: str) -> list[tuple[str, str, str]]:
    path = folder / f"suite_{folder.name}" / "terrain" / "test_dem.py"
    path.parent.mkdir(parents=True)
    path.write_text(source)
    return [(each.verdict, each.feature, each.test) for each in list_inputs.markers(path.parents[1])]


def test_markers_are_found_on_functions_classes_and_cases(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])
    place = f"suite_{tmp_path.name}/terrain/test_dem.py"
    assert markers_of(tmp_path, SOURCE) == [
        ("honoured", "rotation", f"{place}::TestPlace::test_it"),
        ("refused", "no place", f"{place}::TestPlace::test_it"),
        ("honoured", "gz", f"{place}::test_cases"),
        ("honoured", "zip", f"{place}::test_cases"),
    ]


@pytest.mark.parametrize("words", ['"DEM"', '"DEM", 3', '"DEM", "a", "b"', 'kind="DEM", feature="a"'])
def test_a_marker_that_cannot_be_read_names_its_test(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])
    source = f"import pytest\n\n@pytest.mark.honoured({words})\ndef test_it(): ..."
    with pytest.raises(ValueError, match=r"test_dem\.py::test_it: .* allowed: honoured\(kind, feature\)"):
        markers_of(tmp_path, source)


def test_what_lacks_a_test_and_what_is_not_listed_are_named() -> None:
    listed = {"DEM": list_inputs.Kind("GDAL's", {"place": ("rotation", "south up")})}
    marked = [list_inputs.Marker("refused", "DEM", each, "a.py::test") for each in ("rotation", "sheer")]
    assert list_inputs.faults(listed, marked) == [
        "DEM: south up: neither honoured nor refused by any test",
        "DEM: sheer: not in inputs.toml, refused in a.py::test",
    ]
    assert "| rotation |  | `a.py::test` |" in list_inputs.tables(listed, marked)
