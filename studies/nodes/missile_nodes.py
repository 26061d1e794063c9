"""Figures B.2, B.5, B.6 and B.7: the missile's dive on uniform and on adaptive grids.

The thesis shows curves, but neither the objective nor its parameters. Here the cases of
``mathnavi.controllers.ocp.problems.missile`` replace it, FAST first, whose dive resembles Figure B.5 most. The control
error is the relative L2 distance, over the controls' scales and in fractions of T, to a Hermite-Simpson solution on 301
uniform nodes, which itself is compared with Pontryagin's conditions; the miss is the distance between the end of the
replay in the true dynamics and the end that the transcription predicts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Annotated, Any

import casadi as ca
import numpy as np
from annotated_types import Interval
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.controllers.ocp.distribution import Equidistributed, Free
from mathnavi.controllers.ocp.indirect import solve_indirect
from mathnavi.controllers.ocp.methods.adaptation import distribute, redistribute, redistributed, solve, worse_figures
from mathnavi.controllers.ocp.monitors import ARCLENGTH, CURVATURE, LOCAL_ERROR, Monitor
from mathnavi.controllers.ocp.problems.missile import OPTIMA, missile
from mathnavi.controllers.ocp.replay import replayed
from mathnavi.controllers.ocp.solution import ReplayResult, Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import transcription
from mathnavi.controllers.ocp.transcriptions.low_order import Euler, HermiteSimpson, Trapezoid
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.bounds import Count, Within, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.studies.framework.drawing import annotate, styled_figure
from mathnavi.studies.framework.study import Jobs, Setup, StudyResult

NODES = (10, 15, 20, 25, 30, 35, 40, 50)
SCHEMES: tuple[Scheme, ...] = (Euler(), Trapezoid(), HermiteSimpson())
MAIN = HermiteSimpson().name
METHODS = {"uniform": "#6b7785", "equidistributed": "#c2183b", "redistributed, arclength": "#e08a1e",
           "redistributed, curvature": "#1b7fbd", "redistributed, local error": "#2f9e5b"}  # fmt: skip
"""methods of placing the nodes, and their colours"""
FIGURE_B_5 = "SM3"  # the case of Figure B.5
EVERY_FIGURE = 1e-8
"""tolerance of the replay gate, so small that no solution is exempt from the comparison with uniform nodes"""
FRACTIONS = np.linspace(0.0, 1.0, 2001)  # of T, at which controls are compared
PATH = Monitor(
    "arclength of the path",
    lambda solution, tau, epsilon: np.sqrt(epsilon + (solution.scaled_derivative(tau, 1)[:, 4:6] ** 2).sum(axis=1)),
    lambda mesh, epsilon: ca.sqrt(mesh.count**2 * ca.sumsqr(mesh.chord[4:6]) + epsilon * mesh.relative_width**2),
    epsilon=0.01,
)

Rows = Mapping[tuple[str, str, int, str], Mapping[str, Any]]  # by case, transcription, N and method


@configuration
class MissileNodesConfig:
    """Sample sizes: problems and grids that are solved."""

    repeats: Count = 5
    """number of solves of which the median time is taken"""
    cases: Annotated[Count, Within(Interval(ge=1, le=len(OPTIMA)))] = 2
    """number of cases solved on every grid, of FAST, SM2, SM3, SM"""
    grids: Annotated[Count, Within(Interval(ge=5, le=len(NODES)))] = 8
    """number of grids, of N = 10, 15, 20, 25, 30, 35, 40, 50"""
    reference_nodes: Count = 301
    """number of nodes of the uniform solution that the others are compared with"""
    indirect: Annotated[Count, Within(Interval(ge=1, le=len(OPTIMA)))] = len(OPTIMA)
    """number of cases solved by Pontryagin's conditions too"""


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
        indirect_cases = list(OPTIMA)[: config.indirect]
        referenced, jobs = list(dict.fromkeys((*cases, *indirect_cases))), Jobs()
        for case in referenced:
            asked = case in indirect_cases
            jobs.add("references", solved_reference, [case], nodes=config.reference_nodes, indirect=asked)
        for case, scheme, n in product(cases, SCHEMES, nodes):
            jobs.add("grids", solved_on_grid, [case], scheme_name=scheme.name, nodes=n, repeats=config.repeats)
        jobs.add("paths", paths_of_figure_b_5, [FIGURE_B_5])
        jobs.add("gate", free_nodes, ["SM2"])
        done = jobs.done(setup)
        references = dict(zip(referenced, done["references"], strict=True))
        rows = [
            {**row, "control_error": relative_distance(control, references[row["case"]][0])}
            for solved in done["grids"]
            for row, control in solved
        ]
        table = {(row["case"], row["scheme"], row["N"], row["method"]): row for row in rows}
        (shown,), (gate,) = done["paths"], done["gate"]
        indirect = {case: references[case][1] for case in indirect_cases}
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
            figure=_figure(shown, table, cases[0], nodes),
            caption="(a) Paths with N = 50 (Figure B.5). (b) Control error against N (B.6). (c) Time against N (B.7), "
            "(d) Its mean and largest with uniform nodes, over cases and transcriptions (B.2).",
            claims=(*_targets(table, indirect, config.reference_nodes, *gate), *_printed(table, cases, nodes)),
        )


def _targets(
    table: Rows, indirect: Mapping[str, Mapping[str, float]], nodes: int, status: SolverOutcome, message: str
) -> list[Claim]:
    """Evaluate the project's targets; ``status`` and ``message`` are those of free nodes after the replay gate."""
    worst_time, worst_control = (
        max(row[measure] for row in indirect.values()) for measure in ("duration_error_s", "control_error")
    )
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
        key = ("FAST", MAIN, 15, method)
        error, missed = (_ratio(table, key, measure) for measure in ("control_error", "miss_m"))
        ended = table[key]["status"]
        claims.append(
            Claim(
                name, "target", f"{method.capitalize()}: far more accurate than uniform nodes at the same N.",
                "B.3, B.4", f"FAST, N = 15, of uniform: control error <= {most_error:g}, miss <= {most_miss:g}",
                f"{error:.2f} and {missed:.3f} ({ended})",
                ended in ("optimal", "converged") and error <= most_error and missed <= most_miss,
            )
        )  # fmt: skip
    claims.append(
        Claim(
            "missile.gate", "target", "An optimiser that may move the nodes freely hides its error, and is found out.",
            "B.3", "forward Euler with free nodes, SM2, N = 20: refused by the replay gate", message,
            status is SolverOutcome.REFUSED,
        )
    )  # fmt: skip
    return claims


def _printed(table: Rows, cases: Sequence[str], nodes: Sequence[int]) -> list[Claim]:
    """Evaluate the claims of the thesis."""

    def ratios(scheme: str, method: str, measure: str) -> Array:
        return np.array([_ratio(table, (case, scheme, n, method), measure) for case in cases for n in nodes])

    better = {scheme.name: ratios(scheme.name, "equidistributed", "control_error") for scheme in SCHEMES}
    slower = ratios(MAIN, "equidistributed", "solve_ms")
    monitors = {name: ratios(MAIN, name, "control_error") for name in METHODS if name.startswith("redistributed")}
    errors = [table[cases[0], MAIN, n, "equidistributed"]["control_error"] for n in nodes]
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


def _densities(even: PlannedPath, adaptive: PlannedPath) -> str:
    """Return a text on the number of nodes for each 100 m of path, as counted in B.4."""
    a, b = (100.0 / path.steps for path in (even, adaptive))
    refused = worse_figures(adaptive.replay, even.replay, EVERY_FIGURE)
    verdict = f"would refuse for its {'; '.join(refused)}" if refused else "accepts"
    return (
        f"Nodes for each 100 m of path in the case {FIGURE_B_5}, N = 50: {a.min():.1f} to {a.max():.1f} uniform "
        f"(print: 5 to 13), {b.min():.1f} to {b.max():.1f} equidistributed by the path's arclength "
        f"(print: 7), a grid that the replay gate {verdict}."
    )


def _ratio(table: Rows, key: tuple[str, str, int, str], measure: str) -> float:
    """Return the figure of an adaptive method over that of the uniform grid."""
    case, scheme, n, _ = key
    return float(table[key][measure] / table[case, scheme, n, "uniform"][measure])


def _ratios(table: Rows, cases: Sequence[str]) -> Table:
    uniform, *adaptive = METHODS
    rows = []
    for case, scheme, n in product(cases, (scheme.name for scheme in SCHEMES), (15, 20, 25, 30)):
        base = table[case, scheme, n, uniform]
        cells = []
        for method in adaptive:
            key = (case, scheme, n, method)
            error, missed = (_ratio(table, key, measure) for measure in ("control_error", "miss_m"))
            cells.append("refused" if table[key]["status"] == "refused" else f"{error:.2f} / {missed:.3f}")
        rows.append((case, scheme, str(n), f"{base['control_error']:.1e} / {base['miss_m']:.2g} m", *cells))
    title = "Control error / replay miss: uniform, and the others as shares of the uniform one"
    return Table(title, ("case", "transcription", "N", *METHODS), rows)


def _indirect_table(indirect: Mapping[str, Mapping[str, float]], nodes: int) -> Table:
    columns = ("case", "T, independent [s]", "T, Pontryagin [s]", "|T - T_direct| [s]", "control error", "spread of H")
    rows = [
        (case, f"{OPTIMA[case].duration:.6g}", f"{row['T_s']:.9f}", f"{row['duration_error_s']:.1e}",
         f"{row['control_error']:.1e}", f"{row['hamiltonian_spread']:.1e}")
        for case, row in indirect.items()
    ]  # fmt: skip
    return Table(f"Direct (Hermite-Simpson, N = {nodes}) beside the boundary-value solution", columns, rows)


def _figure(planned: tuple[PlannedPath, PlannedPath], table: Rows, case: str, nodes: Sequence[int]) -> Figure:
    """Draw Figures B.5, B.6, B.7 and B.2 side by side."""
    with styled_figure((10.4, 7.0)) as figure:
        (paths, errors), (times, load) = figure.subplots(2, 2)
        _paths(paths, *planned)
        for method, colour in METHODS.items():
            rows = [table[case, MAIN, n, method] for n in nodes]
            style = {"color": colour, "label": method, "ms": 4, "lw": 1.5}
            errors.plot(nodes, [row["control_error"] for row in rows], "o-", **style)
            times.plot(nodes, [row["solve_ms"] for row in rows], "o-", **style)
        errors.set_yscale("log")
        errors.set(xlabel="N", ylabel="relative control error", title=f"(b) accuracy, {case} (Figure B.6)")
        errors.legend(fontsize=8)
        times.set(xlabel="N", ylabel="time [ms]", title=f"(c) time, {case} (Figure B.7)")
        times.set_ylim(bottom=0.0)
        _load(load, table, nodes)
    return figure


def _paths(axes: Axes, even: PlannedPath, adaptive: PlannedPath) -> None:
    density = axes.inset_axes((0.38, 0.1, 0.4, 0.24))
    for path, method, marker in ((even, "uniform", "o"), (adaptive, "equidistributed", "s")):
        colour, x, between = METHODS[method], path.x, path.between
        axes.plot(between[:, 4], -between[:, 5], color=colour, lw=0.8, alpha=0.7)
        axes.plot(x[:, 4], -x[:, 5], marker, color=colour, mfc="none", ms=5, mew=1.1, label=method)
        theta, u, w = x[:, 3], x[:, 0], x[:, 1]
        velocity = np.stack([u * np.cos(theta) + w * np.sin(theta), u * np.sin(theta) - w * np.cos(theta)])
        axes.quiver(
            x[:, 4], -x[:, 5], *velocity, color=colour, width=0.0022, alpha=0.5, angles="xy", scale_units="xy",
            scale=4.0, headwidth=0,
        )  # fmt: skip
        density.plot(np.cumsum(path.steps) - 0.5 * path.steps, 100.0 / path.steps, color=colour, lw=1.4)
    axes.plot(700.0, 0.0, "x", color="#101824", ms=8, mew=2)
    annotate(axes, "target", (700.0, 0.0), (-8, 4), ha="right", fontsize=8)
    axes.set(xlabel="x [m]", ylabel="altitude [m]", title="(a) reference trajectories, N = 50 (Figure B.5)")
    axes.legend(fontsize=8)
    density.set(ylim=(0.0, None))
    density.set_title("nodes for each 100 m, along the path [m]", fontsize=7.5, weight="normal")
    density.tick_params(labelsize=7)


def _load(axes: Axes, table: Rows, nodes: Sequence[int]) -> None:
    """Draw the mean and largest time of a uniform solve over the cases and transcriptions."""
    spent = {
        n: [row["solve_ms"] for (_, _, m, method), row in table.items() if m == n and method == "uniform"]
        for n in nodes
    }
    axes.plot(nodes, [max(spent[n]) for n in nodes], "s--", color="#1b2733", ms=4, label="largest")
    axes.plot(nodes, [float(np.mean(spent[n])) for n in nodes], "o-", color="#1b7fbd", ms=4, label="mean")
    axes.set(xlabel="N", ylabel="time [ms]", title="(d) uniform nodes, cases and transcriptions (Figure B.2)")
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8)


def control_error(solution: Solution, reference: Solution) -> float:
    """Return the relative L2 distance of the controls over their scales, in fractions of T."""
    return relative_distance(sampled_control(solution), sampled_control(reference))


def sampled_control(solution: Solution) -> Array:
    """Return the control (2001, nu) over its scale, at equally spaced fractions of T."""
    sampled: Array = solution.control(FRACTIONS * solution.duration) / solution.problem.control_scale
    return sampled


def relative_distance(u: Array, v: Array) -> float:
    """Return sqrt(sum |u - v|^2 / sum |v|^2)."""
    return float(np.sqrt(((u - v) ** 2).sum() / (v**2).sum()))


def miss(solution: Solution) -> float:
    """Return the distance [m] between the ends of the replay and of the transcription, in the pitch plane."""
    if solution.replay is None:
        return float("nan")
    return float(np.hypot(*(solution.replay.end - solution.x[-1])[4:6]))


def solved_reference(case: str, nodes: int, indirect: bool) -> tuple[Array, dict[str, float]]:
    """A job: control (2001, nu) on a fine uniform grid, and, if ``indirect``, its distance from the indirect one."""
    solution = solve(missile(case), nodes)
    return sampled_control(solution), _against_pontryagin(solution) if indirect else {}


def free_nodes(case: str) -> tuple[SolverOutcome, str]:
    """A job: status after the replay gate, and its message, of forward Euler with free nodes, N = 20."""
    solution = distribute(missile(case), 20, Free(), scheme=Euler(), tolerance=EVERY_FIGURE)
    return solution.status, solution.message


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


def solved_on_grid(case: str, scheme_name: str, nodes: int, repeats: int) -> list[tuple[dict[str, Any], Array]]:
    """A job: solutions by every method: rows without the control error, and controls (2001, nu) over their scales."""
    (scheme,) = (each for each in SCHEMES if each.name == scheme_name)
    found: list[tuple[dict[str, Any], Array]] = []
    for method in METHODS:
        solutions = [_solved(case, scheme, nodes, method) for _ in range(repeats)]
        solution = solutions[0]
        row = {
            "case": case,
            "scheme": scheme.name,
            "N": nodes,
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
    """Return the distances of the direct solution from the solution of the boundary-value problem."""
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


def paths_of_figure_b_5(case: str) -> tuple[PlannedPath, PlannedPath]:
    """A job: paths on both grids of Figure B.5; the adaptive one is not subject to the replay gate."""
    problem, n = missile(case), 50
    even = solve(problem, n)
    programme = transcription(problem, HermiteSimpson(), n, Equidistributed(PATH))
    adaptive = replayed(programme.solve(even, redistributed(even, n, PATH)))
    return PlannedPath.from_solution(even), PlannedPath.from_solution(adaptive)


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """Planned path of the missile, at its nodes and between them."""

    x: Array  # (N, nx) states at the nodes
    between: Array  # (400, nx) states at equal times
    replay: ReplayResult

    @staticmethod
    def from_solution(solution: Solution) -> PlannedPath:
        """Return the path of a replayed solution."""
        assert solution.replay is not None
        return PlannedPath(solution.x, solution.state(np.linspace(0.0, solution.duration, 400)), solution.replay)

    @property
    def steps(self) -> Array:
        """Distances (N - 1,) [m] between successive nodes."""
        return np.asarray(np.hypot(*np.diff(self.x[:, 4:6], axis=0).T), float)
