"""CPU time of the tests, by folder of ``tests/`` and by test.

    python -m benchmarks.tests_by_folder [--paths tests/sim ...] [--workers 3] [--slowest 30]

The time of a test is the CPU time of the process that runs it, all threads included, and of the processes started by it
that have ended: setup, call and teardown together. So a fixture that several tests share counts for the first of them.
CPU time excludes other programs. The rest of the total is the start of the workers, imports, collection, and the
kernels compiled before the first test. As a plug-in of pytest (``-p benchmarks.tests_by_folder``) the module reports
the same figures after any run of the tests.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from annotated_types import Ge
from rich.console import Console
from rich.table import Table

from benchmarks import OPENGL
from benchmarks.arguments import read_arguments
from benchmarks.comparison import Comparison, alone, within
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.field_table import TOGETHER

ROOT = Path(__file__).parents[1]
PROPERTY = "cpu_s"  # a test's, among the properties that its reports carry from a worker to the first process
ALL = ("tests",)
LIMIT = 240.0  # [s] of all tests, on two cores
WORKERS = 3  # as of ``make test``: one waits for a process that it has started, or for a disk
FILE = "MATHNAVI_TESTS_CPU"  # environment variable: the file that the figures are written to, as JSON


@configuration
class Arguments:
    """Measure the CPU time of the tests, by folder and by test."""

    paths: Annotated[tuple[str, ...], TOGETHER] = ALL
    """folders, files or tests to run"""
    workers: Annotated[int, Within(Ge(0), allowed=">= 0")] = WORKERS
    """number of processes that run them; 0 for one process without xdist"""
    slowest: Annotated[int, Within(Ge(0), allowed=">= 0")] = 30
    """number of the longest tests that are shown"""
    out: Path = Path("renders/out/tests_by_folder.json")
    """file of the figures"""


@dataclass(frozen=True, eq=False)
class TestTimes:
    """CPU times [s] of a run of the tests."""

    __test__ = False

    tests: Mapping[str, float]  # [s] by test
    whole: float  # [s] of all processes
    wall: float = math.nan  # [s] by the clock, of all tests with so many workers; NaN for fewer tests
    slowest: int = field(default=30)  # how many tests are shown

    @property
    def title(self) -> str:
        return "CPU time of the tests"

    def folders(self) -> dict[str, tuple[int, float]]:
        """Number of tests and CPU time [s] of each folder, the longest first."""
        count: dict[str, int] = defaultdict(int)
        seconds: dict[str, float] = defaultdict(float)
        for test, cpu in self.tests.items():
            folder = test.partition("::")[0].rpartition("/")[0]
            count[folder] += 1
            seconds[folder] += cpu
        return {name: (count[name], seconds[name]) for name in sorted(seconds, key=lambda name: -seconds[name])}

    def comparisons(self) -> list[Comparison]:
        """Return the row that compares all tests with the goal."""
        return [] if math.isnan(self.wall) else [within("all", "s", np.array([self.wall]), LIMIT)]

    def show(self, console: Console) -> None:
        shown = Table("folder", title="CPU time of the tests [s]")
        for heading in ("tests", "CPU"):
            shown.add_column(heading, justify="right")
        for name, (count, seconds) in self.folders().items():
            shown.add_row(name, str(count), f"{seconds:.1f}")
        rest = self.whole - sum(self.tests.values())
        shown.add_row("start, imports, collection", "", f"{rest:.1f}")
        shown.add_row("whole", str(len(self.tests)), f"{self.whole:.1f}")
        console.print(shown)
        longest = Table("test", title="the longest [s]")
        longest.add_column("CPU", justify="right")
        for test in sorted(self.tests, key=lambda test: -self.tests[test])[: self.slowest]:
            longest.add_row(test, f"{self.tests[test]:.1f}")
        console.print(longest)

    def plain(self) -> dict[str, Any]:
        folders = {name: {"tests": count, "cpu_s": seconds} for name, (count, seconds) in self.folders().items()}
        return {"whole_s": self.whole, "folders": folders, "tests": dict(self.tests)}


def run(arguments: Arguments, console: Console) -> TestTimes:
    """Run the tests and measure them.

    Raises:
        RuntimeError: a test fails, or none is found.
    """
    command = [sys.executable, "-m", "pytest", "-q", "-p", "benchmarks.tests_by_folder", *arguments.paths]
    command += ["-n", str(arguments.workers)] if arguments.workers else []
    console.print(f"running {' '.join(arguments.paths)}")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tests.json"
        environment = os.environ | {FILE: str(file), "PYTHONDONTWRITEBYTECODE": "", "MUJOCO_GL": OPENGL}
        began = time.perf_counter()
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
        wall = time.perf_counter() - began
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)} failed ({done.returncode}):\n{done.stdout[-4000:]}{done.stderr}")
        figures = json.loads(file.read_text(encoding="utf-8"))
    whole = arguments.paths == ALL and arguments.workers == WORKERS
    return TestTimes(figures["tests"], figures["whole_s"], wall if whole else math.nan, arguments.slowest)


def cpu_time() -> float:
    """Return the CPU time [s] of this process and of its child processes that have ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


_began: dict[str, float] = {}  # [s] CPU time at the start of a test that is running, by test
_measured: dict[str, float] = {}  # [s] by test


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Record the CPU time at the start of a test."""
    _began[item.nodeid] = cpu_time()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """Add the CPU time of a test to its last report."""
    if call.when == "teardown":
        item.user_properties.append((PROPERTY, cpu_time() - _began.pop(item.nodeid)))
    return (yield)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Collect the CPU times of all workers."""
    if report.when == "teardown":
        _measured[report.nodeid] = float(dict(report.user_properties)[PROPERTY])  # type: ignore[arg-type]


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Write or show the figures, once the workers have ended."""
    if hasattr(config, "workerinput"):
        return
    whole = cpu_time()
    if FILE in os.environ:
        figures = {"tests": _measured, "whole_s": whole}
        Path(os.environ[FILE]).write_text(json.dumps(figures), encoding="utf-8")
    else:
        TestTimes(_measured, whole).show(Console(width=120))


def main(arguments: Arguments) -> None:
    alone("tests_by_folder", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
