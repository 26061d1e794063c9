"""Notices a sensor that an estimator asked for and whose readings it never uses, a misspelt name for instance."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from mathnavi.sim.interfaces.signals import Measurement

_ENOUGH = 20  # readings that an estimator has been given, for one at least to be used


@dataclass
class UnusedReadings:
    """The sensors that an estimator asked for, until it uses a reading of theirs.

    An estimator picks readings by their sensor's name and reads the value of those it knows. So the value that it was
    given and never read is of a sensor that it does not know.
    """

    sensors: Sequence[str]
    given: Counter[str] = field(default_factory=Counter)
    used: set[str] = field(default_factory=set)
    reported: set[str] = field(default_factory=set)

    settled: bool = False  # each sensor is used or reported

    def watched(self, readings: Sequence[Measurement]) -> Sequence[Measurement]:
        """The readings, those of sensors of which none was used yet in a form that notes their use."""
        if self.settled:
            return readings
        open_ = set(self.sensors) - self.used - self.reported
        self.settled = not open_
        if self.settled:
            return readings
        self.given.update(reading.name for reading in readings if reading.name in open_)
        return [
            _Watched(reading.name, reading.t, reading.value, self.used) if reading.name in open_ else reading
            for reading in readings
        ]

    def found(self) -> list[str]:
        """Sensors, each once, of which no reading was used though there have been enough of them."""
        if self.settled:
            return []
        unused = [
            name
            for name, count in self.given.items()
            if count >= _ENOUGH and name not in self.used and name not in self.reported
        ]
        self.reported.update(unused)
        return unused


@dataclass(frozen=True)
class _Watched(Measurement):
    """A reading that notes when its value is used."""

    used: set[str] = field(compare=False, repr=False)

    def __getattribute__(self, attribute: str) -> Any:
        if attribute == "value":
            self.used.add(self.name)
        return super().__getattribute__(attribute)
