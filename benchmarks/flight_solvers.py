"""One replan of the flight planner, solved by us and by other people's software: thread CPU time and cost.

    python benchmarks/flight_solvers.py [--terrain NAME|FILE.npz] [--problems 600]

Problems are recorded from closed-loop missions of the scenario ``safe-flight`` (N = 13, seeds 1, 2, ...) and then
solved again, in the order they arose and from the guess the planner had, by

* the condensed solver (``controllers.flight.sqp``),
* IPOPT and FATROP on CasADi's statement (``controllers.flight.reference``), warm started from the guess and from the
  multipliers of the problem before, in CasADi's virtual machine (VM) and, where there is a C compiler, compiled (C),
* do-mpc (extra ``[bench]``), IPOPT inside, with the same warm start.

Times are of the thread (``time.thread_time``), each problem's the median over the repetitions. Costs are of the same
function for all, ``kernels.objective`` at the accelerations and climb rate found, and are compared with the least that
any of them found, at any tolerance. All else about the differences stands in benchmarks/README.md.

With the defaults it takes some ten minutes: two or three to record, then the solvers, of which the compiled ones are
built for a minute or two the first time. A few dozen problems are done sooner: --problems 20 --repetitions 1.
"""

from __future__ import annotations

import json
import math
import os
import platform
import shutil
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest import mock

os.environ.setdefault("MUJOCO_GL", "disable")

import casadi as ca
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from controllers.flight import kernels, plugin, spline
from controllers.flight.cost_to_go import TARGET_LENGTH
from controllers.flight.planner import Solver
from controllers.flight.problem import POINTS_ON_MANOEUVRE, POINTS_PER_ARC, Landscape, Problem, Solution
from controllers.flight.reference import Reference
from controllers.flight.sqp import GaussNewton
from sim.scenarios.safe_flight import SafeFlight, SafeFlightConfig
from sim.signals import Array

TOLERANCE = 1e-6
SAME_COST = 1e-5
LINE_EVERY = 10.0  # [s] between lines of progress
OURS, IPOPT, DO_MPC = "condensed", "ipopt, VM", "do-mpc"


@dataclass(frozen=True)
class Arguments:
    """Measure the flight planner's solvers side by side."""

    terrain: str = "tian_shan"
    """name of a terrain, or an .npz file"""
    problems: int = 600
    """how many problems to record at least"""
    repetitions: int = 5
    """solves of each problem by the condensed solver; the others get a third of it"""
    out: Path = Path("renders/out/flight_solvers.json")
    """where the figures go"""

    def __post_init__(self) -> None:
        for name in ("problems", "repetitions"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}; allowed: >= 1")


Recorded = list[tuple[Problem, Array]]  # each with its guess


class Recorder:
    """A solver that remembers what it was asked: the problems without an exact arrival."""

    def __init__(self, solver: Solver, into: Recorded) -> None:
        self._solver, self._into = solver, into

    def solve(self, problem: Problem, guess: Array) -> Solution | str:
        if problem.hold is None:
            self._into.append((problem, guess.copy()))
        return self._solver.solve(problem, guess)


@contextmanager
def progress(console: Console, what: str, total: int) -> Iterator[Callable[[int], None]]:
    """A function to tell how many problems are done: a bar on a terminal, elsewhere a line every ten seconds."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    began = told = time.monotonic()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)

        def tell(done: int) -> None:
            nonlocal told
            bar.update(task, completed=done, total=max(total, done))
            if not console.is_terminal and time.monotonic() - told > LINE_EVERY:
                told = time.monotonic()
                console.print(f"{what}: {done} of {max(total, done)}", highlight=False)

        if not console.is_terminal:
            console.print(f"{what}: {total} problems", highlight=False)
        yield tell
    console.print(f"{what}: done in {time.monotonic() - began:.0f} s", highlight=False)


def record(terrain: str, count: int, tell: Callable[[int], None]) -> Recorded:
    """At least ``count`` problems, whole missions at a time."""
    recorded: Recorded = []
    build = plugin.solver
    seed = 0
    while len(recorded) < count:
        seed += 1
        mission: Recorded = []
        with mock.patch.object(plugin, "solver", lambda config, into=mission: Recorder(build(config), into)):
            SafeFlight.build(SafeFlightConfig(terrain=terrain), seed).run()
        recorded += mission
        tell(len(recorded))
    return recorded


class DoMpc:
    """do-mpc's model of the problem, built once per landscape; how it differs is said in benchmarks/README.md."""

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._landscape: Landscape | None = None
        self._mpc: Any = None

    def prepare(self, problem: Problem, guess: Array) -> None:
        """What is not timed: the model of a new landscape, and the guess."""
        if self._landscape is not problem.landscape:
            self._landscape, self._mpc = problem.landscape, _do_mpc(problem, self._tolerance)
        mpc, h, x = self._mpc, problem.parameters.h, problem.start
        for i, a in enumerate(guess[:-1].reshape(-1, 3)):
            climb = guess[-1] if i == problem.arcs - 1 else 0.0
            mpc.opt_x_num["_x", i, 0, -1] = np.append(x, 0.0)
            mpc.opt_x_num["_u", i, 0] = np.append(a, climb)
            x = np.concatenate([x[:3] + h * x[3:] + 0.5 * h * h * a, x[3:] + h * a])
        mpc.opt_x_num["_x", problem.arcs, 0, -1] = np.append(x, guess[-1])

    def solve(self, problem: Problem, guess: Array) -> Solution | str:
        mpc = self._mpc
        mpc.make_step(np.append(problem.start, 0.0)[:, None])
        statistics = mpc.solver_stats
        if not statistics["success"]:
            return str(statistics["return_status"])
        inputs = np.array([mpc.opt_x_num["_u", i, 0] for i in range(problem.arcs)]).reshape(problem.arcs, 4)
        return Solution(inputs[:, :3], float(inputs[-1, 3]), math.nan, True, int(statistics["iter_count"]))


def _do_mpc(problem: Problem, tolerance: float) -> Any:
    """do-mpc's controller for problems on this landscape with these parameters."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of features that its small installation lacks
        import do_mpc
    c = problem.parameters
    h, M = c.h, c.manoeuvre_duration
    terrain, psi, low = problem.landscape.terrain, _psi(problem), _lowness(problem)

    def following(x: ca.MX, a: ca.MX) -> ca.MX:
        return ca.vertcat(x[:3] + h * x[3:] + h**2 / 2 * a, x[3:] + h * a)

    model = do_mpc.model.Model("discrete", "MX")
    x = model.set_variable("_x", "x", (6, 1))
    model.set_variable("_x", "w")
    a = model.set_variable("_u", "a", (3, 1))
    climb = model.set_variable("_u", "climb")
    model.set_variable("_tvp", "is_last")
    model.set_rhs("x", following(x, a))
    model.set_rhs("w", climb)
    model.setup()
    # The set-up makes new symbols.
    p, v, w, a, climb = model.x["x"][:3], model.x["x"][3:], model.x["w"], model.u["a"], model.u["climb"]

    mpc = do_mpc.controller.MPC(model)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.n_robust = problem.arcs, h, 0
    mpc.settings.store_full_solution = False
    mpc.settings.nlpsol_opts = {
        "print_time": False,
        "calc_lam_p": False,
        "ipopt": {
            "print_level": 0,
            "sb": "yes",
            "tol": tolerance,
            "max_iter": 200,
            "warm_start_init_point": "yes",
            "warm_start_bound_push": 1e-9,
            "warm_start_bound_frac": 1e-9,
            "warm_start_slack_bound_push": 1e-9,
            "warm_start_slack_bound_frac": 1e-9,
            "warm_start_mult_bound_push": 1e-9,
            "mu_strategy": "adaptive",
            "mu_init": 1e-4,
        },
    }
    arc = [low(p + t * v + t**2 / 2 * a) for t in h * np.arange(1, POINTS_PER_ARC + 1) / POINTS_PER_ARC]
    kappa = problem.terrain_weight
    stage = h * ca.sumsqr(a) + problem.packed[kernels.CLIMB_WEIGHT] / 2 * climb**2
    stage += kappa / 2 * sum(ca.fmax(s, 0) ** 2 for s in arc)
    braking = (ca.vertcat(0, 0, w) - v) / M
    times = M * np.arange(1, POINTS_ON_MANOEUVRE + 1) / POINTS_ON_MANOEUVRE
    here, there = psi(p), psi(p + h * v)
    far = (there - here) / (h * c.beta) + 1 + c.epsilon
    final = here + problem.packed[kernels.APPROACH_WEIGHT] / 2 * ca.fmax(far, 0) ** 2
    final += kappa / 2 * sum(ca.fmax(low(p + t * v + t**2 / 2 * braking), 0) ** 2 for t in times)
    mpc.set_objective(mterm=final, lterm=stage)
    mpc.set_rterm(a=0.0, climb=0.0)
    v_next = v + h * a
    mpc.set_nl_cons("speed", ca.sumsqr(v_next) / c.speed_max**2, ub=1.0)
    mpc.set_nl_cons("acceleration", ca.sumsqr(a) / c.acceleration_max**2, ub=1.0)
    last = model.tvp["is_last"] * ca.sumsqr(ca.vertcat(0, 0, climb) - v_next)
    mpc.set_nl_cons("manoeuvre", last / (M * c.acceleration_max) ** 2, ub=1.0)
    mpc.bounds["lower", "_u", "climb"], mpc.bounds["upper", "_u", "climb"] = 0.0, c.speed_max
    border = kernels.BORDER
    mpc.terminal_bounds["lower", "x"] = np.array([border, border, *[-np.inf] * 4])
    mpc.terminal_bounds["upper", "x"] = np.array([terrain.width - border, terrain.depth - border, *[np.inf] * 4])
    varying = mpc.get_tvp_template()
    varying["_tvp", problem.arcs - 1, "is_last"] = 1.0
    mpc.set_tvp_fun(lambda _: varying)
    mpc.setup()
    mpc.set_initial_guess()
    return mpc


def _held(u: ca.MX, nodes: int) -> ca.MX:
    return ca.fmin(ca.fmax(u, 0), nodes - 1)


def _bspline(coordinates: list[ca.MX], coefficients: Array) -> ca.MX:
    """CasADi's own B-spline with constant coefficients, coordinates in cells and held to the nodes."""
    shape = coefficients.shape
    knots = [spline.knots(count - 2) for count in reversed(shape)]
    at = [_held(u, count - 2) for u, count in zip(coordinates, shape, strict=True)]
    return ca.bspline(ca.vertcat(*reversed(at)), ca.DM(coefficients.ravel()), knots, [3] * len(shape), 1, {})


def _lowness(problem: Problem) -> Callable[[ca.MX], ca.MX]:
    spacing, heights = problem.landscape.terrain.spacing, problem.landscape.heights
    floor = problem.parameters.clearance
    return lambda p: _bspline([p[1] / spacing, p[0] / spacing], heights) + floor - p[2]


def _psi(problem: Problem) -> Callable[[ca.MX], ca.MX]:
    cost, factor = problem.landscape.cost, problem.parameters.psi_per_metre
    g, target = cost.grid, ca.DM(cost.target)

    def psi(p: ca.MX) -> ca.MX:
        row, column = (p[1] - g.y_0) / g.spacing, (p[0] - g.x_0) / g.spacing
        layer = (p[2] - _bspline([row, column], cost.ground) - g.level_0) / g.layer_spacing
        distance = ca.sqrt(ca.sumsqr(p - target) + TARGET_LENGTH**2)
        return factor * (distance * _bspline([layer, row, column], cost.ratio) - TARGET_LENGTH)

    return psi


@dataclass(frozen=True, eq=False)
class Result:
    """What one solver did with every problem."""

    name: str
    ms: Array  # (n,) thread CPU time [ms], median over the repetitions
    cost: Array  # (n,) NaN where it failed
    iterations: float  # mean

    @property
    def failures(self) -> int:
        return int(np.isnan(self.cost).sum())


def cost_of(problem: Problem, solution: Solution) -> float:
    """The objective at a solution's unknowns."""
    return float(kernels.objective(solution.unknowns, *problem.data))


def measure(name: str, build: Callable[[], Any], problems: Recorded, repetitions: int, console: Console) -> Result:
    """Solve every problem in order, ``repetitions`` times over."""
    times = np.empty((repetitions, len(problems)))
    cost, iterations = np.full(len(problems), np.nan), []
    for repetition in range(repetitions):
        if repetition == 0:
            console.print(f"building {name}", highlight=False)
        solver = build()
        prepare = getattr(solver, "prepare", lambda problem, guess: None)
        first = problems[0]
        prepare(*first)
        solver.solve(*first)  # builds what is built once
        with progress(console, f"solving with {name}, {repetition + 1} of {repetitions}", len(problems)) as tell:
            for i, (problem, guess) in enumerate(problems):
                prepare(problem, guess)
                began = time.thread_time()
                outcome = solver.solve(problem, guess)
                times[repetition, i] = 1e3 * (time.thread_time() - began)
                if isinstance(outcome, Solution):
                    cost[i] = cost_of(problem, outcome)
                    iterations.append(outcome.iterations)
                else:
                    cost[i] = np.nan
                tell(i + 1)
    return Result(name, np.median(times, axis=0), cost, float(np.mean(iterations)) if iterations else math.nan)


def contestants(repetitions: int) -> Iterator[tuple[str, Callable[[], Any], int]]:
    """Name, factory and repetitions of each solver."""
    fewer = max(1, repetitions // 3)
    yield OURS, partial(GaussNewton, TOLERANCE), repetitions
    yield IPOPT, partial(Reference, "ipopt", TOLERANCE), fewer
    yield "fatrop, VM", partial(Reference, "fatrop", TOLERANCE), fewer
    if shutil.which("cc"):
        yield "ipopt, C", partial(Reference, "ipopt", TOLERANCE, compiled=True), fewer
        yield "fatrop, C", partial(Reference, "fatrop", TOLERANCE, compiled=True), fewer
    if find_spec("do_mpc"):
        yield DO_MPC, partial(DoMpc, TOLERANCE), fewer


def claims(results: dict[str, Result], elsewhere: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """What the figures were to be, and are; costs but for the problems that lead ``elsewhere``, to two minima."""
    ours = results[OURS]
    listed: list[dict[str, Any]] = []

    def claim(statement: str, expected: str, measured: float, holds: bool) -> None:
        listed.append({"statement": statement, "expected": expected, "measured": measured, "holds": bool(holds)})

    mean, p99 = float(ours.ms.mean()), float(np.percentile(ours.ms, 99))
    claim("mean thread CPU time of the condensed solver in ms", "<= 0.5", mean, mean <= 0.5)
    claim("99th percentile of it in ms", "<= 1.5", p99, p99 <= 1.5)
    for name, least in ((IPOPT, 30.0), (DO_MPC, 40.0)):
        if name in results:
            theirs = results[name].ms  # a few failures weigh on the mean, so the median must agree
            ratio = min(float(theirs.mean()) / mean, float(np.median(theirs) / np.median(ours.ms)))
            claim(f"{name} over it, the lesser ratio of means and medians", f">= {least:g}", ratio, ratio >= least)
    gap = float(np.nanmax(np.where(elsewhere, np.nan, _gap(ours.cost, results[IPOPT].cost))))
    claim(f"its cost above that of {IPOPT}, relative, worst", f"<= {SAME_COST:g}", gap, gap <= SAME_COST)
    return listed


def _gap(cost: Array, best: Array) -> Array:
    return (cost - best) / (1.0 + np.abs(best))


def main(arguments: Arguments) -> None:
    warnings.simplefilter("ignore", FutureWarning)  # CasADi's, of how do-mpc calls it
    console = Console(width=110)  # the table needs it, wherever the output goes
    if not find_spec("do_mpc"):
        console.print(f"{DO_MPC} is left out: it is not installed (pip install -e '.[bench]')", markup=False)
    with progress(console, f"recording missions over {arguments.terrain}", arguments.problems) as tell:
        problems = record(arguments.terrain, arguments.problems, tell)
    results = {
        name: measure(name, build, problems, repetitions, console)
        for name, build, repetitions in contestants(arguments.repetitions)
    }
    tight = [
        measure("condensed, tight", partial(GaussNewton, 1e-10, 200), problems, 1, console),
        measure("ipopt, tight", partial(Reference, "ipopt", 1e-9), problems, 1, console),
    ]
    difference = _gap(tight[0].cost, tight[1].cost)
    elsewhere = np.abs(difference) > SAME_COST
    best = np.nanmin([result.cost for result in (*results.values(), *tight)], axis=0)

    title = f"{len(problems)} problems, N = {problems[0][0].arcs + 1}, {arguments.terrain}, tolerance {TOLERANCE:g}"
    table = Table(title=title)
    for heading in ("solver", "ms", "p50", "p99", "/ ours", "p50", "steps", "failed", "worst gap", "> 1e-5"):
        table.add_column(heading, justify="left" if heading == "solver" else "right", no_wrap=True)
    rows = []
    for name, result in results.items():
        gap = _gap(result.cost, best)
        row = {
            "solver": name,
            "mean_ms": float(result.ms.mean()),
            "p50_ms": float(np.median(result.ms)),
            "p99_ms": float(np.percentile(result.ms, 99)),
            "mean_over_ours": float(result.ms.mean() / results[OURS].ms.mean()),
            "p50_over_ours": float(np.median(result.ms) / np.median(results[OURS].ms)),
            "iterations": result.iterations,
            "failures": result.failures,
            "worst_gap": float(np.nanmax(gap)),
            "gaps_above_1e-5": int(np.nansum(gap > SAME_COST)),
        }
        rows.append(row)
        shown = ("mean_ms", "p50_ms", "p99_ms", "mean_over_ours", "p50_over_ours", "iterations")
        numbers = [f"{row[key]:.3g}" for key in shown]
        table.add_row(name, *numbers, str(row["failures"]), f"{row['worst_gap']:.1e}", str(row["gaps_above_1e-5"]))
    console.print(table)
    better = int((difference < -SAME_COST).sum())
    console.print(
        f"At tight tolerances condensed and ipopt come to different minima in {elsewhere.sum()} of {len(problems)} "
        f"problems, condensed to the better one in {better}."
    )
    listed = claims(results, elsewhere)
    for claim in listed:
        sign = "holds" if claim["holds"] else "does not hold"
        console.print(f"{claim['statement']}: {claim['measured']:.3g}, wanted {claim['expected']}: {sign}")
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    arguments.out.write_text(
        json.dumps(
            {
                "terrain": arguments.terrain,
                "problems": len(problems),
                "tolerance": TOLERANCE,
                "machine": platform.processor() or platform.machine(),
                "versions": {"casadi": version("casadi"), "python": platform.python_version()},
                "solvers": rows,
                "different_minima": int(elsewhere.sum()),
                "different_minima_condensed_better": better,
                "claims": listed,
            },
            indent=2,
        )
        + "\n"
    )
    console.print(f"Wrote {arguments.out}")


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=Arguments.__doc__))
