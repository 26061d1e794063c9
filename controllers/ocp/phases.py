"""Problems of several phases, stacked on one normalised time τ in [0, 1] (after Betts; as in GPOPS-II).

Each phase k has its own states, controls, dynamics, constraints, cost and duration T_k, fixed or free; t = t_k + τ T_k:

    dx_k/dτ = T_k f_k(x_k, u_k, t; p),      J = Σ_k T_k ∫_0^1 L_k dτ + Psi_k(x_k(1), T_k; p),

all phases run side by side over τ, a free T_k is a constant state, and t_k = t_0 + T_1 + ... + T_(k-1). A linkage joins
the end of one phase to the start of the next: it is a constraint on both ends, so the start of a state becomes a
constant to be found. An event in the interior is a boundary between two phases. Where several phases may switch, each
has a clock of its own (see ``clocks``).

    rocket = MultiPhaseProblem("two stages")
    boost, coast = rocket.phase("boost"), rocket.phase("coast")
    ...                                         # each stated as an OptimalControlProblem
    rocket.link(boost, coast, jumps={"m": -100.0})
    solution = rocket.solve()
    solution["boost"].t, solution["coast"]["h"]
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.breaks import break_fractions
from mathnavi.controllers.ocp.clocks import clock_name, rate_name
from mathnavi.controllers.ocp.comparisons import Row, end_limits, rows
from mathnavi.controllers.ocp.defects import running_costs
from mathnavi.controllers.ocp.diagnosis import unbounded
from mathnavi.controllers.ocp.dual_solution import own_names
from mathnavi.controllers.ocp.expressions import expression
from mathnavi.controllers.ocp.grid import Grid, from_widths
from mathnavi.controllers.ocp.guesses import Values
from mathnavi.controllers.ocp.instants import check_instant, instant_cost
from mathnavi.controllers.ocp.lowering import functions_of, guesses_of
from mathnavi.controllers.ocp.methods.by_name import Method, solve_by
from mathnavi.controllers.ocp.monitors import Monitor
from mathnavi.controllers.ocp.multipliers import Multipliers, NamedValues, distinct
from mathnavi.controllers.ocp.problem import Numbers, OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.replay import GIVEN_NODES, replayed
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import Options
from mathnavi.controllers.ocp.statement import Duration, Instant, Parameter, Statement, Variable, bounds
from mathnavi.controllers.ocp.substitutions import guessed, since_start, solved
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.short_tables import short_table
from mathnavi.interfaces.signals import Array

_ROUNDING = 1e-12  # relative, by which a stated start may differ from a stated end


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
            raise KeyError(f"{phase!r} is no phase; {allowed_for(phase, tuple(self.phases))}")
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


class MultiPhaseProblem:
    """An optimal control problem of several phases with linkages between them; ``solve()`` solves it.

    The phases follow each other in the order in which they are begun: the time of one goes on where that of the one
    before has ended, unless a phase states its own start time.
    """

    def __init__(self, name: str) -> None:
        """Begin a problem without phases."""
        self.name = name
        self._phases: dict[str, OptimalControlProblem] = {}
        self._parameters: list[Parameter] = []
        self._unknowns: list[Variable] = []
        self._couplings: list[Row] = []

    def phase(self, name: str) -> OptimalControlProblem:
        """Begin the next phase; returns it, to be stated. ProblemError for a name that is empty or taken."""
        if not isinstance(name, str) or not name or name in self._phases:
            raise ProblemError(f"{self.name}: phase {name!r} is empty or taken; allowed: other than {[*self._phases]}")
        phase = OptimalControlProblem(name)
        phase.statement.parameters += self._parameters
        phase.statement.shared += self._unknowns
        self._phases[name] = phase
        return phase

    def parameter(self, name: str, nominal: Numbers) -> ca.SX:
        """Declare a parameter that all phases share, or a vector, known at each solve; returns its symbol.

        ProblemError for a name that is taken, in any phase, and a value that is not finite.
        """
        common, before = self._common(name), len(self._parameters)
        symbol = common.declare_parameter(name, nominal)
        for phase in self._phases.values():
            phase.statement.parameters += self._parameters[before:]
        return symbol

    def unknown(
        self,
        name: str,
        size: int = 1,
        *,
        lower: Numbers = -math.inf,
        upper: Numbers = math.inf,
        scale: Numbers | None = None,
        guess: Numbers = 0.0,
    ) -> ca.SX:
        """Declare a constant that is to be found and that all phases share, or a vector; returns its symbol.

        Arguments and errors are those of ``OptimalControlProblem.unknown``; the name is taken in no phase.
        """
        common, before = self._common(name), len(self._unknowns)
        symbol = common.declare("state", name, size, lower, upper, scale, guess)
        for phase in self._phases.values():
            phase.statement.shared += self._unknowns[before:]
        return symbol

    def _common(self, name: str) -> Statement:
        """Statement of what all phases share; ProblemError for a name that is taken in one of them."""
        for phase in self._phases.values():
            phase.statement.check_name(name)
        return Statement(self.name, parameters=self._parameters, states=self._unknowns)

    def link(
        self, before: OptimalControlProblem, after: OptimalControlProblem, *, jumps: Mapping[str, Any] | None = None
    ) -> None:
        """Let the states that two phases share by name go on from the end of one to the start of the other.

        An integral starts from 0 in each phase. A state that the other phase starts itself ends there too, less the
        jump.

        Args:
            before: phase whose end is linked.
            after: phase whose start is linked.
            jumps: x_after(0) - x_before(T) by state, a number or an expression of parameters; 0 where none is given.

        Raises:
            ProblemError: for phases of another problem, phases that share no state, jumps of other states, and a state
                whose stated start and end differ by another jump.
        """
        self._check_own(before, after)
        jumps = dict(jumps or {})
        own = {v.name: v.symbol for v in before.statement.states}
        common = [v for v in after.statement.states if v.name in own and not v.name.endswith("(0)")]
        shared = [v for v in common if v.name not in after.statement.integrals]
        names = ", ".join(v.name for v in shared)
        where = f"{self.name}: {before.name} to {after.name}"
        if not common:
            raise ProblemError(f"{where}: no state in common; allowed: phases with states of the same name")
        if not shared:
            raise ProblemError(
                f"{where}: {', '.join(v.name for v in common)}: integrals, which start from 0 in {after.name}; "
                "allowed: at least one other state of both phases"
            )
        if strangers := [str(name) for name in jumps if name not in [v.name for v in shared]]:
            why = "; ".join(f"{each} is {_why_it_cannot_jump(each, before, after)}" for each in strangers)
            raise ProblemError(
                f"{where}: jump of {', '.join(strangers)}: {why}; allowed: jumps of {names}, the states of both phases"
            )
        for variable in shared:
            jump = expression(f"{where}: jump of {variable.name}", jumps.get(variable.name, 0.0))
            ends, starts = before.statement.ends.get(variable.name), after.statement.starts.get(variable.name)
            if ends is not None and starts is not None and ca.vertcat(ends, starts, jump).is_constant():
                self._check_joined(f"{where}: {variable.name}", float(ends), float(starts), float(jump))
                continue
            begins = starts if starts is not None and starts.is_constant() else after.initial(variable.symbol)
            gap = begins - own[variable.name] - jump
            self.couple(gap == 0.0, name=f"{variable.name} from {before.name} to {after.name}")

    def couple(self, constraint: Any, *, lower: Any = None, upper: Any = None, name: str = "") -> None:
        """Constrain the ends of several phases together, by a comparison or an expression with limits.

        A state's symbol means its value at the end of its phase, ``phase.initial(x)`` that at the start; the symbols of
        the durations may be among them. ProblemError for what cannot be a constraint.
        """
        every = ca.vertcat(*(each for phase in self._phases.values() for each in phase.statement.known_at))
        where = f"{self.name}: coupling"
        self._couplings += rows(where, constraint, *end_limits(constraint, lower, upper), name, known=ca.symvar(every))

    def functions(self) -> ProblemFunctions:
        """The stacked problem as compiled functions, over τ in [0, 1]; its variables are named phase.variable.

        Raises ProblemError where something is missing or contradicts itself, naming it.
        """
        clocked = self._clocked
        return dataclasses.replace(functions_of(self._stacked(clocked)), clocks=clocked)

    def solve(
        self,
        nodes: int | None = None,
        *,
        method: Method = "auto",
        monitor: Monitor | str | None = None,
        guess: MultiPhaseSolution | None = None,
        parameters: Mapping[str, Numbers] | None = None,
        tolerance: float | None = None,
        options: Options | None = None,
        scheme: Scheme | str | None = None,
        verify: bool | None = None,
    ) -> MultiPhaseSolution:
        """Solve all phases together, on nodes at the same fractions of their durations.

        Arguments and errors are those of ``OptimalControlProblem.solve``, ``guess`` a solution of this problem; break
        times that are known are those of phases whose duration is fixed, and a boundary of two phases is another.
        """
        problem = self.functions()
        values = problem.values_by_name(parameters)
        if guess is not None and not isinstance(guess, MultiPhaseSolution):
            raise ProblemError(f"{self.name}: guess = {guess!r:.80}; allowed: a MultiPhaseSolution")
        start = None if guess is None else guess.stacked
        stacked = solve_by(
            problem,
            nodes,
            method,
            monitor,
            guess=start,
            parameters=values,
            tolerance=tolerance,
            options=options,
            scheme=scheme,
            verify=verify,
        )
        return self._unstacked(stacked)

    def __repr__(self) -> str:
        return f"MultiPhaseProblem({self.name!r}, phases {[*self._phases]})"

    @staticmethod
    def _check_joined(what: str, end: float, start: float, jump: float) -> None:
        """Refuse a link between two values that differ by more than the jump; rounding aside."""
        if abs(start - end - jump) > _ROUNDING * max(abs(start), abs(end), abs(jump)):
            raise ProblemError(
                f"{what} ends at {end:g} and starts at {start:g}, jump {jump:g}; allowed: a jump of {start - end:g}"
            )

    def _check_own(self, *phases: OptimalControlProblem) -> None:
        for phase in phases:
            if phase not in self._phases.values():
                raise ProblemError(f"{self.name}: {phase!r:.80} is not one of its phases; allowed: {[*self._phases]}")

    @property
    def _clocked(self) -> tuple[str, ...]:
        """Names of the phases that have a clock: those with limits at which a control may switch, if there are two.

        None where something happens at times that are known, for these are fractions of what all phases pass at once.
        """
        may_switch = tuple(
            name
            for name, phase in self._phases.items()
            if phase.statement.path or np.isfinite(bounds(phase.statement.controls)).any()
        )
        return may_switch if len(may_switch) > 1 and not break_fractions(self._stacked()) else ()

    def _stacked(self, clocked: tuple[str, ...] = ()) -> Statement:
        """Single statement of all phases over τ, some of which have a clock."""
        if not self._phases:
            raise ProblemError(f"{self.name}: no phase is begun; allowed: at least one")
        stacked = Statement(self.name, duration=Duration(1.0, 1.0, 1.0), parameters=list(self._parameters))
        elapsed = ca.SX(0)
        for name, phase in self._phases.items():
            clock = _clock(stacked, name) if name in clocked else (stacked.t, ca.SX(1))
            elapsed = _add_phase(stacked, name, phase.statement, elapsed, clock, shared=self._parameters)
        stacked.states += self._unknowns
        stacked.rates |= {v.name: ca.SX(0) for v in self._unknowns}
        fixed = {p.statement.final_time: p.statement.duration for p in self._phases.values()}
        for row in self._couplings:
            made = row.expression
            for symbol, duration in fixed.items():
                if duration is not None and not duration.free:
                    made = ca.substitute(made, symbol, duration.guess)
            stacked.final.append(dataclasses.replace(row, expression=made))
        return stacked

    def _unstacked(self, stacked: Solution) -> MultiPhaseSolution:
        """Each phase as a separate solution, its times since the start of the phase."""
        phases, start_times, elapsed = dict[str, Solution](), dict[str, float](), 0.0
        for name, phase in self._phases.items():
            phases[name], start_times[name] = phase_solution(stacked, name, phase.statement, elapsed)
            elapsed = start_times[name] + phases[name].duration
        unlimited = [
            f"phase {name}: {why}"
            for name, phase in phases.items()
            if (why := unbounded(phase.problem, phase.x, np.concatenate(list(phase.u)), phase.duration, diverged=False))
        ]
        if stacked.solved and unlimited:
            stacked, *views = (
                dataclasses.replace(solution, status=SolverOutcome.UNBOUNDED, message="; ".join(unlimited))
                for solution in (stacked, *phases.values())
            )
            phases = dict(zip(phases, views, strict=True))
        unknowns = {v.name: float(stacked[v.name][0]) for v in self._unknowns}
        return MultiPhaseSolution(self.name, stacked, phases, start_times, unknowns)


def _why_it_cannot_jump(name: str, before: OptimalControlProblem, after: OptimalControlProblem) -> str:
    """What a name that link() cannot give a jump is, in the words of the error."""
    for phase, other in ((before, after), (after, before)):
        statement = phase.statement
        if name in [v.name for v in statement.controls]:
            return f"a control of {phase.name}"
        if name in [each.name for each in statement.parameters]:
            return "a parameter"
        if name in [v.name for v in statement.states] and name not in other.statement.names:
            return f"a state of {phase.name} only"
    return (
        f"an integral, which starts from 0 in {after.name}"
        if name in after.statement.integrals
        else "no state of either phase"
    )


def _clock(stacked: Statement, name: str) -> tuple[ca.SX, ca.SX]:
    """Add the clock of a phase; returns its time, a fraction of the phase's duration, and its rate."""
    time, rate = ca.SX.sym(clock_name(name)), ca.SX.sym(rate_name(name))
    free = -math.inf, math.inf, 1.0
    stacked.states.append(Variable(clock_name(name), time, *free, Values(np.array([0.0, 1.0]))))
    stacked.controls.append(Variable(rate_name(name), rate, *free, Values(np.array([1.0]))))
    stacked.rates[clock_name(name)] = rate
    stacked.initial.append(Row(time, 0.0, 0.0, f"start of {clock_name(name)}"))
    return time, rate


def _add_phase(
    stacked: Statement,
    name: str,
    phase: Statement,
    elapsed: ca.SX,
    clock: tuple[ca.SX, ca.SX],
    shared: list[Parameter],
) -> ca.SX:
    """Add a phase that begins at t = ``elapsed`` [s], with its time and rate on τ; returns when it ends."""
    duration = phase.duration
    if duration is None:
        raise ProblemError(f"{stacked.name}: phase {name} has no duration; allowed: duration() or free_duration()")
    if missing := [v.name for v in phase.states if v.name not in phase.rates]:
        raise ProblemError(f"{stacked.name}: phase {name}: no dynamics for {', '.join(missing)}; allowed: one for each")
    T = phase.final_time if duration.free else ca.SX(duration.guess)
    begin = elapsed if phase.start_time.is_zero() else phase.start_time
    time, rate = clock
    now = begin + time * T

    def at(made: ca.SX) -> ca.SX:
        own = ca.vertcat(phase.t, phase.elapsed, phase.final_time)
        return ca.substitute(made, own, ca.vertcat(now, time * T, T))

    def renamed(rows_of: list[Row]) -> list[Row]:
        return [dataclasses.replace(row, expression=at(row.expression), name=f"{name}: {row.name}") for row in rows_of]

    guess = guesses_of(guessed(since_start(phase)))
    columns = zip((*guess.states.T, *guess.controls.T), (*guess.state_scale, *guess.control_scale), strict=True)
    for k, (variable, (values, scale)) in enumerate(zip((*phase.states, *phase.controls), columns, strict=True)):
        among = stacked.states if k < len(phase.states) else stacked.controls
        own = Values(values, guess.times)
        among.append(dataclasses.replace(variable, name=f"{name}.{variable.name}", scale=float(scale), guess=own))
    stacked.rates |= {f"{name}.{state}": rate * T * at(own) for state, own in phase.rates.items()}
    if duration.free:
        constant = Values(np.array([duration.guess]))
        stacked.states.append(Variable(f"{name}.duration", T, duration.lower, duration.upper, duration.guess, constant))
        stacked.rates[f"{name}.duration"] = ca.SX(0)
    stacked.parameters += [
        dataclasses.replace(each, name=f"{name}.{each.name}") for each in phase.parameters if each not in shared
    ]
    stacked.running += rate * T * at(phase.running)
    stacked.terminal += at(phase.terminal)
    stacked.path += renamed(phase.path)
    stacked.initial += renamed(phase.initial)
    stacked.final += renamed(phase.final)
    stacked.instants += _instants(stacked.name, name, phase, begin)
    return begin + T


def _instants(problem: str, name: str, phase: Statement, begin: ca.SX) -> list[Instant]:
    """What a phase states at given times, over τ; ProblemError for a duration that is free, and times beyond it."""
    assert phase.duration is not None
    T, symbols = phase.duration.guess, ca.vertcat(phase.t, phase.elapsed, phase.final_time)
    found = []
    for each in phase.instants:
        check_instant(f"{problem}: phase {name}", each.time, phase.duration)
        now = ca.vertcat(begin + each.time, each.time, phase.final_time if phase.duration.free else T)
        rows_of = tuple(
            dataclasses.replace(row, expression=ca.substitute(row.expression, symbols, now), name=f"{name}: {row.name}")
            for row in each.rows
        )
        found.append(Instant(min(each.time / T, 1.0), ca.substitute(each.cost, symbols, now), rows_of))
    return found
