"""Knowledge that may change while a vehicle flies: the threats, the target, the map (thesis A.1, A.5).

Each message replaces all that was known of its topic, so that the next one repairs what a message that is lost, late or
doubled has caused:

    "radars"   tuple[Radar, ...]      the present threats: more, fewer, or elsewhere
    "target"   (x, y, z) [m]          where the target is now
    "terrain"  HeightField            the map, corrected; of the same extent and spacing
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Message
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar

RADARS, TARGET, TERRAIN = "radars", "target", "terrain"  # topics
_FARTHEST = 1e7  # [m]


@dataclass(frozen=True)
class Knowledge:
    """Knowledge of a vehicle: the threats, the target and the map."""

    terrain: HeightField
    target: tuple[float, float, float]  # [m] map frame, p_f
    radars: tuple[Radar, ...] = ()

    def updated_with(self, messages: Sequence[Message]) -> Knowledge:
        """Return the knowledge after ``messages``; itself if they bring nothing new. Impossible ones are ignored."""
        fields: dict[str, Any] = {}
        for message in messages:
            if message.topic in (RADARS, TARGET, TERRAIN) and not self.complaint(message):
                payload = message.payload
                fields[message.topic] = place_in(payload) if message.topic == TARGET else payload
        known = replace(self, **fields)
        return self if known == self else known

    def complaint(self, message: Message) -> str:
        """Reason why a message cannot be true; "" if it can, and for other topics."""
        payload, terrain = message.payload, self.terrain
        if message.topic == TERRAIN:
            alike = isinstance(payload, HeightField) and (payload.z.shape, payload.spacing) == (
                terrain.z.shape, terrain.spacing
            )  # fmt: skip
            return "" if alike else f"a map of another extent than {terrain.width:g} m by {terrain.depth:g} m"
        if message.topic == TARGET:
            place = place_in(payload)
            known = place is not None and bool(terrain.contains(*place[:2]))
            return "" if known else f"target = {payload!r}; allowed: three finite numbers, on the map"
        if message.topic == RADARS:
            if not isinstance(payload, tuple) or not all(isinstance(radar, Radar) for radar in payload):
                return f"radars = {payload!r}; allowed: a tuple of Radar"
            outside = [radar for radar in payload if not terrain.contains(radar.x, radar.y)]
            return f"{outside[0]!r} is off the map" if outside else ""
        return ""


def place_in(payload: Any) -> tuple[float, float, float] | None:
    """Return x, y, z [m] of a payload that is a sequence or an array of three numbers; None for any other."""
    if not isinstance(payload, (tuple, list, np.ndarray)) or len(payload) != 3:
        return None
    if not all(isinstance(each, Real) for each in payload):
        return None
    try:
        x, y, z = map(float, payload)
    except OverflowError:
        return None
    return (x, y, z) if max(abs(x), abs(y), abs(z)) <= _FARTHEST and not math.isnan(x + y + z) else None
