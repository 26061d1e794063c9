"""Every benchmark, and one table of what they found.

python -m benchmarks [--quick] [--out FILE.json]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import tyro
from rich.console import Console

from benchmarks import acados_peer, flight_solvers, loop_overhead, ocp_peers, range_estimators, start_up, sweep_scaling
from benchmarks.comparison import WIDTH, Findings, Machine, table, write

OWN_TABLES = ("ocp_peers", "acados_peer")  # parts with a row for each problem, which is too much for the table of all


@dataclass(frozen=True)
class Arguments:
    """Measure our software beside other people's, and print one table."""

    quick: bool = False
    """whether a few problems, one repetition or two and one minute have to do: rough figures"""
    out: Path = Path("renders/out/benchmarks.json")
    """where the figures go"""


def parts(quick: bool) -> dict[str, Callable[[Console], Findings]]:
    """The benchmarks by name."""
    solvers = flight_solvers.Arguments(problems=60, repetitions=2) if quick else flight_solvers.Arguments()
    loop = loop_overhead.Arguments(repetitions=5, seconds=60.0) if quick else loop_overhead.Arguments()
    ocp = ocp_peers.Arguments(ocp_peers.SMALL[:1], repetitions=1, limit=20) if quick else ocp_peers.Arguments()
    acados = acados_peer.Arguments(intervals=(40,), repetitions=1) if quick else acados_peer.Arguments()
    ranging = range_estimators.Arguments(seconds=5.0, repetitions=2) if quick else range_estimators.Arguments()
    sweep = sweep_scaling.Arguments(trials=12, repetitions=1) if quick else sweep_scaling.Arguments()
    start = start_up.Arguments(repetitions=1) if quick else start_up.Arguments()
    return {
        "flight_solvers": lambda console: flight_solvers.run(solvers, console),
        "loop_overhead": lambda console: loop_overhead.run(loop, console),
        "ocp_peers": lambda console: ocp_peers.run(ocp, console),
        "acados_peer": lambda console: acados_peer.run(acados, console),
        "range_estimators": lambda console: range_estimators.run(ranging, console),
        "sweep_scaling": lambda console: sweep_scaling.run(sweep, console),
        "start_up": lambda console: start_up.run(start, console),
    }


def main(arguments: Arguments) -> None:
    console, machine = Console(width=WIDTH), Machine.here()
    findings = {name: measure(console) for name, measure in parts(arguments.quick).items()}
    described = machine.plain() | {"quick": arguments.quick}
    for name in OWN_TABLES:
        if name in findings:
            findings[name].show(console)
    console.print(table(list(findings.values()), described))
    if arguments.quick:
        console.print("A quick run: rough figures.")
    write(arguments.out, findings, described)
    console.print(f"Wrote {arguments.out}")


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=Arguments.__doc__))
