"""Interval arithmetic: enclosures of a compiled function over many boxes at once.

The natural interval extension replaces every elementary operation by the set of its values,

    [a] + [b] = [a_ + b_, a^ + b^],      sin [a] = {sin s : s in [a]},      ...

so its result contains every value that the function takes on a box; it may contain others, where a variable occurs more
than once. An operation that is not known here, and a value that is not defined, gives the whole line.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from mathnavi.controllers.ocp.function_tape import OPERATIONS, taped
from mathnavi.controllers.ocp.problem_functions import Interval
from mathnavi.interfaces.signals import Array

_RISING: dict[str, Callable[[Array], Array]] = {
    "ASSIGN": np.positive, "EXP": np.exp, "TWICE": lambda a: 2.0 * a, "ATAN": np.arctan, "FLOOR": np.floor,
    "CEIL": np.ceil, "SIGN": np.sign, "ERF": erf, "SINH": np.sinh, "TANH": np.tanh, "ASINH": np.arcsinh,
    "EXPM1": np.expm1,
}  # fmt: skip
_DOMAINS: dict[str, tuple[Callable[[Array], Array], float, float]] = {
    "LOG": (np.log, 0.0, np.inf),
    "SQRT": (np.sqrt, 0.0, np.inf),
    "ASIN": (np.arcsin, -1.0, 1.0),
    "ATANH": (np.arctanh, -1.0, 1.0),
    "LOG1P": (np.log1p, -1.0, np.inf),
}  # rising on a part of the line
_LOGICAL = ("LT", "LE", "EQ", "NE", "AND", "OR", "NOT")


def whole(limits: Interval, n: int = 1) -> Interval:
    """The box of limits (m,) as ``n`` boxes (m, n) of ``enclosed``."""
    return Interval(np.tile(limits.lower[:, None], (1, n)), np.tile(limits.upper[:, None], (1, n)))


def point(values: Array | float, n: int = 1) -> Interval:
    """A known value () or values (m,) as ``n`` boxes (m, n) without width."""
    columns = np.tile(np.atleast_1d(np.asarray(values, float))[:, None], (1, n))
    return Interval(columns, columns)


def enclosed(function: ca.Function, boxes: Sequence[Interval]) -> Interval:
    """Least and greatest values (size, n) of a function's elements over n boxes; they may be further apart than needed.

    Args:
        function: a function of columns with a column as its result, as those of a ``ProblemFunctions``.
        boxes: of each argument, limits (its size, n).
    """
    tape = _tape(function)
    n = boxes[0].lower.shape[1]
    size = function.numel_out(0)
    if tape is None:
        return Interval(np.full((size, n), -np.inf), np.full((size, n), np.inf))
    work: dict[int, Interval] = {}
    found = Interval(np.zeros((size, n)), np.zeros((size, n)))
    with np.errstate(all="ignore"):
        for name, result, first, second, constant in tape:
            if name == "OUTPUT":
                found.lower[result], found.upper[result] = work[first]
            elif name == "CONST":
                work[result] = Interval(np.full(n, constant), np.full(n, constant))
            elif name == "INPUT":
                work[result] = Interval(boxes[first].lower[second], boxes[first].upper[second])
            else:
                lower, upper = _operation(name, work[first], work.get(second))
                lower, upper = np.where(np.isnan(lower), -np.inf, lower), np.where(np.isnan(upper), np.inf, upper)
                work[result] = Interval(lower, upper)
    return found


class _Step(NamedTuple):
    name: str
    result: int
    first: int
    second: int
    constant: float


@lru_cache(maxsize=256)
def _tape(function: ca.Function) -> list[_Step] | None:
    """Elementary operations of a function; None where it calls others, as a table."""
    arrays = taped(function)
    if arrays is None:
        return None
    rows = zip(arrays["tape"].tolist(), arrays["constants"].tolist(), strict=True)
    return [_Step(OPERATIONS[row[0]], row[1], row[2], row[3], constant) for row, constant in rows]


def _operation(name: str, a: Interval, b: Interval | None) -> tuple[Array, Array]:
    """Values of an elementary operation of intervals (n,); ``b`` belongs to those of two."""
    if name in _RISING:
        return _RISING[name](a.lower), _RISING[name](a.upper)
    if name in _DOMAINS:
        function, least, most = _DOMAINS[name]
        outside = (a.upper < least) | (a.lower > most)
        lower, upper = function(np.clip(a.lower, least, most)), function(np.clip(a.upper, least, most))
        return np.where(outside, np.nan, lower), np.where(outside, np.nan, upper)
    if name in _LOGICAL:
        return np.zeros_like(a.lower), np.ones_like(a.upper)
    if name in _OF_ONE:
        return _OF_ONE[name](a)
    if name in _OF_TWO and b is not None:
        return _OF_TWO[name](a, b)
    return np.full_like(a.lower, np.nan), np.full_like(a.upper, np.nan)


def _hull(*values: Array) -> tuple[Array, Array]:
    """Least and greatest of values (n,); NaN where one of them is."""
    every = np.stack(values)
    return every.min(axis=0), every.max(axis=0)


def _product(a: Interval, b: Interval) -> tuple[Array, Array]:
    # 0 times an end that is infinite is 0: the infinite end is no value.
    return _hull(*(np.where((s == 0.0) | (t == 0.0), 0.0, s * t) for s in a for t in b))


def _square(a: Interval) -> tuple[Array, Array]:
    lower, upper = _magnitude(a)
    return lower**2, upper**2


def _magnitude(a: Interval) -> tuple[Array, Array]:
    lower, upper = _hull(np.abs(a.lower), np.abs(a.upper))
    return np.where((a.lower <= 0.0) & (a.upper >= 0.0), 0.0, lower), upper


def _reciprocal(a: Interval) -> tuple[Array, Array]:
    lower, upper = _hull(1.0 / a.lower, 1.0 / a.upper)
    around = (a.lower <= 0.0) & (a.upper >= 0.0)
    return np.where(around, np.nan, lower), np.where(around, np.nan, upper)


def _sine(a: Interval) -> tuple[Array, Array]:
    lower, upper = _hull(np.sin(a.lower), np.sin(a.upper))
    return np.where(_contains(a, -0.5 * np.pi), -1.0, lower), np.where(_contains(a, 0.5 * np.pi), 1.0, upper)


def _contains(a: Interval, angle: float) -> NDArray[np.bool_]:
    """True where an interval contains an angle, or may by rounding, whole turns apart."""
    room = 1e-12 * (1.0 + np.abs(a.lower) + np.abs(a.upper))
    first = np.ceil((a.lower - room - angle) / (2.0 * np.pi))
    found: NDArray[np.bool_] = ~(first > np.floor((a.upper + room - angle) / (2.0 * np.pi)))  # true of NaN and infinity
    return found


def _cosine(a: Interval) -> tuple[Array, Array]:
    return _sine(Interval(a.lower + 0.5 * np.pi, a.upper + 0.5 * np.pi))


def _tangent(a: Interval) -> tuple[Array, Array]:
    crosses = _contains(a, 0.5 * np.pi) | _contains(a, -0.5 * np.pi)
    return np.where(crosses, np.nan, np.tan(a.lower)), np.where(crosses, np.nan, np.tan(a.upper))


def _power(a: Interval, b: Interval) -> tuple[Array, Array]:
    exponent = float(b.lower[0])
    if not (b.lower == exponent).all() or not (b.upper == exponent).all():
        return np.full_like(a.lower, np.nan), np.full_like(a.upper, np.nan)
    if exponent < 0.0:
        return _reciprocal(Interval(*_power(a, Interval(-b.upper, -b.lower))))
    if exponent % 2.0 == 0.0:
        a = Interval(*_magnitude(a))
    return a.lower**exponent, a.upper**exponent  # rising; NaN for a root of what may be negative


_OF_ONE: dict[str, Callable[[Interval], tuple[Array, Array]]] = {
    "NEG": lambda a: (-a.upper, -a.lower),
    "SQ": _square,
    "FABS": _magnitude,
    "INV": _reciprocal,
    "SIN": _sine,
    "COS": _cosine,
    "TAN": _tangent,
    "ACOS": lambda a: (np.arccos(np.clip(a.upper, -1.0, 1.0)), np.arccos(np.clip(a.lower, -1.0, 1.0))),
    "COSH": lambda a: tuple(np.cosh(end) for end in _magnitude(a)),  # type: ignore[dict-item,return-value]
}
_OF_TWO: dict[str, Callable[[Interval, Interval], tuple[Array, Array]]] = {
    "ADD": lambda a, b: (a.lower + b.lower, a.upper + b.upper),
    "SUB": lambda a, b: (a.lower - b.upper, a.upper - b.lower),
    "MUL": _product,
    "DIV": lambda a, b: _product(a, Interval(*_reciprocal(b))),
    "POW": _power,
    "CONSTPOW": _power,
    "FMIN": lambda a, b: (np.minimum(a.lower, b.lower), np.minimum(a.upper, b.upper)),
    "FMAX": lambda a, b: (np.maximum(a.lower, b.lower), np.maximum(a.upper, b.upper)),
    "IF_ELSE_ZERO": lambda a, b: (np.minimum(b.lower, 0.0), np.maximum(b.upper, 0.0)),
    "HYPOT": lambda a, b: tuple(  # type: ignore[dict-item,return-value]
        np.sqrt(s + t) for s, t in zip(_square(a), _square(b), strict=True)
    ),
    "ATAN2": lambda a, b: (np.full_like(a.lower, -np.pi), np.full_like(a.upper, np.pi)),
}
