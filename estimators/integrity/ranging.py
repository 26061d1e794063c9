"""The witness of estimators of a pose from ranges and odometry, and how one that is lost begins again."""

from __future__ import annotations

import copy
import dataclasses
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.integrity.guard import COST, Guarded
from mathnavi.estimators.integrity.pose_kernels import AGE, begin_branch, no_branches, no_repeats, observe
from mathnavi.estimators.integrity.pose_protection import ALERT, DEVIATIONS, no_responses, nothing_since, square
from mathnavi.estimators.integrity.windows import (
    CLIP,
    IMPOSSIBLE,
    QUIET,
    RECKONED,
    SOFT,
    Flags,
    Thresholds,
    Windows,
    Worst,
)
from mathnavi.estimators.integrity.witness import POSE_LEVELS, is_plausible
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.reader import ODOMETRY, RANGES, TOO_FAST
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart

_WINDOWS = (0.1, 0.5, 2.0, 5.0)  # [s]
_BRANCHED = 0.25  # [s] between two branches of dead reckoning
_REPEATS, _MOVED = 3, 6.0  # repeated readings, and deviations that the prediction has moved meanwhile: stuck
_SOFT_SQUARE = float(chdtri(3, SOFT))  # of odometry that is to be used again
_FINDS_A_POSE = 2  # rays that contradict a wrong pose in a short time; one fits nearly any
_WITHOUT_ODOMETRY = 3  # rays that find a pose by themselves
_NOISIER, _ANYHOW = 10.0, 0.2  # times the declared deviation, and of the greatest speeds: odometry that is left out
_SUREST = 1e-6  # [m, rad] of a start
_ALIKE = float(chdtri(3, 1e-3))  # d' P^-1 d of two estimates of the same pose at most

Build = Callable[[RangingMission], Any]


class PoseWitness:
    """Tests of (x, P) against ranges and odometry; the channels are the rays, and the odometry behind them."""

    def __init__(self, mission: RangingMission) -> None:
        model = RangeModel(mission)
        self._rays, self._range_variance = len(model.angles), model.range_variance
        self.levels = POSE_LEVELS
        self.names = (*(f"ray {i}" for i in range(self._rays)), "odometry")
        self.rebuilt = frozenset({self._rays})
        self._mission = mission
        self.strict, self._strict, self._doubt, self._odometry = False, 0.0, 0.0, 0.0
        thresholds = Thresholds.of(self._rays, mission.period, _WINDOWS, further=1)
        self._outliers = model.outliers  # each of which counts as at most the clipped square
        self._outliers_found = math.nan
        self.windows = Windows(thresholds, self._rays, 1.0 - self._outliers + self._outliers * CLIP**2)
        limits = TOO_FAST * np.array([mission.speed_max, mission.turn_rate_max])
        left_out = np.square(without_odometry(mission).odometry.noise)
        self.constants = np.array(
            [
                *(model.relative, model.absolute, model.too_long, model.scale, *model.W, *limits, thresholds.z),
                *(*left_out, min(round(ALERT / mission.period), thresholds.lengths[-1] // 2)),
            ]
        )
        """errors for the kernels; see ``pose_kernels``"""
        self._soft_square = _SOFT_SQUARE / float(thresholds.energy[3])
        self._fixed = *model.wall, model.rays, self.constants, thresholds.lengths, thresholds.energy
        between = max(1, round(_BRANCHED / mission.period))
        self._responds = max(1, round(between / 3))
        self._every = self._responds * round(between / self._responds)
        self._branches = no_branches(int(thresholds.lengths[-1]) // self._every + 2)
        self._responses, self._since = no_responses(len(self._branches), self._rays), nothing_since(self._rays)
        self._level = np.full(6, np.nan)
        self._map = DEVIATIONS * np.array(mission.map_deviation)
        self._repeats, self._most = no_repeats(self._rays), 0
        self._nothing = np.full(self._rays, np.nan), np.full(2, np.nan)
        self._k = self._odd = 0  # updates, and the last one in which the odometry failed its own test
        self._worst = QUIET

    def take(
        self, before: Estimate | None, after: Estimate, measurements: Sequence[Measurement], command: Array, used: Flags
    ) -> Worst:
        P = after.covariance
        self._strict = self._doubt = self._odometry = 0.0
        if P is None:
            return self._worst
        begins = self._k % self._every == 0
        if before is None or before.covariance is None or after.t <= before.t:
            self._worst = self._worst if is_plausible(after) else Worst(math.inf, IMPOSSIBLE, -1)
        else:
            windows, (rho, u) = self.windows, self._newest(measurements)
            sigma, slip = self._found(before) if "noise" in before.extra else (1.0, 0.0)
            ratio, test, channel, self._most, self._odometry, recent, self._strict, self._doubt = observe(
                *self._fixed, windows.sums, self._branches, self._repeats, self._responses, self._since, self._level,
                windows.k, windows.kappa, sigma, slip, before.x, before.covariance, after.x, P, after.t - before.t,
                rho, u, command, used, begins or self._k % self._responds == 0,
            )  # fmt: skip
            windows.k += 1
            if recent > self._soft_square:
                self._odd = self._k
            if self.strict and self._strict > ratio:
                ratio, test, channel = self._strict, RECKONED, -1
            self._worst = Worst(ratio, test, channel)
        if begins:
            begin_branch(self._branches, self._responses, after.x, P)
        self._k += 1
        return self._worst

    @property
    def suspicious(self) -> bool:
        return self._strict > 1.0

    @property
    def doubtful(self) -> bool:
        return self._doubt > 1.0

    @property
    def protection(self) -> Array:
        """Errors (2,) [m], [rad] of the last estimate: three standard deviations, and what a fault may have caused."""
        level, excess = self._level[4:] + self._map, self.windows.excess
        return level if excess == 1.0 else level + (math.sqrt(excess) - 1.0) * self._level[2:4]

    def widened(self, covariance: Array) -> Array:
        metres, radians = np.square(self.protection / DEVIATIONS).tolist()
        if not math.isfinite(metres + radians):
            return covariance
        wide = covariance.copy()
        wide[:3, :3] += np.diag([metres, metres, radians])
        return wide

    def _found(self, before: Estimate) -> tuple[float, float]:
        """Deviation of ranges over the declared one, and slip [m^2/s], of an estimator that finds its noise itself.

        Its outliers change what the sums of squares are expected to be.
        """
        extra = before.extra
        sigma, outliers = extra["noise"].tolist()
        if outliers != self._outliers_found:
            self._outliers_found, most = outliers, max(self._outliers, outliers)
            self.windows.expect(1.0 - most + most * CLIP**2)
        return max(1.0, sigma), extra["slip"].item() if "slip" in extra else 0.0

    def _newest(self, measurements: Sequence[Measurement]) -> tuple[Array, Array]:
        """Newest ranges (l,) and odometry (2,); NaN for none."""
        ranges = odometry = None
        for each in measurements:
            name = each.name
            if name == RANGES and (ranges is None or each.t >= ranges.t):
                ranges = each
            elif name == ODOMETRY and (odometry is None or each.t >= odometry.t):
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

    def against(self, channel: int) -> float:
        return self._odometry if channel == self._rays else self.windows.of_channel(channel)

    def is_quiet(self, channel: int, updates: int) -> bool:
        if channel == self._rays:
            return self._k - self._odd >= updates
        return self.windows.is_quiet(channel, updates)

    def forget(self, channel: int) -> None:
        if channel == self._rays:
            self._branches[:, AGE], self._odd = -1.0, self._k
        else:
            self.windows.forget(channel)

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        rays = [i for i in out if i < self._rays]
        if not rays:
            return measurements
        return tuple(_without(each, rays) if each.name == RANGES else each for each in measurements)

    def agree(self, one: Estimate, other: Estimate) -> bool:
        assert one.covariance is not None
        assert other.covariance is not None
        d = self._mission.difference(one.x[:3], other.x[:3])
        return square(one.covariance[:3, :3] + other.covariance[:3, :3], d) < _ALIKE

    def clear(self) -> None:
        self.windows.clear()
        self._branches[:, AGE], self._since[:] = -1.0, 0.0
        self._strict = self._doubt = self._odometry = 0.0
        self._worst = QUIET

    def copy(self) -> PoseWitness:
        made = copy.copy(self)
        made.windows = self.windows.copy()
        made._branches, made._repeats = self._branches.copy(), self._repeats.copy()
        made._responses, made._since, made._level = self._responses.copy(), self._since.copy(), self._level.copy()
        return made


def _without(reading: Measurement, rays: list[int]) -> Measurement:
    value = np.array(reading.value, np.float64)
    value[rays] = np.nan
    return dataclasses.replace(reading, value=value)


def without_odometry(mission: RangingMission) -> RangingMission:
    """The mission of a robot whose odometry says next to nothing: ten times its noise, and a fifth of its speeds."""
    odometry, fastest = mission.odometry, (mission.speed_max, mission.turn_rate_max)
    noise = [
        max(_NOISIER * math.hypot(noise, slip), _ANYHOW * most)
        for noise, slip, most in zip(odometry.noise, odometry.slip, fastest, strict=True)
    ]
    return dataclasses.replace(mission, odometry=dataclasses.replace(odometry, noise=(noise[0], noise[1])))


def begun_at(estimate: Estimate, mission: RangingMission, build: Build) -> Estimator | None:
    """The estimator of a mission that begins at an estimate; None where the estimate is unknown, or no place to be."""
    P = estimate.covariance
    if P is None or not is_plausible(estimate):
        return None
    deviation = [max(each, _SUREST) for each in np.sqrt(np.maximum(P.diagonal(), 0.0)).tolist()]
    x_1, x_2, phi = estimate.x[:3].tolist()
    start = KnownStart((x_1, x_2, phi), (deviation[0], deviation[1], deviation[2]), estimate.t)
    try:
        made: Estimator = build(dataclasses.replace(mission, start=start))
    except MissionError:  # outside the wall
        return None
    return made


class Restarts:
    """Estimators of a pose that begin at an estimate, some without odometry."""

    def __init__(self, mission: RangingMission, build: Build, stand_in: Build | None) -> None:
        """``build`` makes the estimator of a mission, ``stand_in`` a simpler one for replays, if any."""
        self._missions, self._build = (mission, without_odometry(mission)), build
        self._replayed = build if stand_in is None else stand_in
        self.stands_in = stand_in is not None
        self.without = frozenset({mission.sensors} if mission.sensors >= _WITHOUT_ODOMETRY else ())

    def begun(self, estimate: Estimate, out: frozenset[int], *, replayed: bool) -> Estimator | None:
        mission = self._missions[self._missions[0].sensors in out]
        return begun_at(estimate, mission, self._replayed if replayed else self._build)


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
        if estimate.status is not Status.OK or estimate.covariance is None:
            return None
        self._finding = None
        return begun_at(estimate, self._mission, self._build)


def guarded(
    build: Build,
    mission: RangingMission,
    *,
    finder: Build | None = None,
    stand_in: Build | None = None,
    most_out: int = 2,
    cost: float = COST,
) -> Guarded:
    """The estimator that ``build`` makes of a mission, with its monitor.

    ``finder`` is that of a filter that does not find an unknown pose by itself: its first word is not trusted where the
    start is unknown, and where it is lost it begins again from what the finder found. Within a polygon, where a wrong
    pose may explain its readings for long, it waits for the finder at an unknown start too. ``stand_in`` makes the
    estimator of replays, where the other takes too long to run again; one whose update takes ``cost`` [s] about.

    From an unknown start as many rays are kept as tell a wrong pose from the right one. How far the map may be off is
    part of what is published, and of nothing within: it moves the walls and the pose alike.
    """
    by_itself, starts = finder is None, mission.start is not None
    spare = mission.sensors - (1 if starts else _FINDS_A_POSE)
    place, direction = np.square(mission.map_deviation).tolist()
    return Guarded(
        build(mission), PoseWitness(mission), most_out=min(most_out, spare), trusted=by_itself or starts,
        unfound=not (by_itself or starts) and isinstance(mission.curve, Polygon),
        recovery=None if finder is None else Relocation(mission, build, finder),
        restart=Restarts(mission, build, stand_in), cost=cost,
        rival=partial(build, dataclasses.replace(mission, start=None)) if by_itself and stand_in is None else None,
        common=np.diag([place, place, direction]) if place or direction else None,
    )  # fmt: skip
