"""All problems with known optima solved by ``OptimalControlProblem.solve()``, and the truth of its statuses.

Each problem is stated with the coarse guess of its literature and solved by its name without options: the library
chooses the method, the grid and the tolerance. An optimum is reached if J of the transcription and J of the replay in
the true dynamics are both within the problem's precision of it: 1e-6, and 1e-5 if the control is singular, relative to
the optimum's distance from its origin.

A status is false in one of three ways: it is OPTIMAL though a figure of the replay exceeds the tolerance; it is OPTIMAL
and J is better than the known optimum by more than the precision; it is another one though the optimum is reached and
every figure is within the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime

FEWEST = 24
"""number of problems that the claims require"""


def solved_by_name(name: str) -> dict[str, Any]:
    """A job: the row of a problem that is solved by its name without options."""
    return row(name, OptimalControlProblem(name).solve())


def row(name: str, solution: Solution) -> dict[str, Any]:
    """Return the figures of a solution, compared with the known optimum of its problem."""
    known, replay = PROBLEMS[name], solution.replay
    error = known.error(solution.cost)
    error_replayed = known.error(replay.cost) if replay is not None else math.nan
    figures = replay.figures if replay is not None else {}
    accurate = bool(figures) and all(value <= solution.tolerance for value in figures.values())
    reached = error <= known.precision and error_replayed <= known.precision
    said = solution.status is SolverOutcome.OPTIMAL
    better = (known.optimum - known.value(solution.cost)) * known.sign / abs(known.optimum - known.origin)
    lie = ""
    if said and not accurate:
        lie = "OPTIMAL, but its replay exceeds the tolerance"
    elif said and better > known.precision:
        lie = "OPTIMAL, but better than the optimum"
    elif not said and reached and accurate:
        lie = f"{solution.status.name}, but it is right"
    return {
        "problem": name,
        "method": solution.method,
        "automatic": True,
        "kind": known.kind,
        "status": solution.status.name.lower(),
        "message": solution.message,
        "lie": lie,
        "nodes": solution.nodes,
        "optimum": known.optimum,
        "value": known.value(solution.cost),
        "value_replayed": known.value(replay.cost) if replay is not None else math.nan,
        "error": error,
        "error_replayed": error_replayed,
        "tolerance": known.precision,
        "reached": said and reached,
        "replay_miss": figures.get("miss", math.nan),
        "replay_path_violation": figures.get("path violation", math.nan),
        "replay_cost_error": figures.get("cost error", math.nan),
        "control_violation": replay.control_violation if replay is not None else math.nan,
        "replay_by_intervals": replay.by_intervals if replay is not None else False,
        "iterations": solution.iterations,
        "total_wall_s": MeasuredTime(1e-3 * solution.timing.total_ms),
    }


def table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return the table with a row for each problem."""
    columns = (
        "problem", "source", "control", "optimum", "J error", "replayed J error", "miss", "violation", "status",
        "time",
    )  # fmt: skip
    cells = []
    for each in rows:
        known = PROBLEMS[each["problem"]]
        cells.append(
            (
                each["problem"] if known.quantity == "J" else f"{each['problem']}: {known.quantity}", known.source,
                each["kind"], f"{known.optimum:.10g}", f"{each['error']:.0e}", f"{each['error_replayed']:.0e}",
                f"{each['replay_miss']:.0e}", f"{each['replay_path_violation']:.0e}",
                each["status"] + (" (lie)" if each["lie"] else ""), f"{each['total_wall_s']:.1f} s",
            )
        )  # fmt: skip
    return Table("Solved by name, nothing chosen: errors relative to the optimum", columns, cells)


def claims(rows: Sequence[Mapping[str, Any]]) -> tuple[Claim, Claim]:
    """Evaluate the claims that every optimum is reached and every status is true."""
    missed = [each["problem"] for each in rows if not each["reached"]]
    lies = [f"{each['problem']} ({each['lie']})" for each in rows if each["lie"]]
    whole = len(rows) >= max(FEWEST, len(PROBLEMS))
    return (
        Claim(
            "ocp.collection", "target",
            "solve() finds the known optimum of every problem from its coarse guess.", "1.1",
            f"J and replayed J of {len(PROBLEMS)} problems to 1e-6, to 1e-5 where the control is singular",
            f"{len(rows) - len(missed)} of {len(rows)}" + (f"; not {', '.join(missed)}" if missed else ""),
            False if missed else True if whole else None,
        ),
        Claim(
            "ocp.statuses", "target",
            "No status lies: OPTIMAL is accurate when it is replayed, and what is right is called OPTIMAL.", "1.1",
            f"none of {len(PROBLEMS)}",
            f"{len(lies)} of {len(rows)}" + (f": {', '.join(lies)}" if lies else ""),
            False if lies else True if whole else None,
        ),
    )  # fmt: skip
