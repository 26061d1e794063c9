"""No number of a plug-in's configuration is NaN or beyond what its field declares: it is refused by its name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import pytest
from annotated_types import Ge, GroupedMetadata, Gt, Le, Lt

from mathnavi.interfaces.field_table import leaves_of
from mathnavi.interfaces.fields import with_fields
from mathnavi.sim.plugin.registry import load, names

CONFIGURED = [(kind, name) for kind in ("scenarios", "controllers", "estimators", "studies") for name in names(kind)]


def beyond(kind: type[float], marks: Iterable[Any]) -> Iterator[float]:
    """Values just beyond what the marks of a field of one number declare."""
    for mark in marks:
        if isinstance(mark, GroupedMetadata):
            yield from beyond(kind, mark)
        elif isinstance(mark, (Gt, Lt)):
            yield kind(mark.gt if isinstance(mark, Gt) else mark.lt)
        elif isinstance(mark, Ge):
            yield kind(mark.ge - 1)
        elif isinstance(mark, Le):
            yield kind(mark.le + max(1, abs(mark.le)))


@pytest.mark.refused("plug-in", "a value that a field does not allow")
@pytest.mark.honoured("plug-in", "Config: fields with bounds")
@pytest.mark.parametrize(("kind", "name"), CONFIGURED)
def test_a_number_that_a_field_does_not_allow_is_refused_by_its_name(kind: str, name: str) -> None:
    config: Any = load(kind, name).Config
    for leaf in leaves_of(config):
        number = leaf.form.kind
        values = [*beyond(number, leaf.form.marks), *([math.nan] if number is float else [])]
        for value in values if number in (int, float) else ():
            with pytest.raises(ValueError, match=rf"{leaf.path.rpartition('.')[2]}\b.* = {value!r}.*allowed"):
                with_fields(config(), {leaf.path: value})
