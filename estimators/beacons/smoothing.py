"""The start of a smoother over a whole run, which the filter finds: where it begins, of all places that it tried."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from mathnavi.estimators.beacons.bank import BeaconBank
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.unicycle.beacons import BeaconMission

_SURE = 0.999  # weight of the filter that is taken for the run's


class Finder(Protocol):
    """A filter that finds an unknown start."""

    bank: BeaconBank
    found: bool
    begun_at: int
    """number of stages with readings up to the one at which its filters began"""

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate at t [s]."""
        ...


class StartFindingModel(BeaconModel):
    """Model whose start, if it is not known, is that of the filter which the run leaves."""

    def __init__(self, mission: BeaconMission, finder: Finder) -> None:
        super().__init__(mission)
        self._finder = finder
        self._waits = 0  # stages with readings before the start

    def prepare(self, samples: Sequence[tuple[float, Sequence[Measurement], Array]]) -> None:
        """Find the start in a run, of time [s], readings and input each; ArgumentError if it is not found.

        Of the poses that its first reading allows it is the one from which a filter leads to the pose that is left.
        """
        if self.mission.start is not None:
            return
        finder = self._finder
        for t, measurements, command in samples:
            finder.update(t, measurements, command)
            if finder.found and finder.bank.weights.max() > _SURE:
                break
        else:
            raise ArgumentError("the run does not say where it begins; allowed: one in which the filter finds the pose")
        seed = int(finder.bank.seeds[finder.bank.best])
        x, P = finder.bank.starts
        self.begin(x[seed], P[seed])
        self._waits = finder.begun_at - 1

    def start(self, reading: Array | None) -> tuple[Array, Array] | None:
        if self.mission.start is not None:
            return super().start(reading)
        if reading is None:
            return None
        self._waits -= 1
        return super().start(reading) if self._waits < 0 else None
