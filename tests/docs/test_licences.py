"""The page of licences has every package that is installed, with the licence that it states."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, files, version
from pathlib import Path

import av
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.programs import program

ROOT = Path(__file__).resolve().parents[2]
list_licences = program("docs/list_licences.py")
PAGE = (ROOT / "docs" / "reference" / "licences.md").read_text(encoding="utf-8")


def test_every_dependency_of_pyproject_is_in_a_table() -> None:
    asked = {canonicalize_name(Requirement(text).name) for texts in list_licences.wanted().values() for text in texts}
    assert asked <= set(list_licences.stated())


def test_every_package_that_is_installed_is_in_its_table_with_its_licence() -> None:
    """It was written with all extras installed; a package that is missing here keeps its row."""
    stated = list_licences.stated()
    for group in list_licences.groups().values():
        for name in group:
            assert name in stated, "python docs/list_licences.py"
            try:
                version(name)
            except PackageNotFoundError:
                continue
            assert stated[name] == list_licences.licence(name), f"{name}: python docs/list_licences.py"
    assert len(stated) > 100


def test_writing_the_page_again_keeps_what_was_written_by_hand_and_the_rows_of_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(list_licences, "PAGE", tmp_path / "licences.md")
    list_licences.PAGE.write_text(PAGE.replace("| `rich` |", "| `poor` |"), encoding="utf-8")
    again = list_licences.written()
    assert "| `rich` |" in again
    assert "| `poor` |" not in again
    assert list_licences.TABLE.sub("", again) == list_licences.TABLE.sub("", PAGE)
    assert "| `maptor` | GNU Lesser General Public License v3 (LGPLv3) | `[bench]` |" in again


def test_a_package_without_a_licence_is_not_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(list_licences, "metadata", lambda name: _Silent())
    with pytest.raises(ValueError, match="state no licence"):
        list_licences.licence("rich")


class _Silent:
    def get(self, name: str) -> None:
        return None

    def get_all(self, name: str) -> list[str]:
        return ["License :: OSI Approved"]


def test_what_the_page_says_of_codecs_and_solvers_is_what_the_wheels_hold() -> None:
    codecs = {path.name for path in files("av") or () if ".so" in path.name or ".dylib" in path.name}
    for library, word in (("libx264", "x264"), ("libx265", "x265"), ("libvpx", "libvpx"), ("libSvtAv1Enc", "SVT-AV1")):
        assert any(name.startswith(library) for name in codecs)
        assert word in PAGE
    # PyAV has no public name for it.
    assert {meta["license"] for meta in av._core.library_meta.values()} == {"LGPL version 3 or later"}
    assert '"LGPL version 3 or later"' in PAGE
    texts = [str(path) for path in files("casadi") or () if "licenses" in path.parts]
    for solver in ("metis", "mumps", "ipopt", "fatrop"):
        assert any(solver in text for text in texts)
        assert solver in PAGE.lower()
