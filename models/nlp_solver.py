"""CasADi's NLP solvers for any programme: IPOPT, or FATROP with its stages, interpreted or compiled.

    minimise f(x, p)    subject to    lbg <= g(x, p) <= ubg,    lbx <= x <= ubx.

A solver is called again and again with other guesses and parameters, online within milliseconds, so its arguments and
results live in buffers. Every outcome of a call is a status.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal, Protocol

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
    INTERRUPTED = "the call was interrupted, and this is the best that it had"
    NOT_FINITE = "the problem or its guess holds NaN or infinity"
    FAILED = "the solver gave up"


_REASONS = {  # return_status of IPOPT
    "Infeasible_Problem_Detected": SolverOutcome.NO_FEASIBLE_POINT,
    "Maximum_Iterations_Exceeded": SolverOutcome.LIMIT,
    "Maximum_CpuTime_Exceeded": SolverOutcome.LIMIT,
    "User_Requested_Stop": SolverOutcome.INTERRUPTED,
    "Invalid_Number_Detected": SolverOutcome.NOT_FINITE,
    "Restoration_Failed": SolverOutcome.NO_FEASIBLE_POINT,
    "Diverging_Iterates": SolverOutcome.UNBOUNDED,
    "Not_Enough_Degrees_Of_Freedom": SolverOutcome.OVERDETERMINED,
}
_F, _G = 1, 2  # places of f and g among what an iterate is shown by
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


class Watch(Protocol):
    """Observer of a solve, which may stop it."""

    def iterated(self, f: float, violation: float) -> bool:
        """Take note of an iterate: f, and the largest violation of lbg <= g <= ubg. True stops the solve there."""
        ...

    @property
    def stopped(self) -> bool:
        """True if the solve has to end."""
        ...


class NlpSolver:
    """One of CasADi's NLP solvers with buffers for its arguments and results.

    ``functions`` are x, p, f and g, ``settings`` those of ``ipopt_settings`` or ``fatrop_settings`` and ``results`` the
    names of the outputs that are kept. ``seconds`` is the CPU time [s] after which a solve is ended: IPOPT checks it in
    every iteration, FATROP, which may not return from one, runs in a separate process (see ``solver_process``).
    ``cache`` contains precomputed derivatives. A solver that is ``watched`` shows its iterates to the ``Watch`` of a
    call; that costs IPOPT some time in each, and changes none of them. ``compiled`` translates the functions to C once
    (seconds, kept in the user's cache folder); otherwise they run in CasADi's virtual machine.

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
        watched: bool = False,
    ) -> None:
        # CasADi would count equations in every call, and print a warning; what is one is the status OVERDETERMINED.
        options = {"print_time": False, "calc_lam_p": False, "inputs_check": False, **settings}
        if plugin == "ipopt":
            options["ipopt"] = {**options.get("ipopt", {}), "max_cpu_time": seconds}
        known = {} if cache is None else {"cache": cache}
        self.watched, self._iterates = watched, None
        if watched and plugin == "ipopt":
            self._iterates = _Iterates({key: functions[key].numel() for key in ("x", "g", "p")})
        seen = {} if self._iterates is None else {"iteration_callback": self._iterates}
        function = ca.nlpsol(name, plugin, dict(functions), options | known | ({} if compiled else seen))
        if compiled:
            function = ca.nlpsol(name, plugin, str(compiled_functions(function)), options | seen)
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

    def solve(self, watch: Watch | None = None) -> NlpReport:
        """Solve with the values in ``inputs``; the solution, or the last iterate, is in ``outputs`` afterwards.

        ``watch`` is for a solver that is watched. An exception that it raises ends the solve, and passes; so does a
        KeyboardInterrupt. FATROP, which shows no iterates, is stopped by it all the same, and leaves no iterate.
        """
        if self._iterates is None:
            report = self._solver.solve(self._seconds, watch if self.watched else None)
        else:
            with self._iterates.shown_to(watch, self.inputs):
                report = self._solver.solve(self._seconds, None)
        if report.timed_out:
            return NlpReport(SolverOutcome.LIMIT, report.message, report.iterations)
        if report.stopped:
            return NlpReport(SolverOutcome.INTERRUPTED, report.message, report.iterations)
        outcome = SolverOutcome.CONVERGED if report.success else _REASONS.get(report.message, SolverOutcome.FAILED)
        return NlpReport(outcome, report.message, report.iterations)


class _LocalSolver:
    """A solver in this process, which enforces the time limit itself."""

    def __init__(self, function: ca.Function, arguments: Sequence[Array], results: Sequence[Array]) -> None:
        self._evaluate = BufferedFunction(function, arguments, results)

    def solve(self, seconds: float, watch: Watch | None) -> ProcessReport:
        try:
            self._evaluate()
        except RuntimeError as error:
            return ProcessReport(False, str(error).strip().splitlines()[-1], None)
        except SystemError as error:  # CasADi looks for signals while it evaluates, and returns as if there were none
            if isinstance(error.__cause__, KeyboardInterrupt):
                raise error.__cause__ from None
            raise
        statistics = self._evaluate.stats()
        return ProcessReport(
            bool(statistics["success"]), str(statistics["return_status"]), int(statistics["iter_count"])
        )


class _Iterates(ca.Callback):
    """Function that IPOPT calls with each of its iterates; what it returns says whether IPOPT stops there."""

    def __init__(self, sizes: Mapping[str, int]) -> None:
        """Build the function of a programme of these numbers of unknowns "x", of rows "g" and of parameters "p"."""
        ca.Callback.__init__(self)
        self._sizes = {"f": 1} | {f"lam_{key}": size for key, size in sizes.items()} | dict(sizes)
        self._watch: Watch | None = None
        self._limits = np.empty(0), np.empty(0)
        self._raised: BaseException | None = None
        self.construct("iterates", {})

    @contextmanager
    def shown_to(self, watch: Watch | None, inputs: Mapping[str, Array]) -> Iterator[None]:
        """Show the iterates of the solve within the block; what is raised meanwhile is raised at its end."""
        self._watch, self._limits, self._raised = watch, (inputs["lbg"], inputs["ubg"]), None
        try:
            yield
        finally:
            self._watch = None
        if self._raised is not None:
            raise self._raised

    # the names are CasADi's

    def get_n_in(self) -> int:
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        return 1

    def get_name_in(self, i: int) -> str:
        return str(ca.nlpsol_out(i))

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(i)])

    def has_eval_buffer(self) -> bool:
        return True

    def eval_buffer(self, arg: Sequence[Any], res: Sequence[Any]) -> int:
        """Write 1 to the result to stop, else 0: an exception would be printed by CasADi, and lost."""
        stop = False
        try:
            if self._watch is not None:
                f, g = (np.frombuffer(arg[k]) if arg[k] is not None else np.empty(0) for k in (_F, _G))
                lower, upper = self._limits
                violation = float(np.maximum(lower - g, g - upper).max(initial=0.0))
                stop = self._watch.iterated(float(f[0]), violation)
        except BaseException as error:
            self._raised, stop = error, True
        np.frombuffer(res[0])[0] = float(stop)
        return 0
