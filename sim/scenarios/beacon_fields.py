"""Fields that describe beacons, common to all vehicles."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

from mathnavi.interfaces.errors import FieldError


def check_beacons(fields: Any) -> None:
    """Raise FieldError for two beacons at one place, readings of none, and fields of beacons that there are not.

    ``fields`` are a configuration of beacons, with ``places`` and what is ``read`` of them.
    """
    places: Sequence[Any] = fields.places
    if len(set(places)) < len(places):
        raise FieldError(f"beacons.places = {places!r} holds one place twice; allowed: different places")
    if not fields.read:
        raise FieldError("beacons.read is empty; allowed: ranges, bearings, range-differences")
    if "range-differences" in fields.read and len(places) == 1:
        raise FieldError("beacons.read = range-differences of one beacon; allowed: two beacons or more")
    for each in dataclasses.fields(fields) if not places else ():
        value = getattr(fields, each.name)
        if value != each.default:
            allowed = f"with beacons.places, or {each.default!r}"
            raise FieldError(f"beacons.{each.name} = {value!r} without beacons.places; allowed: {allowed}")


def check_unknown(fields: Any) -> None:
    """Raise FieldError for unknown places of beacons that there are not, or named twice."""
    if len(set(fields.unknown)) < len(fields.unknown) or any(i >= len(fields.places) for i in fields.unknown):
        raise FieldError(
            f"beacons.unknown = {fields.unknown!r} with {len(fields.places)} places; "
            "allowed: different numbers of places, from 0"
        )
