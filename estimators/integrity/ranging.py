"""The witness of estimators of a pose from ranges and odometry, and how one that is lost begins again."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.integrity.pose_kernels import AGE, begin_branch, no_branches, no_repeats, observe
from mathnavi.estimators.integrity.windows import CLIP, IMPOSSIBLE, QUIET, Flags, Thresholds, Windows, Worst
from mathnavi.estimators.integrity.witness import is_plausible
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.reader import ODOMETRY, RANGES, TOO_FAST
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
        model = RangeModel(mission)
        self._rays, self._range_variance = len(model.angles), model.range_variance
        self.names = tuple(f"ray {i}" for i in range(self._rays))
        thresholds = Thresholds.of(self._rays, mission.period, _WINDOWS, further=1)
        self._outliers = model.outliers  # each of which counts as at most the clipped square
        self.windows = Windows(thresholds, self._rays, 1.0 - self._outliers + self._outliers * CLIP**2)
        limits = TOO_FAST * np.array([mission.speed_max, mission.turn_rate_max])
        self._fixed = (
            *model.wall,
            model.angles,
            np.array([model.relative, model.absolute, model.too_long, model.scale, *model.W, *limits, thresholds.z]),
            thresholds.lengths,
            thresholds.energy,
        )
        self._every = max(1, round(_BRANCHED / mission.period))
        self._branches = no_branches(int(thresholds.lengths[-1]) // self._every + 2)
        self._repeats, self._most = no_repeats(self._rays), 0
        self._nothing = np.full(self._rays, np.nan), np.full(2, np.nan)
        self._k = 0
        self._worst = QUIET

    def take(
        self, before: Estimate | None, after: Estimate, measurements: Sequence[Measurement], command: Array, used: Flags
    ) -> Worst:
        P = after.covariance
        if P is None:
            return self._worst
        if before is None or before.covariance is None or after.t <= before.t:
            self._worst = self._worst if is_plausible(after) else Worst(math.inf, IMPOSSIBLE, -1)
        else:
            windows, (rho, u) = self.windows, self._newest(measurements)
            sigma, slip = self._found(before) if "noise" in before.extra else (1.0, 0.0)
            ratio, test, channel, self._most = observe(
                *self._fixed, windows.sums, self._branches, self._repeats, windows.k, windows.kappa,
                sigma, slip, before.x, before.covariance, after.x, P, after.t - before.t,
                rho, u, command, used,
            )  # fmt: skip
            windows.k += 1
            self._worst = Worst(ratio, test, channel)
        if self._k % self._every == 0:
            begin_branch(self._branches, after.x, P)
        self._k += 1
        return self._worst

    def _found(self, before: Estimate) -> tuple[float, float]:
        """Deviation of ranges over the declared one, and slip [m^2/s], of an estimator that finds its noise itself.

        Its outliers change what the sums of squares are expected to be.
        """
        sigma, outliers = before.extra["noise"].tolist()
        most = max(self._outliers, outliers)
        self.windows.expect(1.0 - most + most * CLIP**2)
        return max(1.0, sigma), float(before.extra["slip"][0]) if "slip" in before.extra else 0.0

    def _newest(self, measurements: Sequence[Measurement]) -> tuple[Array, Array]:
        """Newest ranges (l,) and odometry (2,); NaN for none."""
        ranges = odometry = None
        for each in measurements:
            if each.name == RANGES and (ranges is None or each.t >= ranges.t):
                ranges = each
            elif each.name == ODOMETRY and (odometry is None or each.t >= odometry.t):
                odometry = each
        rho, u = self._nothing
        return (
            rho if ranges is None else np.ascontiguousarray(ranges.value, np.float64),
            u if odometry is None else np.ascontiguousarray(odometry.value, np.float64),
        )

    def stuck(self) -> list[int]:
        if self._most < _REPEATS:
            return []
        last, first, now, times = self._repeats
        least = _MOVED * np.sqrt(self._range_variance(np.nan_to_num(last)))
        return np.flatnonzero((times >= _REPEATS) & (np.abs(now - first) > least)).tolist()

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        if not out:
            return measurements
        return tuple(_without(each, out) if each.name == RANGES else each for each in measurements)

    def clear(self) -> None:
        self.windows.clear()
        self._branches[:, AGE] = -1.0
        self._worst = QUIET

    def copy(self) -> PoseWitness:
        made = copy.copy(self)
        made.windows = self.windows.copy()
        made._branches, made._repeats = self._branches.copy(), self._repeats.copy()
        return made


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
