"""Figures B.2, B.5, B.6 and B.7: the missile's dive on uniform and on adaptive grids.

The thesis gives neither the objective nor its numbers, only curves. Here the cases of
``mathnavi.controllers.ocp.problems.missile`` stand for it, FAST first, whose dive resembles Figure B.5 most. The
control error is the relative L2 distance, over the controls' scales and in fractions of T, to a Hermite-Simpson
solution on 301 uniform nodes, which itself is held against Pontryagin's conditions; the miss is where the control
takes the missile in the true dynamics, against where the transcription believes it to be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Annotated, Any

import casadi as ca
import numpy as np
from annotated_types import Interval

from mathnavi.controllers.ocp.distribution import Equidistributed, Free
from mathnavi.controllers.ocp.indirect import solve_indirect
from mathnavi.controllers.ocp.methods.direct import solve
from mathnavi.controllers.ocp.methods.distribution import distribute
from mathnavi.controllers.ocp.methods.gate import worse_figures
from mathnavi.controllers.ocp.methods.redistribution import redistribute, redistributed
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, Monitor
from mathnavi.controllers.ocp.problems.missile import OPTIMA, missile
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.euler import Euler
from mathnavi.controllers.ocp.transcriptions.hermite_simpson import HermiteSimpson
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.controllers.ocp.transcriptions.trapezoid import Trapezoid
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, Within, configuration
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.studies.framework.jobs import Jobs
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.nodes.missile_nodes.figures import PlannedPath, nodes_figure

NODES = (10, 15, 20, 25, 30, 35, 40, 50)
SCHEMES: tuple[Scheme, ...] = (Euler(), Trapezoid(), HermiteSimpson())
METHODS = ("uniform", "equidistributed", "redistributed, arclength", "redistributed, curvature",
           "redistributed, local error")  # fmt: skip
_FRACTIONS = np.linspace(0.0, 1.0, 2001)
Key = tuple[str, str, int, str]  # case, transcription, N, method
Rows = Mapping[Key, Mapping[str, Any]]
_FIGURE_B_5 = "SM3"  # the case of Figure B.5
EVERY_FIGURE = 1e-8
"""tolerance of the replay gate here: methods are compared, and nothing is good enough to be excused"""


@dataclass(frozen=True)
class GateVerdict:
    """The status of a solution after the replay gate."""

    status: SolverOutcome
    message: str


@configuration
class MissileNodesConfig:
    """Sample sizes: problems and grids that are solved."""

    repeats: Count = 5
    """solves of which the median time is taken"""
    cases: Annotated[Count, Within(Interval(ge=1, le=len(OPTIMA)))] = 2
    """how many of FAST, SM2, SM3, SM are solved on every grid"""
    grids: Annotated[Count, Within(Interval(ge=5, le=len(NODES)))] = 8
    """how many of N = 10, 15, 20, 25, 30, 35, 40, 50"""
    reference_nodes: Count = 301
    """of the uniform solution that the others are compared with"""
    indirect: Annotated[Count, Within(Interval(ge=1, le=len(OPTIMA)))] = len(OPTIMA)
    """how many cases are solved by Pontryagin's conditions too"""


PATH = Monitor(
    "arclength of the path",
    lambda solution, tau, epsilon: np.sqrt(epsilon + (solution.scaled_derivative(tau, 1)[:, 4:6] ** 2).sum(axis=1)),
    lambda mesh, epsilon: ca.sqrt(mesh.count**2 * ca.sumsqr(mesh.chord[4:6]) + epsilon * mesh.relative_width**2),
    epsilon=0.01,
)


class MissileNodes:
    """Uniform and adaptive grids for the missile (Figures B.2, B.5, B.6, B.7)."""

    Config = MissileNodesConfig
    quick = MissileNodesConfig(repeats=1, cases=1, grids=5)
    title = "Nodes that know where to be: the missile's dive"
    on_terrain = False

    @staticmethod
    def run(config: MissileNodesConfig, setup: Setup) -> StudyResult:
        cases = ("FAST", "SM2", "SM3", "SM")[: config.cases]
        nodes = NODES[: config.grids]
        indirect_cases, grids = list(OPTIMA)[: config.indirect], list(product(cases, SCHEMES, nodes))
        jobs = Jobs()
        for case in dict.fromkeys((*cases, *indirect_cases)):
            reference = ReferenceSolve(case, config.reference_nodes, case in indirect_cases)
            jobs.add(("reference", case), solved_reference, [reference])
        for case, scheme, n in grids:
            jobs.add("grids", solved_on_grid, [GridSolve(case, scheme.name, n, config.repeats)])
        jobs.add("paths", paths_of_figure_b_5, [_FIGURE_B_5])
        jobs.add("gate", free_nodes, ["SM2"])
        done = jobs.done(setup)
        controls = {case: done["reference", case][0].control for case in cases}
        rows = [
            {**row, "control_error": relative_distance(control, controls[row["case"]])}
            for solved in done["grids"]
            for row, control in solved
        ]
        table = {(row["case"], row["scheme"], row["N"], row["method"]): row for row in rows}
        (shown,), (gate,) = done["paths"], done["gate"]
        indirect = {case: done["reference", case][0].indirect for case in indirect_cases}
        return StudyResult(
            summary=(
                f"The cases {', '.join(cases)} on N = {nodes[0]} to {nodes[-1]} nodes by three transcriptions and "
                f"{len(METHODS)} ways to place the nodes. Times are wall-clock medians of {config.repeats} solves with "
                "IPOPT from the same coarse guess, replay left out; those of an adaptive method contain the uniform "
                "solve that it starts from.",
                _densities(*shown),
            ),
            rows=rows,
            tables=(_ratios(table, cases), _indirect_table(indirect, config.reference_nodes)),
            figure=nodes_figure(shown, table, cases[0], nodes, METHODS),
            caption="(a) Paths with N = 50 (Figure B.5). (b) Control error against N (B.6). (c) Time against N (B.7), "
            "(d) Its mean and largest with uniform nodes, over cases and transcriptions (B.2).",
            claims=(*_targets(table, indirect, config.reference_nodes, gate), *_printed(table, cases, nodes)),
        )


def control_error(solution: Solution, reference: Solution) -> float:
    """Relative L2 distance of the controls over their scales, in fractions of T."""
    return relative_distance(sampled_control(solution), sampled_control(reference))


def sampled_control(solution: Solution) -> Array:
    """(2001, nu) the control over its scale, at equal fractions of T."""
    sampled: Array = solution.control(_FRACTIONS * solution.duration) / solution.problem.control_scale
    return sampled


def relative_distance(u: Array, v: Array) -> float:
    """sqrt(sum |u - v|^2 / sum |v|^2)."""
    return float(np.sqrt(((u - v) ** 2).sum() / (v**2).sum()))


def miss(solution: Solution) -> float:
    """[m] between where the replay ends and where the transcription does, in the pitch plane."""
    if solution.replay is None:
        return float("nan")
    return float(np.hypot(*(solution.replay.end - solution.x[-1])[4:6]))


@dataclass(frozen=True)
class ReferenceSolve:
    """A case on a fine uniform grid, and whether Pontryagin's conditions are solved too."""

    case: str
    nodes: int
    indirect: bool


@dataclass(frozen=True, eq=False)
class ReferenceControl:
    """The control of a fine uniform grid, and its distance from the boundary-value solution."""

    control: Array  # (2001, nu) over its scale
    indirect: dict[str, float]  # empty where it is not solved


@dataclass(frozen=True)
class GridSolve:
    """A case by one transcription on N nodes, by every method to place them."""

    case: str
    scheme: str  # name of one of SCHEMES
    nodes: int
    repeats: int


def solved_reference(reference: ReferenceSolve) -> ReferenceControl:
    """Solve a case on a fine uniform grid."""
    solution = solve(missile(reference.case), reference.nodes)
    return ReferenceControl(sampled_control(solution), _against_pontryagin(solution) if reference.indirect else {})


def free_nodes(case: str) -> GateVerdict:
    """Forward Euler with free nodes, N = 20, and what the replay gate says."""
    solution = distribute(missile(case), 20, Free(), scheme=Euler(), tolerance=EVERY_FIGURE)
    return GateVerdict(solution.status, solution.message)


def _solved(case: str, scheme: Scheme, n: int, method: str) -> Solution:
    problem = missile(case)
    match method:
        case "uniform":
            return solve(problem, n, scheme=scheme)
        case "equidistributed":
            return distribute(problem, n, scheme=scheme, tolerance=EVERY_FIGURE)
        case _:
            monitors = {monitor.name: monitor for monitor in (ARCLENGTH, CURVATURE, LOCAL_ERROR)}
            monitor = monitors[method.removeprefix("redistributed, ")]
            return redistribute(problem, n, monitor, scheme=scheme, tolerance=EVERY_FIGURE)


def solved_on_grid(grid: GridSolve) -> list[tuple[dict[str, Any], Array]]:
    """Solve by every method: rows without the control error, and controls (2001, nu) over their scales."""
    (scheme,) = (each for each in SCHEMES if each.name == grid.scheme)
    found: list[tuple[dict[str, Any], Array]] = []
    for method in METHODS:
        solutions = [_solved(grid.case, scheme, grid.nodes, method) for _ in range(grid.repeats)]
        solution = solutions[0]
        row = {
            "case": grid.case,
            "scheme": scheme.name,
            "N": grid.nodes,
            "method": method,
            "status": solution.status.name.lower(),
            "control_error": float("nan"),
            "miss_m": miss(solution),
            "J": solution.cost,
            "J_replayed": solution.replay.cost if solution.replay else float("nan"),
            "T_s": solution.duration,
            "iterations": solution.iterations,
            "solve_ms": MeasuredTime(np.median([s.timing.solve_ms for s in solutions])),
        }
        found.append((row, sampled_control(solution)))
    return found


def _against_pontryagin(direct: Solution) -> dict[str, float]:
    """Distance of the direct solution from the boundary-value one."""
    found = solve_indirect(direct)
    scale = direct.problem.control_scale
    error = (direct.control(found.t) - found.u) / scale
    return {
        "converged": float(found.converged),
        "T_s": found.duration,
        "duration_error_s": abs(direct.duration - found.duration),
        "control_error": float(np.sqrt((error**2).sum() / ((found.u / scale) ** 2).sum())),
        "hamiltonian_spread": float(np.ptp(found.hamiltonian)),
    }


def _ratio(table: Rows, key: tuple[str, str, int, str], measure: str) -> float:
    """An adaptive method's figure over that of the uniform grid."""
    case, scheme, n, _ = key
    return float(table[key][measure] / table[case, scheme, n, "uniform"][measure])


def _targets(
    table: Rows,
    indirect: Mapping[str, Mapping[str, float]],
    nodes: int,
    gate: GateVerdict,
) -> list[Claim]:
    fast = ("FAST", HermiteSimpson().name, 15)
    worst_time = max(row["duration_error_s"] for row in indirect.values())
    worst_control = max(row["control_error"] for row in indirect.values())
    solved = all(row["converged"] for row in indirect.values())
    claims = [
        Claim(
            "missile.indirect", "target", "The direct solution is the one that Pontryagin's conditions give.",
            "1.1.1", f"uniform Hermite-Simpson, N = {nodes}: T to 1e-6 s, u to 1e-3 relative, every case",
            f"T to {worst_time:.1e} s, u to {worst_control:.1e}",
            solved and worst_time <= 1e-6 and worst_control <= 1e-3,
        )
    ]  # fmt: skip
    for name, method, most_error, most_miss in (
        ("missile.redistribute", "redistributed, curvature", 0.3, 0.1),
        ("missile.equidistribute", "equidistributed", 0.65, 0.2),
    ):
        error, missed = (_ratio(table, (*fast, method), measure) for measure in ("control_error", "miss_m"))
        status = table[(*fast, method)]["status"]
        claims.append(
            Claim(
                name, "target", f"{method.capitalize()}: far more accurate than uniform nodes at the same N.",
                "B.3, B.4", f"FAST, N = 15, of uniform: control error <= {most_error:g}, miss <= {most_miss:g}",
                f"{error:.2f} and {missed:.3f} ({status})",
                status in ("optimal", "converged") and error <= most_error and missed <= most_miss,
            )
        )  # fmt: skip
    claims.append(
        Claim(
            "missile.gate", "target", "An optimiser that may move the nodes freely hides its error, and is found out.",
            "B.3", "forward Euler with free nodes, SM2, N = 20: refused by the replay gate", f"{gate.message}",
            gate.status is SolverOutcome.REFUSED,
        )
    )  # fmt: skip
    return claims


def _printed(table: Rows, cases: Sequence[str], nodes: Sequence[int]) -> list[Claim]:
    def ratios(scheme: Scheme, method: str, measure: str) -> Array:
        return np.array([_ratio(table, (case, scheme.name, n, method), measure) for case in cases for n in nodes])

    better = {scheme.name: ratios(scheme, "equidistributed", "control_error") for scheme in SCHEMES}
    slower = ratios(HermiteSimpson(), "equidistributed", "solve_ms")
    monitors = {name: ratios(HermiteSimpson(), name, "control_error") for name in METHODS[2:]}
    errors = [table[cases[0], HermiteSimpson().name, n, "equidistributed"]["control_error"] for n in nodes]
    return [
        Claim(
            "B.more-accurate", "printed", "At a given N, distributing the nodes improves accuracy.", "Figure B.6, B.4",
            "control error below that of uniform nodes at every N and by every transcription",
            "ratio of control errors, equidistributed by scaled arclength: "
            + "; ".join(f"{name} {r.min():.2f} to {r.max():.2f}" for name, r in better.items())
            + " (1 where the replay gate refuses)",
            bool(all((r < 1.0).all() for r in better.values())),
        ),
        Claim(
            "B.no-extra-time", "printed", "It does not bring any increase in the average computational time.",
            "Figure B.7, B.4", "mean time at most that of uniform nodes",
            f"{slower.mean():.1f} times on average ({slower.min():.1f} to {slower.max():.1f})",
            bool(slower.mean() <= 1.0),
        ),
        Claim(
            "B.arclength-best", "printed", "The arclength monitor is the most efficient among all choices.", "B.3",
            "least control error after one redistribution, on average",
            "; ".join(f"{name.split(', ')[1]} {r.mean():.2f} of uniform" for name, r in monitors.items()),
            bool(monitors["redistributed, arclength"].mean() <= min(r.mean() for r in monitors.values())),
        ),
        Claim(
            "B.minimum-at-25", "printed", "The approximation error is least at N = 25.", "Figure B.6, B.4",
            "a minimum at N = 25", f"{errors[0]:.1e} at N = {nodes[0]}, {errors[nodes.index(25)]:.1e} at 25, "
            f"{errors[-1]:.1e} at {nodes[-1]}: "
            + ("it falls with every N" if all(a > b for a, b in pairwise(errors)) else "it does not fall with every N"),
            int(np.argmin(errors)) == nodes.index(25),
        ),
    ]  # fmt: skip


def paths_of_figure_b_5(case: str) -> tuple[PlannedPath, PlannedPath]:
    """The paths on both grids of Figure B.5, the adaptive one whatever the replay gate says."""
    problem, n = missile(case), 50
    even = solve(problem, n)
    programme = transcription(problem, HermiteSimpson(), n, Equidistributed(PATH))
    return PlannedPath.from_solution(even), PlannedPath.from_solution(
        replayed(programme.solve(even, redistributed(even, n, PATH)))
    )


def _densities(even: PlannedPath, adaptive: PlannedPath) -> str:
    """Nodes for each 100 m of path, as B.4 counts them."""

    def counts(path: PlannedPath) -> Array:
        steps = np.hypot(*np.diff(path.x[:, 4:6], axis=0).T)
        return np.asarray(100.0 / steps, float)

    a, b = counts(even), counts(adaptive)
    refused = worse_figures(adaptive.replay, even.replay, EVERY_FIGURE)
    verdict = f"would refuse for its {'; '.join(refused)}" if refused else "accepts"
    return (
        f"Nodes for each 100 m of path in the case {_FIGURE_B_5}, N = 50: {a.min():.1f} to {a.max():.1f} uniform "
        f"(print: 5 to 13), {b.min():.1f} to {b.max():.1f} equidistributed by the path's arclength "
        f"(print: 7), a grid that the replay gate {verdict}."
    )


def _ratios(table: Rows, cases: Sequence[str]) -> Table:
    columns = ("case", "transcription", "N", "uniform", *METHODS[1:])
    rows = []
    for case in cases:
        for scheme in SCHEMES:
            for n in (15, 20, 25, 30):
                base = table[case, scheme.name, n, "uniform"]
                cells = []
                for method in METHODS[1:]:
                    key = (case, scheme.name, n, method)
                    refused = table[key]["status"] == "refused"
                    error, missed = (_ratio(table, key, measure) for measure in ("control_error", "miss_m"))
                    cells.append("refused" if refused else f"{error:.2f} / {missed:.3f}")
                start = f"{base['control_error']:.1e} / {base['miss_m']:.2g} m"
                rows.append((case, scheme.name, str(n), start, *cells))
    return Table("Control error / replay miss: uniform, and the others as shares of the uniform one", columns, rows)


def _indirect_table(indirect: Mapping[str, Mapping[str, float]], nodes: int) -> Table:
    columns = ("case", "T, independent [s]", "T, Pontryagin [s]", "|T - T_direct| [s]", "control error", "spread of H")
    rows = [
        (case, f"{OPTIMA[case].duration:.6g}", f"{row['T_s']:.9f}", f"{row['duration_error_s']:.1e}",
         f"{row['control_error']:.1e}", f"{row['hamiltonian_spread']:.1e}")
        for case, row in indirect.items()
    ]  # fmt: skip
    return Table(f"Direct (Hermite-Simpson, N = {nodes}) beside the boundary-value solution", columns, rows)
