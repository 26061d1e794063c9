"""The table of versions: which are run, what stands in a cell, and what counts as a failure. No network is needed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

from tests.programs import program

versions = program(".ci/versions.py")
SERVED = ["5.0.0rc1", "4.0.1", "4.0.0", "3.19.0", "3.18.1", "3.18.0", "3.17.0", "3.16.0"]


def tried(served: list[str], wanted: str, minors: bool = False) -> tuple[list[str], list[str]]:
    found: tuple[list[str], list[str]] = versions.versions_to_try(served, Requirement(wanted), minors)
    return found


def test_both_ends_of_the_range_are_run_and_the_newest_above_it_is_tried() -> None:
    assert tried(SERVED, "mujoco>=3.17,<4") == (["3.17.0", "3.19.0"], ["4.0.1"])
    assert tried(SERVED, "mujoco>=3.17,<4", minors=True) == (["3.17.0", "3.18.1", "3.19.0"], ["4.0.1"])
    assert tried(["3.17.0"], "mujoco>=3.17,<4") == (["3.17.0"], [])
    assert tried(SERVED, "mujoco>=3.17,!=4.0.0,<5") == (["3.17.0", "4.0.1"], [])


def test_without_a_version_in_the_range_there_is_no_empty_table() -> None:
    with pytest.raises(versions.NothingServedError, match=r"no version of mujoco<4,>=3.17 is served; .* 3.16.0, 4.0.0"):
        tried(["4.0.0", "3.16.0"], "mujoco>=3.17,<4")


def test_the_pythons_are_those_that_pyproject_names() -> None:
    classifiers = ["Programming Language :: Python :: 3", "Programming Language :: Python :: 3.9", "Topic :: 3.8"]
    assert versions.supported_pythons({"classifiers": classifiers}) == ["3.9"]


def test_a_python_is_found_on_path_then_among_pyenvs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    own, later = f"{sys.version_info.major}.{sys.version_info.minor}", f"3.{sys.version_info.minor + 1}"
    inside = tmp_path / "versions" / f"{own}.9" / "bin" / "python"
    inside.parent.mkdir(parents=True)
    inside.symlink_to(sys.executable)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path))
    assert versions.interpreter(own) == str(inside)
    (tmp_path / f"python{own}").symlink_to(sys.executable)
    (tmp_path / f"python{later}").symlink_to(sys.executable)  # says another version
    assert versions.interpreter(own) == f"python{own}"
    assert versions.interpreter(later) is None


UNSOLVED = """\
error: No solution found when resolving dependencies
  cause: Because all versions of labmaze have no usable wheels and you require labmaze, we can conclude that your \
requirements are unsatisfiable.

hint: Wheels are required for `labmaze` because building from source is disabled for all packages
"""
FAILED = """\
E   AssertionError
FAILED tests/contracts/test_planners.py::test_one[a] - AssertionError: no
FAILED tests/contracts/test_planners.py::test_two - ValueError
2 failed, 679 passed in 61.20s (0:01:01)
"""


@pytest.mark.parametrize(
    ("code", "said", "cell"),
    [
        (0, "run     out\n", "passed"),
        (0, "....\n681 passed, 2 skipped in 71.30s (0:01:11)\n", "passed (681 passed, 2 skipped)"),
        (1, FAILED, "failed: 2 failed, 679 passed: test_planners.py::test_one[a]"),
        (2, "Traceback\nmathnavi: MuJoCo 9 | 8\n", r"failed: mathnavi: MuJoCo 9 \| 8"),
        (132, "", "failed: nothing was said"),
    ],
)
def test_a_cell_has_the_reason_of_a_failure(code: int, said: str, cell: str) -> None:
    assert versions.result(code, said) == cell


def test_a_package_without_a_wheel_is_named() -> None:
    assert versions.why_not_installed(UNSOLVED) == "no wheel of labmaze"
    assert versions.why_not_installed("error: Failed to fetch\n\nhint: try\n") == "error: Failed to fetch"


class Made:
    """An environment that is made or not, in which every part but those of ``wrong`` passes."""

    def __init__(self, folder: Path, reason: str = "", wrong: tuple[str, ...] = ()) -> None:
        self.folder, self._reason, self._wrong = folder, reason, wrong

    def make(self, program: str, tools: list[str]) -> str:
        return self._reason

    def run(self, part: str, workers: int) -> str:
        if part == "flight" and part not in self._wrong:
            (self.folder / "flight").mkdir()
            (self.folder / "flight" / "summary.json").touch()
        return "failed: wrong" if part in self._wrong else "passed"


def cells(made: Made) -> dict[str, str]:
    found: dict[str, str] = versions.cells_of(made, "python", [], list(versions.PARTS), 1)
    return found


def test_a_part_that_fails_is_a_cell_and_not_the_end(tmp_path: Path) -> None:
    assert set(cells(Made(tmp_path, reason="no wheel of it")).values()) == {"failed: no wheel of it"}
    without_flight = cells(Made(tmp_path, wrong=("flight",)))
    assert without_flight == {
        "flight": "failed: wrong",
        "osmesa": "no flight",
        "egl": "no flight",
        "contracts": "passed",
    }
    assert cells(Made(tmp_path, wrong=("osmesa",))) == {
        **dict.fromkeys(versions.PARTS, "passed"),
        "osmesa": "failed: wrong",
    }


def test_a_missing_library_is_named_and_nothing_is_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(versions, "find_library", lambda name: None if name == "OSMesa" else name)
    assert versions.Environment("3.11", "3.17.0", tmp_path / "uv").run("osmesa", 1) == "missing: libOSMesa"


def row(trial: bool, **cells: str) -> Any:
    return versions.Row("3.11", "3.17.0", trial, cells)


def test_what_fails_above_the_range_or_is_missing_here_is_no_failure() -> None:
    assert row(False, flight="passed", egl="failed: nothing").failed
    assert not row(True, flight="failed: nothing").failed
    assert not row(False, flight="passed", egl="missing: libEGL").failed


def test_the_table_has_a_row_for_each_pair() -> None:
    printed = versions.table([row(False, egl="passed"), row(True, egl="failed: no")], ["egl"])
    assert printed.splitlines() == [
        "| Python | MuJoCo | egl |",
        "|---|---|---|",
        "| 3.11 | 3.17.0 | passed |",
        "| 3.11 | 3.17.0 (trial) | failed: no |",
    ]


@pytest.mark.parametrize("words", [["--python", "2.7"], ["--parts", "speed"], ["--minor"]])
def test_unknown_words_are_refused(words: list[str]) -> None:
    command = [sys.executable, versions.__file__, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith("versions.py: error:")
