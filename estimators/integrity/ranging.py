"""The witness of estimators of a pose from ranges and odometry, and how one that is lost begins again."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.integrity.pose_kernels import (
    branch,
    innovations,
    no_branches,
    no_repeats,
    note_repeats,
    predicted,
    reckoned,
)
from mathnavi.estimators.integrity.windows import CLIP, NOTHING, Flags, Thresholds, Windows, Worst
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.reader import ODOMETRY, RANGES, TOO_FAST
from mathnavi.estimators.ranging.reading_kernels import is_within
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart

_WINDOWS = (0.1, 0.5, 2.0, 5.0)  # [s]
_BRANCHED = 0.25  # [s] between two branches of dead reckoning
_REPEATS, _MOVED = 3, 6.0  # repeated readings, and deviations that the prediction has moved meanwhile: stuck

Build = Callable[[RangingMission], Any]


class PoseWitness:
    """Tests of (x, P) against ranges and odometry; the channels are the rays."""

    def __init__(self, mission: RangingMission) -> None:
        self._mission, self._model = mission, RangeModel(mission)
        self._rays = len(self._model.angles)
        self.names = tuple(f"ray {i}" for i in range(self._rays))
        self._thresholds = Thresholds.of(self._rays, mission.period, _WINDOWS, further=1)
        outliers = self._model.outliers  # each of which counts as at most the clipped square
        self.windows = Windows(self._thresholds, self._rays, 1.0 - outliers + outliers * CLIP**2)
        self._lengths = self._thresholds.lengths[1:]
        self._limit = self._thresholds.chi_square(3)
        self._every = max(1, round(_BRANCHED / mission.period))
        self._branches = no_branches(int(self._lengths[-1]) // self._every + 2)
        self._noise = self._model.relative, self._model.absolute, self._model.too_long
        self._limits = TOO_FAST * np.array([mission.speed_max, mission.turn_rate_max])
        self._nothing = np.full(self._rays, np.nan)
        self._k, self._reckoned = 0, 0.0
        self._repeats, self._most = no_repeats(self._rays), 0

    def take(
        self, before: Estimate | None, after: Estimate, measurements: Sequence[Measurement], command: Array, used: Flags
    ) -> None:
        rho = newest(RANGES, measurements)
        rho, u = self._nothing if rho is None else rho, newest(ODOMETRY, measurements)
        reckons, model = u is not None and is_within(u, self._limits), self._model
        u = u if u is not None and reckons else command
        if before is not None and before.covariance is not None and after.t > before.t:
            dt = after.t - before.t
            x, P = predicted(before.x, before.covariance, u, model.W, model.scale, dt)
            e, white, expected = innovations(model.wall, model.angles, self._noise, x, P, rho, used)
            self.windows.add(e, white)
            self._most = note_repeats(self._repeats, rho, expected)
            if reckons:
                square = reckoned(self._branches, self._lengths, after.x, u, model.W, model.scale, dt)
                self._reckoned = square / (self.windows.kappa * self._limit)
            else:
                self._branches.age[:] = -1
                self._reckoned = 0.0
        if self._k % self._every == 0 and after.covariance is not None:
            branch(self._branches, after.x, after.covariance)
        self._k += 1

    def worst(self, used: Flags) -> Worst:
        found = self.windows.worst(used)
        return Worst(self._reckoned, NOTHING, -1) if self._reckoned > found.ratio else found

    def stuck(self) -> list[int]:
        if self._most < _REPEATS:
            return []
        moved = np.abs(self._repeats.now - self._repeats.first)
        least = _MOVED * np.sqrt(self._model.range_variance(np.nan_to_num(self._repeats.last)))
        return np.flatnonzero((self._repeats.times >= _REPEATS) & (moved > least)).tolist()

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        if not out:
            return measurements
        return tuple(_without(each, out) if each.name == RANGES else each for each in measurements)

    def clear(self) -> None:
        self.windows.clear()
        self._branches.age[:] = -1
        self._reckoned = 0.0

    def copy(self) -> PoseWitness:
        made = copy.copy(self)
        made.windows = self.windows.copy()
        made._branches, made._repeats = copy.deepcopy((self._branches, self._repeats))
        return made


def newest(sensor: str, measurements: Sequence[Measurement]) -> Array | None:
    """Value of the newest reading of a sensor; None without one."""
    found = None
    for each in measurements:
        if each.name == sensor and (found is None or each.t >= found.t):
            found = each
    return None if found is None else np.ascontiguousarray(found.value, np.float64)


def _without(reading: Measurement, out: frozenset[int]) -> Measurement:
    value = np.array(reading.value, np.float64)
    value[list(out)] = np.nan
    return dataclasses.replace(reading, value=value)


class Relocation:
    """A finder of the pose of a robot that is lost, from which another filter begins again."""

    def __init__(self, mission: RangingMission, build: Build, finder: Build) -> None:
        """``build`` makes the filter of a mission, ``finder`` an estimator that finds an unknown pose by itself."""
        self._mission, self._build, self._finder = mission, build, finder
        self._finding: Estimator | None = None

    def found(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimator | None:
        if self._finding is None:
            self._finding = self._finder(dataclasses.replace(self._mission, start=None))
        estimate = self._finding.update(t, measurements, command)
        P = estimate.covariance
        if estimate.status is not Status.OK or P is None:
            return None
        self._finding = None
        deviation = np.sqrt(P.diagonal()).tolist()
        start = KnownStart(tuple(estimate.x.tolist()), tuple(max(each, 1e-6) for each in deviation))
        begun: Estimator = self._build(dataclasses.replace(self._mission, start=start))
        return begun


def guarded(build: Build, mission: RangingMission, *, finder: Build | None = None, most_out: int = 2) -> Guarded:
    """The estimator that ``build`` makes of a mission, with its monitor.

    ``finder`` is that of a filter that does not find an unknown pose by itself: its first word is not trusted where the
    start is unknown, and where it is lost it begins again from what the finder found.
    """
    by_itself = finder is None
    return Guarded(
        build(mission), PoseWitness(mission), most_out=most_out, trusted=by_itself or mission.start is not None,
        recovery=None if finder is None else Relocation(mission, build, finder),
    )  # fmt: skip
