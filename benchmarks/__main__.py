"""Run every benchmark and print one table of the results.

python -m benchmarks [--quick] [--before COMMIT] [--only PART ...] [--out FILE.json]
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console

from benchmarks import (
    acados_peer,
    flight_solvers,
    growth,
    imports,
    loop_overhead,
    mission_cost,
    ocp_peers,
    range_estimators,
    start_up,
    sweep_scaling,
    tests_by_folder,
    video_time,
)
from benchmarks.arguments import read_arguments
from benchmarks.comparison import WIDTH, Findings, Machine, load, table, write
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.field_table import TOGETHER

# Parts with a row for each problem, part or folder, which is too much for the table of all.
OWN_TABLES = ("ocp_peers", "acados_peer", "start_up", "imports", "video_time", "tests_by_folder")


@dataclass(frozen=True)
class Arguments:
    """Run every benchmark and print one table of the results."""

    quick: bool = False
    """whether to measure a few problems only, once or twice, within about a minute: rough figures"""
    before: str = ""
    """commit whose start-up times are compared with this tree's; empty for no comparison"""
    only: Annotated[tuple[str, ...], TOGETHER] = ()
    """names of the benchmarks to run; all if none is given"""
    out: Path = Path("renders/out/benchmarks.json")
    """file of the figures"""


def parts(quick: bool, before: str = "") -> dict[str, Callable[[Console], Findings]]:
    """Return the benchmarks by name, with few samples if ``quick``."""
    solvers = flight_solvers.Arguments(problems=60, repetitions=2) if quick else flight_solvers.Arguments()
    loop = loop_overhead.Arguments(repetitions=5, seconds=60.0) if quick else loop_overhead.Arguments()
    ocp = ocp_peers.Arguments(ocp_peers.SMALL[:1], repetitions=1, limit=20) if quick else ocp_peers.Arguments()
    acados = acados_peer.Arguments(intervals=(40,), repetitions=1) if quick else acados_peer.Arguments()
    ranging = range_estimators.Arguments(seconds=5.0, repetitions=2) if quick else range_estimators.Arguments()
    sweep = sweep_scaling.Arguments(trials=12, repetitions=1) if quick else sweep_scaling.Arguments()
    start = start_up.Arguments(before, repetitions=1, flight=False) if quick else start_up.Arguments(before)
    mission = mission_cost.Arguments(repetitions=2) if quick else mission_cost.Arguments()
    grown = growth.Arguments(repetitions=1, quick=True) if quick else growth.Arguments()
    video = video_time.Arguments(repetitions=1, fps=1, frames=4) if quick else video_time.Arguments()
    imported = imports.Arguments(repetitions=1) if quick else imports.Arguments()
    tests = tests_by_folder.Arguments(paths=("tests/models/terrain",)) if quick else tests_by_folder.Arguments()
    return {
        "flight_solvers": lambda console: flight_solvers.run(solvers, console),
        "loop_overhead": lambda console: loop_overhead.run(loop, console),
        "ocp_peers": lambda console: ocp_peers.run(ocp, console),
        "acados_peer": lambda console: acados_peer.run(acados, console),
        "range_estimators": lambda console: range_estimators.run(ranging, console),
        "sweep_scaling": lambda console: sweep_scaling.run(sweep, console),
        "mission_cost": lambda console: mission_cost.run(mission, console),
        "growth": lambda console: growth.run(grown, console),
        "video_time": lambda console: video_time.run(video, console),
        "imports": lambda console: imports.run(imported, console),
        "start_up": lambda console: start_up.run(start, console),
        "tests_by_folder": lambda console: tests_by_folder.run(tests, console),
    }


def main(arguments: Arguments) -> int:
    """Run the benchmarks and print the table; return the exit status, 1 if one failed."""
    console, machine = Console(width=WIDTH), Machine.here()
    every = parts(arguments.quick, arguments.before)
    for name in arguments.only:
        if name not in every:
            raise FieldError(f"only = {name!r}; allowed: {', '.join(every)}")
    findings: dict[str, Findings] = {}
    loads: dict[str, float] = {}
    failed: dict[str, str] = {}
    described: dict[str, Any] = {}
    for name in arguments.only or every:
        try:
            findings[name] = every[name](console)
            loads[name] = load()[0]
        except RuntimeError as error:  # hours of other figures are not to be lost
            failed[name] = str(error)
        described = machine.plain() | {"quick": arguments.quick, "loads": loads, "failed": failed}
        write(arguments.out, findings, described)  # whatever ends the next part
    for name in OWN_TABLES:
        if name in findings:
            findings[name].show(console)
    console.print(table(list(findings.values()), described, list(loads.values())))
    if arguments.quick:
        console.print("A quick run: rough figures.")
    for name, reason in failed.items():
        console.print(f"{name} failed: {reason}", markup=False, highlight=False)
    console.print(f"Wrote {arguments.out}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(read_arguments(Arguments)))
