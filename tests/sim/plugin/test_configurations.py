"""No number of a plug-in's configuration is NaN or beyond what its field declares: it is refused by its name."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import pytest
from annotated_types import Ge, Gt, Interval, Le, Lt

from mathnavi.interfaces.field_table import leaves_of
from mathnavi.interfaces.fields import with_fields
from mathnavi.sim.plugin.registry import load, names

CONFIGURED = [(kind, name) for kind in ("scenarios", "controllers", "estimators", "studies") for name in names(kind)]


def beyond(leaf: Any) -> Iterator[float]:
    """Values of a field of one number that are none of its own."""
    kind = leaf.form.kind
    if kind is float:
        yield math.nan
    for mark in leaf.form.marks if kind in (int, float) else ():
        for bound in mark if isinstance(mark, Interval) else (mark,):
            if isinstance(bound, (Gt, Lt)):
                yield kind(bound.gt if isinstance(bound, Gt) else bound.lt)
            elif isinstance(bound, Ge):
                yield kind(bound.ge - 1)
            elif isinstance(bound, Le):
                yield kind(bound.le + max(1, abs(bound.le)))


@pytest.mark.parametrize(("kind", "name"), CONFIGURED)
def test_a_number_that_a_field_does_not_allow_is_refused_by_its_name(kind: str, name: str) -> None:
    config: Any = load(kind, name).Config
    for leaf in leaves_of(config):
        for value in beyond(leaf):
            with pytest.raises(ValueError, match=rf"{leaf.path.rpartition('.')[2]}\b.* = {value!r}.*allowed"):
                with_fields(config(), {leaf.path: value})
