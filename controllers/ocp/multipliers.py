"""Multipliers of a solution by name: costates, path constraints, bounds and ends.

With the Lagrangian of the continuous problem

    J + ∫ λ'(f - x') + μ'd(x, u, t) + μ_x'x + μ_u'u dt + ν_0'i(x(0)) + ν's(x(T), T) + κ T + Σ_k ν_k'c_k(x(t_k))

a multiplier is positive where an upper limit is active, negative where a lower one is, and zero where neither is.
A limit that is raised by δ changes the least J by -δ times its multiplier (along the path: times its integral).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.short_tables import short_table
from mathnavi.interfaces.signals import Array


def column_of(name: str, names: Sequence[str]) -> int | list[int] | None:
    """Index of a name among others, or those of the components of a vector "x": "x[0]", "x[1]", ...; or None."""
    if name in names:
        return names.index(name)
    components = [k for k, other in enumerate(names) if other.startswith(f"{name}[") and other.endswith("]")]
    return components or None


@dataclass(frozen=True, eq=False, repr=False)
class NamedValues:
    """Values (..., n) by n names, (...,) each; those of a vector "x" are the ones of "x[0]", "x[1]", ..."""

    names: tuple[str, ...]
    values: Array

    def __getitem__(self, name: str) -> Array:
        """Values (...,) of a name, or (..., k) of a vector of k components; KeyError names those that exist."""
        column = column_of(name, self.names)
        if column is None:
            raise KeyError(f"{name!r} is not one of these; {allowed_for(name, self.names)}")
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
    instants: NamedValues | None = None  # (nc,) of the constraints at given times; None where nothing is stated there

    def __repr__(self) -> str:
        """A short table: every multiplier with its value, or the range of its values."""
        kinds = {
            "costate": self.dynamics,
            "path": self.path,
            "bound": self.states,
            "bound ": self.controls,
            "start": self.initial,
            "end": self.final,
        } | ({} if self.instants is None else {"at": self.instants})
        rows = [
            (f"{kind.strip()} {name}", _range_text(all_[name]), "") for kind, all_ in kinds.items() for name in all_
        ]
        return short_table("multipliers", [*rows, ("duration", f"{self.duration:.6g}", "")])


def distinct(names: Sequence[str]) -> tuple[str, ...]:
    """Make names unique: the second "x" becomes "x, 2"."""
    return tuple(f"{name}, {k}" if (k := 1 + list(names[:i]).count(name)) > 1 else name for i, name in enumerate(names))
