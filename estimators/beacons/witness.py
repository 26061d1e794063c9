"""Witness of a robot among beacons: tests of its filter's innovations, of each kind of reading of each beacon.

The channels are the beacons: one is left out with all that is read of it, and without beacon 0 so are all differences.
The filter publishes the innovation of each number before it is used, and of those of a beacon that is left out, which
the witness gives to it under another name (``TESTED``). What all differences of an instant have in common is that of
the arrival from beacon 0: the mean of their innovations is tested as its number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.beacons.kernels import DIFFERENCE
from mathnavi.estimators.beacons.model import BeaconModel
from mathnavi.estimators.integrity.number_tests import NumberTests
from mathnavi.estimators.integrity.windows import IMPOSSIBLE, SEPARATED, Flags, Worst
from mathnavi.estimators.integrity.witness import POSE_LEVELS, is_plausible
from mathnavi.estimators.stagewise.model import Piece
from mathnavi.interfaces.signals import Array, Estimate, Measurement
from mathnavi.models.beacon_names import DIFFERENCES
from mathnavi.models.unicycle.beacons import BeaconMission

TESTED = ", only tested"
"""end of the name of a reading of beacons that are left out; only a witness gives it"""
_WINDOWS = (0.5, 2.0, 5.0)  # [s]
_QUICK = 0.5  # [s] in which each beacon is read for these
_ALIKE = float(chdtri(3, 1e-3))


def pace_of(mission: BeaconMission) -> float:
    """Factor of the times of the monitor: all beacons may be read one after the other, every ``interval``."""
    interval = mission.interval or mission.period
    return max(1.0, len(mission.beacons) * interval / _QUICK)


class RobotBeaconWitness(NumberTests):
    """Tests of the innovations of a pose (3,) by beacons."""

    def __init__(self, model: BeaconModel) -> None:
        mission, self._model = model.mission, model
        self.levels = POSE_LEVELS
        self.names = tuple(f"beacon {i}" for i in range(len(mission.beacons)))
        kinds, channels = zip(*model.entries, strict=True)
        self._differences = np.flatnonzero(np.array(kinds) == DIFFERENCE)
        pace = pace_of(mission)
        super().__init__(
            np.array(channels, np.int64),
            np.array([model.errors[kind][0] for kind in kinds]),
            mission.period,
            len(mission.beacons) * (mission.interval or mission.period),
            tuple(pace * each for each in _WINDOWS),
            0.0,  # the filter publishes none of the outliers that are declared
        )
        self.calm = 0
        """readings in sequence after which innovations passed their tests, whatever separations say"""
        self._hard = float(chdtri(3, self.windows.thresholds.alpha))

    def take(
        self, before: Estimate | None, after: Estimate, measurements: Sequence[Measurement], command: Array, used: Flags
    ) -> Worst:
        del before, command
        if not is_plausible(after):
            self._worst = Worst(math.inf, IMPOSSIBLE, -1)
            return self._worst
        self._level = after.extra["protection"].copy()
        nu, white = after.extra["innovations"], after.extra["whitened_innovations"]
        e = nu / after.extra["innovation_std"]
        read = np.isfinite(e)
        if not read.any():
            self.add(self._nothing, self._nothing)
            return self._worst
        first, common = self._differences[:1], e[self._differences]
        if len(first) and np.isfinite(common).any():
            e[first] = np.nansum(common) / math.sqrt(np.isfinite(common).sum())
        self.add(e, white)
        y = self._newest(measurements)
        self.note_repeats(y, y - nu, read & np.isfinite(y))
        worst = self.worst_of(used[self._channel])
        self.calm = 0 if worst.ratio > 1.0 else self.calm + 1
        squares = after.extra["separation"][:-1] / (self._hard * self.windows.kappa)
        if squares.max() > worst.ratio:
            self._worst = worst = Worst(float(squares.max()), SEPARATED, int(squares.argmax()))
        return worst

    def _newest(self, measurements: Sequence[Measurement]) -> Array:
        """Newest number (m,) of each kind and beacon, NaN for none."""
        y = self._nothing.copy()
        for each in sorted(measurements, key=lambda reading: reading.t):
            values = self._model.reading(each)
            if values is not None:
                y = np.where(np.isfinite(values), values, y)
        return y

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        given, n = list[Measurement](), len(self.names)
        for each in measurements:
            gone = sorted(out)
            if each.name not in self._model.names or len(each.value) != n:
                given.append(each)
                continue
            if each.name == DIFFERENCES and 0 in out:
                gone = list(range(n))
            value = np.array(each.value, np.float64)
            tested = np.full(len(value), np.nan)
            tested[gone], value[gone] = value[gone], np.nan
            given.append(replace(each, value=value))
            given.append(replace(each, value=tested, name=each.name + TESTED))
        return tuple(given)

    def agree(self, one: Estimate, other: Estimate) -> bool:
        assert one.covariance is not None
        assert other.covariance is not None
        d = self._model.mission.difference(one.x[:3], other.x[:3])
        return float(d @ np.linalg.solve(one.covariance + other.covariance, d)) < _ALIKE


class TestedReadings:
    """Readings (2, rows) of a robot among beacons: those that are used, and those that are only tested."""

    def __init__(self, model: BeaconModel) -> None:
        self._model = model

    def inputs(self, begin: float, end: float, measurements: Sequence[Measurement], command: Array) -> Sequence[Piece]:
        return self._model.inputs(begin, end, measurements, command)

    def reading(self, measurement: Measurement) -> Array | None:
        tested = measurement.name.endswith(TESTED)
        name = measurement.name.removesuffix(TESTED)
        y = self._model.reading(replace(measurement, name=name) if tested else measurement)
        if y is None:
            return None
        nothing = np.full_like(y, np.nan)
        return np.stack((nothing, y) if tested else (y, nothing))
