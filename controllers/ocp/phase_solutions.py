"""Solutions of problems of several phases: all phases over one normalised time, and each as its own solution."""

from __future__ import annotations

import dataclasses
import math

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.clocks import clock_name
from mathnavi.controllers.ocp.defects import running_costs
from mathnavi.controllers.ocp.dual_solution import own_names
from mathnavi.controllers.ocp.grid import Grid, from_widths
from mathnavi.controllers.ocp.instants import instant_cost
from mathnavi.controllers.ocp.lowering import functions_of
from mathnavi.controllers.ocp.multipliers import Multipliers, NamedValues, distinct
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import GIVEN_NODES, replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.statement import Statement
from mathnavi.controllers.ocp.substitutions import solved
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.short_tables import short_table
from mathnavi.interfaces.signals import Array


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class MultiPhaseSolution:
    """Solution of a problem of several phases; ``solution["boost"]`` is one phase's, its times from its own start."""

    name: str
    stacked: Solution  # solution of all phases over τ in [0, 1], variables named phase.variable
    phases: dict[str, Solution]
    start_times: dict[str, float]  # [s] by phase
    unknowns: dict[str, float] = dataclasses.field(default_factory=dict)  # constants that were found, by name

    @property
    def status(self) -> SolverOutcome:
        """Outcome of the solve."""
        return self.stacked.status

    @property
    def message(self) -> str:
        """Message of the solver and of the method."""
        return self.stacked.message

    @property
    def ok(self) -> bool:
        """True if this is a solution of the problem: solved, and within the tolerance when it is replayed."""
        return self.stacked.ok

    @property
    def cost(self) -> float:
        """J of all phases."""
        return self.stacked.cost

    @property
    def duration(self) -> float:
        """Sum of the durations [s]."""
        return sum(phase.duration for phase in self.phases.values())

    def __getitem__(self, phase: str) -> Solution:
        """The solution of one phase by its name; KeyError names those that exist."""
        if phase not in self.phases:
            raise KeyError(f"{phase!r} is no phase; {allowed_for(str(phase), tuple(self.phases))}")
        return self.phases[phase]

    def __repr__(self) -> str:
        """A short table: how it ended, what it costs, and when each phase begins and ends."""
        lines = [("J", f"{self.cost:.6g}", ""), ("iterations", str(self.stacked.iterations), "")]
        lines += [(name, f"{value:.6g}", "") for name, value in self.unknowns.items()]
        for name, phase in self.phases.items():
            begin = self.start_times[name]
            lines.append((f"phase {name}", f"{begin:.6g} to {begin + phase.duration:.6g}", "s"))
        return f"{short_table(f'{self.name}, {self.stacked.method}: {self.status.value}', lines)}\n  {self.message}"


def phase_solution(stacked: Solution, name: str, phase: Statement, elapsed: float) -> tuple[Solution, float]:
    """A phase of a stacked solution with its replay, and the time [s] at which it begins."""
    assert phase.duration is not None
    states, controls, parameters = (
        [known.index(f"{name}.{each.name}" if f"{name}.{each.name}" in known else each.name) for each in own]
        for known, own in (
            (stacked.problem.states, phase.states),
            (stacked.problem.controls, phase.controls),
            (stacked.problem.parameters, phase.parameters),
        )
    )
    duration = float(stacked[f"{name}.duration"][0]) if phase.duration.free else phase.duration.guess
    start = ca.SX(elapsed) if phase.start_time.is_zero() else phase.start_time
    x, grid = stacked.x[:, states], own_grid(stacked, name)
    begin = float(ca.Function("t_0", [phase.x], [start])(x[0]))
    constants = [float(stacked[v.name][0]) for v in phase.shared]
    problem = functions_of(solved(dataclasses.replace(phase, start_time=start), duration, constants))
    view = dataclasses.replace(
        stacked,
        problem=problem,
        grid=grid,
        duration=duration,
        parameters=stacked.parameters[parameters],
        x=x,
        inner=stacked.inner[:, :, states],
        u=stacked.u[:, :, controls],
        costates=stacked.costates[:, states],
        multipliers=_multipliers(
            stacked, name, problem, states, controls, duration * grid.widths / stacked.grid.widths
        ),
        sensitivities=NamedValues(problem.parameters, stacked.sensitivities.values[parameters]),
        replay=None,
        cost_bound=math.nan,
        linked=True,
    )
    cost = _running_cost(view) + float(problem.terminal_cost(x[-1], duration, view.parameters))
    if problem.instants is not None:
        cost += instant_cost(problem.instants, view.at_instants, view.parameters)
    tolerance = stacked.tolerance if math.isfinite(stacked.tolerance) else GIVEN_NODES
    view = replayed(dataclasses.replace(view, cost=cost), tolerance)
    if view.ok and stacked.status in (SolverOutcome.CONVERGED, SolverOutcome.STATIONARY):
        view = dataclasses.replace(view, status=stacked.status, message=stacked.message)  # no phase is better than all
    return view, begin


def own_grid(stacked: Solution, name: str) -> Grid:
    """The grid of a phase of a stacked solution, its clock at the nodes; that in τ where it has none."""
    if name not in stacked.problem.clocks:
        return stacked.grid
    times = stacked[clock_name(name)]
    return from_widths(np.diff(times)) if (np.diff(times) > 0.0).all() else stacked.grid


def _running_cost(view: Solution) -> float:
    """∫ L dt of a phase by the quadrature of its scheme."""
    count, k, nx = view.inner.shape
    times = view.point_times.ravel()
    rates = running_costs(view, view.inner.reshape(count * k, nx), view.u.reshape(count * k, -1), times)
    return float((rates.reshape(count, k) * view.point_shares).sum())


def _multipliers(
    stacked: Solution, name: str, problem: ProblemFunctions, states: list[int], controls: list[int], seconds: Array
) -> Multipliers:
    """Multipliers of a phase: those along the path are per second of the phase, no longer per unit of τ.

    ``seconds`` (N - 1,) is how long a unit of τ is in each interval.
    """
    whole, of_duration, duration = stacked.multipliers, 0.0, seconds[:, None, None]
    path, initial, final = (
        [k for k, row in enumerate(names) if row.startswith(f"{name}: ")]
        for names in (stacked.problem.path_names, stacked.problem.initial_names, stacked.problem.final_names)
    )
    if problem.free_duration:
        rates = whole.states[f"{name}.duration"]
        of_duration = float((rates * stacked.point_shares).sum() / stacked.duration)
    return Multipliers(
        dynamics=NamedValues(problem.states, whole.dynamics.values[..., states]),
        path=NamedValues(distinct(problem.path_names), whole.path.values[..., path] / duration),
        states=NamedValues(problem.states, whole.states.values[..., states] / duration),
        controls=NamedValues(problem.controls, whole.controls.values[..., controls] / duration),
        initial=NamedValues(own_names(problem.initial_names, "start of "), whole.initial.values[initial]),
        final=NamedValues(own_names(problem.final_names, "end of "), whole.final.values[final]),
        duration=of_duration,
        instants=_at_instants(whole.instants, name, problem),
    )


def _at_instants(whole: NamedValues | None, name: str, problem: ProblemFunctions) -> NamedValues | None:
    """Multipliers of what a phase states at given times, of those of all phases."""
    if whole is None or problem.instants is None:
        return None
    own = [k for k, row in enumerate(whole.names) if row.startswith(f"{name}: ")]
    return NamedValues(distinct(problem.instants.names), whole.values[own])
