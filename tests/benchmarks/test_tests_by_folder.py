"""The CPU time of tests is measured, test by test, and summed by folder."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from rich.console import Console

from benchmarks import OPENGL
from benchmarks.tests_by_folder import Arguments, TestTimes, run

BUSY = """
import subprocess, sys, time

SPENT = "import time\\nwhile time.process_time() < {}: pass"

def spend(seconds):
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass

def test_in_this_process():
    spend(0.2)

def test_in_another():
    subprocess.run([sys.executable, "-c", SPENT.format(0.4)], check=True)

def test_that_only_waits():
    time.sleep(0.3)

def test_that_draws():
    import os
    assert os.environ["MUJOCO_GL"] == "{opengl}"
""".replace("{opengl}", OPENGL)


def test_each_test_has_the_time_of_its_process_and_of_those_it_started_and_can_draw(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "test_busy.py").write_text(BUSY, encoding="utf-8")
    monkeypatch.setenv("MUJOCO_GL", "disable")  # as another part has switched it
    times = run(Arguments((str(tmp_path),), workers=0), Console(quiet=True))
    taken = {place.rpartition("::")[2]: seconds for place, seconds in times.tests.items()}
    rounded = 2.5 / os.sysconf("SC_CLK_TCK")  # s; both ends of an interval may be rounded by a tick of the clock
    assert taken["test_in_this_process"] >= 0.2 - rounded
    assert taken["test_in_another"] >= 0.4 - rounded
    assert taken["test_that_only_waits"] < 0.2
    assert times.whole >= sum(taken.values())


def test_folders_are_summed_and_the_longest_comes_first() -> None:
    times = TestTimes(
        {"tests/a/test_x.py::test_1": 1.0, "tests/a/test_y.py::test_2": 2.0, "tests/b/test_z.py::t": 4.0}, 9.0
    )
    assert times.folders() == {"tests/b": (1, 4.0), "tests/a": (2, 3.0)}
    assert list(times.folders()) == ["tests/b", "tests/a"]
    console = Console(record=True, width=100, file=open(os.devnull, "w"))  # noqa: SIM115
    times.show(console)
    (rest,) = (line for line in console.export_text().splitlines() if "collection" in line)
    assert " 2.0 " in rest  # 9 less 7


def test_only_all_tests_have_a_goal() -> None:
    (row,) = TestTimes({}, 9.0, wall=480.0).comparisons()
    assert (row.ratio, row.holds) == (2.0, False)
    assert TestTimes({}, 9.0).comparisons() == []
