"""The start of a smoother over a whole run, which the filter finds: where it begins, of all places that it tried."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.unicycle.beacons import BeaconMission

if TYPE_CHECKING:
    from mathnavi.estimators.beacons.filter import BeaconBankConfig


class StartFindingModel(BeaconModel):
    """Model whose start, if it is not known, is that of the filter which the run leaves."""

    def __init__(self, config: BeaconBankConfig, mission: BeaconMission) -> None:
        super().__init__(mission)
        self._config = config
        self._waits = 0  # stages with readings before the start

    def prepare(self, samples: Sequence[tuple[float, Sequence[Measurement], Array]]) -> None:
        """Find the start in a run, of time [s], readings and input each; ArgumentError if there is none.

        Of the poses that its first reading allows it is the one from which a filter leads to the pose that is left.
        """
        from mathnavi.estimators.beacons.filter import BeaconFilter

        if self.mission.start is not None:
            return
        finder = BeaconFilter(self._config, self.mission)
        for t, measurements, command in samples:
            finder.update(t, measurements, command)
            if finder.found and finder.bank.weights.max() > 0.999:
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
