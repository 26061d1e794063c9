"""``make check`` runs the tests of what has changed."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.programs import program

ROOT = Path(__file__).resolve().parents[1]
changed = program(".ci/changed.py")


@pytest.mark.parametrize(
    ("file", "tests"),
    [
        ("interfaces/compiled.py", {"tests/interfaces/test_compiled.py"}),
        ("tests/interfaces/test_compiled.py", {"tests/interfaces/test_compiled.py"}),
        ("tests/interfaces/test_removed.py", set()),
        ("docs/index.md", set()),
        ("pyproject.toml", set()),
    ],
)
def test_the_tests_of_a_file(file: str, tests: set[str]) -> None:
    found = {test.relative_to(ROOT).as_posix() for test in changed.tests_of(Path(file))}
    assert found == tests


@pytest.mark.parametrize("file", ["models/terrain/nobodys.py", "tests/models/terrain/helper.py"])
def test_a_file_that_no_test_names_has_all_tests_of_its_package(file: str) -> None:
    assert set(changed.tests_of(Path(file))) == set((ROOT / "tests" / "models" / "terrain").glob("test_*.py"))


def test_a_package_without_a_folder_of_tests_has_those_of_the_package_around_it() -> None:
    (folder,) = {test.parent for test in changed.tests_of(Path("studies/flight/nobodys.py"))}
    assert (ROOT / "tests" / "studies" / "flight").is_relative_to(folder)


def test_a_commit_that_is_not_there_is_an_error(
    capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["changed.py", "no-such-commit"])
    with pytest.raises(changed.subprocess.CalledProcessError):
        changed.main()
    assert "no-such-commit" in capfd.readouterr().err
