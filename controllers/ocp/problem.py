"""A continuous-time optimal control problem, stated as the thesis does ((OCP) of 1.1, B.2).

    minimise    J = ∫_0^T L(x, u, t; p) dt + Psi(x(T), T; p)
    subject to  x' = f(x, u, t; p)
                d_lower <= d(x, u, t; p) <= d_upper                  path constraints, bounds among them
                i_lower <= i(x(0); p) <= i_upper                     x(0) in X_i
                s_lower <= s(x(T), T; p) <= s_upper                  x(T) in S_f

with states x, controls u, known parameters p and a final time T, fixed or free. An integral constraint is a state of
its own, and so is a constant that is to be found. A problem is stated call by call, and solved:

    ocp = OptimalControlProblem("Bryson-Denham")
    x, v = ocp.state("x", upper=1 / 9), ocp.state("v")
    u = ocp.control("u", scale=5.0)
    ocp.duration(1.0)
    ocp.minimise(running=u**2 / 2)
    ocp.dynamics(x, v)
    ocp.dynamics(v, u)
    ocp.start(x, 0.0), ocp.start(v, 1.0), ocp.end(x, 0.0), ocp.end(v, -1.0)
    solution = ocp.solve()
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.methods.by_name import Method, solve_by
from mathnavi.controllers.ocp.monitors import Monitor
from mathnavi.controllers.ocp.problem_functions import Interval, ProblemFunctions
from mathnavi.controllers.ocp.solution import Solution
from mathnavi.sim.interfaces.checks import allowed_for
from mathnavi.sim.interfaces.errors import ProblemError
from mathnavi.sim.interfaces.signals import Array

NODES = 40
"""nodes of a solution by default"""

KNOWN: dict[str, Callable[[], ProblemFunctions]] = {}
"""problems with a known optimum by name, which ``mathnavi.controllers.ocp.problems.library`` enters"""
_MOST_DURATION = 1e9  # [s] beyond which a final time is no number to search among


@dataclass
class _Variable:
    """A state or a control as it is declared."""

    name: str
    symbol: ca.SX
    lower: float
    upper: float
    scale: float
    guess: Sequence[float] = (0.0,)


@dataclass
class _Constraints:
    """Expressions with their limits."""

    expressions: list[ca.SX] = field(default_factory=list)
    lower: list[float] = field(default_factory=list)
    upper: list[float] = field(default_factory=list)

    def add(self, where: str, expression: ca.SX | float, lower: float, upper: float) -> None:
        _check_limits(where, lower, upper)
        for element in ca.vertsplit(ca.vec(ca.SX(expression))):
            self.expressions.append(element)
            self.lower.append(lower)
            self.upper.append(upper)

    @property
    def interval(self) -> Interval:
        return Interval(np.array(self.lower, float), np.array(self.upper, float))

    @property
    def column(self) -> ca.SX:
        return ca.vertcat(*self.expressions) if self.expressions else ca.SX(0, 1)


class OptimalControlProblem:
    """An optimal control problem: variables, objective, dynamics, constraints and guess; ``solve()`` solves it.

    A problem on which nothing is declared is the one of that name among those whose optimum is known
    (``mathnavi.controllers.ocp.problems.library``). Symbols are CasADi's.

    Times in a guess are fractions of T, spread evenly over the values given: ``guess=(0, 5, 2)`` is 0 at the start, 5
    in the middle and 2 at the end, straight in between. In terminal cost and end constraints a state's symbol means
    x(T).
    """

    def __init__(self, name: str) -> None:
        """Begin an empty problem of this name, or the problem of the literature that has it."""
        self.name = name
        self.t = ca.SX.sym("t")
        """time [s] since the start"""
        self._states: list[_Variable] = []
        self._controls: list[_Variable] = []
        self._parameters: list[tuple[str, ca.SX, float]] = []
        self._rates: dict[str, ca.SX] = {}
        self._running, self._terminal, self._stated = ca.SX(0), ca.SX(0), False
        self._path, self._initial, self._final = _Constraints(), _Constraints(), _Constraints()
        self._final_time = ca.SX.sym("T")
        self._duration: tuple[float, float, float] | None = None  # guess, lower, upper

    def state(
        self,
        name: str,
        *,
        lower: float = -math.inf,
        upper: float = math.inf,
        scale: float = 1.0,
        guess: Sequence[float] = (0.0,),
    ) -> ca.SX:
        """Declare a state; returns its symbol ().

        ``lower`` and ``upper`` bound it along the path, ``scale`` > 0 is its typical magnitude, ``guess`` (k,) are
        values spread evenly over [0, T]; all in the state's own unit. ProblemError for a name that is taken, limits
        that contradict each other, and numbers that are not finite.
        """
        return self._declare(self._states, name, lower, upper, scale, guess)

    def control(
        self,
        name: str,
        *,
        lower: float = -math.inf,
        upper: float = math.inf,
        scale: float = 1.0,
        guess: Sequence[float] = (0.0,),
    ) -> ca.SX:
        """Declare a control; returns its symbol (). Arguments and errors are those of ``state``."""
        return self._declare(self._controls, name, lower, upper, scale, guess)

    def parameter(self, name: str, nominal: float) -> ca.SX:
        """Declare a parameter p, known at each solve, with its nominal value; returns its symbol ().

        ProblemError for a name that is taken and a value that is not finite.
        """
        self._check_name(name)
        if not math.isfinite(nominal):
            raise ProblemError(f"{self.name}: parameter {name} = {nominal!r}; allowed: a finite number")
        symbol = ca.SX.sym(name)
        self._parameters.append((name, symbol, nominal))
        return symbol

    def duration(self, value: float) -> None:
        """Fix the final time T [s]; ProblemError unless 0 < T <= 1e9 s, and if it is given twice."""
        self.free_duration(guess=value, lower=value, upper=value)

    def free_duration(self, *, guess: float, lower: float = 1e-3, upper: float = _MOST_DURATION) -> ca.SX:
        """Free the final time, lower <= T <= upper [s]; returns its symbol, for terminal cost and end constraints.

        ProblemError unless 0 < lower <= guess <= upper <= 1e9 s, and if it is given twice.
        """
        if not (0.0 < lower <= guess <= upper <= _MOST_DURATION):
            raise ProblemError(
                f"{self.name}: duration: lower = {lower!r}, guess = {guess!r}, upper = {upper!r}; "
                f"allowed: 0 < lower <= guess <= upper <= {_MOST_DURATION:g} s"
            )
        if self._duration is not None:
            raise ProblemError(f"{self.name}: the duration is given twice; allowed: once")
        self._duration = guess, lower, upper
        return self._final_time

    def minimise(self, running: ca.SX | float = 0.0, terminal: ca.SX | float = 0.0) -> None:
        """State the objective J = ∫ running dt + terminal; ProblemError if it is stated twice or is no scalar."""
        if self._stated:
            raise ProblemError(f"{self.name}: minimise() is called twice; allowed: once, with both parts of J")
        self._stated = True
        for what, expression in (("running", running), ("terminal", terminal)):
            if ca.SX(expression).numel() != 1:
                raise ProblemError(f"{self.name}: the {what} cost has shape {ca.SX(expression).shape}; allowed: one")
        self._running, self._terminal = ca.SX(running), ca.SX(terminal)

    def dynamics(self, state: ca.SX, rate: ca.SX | float) -> None:
        """State the dynamics x' = rate [1/s] of one state; ProblemError for no state, a second rate or no scalar."""
        variable = self._find(state, self._states, "dynamics")
        if ca.SX(rate).numel() != 1:
            raise ProblemError(
                f"{self.name}: dynamics of {variable.name} have shape {ca.SX(rate).shape}; allowed: one expression"
            )
        if variable.name in self._rates:
            raise ProblemError(f"{self.name}: dynamics of {variable.name} are given twice; allowed: once")
        self._rates[variable.name] = ca.SX(rate)

    def constrain(self, expression: ca.SX, *, lower: float = -math.inf, upper: float = math.inf) -> None:
        """Constrain an expression, or each of several, along the path: lower <= d(x, u, t; p) <= upper.

        ProblemError for limits that contradict each other.
        """
        self._path.add(f"{self.name}: path constraint", expression, lower, upper)

    def start(self, state: ca.SX, value: float | ca.SX) -> None:
        """Start one state at x(0) = value, a number or an expression of parameters; ProblemError for no state."""
        self._find(state, self._states, "start")
        self._initial.add(f"{self.name}: start", state - value, 0.0, 0.0)

    def start_constraint(self, expression: ca.SX, *, lower: float = 0.0, upper: float = 0.0) -> None:
        """Constrain the start: lower <= i(x(0); p) <= upper; ProblemError for limits that contradict each other."""
        self._initial.add(f"{self.name}: start constraint", expression, lower, upper)

    def end(self, state: ca.SX, value: float | ca.SX) -> None:
        """End one state at x(T) = value, a number or an expression of T and parameters; ProblemError for no state."""
        self._find(state, self._states, "end")
        self._final.add(f"{self.name}: end", state - value, 0.0, 0.0)

    def end_constraint(self, expression: ca.SX, *, lower: float = 0.0, upper: float = 0.0) -> None:
        """Constrain the end: lower <= s(x(T), T; p) <= upper; ProblemError for limits that contradict each other."""
        self._final.add(f"{self.name}: end constraint", expression, lower, upper)

    def solve(
        self,
        nodes: int = NODES,
        *,
        method: Method = "direct",
        monitor: Monitor | str | None = None,
        guess: Solution | None = None,
        parameters: Mapping[str, float] | None = None,
    ) -> Solution:
        """Solve the problem by Hermite-Simpson collocation and replay the solution through its own dynamics.

        Args:
            nodes: number N of nodes, for ``refine`` the most that it may use.
            method: "direct", uniform nodes; "redistribute", nodes moved between two solves to where the monitor
                function is large; "distribute", nodes that are unknowns of the programme, (B.1), and hold the monitor
                function in equal shares; "refine", nodes added where the local error is.
            monitor: monitor function w of "redistribute" and "distribute", or the name of one: "arclength",
                "curvature", "local error", "residual", "uniform". None: curvature, and arclength for "distribute".
            guess: a solution to start from, on any grid; None for the guess that was stated.
            parameters: values by name, the nominal ones where none is given.

        Returns:
            The solution; ``solution.ok`` says whether it is one, its ``status`` why not. An adaptive solution that
            replays worse than the uniform one has the status REFUSED and the uniform one's arrays.

        Raises:
            ProblemError: for a problem that is not complete or contradicts itself, fewer than two nodes, an unknown
                method, monitor or parameter, and a monitor that its method cannot take.
        """
        problem = self.functions()
        values = problem.values(**(parameters or {}))
        return solve_by(problem, nodes, method, monitor, guess=guess, parameters=values)

    def functions(self) -> ProblemFunctions:
        """The problem as compiled functions, checked.

        Raises ProblemError where something is missing or contradicts itself, naming it.
        """
        if not self._states:
            return self._of_the_literature()
        if missing := [v.name for v in self._states if v.name not in self._rates]:
            raise ProblemError(f"{self.name}: no dynamics for {', '.join(missing)}; allowed: one for each state")
        if self._duration is None:
            raise ProblemError(f"{self.name}: no duration is given; allowed: duration() or free_duration()")
        x, u = _column(v.symbol for v in self._states), _column(v.symbol for v in self._controls)
        t, p, final_time = self.t, _column(symbol for _, symbol, _ in self._parameters), self._final_time
        rates = ca.vertcat(*(self._rates[v.name] for v in self._states))
        along, at_end = [x, u, t, p], [x, final_time, p]
        times, states, controls = self._guesses()
        guess, shortest, longest = self._duration
        return ProblemFunctions(
            name=self.name,
            states=tuple(v.name for v in self._states),
            controls=tuple(v.name for v in self._controls),
            parameters=tuple(name for name, _, _ in self._parameters),
            dynamics=self._function("f", along, rates, "dynamics"),
            running_cost=self._function("L", along, self._running, "running cost"),
            terminal_cost=self._function("Psi", at_end, self._terminal, "terminal cost"),
            path=self._function("d", along, self._path.column, "path constraints"),
            initial=self._function("i", [x, p], self._initial.column, "start"),
            final=self._function("s", at_end, self._final.column, "end"),
            state_bounds=_bounds(self._states),
            control_bounds=_bounds(self._controls),
            path_bounds=self._path.interval,
            initial_bounds=self._initial.interval,
            final_bounds=self._final.interval,
            duration_bounds=(shortest, longest),
            state_scale=np.array([v.scale for v in self._states]),
            control_scale=np.array([v.scale for v in self._controls]),
            nominal=np.array([nominal for _, _, nominal in self._parameters], float),
            guess_times=times,
            guess_states=states,
            guess_controls=controls,
            guess_duration=guess,
        )

    def __repr__(self) -> str:
        states, controls = ([each.name for each in declared] for declared in (self._states, self._controls))
        return f"OptimalControlProblem({self.name!r}, states {states}, controls {controls})"

    def _of_the_literature(self) -> ProblemFunctions:
        """The problem of this name whose optimum is known."""
        if not KNOWN:
            raise ProblemError(f"{self.name}: no state is declared; allowed: at least one")
        if self.name not in KNOWN:
            known = allowed_for(self.name, list(KNOWN))
            raise ProblemError(f"{self.name}: no state is declared, and no problem with a known optimum; {known}")
        return KNOWN[self.name]()

    def _declare(
        self, among: list[_Variable], name: str, lower: float, upper: float, scale: float, guess: Sequence[float]
    ) -> ca.SX:
        self._check_name(name)
        _check_limits(f"{self.name}: {name}", lower, upper)
        if not (math.isfinite(scale) and scale > 0.0):
            raise ProblemError(f"{self.name}: {name}: scale = {scale!r}; allowed: a finite value > 0")
        if not len(guess) or not np.isfinite(guess).all():
            raise ProblemError(f"{self.name}: {name}: guess = {list(guess)!r}; allowed: finite numbers, at least one")
        symbol = ca.SX.sym(name)
        among.append(_Variable(name, symbol, lower, upper, scale, guess))
        return symbol

    def _check_name(self, name: str) -> None:
        taken = [v.name for v in (*self._states, *self._controls)] + [name for name, _, _ in self._parameters]
        if not name or name in taken:
            raise ProblemError(f"{self.name}: variable {name!r} is empty or taken; allowed: other than {taken}")

    def _find(self, symbol: ca.SX, among: list[_Variable], where: str) -> _Variable:
        for variable in among:
            if ca.is_equal(variable.symbol, symbol):
                return variable
        raise ProblemError(f"{self.name}: {where}: {symbol} is not a state; allowed: {[v.name for v in among]}")

    def _function(self, name: str, arguments: list[ca.SX], result: ca.SX, what: str) -> ca.Function:
        known = ca.vertcat(*arguments)
        free = [s for s in ca.symvar(result) if not ca.depends_on(s, known)]
        if free:
            raise ProblemError(f"{self.name}: the {what} depend on {free}, which is not among {ca.symvar(known)}")
        return ca.Function(name, arguments, [result])

    def _guesses(self) -> tuple[Array, Array, Array]:
        """All guesses at the union of their break times."""
        variables = [*self._states, *self._controls]
        times = np.unique(np.concatenate([np.linspace(0.0, 1.0, max(2, len(v.guess))) for v in variables]))

        def spread(over: list[_Variable]) -> Array:
            columns = [np.interp(times, np.linspace(0.0, 1.0, len(v.guess)), v.guess) for v in over]
            return np.array(columns).T.reshape(len(times), len(over))

        return times, spread(self._states), spread(self._controls)


def _column(symbols: Iterable[ca.SX]) -> ca.SX:
    parts = list(symbols)
    return ca.vertcat(*parts) if parts else ca.SX(0, 1)


def _bounds(variables: list[_Variable]) -> Interval:
    return Interval(np.array([v.lower for v in variables], float), np.array([v.upper for v in variables], float))


def _check_limits(where: str, lower: float, upper: float) -> None:
    if not lower <= upper or lower == math.inf or upper == -math.inf:  # NaN too
        raise ProblemError(f"{where}: lower = {lower!r}, upper = {upper!r}; allowed: lower <= upper")
