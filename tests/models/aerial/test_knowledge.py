"""The knowledge of a vehicle, and messages that change it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.interfaces.signals import Message
from mathnavi.models.aerial.knowledge import RADARS, TARGET, TERRAIN, Knowledge
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar
from tests import flight

RADAR = Radar(5000.0, 6000.0, 900.0, 2.0)
KNOWN = flight.mission(radars=(RADAR,)).knowledge


def message_of(topic: str, payload: Any) -> Message:
    return Message(0.0, "somebody", topic, payload)


def test_a_message_replaces_all_that_was_known_of_its_topic() -> None:
    other = Radar(1000.0, 1000.0, 500.0, 1.0)
    higher = HeightField(KNOWN.terrain.z + 5.0, KNOWN.terrain.spacing)
    now = KNOWN.updated_with(
        [message_of(RADARS, (other,)), message_of(TARGET, (1.0, 2.0, 3.0)), message_of(TERRAIN, higher)]
    )
    assert now == Knowledge(higher, (1.0, 2.0, 3.0), (other,))
    assert now.updated_with([message_of(RADARS, ())]).radars == ()


def test_a_message_again_or_of_another_topic_tells_nothing_new() -> None:
    again = (
        message_of(RADARS, (RADAR,)),
        message_of(TARGET, KNOWN.target),
        message_of(TERRAIN, KNOWN.terrain),
        message_of("weather", 3.0),
    )
    assert KNOWN.updated_with(again) is KNOWN
    assert not any(KNOWN.complaint(message) for message in again)


@pytest.mark.parametrize("place", [(10, 20, 30), [10.0, 20.0, 30.0], np.array([10.0, 20.0, 30.0])])
def test_a_place_may_be_any_three_numbers(place: Any) -> None:
    target = KNOWN.updated_with([message_of(TARGET, place)]).target
    assert target == (10.0, 20.0, 30.0)
    assert all(type(each) is float for each in target)


@pytest.mark.parametrize(
    ("topic", "payload", "complaint"),
    [
        (RADARS, RADAR, "allowed: a tuple of Radar"),
        (RADARS, (RADAR, "another"), "allowed: a tuple of Radar"),
        (RADARS, (Radar(-5.0, 0.0, 900.0, 2.0),), "off the map"),
        (TARGET, (1.0, np.nan, 3.0), "finite"),
        (TARGET, (-1.0, 2.0, 3.0), "on the map"),
        (TARGET, (1.0, 2.0), "three"),
        (TARGET, "there", "three"),
        (TARGET, "123", "three"),
        (TARGET, {1: 2, 2: 3, 3: 4}, "three"),
        (TARGET, (10**400, 1, 1), "three"),
        (TARGET, (6000.0, 6000.0, 1e300), "three"),
        (TARGET, (6000.0, math.nan, 900.0), "three"),
        (TERRAIN, KNOWN.terrain.z, "another extent"),
        (TERRAIN, HeightField(np.zeros((3, 3)), 1.0), "another extent"),
    ],
)
def test_what_cannot_be_is_left_out_and_says_why(topic: str, payload: Any, complaint: str) -> None:
    message = message_of(topic, payload)
    assert complaint in KNOWN.complaint(message)
    assert KNOWN.updated_with([message]) is KNOWN
