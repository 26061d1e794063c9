"""Multipliers of a solution by name: costates, path constraints, bounds and ends.

With the Lagrangian of the continuous problem

    J + ∫ λ'(f - x') + μ'd(x, u, t) + μ_x'x + μ_u'u dt + ν_0'i(x(0)) + ν's(x(T), T) + κ T

a multiplier is positive where an upper limit holds back, negative where a lower one does, and zero where neither does.
A limit that is raised by δ changes the least J by -δ times its multiplier (along the path: times its integral).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from mathnavi.controllers.ocp.problem_functions import ProblemFunctions
from mathnavi.sim.interfaces.checks import allowed_for
from mathnavi.sim.interfaces.short_tables import short_table
from mathnavi.sim.interfaces.signals import Array

_LONGEST_NAME = 40  # characters of an expression that names a row


def column_of(name: str, names: Sequence[str]) -> int | list[int] | None:
    """The place of a name among others, or those of the components of a vector "x": "x[0]", "x[1]", ...; or None."""
    if name in names:
        return names.index(name)
    components = [k for k, other in enumerate(names) if other.startswith(f"{name}[") and other.endswith("]")]
    return components or None


@dataclass(frozen=True, eq=False, repr=False)
class NamedValues(Mapping[str, Array]):
    """Values (..., n) of which each of n names has its own (...,), and a vector "x" those of "x[0]", "x[1]", ..."""

    names: tuple[str, ...]
    values: Array

    def __getitem__(self, name: str) -> Array:
        """Values (...,) of a name, or (..., k) of a vector of k components; KeyError names those that exist."""
        column = column_of(name, self.names)
        if column is None:
            raise KeyError(f"{name!r} is none of these; {allowed_for(name, self.names)}")
        own: Array = self.values[..., column]
        return own

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __repr__(self) -> str:
        """A short table: each name with its value, or the range of its values."""
        rows = [(name, _range_text(self[name]), "") for name in self.names]
        return short_table(f"{len(rows)} by name, shape {self.values.shape[:-1]}", rows)


def _range_text(values: Array) -> str:
    if np.ndim(values) == 0:
        return f"{float(values):.6g}"
    return f"{values.min():.4g} to {values.max():.4g}" if values.size else "-"


@dataclass(frozen=True, eq=False, repr=False)
class Multipliers:
    """Multipliers by the names of states, controls and constraints; see the module for signs and units.

    Those along the path belong to ``Solution.point_times`` (N - 1, k).
    """

    dynamics: NamedValues  # (N - 1, k, nx) costates λ, H = L + λ'f
    path: NamedValues  # (N - 1, k, nd) μ of path constraints, per second
    states: NamedValues  # (N - 1, k, nx) μ_x of the states' bounds, per second
    controls: NamedValues  # (N - 1, k, nu) μ_u of the controls' bounds, per second
    initial: NamedValues  # (ni,) ν_0 of the conditions at the start
    final: NamedValues  # (ns,) ν of the conditions at the end
    duration: float  # κ of the bounds of T, 0 where T is fixed

    def __repr__(self) -> str:
        """A short table: every multiplier with its value, or the range of its values."""
        kinds = {
            "costate": self.dynamics,
            "path": self.path,
            "bound": self.states,
            "bound ": self.controls,
            "start": self.initial,
            "end": self.final,
        }
        rows = [
            (f"{kind.strip()} {name}", _range_text(all_[name]), "") for kind, all_ in kinds.items() for name in all_
        ]
        return short_table("multipliers", [*rows, ("duration", f"{self.duration:.6g}", "")])


class RowNames(NamedTuple):
    """Names of the rows of a problem's constraints."""

    path: tuple[str, ...]  # (nd,)
    initial: tuple[str, ...]  # (ni,)
    final: tuple[str, ...]  # (ns,)


@lru_cache(maxsize=64)
def row_names(problem: ProblemFunctions) -> RowNames:
    """Names of a problem's rows: the state of an end condition, or the expression that is constrained.

    A long expression, and one that comes twice, is called by its place: "path 0", "start 1", "end 2".
    """
    x, u, t, T = _symbols(problem.states), _symbols(problem.controls), ca.SX.sym("t"), ca.SX.sym("T")
    p = _symbols(problem.parameters)
    return RowNames(
        _names("path", problem.path(x, u, t, p), ()),
        _names("start", problem.initial(x, p), problem.states),
        _names("end", problem.final(x, T, p), problem.states),
    )


def _expression(row: ca.SX) -> str:
    """A row as text, without brackets around all of it."""
    text = str(row)
    inner = text[1:-1]
    return inner if text.startswith("(") and "(" not in inner and text.endswith(")") else text


def _symbols(names: tuple[str, ...]) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *(ca.SX.sym(name) for name in names))


def _names(kind: str, rows: ca.SX, states: tuple[str, ...]) -> tuple[str, ...]:
    texts = []
    for row in ca.vertsplit(rows) if rows.numel() else []:
        own = [symbol for symbol in ca.symvar(row) if symbol.name() in states]
        alone = len(own) == 1 and ca.jacobian(row, own[0]).is_one()
        texts.append(own[0].name() if alone else _expression(row))
    return tuple(
        text if len(text) <= _LONGEST_NAME and texts.count(text) == 1 else f"{kind} {k}" for k, text in enumerate(texts)
    )
