"""Constraints written as comparisons of expressions, and read as limits.

    x <= 0.1        d = x,          d_upper = 0.1
    x >= p          d = p - x,      d_upper = 0
    x == y          d = x - y,      d_lower = d_upper = 0
    bounded(1, x, 2), which is 1 <= (x <= 2)

CasADi knows no strict inequality of a programme: ``<`` counts as ``<=``. Python reads ``1 <= x <= 2`` as
``(1 <= x) and (x <= 2)`` and needs the truth value of a comparison, which has none; the error says what to write.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import wraps
from typing import Any, NoReturn

import casadi as ca

from mathnavi.controllers.ocp.expressions import check_symbols, expression, number, refuse_mx, scalars
from mathnavi.interfaces.errors import ProblemError

_ONE_SIDED = (ca.OP_LE, ca.OP_LT)
_OTHER = {ca.OP_NE: "!=", ca.OP_AND: "a logical and", ca.OP_OR: "a logical or", ca.OP_NOT: "a logical not"}
_ALLOWED = "allowed: <=, >=, ==, bounded(lower, x, upper), or lower= and upper= with an expression"


class TruthValueError(ProblemError, RuntimeError):
    """A comparison of symbols was used as a truth value."""


@dataclass(frozen=True, eq=False)
class Row:
    """A scalar expression with its limits, lower <= expression <= upper; at least one of them is finite."""

    expression: ca.SX
    lower: float
    upper: float
    name: str


def bounded(lower: Any, between: Any, upper: Any) -> ca.SX:
    """The comparison lower <= between <= upper, element by element; a limit is a number or an expression."""
    low, middle, high = (expression("bounded()", each) for each in (lower, between, upper))
    result: ca.SX = low <= (middle <= high)
    return result


def rows(where: str, constraint: Any, lower: Any, upper: Any, name: str, *, known: list[ca.SX]) -> list[Row]:
    """Rows of a constraint: a comparison, or an expression with limits.

    Args:
        where: name of what is constrained, for errors.
        constraint: comparison, expression, or a sequence of either, element by element.
        lower: limits of an expression, for all elements or for each; a number or an expression. None for no limit.
        upper: limits of an expression, like ``lower``.
        name: name of the rows; empty for the text of each.
        known: symbols that the constraint may depend on.

    Raises:
        ProblemError: for what cannot be a constraint: a truth value, a logical connection, an expression without a
            limit or without any of the problem's symbols, limits given with a comparison, and limits that contradict
            each other.
    """
    if isinstance(constraint, bool):
        raise ProblemError(f"{where} is {constraint}, the truth value of numbers; {_ALLOWED}")
    elements = scalars(expression(where, constraint))
    limits = [_spread(where, limit, len(elements)) for limit in (lower, upper)]
    given = lower is not None or upper is not None
    made = []
    for k, element in enumerate(elements):
        label = name or _text(element)
        if given and _operation(element) in (*_ONE_SIDED, ca.OP_EQ):
            raise ProblemError(f"{where} {label} is a comparison and has a limit as well; allowed: one of them")
        low, high = (limit[k] for limit in limits)
        own = _limited(where, label, element, low, high) if given else _compared(where, label, element)
        made += own
        for row in own:
            check_symbols(f"{where} {label}", row.expression, ca.vertcat(*known))
            _check(where, row)
    if name and len(made) > 1:
        made = [Row(row.expression, row.lower, row.upper, f"{name}[{k}]") for k, row in enumerate(made)]
    return made


def end_limits(constraint: Any, lower: Any, upper: Any) -> tuple[Any, Any]:
    """Limits of a constraint at one end: as given, and those of an equation for an expression without any."""
    if lower is not None or upper is not None or _is_comparison(constraint):
        return lower, upper
    return 0.0, 0.0


def _is_comparison(constraint: Any) -> bool:
    if isinstance(constraint, bool):
        return True
    known = (*_ONE_SIDED, ca.OP_EQ, *_OTHER)
    return any(_operation(element) in known for element in scalars(expression("constraint", constraint)))


def _compared(where: str, label: str, element: ca.SX) -> list[Row]:
    """Rows of one comparison, with one or two limits."""
    operation = _operation(element)
    if operation in _OTHER:
        raise ProblemError(f"{where} {label} is {_OTHER[operation]}, which cannot be a constraint; {_ALLOWED}")
    if element.is_constant():
        always = "always holds" if float(element) else "never holds"
        raise ProblemError(
            f"{where} {label} {always} for all values of the variables; allowed: one that depends on them"
        )
    if operation not in (*_ONE_SIDED, ca.OP_EQ):
        raise ProblemError(f"{where} {label} has no limit; {_ALLOWED}")
    left, right = element.dep(0), element.dep(1)
    if operation != ca.OP_EQ:
        # 1 <= (x <= 2), or (1 <= x) <= 2
        if _operation(right) in _ONE_SIDED and _operation(left) not in _ONE_SIDED and not right.dep(0).is_constant():
            return _merged([*_side(where, label, left, right.dep(0)), *_side(where, label, *_sides(right))])
        if _operation(left) in _ONE_SIDED and _operation(right) not in _ONE_SIDED and not left.dep(1).is_constant():
            return _merged([*_side(where, label, *_sides(left)), *_side(where, label, left.dep(1), right)])
    if any(_operation(side) in (*_ONE_SIDED, ca.OP_EQ, *_OTHER) for side in (left, right)):
        raise ProblemError(f"{where} {label} compares a comparison; {_ALLOWED}")
    return _side(where, label, left, right, equal=operation == ca.OP_EQ)


def _limited(where: str, label: str, element: ca.SX, lower: ca.SX | None, upper: ca.SX | None) -> list[Row]:
    """Rows of an expression with limits."""
    sides = []
    if lower is not None:
        sides += _side(where, label, lower, element)
    if upper is not None:
        sides += _side(where, label, element, upper)
    return _merged(sides)


def _side(where: str, label: str, left: ca.SX, right: ca.SX, *, equal: bool = False) -> list[Row]:
    """left <= right, or left == right, with the symbols on one side and the number on the other."""
    if left.is_constant() and not right.is_constant():
        limit = number(where, float(left))
        return [Row(right, limit, limit if equal else math.inf, label)]
    limit = number(where, float(right)) if right.is_constant() else 0.0
    difference = left if right.is_constant() else left - right
    return [Row(difference, limit if equal else -math.inf, limit, label)]


def _sides(comparison: ca.SX) -> tuple[ca.SX, ca.SX]:
    return comparison.dep(0), comparison.dep(1)


def _merged(sides: list[Row]) -> list[Row]:
    """Two rows of the same expression as one."""
    if len(sides) == 2 and ca.is_equal(sides[0].expression, sides[1].expression, 1):
        lower, upper = max(row.lower for row in sides), min(row.upper for row in sides)
        return [Row(sides[0].expression, lower, upper, sides[0].name)]
    return sides


def _check(where: str, row: Row) -> None:
    if row.lower == -math.inf and row.upper == math.inf:
        raise ProblemError(f"{where} {row.name}: lower = -inf, upper = inf is no limit; allowed: a finite one")
    if not row.lower <= row.upper or row.lower == math.inf or row.upper == -math.inf:
        raise ProblemError(f"{where} {row.name}: lower = {row.lower!r}, upper = {row.upper!r}; allowed: lower <= upper")
    symbols = ca.symvar(row.expression)
    if not symbols:
        raise ProblemError(f"{where} {row.name} depends on no symbol of the problem; allowed: one that does")
    if ca.jacobian(row.expression, ca.vertcat(*symbols)).is_zero():
        raise ProblemError(f"{where} {row.name} is constant but for jumps, no solver can meet it; {_ALLOWED}")


def _spread(where: str, limit: Any, size: int) -> list[ca.SX | None]:
    if limit is None:
        return [None] * size
    elements = scalars(expression(where, limit))
    if len(elements) not in (1, size):
        raise ProblemError(f"{where}: {len(elements)} limits of {size} expressions; allowed: one, or {size}")
    return [*elements] if len(elements) == size else [*elements] * size


def _operation(element: ca.SX) -> int | None:
    return None if element.is_leaf() else int(element.op())


def _text(element: ca.SX | ca.MX) -> str:
    text = str(element).replace("\n", " ")
    return text if len(text) <= 60 else f"{text[:57]}..."


def _explained(kind: type) -> None:
    """Make the truth value of a symbolic comparison fail with a message that says what to write in its place.

    It is evaluated in the user's code, before any function of this module is called, so CasADi's error is the only
    place for that message. Truth values that exist are unchanged.
    """
    original = kind.__bool__  # type: ignore[attr-defined]

    @wraps(original)
    def truth(self: Any) -> bool:
        try:
            return bool(original(self))
        except RuntimeError:
            _refuse(self)

    kind.__bool__ = truth  # type: ignore[attr-defined]


def _refuse(comparison: Any) -> NoReturn:
    raise TruthValueError(
        f"{_text(comparison)} has no truth value; allowed in place of a <= x <= b: bounded(a, x, b); of and: two "
        "constraints; of max, min and if: casadi.fmax, casadi.fmin and casadi.if_else"
    ) from None


def _unmixed(kind: type, operator: str) -> None:
    """Make an operator on an SX and an MX fail with a message that names both; it is unchanged for all else."""
    original = getattr(kind, operator)

    @wraps(original)
    def applied(self: Any, other: Any) -> Any:
        result = original(self, other)
        if result is NotImplemented and isinstance(other, (ca.SX, ca.MX)):
            refuse_mx(_text(self if kind is ca.SX else other), _text(other if kind is ca.SX else self))
        return result

    setattr(kind, operator, applied)


for _kind in (ca.SX, ca.MX):
    _explained(_kind)
    for _operator in ("add", "sub", "mul", "truediv", "pow", "matmul", "lt", "le", "eq", "ne", "ge", "gt"):
        _unmixed(_kind, f"__{_operator}__")
