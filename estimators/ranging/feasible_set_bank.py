"""The feasible-set bank: a bank of Kalman filters that starts on the set of feasible states (Definition C.9).

A robot's first readings do not determine its pose, but a set that contains it: FS_y, of dimension 3 - l for l sensors.
So the first readings are averaged, random poses are projected onto FS_y, and those that are farthest from each other
become the hypotheses, each with an extended Kalman filter (``kalman_kernels``). The ranges that are read while the
robot moves decide between them (``bank_kernels``); the estimate is that of the best one. If the start is known there is
one hypothesis only.

**Weights.** Model errors are correlated over many readings, so that ten readings count as one: with the logarithm L_k
of its likelihood a hypothesis has the weight

    w_k = exp(L_k / 10) / sum_j exp(L_j / 10)

(a tempered likelihood; Thrun, Burgard and Fox, Probabilistic Robotics, 2005, section 6.3.4). While the best weight is
less than twice that of all others together that are not within the errors of the best, by d' P^-1 d at 99 %, the
readings do not distinguish these poses: the status is ``INITIALISING``, and ``extra`` has all poses with their weights.

**Noise, outliers and slip** need not be as declared: the bank estimates the scale of the ranges' noise and the share of
outliers (``noise_kernels``) and the slip of the wheels (``bank_kernels``) while it runs. What a scale of the odometry
that is not as declared may have done to the pose is part of the covariance, until the readings tell how much it is.

**Confirmation.** A pose that was found is known once a replay of the readings on the way to it confirms it, and no
other that fits them is found (``confirmation``); one that is becomes a hypothesis.

**Misfit.** The best hypothesis is rejected if it contradicts the rays, by the mean of NIS per ray over the last 0.2 s,
or four readings where that is longer, or by more slip than wheels have. The most likely of the others that do not is
the best from then on. If there is none, the robot was carried away, or no hypothesis was near the truth: new hypotheses
are made from the last readings, and compete with the old one.

**Buildings.** Within a polygon a ray may end on one of several walls (``wall_choice_kernels``), and the map may lack
what stands there, or be wrong (``map_fit``): there a search that explains less than a third of the recent readings
begins again, for to a wrong pose they are all outliers, and its misfit stays small.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Gt, Interval, Lt
from scipy.special import chdtri

from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.integrity.ranging import guarded
from mathnavi.estimators.ranging.bank_kernels import (
    MOST_SLIP,
    Flags,
    Scoring,
    add,
    apart,
    condition_each,
    covariance_of,
    declare_scale,
    drop,
    no_hypotheses,
    predict_each,
)
from mathnavi.estimators.ranging.confirmation import Confirmation, replayed_calls
from mathnavi.estimators.ranging.feasible_set_kernels import farthest_points, project, pushed
from mathnavi.estimators.ranging.last_readings import LastReadings
from mathnavi.estimators.ranging.map_fit import MapFit
from mathnavi.estimators.ranging.model import RangeModel, chi_square_gate
from mathnavi.estimators.ranging.noise_kernels import WINDOW, declared_noise, noise_of
from mathnavi.estimators.ranging.reader import RangeReader
from mathnavi.estimators.ranging.slip_weight import SlipWeight
from mathnavi.estimators.timeout_monitor import waiting
from mathnavi.interfaces.angles import Radians, check_angle
from mathnavi.interfaces.bounds import CountInMemory, Each, Positive, Probability, Seed, Within, configuration
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality

_OF_MEDIAN = 0.5 * np.pi  # variance of the median of many Gaussian numbers over that of their mean
_MOVED = 0.005  # of a range: error of the range in the middle of a motion, from ranges read along it
_FEASIBLE = 1e-4  # probability that a feasible pose is refused
_MORE_OUTLIERS = 1.5  # times their share that may occur by chance while a misfit is averaged
_STEADY = 1e-6  # of the period: what its multiples are rounded by
_NEAREST = 0.1  # [m, rad] between hypotheses at the start
_LEFT = 0.25  # share of the greatest slip with which new hypotheses begin at most
_REMEMBERED = 0.2  # [s] over which the misfit is averaged
_REMEMBERED_READINGS = 0.75  # least memory of the misfit: four readings, however seldom they come
_TEMPERED = 0.1  # power of a likelihood in the weights
_TWICE = 2.0  # times the weight of all others that the best hypothesis has where the pose is known
_ALIKE = float(chdtri(3, 0.01))  # d' P^-1 d below which another hypothesis is within the errors of the best
_TWIN = 1.0  # d' P^-1 d below which two hypotheses are the same


@configuration
class FeasibleSetBankConfig:
    """Fields of the command line."""

    kernels: ClassVar[str] = "mathnavi.estimators.ranging.ahead"  # compiled before the first run

    hypotheses: CountInMemory = 16
    """largest number of hypotheses"""
    candidates: CountInMemory = 300
    """number of random poses that are projected onto the feasible set"""
    readings: CountInMemory = 10
    """number of readings that are averaged for the feasible set"""
    projections: CountInMemory = 3
    """number of steps of the projection onto the feasible set"""
    deviation: Annotated[
        tuple[float, float, float], Each(Interval(gt=0.0, le=100.0), allowed="three values > 0 and <= 100")
    ] = (0.6, 0.4, 0.5)
    """standard deviations X Y HEADING of a new hypothesis [m, m, rad]"""
    forgetting: Probability = 0.9999
    """factor on a score at each update: the share of the past that is kept"""
    lowest: Annotated[float, Lt(0.0)] = -20.0
    """log-likelihood relative to the best hypothesis below which a hypothesis is dropped"""
    misfit: Annotated[float, Within(Gt(1.0), allowed="a value > 1, the mean of one that fits")] = 2.5
    """mean of NIS per ray, not counting outliers, above which the best hypothesis is rejected"""
    gate: Probability = 1e-4
    """probability that a good range is refused"""
    timeout: Positive = 0.5
    """time without a range after which the estimate is lost [s]"""

    def __post_init__(self) -> None:
        check_angle(self.deviation[2], "deviation: of the heading", Radians(0.0, math.pi, open_low=True))

    seed: Seed = 0
    """seed of the random poses"""


class FeasibleSetBank:
    """Estimator of the pose from ranges and odometry: Kalman filters that start on the set of feasible states."""

    Config = FeasibleSetBankConfig

    def __init__(self, config: FeasibleSetBankConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._config, self._model, self._reader = config, RangeModel(mission), RangeReader(mission, config.timeout)
        self._gate = chi_square_gate(config.gate)
        self._sensors = self._model.sensors(self._gate)
        # Of a ray in the distance from the feasible set: all of it, unless some rays are declared to be outliers.
        self._most = self._gate if mission.ranging.outliers > 0.0 else math.inf
        self._noise = declared_noise(mission.ranging.outliers)
        memory = max(1.0 - mission.period / _REMEMBERED, _REMEMBERED_READINGS)
        self._scoring = Scoring(config.forgetting, memory, config.lowest, _TWIN)
        self._symmetry = (max(mission.curve.symmetry, 1), *mission.curve.centre)
        self._candidates = self._model.anywhere(np.random.default_rng(config.seed), config.candidates)
        self._candidates[:, 3] = 0.0
        self._nothing = mission.start_pose
        self._bank = no_hypotheses(config.hypotheses, mission.sensors, WINDOW)
        self._best = 0
        # Ranges may be read more seldom than odometry, or in turn: what is older than the timeout is of no use.
        kept = max(config.readings, math.ceil(config.timeout / mission.period - 1e-9))
        self._last = LastReadings(max(kept, replayed_calls(mission.period, config.timeout)), mission.sensors)
        self._kept = kept  # calls on which a search rests at most
        self._t = mission.begins or 0.0  # [s] of the hypotheses
        self._slip_weight = SlipWeight()
        self._confirmation = Confirmation(
            self._model, self._last, self._candidates, self._symmetry, is_known=mission.start is not None
        )
        self._fit = MapFit(mission)  # of the best hypothesis
        if mission.start is not None:
            self._bank.x[0], self._bank.P[0] = self._model.start()
            declare_scale(self._bank, 1, self._model.scale)
            self._bank.score[0] = 0.0

    @staticmethod
    def build(config: FeasibleSetBankConfig, mission: RangingMission) -> Guarded:
        """Build the estimator of one run, with its monitor of integrity."""
        return guarded(partial(FeasibleSetBank, config), mission)

    @staticmethod
    def sensors(config: FeasibleSetBankConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: FeasibleSetBankConfig, mission: RangingMission) -> RangeQuality:
        """Declared quality of the ranges."""
        return mission.ranging

    @staticmethod
    def properties(config: FeasibleSetBankConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            domain_of_attraction=Domain.GLOBAL,
            rate=Rate.ASYMPTOTIC,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.GLOBAL,
            system_domain=Domain.GLOBAL,
            note="modulo the wall's symmetry",
        )

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]: pose and covariance of the best hypothesis.

        ``command`` (2,) replaces missing odometry. ``extra`` has the ``hypotheses`` (K, 3), their ``scores`` (K,) and
        ``weights`` (K,), NaN for hypotheses that do not exist; ``nis`` (2,), the NIS of the best and its number of
        rays, NaN without an update; ``innovations`` (l,) [m] and ``innovation_std`` (l,) [m], those of the rays by the
        hypothesis that was the best before (``interfaces.innovations``); ``noise`` (2,), the ranges' standard deviation
        over the declared one and the share of outliers; and ``slip`` (1,) [m^2/s], the intensity of the process noise
        of wheel slip. It also counts the readings that were not used, by ray; an outlier is one that is more likely so
        than not to the best hypothesis.
        """
        rho, u = self._reader.read(t, measurements, command)
        self._last.remember(t, rho, u)
        nis = np.full(2, np.nan)
        self._fit.innovations.of_best[:] = np.nan
        if self._is_alive:
            if t > self._t:
                predict_each(
                    self._bank,
                    u,
                    self._model.W,
                    self._model.wall,
                    t - self._t,
                    self._slip_weight.update(u, t - self._t),
                )
            if self._reader.rays:
                nis = self._condition(rho)
        refuted = self._fit.is_refuted
        believed = self._is_alive and self._is_believed and not refuted
        if not believed and not refuted and self._is_alive and (other := self._next_believed()) is not None:
            self._bank.score[self._best], self._best, believed = np.nan, other, True
            self._confirmation.change()
            self._bank.score[:] -= self._bank.score[other]
        self._reader.note(t, believed)
        if not believed:
            self._start()
        self._t = t
        return self._estimate(t, nis)

    @property
    def _is_alive(self) -> bool:
        return not np.isnan(self._bank.score[self._best])

    @property
    def _believed(self) -> Flags:
        """True (K,) for hypotheses that explain the rays with no more than the largest slip; an outlier counts as the
        gate.
        """
        limit = self._config.misfit + _MORE_OUTLIERS * noise_of(self._noise)[1] * self._gate
        believed: Flags = (self._bank.misfit <= limit) & (self._bank.slip < MOST_SLIP) & np.isfinite(self._bank.score)
        believed[self._best] &= not self._confirmation.is_refuted
        return believed

    @property
    def _is_believed(self) -> bool:
        return bool(self._believed[self._best])

    def _next_believed(self) -> int | None:
        """The most likely hypothesis that explains the rays; None without one."""
        believed = self._believed
        return int(np.argmax(np.where(believed, self._bank.score, -np.inf))) if believed.any() else None

    def _window(self) -> tuple[int, Array]:
        """Number of last calls whose readings are averaged, and which rays (l,) have enough of them.

        These are as many calls as readings are to be averaged, more if a ray was not read in them: a ray that is read
        at least half as often as the one that is read most.
        """
        read = np.isfinite(self._last.last(self._kept).ranges)
        often = read.sum(axis=0)
        alive = (2 * often >= often.max()) & (often > 0)
        age = np.argmax(read[::-1], axis=0)  # of the last reading of each ray, in calls
        calls = max(self._config.readings, int(age[alive].max(initial=0)) + 1)
        often = read[-calls:].sum(axis=0)
        return calls, alive & (2 * often >= often.max()) & (often > 0)

    def _condition(self, rho: Array) -> Array:
        before, innovations = self._best, self._fit.innovations
        self._best, nis, rays = condition_each(
            self._bank, before, rho, self._model.wall, self._sensors, self._noise, self._scoring, innovations
        )
        if self._best != before:
            self._confirmation.change()
        drop(self._bank, self._best, self._scoring, self._symmetry)
        if rays:
            self._fit.note(int(innovations.misfits[1]), rays)
            innovations.misfits[1] = 0
        if outliers := innovations.outliers[1]:
            self._reader.counts.add(Unused.OUTLIER, int(outliers))
            innovations.outliers[1] = 0
        return np.array([nis, rays]) if rays else np.full(2, np.nan)

    def _start(self) -> None:
        """Make new hypotheses from the last readings, if there are enough, and keep the best one so far."""
        calls, enough = self._window()
        if self._last.calls < calls or enough.sum() < min(2, len(enough)):
            return
        states, bank, alive = self._feasible(enough, calls), self._bank, self._is_alive
        count, last = len(states), len(bank.score) - 1
        slip = min(float(bank.slip[self._best]), _LEFT * MOST_SLIP)  # the wheels are the same
        if alive and last > 0:
            for values in bank:
                values[last] = values[self._best]
            count = min(count, last)
        bank.x[:count], bank.P[:count] = states[:count], self._model.covariance(self._config.deviation)
        declare_scale(bank, count, self._model.scale)
        bank.mean[:count], bank.readings[:count] = 0.0, 0
        bank.misfit[:], bank.slip[:] = 1.0, slip
        bank.score[:count], bank.score[count:last] = 0.0, np.nan
        bank.score[last] = 0.0 if alive or count > last else np.nan
        self._best = 0
        self._fit.begin_again()
        self._confirmation.begin(calls)

    def _feasible(self, rays: Array, calls: int) -> Array:
        """Feasible states (k, 4), far from each other, by those ``rays`` (l,) that have enough readings in the last
        ``calls``.

        The readings are averaged by their median, which tolerates outliers. As the robot moves meanwhile, this stands
        for the reading at the pose in the middle of them, from which odometry leads to the present pose. A ray whose
        own middle lies elsewhere is off by as far as the robot came between.
        """
        config, model, wall = self._config, self._model, self._model.wall
        y = np.full(len(rays), np.nan)
        ranges, inputs, _ = self._last.last(calls)
        y[rays] = np.nanmedian(ranges[:, rays], axis=0)
        read = np.isfinite(ranges) & rays
        often = np.maximum(read.sum(axis=0), 1)
        v = _OF_MEDIAN * model.range_variance(y) / often
        v += np.square(_MOVED * y)
        ages = np.arange(calls)[::-1]  # [calls]
        middles, middle = ages @ read / often, float(ages @ read.sum(axis=1)) / float(read.sum())
        speed = float(np.abs(inputs[:, 0]).max()) + y * float(np.abs(inputs[:, 1]).max())
        v += np.square(speed * self._step(calls) * (middles - middle))
        states, far = project(self._candidates, y, v, wall, model.rays, config.projections, self._most)
        near_enough = max(chdtri(rays.sum(), _FEASIBLE), np.sort(far)[: config.hypotheses][-1])
        states, far = states[far <= near_enough], far[far <= near_enough]
        chosen = farthest_points(states, int(np.argmin(far)), config.hypotheses, _NEAREST)
        # Inputs from the middle on; of the first a share, if the middle lies between two calls.
        after = math.floor(middle) + 1
        return pushed(states[chosen], inputs[calls - after :], wall, self._step(calls), middle - math.floor(middle))

    def _step(self, calls: int) -> float:
        """Time [s] between two of the last ``calls``: the declared period, unless they come at another rate."""
        times = self._last.last(calls).times
        step = float(times[-1] - times[0]) / (calls - 1) if calls > 1 else self.period
        return self.period if abs(step - self.period) < _STEADY * self.period else step

    def _estimate(self, t: float, nis: Array) -> Estimate:
        bank, best = self._bank, self._best
        likely = np.exp(_TEMPERED * bank.score)
        weights = likely / np.nansum(likely) if self._is_alive else likely
        extra = {
            "hypotheses": np.where(np.isnan(weights)[:, None], np.nan, bank.x[:, :3]),
            "scores": bank.score.copy(),
            "weights": weights,
            "nis": nis,
            **published(self._fit.innovations.of_best),
            "noise": np.array(noise_of(self._noise)),
            "slip": bank.slip[best : best + 1].copy(),
            **self._reader.counts.extra,
        }
        if not self._is_alive:
            return Estimate(t, self._nothing.copy(), None, Status.INITIALISING, extra, self._waits_to_start())
        P = self._fit.inflation * covariance_of(bank, best)
        doubts = np.nansum(weights[apart(bank, best, self._symmetry, _ALIKE)])
        is_known = weights[best] >= _TWICE * doubts
        message = "" if is_known else f"waits for motion: {np.isfinite(weights).sum()} poses explain the ranges so far"
        if is_known and not self._is_confirmed(P):
            is_known, message = False, "waits for motion: the readings do not confirm the pose yet"
        status = self._fit.judged(self._reader.status(t, P)) if is_known else Status.INITIALISING
        message = message or waiting(status, "ranges") or self._reader.message or self._fit.doubt
        return Estimate(t, bank.x[best, :3].copy(), P, status, extra, message)

    def _is_confirmed(self, P: Array) -> bool:
        bank, best, (sigma, outliers) = self._bank, self._best, noise_of(self._noise)
        if self._fit.has_corners:  # to a wrong pose in a building many are outliers, which excuse nothing
            sigma, outliers = max(sigma, 1.0), min(outliers, self._sensors.outliers)
        sensors = self._sensors.noisier(sigma, outliers)
        others = self._confirmation.attempt(bank, best, P, sensors, self._config.misfit, self._fit.inflation)
        add(bank, best, others.states, others.covariances, self._symmetry)
        return self._confirmation.is_confirmed

    def _waits_to_start(self) -> str:
        """Readings that are missing for the first hypotheses."""
        calls, enough = self._window()
        if self._last.calls < calls:
            return f"waits for {calls} readings to average: it has {self._last.calls}"
        needed = min(2, len(enough))
        return f"waits for ranges of {needed} beam{'s' * (needed > 1)} at one pose: it has {enough.sum()}"


def pose_finder(mission: RangingMission, timeout: float = FeasibleSetBankConfig.timeout) -> FeasibleSetBank:
    """The bank, with its standard fields and the ``timeout`` [s] of a filter, which does not find the pose itself."""
    return FeasibleSetBank(FeasibleSetBankConfig(timeout=timeout), mission)
