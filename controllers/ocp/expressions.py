"""Expressions of a statement: SX columns made from what a user writes, checked where it is written."""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable
from typing import Any, NoReturn

import casadi as ca
import numpy as np

from mathnavi.interfaces.errors import ProblemError

_KINKS = {"fabs": ca.OP_FABS, "fmin": ca.OP_FMIN, "fmax": ca.OP_FMAX}
_CALLED = "allowed: SX expressions, and a casadi.Function of MX that is called with the problem's symbols"


def expression(where: str, value: Any) -> ca.SX:
    """The SX of an expression, a number, an array or a sequence of these; ProblemError names ``where`` it stands.

    Refused are texts, mappings, MX expressions, and constants that are NaN.
    """
    if (foreign := _mx_in(value)) is not None:
        raise ProblemError(f"{where} = {foreign}, an MX expression; {_CALLED}")
    made = _converted(value)
    if made is None:
        raise ProblemError(f"{where} = {value!r:.80}; allowed: an SX expression, a number or a sequence of these")
    if any(math.isnan(value) for value in _constants(made)):
        raise ProblemError(
            f"{where} = {made}: NaN; allowed: finite numbers, and functions of CasADi: math.sin(x) of a symbol is NaN, "
            "casadi.sin(x) is not"
        )
    return made


def refuse_mx(own: str, foreign: str) -> NoReturn:
    """Raise ProblemError for an operation on an SX expression ``own`` and an MX expression ``foreign``."""
    raise ProblemError(f"{own} is an SX expression and {foreign} an MX one, which do not mix; {_CALLED}")


def _mx_in(value: Any) -> ca.MX | None:
    """An MX expression that a value is, or contains; None if absent."""
    if isinstance(value, ca.MX):
        return value
    if isinstance(value, (list, tuple)) or (isinstance(value, np.ndarray) and value.dtype == object):
        return next((found for each in value if (found := _mx_in(each)) is not None), None)
    return None


def scalars(column: ca.SX) -> list[ca.SX]:
    """The elements of an expression, column by column."""
    return list(ca.vertsplit(ca.vec(ca.densify(column))))


def column(symbols: Iterable[ca.SX]) -> ca.SX:
    """Expressions () below each other, (n, 1); of none (0, 1)."""
    parts = list(symbols)
    return ca.vertcat(*parts) if parts else ca.SX(0, 1)


def check_symbols(where: str, made: ca.SX, known: ca.SX) -> None:
    """Raise ProblemError where an expression depends on a symbol that is not among the known ones."""
    own = {s.element_hash() for s in ca.symvar(known)}
    strangers = [s for s in ca.symvar(made) if s.element_hash() not in own]
    if strangers:
        allowed = ", ".join(s.name() for s in ca.symvar(known)) or "none"
        twins = {s.name() for s in ca.symvar(known)} & {s.name() for s in strangers}
        why = f" ({', '.join(sorted(twins))} of another problem)" if twins else ""
        names = ", ".join(s.name() for s in strangers)
        raise ProblemError(f"{where} depends on {names}{why}, which is not among its symbols; allowed: {allowed}")


def number(where: str, value: Any) -> float:
    """A number that is not NaN, as a float; ProblemError names ``where`` it stands."""
    if isinstance(value, (ca.DM, np.ndarray)) and np.size(value) == 1:
        value = float(value)
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or math.isnan(value):
        raise ProblemError(f"{where} = {value!r:.80}; allowed: a number")
    return float(value)


def numbers_of(where: str, value: Any, size: int) -> list[float]:
    """``size`` numbers: one for all, or one for each; ProblemError names ``where`` they stand."""
    if isinstance(value, (str, bytes, dict)) or np.ndim(value) == 0:
        return [number(where, value)] * size
    values = list(np.ravel(np.asarray(value, dtype=object)))
    if len(values) != size:
        raise ProblemError(f"{where} = {value!r:.80} has {len(values)} numbers; allowed: one, or {size}")
    return [number(where, each) for each in values]


def kinks(made: ca.SX, times: ca.SX) -> list[str]:
    """The functions in an expression that have a kink, fabs, fmin and fmax, of more than the ``times`` (k,)."""
    function = ca.Function("e", ca.symvar(made), [made])
    codes = [function.instruction_id(k) for k in range(function.n_instructions())]
    if not set(_KINKS.values()) & set(codes):
        return []
    known = {each.element_hash() for each in ca.symvar(times)}
    steps = zip(codes, ca.vertsplit(function.instructions_sx()), strict=True)
    found = {code for code, step in steps if {each.element_hash() for each in ca.symvar(step)} - known}
    return [name for name, code in _KINKS.items() if code in found]


def _converted(value: Any) -> ca.SX | None:
    if isinstance(value, (list, tuple)):
        parts = [part for each in value if (part := _converted(each)) is not None]
        return ca.vertcat(*parts) if parts and len(parts) == len(value) else None
    if isinstance(value, np.ndarray) and value.dtype == object:
        return _converted(value.tolist())
    if isinstance(value, bool) or not isinstance(value, (ca.SX, ca.DM, np.ndarray, numbers.Real)):
        return None
    try:
        return ca.SX(float(value) if isinstance(value, numbers.Real) else value)
    except (NotImplementedError, TypeError):
        return None


def _constants(made: ca.SX) -> list[float]:
    """The numbers in an expression."""
    function = ca.Function("e", ca.symvar(made), [made])
    count = function.n_instructions()
    return [function.instruction_constant(k) for k in range(count) if function.instruction_id(k) == ca.OP_CONST]
