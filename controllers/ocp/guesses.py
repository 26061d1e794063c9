"""Guesses of a statement: numbers spread over [0, T], values at times, functions of time, integrals and simulations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import solve_ivp

from mathnavi.controllers.ocp.expressions import number
from mathnavi.interfaces.errors import ProblemError
from mathnavi.interfaces.signals import Array

SAMPLES = 101
"""number of times at which a guess that is not given by values is sampled"""
_MOST = 1e12  # scaled size of a simulated state that counts as diverged

Guess = float | Sequence[float] | Sequence[Sequence[float]] | Array | Callable[[float], Any]
"""guess: a number; values spread evenly over [0, T]; or a function of the time [s] since the start"""


@dataclass(frozen=True, eq=False)
class Values:
    """Values (k,) of one variable at times (k,) [s], or spread evenly over [0, T]; straight in between."""

    values: Array
    times: Array | None = None

    def breaks(self, duration: float) -> Array:
        """Fractions of T that a common grid of guesses has to contain."""
        if self.times is None:
            return np.linspace(0.0, 1.0, max(2, len(self.values)))
        inside = self.times / duration
        return np.concatenate([[0.0, 1.0], inside[(inside > 0.0) & (inside < 1.0)]])

    def at(self, fractions: Array, duration: float) -> Array:
        """Values (k,) at fractions (k,) of T, held beyond the first and the last time."""
        own = np.linspace(0.0, 1.0, len(self.values)) if self.times is None else self.times / duration
        return np.interp(fractions, own, self.values)


@dataclass(frozen=True, eq=False)
class Sampled:
    """A component of a function of time."""

    where: str
    function: Callable[[float], Any]
    component: int
    size: int

    def breaks(self, duration: float) -> Array:
        """Fractions of T at which the function is sampled."""
        return np.linspace(0.0, 1.0, SAMPLES)

    def at(self, fractions: Array, duration: float) -> Array:
        """Values (k,) at fractions (k,) of T; ProblemError where they are not finite numbers."""
        return np.array([self._value(float(fraction * duration)) for fraction in fractions])

    def _value(self, t: float) -> float:
        found = self.function(t)
        try:
            values = np.ravel(np.asarray(found, float))
        except (TypeError, ValueError):
            values = np.empty(0)
        if len(values) != self.size or not np.isfinite(values).all():
            raise ProblemError(f"{self.where}: guess at t = {t:g} s is {found!r:.80}; allowed: {_finite(self.size)}")
        return float(values[self.component])


@dataclass(frozen=True, eq=False)
class Derived:
    """A guess that follows from the others: the integral of the variable's own rate, or the start of a state."""

    start_of: str = ""

    def breaks(self, duration: float) -> Array:
        """Fractions of T at which an integral is sampled."""
        return np.linspace(0.0, 1.0, 2 if self.start_of else SAMPLES)

    def at(self, fractions: Array, duration: float) -> Array:
        """Zeros (k,), until the other guesses are known."""
        return np.zeros(len(fractions))


Component = Values | Sampled | Derived


def components(where: str, guess: Any, size: int, times: Any = None) -> list[Component]:
    """Guesses of each of ``size`` components; ProblemError names ``where`` they stand.

    Args:
        where: name of the variable, for errors.
        guess: a number; (k,) values of a scalar; (size,) constants or (k, size) values of a vector; a function of time.
        size: number of components.
        times: (k,) [s] of the values, increasing; None where they are spread evenly over [0, T].
    """
    if callable(guess):
        if times is not None:
            raise ProblemError(f"{where}: guess is a function and has times as well; allowed: one of them")
        return [Sampled(where, guess, k, size) for k in range(size)]
    values = _array(f"{where}: guess", guess)
    given = values.tolist()
    if values.ndim == 0:
        values = np.full((1, size), float(values))
    elif values.ndim == 1:
        values = values[:, None] if size == 1 else values[None, :]
    if values.ndim != 2 or values.shape[1] != size or not len(values) or not np.isfinite(values).all():
        raise ProblemError(f"{where}: guess = {given!r:.80}; allowed: {_finite(size)}, at least one")
    at = None if times is None else _array(f"{where}: times of the guess", times)
    if at is not None and (at.shape != (len(values),) or not np.isfinite(at).all() or (np.diff(at) <= 0.0).any()):
        raise ProblemError(
            f"{where}: times of the guess = {at.tolist()!r:.80}; allowed: {len(values)}, one for each value, increasing"
        )
    return [Values(each, at) for each in values.T]


def _finite(size: int) -> str:
    return "finite numbers" if size == 1 else f"finite numbers, {size} of them or (k, {size})"


def _array(where: str, value: Any) -> Array:
    try:
        if isinstance(value, (str, bytes, Mapping)):
            raise TypeError
        return np.array(value, float)  # a copy: the caller may write to the original
    except (TypeError, ValueError, RuntimeError):
        raise ProblemError(f"{where} = {value!r:.80}; allowed: finite numbers, or a function of time") from None


@dataclass(frozen=True, eq=False)
class Simulation:
    """A guess of the states by integrating the dynamics under the guessed controls."""

    start: Mapping[str, float]
    """values at the start by state; the others come from ``start()`` and from the guess"""


def simulated(
    name: str, rates: ca.Function, scale: Array, start: Array, times: Array, controls: Array, p: Array
) -> Array:
    """States (k, nx) from a start (nx,) with rates(x, u, t, p) under controls (k, nu), straight between times (k,) [s].

    ProblemError where they diverge, with the time.
    """

    def slope(t: float, y: Array) -> Array:
        u = np.array([np.interp(t, times, each) for each in controls.T])
        return np.array(rates(y * scale, u, t, p).full()[:, 0] / scale)

    def diverged(t: float, y: Array) -> float:
        return _MOST - float(np.abs(y).max(initial=0.0))

    diverged.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(slope, (times[0], times[-1]), start / scale, t_eval=times, rtol=1e-6, atol=1e-6, events=diverged)
    if found.y.shape[1] < len(times) or not np.isfinite(found.y).all():
        last = float(found.t[-1]) if len(found.t) else 0.0
        raise ProblemError(
            f"{name}: the simulation for the guess diverges after t = {last:.3g} s; "
            "allowed: controls and a start whose states stay finite"
        )
    return np.array(found.y.T * scale)


def integral(rate: ca.SX, known: list[ca.SX], times: Array, x: Array, u: Array, p: Array) -> Array:
    """Integral (k,) of a rate along guesses x (k, nx), u (k, nu) at times (k,) [s]; zeros where it is not finite."""
    function = ca.Function("rate", known, [rate])
    values = np.array(function(x.T, u.T, times[None, :], np.tile(p[:, None], (1, len(times)))).full())[0]
    total = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(times))])
    return total if np.isfinite(total).all() else np.zeros(len(times))


def start_values(where: str, start: Any, states: Sequence[str]) -> dict[str, float]:
    """Values at the start by state; ProblemError for an unknown state and for a value that is not a number."""
    if not isinstance(start, Mapping):
        raise ProblemError(f"{where}: start = {start!r:.80}; allowed: values by state")
    if strangers := [str(name) for name in start if name not in states]:
        raise ProblemError(f"{where}: start of {', '.join(strangers)}; allowed: {', '.join(states)}")
    return {name: number(f"{where}: start of {name}", value) for name, value in start.items()}
