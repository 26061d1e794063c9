"""Compiled functions, bounds, scales and guess of an optimal control problem: the input of the transcriptions.

``mathnavi.controllers.ocp.problem`` states a problem and makes these functions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import NamedTuple

import casadi as ca
import numpy as np

from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.short_tables import Row, html_table, short_table
from mathnavi.interfaces.signals import Array

MOST_ROWS = 12  # of one kind


def limits_text(lower: float, upper: float) -> str:
    """Limits in a few characters: "0 to 1", ">= 0", "= 3", "free"."""
    if lower == upper:
        return f"= {lower:.4g}"
    if math.isinf(lower) and math.isinf(upper):
        return "free"
    if math.isinf(lower):
        return f"<= {upper:.4g}"
    return f">= {lower:.4g}" if math.isinf(upper) else f"{lower:.4g} to {upper:.4g}"


def limit_rows(kind: str, limited: Sequence[tuple[str, float, float]]) -> list[Row]:
    """A row for each name of a kind with its limits (name, lower, upper); the last row counts what is too many."""
    rows = [(f"{kind} {name}".strip(), limits_text(lower, upper), "") for name, lower, upper in limited[:MOST_ROWS]]
    more = len(limited) - MOST_ROWS
    return rows if more <= 0 else [*rows, (f"{more} more of {kind}", "", "")]


def duration_row(lower: float, upper: float) -> Row:
    """The row of the final time."""
    return "T", limits_text(lower, upper), "s"


DURATION_LIMITS = (1e-3, 1e9)
"""default limits [s] of a free final time: they bound the search, no solution ends there"""


class Interval(NamedTuple):
    """Lower and upper limits, arrays of one shape (n,): infinite for no limit, equal for a fixed value."""

    lower: Array
    upper: Array


def _less(limits: Interval, values: ca.DM) -> Interval:
    """Limits minus the constrained expressions without their states; unchanged where that is not finite."""
    own = values.full()[:, 0]
    shift = np.where(np.isfinite(own), own, 0.0)
    return Interval(limits.lower - shift, limits.upper - shift)


@dataclass(frozen=True, eq=False)
class GuessedTrajectory:
    """A guess of a whole trajectory, straight between its times and constant beyond them."""

    times: Array  # (k,) in [0, 1], fractions of T
    states: Array  # (k, nx)
    controls: Array  # (k, nu)
    duration: float  # [s] T

    def states_at(self, fractions: Array) -> Array:
        """States (n, nx) at fractions (n,) of T."""
        return self._at(self.states, fractions)

    def controls_at(self, fractions: Array) -> Array:
        """Controls (n, nu) at fractions (n,) of T."""
        return self._at(self.controls, fractions)

    def _at(self, values: Array, fractions: Array) -> Array:
        columns = [np.interp(fractions, self.times, column) for column in values.T]
        return np.array(columns).T.reshape(len(fractions), values.shape[1])


@dataclass(frozen=True, eq=False, repr=False)
class InstantFunctions:
    """Functions of what is stated at m given times, of the states there, X (m nx,), one time after the other."""

    fractions: Array  # (m,) of T, increasing, in [0, 1]
    cost: ca.Function  # Σ_k Psi_k(X, p) -> ()
    rows: ca.Function  # c(X, p) -> (nc,)
    bounds: Interval  # (nc,)
    names: tuple[str, ...]  # nc


@dataclass(frozen=True, eq=False, repr=False)
class ProblemFunctions:
    """An optimal control problem as compiled functions with their limits; every function is CasADi's, over SX columns.

    ``nx`` states, ``nu`` controls, ``np`` parameters. The scales are typical magnitudes: a solver sees x / x_scale.
    """

    name: str
    states: tuple[str, ...]  # nx names
    controls: tuple[str, ...]  # nu names
    parameters: tuple[str, ...]  # np names
    dynamics: ca.Function  # f(x, u, t, p) -> (nx,)
    running_cost: ca.Function  # L(x, u, t, p) -> ()
    terminal_cost: ca.Function  # Psi(x, T, p) -> ()
    path: ca.Function  # d(x, u, t, p) -> (nd,)
    initial: ca.Function  # i(x, p) -> (ni,)
    final: ca.Function  # s(x, T, p) -> (ns,)
    state_bounds: Interval  # (nx,) each
    control_bounds: Interval  # (nu,)
    path_bounds: Interval  # (nd,)
    initial_bounds: Interval  # (ni,)
    final_bounds: Interval  # (ns,)
    path_names: tuple[str, ...]  # nd texts or names of the constraints
    initial_names: tuple[str, ...]  # ni
    final_names: tuple[str, ...]  # ns
    duration_bounds: tuple[float, float]  # [s] equal for a fixed T
    state_scale: Array  # (nx,)
    control_scale: Array  # (nu,)
    nominal: Array  # (np,) values of the parameters by default
    guess_times: Array  # (k,) in [0, 1], fractions of T
    guess_states: Array  # (k, nx)
    guess_controls: Array  # (k, nu)
    guess_duration: float  # [s]
    breaks: tuple[float, ...] = ()  # in ]0, 1[, fractions of T at which a node is placed, increasing
    break_times: tuple[float, ...] = ()  # [s] of a free T, at which a node is placed where T is later, increasing
    instants: InstantFunctions | None = None  # what is stated at given times
    clocks: tuple[str, ...] = ()  # of several phases, those that have a time of their own (see ``clocks``)

    def __repr__(self) -> str:
        """A short table: states, controls, constraints and ends with their limits, and parameters."""
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        """The same table, for a notebook."""
        return html_table(*self._table())

    def _table(self) -> tuple[str, list[Row]]:
        rows: list[Row] = []
        nothing = ca.DM.zeros(self.nx)  # an end is stated as x - value = 0, and shown as x = value
        for kind, names, limits in (
            ("state", self.states, self.state_bounds),
            ("control", self.controls, self.control_bounds),
            ("path", self.path_names, self.path_bounds),
            ("", self.initial_names, _less(self.initial_bounds, self.initial(nothing, self.nominal))),
            ("", self.final_names, _less(self.final_bounds, self.final(nothing, self.guess_duration, self.nominal))),
        ):
            rows += limit_rows(kind, list(zip(names, limits.lower.tolist(), limits.upper.tolist(), strict=True)))
        if self.instants is not None:
            rows += limit_rows("", list(zip(self.instants.names, *map(list, self.instants.bounds), strict=True)))
        known = zip(self.parameters, self.nominal.tolist(), strict=True)
        return self.name, [
            *rows,
            *limit_rows("parameter", [(name, value, value) for name, value in known]),
            duration_row(*self.duration_bounds),
        ]

    @property
    def nx(self) -> int:
        """Number of states."""
        return len(self.states)

    @property
    def nu(self) -> int:
        """Number of controls."""
        return len(self.controls)

    @property
    def guess(self) -> GuessedTrajectory:
        """The stated guess."""
        return GuessedTrajectory(self.guess_times, self.guess_states, self.guess_controls, self.guess_duration)

    @property
    def free_duration(self) -> bool:
        """True if T is an unknown."""
        return self.duration_bounds[0] < self.duration_bounds[1]

    def values(self, **parameters: float | Sequence[float]) -> Array:
        """Values (np,) of the parameters: the nominal ones, or those given by name; for a vector all its components.

        ProblemError for an unknown name, a value that is not finite and a vector of another size.
        """
        values = self.nominal.copy()
        for name, given in parameters.items():
            places = self._places(name)
            numbers = [given] if np.ndim(given) == 0 else list(np.ravel(np.asarray(given, object)))
            if len(numbers) != len(places):
                raise ProblemError(f"{self.name}: parameter {name} = {given!r}; allowed: {len(places)} numbers")
            for place, value in zip(places, numbers, strict=True):
                if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
                    raise ProblemError(f"{self.name}: parameter {name} = {value!r}; allowed: a finite number")
                values[place] = value
        return values

    def values_by_name(self, parameters: Mapping[str, float | Sequence[float]] | None) -> Array:
        """Values (np,) from a mapping, nominal for None; errors as of ``values``, also for what is not a mapping."""
        if parameters is None:
            return self.nominal.copy()
        if not isinstance(parameters, Mapping):
            raise ProblemError(f"{self.name}: parameters = {parameters!r:.80}; allowed: values by name")
        return self.values(**{str(name): value for name, value in parameters.items()})

    def _places(self, name: str) -> list[int]:
        """Place of a parameter, or those of the components of a vector."""
        places = [k for k, own in enumerate(self.parameters) if own == name or own.startswith(f"{name}[")]
        if not places:
            known = ", ".join(self.parameters) or "none"
            raise ProblemError(f"{self.name}: parameter {name!r} is not known; allowed: {known}")
        return places


def check_problem(problem: object) -> None:
    """Raise ProblemError for a problem that is not a ``ProblemFunctions``, such as an ``OptimalControlProblem``."""
    if not isinstance(problem, ProblemFunctions):
        raise ProblemError(
            f"problem = {first_line(problem)}; allowed: ProblemFunctions, such as OptimalControlProblem.functions()"
        )


def first_line(value: object) -> str:
    """Name of a value in an error of one line: the first line of its representation."""
    return f"{repr(value).partition(chr(10))[0]:.120}"
