"""Published optima computed by two discretisations of the problem as stated, next to the value of the list."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from benchmarks.ocp_references.collocation import NoReferenceError
from benchmarks.ocp_references.phases import Collocated, Mesh, Stated, of_solution, witness
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.studies.published.library import EVERY, STATED_AS, known_cost, precision, relative_error


def compare(names: Sequence[str], mesh: Mesh, console: Console, *, from_solve: bool = False) -> int:
    """Print both values of each problem and the list's; returns 1 unless each agrees to the precision of its problem.

    A problem of ``controllers/ocp/problems`` has its own references and is left out, and so is what is not stated.
    """
    table = Table(title=f"Published optima, {mesh}")
    for heading in ("problem", "Radau IIA", "Gauss", "difference", "list", "its error"):
        table.add_column(heading, justify="left" if heading == "problem" else "right", no_wrap=heading != "problem")
    failed = []
    for name in names:
        state = EVERY[STATED_AS[name]].statement
        if state is None or (isinstance(problem := state(), OptimalControlProblem) and not problem.statement.states):
            continue
        cells, agrees = _compared(name, problem, mesh, _start(problem) if from_solve else None)
        table.add_row(name, *cells)
        if not agrees:
            failed.append(name)
    console.print(table)
    if failed:
        console.print(f"They do not agree: {', '.join(failed)}", markup=False)
    return 1 if failed else 0


def _start(problem: Stated) -> Collocated:
    return of_solution(problem.solve(progress=False))


def _compared(name: str, problem: Stated, mesh: Mesh, start: Collocated | None) -> tuple[list[str], bool]:
    """Cells of a problem, and whether its values agree."""
    entry, optimum = EVERY[name], known_cost(name)
    try:
        values = [entry.sign * each.cost for each in witness(problem, mesh, start)]
    except NoReferenceError as error:
        return [str(error), "", "", "" if optimum is None else f"{entry.sign * optimum:.10g}", ""], False
    cells = [f"{value:.10g}" for value in values]
    apart = relative_error(entry, *values)
    if optimum is None:
        return [*cells, f"{apart:.0e}", "none", ""], False
    known = entry.sign * optimum
    off = max(relative_error(entry, value, known) for value in values)
    agrees = math.isfinite(off) and max(apart, off) <= precision(name)
    return [*cells, f"{apart:.0e}", f"{known:.10g}", f"{off:.0e}"], agrees
