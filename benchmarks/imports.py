"""Imports of a flight: CPU time of an interpreter that imports its modules, and the packages that take it.

    python -m benchmarks.imports [--repetitions 5]

The modules of ``mathnavi run safe-flight`` are imported in a new process, in turns with a process that imports nothing.
A package's share is the time of its modules, without those that they import, as measured by ``python -X importtime``,
which itself takes time.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge
from rich.console import Console
from rich.table import Table

from benchmarks.arguments import read_arguments
from benchmarks.comparison import Comparison, alone
from benchmarks.progress import progress
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.signals import Array

FLIGHT = "import mathnavi.commands.run, mathnavi.sim.scenarios.safe_flight, mathnavi.controllers.flight.plugin"
NOTHING = "pass"
MOST = 12  # packages that are shown
PREFIX = "import time:"


@configuration
class Arguments:
    """Measure what is imported before a flight."""

    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 5
    """number of measurements of each import"""
    out: Path = Path("renders/out/imports.json")
    """file of the figures"""


def cpu(code: str, *options: str) -> tuple[float, str]:
    """Return CPU time [s] and standard error of an interpreter that runs ``code``; RuntimeError if it fails."""
    before = os.times()
    done = subprocess.run(
        [sys.executable, *options, "-c", code], env=os.environ | {"PYTHONDONTWRITEBYTECODE": ""}, capture_output=True,
        text=True, check=False,
    )  # fmt: skip
    after = os.times()
    if done.returncode:
        raise RuntimeError(f"{code}: exit code {done.returncode}: {done.stderr}")
    return after.children_user - before.children_user + after.children_system - before.children_system, done.stderr


def shares(lines: Iterable[str]) -> dict[str, float]:
    """Return the import time [s] of each package's modules, the longest first, from the output of ``-X importtime``."""
    found: Counter[str] = Counter()
    for line in lines:
        columns = line.removeprefix(PREFIX).split("|")
        if line.startswith(PREFIX) and len(columns) == 3 and columns[0].strip().isdigit():
            found[columns[2].strip().partition(".")[0]] += int(columns[0])
    return {package: 1e-6 * taken for package, taken in found.most_common()}


@dataclass(frozen=True, eq=False)
class ImportFindings:
    """Imports of a flight, compared with a bare interpreter."""

    flight: Array  # (R,) [s]
    bare: Array  # (R,) [s]
    packages: dict[str, float]  # [s] by package, the longest first

    @property
    def title(self) -> str:
        return "imports"

    def comparisons(self) -> list[Comparison]:
        return [Comparison("of a flight, CPU", "s", self.flight, self.bare, "python -c pass", "ours / other")]

    def show(self, console: Console) -> None:
        shown = Table("package", title="imports of a flight [s]")
        shown.add_column("its modules", justify="right")
        for package, taken in list(self.packages.items())[:MOST]:
            shown.add_row(package, f"{taken:.3f}")
        shown.add_row("all", f"{sum(self.packages.values()):.3f}")
        console.print(shown)

    def plain(self) -> dict[str, Any]:
        return {"flight_s": self.flight.tolist(), "bare_s": self.bare.tolist(), "packages_s": self.packages}


def run(arguments: Arguments, console: Console) -> ImportFindings:
    """Run both processes in turns."""
    cpu(FLIGHT)  # after it byte code is there, and files are in memory
    pairs = []
    with progress(console, "imports", arguments.repetitions) as report:
        for repetition in range(arguments.repetitions):
            pairs.append([cpu(code)[0] for code in (FLIGHT, NOTHING)])
            report(repetition + 1)
    _, said = cpu(FLIGHT, "-X", "importtime")
    flight, bare = np.array(pairs).T
    return ImportFindings(flight, bare, shares(said.splitlines()))


def main(arguments: Arguments) -> None:
    alone("imports", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
