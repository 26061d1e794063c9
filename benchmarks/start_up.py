"""Start-up time of the command line: help, version, list, the help of a scenario, and a first flight without video.

    python -m benchmarks.start_up [--before COMMIT] [--repetitions 5]

*Cold* is the first start after an installation: no module has been compiled to byte code (``PYTHONPYCACHEPREFIX``
points to an empty folder, so modules of libraries count too), and with ``--drop`` the system's file cache is emptied.
*Warm* is every later start. Each tree uses its compiled kernels of numba, made before anything is measured; for the
flight there is also *first*: a warm start with an empty folder of kernels. With ``--before`` the same commands of an
earlier commit, checked out into a temporary folder, run in turns with those of this tree, in the same environment. The
table shows the load of the machine, which increases the times.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge
from rich.console import Console
from rich.table import Table

from benchmarks.arguments import read_arguments
from benchmarks.comparison import Comparison, alone, within
from benchmarks.progress import progress
from mathnavi.interfaces.bounds import Within, configuration

ROOT = Path(__file__).parents[1]
DROP = Path("/proc/sys/vm/drop_caches")
CALL = "import runpy; runpy.run_module('mathnavi', run_name='__main__')"  # the same at every commit
FLIGHT = "a flight of 4 km"
# fmt: off
COMMANDS: dict[str, tuple[str, ...]] = {
    "--help": ("--help",),
    "--version": ("--version",),
    "list": ("list",),
    "run safe-flight --help": ("run", "safe-flight", "--help"),
    FLIGHT: (
        "run", "safe-flight", "--terrain", "jacksboro",
        "--start", "3000", "4000", "1000", "--target", "6000", "7000", "1000",
    ),
}
WANTED = {  # [s] at most
    ("--help", "warm"): 0.3, ("list", "warm"): 0.5, ("run safe-flight --help", "warm"): 0.3,
    (FLIGHT, "warm"): 1.2, (FLIGHT, "first"): 8.0,
}
# fmt: on

Tree = Literal["here", "before"]
State = Literal["cold", "warm", "first"]
STATES: tuple[State, ...] = ("cold", "warm", "first")


@configuration
class Arguments:
    """Measure the start-up time of commands."""

    before: str = ""
    """commit that is compared with this tree; empty for no comparison"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 5
    """number of measurements of each command in each state"""
    drop: bool = False
    """whether to empty the system's file cache before a cold start; needs root, and slows down other programs"""
    flight: bool = True
    """whether to measure a first flight too"""
    out: Path = Path("renders/out/start_up.json")
    """file of the figures"""


@dataclass(frozen=True)
class Case:
    """A command of one tree in one state, cold, warm or first."""

    tree: Tree
    command: str  # a key of COMMANDS
    state: State


@dataclass(frozen=True, eq=False)
class StartUp:
    """Measurements in the order of the repetitions."""

    before: str  # the commit, "" for none
    wall: dict[Case, list[float]] = field(default_factory=dict)  # [s]
    cpu: dict[Case, list[float]] = field(default_factory=dict)  # [s] of all threads and children
    load: list[float] = field(default_factory=list)  # processes that ran or wanted to, on average, before each

    @property
    def title(self) -> str:
        return "start of the command line"

    def comparisons(self) -> list[Comparison]:
        """Return the rows that compare each command with its goal and with the earlier commit, if there are any."""
        rows = []
        for here in (case for case in self.wall if case.tree == "here"):
            what, wall = f"{here.command}, {here.state}", np.array(self.wall[here])
            if limit := WANTED.get((here.command, here.state)):
                rows.append(within(what, "s", wall, limit))
            if before := self.wall.get(Case("before", here.command, here.state)):
                rows.append(Comparison(what, "s", wall, np.array(before), f"ours at {self.before}", "other / ours"))
        return rows

    def show(self, console: Console) -> None:
        load = f"; load {np.median(self.load):.1f} on {os.cpu_count()} cores" if self.load else ""
        shown = Table(title=f"medians [s]{load}")
        for k, heading in enumerate(("command", "state", "tree", "wall", "CPU")):
            shown.add_column(heading, justify="right" if 3 <= k <= 4 else "left")
        for case in self.wall:
            wall, cpu = (float(np.median(times[case])) for times in (self.wall, self.cpu))
            name = self.before if case.tree == "before" else "this"
            shown.add_row(case.command, case.state, name, f"{wall:.2f}", f"{cpu:.2f}")
        console.print(shown)

    def plain(self) -> dict[str, Any]:
        rows = [
            {"tree": case.tree, "command": case.command, "state": case.state, "wall_s": wall, "cpu_s": self.cpu[case]}
            for case, wall in self.wall.items()
        ]
        return {"before": self.before, "load": self.load, "starts": rows}


def run(arguments: Arguments, console: Console) -> StartUp:
    """Start every command, cold and warm, of both trees in turns."""
    commands = [name for name in COMMANDS if arguments.flight or name != FLIGHT]
    found = StartUp(arguments.before, {}, {})
    with tempfile.TemporaryDirectory() as folder, checked_out(arguments.before, Path(folder)) as trees:
        for tree in trees.values():  # kernels are compiled, and files are in memory
            for name in commands:
                start(tree, COMMANDS[name], Path(folder))
        states = {name: STATES if name == FLIGHT else STATES[:2] for name in commands}
        total = arguments.repetitions * sum(map(len, states.values())) * len(trees)
        with progress(console, "starting", total) as report:
            done = 0
            for _ in range(arguments.repetitions):
                for name in commands:
                    for state in states[name]:
                        for kind, tree in trees.items():
                            report(done, f"{name}, {state}")
                            found.load.append(os.getloadavg()[0])
                            wall, cpu = start(tree, COMMANDS[name], Path(folder), state, arguments.drop)
                            case = Case(kind, name, state)
                            found.wall.setdefault(case, []).append(wall)
                            found.cpu.setdefault(case, []).append(cpu)
                            done += 1
    return found


def start(
    tree: Path, words: tuple[str, ...], folder: Path, state: State = "warm", drop: bool = False
) -> tuple[float, float]:
    """Return wall-clock and CPU time [s] of a command of a tree; RuntimeError if it fails."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        empty = {"cold": ["PYTHONPYCACHEPREFIX"], "first": ["NUMBA_CACHE_DIR"], "warm": []}[state]
        # A caller's switch would have every start compile all modules anew.
        environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "", "PYTHONPATH": str(tree / "src")}
        # Both trees are one installation for their indices of plug-ins, which each would make anew after the other.
        environment["XDG_CACHE_HOME"] = str(folder / "caches" / tree.relative_to(tree.anchor))
        environment |= dict.fromkeys(empty, scratch)
        if words[0] == "run" and "--help" not in words:
            words = (*words, "--out", f"{scratch}/run")
        if state == "cold" and drop:
            drop_files()
        before, began = os.times(), time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-c", CALL, *words],
            cwd=tree, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
        wall, after = time.perf_counter() - began, os.times()
    if done.returncode:
        raise RuntimeError(f"mathnavi {' '.join(words)} in {tree}: exit code {done.returncode}: {done.stderr}")
    return wall, after.children_user - before.children_user + after.children_system - before.children_system


def drop_files() -> None:
    """Empty the system's file cache, if that is permitted."""
    with suppress(OSError):
        os.sync()
        DROP.write_text("1")


@contextmanager
def checked_out(commit: str, folder: Path) -> Iterator[dict[Tree, Path]]:
    """Yield the folder of this tree, and of a checked-out commit if given; ValueError if there is no such commit."""
    if not commit:
        yield {"here": ROOT}
        return
    git, tree = ["git", "-C", str(ROOT), "worktree"], folder / "before"
    made = subprocess.run(
        [*git, "add", "--detach", str(tree), commit], capture_output=True, text=True, check=False
    )  # fmt: skip
    if made.returncode:
        raise ValueError(f"before = {commit!r}: {made.stderr.strip()}; allowed: a commit of this repository")
    try:
        yield {"before": tree, "here": ROOT}
    finally:
        subprocess.run([*git, "remove", "--force", str(tree)], capture_output=True, check=False)


def main(arguments: Arguments) -> None:
    alone("start_up", lambda console: run(arguments, console), arguments.out)


if __name__ == "__main__":
    main(read_arguments(Arguments))
