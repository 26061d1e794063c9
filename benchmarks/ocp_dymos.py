"""A problem of ``mathnavi.controllers.ocp`` stated for dymos: a trajectory of one phase and its refinement.

dymos collocates at Legendre-Gauss-Radau points inside OpenMDAO and refines its grid by segment and by order (``hp``).
The optimiser is SciPy's SLSQP, the only one that is available from the package index. It is dense, so its time grows
with the third power of the number of unknowns. With SNOPT or IPOPT through pyOptSparse, which has to be built from
source, dymos is faster. The ordinary differential equation is one component, evaluated at all nodes at once with its
sparse derivatives; it also returns the cost so far, Psi(x, t) + ∫ L dt, whose last value is the objective, and the
constrained quantities. Fixed values of single states at the ends are stated as fixed. States and controls are divided
by the problem's scales.
"""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
import warnings
from collections.abc import Iterator
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.ocp_trajectory import End, Trajectory, control_limits, ends, finite, limits
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions

ORDER, SEGMENTS, REFINEMENTS = 3, 8, 10  # of the first grid, and how often it may be refined


def solved(problem: ProblemFunctions, tolerance: float) -> Trajectory | None:
    """Return the solution to dymos' refinement ``tolerance``; None if the optimiser failed."""
    os.environ["OPENMDAO_REPORTS"] = "0"  # before OpenMDAO is imported: it would write folders of them
    with _quietly():
        import dymos as dm

        model, phase = _stated(problem, tolerance)
        model.setup()
        _guess(problem, phase)
        result = dm.run_problem(
            model,
            refine_iteration_limit=REFINEMENTS,
            refine_method="hp",
            make_plots=False,
            solution_record_file=None,
        )
        return _trajectory(problem, model, phase) if result.success else None


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """Discard printed output and warnings, and work in a temporary folder."""
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
    model.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", maxiter=500, tol=min(1e-7, 0.01 * tolerance), disp=False)
    model.driver.declare_coloring(show_summary=False)
    phase = dm.Phase(ode_class=_dynamics(problem), transcription=dm.Radau(num_segments=SEGMENTS, order=ORDER))
    trajectory = dm.Trajectory()
    trajectory.add_phase("phase", phase)
    model.model.add_subsystem("flight", trajectory)
    shortest, longest = problem.duration_bounds
    length = {"duration_bounds": (shortest, longest)} if problem.free_duration else {"fix_duration": True}
    phase.set_time_options(units=None, fix_initial=True, targets=["t"], **length)
    start, end = ends(problem)
    for i, (lower, upper) in enumerate(limits(problem.state_bounds, problem.state_scale)):
        fixed = {"fix_initial": i in start.fixed, "fix_final": i in end.fixed}
        phase.add_state(f"x{i}", rate_source=f"f{i}", targets=[f"x{i}"], lower=lower, upper=upper, **fixed)
    phase.add_state("gathered", rate_source="L", targets=["gathered"], fix_initial=True)  # ∫ L dt
    for i, (lower, upper) in enumerate(control_limits(problem)):
        free = {"continuity": False, "rate_continuity": False}
        phase.add_control(f"u{i}", targets=[f"u{i}"], lower=lower, upper=upper, **free)
    for k, (low, high) in enumerate(zip(*problem.path_bounds, strict=True)):
        phase.add_path_constraint(f"d{k}", lower=finite(low), upper=finite(high))
    for where, name, own, bounds in (
        ("initial", "i", start, problem.initial_bounds),
        ("final", "s", end, problem.final_bounds),
    ):
        for k in own.others:
            low, high = float(bounds.lower[k]), float(bounds.upper[k])
            given = {"equals": low} if low == high else {"lower": finite(low), "upper": finite(high)}
            phase.add_boundary_constraint(f"{name}{k}", loc=where, **given)
    phase.add_objective("J", loc="final")
    phase.set_refine_options(refine=True, tol=tolerance)
    return model, phase


def _dynamics(problem: ProblemFunctions) -> Any:
    """Return the component that evaluates (f / scale, L, d, i, s, cost so far) at all nodes, with its derivatives."""
    import openmdao.api as om

    x, u, t = ca.SX.sym("x", problem.nx), ca.SX.sym("u", problem.nu), ca.SX.sym("t")
    gathered = ca.SX.sym("gathered")
    scale, p = ca.DM(problem.state_scale), ca.DM(problem.nominal)
    X, U = x * scale, u * ca.DM(problem.control_scale)
    rates, running, path = (f(X, U, t, p) for f in (problem.dynamics, problem.running_cost, problem.path))
    first, last = problem.initial(X, p), problem.final(X, t, p)
    cost = problem.terminal_cost(X, t, p) + gathered
    result = ca.vertcat(rates / scale, running, path, first, last, cost)
    known = ca.vertcat(x, u, t, gathered)
    slope = ca.jacobian(result, known)
    where = list(zip(*slope.sparsity().get_triplet(), strict=True))
    values, slopes = (
        ca.Function("values", [known], [result]),
        ca.Function("slopes", [known], [slope.nz[:]]),
    )
    inputs = [*(f"x{i}" for i in range(problem.nx)), *(f"u{i}" for i in range(problem.nu)), "t", "gathered"]
    counted = (("f", rates), ("d", path), ("i", first), ("s", last))
    named = {letter: [f"{letter}{k}" for k in range(rows.shape[0])] for letter, rows in counted}
    outputs = [*named["f"], "L", *named["d"], *named["i"], *named["s"], "J"]

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


def _guess(problem: ProblemFunctions, phase: Any) -> None:
    times = problem.guess_times * problem.guess_duration
    phase.set_time_val(initial=0.0, duration=problem.guess_duration)
    fixed: tuple[End, End] = ends(problem)
    for i, scale in enumerate(problem.state_scale):
        values = problem.guess_states[:, i] / scale
        for place, end in zip((0, -1), fixed, strict=True):
            values[place] = end.fixed.get(i, values[place])
        phase.set_state_val(f"x{i}", vals=values, time_vals=times)
    phase.set_state_val("gathered", vals=[0.0, 1.0])
    for i, scale in enumerate(problem.control_scale):
        phase.set_control_val(f"u{i}", vals=problem.guess_controls[:, i] / scale, time_vals=times)


def _trajectory(problem: ProblemFunctions, model: Any, phase: Any) -> Trajectory:
    """Return the trajectory found: controls at all nodes of each segment, states at the ends of the segments."""
    grid = phase.options["transcription"].grid_data

    def series(name: str) -> Any:
        return np.array(model.get_val(f"flight.phase.timeseries.{name}"))[:, 0]

    x = np.array([series(f"x{i}") * scale for i, scale in enumerate(problem.state_scale)]).T
    u = np.array([series(f"u{i}") * scale for i, scale in enumerate(problem.control_scale)]).T
    spans = [(int(first), int(beyond)) for first, beyond in grid.subset_segment_indices["all"]]
    fractions = 0.5 * (np.array(grid.node_stau) + 1.0)
    T = float(series("time")[-1])
    return Trajectory(
        problem,
        T,
        0.5 * (np.array(grid.segment_ends) + 1.0),
        np.vstack([x[[first for first, _ in spans]], x[-1]]),
        tuple(fractions[first:beyond] for first, beyond in spans),
        tuple(u[first:beyond] for first, beyond in spans),
        float(problem.terminal_cost(x[-1], T, problem.nominal)) + float(series("gathered")[-1]),
    )
