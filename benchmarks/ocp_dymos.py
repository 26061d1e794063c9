"""A problem of ``mathnavi.controllers.ocp`` as dymos takes it.

dymos collocates at Legendre-Gauss-Radau points inside OpenMDAO and refines its grid by segment and by order (``hp``).
The optimiser is SciPy's SLSQP, the only one for it that comes from the package index: dense, so time grows with the
third power of the number of unknowns. With SNOPT or IPOPT through pyOptSparse, which has to be built by hand, dymos is
faster. The dynamics are the problem's CasADi functions, all nodes at once, with their sparse derivatives; states and
controls are over the problem's scales.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import tempfile
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

NAME = "dymos, SLSQP"
ORDER, SEGMENTS, REFINEMENTS = 3, 6, 8  # of the first grid, and how often it may be refined


def prepared(problem: ProblemFunctions, tolerance: float) -> Callable[[], float | None]:
    """Function that solves the problem to dymos' ``tolerance`` and returns J, None where the optimiser failed."""
    os.environ["OPENMDAO_REPORTS"] = "0"  # before OpenMDAO is imported: it would write folders of them
    with _quietly():
        import dymos as dm

        model, phase = _stated(problem, tolerance)

    def solved() -> float | None:
        with _quietly():
            model.setup()
            _guess(problem, phase)
            result = dm.run_problem(
                model,
                refine_iteration_limit=REFINEMENTS,
                refine_method="hp",
                make_plots=False,
                solution_record_file=None,
            )
            ends = [model.get_val(f"flight.phase.timeseries.x{i}")[-1, 0] for i in range(problem.nx)]
            T = float(model.get_val("flight.phase.timeseries.time")[-1, 0])
            gathered = float(model.get_val("flight.phase.timeseries.gathered")[-1, 0])
        terminal = float(problem.terminal_cost(np.array(ends) * problem.state_scale, T, problem.nominal))
        return terminal + gathered if result.success else None

    return solved


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """Without what it prints, and in a folder of its own for what it writes."""
    with (
        tempfile.TemporaryDirectory() as folder,
        contextlib.chdir(folder),
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        yield


def _stated(problem: ProblemFunctions, tolerance: float) -> tuple[Any, Any]:
    import dymos as dm
    import openmdao.api as om

    model = om.Problem()
    model.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", maxiter=500, tol=1e-7, disp=False)
    model.driver.declare_coloring(show_summary=False)
    phase = dm.Phase(ode_class=_dynamics(problem), transcription=dm.Radau(num_segments=SEGMENTS, order=ORDER))
    trajectory = dm.Trajectory()
    trajectory.add_phase("phase", phase)
    model.model.add_subsystem("flight", trajectory)
    shortest, longest = problem.duration_bounds
    length = {"duration_bounds": (shortest, longest)} if problem.free_duration else {"fix_duration": True}
    phase.set_time_options(units=None, fix_initial=True, targets=["t"], **length)
    for i, scale in enumerate(problem.state_scale):
        lower, upper = (_limit(side[i] / scale) for side in problem.state_bounds)
        phase.add_state(f"x{i}", rate_source=f"f{i}", targets=[f"x{i}"], lower=lower, upper=upper)
    phase.add_state("gathered", rate_source="L", fix_initial=True)  # ∫ L dt
    for i, scale in enumerate(problem.control_scale):
        lower, upper = (_limit(side[i] / scale) for side in problem.control_bounds)
        free = {"continuity": False, "rate_continuity": False}
        phase.add_control(f"u{i}", targets=[f"u{i}"], lower=lower, upper=upper, **free)
    for k, (low, high) in enumerate(zip(*problem.path_bounds, strict=True)):
        phase.add_path_constraint(f"d{k}", lower=_limit(low), upper=_limit(high))
    for where, i, value in _fixed_ends(problem):
        phase.add_boundary_constraint(f"x{i}", loc=where, equals=value)
    _minimise(problem, phase)
    phase.set_refine_options(refine=True, tol=tolerance)
    return model, phase


def _dynamics(problem: ProblemFunctions) -> Any:
    """The component that evaluates (f / scale, L, d) at all nodes, with its derivatives."""
    import openmdao.api as om

    x, u, t = ca.SX.sym("x", problem.nx), ca.SX.sym("u", problem.nu), ca.SX.sym("t")
    scale, p = ca.DM(problem.state_scale), ca.DM(problem.nominal)
    X, U = x * scale, u * ca.DM(problem.control_scale)
    rates, running, path = (f(X, U, t, p) for f in (problem.dynamics, problem.running_cost, problem.path))
    result = ca.vertcat(rates / scale, running, path)
    known = ca.vertcat(x, u, t)
    slope = ca.jacobian(result, known)
    where = list(zip(*slope.sparsity().get_triplet(), strict=True))
    values, slopes = (
        ca.Function("values", [known], [result]),
        ca.Function("slopes", [known], [slope.nz[:]]),
    )
    inputs = [*(f"x{i}" for i in range(problem.nx)), *(f"u{i}" for i in range(problem.nu)), "t"]
    outputs = [*(f"f{i}" for i in range(problem.nx)), "L", *(f"d{k}" for k in range(len(problem.path_bounds.lower)))]

    class Dynamics(om.ExplicitComponent):
        def initialize(self) -> None:
            self.options.declare("num_nodes", types=int)

        def setup(self) -> None:
            n = self.options["num_nodes"]
            for name in inputs:
                self.add_input(name, shape=(n,))
            for name in outputs:
                self.add_output(name, shape=(n,))
            for i, j in where:
                self.declare_partials(outputs[i], inputs[j], rows=np.arange(n), cols=np.arange(n))

        def compute(self, inputs_: Any, outputs_: Any) -> None:
            for name, row in zip(outputs, self._mapped(values, inputs_), strict=True):
                outputs_[name] = row

        def compute_partials(self, inputs_: Any, partials: Any) -> None:
            for (i, j), row in zip(where, self._mapped(slopes, inputs_), strict=True):
                partials[outputs[i], inputs[j]] = row

        def _mapped(self, function: ca.Function, inputs_: Any) -> Any:
            return function.map(self.options["num_nodes"])(np.vstack([inputs_[name] for name in inputs])).full()

    return Dynamics


def _limit(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _fixed_ends(problem: ProblemFunctions) -> Iterator[tuple[str, int, float]]:
    """(initial or final, i, value over the scale) of each end condition; ValueError if one is not x_i = value."""
    x, T, p = ca.SX.sym("x", problem.nx), ca.SX.sym("T"), ca.DM(problem.nominal)
    for where, conditions, bounds in (
        ("initial", problem.initial(x, p), problem.initial_bounds),
        ("final", problem.final(x, T, p), problem.final_bounds),
    ):
        slopes = ca.DM(ca.jacobian(conditions, x)).full()
        at_zero = ca.DM(ca.substitute(conditions, x, ca.SX.zeros(problem.nx))).full()[:, 0]
        for slope, offset, lower, upper in zip(slopes, at_zero, *bounds, strict=True):
            named = np.flatnonzero(slope)
            if len(named) != 1 or lower != upper:
                raise ValueError(f"{problem.name}: an end condition is no fixed state; allowed: x_i = value")
            i = int(named[0])
            yield where, i, float((lower - offset) / slope[i] / problem.state_scale[i])


def _minimise(problem: ProblemFunctions, phase: Any) -> None:
    """dymos minimises one variable: T, a final state or ∫ L dt."""
    x, T = ca.SX.sym("x", problem.nx), ca.SX.sym("T")
    terminal = problem.terminal_cost(x, T, ca.DM(problem.nominal))
    slopes = ca.DM(ca.substitute(ca.gradient(terminal, ca.vertcat(x, T)), ca.vertcat(x, T), 0)).full()[:, 0]
    named = np.flatnonzero(slopes)
    if len(named) == 0:
        phase.add_objective("gathered", loc="final")
    elif named[0] == problem.nx:
        phase.add_objective("time", loc="final")
    else:
        phase.add_objective(f"x{named[0]}", loc="final", scaler=float(np.sign(slopes[named[0]])))


def _guess(problem: ProblemFunctions, phase: Any) -> None:
    times = problem.guess_times * problem.guess_duration
    phase.set_time_val(initial=0.0, duration=problem.guess_duration)
    for i, scale in enumerate(problem.state_scale):
        phase.set_state_val(f"x{i}", vals=problem.guess_states[:, i] / scale, time_vals=times)
    phase.set_state_val("gathered", vals=[0.0, 1.0])
    for i, scale in enumerate(problem.control_scale):
        phase.set_control_val(f"u{i}", vals=problem.guess_controls[:, i] / scale, time_vals=times)
