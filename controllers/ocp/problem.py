"""A continuous-time optimal control problem, stated as the thesis does ((OCP) of 1.1, B.2).

    minimise    J = ∫_0^T L(x, u, t; p) dt + Psi(x(T), T; p)
    subject to  x' = f(x, u, t; p)
                d_lower <= d(x, u, t; p) <= d_upper                  path constraints, bounds among them
                i_lower <= i(x(0); p) <= i_upper                     x(0) in X_i
                s_lower <= s(x(T), T; p) <= s_upper                  x(T) in S_f

with states x, controls u, known parameters p and a final time T, fixed or free. All else is one of these: an integral
is an additional state, and so is a constant that is to be found, the start of a state that an end constraint contains,
and a free start time. A problem is stated call by call, and solved:

    ocp = OptimalControlProblem("Bryson-Denham")
    x, v = ocp.state("x"), ocp.state("v")
    u = ocp.control("u")
    ocp.duration(1.0)
    ocp.minimise(running=u**2 / 2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.constrain(x <= 1 / 9)
    ocp.start(x, 0.0), ocp.start(v, 1.0), ocp.end(x, 0.0), ocp.end(v, -1.0)
    solution = ocp.solve()
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.comparisons import Row, bounded, end_limits, rows
from mathnavi.controllers.ocp.compiled_statement import CompiledStatement
from mathnavi.controllers.ocp.expressions import column, expression, number
from mathnavi.controllers.ocp.guesses import Derived, Guess, Simulation, Values, start_values
from mathnavi.controllers.ocp.instants import ProblemAt
from mathnavi.controllers.ocp.lowering import guesses_of
from mathnavi.controllers.ocp.methods.by_name import Method, solve_by
from mathnavi.controllers.ocp.monitors import Monitor
from mathnavi.controllers.ocp.problem_functions import DURATION_LIMITS, ProblemFunctions
from mathnavi.controllers.ocp.progress import Report
from mathnavi.controllers.ocp.scaling import Scale, Scaling
from mathnavi.controllers.ocp.scaling_rows import programme_scales
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.controllers.ocp.solver import Options
from mathnavi.controllers.ocp.statement import Duration, DurationSymbol, Statement
from mathnavi.controllers.ocp.statement_table import table_of
from mathnavi.controllers.ocp.substitutions import guessed, since_start
from mathnavi.controllers.ocp.transcriptions.scheme import Scheme
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.short_tables import html_table, short_table

Numbers = float | Sequence[float]
"""one number for all components, or one for each"""
Expression = Any
"""an SX expression, a number, or a sequence of these"""


class OptimalControlProblem:
    """An optimal control problem: variables, objective, dynamics, constraints and guess; ``solve()`` solves it.

    A problem without declarations is the one of that name among those with a known optimum
    (``mathnavi.controllers.ocp.problems.library``). Symbols are CasADi's SX, () or, of a vector, (n, 1); a casadi
    Function, of MX or a table for one (``casadi.interpolant``), is called with them.

    A constraint is a comparison, ``x <= 0.1``, ``v == p`` or ``bounded(1, x, 2)``, or an expression with limits;
    for vectors element by element. In terminal cost and end constraints a state's symbol means x(T).

    A guess is a number, or values spread evenly over [0, T]: ``guess=(0, 5, 2)`` is 0 at the start, 5 in the middle and
    2 at the end, linear in between; or a function of the time [s] since the start. For a vector it is one number, one
    number for each component, or an array (k, n).
    """

    def __init__(self, name: str) -> None:
        """Begin an empty problem of this name, or take the problem of the literature with this name."""
        if not isinstance(name, str):
            raise ProblemError(f"name = {name!r:.80}; allowed: a text")
        self.name = name
        self.statement = Statement(name)
        self._integrals = 0
        self._compiled = CompiledStatement(self.statement)

    @property
    def t(self) -> ca.SX:
        """Time [s] since the start, or since the origin of a start time that is stated; of a phase, see ``elapsed``.

        In a phase it is the time of the whole problem: it goes on from one phase to the next.
        """
        return self.statement.t

    @property
    def elapsed(self) -> ca.SX:
        """Time [s] since the start of this problem or, in one of several phases, of this phase."""
        return self.statement.elapsed

    bounded = staticmethod(bounded)

    # variables

    def state(
        self,
        name: str,
        size: int = 1,
        *,
        lower: Numbers = -math.inf,
        upper: Numbers = math.inf,
        scale: Numbers | None = None,
        guess: Guess = 0.0,
    ) -> ca.SX:
        """Declare a state, or a vector of ``size`` states x[0], x[1] ...; returns its symbol () or (size, 1).

        ``lower`` and ``upper`` bound it along the path, ``scale`` > 0 is its typical magnitude, None for the automatic
        one (see ``scaling``), ``guess`` is a guess as described in the class; all in the unit of the state.
        ProblemError for a name that is taken, limits that contradict each other, and numbers that are not finite.
        """
        return self.statement.declare("state", name, size, lower, upper, scale, guess)

    def control(
        self,
        name: str,
        size: int = 1,
        *,
        lower: Numbers = -math.inf,
        upper: Numbers = math.inf,
        scale: Numbers | None = None,
        guess: Guess = 0.0,
    ) -> ca.SX:
        """Declare a control, or a vector of them; returns its symbol. Arguments and errors are those of ``state``."""
        return self.statement.declare("control", name, size, lower, upper, scale, guess)

    def parameter(self, name: str, nominal: Numbers) -> ca.SX:
        """Declare a parameter p, known at each solve, with its nominal value, or a vector; returns its symbol.

        ProblemError for a name that is taken and a value that is not finite.
        """
        return self.statement.declare_parameter(name, nominal)

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
        """Declare a constant that is to be found, or a vector, a state that does not change; returns its symbol.

        Arguments and errors are those of ``state``.
        """
        symbol = self.state(name, size, lower=lower, upper=upper, scale=scale, guess=guess)
        self.dynamics(symbol, 0.0)
        return symbol

    # time

    @property
    def duration(self) -> DurationSymbol:
        """Symbol T [s] of the final time; called with a number, ``duration(2.0)``, it fixes it, and returns the symbol.

        T may stand in dynamics, costs and constraints. ProblemError unless 0 < T <= 1e9 s, and if it is given twice.
        """
        return DurationSymbol(self.statement)

    def free_duration(
        self, *, guess: float, lower: float = DURATION_LIMITS[0], upper: float = DURATION_LIMITS[1]
    ) -> ca.SX:
        """Free the final time, lower <= T <= upper [s]; returns its symbol ``duration``.

        A result that ends at one of the default limits is not a solution: its status is UNBOUNDED.

        ProblemError unless 0 < lower <= guess <= upper <= 1e9 s, and if it is given twice.
        """
        self.statement.set_duration(guess, lower, upper)
        return self.statement.final_time

    def start_time(self, value: float) -> None:
        """Start at t = value [s], where dynamics, cost or constraints depend on t; ProblemError if it is given twice.

        The times of a guess and of a solution are still counted from the start.
        """
        self.statement.set_start_time(ca.SX(number(f"{self.name}: start time", value)))

    def free_start_time(self, *, guess: float, lower: float, upper: float) -> ca.SX:
        """Free the start time t_0, lower <= t_0 <= upper [s], a constant to be found named t0; returns its symbol."""
        symbol = self.unknown("t0", lower=lower, upper=upper, guess=guess)
        self.statement.set_start_time(symbol)
        return symbol

    # objective and dynamics

    def minimise(self, running: Expression = 0.0, terminal: Expression = 0.0) -> None:
        """State the objective J = ∫ running dt + terminal; ProblemError if it is stated twice or is no scalar.

        A cost with a kink, |u| for one, is announced by a warning: ``absolute`` and ``largest`` split it.
        """
        self.statement.set_cost(running, terminal)

    def dynamics(self, state: ca.SX, rate: Expression) -> None:
        """State the dynamics x' = rate [1/s] of one state or of several, (n, 1) each.

        ProblemError for no state, a second rate, another shape and symbols of another problem.
        """
        self.statement.set_rates(state, rate)

    # constraints

    def constrain(
        self, constraint: Expression, *, lower: Expression = None, upper: Expression = None, name: str = ""
    ) -> None:
        """Constrain the path: a comparison, or lower <= d(x, u, t; p) <= upper, element by element.

        A comparison of a state or a control with numbers tightens its bounds. ``name`` stands for the constraint in
        messages and results. ProblemError for what cannot be a constraint, see ``comparisons.rows``.
        """
        s = self.statement
        for row in rows(f"{self.name}: path constraint", constraint, lower, upper, name, known=s.known_along):
            variable = self.statement.variable(row.expression)
            if variable is None or lower is not None or upper is not None or row.lower == row.upper:
                s.path.append(row)
            else:
                self.statement.tighten(variable, row)

    def start(self, state: ca.SX, value: Expression) -> None:
        """Start at x(0) = value, a number or an expression of parameters and states, for one state or several.

        ProblemError for no state, a second start, and a value outside the state's bounds.
        """
        self.statement.pin("start", state, value)

    def start_constraint(
        self, constraint: Expression, *, lower: Expression = None, upper: Expression = None, name: str = ""
    ) -> None:
        """Constrain the start: a comparison, or lower <= i(x(0); p) <= upper.

        One limit of an expression is a one-sided constraint; an expression without any is an equation, = 0.
        """
        s = self.statement
        where = f"{self.name}: start constraint"
        s.initial += rows(where, constraint, *end_limits(constraint, lower, upper), name, known=s.known_at)

    def end(self, state: ca.SX, value: Expression) -> None:
        """End at x(T) = value, a number or an expression of T, parameters and states, for one state or several.

        ProblemError for no state, a second end, and a value outside the state's bounds.
        """
        self.statement.pin("end", state, value)

    def end_constraint(
        self, constraint: Expression, *, lower: Expression = None, upper: Expression = None, name: str = ""
    ) -> None:
        """Constrain the end: a comparison, or lower <= s(x(T), T; p) <= upper.

        One limit of an expression is a one-sided constraint; an expression without any is an equation, = 0.
        """
        s = self.statement
        where = f"{self.name}: end constraint"
        s.final += rows(where, constraint, *end_limits(constraint, lower, upper), name, known=s.known_at)

    def at(self, time: float) -> ProblemAt:
        """A time [s] since the start, of a phase since its own, at which a cost or constraints are to be stated.

        ``at(2.0).minimise((x - 3.1)**2)`` adds to J, ``at(2.0).constrain(x <= 1)`` limits x(2.0). A node is placed
        there. ProblemError, at the latest when it is solved, unless 0 <= time <= T of a duration that is fixed.
        """
        return ProblemAt(self.statement, time)

    # what becomes an additional state or control

    def integral(self, rate: Expression, *, name: str = "", lower: float = -math.inf, upper: float = math.inf) -> ca.SX:
        """Declare the integral of a rate from the start, an additional state; returns its symbol, the integral up to t.

        In terminal cost and end constraints the symbol means ∫_0^T, and ``lower`` and ``upper`` limit that.
        """
        self._integrals += not name
        name = name or f"integral {self._integrals}"
        made = expression(f"{self.name}: {name}", rate)
        symbol = self.statement.declare("state", name, 1, -math.inf, math.inf, None, 0.0)
        self.statement.states[-1].guess = Derived()
        self.statement.integrals.append(name)
        self.dynamics(symbol, made)
        self.start(symbol, 0.0)
        if lower != -math.inf or upper != math.inf:
            self.end_constraint(symbol, lower=lower, upper=upper, name=name)
        return symbol

    def initial(self, state: ca.SX) -> ca.SX:
        """Declare the value x(0) of a state, or of several, for terminal cost and end constraints; returns its symbol.

        It becomes a constant to be found, named x(0), with the state's bounds and scale.
        """
        symbols = []
        for source in self.statement.find(state, "initial"):
            name = f"{source.name}(0)"
            if name not in self.statement.names:
                symbol = self.unknown(name, lower=source.lower, upper=source.upper, scale=source.scale)
                self.statement.states[-1].guess = Derived(start_of=source.name)
                row = Row(symbol - source.symbol, 0.0, 0.0, name)
                self.statement.initial.append(row)
            symbols += [v.symbol for v in self.statement.states if v.name == name]
        return column(symbols)

    def periodic(self, *states: ca.SX) -> None:
        """End each of these states where it began: x(T) = x(0)."""
        for state in states:
            for variable in self.statement.find(state, "periodic"):
                self.end_constraint(variable.symbol == self.initial(variable.symbol), name=f"period of {variable.name}")

    def absolute(self, value: Expression, *, name: str = "") -> ca.SX:
        """|value| without its kink, for a cost that grows with it; returns an expression of two controls.

        The value is split, value = p - n with p, n >= 0, and |value| is p + n: at an optimum one of them is 0. In a
        constraint that would be met by a larger |value| both may be positive. ProblemError for no scalar.
        """
        made = expression(f"{self.name}: absolute", value)
        if made.numel() != 1:
            raise ProblemError(f"{self.name}: absolute of shape {made.shape}; allowed: one expression")
        name = name or f"|{made}|"
        plus, minus = (self.control(f"{name}{sign}", lower=0.0) for sign in "+-")
        self.constrain(made == plus - minus, name=name)
        return plus + minus

    def largest(self, *values: Expression, name: str = "") -> ca.SX:
        """Return max(values) without its kink, for a cost that grows with it: a control above all values.

        The least of several is -largest(-a, -b), for a cost that falls with it.
        """
        made = [expression(f"{self.name}: largest", value) for value in values]
        name = name or f"max({', '.join(str(each) for each in made)})"
        symbol = self.control(name)
        for each in made:
            self.constrain(each - symbol <= 0.0, name=name)
        return symbol

    # guesses

    def guess(self, variable: ca.SX, values: Guess, *, times: Sequence[float] | None = None) -> None:
        """Guess a state or a control, or a vector of them, in place of the guess of its declaration.

        Args:
            variable: its symbol, (n, 1).
            values: as described in the class; with ``times`` (k,) or (k, n).
            times: [s] since the start, increasing; None where the values are spread evenly over [0, T].
        """
        self.statement.set_guess(variable, values, times)

    def guess_from(self, solution: Solution) -> None:
        """Take the guess of T, and of every variable that a solution has under the same name, from the solution."""
        found = solution.problem
        for variable in (*self.statement.states, *self.statement.controls):
            if variable.name in (*found.states, *found.controls):
                variable.guess = Values(np.asarray(solution[variable.name], float), solution.t)
        duration = self.statement.duration
        if duration is not None and duration.lower <= solution.duration <= duration.upper:
            self.statement.duration = Duration(solution.duration, duration.lower, duration.upper)

    def guess_by_simulation(self, start: Mapping[str, float] | None = None) -> None:
        """Guess the states by integrating the dynamics from the start under the guessed controls.

        ``start`` holds values at the start by state; the others are those of ``start()``, or the first of the guess.
        ProblemError for an unknown state and, when it is solved, for states that diverge.
        """
        states = [v.name for v in self.statement.states]
        self.statement.simulation = Simulation(start_values(self.name, start or {}, states))

    def scaling(self) -> Scaling:
        """Scales of the states, the controls and T by name, with where each comes from; printed as a table.

        A stated scale stays. Automatic ones come from the limits, the guess, the values at start and end and the
        rates (see ``scaling``); those of J and of the constraints are what the solver divides them by, 1 for ordinary
        sizes. Raises ProblemError where something is missing or contradicts itself, naming it.
        """
        duration = self.statement.duration
        if duration is None:
            raise ProblemError(f"{self.name}: no duration is given; allowed: duration() or free_duration()")
        problem, found = self.functions(), guesses_of(guessed(since_start(self.statement)))
        scales = [*found.state_scales, *found.control_scales]
        variables = dict(zip(self.statement.variable_names, scales, strict=True))
        return Scaling(self.name, variables | {"T": Scale(duration.guess, "guess")}, *programme_scales(problem))

    # solution

    def solve(
        self,
        nodes: int | None = None,
        *,
        method: Method = "auto",
        monitor: Monitor | str | None = None,
        guess: Solution | None = None,
        parameters: Mapping[str, Numbers] | None = None,
        tolerance: float | None = None,
        options: Options | None = None,
        scheme: Scheme | str | None = None,
        breaks: Sequence[float] = (),
        replay: bool = True,
        verify: bool | None = None,
        starts: int | None = None,
        progress: bool | Report | None = None,
    ) -> Solution:
        """Solve the problem by collocation, replay the solution through its own dynamics, and verify it.

        Args:
            nodes: number N of nodes, for "hp" and "refine" the most that they may use. None: as many as the tolerance
                needs for "auto" and "hp", 40 for the others.
            method: "auto", the one that suits the problem, which the message names: "direct" where a number of nodes is
                given, otherwise "hp", from a redistribution's solution where the stated guess is too poor; "hp", Radau
                collocation with points, nodes and switching times added until the replay is within the tolerance; by
                Hermite-Simpson collocation "direct", uniform nodes; "redistribute", nodes moved between two solves to
                where the monitor function is large; "distribute", nodes that are unknowns of the programme, (B.1), and
                hold the monitor function in equal shares; "refine", nodes added where the local error is.
            monitor: monitor function w of "redistribute" and "distribute", or the name of one: "arclength",
                "curvature", "local error", "residual", "uniform". None: curvature, and arclength for "distribute".
            guess: a solution to start from, on any grid; None for the guess that was stated.
            parameters: values by name, the nominal ones where none is given.
            tolerance: largest miss and path violation, over the scales, and cost error, relative to max(1, |J|) or, of
                a J that is small by its units, to its scale, of the replay of a solution that is called OPTIMAL. None:
                1e-6 for "hp" and "refine", and 1e-3 on nodes whose number is given.
            options: NLP solver with its own tolerance, and what it prints or logs; None for the method's. FATROP
                (``backend="fatrop"``) needs a scheme that gives x_(i+1): "multiple shooting", which "auto" and "direct"
                then take, or "forward Euler"; "hp" is refused.
            scheme: transcription of an interval, or its name: "Hermite-Simpson", "trapezoid", "Radau",
                "Gauss-Legendre", "Legendre-Gauss-Lobatto", "multiple shooting", "forward Euler"; "auto" is then
                "direct". None for the method's own.
            breaks: times [s] since the start, inside of the duration, at which a node is placed: where a function
                jumps or has a kink. Those of linear tables of the time, of comparisons with it, and of ``at()`` are
                known. Where the duration is free they need "auto" without nodes, and those that are later than T do
                nothing.
            replay: False, for a number of nodes that is given, returns the solution of the programme unchanged, in a
                loop that has no time for more: its status is at best CONVERGED.
            verify: True to bound the error of J on two finer meshes, which takes about one more solve; False for the
                second-order condition alone. None: True, but for "direct" and where a number of nodes is given to
                "auto": their message says that the error of J is not estimated.
            starts: number k of guesses, the stated one and k - 1 others, simulated under other controls or perturbed
                by draws of a fixed seed, that are solved on a coarse mesh; the lowest is solved by the method, and the
                message says what each found. Where that mesh does not hold the solution, one of up to 8 times as many
                intervals compares them, and the message says so where none does. None: 3 where the error of J is
                bounded, on the coarsest mesh alone, otherwise 1. The minimum that is returned is a local one, lower
                than those of the other starts.
            progress: None for a line on standard error, if that is a terminal, from the first second on: stage, method,
                mesh, nodes, J, miss and time; False for none, True for the line wherever standard error goes. Or a
                function that is called with a ``SolveProgress`` at every iterate and stage; where it returns True the
                call ends, as on Ctrl-C. With ``replay=False`` there is neither.

        Returns:
            The solution; ``solution.ok`` says whether the problem is solved, ``status`` why not: CONVERGED where the
            programme is solved but its replay, or the error of J, is not within the tolerance; STATIONARY where it is
            no minimum; UNBOUNDED where J falls without limit from it; the message has the figures. INTERRUPTED is the
            best so far of a call that Ctrl-C ended, with its replay; a second Ctrl-C is a KeyboardInterrupt, and so is
            the first one with ``replay=False``. A call ends when the CPU time ``options.seconds`` is spent. An adaptive
            solution that replays worse than the uniform one has the status REFUSED and the uniform one's arrays.

        Raises:
            ProblemError: for a problem that is not complete or contradicts itself, fewer than two nodes, an unknown
                method, scheme, monitor or parameter, a monitor or a scheme that its method cannot take, and break times
                outside of the duration or, where it is free, for a method that cannot hold them.
        """
        whole = nodes is None and scheme is None and monitor is None
        problem = self._compiled.with_breaks(self.functions(), breaks, method, whole=whole)
        values = problem.values_by_name(parameters)
        return solve_by(
            problem,
            nodes,
            method,
            monitor,
            guess=guess,
            parameters=values,
            tolerance=tolerance,
            options=options,
            scheme=scheme,
            replay=replay,
            verify=verify,
            starts=starts,
            progress=progress,
        )

    def functions(self) -> ProblemFunctions:
        """Compile and check the problem's functions; they are kept until something else is stated.

        Raises ProblemError, with the name of what is missing or contradicts itself.
        """
        return self._compiled.functions()

    def __repr__(self) -> str:
        """A short table: what is stated, with its limits, and which states have no dynamics yet."""
        return short_table(*table_of(self.statement))

    def _repr_html_(self) -> str:
        """The same table, for a notebook."""
        return html_table(*table_of(self.statement))
