"""The numerical solver of a programme: ``mathnavi.models.nlp_solver`` with the options of ``ocp``."""

from __future__ import annotations

import dataclasses
import os
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import casadi as ca
import numpy as np
from annotated_types import Ge, Le

from mathnavi.controllers.ocp.call import watch
from mathnavi.controllers.ocp.nlp import Programme
from mathnavi.controllers.ocp.scaling_rows import corrected, cost_scale
from mathnavi.interfaces.bounds import Count, Positive, Probability, configuration
from mathnavi.interfaces.checks import check_path
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array
from mathnavi.models.nlp_solver import (
    NlpPlugin,
    NlpSolver,
    SolverOutcome,
    StageStructure,
    fatrop_settings,
    ipopt_settings,
)

Backend = Literal["ipopt", "fatrop", "fatrop-compiled", "ipopt-compiled"]
LinearSolver = Literal["mumps", "spral", "ma27", "ma57", "ma77", "ma86", "ma97", "pardiso"]
Hessian = Literal["exact", "limited-memory"]

_FATROP_WARM = {"mu_init": 1e-5}
_NEAR: dict[str, Any] = {
    "bound_push": 1e-9, "bound_frac": 1e-9, "slack_bound_push": 1e-9, "slack_bound_frac": 1e-9, "mu_init": 1e-6
}  # fmt: skip
"""options of IPOPT for a guess near a solution, whose multipliers are not known: it estimates them from the guess"""
_LOGGED = 5  # print level of a log: a line each iteration
_RESULTS = ("x", "f", "g", "lam_x", "lam_g")


@configuration
class Options:
    """Options of a solve: the NLP solver, its tolerance, its iteration limit and its start; some are for IPOPT only.

    FATROP raises its regularisation without end on some problems without a feasible point, and no iteration limit stops
    it there: it runs in a separate process, which is ended after ``seconds``.
    """

    backend: Backend = "ipopt"
    tolerance: Probability = 1e-9  # of the scaled optimality conditions
    iterations: Count = 500
    seconds: Positive = 600.0  # of CPU time of a whole call, however many programmes it solves, within a quarter
    restarts: Annotated[int, Ge(0), Le(100)] = 12  # most other guesses, where a method finds no feasible point
    warm: bool = False  # True if guesses are near solutions: start close to the bounds, with a small barrier
    linear_solver: LinearSolver = "mumps"  # of IPOPT; all but MUMPS and SPRAL need an additional library
    hessian: Hessian = "exact"  # of IPOPT
    print_level: Annotated[int, Ge(0), Le(12)] = 0  # of IPOPT's lines on standard output, 5 for one each iteration
    log: str | None = None  # file of IPOPT's own log, a line each iteration; overwritten by each solve

    def __post_init__(self) -> None:
        """Check that the log can be written, without touching what is there."""
        if self.log is None:
            return
        file = Path(self.log)
        check_path(file, "log")
        if file.is_dir() or not file.parent.is_dir() or not os.access(file if file.exists() else file.parent, os.W_OK):
            raise FieldError(f"log = {self.log!r}; allowed: a file that can be written, in a folder that exists")


@dataclass(frozen=True, eq=False)
class SolverAnswer:
    """Answer of an NLP solver, in the programme's own scaled unknowns."""

    status: SolverOutcome
    message: str
    x: Array  # (n,) unknowns over their scales, the last iterate if the solve failed
    multipliers: tuple[Array, Array]  # of the bounds (n,) and of the rows (m,)
    cost: float  # f(x, p)
    iterations: int
    solve_ms: float  # wall-clock time
    violation: float = np.inf  # largest of the rows, as the solver scaled them

    @property
    def ok(self) -> bool:
        """True if the programme is solved."""
        return self.status is SolverOutcome.CONVERGED


class NumericalSolver:
    """One of CasADi's NLP solvers for a programme: built once, called for any guess and parameters."""

    def __init__(self, nlp: Programme, options: Options) -> None:
        """Build the solver, and compile its functions for the compiled back ends."""
        self._name, self._linear_solver = options.backend, options.linear_solver
        self._build = partial(_solver, nlp, options)
        self._take(self._build(watched=watch(1.0) is not None))
        self._bounds, self._row_scale = (nlp.x_lower, nlp.x_upper, nlp.lower, nlp.upper), nlp.row_scale
        self._layout, self._rows = nlp.layout, nlp.row_scale

    def solve(
        self,
        x_0: Array,
        known: Array,
        multipliers: tuple[Array, Array] | None = None,
        bounds: tuple[Array, Array, Array, Array] | None = None,
        *,
        plain_rows: bool = False,
        cost: float | None = None,
    ) -> SolverAnswer:
        """Solve from a guess; failure of any kind is in the answer's status.

        The solver sees f over its scale and each row over its own; arguments and answer are in units of f and g. Where
        f turns out to be far smaller than its scale, it is solved again from there; a guess that is a solution on
        another mesh says so at once.

        Args:
            x_0: (n,) guess of the scaled unknowns.
            known: (np,) or, on a fixed grid, (np + N - 1,) the programme's parameters p, then the relative widths D.
            multipliers: guesses of those of the bounds (n,) and of the rows (m,); None for zeros.
            bounds: lower and upper bounds (n,) of the scaled unknowns and (m,) of the rows; None for the programme's.
            plain_rows: True for rows as stated, which the solver may scale itself.
            cost: J of the guess where it is a solution on another mesh; None for a guess of any other kind.
        """
        began = time.perf_counter()
        if not (np.isfinite(x_0).all() and np.isfinite(known).all()):
            return self._failed(SolverOutcome.NOT_FINITE, SolverOutcome.NOT_FINITE.value, x_0, began)
        limits = self._bounds if bounds is None else bounds
        self._rows = np.ones_like(self._row_scale) if plain_rows else self._row_scale
        scale = self._cost_scale(x_0, known)
        if cost is not None:
            scale = corrected(scale, cost)
        answer = self._solved(x_0, known, multipliers, limits, scale)
        if not answer.ok or (found := corrected(scale, answer.cost)) == scale:
            return answer
        again = self._solved(answer.x, known, answer.multipliers, limits, found)
        return dataclasses.replace(
            again if again.ok else answer,
            iterations=answer.iterations + again.iterations,
            solve_ms=answer.solve_ms + again.solve_ms,
        )

    def _take(self, solver: NlpSolver) -> None:
        self._solver, self._in, self._out = solver, solver.inputs, solver.outputs

    def _cost_scale(self, unknowns: Array, known: Array) -> float:
        """Scale of J along a vector of unknowns, at equal shares of T."""
        layout, problem = self._layout, self._layout.problem
        nx, nu = problem.nx, problem.nu
        z, w, last = layout.split(unknowns)
        duration = float(z[0, nx : nx + layout.durations].sum()) if layout.durations else problem.guess_duration
        u = np.vstack([w[:, :nu], last if layout.scheme.shared else w[-1:, :nu]])
        times = np.linspace(0.0, duration, len(z))
        return cost_scale(problem, times, z[:, :nx], u, duration, known[: len(problem.parameters)])

    def _solved(
        self,
        x_0: Array,
        known: Array,
        multipliers: tuple[Array, Array] | None,
        bounds: tuple[Array, Array, Array, Array],
        scale: float,
    ) -> SolverAnswer:
        """The answer of one solve, of f over this scale."""
        began, rows, watching = time.perf_counter(), self._rows, watch(scale)
        if watching is not None and not self._solver.watched:
            self._take(self._build(watched=True))
        self._in["x0"][:], self._in["p"][:] = x_0, np.concatenate([known, [1.0 / scale], 1.0 / rows])
        x_lower, x_upper, lower, upper = bounds
        self._in["lbx"][:], self._in["ubx"][:] = x_lower, x_upper
        self._in["lbg"][:], self._in["ubg"][:] = lower / rows, upper / rows
        of_bounds, of_rows = (0.0, 0.0) if multipliers is None else multipliers
        self._in["lam_x0"][:], self._in["lam_g0"][:] = of_bounds / scale, of_rows * rows / scale
        report = self._solver.solve(watching)
        if report.iterations is None:
            ended = report.outcome in (SolverOutcome.LIMIT, SolverOutcome.INTERRUPTED)
            reason = f"{self._name} {report.message if ended else f'gave up: {_last_words(report.message)}'}"
            return self._failed(report.outcome, reason, x_0, began)
        if report.message == "Invalid_Option":
            wrong = f"linear_solver = {self._linear_solver!r} is not in this build of IPOPT"
            return self._failed(SolverOutcome.FAILED, wrong, x_0, began)
        if report.outcome is SolverOutcome.OVERDETERMINED:
            return self._failed(report.outcome, report.message, x_0, began)
        out = {name: array.copy() for name, array in self._out.items()}
        if not all(np.isfinite(out[name]).all() for name in ("x", "f", "g")):  # FATROP calls even that a success
            last = out["x"] if np.isfinite(out["x"]).all() else x_0
            return self._failed(SolverOutcome.NOT_FINITE, SolverOutcome.NOT_FINITE.value, last, began)
        return SolverAnswer(
            report.outcome,
            f"{self._name} gave up with the status {report.message}" if report.message.isdigit() else report.message,
            out["x"],
            (scale * out["lam_x"], scale * out["lam_g"] / rows),
            scale * float(out["f"][0]),
            report.iterations,
            1e3 * (time.perf_counter() - began),
            float(np.maximum(lower / rows - out["g"], out["g"] - upper / rows).max(initial=0.0)),
        )

    def _failed(self, status: SolverOutcome, message: str, x_0: Array, began: float) -> SolverAnswer:
        nothing = np.zeros_like(self._out["lam_x"]), np.zeros_like(self._out["lam_g"])
        return SolverAnswer(status, message, x_0, nothing, np.nan, 0, 1e3 * (time.perf_counter() - began))


def _last_words(message: str) -> str:
    """Message of a solver's exception, without the place in its sources."""
    return message.rpartition("] ")[2].rpartition(": ")[2]


def _own(options: Options) -> dict[str, Any]:
    """IPOPT's own options, those that differ from its defaults."""
    own: dict[str, Any] = {}
    if options.linear_solver != "mumps":
        own["linear_solver"] = options.linear_solver
    if options.hessian != "exact":
        own["hessian_approximation"] = options.hessian
    if options.print_level:
        own["print_level"] = options.print_level
    if options.log is not None:
        own |= {"output_file": options.log, "file_print_level": _LOGGED}
    return own


def _solver(nlp: Programme, options: Options, *, watched: bool) -> NlpSolver:
    plugin: NlpPlugin = "ipopt" if options.backend.startswith("ipopt") else "fatrop"
    if plugin == "ipopt":
        more = {"honor_original_bounds": "yes"} | (_NEAR if options.warm else {}) | _own(options)
        settings = ipopt_settings(options.tolerance, options.iterations, more)
    else:
        n, layout = nlp.layout.nodes - 1, nlp.layout
        stages = StageStructure(
            states=[layout.state_size] * (n + 1),
            inputs=[layout.input_size] * n + [layout.last_input_size],
            path_rows=nlp.path_rows,
            equality=nlp.equality,
        )
        settings = fatrop_settings(stages, options.tolerance, options.iterations, _FATROP_WARM if options.warm else {})
    scaled = _scaled(nlp, plugin)
    return NlpSolver(
        "solver",
        plugin,
        scaled.functions,
        {"show_eval_warnings": False, **settings},
        _RESULTS,
        seconds=options.seconds,
        compiled=options.backend.endswith("compiled"),
        cache=scaled.derivatives,
        watched=watched,
    )


class _Scaled(NamedTuple):
    """Programme over its scales: x, p, f and g, and their derivatives; p ends with 1 / scale of f and of the rows."""

    functions: dict[str, ca.MX]
    derivatives: dict[str, ca.Function]


def _scaled(nlp: Programme, plugin: NlpPlugin) -> _Scaled:
    """A programme over its scales, with what CasADi's ``plugin`` needs of its derivatives."""
    x, p, share, over = nlp.x, nlp.p, ca.MX.sym("share"), ca.MX.sym("over", len(nlp.row_scale))
    sigma, mu = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(nlp.row_scale))
    own = nlp.assembly.derivatives(plugin)
    f_and_gradient = own["nlp_grad_f"].call([x, p])
    g, jacobian = own["nlp_jac_g"].call([x, p])
    of_row = over[jacobian.sparsity().row()]
    results = {
        "nlp_grad_f": [share * each for each in f_and_gradient],
        "nlp_jac_g": [over * g, ca.MX(jacobian.sparsity(), of_row * jacobian.nz[:])],
        "nlp_hess_l": own["nlp_hess_l"].call([x, p, share * sigma, over * mu]),
    }
    known = {"x": x, "p": ca.vertcat(p, share, over)}
    derivatives = {}
    for name, result in results.items():
        symbols = [*known.values(), *([sigma, mu] if name == "nlp_hess_l" else [])]
        derivatives[name] = ca.Function(name, symbols, result, own[name].name_in(), own[name].name_out())
    return _Scaled(known | {"f": share * nlp.assembly.f, "g": over * nlp.assembly.g}, derivatives)
