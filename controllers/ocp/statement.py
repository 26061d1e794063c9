"""A statement: the variables, expressions and limits of an optimal control problem as they were written, scalar by
scalar."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.comparisons import Row
from mathnavi.controllers.ocp.expressions import check_symbols, column, expression, numbers_of, scalars
from mathnavi.controllers.ocp.guesses import Component, Simulation, components
from mathnavi.controllers.ocp.problem_functions import Interval
from mathnavi.sim.interfaces.errors import ProblemError


@dataclass
class Variable:
    """A scalar state or control, or a component of a vector."""

    name: str
    symbol: ca.SX
    lower: float
    upper: float
    scale: float | None  # None for the automatic one
    guess: Component


@dataclass(frozen=True)
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


@dataclass
class Statement:
    """All that is stated of a problem."""

    name: str
    t: ca.SX = field(default_factory=lambda: ca.SX.sym("t"))  # [s]
    final_time: ca.SX = field(default_factory=lambda: ca.SX.sym("T"))  # [s] since the start
    start_time: ca.SX = field(default_factory=lambda: ca.SX(0))  # [s] t at the start
    states: list[Variable] = field(default_factory=list)
    controls: list[Variable] = field(default_factory=list)
    parameters: list[Parameter] = field(default_factory=list)
    rates: dict[str, ca.SX] = field(default_factory=dict)  # by state
    running: ca.SX = field(default_factory=lambda: ca.SX(0))
    terminal: ca.SX = field(default_factory=lambda: ca.SX(0))
    path: list[Row] = field(default_factory=list)
    initial: list[Row] = field(default_factory=list)
    final: list[Row] = field(default_factory=list)
    starts: dict[str, ca.SX] = field(default_factory=dict)  # x(0) by state, of those that have one value
    ends: dict[str, ca.SX] = field(default_factory=dict)  # x(T) likewise
    duration: Duration | None = None
    simulation: Simulation | None = None

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

    # what is stated, checked

    def declare(self, kind: str, name: str, size: int, lower: Any, upper: Any, scale: Any, guess: Any) -> ca.SX:
        """Declare a "state" or a "control" of ``size`` components; returns its symbol (size, 1).

        ProblemError for a name that is taken, and for limits, scales and guesses that are none.
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
        """The states of a symbol (n, 1); ProblemError names ``where`` it stands if it is none."""
        found = [self.variable(each) for each in scalars(expression(f"{self.name}: {where} of", states))]
        known = [v.name for v in self.states]
        variables = [v for v in found if v is not None and v.name in known]
        if len(variables) < len(found) or not found:
            raise ProblemError(f"{self.name}: {where}: {states} is not a state; allowed: {known}")
        return variables

    def pin(self, where: Literal["start", "end"], states: Any, value: Any) -> None:
        """State x(0) = value or x(T) = value of one state or several.

        ProblemError for no state, a second value, and a value outside the state's bounds.
        """
        pinned, among = (self.starts, self.initial) if where == "start" else (self.ends, self.final)
        known = self.p if where == "start" else ca.vertcat(self.final_time, self.p)
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
        if value.is_constant() and not variable.lower <= float(value) <= variable.upper:
            raise ProblemError(
                f"{self.name}: {label} = {value}, outside its bounds; allowed: {variable.lower:g} to {variable.upper:g}"
            )

    def tighten(self, variable: Variable, row: Row) -> None:
        """Bound a state or a control by a constraint on it alone; ProblemError where nothing is left."""
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
        """Names of the states, controls and parameters."""
        return [each.name for each in (*self.states, *self.controls, *self.parameters)]


def limits(rows: list[Row]) -> Interval:
    """Lower and upper limits (n,) of rows."""
    return Interval(np.array([row.lower for row in rows], float), np.array([row.upper for row in rows], float))


def bounds(variables: list[Variable]) -> Interval:
    """Bounds (n,) of variables."""
    return Interval(np.array([v.lower for v in variables], float), np.array([v.upper for v in variables], float))


def _check_limits(where: str, lower: float, upper: float) -> None:
    if not lower <= upper or lower == math.inf or upper == -math.inf:  # NaN too
        raise ProblemError(f"{where}: lower = {lower!r}, upper = {upper!r}; allowed: lower <= upper")
