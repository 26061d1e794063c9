"""Messages with named fields as rows of numbers: what the readers of ROS, MCAP and PX4 have in common.

A field of a field is called "outer.inner", a number of a list "field 0". A message that lacks a number which another of
its channel has holds NaN there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.sim.logs.recorded_log import Channel, Role

MOST_NUMBERS = 4096  # of a message; pictures, point clouds and scenes have more
NANOSECONDS = 10**9  # of a second


def numbers_in(message: Any, before: str = "", skipped: set[str] | None = None) -> Iterator[tuple[str, float]]:
    """Name and value of each number in a message of mappings, lists and objects with fields, in their order.

    Texts are left out, and bytes and lists of more than ``MOST_NUMBERS``, whose names are added to ``skipped``.
    """
    left = set() if skipped is None else skipped
    if isinstance(message, bool | int | float | np.number):
        yield before or "value", float(message)
    elif isinstance(message, str | None):
        return
    elif isinstance(message, bytes | bytearray) or (isinstance(message, np.ndarray) and message.dtype == np.uint8):
        left.add(before)
    elif isinstance(message, Mapping):
        for name, value in message.items():
            yield from numbers_in(value, f"{before}.{name}" if before else str(name), left)
    elif isinstance(message, Sequence | np.ndarray):
        if len(message) > MOST_NUMBERS:
            left.add(before)
            return
        for k, value in enumerate(message.tolist() if isinstance(message, np.ndarray) else message):
            yield from numbers_in(value, f"{before} {k}", left)
    else:
        for name in getattr(type(message), "__dataclass_fields__", ()):
            if not name.startswith("__"):
                yield from numbers_in(getattr(message, name), f"{before}.{name}" if before else name, left)


@dataclass
class Messages:
    """Messages of one channel, in the order in which they were recorded."""

    stamps: list[int] = field(default_factory=list)  # [ns]
    rows: list[dict[str, float]] = field(default_factory=list)
    skipped: set[str] = field(default_factory=set)  # names of what was left out
    facts: dict[str, str] = field(default_factory=dict)
    frame: str = ""
    kind: str = ""  # of the messages

    def add(self, stamp: int, message: Any, without: Sequence[str] = ()) -> None:
        """Add a message, but for some of its fields."""
        numbers = (
            each for each in numbers_in(message, skipped=self.skipped) if each[0].partition(".")[0] not in without
        )
        row = dict(islice(numbers, MOST_NUMBERS + 1))
        if len(row) > MOST_NUMBERS:
            self.skipped.add("all of a message")
            row = {}
        self.stamps.append(stamp)
        self.rows.append(row)

    def channel(self, start: int, units: Mapping[str, str] | None = None, role: Role = "reading") -> Channel | None:
        """The channel, with stamps from ``start`` [ns] on; None where no message has a number.

        ``units`` are those of signals by the beginnings of their names.
        """
        names = list(dict.fromkeys(name for row in self.rows for name in row))
        if not names:
            return None
        values = np.array([[row.get(name, np.nan) for name in names] for row in self.rows])
        signals = tuple(f"{name} [{unit}]" if (unit := _unit(name, units or {})) else name for name in names)
        return Channel(seconds(self.stamps, start), values, signals, role, self.frame, self.facts)


def seconds(stamps: Sequence[int], start: int) -> Array:
    """Times (n,) [s] of stamps [ns] from ``start`` on, subtracted while they are whole numbers."""
    since: Integers = np.array([stamp - start for stamp in stamps], dtype=np.int64)
    return since / NANOSECONDS


def _unit(name: str, units: Mapping[str, str]) -> str:
    return next((unit for beginning, unit in units.items() if name.startswith(beginning)), "")
