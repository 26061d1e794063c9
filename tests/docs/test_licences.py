"""The page of licences has every package that is installed, with the licence that it states."""

from __future__ import annotations

import importlib.util
from importlib.metadata import PackageNotFoundError, files, version
from pathlib import Path
from types import ModuleType

import av
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "reference" / "licences.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def program() -> ModuleType:
    spec = importlib.util.spec_from_file_location("list_licences", ROOT / "docs" / "list_licences.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_dependency_of_pyproject_is_in_a_table(program: ModuleType) -> None:
    asked = {canonicalize_name(Requirement(text).name) for texts in program.wanted().values() for text in texts}
    assert asked <= set(program.stated())


def test_every_package_that_is_installed_is_in_its_table_with_its_licence(program: ModuleType) -> None:
    """It was written with all extras installed; a package that is missing here keeps its row."""
    stated = program.stated()
    for group in program.groups().values():
        for name in group:
            assert name in stated, "python docs/list_licences.py"
            try:
                version(name)
            except PackageNotFoundError:
                continue
            assert stated[name] == program.licence(name), f"{name}: python docs/list_licences.py"
    assert len(stated) > 100


def test_writing_the_page_again_keeps_what_was_written_by_hand_and_the_rows_of_what_is_missing(
    program: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(program, "PAGE", tmp_path / "licences.md")
    program.PAGE.write_text(PAGE.replace("| `rich` |", "| `poor` |"), encoding="utf-8")
    again = program.written()
    assert "| `rich` |" in again
    assert "| `poor` |" not in again
    assert program.TABLE.sub("", again) == program.TABLE.sub("", PAGE)
    assert "| `maptor` | GNU Lesser General Public License v3 (LGPLv3) | `[bench]` |" in again


def test_a_package_without_a_licence_is_not_passed_over(program: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(program, "metadata", lambda name: _Silent())
    with pytest.raises(ValueError, match="state no licence"):
        program.licence("rich")


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
    assert {meta["license"] for meta in av._core.library_meta.values()} == {"LGPL version 3 or later"}
    assert '"LGPL version 3 or later"' in PAGE
    texts = [str(path) for path in files("casadi") or () if "licenses" in path.parts]
    for solver in ("metis", "mumps", "ipopt", "fatrop"):
        assert any(solver in text for text in texts)
        assert solver in PAGE.lower()
