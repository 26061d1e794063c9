"""Types of the values that a field is given in Python: a text is no number, and 2.5 is no whole one."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Mapping
from numbers import Integral, Real
from typing import Any

from mathnavi.interfaces.field_table import Form


def type_test(form: Form) -> tuple[Callable[[Any], bool], str] | None:
    """Return the test of a value's type, and the words for what is allowed; None for a type that is not tested."""
    if form.origin is not tuple:
        return _KINDS.get(form.kind)
    kinds = [(member.optional, type_test(member)) for member in form.members]
    each = kinds if form.fixed else itertools.repeat(kinds[0])

    def accepted(values: Any) -> bool:
        if isinstance(values, (str, bytes, Mapping)) or not isinstance(values, Collection):
            return False
        items = zip(each, values, strict=form.fixed)
        return (not form.fixed or len(values) == len(kinds)) and all(
            (optional and value is None) or kind is None or kind[0](value) for (optional, kind), value in items
        )

    return accepted, f"a sequence of {len(kinds)} values" if form.fixed else "a sequence of values"


def _is_truth_value(value: Any) -> bool:
    return isinstance(value, bool) or (getattr(getattr(value, "dtype", None), "kind", "") == "b" and value.ndim == 0)


def _is_number(value: Any, kind: type[Any]) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)


_KINDS: dict[Any, tuple[Callable[[Any], bool], str]] = {
    bool: (_is_truth_value, "True, False"),
    int: (lambda value: _is_number(value, Integral), "a whole number"),
    float: (lambda value: _is_number(value, Real), "a number"),
    str: (lambda value: isinstance(value, str), "a text"),
}
"""test of a value, and the words for what is allowed, of each type that one value has"""
