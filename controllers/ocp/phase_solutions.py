"""Solutions of problems of several phases: each phase is returned as a separate solution."""

from __future__ import annotations

import dataclasses
import math

import casadi as ca

from mathnavi.controllers.ocp.defects import running_costs
from mathnavi.controllers.ocp.dual_solution import own_names
from mathnavi.controllers.ocp.lowering import functions_of
from mathnavi.controllers.ocp.multipliers import Multipliers, NamedValues, distinct
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import GIVEN_NODES, replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.statement import Statement
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.short_tables import short_table


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class MultiPhaseSolution:
    """Solution of a problem of several phases; ``solution["boost"]`` is one phase's, its times from its own start."""

    name: str
    stacked: Solution  # solution of all phases over τ in [0, 1], variables named phase.variable
    phases: dict[str, Solution]
    start_times: dict[str, float]  # [s] by phase

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
            raise KeyError(f"{phase!r} is no phase; {allowed_for(phase, tuple(self.phases))}")
        return self.phases[phase]

    def __repr__(self) -> str:
        """A short table: how it ended, what it costs, and when each phase begins and ends."""
        lines = [("J", f"{self.cost:.6g}", ""), ("iterations", str(self.stacked.iterations), "")]
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
    x = stacked.x[:, states]
    begin = float(ca.Function("t_0", [phase.x], [start])(x[0]))
    problem = functions_of(dataclasses.replace(phase, start_time=start))
    view = dataclasses.replace(
        stacked,
        problem=problem,
        duration=duration,
        parameters=stacked.parameters[parameters],
        x=x,
        inner=stacked.inner[:, :, states],
        u=stacked.u[:, :, controls],
        costates=stacked.costates[:, states],
        multipliers=_multipliers(stacked, name, problem, states, controls, duration),
        sensitivities=NamedValues(problem.parameters, stacked.sensitivities.values[parameters]),
        replay=None,
    )
    cost = _running_cost(view) + float(problem.terminal_cost(x[-1], duration, view.parameters))
    tolerance = stacked.tolerance if math.isfinite(stacked.tolerance) else GIVEN_NODES
    return replayed(dataclasses.replace(view, cost=cost), tolerance), begin


def _running_cost(view: Solution) -> float:
    """∫ L dt of a phase by the quadrature of its scheme."""
    count, k, nx = view.inner.shape
    times = view.point_times.ravel()
    rates = running_costs(view, view.inner.reshape(count * k, nx), view.u.reshape(count * k, -1), times)
    return float((rates.reshape(count, k) * view.point_shares).sum())


def _multipliers(
    stacked: Solution, name: str, problem: ProblemFunctions, states: list[int], controls: list[int], duration: float
) -> Multipliers:
    """Multipliers of a phase: those along the path are per second of the phase, no longer per unit of τ."""
    whole, of_duration = stacked.multipliers, 0.0
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
    )
