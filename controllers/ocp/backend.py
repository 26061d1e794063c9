"""The numerical solver of a programme: ``mathnavi.models.nlp_solver`` with the options of ``ocp``."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Le

from mathnavi.controllers.ocp.nlp import Programme
from mathnavi.interfaces.bounds import Count, Positive, Probability, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.nlp_solver import (
    IPOPT_WARM_START,
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
    seconds: Positive = 600.0  # of CPU time, after which a solve is ended
    restarts: Annotated[int, Ge(0), Le(100)] = 12  # most other guesses, where a method finds no feasible point
    warm: bool = False  # True if guesses are near solutions: start close to the bounds, with a small barrier
    linear_solver: LinearSolver = "mumps"  # of IPOPT; all but MUMPS and SPRAL need an additional library
    hessian: Hessian = "exact"  # of IPOPT
    print_level: Annotated[int, Ge(0), Le(12)] = 0  # of IPOPT's lines on standard output, 5 for one each iteration
    log: str | None = None  # file of IPOPT's own log, a line each iteration; overwritten by each solve


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

    @property
    def ok(self) -> bool:
        """True if the programme is solved."""
        return self.status is SolverOutcome.CONVERGED


class NumericalSolver:
    """One of CasADi's NLP solvers for a programme: built once, called for any guess and parameters."""

    def __init__(self, nlp: Programme, options: Options) -> None:
        """Build the solver, and compile its functions for the compiled back ends."""
        self._name, self._linear_solver = options.backend, options.linear_solver
        self._solver = _solver(nlp, options)
        self._in, self._out = self._solver.inputs, self._solver.outputs
        self._bounds = nlp.x_lower, nlp.x_upper, nlp.lower, nlp.upper

    def solve(
        self,
        x_0: Array,
        known: Array,
        multipliers: tuple[Array, Array] | None = None,
        bounds: tuple[Array, Array, Array, Array] | None = None,
    ) -> SolverAnswer:
        """Solve from a guess; failure of any kind is in the answer's status.

        Args:
            x_0: (n,) guess of the scaled unknowns.
            known: (np,) or, on a fixed grid, (np + N - 1,) the programme's parameters p, then the relative widths D.
            multipliers: guesses of those of the bounds (n,) and of the rows (m,); None for zeros.
            bounds: lower and upper bounds (n,) of the scaled unknowns and (m,) of the rows; None for the programme's.
        """
        began = time.perf_counter()
        if not (np.isfinite(x_0).all() and np.isfinite(known).all()):
            return self._failed(SolverOutcome.NOT_FINITE, SolverOutcome.NOT_FINITE.value, x_0, began)
        self._in["x0"][:], self._in["p"][:] = x_0, known
        limits = self._bounds if bounds is None else bounds
        for name, values in zip(("lbx", "ubx", "lbg", "ubg"), limits, strict=True):
            self._in[name][:] = values
        self._in["lam_x0"][:], self._in["lam_g0"][:] = (0.0, 0.0) if multipliers is None else multipliers
        report = self._solver.solve()
        if report.iterations is None:
            ended = report.outcome is SolverOutcome.LIMIT
            reason = f"{self._name} {report.message if ended else f'gave up: {_last_words(report.message)}'}"
            return self._failed(report.outcome, reason, x_0, began)
        if report.message == "Invalid_Option":
            wrong = (
                f"linear_solver = {self._linear_solver!r} is not in this build of IPOPT, or the log cannot be written"
            )
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
            (out["lam_x"], out["lam_g"]),
            float(out["f"][0]),
            report.iterations,
            1e3 * (time.perf_counter() - began),
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


def _solver(nlp: Programme, options: Options) -> NlpSolver:
    plugin: NlpPlugin = "ipopt" if options.backend.startswith("ipopt") else "fatrop"
    if plugin == "ipopt":
        more = {"honor_original_bounds": "yes"} | (dict(IPOPT_WARM_START) if options.warm else {}) | _own(options)
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
    return NlpSolver(
        "solver",
        plugin,
        {"x": nlp.x, "p": nlp.p, "f": nlp.assembly.f, "g": nlp.assembly.g},
        {"show_eval_warnings": False, **settings},
        _RESULTS,
        seconds=options.seconds,
        compiled=options.backend.endswith("compiled"),
        cache=nlp.assembly.derivatives(plugin),
    )
