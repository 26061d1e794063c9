"""Detection of a sensor that an estimator requires and whose readings it never uses, by a misspelt name for example."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from mathnavi.interfaces.signals import Measurement

_ENOUGH = 20  # readings that an estimator has received, of which it must have used at least one


@dataclass
class UnusedReadings:
    """Sensors that an estimator requires, until it uses a reading of theirs.

    An estimator selects readings by their sensor's name and reads the value of those it knows. So a value that it
    received and never read belongs to a sensor that it does not know.
    """

    sensors: Sequence[str]
    given: Counter[str] = field(default_factory=Counter)
    used: set[str] = field(default_factory=set)
    reported: set[str] = field(default_factory=set)

    settled: bool = False  # each sensor is used or reported

    def watched(self, readings: Sequence[Measurement]) -> Sequence[Measurement]:
        """Return the readings; those of sensors of which none was used yet note their use."""
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
        """Return the sensors, each once, of which no reading was used though there have been enough of them."""
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
    """Reading that notes when its value is used."""

    used: set[str] = field(compare=False, repr=False)

    def __getattribute__(self, attribute: str) -> Any:
        if attribute == "value":
            self.used.add(self.name)
        return super().__getattribute__(attribute)
