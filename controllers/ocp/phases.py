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
from mathnavi.controllers.ocp.comparisons import Row, end_limits, rows
from mathnavi.controllers.ocp.diagnosis import unbounded
from mathnavi.controllers.ocp.expressions import expression
from mathnavi.controllers.ocp.lowering import Guesses, functions_of
from mathnavi.controllers.ocp.methods.by_name import Method, solve_by
from mathnavi.controllers.ocp.monitors import Monitor
from mathnavi.controllers.ocp.phase_solutions import MultiPhaseSolution, phase_solution
from mathnavi.controllers.ocp.problem import Numbers, OptimalControlProblem
from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.controllers.ocp.progress import Report
from mathnavi.controllers.ocp.scaling import Scale, Scaling
from mathnavi.controllers.ocp.scaling_rows import programme_scales
from mathnavi.controllers.ocp.solution import Solution, SolverOutcome
from mathnavi.controllers.ocp.solver import Options
from mathnavi.controllers.ocp.stacking import add_clock, add_phase, phase_guesses
from mathnavi.controllers.ocp.statement import Duration, Parameter, Statement, Variable, bounds
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.errors import ProblemError

_ROUNDING = 1e-12  # relative, by which a stated start may differ from a stated end


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
        starts: int | None = None,
        progress: bool | Report | None = None,
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
            starts=starts,
            progress=progress,
        )
        return self._unstacked(stacked)

    def scaling(self) -> Scaling:
        """Scales of the variables by name, "phase.variable", with where each comes from; printed as a table.

        They are those of ``OptimalControlProblem.scaling``, phase by phase; states of the same name have the largest of
        their automatic ones. The scale of a free duration is its guess. Raises ProblemError as ``functions`` does.
        """
        problem = self.functions()
        origins = dict[str, Scale]()
        for name, guess in self._guesses().items():
            variables = [*self._phases[name].statement.states, *self._phases[name].statement.controls]
            known = zip(variables, (*guess.state_scales, *guess.control_scales), strict=True)
            origins |= {f"{name}.{variable.name}": scale for variable, scale in known}
        values = zip((*problem.states, *problem.controls), (*problem.state_scale, *problem.control_scale), strict=True)
        stated = {name: origins.get(name, Scale(float(value), "guess")) for name, value in values}
        return Scaling(self.name, stated, *programme_scales(problem))

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
        for name, guess in self._guesses().items():
            phase = self._phases[name].statement
            clock = add_clock(stacked, name) if name in clocked else (stacked.t, ca.SX(1))
            elapsed = add_phase(stacked, name, phase, guess, elapsed, clock, shared=self._parameters)
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

    def _guesses(self) -> dict[str, Guesses]:
        """Guess and scales of each phase; ProblemError for one that is not complete."""
        return phase_guesses(self.name, {name: phase.statement for name, phase in self._phases.items()})

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
    """Reason why link() cannot give a name a jump, in the words of the error."""
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
