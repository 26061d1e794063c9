"""Optimal control problems with known optima: CPU time to the same replayed accuracy, compared with other software.

    python -m benchmarks.ocp_peers [--repetitions 3] [--limit 60] [--dymos-limit 20] [--problems NAME NAME ...]

Each solver states the problem in its own terms, with the same scales and the same coarse guess, and uses its own
refinement; ours is ``solve()``, which chooses its method and looks for the witnesses of its status. The peers are
MAPTOR, to which the claim refers, dymos, and collocation as a user of CasADi writes it (``ocp_collocation``). Each runs
in a separate process for each problem (``ocp_attempts``), with tolerances from 1e-3 to 1e-8, and every solution is
replayed in the same way (``ocp_trajectory``). Two solvers are compared at the finest level of accuracy, of 1e-3, 1e-4,
1e-5 and 1e-6, that both reached within the time limit. The accuracy is the largest of the errors of J and of the
replayed J, the replay's miss and its violation of bounds.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge
from rich.console import Console
from rich.table import Table

from benchmarks.arguments import read_arguments
from benchmarks.comparison import Comparison, Machine, alone
from benchmarks.ocp_attempts import LEVELS, Attempt, level
from benchmarks.progress import progress
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.interfaces.bounds import Within, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import TOGETHER

OURS = "ours"
SHOWN = {OURS: "ours", "maptor": "MAPTOR", "dymos": "dymos, SLSQP", "collocation": "CasADi, Radau"}
AT_MOST = 0.2  # of MAPTOR's time: the claim
SMALL = (
    "brachistochrone", "Bryson-Denham", "double integrator, energy", "double integrator, time", "target line",
    "lunar landing", "Zermelo", "steering",
)  # fmt: skip
"""problems that dymos solves: those that a dense optimiser can solve within a minute"""


@configuration
class Arguments:
    """Compare ``solve()`` with MAPTOR, dymos and plain collocation."""

    problems: Annotated[tuple[str, ...], TOGETHER] = tuple(PROBLEMS)
    """names of the problems"""
    repetitions: Annotated[int, Within(Ge(1), allowed=">= 1")] = 3
    """number of runs of each compared attempt"""
    limit: Annotated[int, Within(Ge(1), allowed=">= 1")] = 60
    """CPU time limit of a solver for a problem, all tolerances and repetitions included [s]"""
    dymos_limit: Annotated[int, Within(Ge(1), allowed=">= 1")] = 20
    """CPU time limit of dymos for a problem [s], if larger than limit: building its model alone takes seconds"""
    out: Path = Path("renders/out/ocp_peers.json")
    """file of the figures; the table has the same name with the extension .md"""

    def __post_init__(self) -> None:
        if unknown := [name for name in self.problems if name not in PROBLEMS]:
            raise FieldError(f"problems = {', '.join(unknown)}; allowed: {', '.join(PROBLEMS)}")

    def limit_of(self, software: str) -> int:
        """Return the CPU time limit [s] of a solver for a problem."""
        return max(self.limit, self.dymos_limit) if software == "dymos" else self.limit


@dataclass(frozen=True)
class Entry:
    """Attempts of one solver on one problem."""

    problem: str
    software: str
    attempts: tuple[Attempt, ...]
    ended: str = ""  # why it tried no more; empty where it came to its last tolerance or to the precision

    def first(self, within: float) -> Attempt | None:
        """Return the first attempt that reaches a level of accuracy."""
        return next((attempt for attempt in self.attempts if attempt.accuracy <= within), None)

    @property
    def finest(self) -> float | None:
        """The finest level of accuracy reached."""
        return min((own for own in LEVELS if self.first(own)), default=None)

    @property
    def best(self) -> Attempt | None:
        """The attempt in the table: the first at the finest level; None if no level was reached."""
        return None if self.finest is None else self.first(self.finest)


@dataclass(frozen=True)
class PeerFindings:
    """Accuracies and times of every solver."""

    entries: list[Entry]

    @property
    def title(self) -> str:
        return "optimal control, CPU time to the same replayed accuracy"

    def _ours(self) -> dict[str, Entry]:
        return {entry.problem: entry for entry in self.entries if entry.software == OURS}

    def comparisons(self) -> list[Comparison]:
        rows = []
        ours = self._ours()
        for entry in self.entries:
            mine = ours.get(entry.problem)
            if entry.software == OURS or mine is None or mine.finest is None or entry.finest is None:
                continue
            common = max(mine.finest, entry.finest)
            own, other = mine.first(common), entry.first(common)
            assert own is not None
            assert other is not None
            count = min(len(own.seconds), len(other.seconds))
            mine_ms, other_ms = (1e3 * np.array(attempt.seconds[:count]) for attempt in (own, other))
            what = f"{entry.problem}, {common:g}"
            rows.append(Comparison(what, "ms", mine_ms, other_ms, SHOWN[entry.software], "ours / other"))
        return rows

    def medians(self) -> dict[str, tuple[float, int]]:
        """Return the median of our time over each peer's, and of how many problems, over those that both solve."""
        ratios: dict[str, list[float]] = {}
        for row in self.comparisons():
            ratios.setdefault(row.software, []).append(row.ratio)
        return {software: (float(np.median(own)), len(own)) for software, own in ratios.items()}

    def beside(self) -> list[str]:
        """Return the medians in words."""
        return [
            f"our time over that of {software}: {median:.3g}, median of {count} problems"
            for software, (median, count) in self.medians().items()
        ]

    def claims(self) -> list[dict[str, Any]]:
        """Return the claim on MAPTOR's time, over the problems on which both reached a level."""
        ratios = [row.ratio for row in self.comparisons() if row.software == SHOWN["maptor"]]
        if not ratios:
            return []
        measured = float(np.median(ratios))
        statement = f"our time over MAPTOR's at the same replayed accuracy, median of {len(ratios)} problems"
        held = {"expected": f"<= {AT_MOST:g}", "measured": measured, "holds": measured <= AT_MOST}
        return [{"id": "ocp.peers", "statement": statement, **held}]

    def show(self, console: Console) -> None:
        shown = Table(title="replayed accuracy that each comes to, and CPU time")
        for heading in ("problem", "software", "tolerance", "J error", "accuracy", "CPU s", "load", ""):
            shown.add_column(heading, justify="left" if heading in ("problem", "software", "") else "right")
        for entry in self.entries:
            shown.add_row(entry.problem, SHOWN[entry.software], *_cells(entry))
        console.print(shown)
        for claim in self.claims():
            sign = "holds" if claim["holds"] else "does not hold"
            console.print(
                f"{claim['id']}: {claim['statement']}: {claim['measured']:.3g}, wanted {claim['expected']}: {sign}"
            )

        for line in self.beside():
            console.print(line, markup=False)

    def plain(self) -> dict[str, Any]:
        return {
            "claims": self.claims(),
            "medians": self.medians(),
            "entries": [
                {
                    "problem": entry.problem,
                    "software": SHOWN[entry.software],
                    "level": entry.finest,
                    "ended": entry.ended or None,
                    "attempts": [_plain(attempt) for attempt in entry.attempts],
                }
                for entry in self.entries
            ],
        }


def _cells(entry: Entry) -> list[str]:
    best = entry.best
    if best is None:
        least = min((attempt.accuracy for attempt in entry.attempts), default=np.inf)
        return ["none", "", f"{least:.0e}" if np.isfinite(least) else "", "", "", entry.ended]
    figures = [f"{best.tolerance:g}", f"{best.cost_error:.0e}", f"{best.accuracy:.0e}"]
    return [*figures, f"{np.median(best.seconds):.3g}", f"{best.load:.1f}", entry.ended]


def _plain(attempt: Attempt) -> dict[str, Any]:
    finite = {"cost_error": attempt.cost_error, "accuracy": attempt.accuracy}
    errors = {name: value if np.isfinite(value) else None for name, value in finite.items()}
    own = {"tolerance": attempt.tolerance, "seconds": list(attempt.seconds), "load": attempt.load}
    return own | errors | {"level": level(attempt.accuracy)}


def measured(problem: str, software: str, repetitions: int, limit: int) -> Entry:
    """Return the attempts of one solver on one problem, in a process with ``limit`` [s] of CPU time."""
    command = [sys.executable, "-m", "benchmarks.ocp_attempts", software, problem, str(repetitions), str(limit)]
    environment = os.environ | {"OPENMDAO_REPORTS": "0"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    found = tuple(_attempt(json.loads(line)) for line in done.stdout.splitlines() if line.startswith("{"))
    if done.returncode == -signal.SIGXCPU:
        return Entry(problem, software, found, f"ended after {limit} s")
    if done.returncode:
        raise RuntimeError(f"{SHOWN[software]}, {problem}: exit code {done.returncode}\n{done.stderr[-2000:]}")
    return Entry(problem, software, found)


def _attempt(line: Mapping[str, Any]) -> Attempt:
    return Attempt(**{**line, "seconds": tuple(line["seconds"])})


def contenders(problem: str) -> list[str]:
    """Return the solvers for a problem: ours, CasADi and, if installed, MAPTOR and, for ``SMALL`` only, dymos."""
    peers = [name for name in ("maptor", "dymos") if find_spec(name)]
    return [OURS, *(name for name in peers if name != "dymos" or problem in SMALL), "collocation"]


def peers_table(findings: PeerFindings, software: Mapping[str, str], machine: Mapping[str, Any]) -> str:
    """Return a table with a row for each problem and two columns for each ``software``, by its key in the entries.

    The last columns are the level of accuracy at which ``solve()`` and MAPTOR are compared, and the ratio of times.
    """
    found = {(entry.problem, entry.software): entry for entry in findings.entries}
    ratios = {row.what: row.ratio for row in findings.comparisons() if row.software == software["maptor"]}
    heads = [f"{name}: {what}" for name in software.values() for what in ("accuracy", "CPU s")]
    lines = [_markdown_row(["problem", *heads, "compared at", f"ours / {software['maptor']}"])]
    lines.append(_markdown_row(["---", *["--:"] * (len(heads) + 2)]))
    for problem in dict.fromkeys(entry.problem for entry in findings.entries):
        cells = [cell for key in software for cell in _shown_cells(found.get((problem, key)))]
        compared = [(what, ratio) for what, ratio in ratios.items() if what.rpartition(", ")[0] == problem]
        ending = [compared[0][0].rpartition(", ")[2], f"{compared[0][1]:.2f}"] if compared else ["", ""]
        lines.append(_markdown_row([problem, *cells, *ending]))
    lines.append("")
    lines += [
        f"{claim['statement']}: **{claim['measured']:.3g}**, wanted {claim['expected']}." for claim in findings.claims()
    ]
    lines += ["", *(f"- {line}" for line in findings.beside())]
    versions = machine["versions"]
    named = ", ".join(f"{name} {versions[name]}" for name in ("casadi", "maptor", "dymos") if versions.get(name))
    load = machine["load_before"][0]
    lines += ["", f"{machine['processor']}, {machine['cores']} cores, load {load:g} at the start; {named}.", ""]
    return "\n".join(lines)


def _shown_cells(entry: Entry | None) -> list[str]:
    """Return the cells of accuracy and CPU time [s] of the attempt in the table."""
    if entry is None:
        return ["", ""]
    best = entry.best
    if best is None:
        return ["none", entry.ended]
    return [f"{best.accuracy:.0e}", f"{np.median(best.seconds):.3g}"]


def _markdown_row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def run(arguments: Arguments, console: Console) -> PeerFindings:
    """Run every solver on every problem, one after the other."""
    for module in ("maptor", "dymos"):
        if not find_spec(module):
            console.print(f"{SHOWN[module]} is left out: it is not installed (pip install -e '.[bench]')", markup=False)
    entries: list[Entry] = []
    with progress(console, "problems of optimal control", len(arguments.problems)) as report:
        for done, name in enumerate(arguments.problems):
            report(done, name)
            for software in contenders(name):
                entries.append(measured(name, software, arguments.repetitions, arguments.limit_of(software)))
    return PeerFindings(entries)


def main(arguments: Arguments) -> None:
    found: list[PeerFindings] = []

    def measure(console: Console) -> PeerFindings:
        found.append(run(arguments, console))
        return found[-1]

    machine = Machine.here()
    alone("ocp_peers", measure, arguments.out)
    page = arguments.out.with_suffix(".md")
    page.write_text(peers_table(found[-1], SHOWN, machine.plain()), "utf-8")
    print(f"Wrote {page}")


if __name__ == "__main__":
    main(read_arguments(Arguments))
