"""The numerical solvers behind a programme: IPOPT, or FATROP with its stages, in CasADi's virtual machine or compiled.

A solver is called again and again with other guesses and parameters, on line within milliseconds, so its arguments and
results live in buffers. Whatever happens in it ends as a status.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from mathnavi.controllers.compilation import compiled
from mathnavi.controllers.ocp.nlp import Programme
from mathnavi.controllers.ocp.solution import Outcome
from mathnavi.models.buffered_function import BufferedFunction
from mathnavi.sim.interfaces.bounds import Count, Probability, configuration
from mathnavi.sim.interfaces.signals import Array

Backend = Literal["ipopt", "fatrop", "fatrop-compiled", "ipopt-compiled"]

_REASONS = {  # return_status of IPOPT
    "Infeasible_Problem_Detected": Outcome.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Outcome.LIMIT,
    "Maximum_CpuTime_Exceeded": Outcome.LIMIT,
    "Invalid_Number_Detected": Outcome.NOT_FINITE,
    "Restoration_Failed": Outcome.INFEASIBLE,
}
_IPOPT_WARM = {
    "warm_start_init_point": "yes",
    "warm_start_bound_push": 1e-9,
    "warm_start_bound_frac": 1e-9,
    "warm_start_slack_bound_push": 1e-9,
    "warm_start_slack_bound_frac": 1e-9,
    "warm_start_mult_bound_push": 1e-9,
    "mu_init": 1e-4,
}
_FATROP_WARM = {"mu_init": 1e-5}
_RESULTS = ("x", "f", "g", "lam_x", "lam_g")


@configuration
class Options:
    """How to solve.

    FATROP raises its regularisation without end on some problems without a feasible point: it may not return, whatever
    the limit of iterations. Use IPOPT where there may be no feasible point.
    """

    backend: Backend = "ipopt"
    tolerance: Probability = 1e-9  # of the scaled optimality conditions
    iterations: Count = 500
    warm: bool = False  # whether guesses are near solutions: start close to the bounds, with a small barrier


@dataclass(frozen=True, eq=False)
class Answer:
    """What a solver said."""

    status: Outcome
    message: str
    x: Array  # (n,) unknowns, its last iterate if it failed
    multipliers: tuple[Array, Array]  # of the bounds (n,) and of the rows (m,)
    cost: float
    iterations: int
    solve_ms: float  # wall-clock time

    @property
    def ok(self) -> bool:
        return self.status is Outcome.OPTIMAL


class NumericalSolver:
    """One of CasADi's NLP solvers for a programme."""

    def __init__(self, nlp: Programme, options: Options) -> None:
        function = _nlpsol(nlp, options)
        self._name = options.backend
        self._in = {name: np.zeros(function.nnz_in(name)) for name in function.name_in()}
        self._out = {name: np.zeros(function.nnz_out(name)) for name in _RESULTS}
        self._evaluate = BufferedFunction(
            function, list(self._in.values()), [self._out.get(name) for name in function.name_out()]
        )
        for name, limits in (("lbx", nlp.x_lower), ("ubx", nlp.x_upper), ("lbg", nlp.lower), ("ubg", nlp.upper)):
            self._in[name][:] = limits

    def solve(self, x_0: Array, known: Array, multipliers: tuple[Array, Array] | None = None) -> Answer:
        """The answer from a guess of the unknowns and, if given, of the multipliers, at the programme's parameters."""
        began = time.perf_counter()
        if not (np.isfinite(x_0).all() and np.isfinite(known).all()):
            return self._failed(Outcome.NOT_FINITE, Outcome.NOT_FINITE.value, x_0, began)
        self._in["x0"][:], self._in["p"][:] = x_0, known
        self._in["lam_x0"][:], self._in["lam_g0"][:] = (0.0, 0.0) if multipliers is None else multipliers
        try:
            self._evaluate()
        except RuntimeError as error:  # FATROP's way to give up
            return self._failed(Outcome.FAILED, f"{self._name} raised an exception: {_last_words(error)}", x_0, began)
        statistics = self._evaluate.stats()
        message, out = str(statistics["return_status"]), {name: array.copy() for name, array in self._out.items()}
        if not all(np.isfinite(out[name]).all() for name in ("x", "f", "g")):  # FATROP calls even that a success
            return self._failed(Outcome.NOT_FINITE, Outcome.NOT_FINITE.value, x_0, began)
        return Answer(
            Outcome.OPTIMAL if statistics["success"] else _REASONS.get(message, Outcome.FAILED),
            message,
            out["x"],
            (out["lam_x"], out["lam_g"]),
            float(out["f"][0]),
            int(statistics["iter_count"]),
            1e3 * (time.perf_counter() - began),
        )

    def _failed(self, status: Outcome, message: str, x_0: Array, began: float) -> Answer:
        nothing = np.zeros_like(self._out["lam_x"]), np.zeros_like(self._out["lam_g"])
        return Answer(status, message, x_0, nothing, np.nan, 0, 1e3 * (time.perf_counter() - began))


def _last_words(error: RuntimeError) -> str:
    """What a solver said of its failure, without the place in its sources."""
    return str(error).strip().splitlines()[-1].rpartition("] ")[2].rpartition(": ")[2]


def _nlpsol(nlp: Programme, options: Options) -> ca.Function:
    plugin = options.backend.removesuffix("-compiled")
    functions = {"x": nlp.x, "p": nlp.p, "f": nlp.assembly.f, "g": nlp.assembly.g}
    settings: dict[str, Any] = {"print_time": False, "calc_lam_p": False, "show_eval_warnings": False}
    if plugin == "ipopt":
        settings["ipopt"] = {
            "print_level": 0,
            "sb": "yes",
            "tol": options.tolerance,
            "max_iter": options.iterations,
            "honor_original_bounds": "yes",
        } | (_IPOPT_WARM if options.warm else {})
    else:
        n, layout = nlp.layout.nodes - 1, nlp.layout
        settings |= {
            "structure_detection": "manual",
            "nx": [layout.state_size] * (n + 1),
            "nu": [layout.input_size] * n + [layout.last_input_size],
            "ng": list(nlp.path_rows),
            "N": n,
            "equality": nlp.equality,
            "fatrop": {"print_level": 0, "tolerance": options.tolerance, "max_iter": options.iterations}
            | (_FATROP_WARM if options.warm else {}),
        }
    solver = ca.nlpsol("solver", plugin, functions, settings | {"cache": nlp.assembly.derivatives(plugin)})
    if options.backend.endswith("compiled"):
        solver = ca.nlpsol("solver", plugin, str(compiled(solver)), settings)
    return solver
