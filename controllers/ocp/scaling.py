"""Scales of a statement's variables: typical magnitudes, over which a solver sees them.

A stated scale stays. Otherwise, with the largest magnitude of guess and ends, the limits, and the reach

    R_i = max over u of the median over the guess of |f_i| τ_i,      A = ∂f/∂x,
    τ_i = min(T, 1 / max(0, -A_ii), 1 / sqrt(max(0, -Σ_{j≠i} A_ij A_ji))),

how far the rates carry a state before T ends, or the state's own decay or oscillation ends it, under the guessed and
some possible controls,

    control      its guess, or two limits more than ten times that, else a single limit, else 1;
    state        guess and ends, else the lesser of R and two limits, else what is there of R and a limit, else 1;
    constant c   guess and limits, else the change that moves some state by its scale, 1 / max_i |∂f_i/∂c| τ_i / s_i,
                 somewhere along the guess; 1 where that is from 0.01 to 100.

Rounding noise, as sin π leaves it, is no magnitude: for a state, less than 1e-6 of R; for a control, or a state that
nothing moves, at most 1e-12 of the largest number that is stated; for a rate, as cos π/2 leaves it, less than 1e-6 of
what the other states change it by, Σ_j |A_ij| s_j, which then takes its place in R. The components of one vector share
the largest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.expressions import column
from mathnavi.controllers.ocp.guesses import Derived
from mathnavi.controllers.ocp.statement import Statement, Variable
from mathnavi.interfaces.short_tables import Row, html_table, short_table
from mathnavi.interfaces.signals import Array

NOTHING = "nothing known"
"""origin of a scale of 1 that no number suggests"""

_REACH = "derivative"  # origin of a scale that is R
_LEAST_SHARE = 1e-6  # of what the rates reach, below which the magnitude of a state is noise
_FAIR_SHARE = 0.1  # of the limits of a control, from which its guess says more than they do
_ROUNDING = 1e-12  # of the largest number that is stated
_POINTS = 11  # along the guess, for the median of the rates
_SHARES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # of the range of the controls, for what they can do
_ORDINARY = (1e-2, 1e2)  # scales of a constant that 1 does as well
_MOST_ROWS = 40


@dataclass(frozen=True)
class Scale:
    """A scale > 0 and where it comes from: "stated", "guess", "ends", "bounds", "derivative" or "nothing known"."""

    value: float
    origin: str


class Scaling(Mapping[str, float]):
    """Scales of states, controls and T by name; ``cost`` and ``constraints`` are what a solver divides J and rows by.

    ``origins`` says where each comes from. A cost or a constraint of ordinary size has the scale 1.
    """

    def __init__(
        self, name: str, variables: Mapping[str, Scale], cost: Scale, constraints: Sequence[tuple[str, Scale]]
    ) -> None:
        self.name, self.cost, self.constraints = name, cost, tuple(constraints)
        self._variables = dict(variables)

    @property
    def origins(self) -> dict[str, str]:
        """Scale of each variable, and where it comes from."""
        return {name: scale.origin for name, scale in self._variables.items()}

    def __getitem__(self, name: str) -> float:
        """Scale of a state, a control or T; KeyError for another name."""
        return self._variables[name].value

    def __iter__(self) -> Iterator[str]:
        return iter(self._variables)

    def __len__(self) -> int:
        return len(self._variables)

    def __repr__(self) -> str:
        """A short table: each scale with where it comes from."""
        return short_table(*self._table())

    def _repr_html_(self) -> str:
        """The same table, for a notebook."""
        return html_table(*self._table())

    def _table(self) -> tuple[str, list[Row]]:
        scales = [*self._variables.items(), ("J", self.cost), *self.constraints]
        rows = [(name, f"{scale.value:.4g}", scale.origin) for name, scale in scales[:_MOST_ROWS]]
        more = len(scales) - _MOST_ROWS
        return f"Scales of {self.name!r}", rows if more <= 0 else [*rows, (f"{more} more", "", "")]


def variable_scales(
    statement: Statement, times: Array, x: Array, u: Array, p: Array
) -> tuple[list[Scale], list[Scale]]:
    """Scales of the states and of the controls of a statement.

    Args:
        statement: with a duration; a state without dynamics counts as one that nothing moves.
        times: (k,) [s] of the guess.
        x: (k, nx) guess of the states.
        u: (k, nu) guess of the controls.
        p: (np,) values of the parameters.
    """
    most = _largest_number(statement, x, u)
    controls = [_of_control(v, own, most) for v, own in zip(statement.controls, u.T, strict=True)]
    controls = _shared(statement.controls, controls)
    rates = _Rates(statement, times, x, u, p)
    reach = rates.reach(np.array([scale.value for scale in controls]))

    def scaled(reach: Array) -> list[Scale]:
        return [
            _of_state(v, own, _ends(statement, v), float(far), most)
            for v, own, far in zip(statement.states, x.T, reach, strict=True)
        ]

    states = scaled(reach)
    others = rates.by_others(np.array([0.0 if scale.origin == NOTHING else scale.value for scale in states]))
    noise = (reach > 0.0) & (reach < _LEAST_SHARE * others)
    states = scaled(np.where(noise, others, reach))
    for k, size in rates.of_constants(np.array([scale.value for scale in states])):
        if states[k].origin == NOTHING:
            states[k] = Scale(size, _REACH)
    states = _shared(statement.states, states)
    for k, variable in enumerate(statement.states):
        if variable.scale is None and isinstance(variable.guess, Derived) and variable.guess.start_of:
            source = [v.name for v in statement.states].index(variable.guess.start_of)
            states[k] = Scale(states[source].value, f"as {variable.guess.start_of}")
    return states, controls


def _pinned(stated: ca.SX | None) -> float:
    """A stated end if it is a number, otherwise 0."""
    return float(stated) if stated is not None and stated.is_constant() else 0.0


def _ends(statement: Statement, variable: Variable) -> float:
    """Largest magnitude of what a variable starts and ends at."""
    return max(abs(_pinned(stated.get(variable.name))) for stated in (statement.starts, statement.ends))


def _largest_number(statement: Statement, x: Array, u: Array) -> float:
    variables = [*statement.states, *statement.controls]
    limits = [abs(limit) for v in variables for limit in (v.lower, v.upper) if math.isfinite(limit)]
    guesses = [float(np.abs(values).max(initial=0.0)) for values in (x, u)]
    return max([*limits, *guesses, *(_ends(statement, v) for v in variables)], default=0.0)


def _range(variable: Variable) -> float:
    """Largest magnitude between two finite limits, 0 where one is missing."""
    both = math.isfinite(variable.lower) and math.isfinite(variable.upper)
    return max(abs(variable.lower), abs(variable.upper)) if both else 0.0


def _single_limit(variable: Variable) -> float:
    return max((abs(limit) for limit in (variable.lower, variable.upper) if math.isfinite(limit)), default=0.0)


def _first(*known: tuple[float, str]) -> Scale:
    """The first magnitude that is not 0."""
    return next((Scale(value, origin) for value, origin in known if value > 0.0), Scale(1.0, NOTHING))


def _of_control(variable: Variable, guess: Array, most: float) -> Scale:
    if variable.scale is not None:
        return Scale(variable.scale, "stated")
    guessed = float(np.abs(guess).max(initial=0.0))
    guessed = 0.0 if guessed <= _ROUNDING * most else guessed
    limit = _range(variable)
    if guessed >= _FAIR_SHARE * limit and guessed > 0.0:
        return Scale(guessed, "guess")
    return _first((limit, "bounds"), (guessed, "guess"), (_single_limit(variable), "bounds"))


def _of_state(variable: Variable, guess: Array, ends: float, reach: float, most: float) -> Scale:
    if variable.scale is not None:
        return Scale(variable.scale, "stated")
    guessed = float(np.abs(guess).max(initial=0.0))
    known, origin = (ends, "ends") if ends >= guessed else (guessed, "guess")
    noise = known < _LEAST_SHARE * reach if reach > 0.0 else known <= _ROUNDING * most
    if known > 0.0 and not noise:
        return Scale(known, origin)
    limit = _range(variable)
    if 0.0 < limit < reach:
        return Scale(limit, "bounds")
    return _first((reach, _REACH), (limit, "bounds"), (_single_limit(variable), "bounds"))


def _shared(variables: Sequence[Variable], scales: list[Scale]) -> list[Scale]:
    """Scales of which the automatic ones of one vector are all its largest; one of which nothing is known yields."""
    shared = list(scales)
    for vector in {_vector(v.name) for v in variables} - {""}:
        own = [k for k, v in enumerate(variables) if _vector(v.name) == vector]
        known = [k for k in own if scales[k].origin != NOTHING]
        if not known:
            continue
        largest = max(known, key=lambda k: scales[k].value)
        origin = f"{scales[largest].origin} of {variables[largest].name}"
        for k in own:
            if variables[k].scale is None and k != largest:
                shared[k] = Scale(scales[largest].value, origin)
    return shared


def shared_by_phases(phases: Mapping[str, tuple[Sequence[Variable], Sequence[Scale]]]) -> dict[str, list[Scale]]:
    """Scales of the states of several phases: one of which no number is stated has the largest of its name.

    R is how far a state is carried, not where it begins, and that may be told by another phase alone.

    Args:
        phases: states of each phase, by name, and their own scales.
    """
    largest: dict[str, Scale] = {}
    for phase, (states, scales) in phases.items():
        for variable, scale in zip(states, scales, strict=True):
            name = _state(variable)
            if scale.origin != NOTHING and (name not in largest or scale.value > largest[name].value):
                largest[name] = Scale(scale.value, f"{scale.origin} of {phase}.{variable.name}")

    def shared(states: Sequence[Variable], scales: Sequence[Scale]) -> list[Scale]:
        origins = {v.name: scale.origin for v, scale in zip(states, scales, strict=True)}
        unstated = {name for name, origin in origins.items() if origin == NOTHING or origin.startswith(_REACH)}
        known = [largest.get(_state(v), scale) for v, scale in zip(states, scales, strict=True)]
        return [
            far if _state(v) in unstated and far.value != scale.value else scale
            for v, scale, far in zip(states, scales, known, strict=True)
        ]

    return {phase: shared(*own) for phase, own in phases.items()}


def _state(variable: Variable) -> str:
    """Name of a state, or of the one whose start a constant is."""
    own = variable.guess
    return (own.start_of if isinstance(own, Derived) else "") or variable.name


def _vector(name: str) -> str:
    """Name of the vector of which a variable is a component; empty for none."""
    return name.rpartition("[")[0] if name.endswith("]") else ""


class _Rates:
    """Rates of the states along a guess, and their derivatives."""

    def __init__(self, statement: Statement, times: Array, x: Array, u: Array, p: Array) -> None:
        """Sample the guess x (k, nx), u (k, nu) at times (k,) [s], with parameters p (np,)."""
        self._statement, self._p = statement, np.tile(p[:, None], (1, _POINTS))
        self._duration, self._times = float(times[-1] - times[0]), np.linspace(times[0], times[-1], _POINTS)
        self._x, self._u = (
            np.array([np.interp(self._times, times, each) for each in values.T]).T.reshape(_POINTS, -1)
            for values in (x, u)
        )
        rates = column(statement.rates.get(v.name, ca.SX(0)) for v in statement.states)
        self._constant = np.array([rates[k].is_zero() for k in range(len(statement.states))], bool)
        A = ca.jacobian(rates, statement.x)
        loops = ca.diag(ca.mtimes(A, A)) - ca.diag(A) ** 2
        known = [ca.densify(each) for each in (rates, ca.diag(A), loops, ca.vec(A))]
        self._function = ca.Function("rates", statement.along, known, {"cse": True}).map(_POINTS)

    def reach(self, sizes: Array) -> Array:
        """R (nx,) under the guessed and the possible controls, which without a limit go as far as their size (nu,)."""
        controls = self._statement.controls
        lower, upper = (
            np.array(
                [limit if math.isfinite(limit) else side * size for limit, size in zip(limits, sizes, strict=True)]
            )
            for side, limits in ((-1.0, [v.lower for v in controls]), (1.0, [v.upper for v in controls]))
        )
        reach = np.zeros(len(self._constant))
        for share in (None, *_SHARES):
            u = self._u if share is None else np.tile((1.0 - share) * lower + share * upper, (_POINTS, 1))
            f, times, _ = self._at(u)
            with np.errstate(invalid="ignore"):
                reach = np.fmax(reach, _medians(np.abs(f) * times))
        return reach

    def by_others(self, scales: Array) -> Array:
        """Distance (nx,) that the rates carry a state once the others move by their scales (nx,); 0 if unknown."""
        _, times, A = self._at(self._u)
        with np.errstate(invalid="ignore"):
            return _medians(np.einsum("ijk,j->ik", np.abs(A), scales) * times)

    def of_constants(self, scales: Array) -> Iterator[tuple[int, float]]:
        """Index of each constant with a change that moves a state by its scale, of (nx,), unless that is ordinary."""
        _, times, A = self._at(self._u)
        with np.errstate(invalid="ignore"):
            moved = np.abs(A) * (times / scales[:, None])[:, None, :]
        for k in np.flatnonzero(self._constant):
            own = moved[~self._constant, k]
            most = float(own[np.isfinite(own)].max(initial=0.0))
            if most > 0.0 and not _ORDINARY[0] <= 1.0 / most <= _ORDINARY[1]:
                yield int(k), 1.0 / most

    def _at(self, u: Array) -> tuple[Array, Array, Array]:
        """f (nx, m), τ (nx, m) and A (nx, nx, m) at the m points of the guess under controls (m, nu)."""
        made = self._function(self._x.T, u.T, self._times[None, :], self._p)
        f, own, loop, A = (np.array(each.full()) for each in made)
        with np.errstate(invalid="ignore"):
            times = 1.0 / np.fmax(np.fmax(-own, np.sqrt(np.fmax(-loop, 0.0))), 1.0 / self._duration)
        return f, times, A.reshape(len(f), len(f), -1, order="F")


def _medians(rows: Array) -> Array:
    """Median of what is finite in each row, 0 for nothing."""
    finite = [row[np.isfinite(row)] for row in rows]
    return np.array([float(np.median(row)) if len(row) else 0.0 for row in finite])
