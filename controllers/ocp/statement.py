"""A statement: the variables, expressions and limits of an optimal control problem as written, scalar by scalar."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.comparisons import Row
from mathnavi.controllers.ocp.expressions import check_symbols, column, expression, kinks, number, numbers_of, scalars
from mathnavi.controllers.ocp.guesses import Component, Simulation, components
from mathnavi.controllers.ocp.problem_functions import DURATION_LIMITS, Interval
from mathnavi.interfaces.errors import ProblemError

_ROUNDING = 1e-12  # relative, by which a value may be outside a bound that it was meant to be on


@dataclass
class Variable:
    """A scalar state or control, or a component of a vector."""

    name: str
    symbol: ca.SX
    lower: float
    upper: float
    scale: float | None  # None for the automatic one
    guess: Component


@dataclass(frozen=True, eq=False)
class Parameter:
    """A parameter p, known at each solve."""

    name: str
    symbol: ca.SX
    nominal: float


@dataclass(frozen=True)
class Duration:
    """Guess and limits [s] of the final time; equal for a fixed one."""

    guess: float
    lower: float
    upper: float

    @property
    def free(self) -> bool:
        """True if the final time is an unknown."""
        return self.lower < self.upper


@dataclass(frozen=True, eq=False)
class Instant:
    """A cost and constraints at one time [s] since the start, expressions of the states there and the parameters."""

    time: float
    cost: ca.SX
    rows: tuple[Row, ...]


@dataclass
class Statement:
    """All that is stated of a problem."""

    name: str
    t: ca.SX = field(default_factory=lambda: ca.SX.sym("t"))  # [s]
    final_time: ca.SX = field(default_factory=lambda: ca.SX.sym("T"))  # [s] since the start
    elapsed: ca.SX = field(default_factory=lambda: ca.SX.sym("elapsed"))  # [s] time since the start
    start_time: ca.SX = field(default_factory=lambda: ca.SX(0))  # [s] t at the start
    states: list[Variable] = field(default_factory=list)
    controls: list[Variable] = field(default_factory=list)
    parameters: list[Parameter] = field(default_factory=list)
    shared: list[Variable] = field(default_factory=list)  # constants to be found of the problem that this is a phase of
    rates: dict[str, ca.SX] = field(default_factory=dict)  # by state
    running: ca.SX = field(default_factory=lambda: ca.SX(0))
    terminal: ca.SX = field(default_factory=lambda: ca.SX(0))
    path: list[Row] = field(default_factory=list)
    initial: list[Row] = field(default_factory=list)
    final: list[Row] = field(default_factory=list)
    instants: list[Instant] = field(default_factory=list)
    starts: dict[str, ca.SX] = field(default_factory=dict)  # x(0) by state, of those that have one value
    ends: dict[str, ca.SX] = field(default_factory=dict)  # x(T) by state, of those that have one value
    integrals: list[str] = field(default_factory=list)  # names of the states that integral() declared
    has_cost: bool = False
    duration: Duration | None = None
    simulation: Simulation | None = None

    @property
    def parts(self) -> list[object]:
        """All that is stated, part by part; none of them is ever changed, only replaced."""
        variables = (*self.states, *self.controls)
        own = [part for v in variables for part in (v.symbol, v.lower, v.upper, v.scale, v.guess)]
        rest = (self.start_time, self.running, self.terminal, self.duration, self.simulation, *self.instants)
        return [*own, *self.parameters, *self.rates.values(), *self.path, *self.initial, *self.final, *rest]

    @property
    def x(self) -> ca.SX:
        """Column (nx,) of the states."""
        return column(v.symbol for v in self.states)

    @property
    def u(self) -> ca.SX:
        """Column (nu,) of the controls."""
        return column(v.symbol for v in self.controls)

    @property
    def p(self) -> ca.SX:
        """Column (np,) of the parameters."""
        return column(each.symbol for each in self.parameters)

    @property
    def along(self) -> list[ca.SX]:
        """Arguments of what holds along the path: x, u, t, p."""
        return [self.x, self.u, self.t, self.p]

    @property
    def at_start(self) -> list[ca.SX]:
        """Arguments of what holds at the start: x, p."""
        return [self.x, self.p]

    @property
    def at_end(self) -> list[ca.SX]:
        """Arguments of what holds at the end: x, T, p."""
        return [self.x, self.final_time, self.p]

    @property
    def constants(self) -> list[ca.SX]:
        """Symbols that may stand in all that is stated: T, and the constants to be found of all phases."""
        return [self.final_time, *(v.symbol for v in self.shared)]

    @property
    def known_along(self) -> list[ca.SX]:
        """Symbols that dynamics, running cost and path constraints may depend on."""
        return [*self.along, self.elapsed, *self.constants]

    @property
    def known_at(self) -> list[ca.SX]:
        """Symbols that conditions and costs at the start, at the end or at a time between may depend on."""
        return [self.x, self.p, *self.constants]

    # what is stated, checked

    def declare(self, kind: str, name: str, size: int, lower: Any, upper: Any, scale: Any, guess: Any) -> ca.SX:
        """Declare a "state" or a "control" of ``size`` components; returns its symbol (size, 1).

        ProblemError for a name that is taken, and for invalid limits, scales and guesses.
        """
        self.check_name(name)
        where = f"{self.name}: {name}"
        if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
            raise ProblemError(f"{where}: size = {size!r:.80}; allowed: a whole number >= 1")
        lowers, uppers = (numbers_of(f"{where}: {side}", v, size) for side, v in (("lower", lower), ("upper", upper)))
        scales = [None] * size if scale is None else numbers_of(f"{where}: scale", scale, size)
        for low, high, one in zip(lowers, uppers, scales, strict=True):
            _check_limits(where, low, high)
            if one is not None and not (math.isfinite(one) and one > 0.0):
                raise ProblemError(f"{where}: scale = {one!r}; allowed: a finite value > 0")
        guesses = components(where, guess, size)
        names = [name] if size == 1 else [f"{name}[{k}]" for k in range(size)]
        symbols = [ca.SX.sym(each) for each in names]
        among = self.states if kind == "state" else self.controls
        among += [Variable(*each) for each in zip(names, symbols, lowers, uppers, scales, guesses, strict=True)]
        return column(symbols)

    def set_cost(self, running: Any, terminal: Any) -> None:
        """Set L and Psi; ProblemError if set before and for what is not a scalar of their symbols."""
        if self.has_cost:
            raise ProblemError(f"{self.name}: minimise() is called twice; allowed: once, with both parts of J")
        made = []
        for what, cost, known in (("running", running, self.known_along), ("terminal", terminal, self.known_at)):
            value = expression(f"{self.name}: the {what} cost", cost)
            if value.numel() != 1:
                raise ProblemError(f"{self.name}: the {what} cost has shape {value.shape}; allowed: one")
            check_symbols(f"{self.name}: the {what} cost", value, ca.vertcat(*known))
            if bent := kinks(value, ca.vertcat(self.t, self.elapsed)):
                warnings.warn(
                    f"{self.name}: the {what} cost has a kink ({', '.join(bent)}), where a solver may stop early; "
                    "absolute() and largest() split it",
                    stacklevel=3,
                )
            made.append(value)
        self.has_cost = True
        self.running, self.terminal = made

    def set_rates(self, states: Any, rate: Any) -> None:
        """Set x' of states (n, 1); ProblemError for what is not a state, a second rate and another shape."""
        variables = self.find(states, "dynamics")
        where = f"{self.name}: dynamics of {', '.join(v.name for v in variables)}"
        made = expression(where, rate)
        if made.numel() != len(variables) and not (made.numel() == 1 and made.is_constant()):
            raise ProblemError(f"{where} have shape {made.shape}; allowed: {len(variables)}, one for each state")
        rates = scalars(made) if made.numel() == len(variables) else [made] * len(variables)
        for variable, each in zip(variables, rates, strict=True):
            check_symbols(where, each, ca.vertcat(*self.known_along))
            if variable.name in self.rates:
                raise ProblemError(f"{self.name}: dynamics of {variable.name} are given twice; allowed: once")
            self.rates[variable.name] = each

    def set_duration(self, guess: Any, lower: Any, upper: Any) -> None:
        """Set guess and limits [s] of T; ProblemError unless they are in order, and if set before."""
        guess, lower, upper = (number(f"{self.name}: duration", value) for value in (guess, lower, upper))
        if not (0.0 < lower <= guess <= upper <= DURATION_LIMITS[1]):
            raise ProblemError(
                f"{self.name}: duration: lower = {lower!r}, guess = {guess!r}, upper = {upper!r}; "
                f"allowed: 0 < lower <= guess <= upper <= {DURATION_LIMITS[1]:g} s"
            )
        if self.duration is not None:
            raise ProblemError(f"{self.name}: the duration is given twice; allowed: once")
        self.duration = Duration(guess, lower, upper)

    def declare_parameter(self, name: str, nominal: Any) -> ca.SX:
        """Declare a parameter, or a vector of them; returns its symbol.

        ProblemError for a name that is taken and a value that is not a number.
        """
        self.check_name(name)
        size = 1 if isinstance(nominal, (str, Mapping)) else max(1, int(np.size(nominal)))
        values = numbers_of(f"{self.name}: parameter {name}", nominal, size)
        if not np.isfinite(values).all():
            raise ProblemError(f"{self.name}: parameter {name} = {nominal!r}; allowed: finite numbers")
        names = [name] if np.ndim(nominal) == 0 else [f"{name}[{k}]" for k in range(size)]
        made = [Parameter(each, ca.SX.sym(each), value) for each, value in zip(names, values, strict=True)]
        self.parameters += made
        return column(each.symbol for each in made)

    def set_guess(self, symbol: Any, values: Any, times: Any) -> None:
        """Set the guess of variables (n, 1); ProblemError for other symbols, and for an invalid guess."""
        symbols = scalars(expression(f"{self.name}: guess", symbol))
        variables = [v for each in symbols if (v := self.variable(each)) is not None]
        if len(variables) < len(symbols):
            raise ProblemError(f"{self.name}: guess of {symbol}; allowed: {', '.join(self.variable_names)}")
        where = f"{self.name}: {', '.join(v.name for v in variables)}"
        for each, guess in zip(variables, components(where, values, len(variables), times), strict=True):
            each.guess = guess

    def check_name(self, name: str) -> None:
        """Raise ProblemError for a name that is empty or taken."""
        taken = self.names
        if not isinstance(name, str) or not name or name in taken or f"{name}[0]" in taken:
            raise ProblemError(f"{self.name}: variable {name!r} is empty or taken; allowed: a text other than {taken}")

    def set_start_time(self, value: ca.SX) -> None:
        """Set t at the start [s]; ProblemError if it is given twice."""
        if not self.start_time.is_zero():
            raise ProblemError(f"{self.name}: the start time is given twice; allowed: once")
        self.start_time = value

    def variable(self, symbol: ca.SX) -> Variable | None:
        """The state or control of a symbol ()."""
        return next((v for v in (*self.states, *self.controls) if ca.is_equal(v.symbol, symbol)), None)

    def find(self, states: Any, where: str) -> list[Variable]:
        """The states of a symbol (n, 1); ProblemError, with the place ``where``, if it is not a state."""
        found = [self.variable(each) for each in scalars(expression(f"{self.name}: {where} of", states))]
        known = [v.name for v in self.states]
        variables = [v for v in found if v is not None and v.name in known]
        if len(variables) < len(found) or not found:
            raise ProblemError(f"{self.name}: {where}: {states} is not a state; allowed: {known}")
        return variables

    def pin(self, where: Literal["start", "end"], states: Any, value: Any) -> None:
        """State x(0) = value or x(T) = value of one state or several.

        ProblemError for what is not a state, a second value, and a value outside the state's bounds.
        """
        pinned, among = (self.starts, self.initial) if where == "start" else (self.ends, self.final)
        known = ca.vertcat(*self.known_at)
        variables = self.find(states, where)
        made = expression(f"{self.name}: {where} of {states}", value)
        if made.numel() not in (1, len(variables)):
            raise ProblemError(f"{self.name}: {where} of {states} has shape {made.shape}; allowed: {len(variables)}")
        values = scalars(made) if made.numel() == len(variables) else [made] * len(variables)
        for variable, each in zip(variables, values, strict=True):
            label = f"{where} of {variable.name}"
            check_symbols(f"{self.name}: {label}", each, known)
            if variable.name in pinned:
                raise ProblemError(
                    f"{self.name}: {label} = {each}, and = {pinned[variable.name]} before; allowed: one value"
                )
            self._check_inside(variable, label, each)
            pinned[variable.name] = each
            among.append(Row(variable.symbol - each, 0.0, 0.0, label))

    def _check_inside(self, variable: Variable, label: str, value: ca.SX) -> None:
        rounding = _ROUNDING * abs(float(value)) if value.is_constant() else 0.0
        if value.is_constant() and not variable.lower - rounding <= float(value) <= variable.upper + rounding:
            raise ProblemError(
                f"{self.name}: {label} = {value}, outside its bounds; allowed: {variable.lower:g} to {variable.upper:g}"
            )

    def tighten(self, variable: Variable, row: Row) -> None:
        """Bound a state or a control by a constraint on it alone; ProblemError if no value is left."""
        lower, upper = max(variable.lower, row.lower), min(variable.upper, row.upper)
        _check_limits(f"{self.name}: {variable.name} with path constraint {row.name}", lower, upper)
        variable.lower, variable.upper = lower, upper
        for where, pinned in (("start", self.starts), ("end", self.ends)):
            if variable.name in pinned:
                self._check_inside(variable, f"{where} of {variable.name}", pinned[variable.name])

    @property
    def variable_names(self) -> list[str]:
        """Names of the states and controls."""
        return [v.name for v in (*self.states, *self.controls)]

    @property
    def names(self) -> list[str]:
        """Names of the states, controls, parameters and constants of all phases."""
        parameters = (each.name for each in self.parameters)
        return [*self.variable_names, *parameters, *(v.name for v in self.shared)]


class DurationSymbol(ca.SX):
    """The symbol T [s] of a final time, which is fixed by a call."""

    def __init__(self, statement: Statement) -> None:
        """Take the symbol of a statement."""
        super().__init__(statement.final_time)
        self._statement = statement

    def __call__(self, value: float) -> ca.SX:
        """Fix the final time at ``value`` [s]; returns its symbol."""
        self._statement.set_duration(value, value, value)
        return self._statement.final_time


def limits(rows: list[Row]) -> Interval:
    """Lower and upper limits (n,) of rows."""
    return Interval(np.array([row.lower for row in rows], float), np.array([row.upper for row in rows], float))


def bounds(variables: list[Variable]) -> Interval:
    """Bounds (n,) of variables."""
    return Interval(np.array([v.lower for v in variables], float), np.array([v.upper for v in variables], float))


def _check_limits(where: str, lower: float, upper: float) -> None:
    if not lower <= upper or lower == math.inf or upper == -math.inf:  # NaN too
        raise ProblemError(f"{where}: lower = {lower!r}, upper = {upper!r}; allowed: lower <= upper")
