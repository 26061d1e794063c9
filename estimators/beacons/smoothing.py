"""The start of a smoother over a whole run, which the filter finds: where it begins, of all places that it tried.

Of beacons at unknown places it takes where the filter found them at last, b^, and that nothing is known of them at the
start, so that no reading counts twice; a start that is not known is then the first pose of the batch fit. Readings are
linearised there, however far off the few first ones put a beacon:

    h(x, b) = h(x, b^) + dh/db (x, b^) (b - b^).

While nothing is known of a beacon, any reading of it is as good as another; so those that are outliers by the batch fit
of all readings are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from mathnavi.estimators.beacons.bank import BeaconBank
from mathnavi.estimators.beacons.kernels import RANGE, STATES
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.unicycle.beacons import BeaconMission

_SURE = 0.999  # weight of the filter that is taken for the run's


class Finder(Protocol):
    """A filter that finds an unknown start."""

    bank: BeaconBank
    model: BeaconModel
    found: bool
    begun_at: int
    """number of stages with readings up to the one at which its filters began"""

    def outliers(self) -> frozenset[tuple[int, int, float]]:
        """Kind, beacon and value of each reading that is an outlier by all readings together."""
        ...

    def first_pose(self) -> Array | None:
        """Pose (3,) at which its filters began by all readings together; None where it has none."""
        ...

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate at t [s]."""
        ...


class StartFindingModel(BeaconModel):
    """Model whose start, if it is not known, is that of the filter which the run leaves."""

    def __init__(self, mission: BeaconMission, finder: Finder) -> None:
        super().__init__(mission)
        self._finder = finder
        self._found: Array | None = None  # (2 m,) [m] unknown places, as found
        self._outliers: frozenset[tuple[int, int, float]] = frozenset()  # kind, beacon and value of readings
        self._waits = 0  # stages with readings before the start

    @property
    def _knows_all(self) -> bool:
        return self.mission.start is not None and not self.mission.unknown

    def prepare(self, samples: Sequence[tuple[float, Sequence[Measurement], Array]]) -> None:
        """Find the start in a run, of time [s], readings and input each; ArgumentError if it is not found.

        Of the poses that its first reading allows it is the one from which a filter leads to the pose that is left.
        """
        if self._knows_all:
            return
        finder, bank = self._finder, self._finder.bank
        for t, measurements, command in samples:
            finder.update(t, measurements, command)
            if not self.mission.unknown and finder.found and _shares(bank).max() > _SURE:
                break
        if not finder.found or _shares(bank).max() <= _SURE:
            raise ArgumentError("the run does not say where it begins; allowed: one in which the filter finds the pose")
        seed, (x, P) = int(_shares(bank).argmax()), bank.starts
        start, covariance = x[seed].copy(), P[seed].copy()
        start[STATES:] = self._found = bank.x[bank.best, STATES:].copy()
        first = finder.first_pose()
        if self.mission.start is None and first is not None and self.errors.keys() != {RANGE}:
            start[:3] = first  # a grid is too coarse to linearise at; ranges alone begin on a circle
        nothing = self.covariance(np.zeros(3))
        covariance[STATES:], covariance[:, STATES:] = nothing[STATES:], nothing[:, STATES:]
        self.placed = finder.model.placed.copy()
        self._outliers = finder.outliers()
        self.begin(start, covariance)
        self._waits = finder.begun_at - 1

    def start(self, reading: Array | None) -> tuple[Array, Array] | None:
        if self.mission.start is not None:  # before the first reading too
            return super().start(reading)
        if reading is None:
            return None
        self._waits -= 1
        return super().start(reading) if self._waits < 0 else None

    def residual(self, x: Array, y: Array) -> tuple[Array, Array]:
        if self._found is None:
            return super().residual(x, y)
        far = [(*self.entries[row], float(y[row])) in self._outliers for row in range(len(y))]
        r, W = super().residual(np.concatenate([x[:STATES], self._found]), np.where(far, np.nan, y))
        return r - W[:, STATES:] @ (x[STATES:] - self._found), W


def _shares(bank: BeaconBank) -> Array:
    """Weight of the filters that began at each place."""
    return np.asarray(np.bincount(bank.seeds, bank.weights, minlength=1), dtype=np.float64)
