"""Problems with known optima: the whole collection by ``solve()``, and some by every adaptive method of the thesis.

The collection is ``mathnavi.controllers.ocp.problems.library``. The methods of the thesis are compared on ``COMPARED``,
in a fixed order and with a limited number of nodes. A method has reached an optimum if its solution passed the replay
gate and both J of the transcription and J of the replay in the true dynamics are within the problem's tolerance of it.
The table reports the first method that reached the optimum of a problem; the figure shows all.

N counts the points whose states are unknowns: the grid's nodes, and the interior points of the intervals of a
Legendre-Gauss-Lobatto scheme of degree K > 1.

**The collection** is solved by ``OptimalControlProblem.solve()``, and its statuses are checked. Each problem is stated
with the coarse guess of its literature and solved by its name without options: the library chooses the method, the grid
and the tolerance. An optimum is reached if J of the transcription and J of the replay in the true dynamics are both
within the problem's precision of it: 1e-6, and 1e-5 if the control is singular, relative to the optimum's distance from
its origin.

A status is false in one of three ways: it is OPTIMAL though a figure of the replay exceeds the tolerance; it is OPTIMAL
and J is better than the known optimum by more than the precision; it is another one though the optimum is reached and
every figure is within the tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any

import matplotlib
import numpy as np
from annotated_types import Interval
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from mathnavi.controllers.ocp.methods.adaptation import distribute, redistribute, refine, solve
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR
from mathnavi.controllers.ocp.problem import OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.problems.library import PROBLEMS
from mathnavi.controllers.ocp.residual import RESIDUAL
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.transcriptions.collocation import LegendreGaussLobatto
from mathnavi.interfaces.bounds import configuration
from mathnavi.renders.figures import STYLE, canvas
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.studies.framework.drawing import annotate, heat_map
from mathnavi.studies.framework.study import Row, Setup, StudyResult

Method = Callable[[ProblemFunctions, int], Solution]
DEGREE = 4
LOBATTO = LegendreGaussLobatto(DEGREE)


def _intervals_by_degree(most: int) -> int:
    """Return the number of nodes of the finest grid with at most ``most`` points."""
    return max(2, (most - 1) // DEGREE + 1)


ADAPTIVE: dict[str, Method] = {
    "refinement": lambda problem, n: refine(problem, min(6, n), most_nodes=n),
    f"refinement, LGL {DEGREE}": lambda problem, n: refine(
        problem, min(4, _intervals_by_degree(n)), most_nodes=_intervals_by_degree(n), scheme=LOBATTO
    ),
    "redistribution, local error": lambda problem, n: redistribute(problem, n, LOCAL_ERROR, rounds=3),
    "redistribution, curvature": lambda problem, n: redistribute(problem, n, CURVATURE, rounds=3),
    "redistribution, arclength": lambda problem, n: redistribute(problem, n, ARCLENGTH, rounds=3),
    "redistribution, residual": lambda problem, n: redistribute(problem, n, RESIDUAL, rounds=10),
    "equidistribution in the NLP": lambda problem, n: distribute(problem, n),
}
NOT_ADAPTIVE: dict[str, Method] = {
    "uniform": solve,
    "one polynomial": lambda problem, n: solve(problem, 2, scheme=LegendreGaussLobatto(min(n - 1, 40))),
}
METHODS = ADAPTIVE | NOT_ADAPTIVE
COMPARED = (
    "brachistochrone", "brachistochrone, g = 9.81", "brachistochrone, drop", "Bryson-Denham", "hypersensitive",
    "hypersensitive, short", "double integrator, energy", "double integrator, energy, v(T) free",
    "double integrator, time", "Goddard", "van der Pol", "Rayleigh", "cart-pole", "tumour", "free-flying robot",
    "alp rider",
)  # fmt: skip
"""problems on which the methods of the thesis are compared"""
REFUSED, UNSOLVED, UNTRIED = "#c9ced4", "#93a0ad", "none"  # colours and text of a cell without an error
KEY = {"refused: replays worse than uniform nodes": REFUSED, "no solution, and why": UNSOLVED, "not tried": UNTRIED}
FEWEST = 24  # problems that the claims on ``solve()`` require


@configuration
class OcpProblemsConfig:
    """Sample sizes: problems and grids that are solved."""

    nodes: Annotated[int, Interval(ge=6, le=1000)] = 60
    """largest number of nodes of a method"""
    problems: Annotated[int, Interval(ge=1, le=len(PROBLEMS))] = len(PROBLEMS)
    """number of problems, in the order of the library"""
    exhaustive: bool = True
    """whether every method solves every problem; if not, methods are tried until one reaches the optimum"""


class OcpProblems:
    """Optimal control problems with known optima, by every adaptive method."""

    Config = OcpProblemsConfig
    quick = OcpProblemsConfig(problems=16, exhaustive=False)
    title = "Problems with known optima"
    on_terrain = False

    @staticmethod
    def run(config: OcpProblemsConfig, setup: Setup) -> StudyResult:
        automatic = setup.compute(solved_by_name, list(PROBLEMS)[: config.problems])
        names = COMPARED[: config.problems]
        solved = setup.compute(attempts, names, nodes=config.nodes, exhaustive=config.exhaustive)
        rows = [row for tried in solved for row in tried]
        best = {name: _first_reached(tried) for name, tried in zip(names, solved, strict=True)}
        reached = [name for name, row in best.items() if row["reached"]]
        return StudyResult(
            summary=(
                f"{len(automatic)} problems by solve(), from the coarse guess of the literature, and {len(names)} by "
                f"the methods of the thesis, at most {config.nodes} nodes, Hermite-Simpson unless a method says else. "
                "Reported is the first method, in the order of the figure, whose solution passed the replay gate and "
                "whose J and replayed J are both within the tolerance. Times are wall-clock times of the solver, "
                "summed over the grids that a method goes through, with as many problems at once as there are workers.",
                "Where the open loop is ill-posed, the replay goes interval by interval. What is replayed is the "
                "control that actuators can follow: one that is a parabola between its nodes overshoots a bound where "
                "it switches, and is saturated there. Miss and largest violation of a state bound or a path constraint "
                "on a dense grid are in the table, relative to the scale.",
            ),
            rows=automatic + rows,
            tables=(automatic_table(automatic), _table(best.values())),
            figure=_figure(rows, best),
            caption="The larger of the errors of J and of the replayed J, over the problem's tolerance, for every "
            "method: blue, below 1, where it is reached. Framed: what is reported.",
            claims=(*automatic_claims(automatic), _claim(best, reached, config)),
        )


def attempts(name: str, nodes: int, exhaustive: bool) -> list[dict[str, Any]]:
    """A job: a row for each method tried, up to the first that reaches the tolerance, or all if ``exhaustive``."""
    rows: list[dict[str, Any]] = []
    for method in METHODS:
        rows.append(_row(name, method, METHODS[method](PROBLEMS[name].problem(), nodes)))
        if rows[-1]["reached"] and not exhaustive:
            break
    return rows


def _row(name: str, method: str, solution: Solution) -> dict[str, Any]:
    known, replay = PROBLEMS[name], solution.replay
    passed = solution.status in (SolverOutcome.OPTIMAL, SolverOutcome.CONVERGED) and replay is not None
    error = known.error(solution.cost)
    error_replayed = known.error(replay.cost) if replay is not None else math.nan
    intervals, inside = solution.nodes - 1, solution.scheme.interior
    return {
        "problem": name,
        "method": method,
        "adaptive": method in ADAPTIVE,
        "status": solution.status.name.lower(),
        "message": solution.message,
        "nodes": intervals * (1 + inside) + 1,
        "intervals": intervals,
        "optimum": known.optimum,
        "value": known.value(solution.cost),
        "value_replayed": known.value(replay.cost) if replay is not None else math.nan,
        "error": error,
        "error_replayed": error_replayed,
        "tolerance": known.tolerance,
        "reached": passed and error <= known.tolerance and error_replayed <= known.tolerance,
        "replay_miss": replay.miss if replay is not None else math.nan,
        "replay_path_violation": replay.path_violation if replay is not None else math.nan,
        "replay_control_violation": replay.control_violation if replay is not None else math.nan,
        "replay_cost_error": replay.cost_error if replay is not None else math.nan,
        "replay_by_intervals": replay.by_intervals if replay is not None else False,
        "iterations": solution.iterations,
        "solve_ms": MeasuredTime(solution.timing.solve_ms),
        "build_wall_s": MeasuredTime(1e-3 * solution.timing.build_ms),
    }


def _first_reached(tried: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the row of the first adaptive method that reached the optimum, else that of the least error."""
    adaptive = [row for row in tried if row["adaptive"]]
    for row in adaptive:
        if row["reached"]:
            return row
    return min(adaptive, key=_excess)


def _excess(row: Mapping[str, Any]) -> float:
    """Return the larger error over the tolerance; infinite without a solution that passed the gate."""
    excess = float(np.max([row["error"], row["error_replayed"]])) / row["tolerance"]  # NaN if either is
    return excess if row["status"] in ("optimal", "converged") and math.isfinite(excess) else math.inf


def _claim(best: Mapping[str, Mapping[str, Any]], reached: Sequence[str], config: OcpProblemsConfig) -> Claim:
    most = max(row["nodes"] for row in best.values())
    missed = [f"{name} {_excess(row):.2g} times" for name, row in best.items() if name not in reached]
    counted = f"{len(reached)} of {len(best)}, with at most {most} nodes"
    return Claim(
        "ocp.all", "target",
        "Some adaptive method of the thesis solves every problem that they are compared on.", "1.1, B.3",
        f"each of {len(COMPARED)} within {config.nodes} nodes, J and replayed J to 1e-4 of the optimum (1e-3 for "
        "tumour and alp rider, Goddard relative to h - 1)",
        counted + (f"; the tolerance is missed by {', '.join(missed)}" if missed else ""),
        None if len(best) < len(COMPARED) and not missed else not missed,
    )  # fmt: skip


def _named(problem: str) -> str:
    """Return the name of a problem, with what its optimum is the value of unless that is J."""
    quantity = PROBLEMS[problem].quantity
    return problem if quantity == "J" else f"{problem}: {quantity}"


def _table(best: Iterable[Row]) -> Table:
    return Table.of("The larger of both errors; * replayed interval by interval", best, (
        ("problem", lambda row: _named(row["problem"])), ("optimum", "{optimum:.8g}"),
        ("source", lambda row: PROBLEMS[row["problem"]].source), ("value", "{value:.8g}"),
        ("replayed", lambda row: f"{row['value_replayed']:.8g}{' *' if row['replay_by_intervals'] else ''}"),
        ("error", lambda row: f"{max(row['error'], row['error_replayed']):.0e}"), ("miss", "{replay_miss:.0e}"),
        ("path violation", "{replay_path_violation:.0e}"), ("N", "{nodes}"),
        ("method", lambda row: row["method"] + ("" if row["reached"] else " (not reached)")),
        ("time", "{solve_ms:.0f} ms"),
    ))  # fmt: skip


def _figure(rows: Sequence[Mapping[str, Any]], best: Mapping[str, Mapping[str, Any]]) -> Figure:
    names, methods = list(best), list(METHODS)
    lacking = {row["status"].replace("_", " "): UNSOLVED for row in rows} | {"": UNTRIED, "refused": REFUSED}
    values = np.full((len(names), len(methods)), np.nan)
    texts = [["" for _ in methods] for _ in names]
    for row in rows:
        i, j = names.index(row["problem"]), methods.index(row["method"])
        excess = _excess(row)
        known = math.isfinite(excess)
        values[i, j] = max(excess, 1e-12) if known else np.nan
        texts[i][j] = _ratio(excess) if known else row["status"].replace("_", " ")
    framed = [(i, methods.index(best[name]["method"])) for i, name in enumerate(names) if best[name]["reached"]]
    with matplotlib.rc_context(STYLE):
        figure = canvas(10.2, 2.5 + 0.29 * len(names))
        axes = figure.add_subplot()
        shown = heat_map(axes, values, names, methods, texts, decades=(4.0, 4.0), framed=framed, lacking=lacking)
        axes.set_title("Distance from known optima: larger error of J and the replayed J, over the tolerance", pad=18)
        bar = figure.colorbar(shown, ax=axes, shrink=0.8, pad=0.015, aspect=28, extend="both")
        ticks = np.arange(-4, 5, 2)
        bar.set_ticks(ticks.tolist(), labels=["1" if k == 0 else f"$10^{{{k}}}$" for k in ticks])
        bar.set_label("error over tolerance, as in the cells")
        bar.outline.set_visible(False)
        axes.axvline(len(ADAPTIVE), color=STYLE["axes.edgecolor"], lw=1.4)
        middle = len(ADAPTIVE) + 0.5 * len(NOT_ADAPTIVE)
        annotate(axes, "not adaptive", (middle, 0.0), (0, 4), ha="center", fontsize=8)
        key = [
            Patch(facecolor="none", edgecolor="#16202a", lw=2.0, label="reported: the first to reach it"),
            *(Patch(facecolor=colour, edgecolor="#8b95a0", label=words) for words, colour in KEY.items()),
        ]
        figure.legend(handles=key, loc="outside lower center", ncols=len(key), fontsize=8)
    return figure


def _ratio(excess: float) -> str:
    """Return a short text of a ratio: 0.036, 2.4, 71, 6e-4."""
    if 1e-2 <= excess < 1e3:
        return f"{excess:.2g}" if excess < 100.0 else f"{excess:.0f}"
    mantissa, exponent = f"{excess:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def solved_by_name(name: str) -> dict[str, Any]:
    """A job: the row of a problem that is solved by its name without options."""
    return automatic_row(name, OptimalControlProblem(name).solve(progress=False))


def automatic_row(name: str, solution: Solution) -> dict[str, Any]:
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


def automatic_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return the table with a row for each problem."""
    return Table.of("Solved by name, nothing chosen: errors relative to the optimum", rows, (
        ("problem", lambda row: _named(row["problem"])), ("source", lambda row: PROBLEMS[row["problem"]].source),
        ("control", "kind"), ("optimum", lambda row: f"{PROBLEMS[row['problem']].optimum:.10g}"),
        ("J error", "{error:.0e}"), ("replayed J error", "{error_replayed:.0e}"), ("miss", "{replay_miss:.0e}"),
        ("violation", "{replay_path_violation:.0e}"),
        ("status", lambda row: row["status"] + (" (lie)" if row["lie"] else "")), ("time", "{total_wall_s:.1f} s"),
    ))  # fmt: skip


def automatic_claims(rows: Sequence[Mapping[str, Any]]) -> tuple[Claim, Claim]:
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
