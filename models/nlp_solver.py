"""CasADi's NLP solvers for any programme: IPOPT, or FATROP with its stages, interpreted or compiled.

    minimise f(x, p)    subject to    lbg <= g(x, p) <= ubg,    lbx <= x <= ubx.

A solver is called again and again with other guesses and parameters, online within milliseconds, so its arguments and
results live in buffers. Every outcome of a call is a status.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

import casadi as ca
import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.buffered_function import BufferedFunction
from mathnavi.models.compilation import compiled as compiled_functions
from mathnavi.models.solver_process import ProcessReport, RemoteSolver

NlpPlugin = Literal["ipopt", "fatrop"]


class SolverOutcome(Enum):
    """Outcome of a solve; the value is the message for the user.

    A solver itself reports at most ``CONVERGED``: only the replay in the true dynamics shows whether the solution of a
    transcribed programme solves the problem.
    """

    OPTIMAL = "a local optimum, within the tolerance when it is replayed"
    CONVERGED = "the programme is solved, but not shown to be accurate"
    STATIONARY = "the first-order conditions hold, but not what a minimum needs beyond them"
    REFUSED = "the adaptive solution replays worse than the uniform one, which is returned in its place"
    UNBOUNDED = "nothing that was stated bounds the solution"
    INFEASIBLE = "no point is feasible, which is proved"
    NO_FEASIBLE_POINT = "no feasible point was found from any start, which proves nothing"
    OVERDETERMINED = "there are more equations than unknowns"
    LIMIT = "the solver stopped at its limit of iterations or of time"
    NOT_FINITE = "the problem or its guess holds NaN or infinity"
    FAILED = "the solver gave up"


_REASONS = {  # return_status of IPOPT
    "Infeasible_Problem_Detected": SolverOutcome.NO_FEASIBLE_POINT,
    "Maximum_Iterations_Exceeded": SolverOutcome.LIMIT,
    "Maximum_CpuTime_Exceeded": SolverOutcome.LIMIT,
    "Invalid_Number_Detected": SolverOutcome.NOT_FINITE,
    "Restoration_Failed": SolverOutcome.NO_FEASIBLE_POINT,
    "Diverging_Iterates": SolverOutcome.UNBOUNDED,
    "Not_Enough_Degrees_Of_Freedom": SolverOutcome.OVERDETERMINED,
}
IPOPT_WARM_START: Mapping[str, Any] = {
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-9,
    "warm_start_bound_frac": 1e-9,
    "warm_start_slack_bound_push": 1e-9,
    "warm_start_slack_bound_frac": 1e-9,
    "warm_start_mult_bound_push": 1e-9,
    "mu_init": 1e-4,
}
"""options of a warm start, which stays where it is: the usual push away from the bounds would undo it"""


@dataclass(frozen=True)
class StageStructure:
    """Stages of a programme as FATROP needs them: N + 1 states with N or N + 1 inputs between them."""

    states: Sequence[int]  # (N + 1,) sizes
    inputs: Sequence[int]  # (N + 1,) sizes, the last one after the last state
    path_rows: Sequence[int]  # (N + 1,) constraints of each stage besides its gap
    equality: Sequence[bool]  # (m,) of the rows of g


def ipopt_settings(tolerance: float, iterations: int, more: Mapping[str, Any]) -> dict[str, Any]:
    """Settings for ``NlpSolver`` with IPOPT, silent; ``more`` are additional options of IPOPT."""
    return {"ipopt": {"print_level": 0, "sb": "yes", "tol": tolerance, "max_iter": iterations, **more}}


def fatrop_settings(
    stages: StageStructure, tolerance: float, iterations: int, more: Mapping[str, Any]
) -> dict[str, Any]:
    """Settings for ``NlpSolver`` with FATROP, silent; ``more`` are additional options of FATROP."""
    return {
        "structure_detection": "manual",
        "nx": list(stages.states),
        "nu": list(stages.inputs),
        "ng": list(stages.path_rows),
        "N": len(stages.states) - 1,
        "equality": list(stages.equality),
        "fatrop": {"print_level": 0, "tolerance": tolerance, "max_iter": iterations, **more},
    }


@dataclass(frozen=True)
class NlpReport:
    """Report on a call of a solver."""

    outcome: SolverOutcome
    message: str  # the solver's return status, or the last line of the exception that it raised
    iterations: int | None  # None if it raised an exception or did not return


class NlpSolver:
    """One of CasADi's NLP solvers with buffers for its arguments and results.

    ``functions`` are x, p, f and g, ``settings`` those of ``ipopt_settings`` or ``fatrop_settings`` and ``results`` the
    names of the outputs that are kept. ``seconds`` is the CPU time [s] after which a solve is ended: IPOPT checks it in
    every iteration, FATROP, which may not return from one, runs in a separate process (see ``solver_process``).
    ``cache`` contains precomputed derivatives. ``compiled`` translates the functions to C once (seconds, kept
    in the user's cache folder); otherwise they run in CasADi's virtual machine.

    Raises FileNotFoundError if there is no C compiler named cc, and OSError if it fails.
    """

    def __init__(
        self,
        name: str,
        plugin: NlpPlugin,
        functions: Mapping[str, ca.MX],
        settings: Mapping[str, Any],
        results: Sequence[str],
        *,
        seconds: float,
        compiled: bool = False,
        cache: Mapping[str, Any] | None = None,
    ) -> None:
        # CasADi would count equations in every call, and print a warning; what is one is the status OVERDETERMINED.
        options = {"print_time": False, "calc_lam_p": False, "inputs_check": False, **settings}
        if plugin == "ipopt":
            options["ipopt"] = {**options.get("ipopt", {}), "max_cpu_time": seconds}
        known = {} if cache is None else {"cache": cache}
        function = ca.nlpsol(name, plugin, dict(functions), options | known)
        if compiled:
            function = ca.nlpsol(name, plugin, str(compiled_functions(function)), options)
        self.inputs = {key: np.zeros(function.nnz_in(key)) for key in function.name_in()}
        every = {key: np.zeros(function.nnz_out(key)) for key in function.name_out()}
        self.outputs: dict[str, Array] = {key: every[key] for key in results}
        arguments, places = list(self.inputs.values()), list(every.values())
        self._seconds = seconds
        self._solver: RemoteSolver | _LocalSolver
        if plugin == "fatrop":
            self._solver = RemoteSolver(function, arguments, places)
        else:
            self._solver = _LocalSolver(function, arguments, places)

    def solve(self) -> NlpReport:
        """Solve with the values in ``inputs``; the solution, or the last iterate, is in ``outputs`` afterwards."""
        report = self._solver.solve(self._seconds)
        if report.timed_out:
            return NlpReport(SolverOutcome.LIMIT, report.message, report.iterations)
        outcome = SolverOutcome.CONVERGED if report.success else _REASONS.get(report.message, SolverOutcome.FAILED)
        return NlpReport(outcome, report.message, report.iterations)


class _LocalSolver:
    """A solver in this process, which enforces the time limit itself."""

    def __init__(self, function: ca.Function, arguments: Sequence[Array], results: Sequence[Array]) -> None:
        self._evaluate = BufferedFunction(function, arguments, results)

    def solve(self, seconds: float) -> ProcessReport:
        try:
            self._evaluate()
        except RuntimeError as error:
            return ProcessReport(False, str(error).strip().splitlines()[-1], None)
        statistics = self._evaluate.stats()
        return ProcessReport(
            bool(statistics["success"]), str(statistics["return_status"]), int(statistics["iter_count"])
        )
