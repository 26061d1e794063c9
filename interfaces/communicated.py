"""Boundary of plug-ins for what vehicles communicate: the answers of a coordinator, and of a consensus.

What a guest sends is copied as data, so that it holds nothing that another vehicle has, and no other vehicle runs into
an object of its making. Dataclasses pass their constructors again, which refuse what is torn.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Collection, Mapping
from enum import Enum
from types import MappingProxyType
from typing import Any

import numpy as np

from mathnavi.interfaces.boundary import RefusedError, Unusable, checked, locked, signed_events
from mathnavi.interfaces.signals import Message, Outbox

_ATOMS = (bool, int, float, complex, str, bytes)
_DATA = "numbers, text, arrays, tuples, sets and mappings of them, and frozen dataclasses"


def data(value: Any) -> Any:
    """Return immutable data that no one else holds; RefusedError for an object that is no data.

    Lists become tuples, sets frozen sets, mappings read-only, and arrays are locked.
    """
    if value is None or type(value) in _ATOMS or isinstance(value, Enum):
        return value
    if isinstance(value, np.generic):
        return locked(np.asarray(value))[()]
    if isinstance(value, np.ndarray):
        return locked(np.asarray(value))
    if isinstance(value, (tuple, list)):
        made: Callable[[Any], Any] = getattr(type(value), "_make", tuple)  # a NamedTuple stays one
        return made(map(data, value))
    if isinstance(value, (set, frozenset)):
        return frozenset(map(data, value))
    if isinstance(value, Mapping):
        return MappingProxyType({data(key): data(each) for key, each in value.items()})
    if dataclasses.is_dataclass(value) and not isinstance(value, type) and _is_frozen(type(value)):
        own = {each.name: data(getattr(value, each.name)) for each in dataclasses.fields(value) if each.init}
        return dataclasses.replace(value, **own)
    raise RefusedError(f"{_a(value)}; allowed: {_DATA}")


def _is_frozen(kind: Any) -> bool:
    return bool(kind.__dataclass_params__.frozen)


def _a(value: Any) -> str:
    return f"an object of {type(value).__name__}"


def usable_outbox(answer: Any, sender: str, fleet: Collection[str], name: str = "") -> Outbox | Unusable:
    """Return a coordinator's answer; what it sends carries the name of its own vehicle, to vehicles of the ``fleet``.

    What a guest, called ``name``, sends is copied as data. To its planner it sends finite numbers and text, and no map.
    """
    return checked(lambda: _outbox(answer, sender, fleet, name))


def _outbox(answer: Any, sender: str, fleet: Collection[str], name: str) -> Outbox:
    if not isinstance(answer, Outbox):
        raise RefusedError(f"exchange() returned {type(answer).__name__}; allowed: Outbox")
    sent = [message for _, message in answer.messages]
    for message in (*sent, *answer.planner_messages):
        if not isinstance(message, Message) or not math.isfinite(message.t):
            raise RefusedError(f"exchange() sends {message!r}; allowed: a Message of a finite time")
        if message.sender != sender:
            raise RefusedError(f"exchange() sends as {message.sender!r}; allowed: {sender!r}")
    if not name:
        return answer
    for to, _ in answer.messages:
        if unknown := [each for each in (to if isinstance(to, tuple) else (to,)) if each not in fleet]:
            raise RefusedError(f"exchange() sends to {unknown[0]!r}; allowed: {', '.join(fleet)}")
    for message in answer.planner_messages:
        _check_numbers(message.payload)
    return Outbox(
        tuple((to, _own(message, sender)) for to, message in answer.messages),
        tuple(_own(message, sender) for message in answer.planner_messages),
        signed_events(answer.events, name),
    )


def _own(message: Message, sender: str) -> Message:
    return Message(float(message.t), sender, str(message.topic), data(message.payload))


def _check_numbers(payload: Any) -> None:
    """Raise RefusedError for a payload that is more than finite numbers and text."""
    values = payload if isinstance(payload, (tuple, list)) else (payload,)
    for value in values:
        if isinstance(value, (float, np.floating)) and not math.isfinite(value):
            raise RefusedError(f"exchange() sends {float(value)!r} to the planner; allowed: finite numbers")
        if not (value is None or type(value) in _ATOMS or isinstance(value, np.generic)):
            raise RefusedError(f"exchange() sends {_a(value)} to the planner; allowed: numbers, text, tuples of them")


def usable_round(payload: Any, value: Any, outlier: Any, name: str = "") -> tuple[Any, float, bool] | Unusable:
    """Return a consensus's payload, its value (NaN while it knows none), and whether it only follows.

    The payload of a guest, called ``name``, is copied as data.
    """
    return checked(lambda: _round(payload, value, outlier, name))


def _round(payload: Any, value: Any, outlier: Any, name: str) -> tuple[Any, float, bool]:
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise RefusedError(f"value is {_a(value)}; allowed: a number")
    number = float(value)
    if not (math.isnan(number) or math.isfinite(number * number)):
        raise RefusedError(f"value is {number!r}; allowed: NaN, and numbers whose squares are finite")
    if not isinstance(outlier, (bool, np.bool_)):
        raise RefusedError(f"outlier is {_a(outlier)}; allowed: True, False")
    return data(payload) if name else payload, number, bool(outlier)
