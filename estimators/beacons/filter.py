"""The plug-in ``beacon_bank``: the pose of a unicycle from odometry and readings of beacons, each at its own time.

Beacons at unknown places are found together with the pose: in the frame of the known start, or of the known beacons.

A bank of extended Kalman filters (``bank``) finds an unknown start; once one pose is left it is one filter. It begins
again, from anywhere, where its readings contradict it for long, or where it has not read a beacon for so long that it
knows next to nothing.

    INITIALISING   until position and heading are known: their standard deviations, over all filters that are left,
                   are at most a share ``found`` of the surroundings and 20 degrees; and until all unknown
                   beacons that are read are at one place each, as exactly, and a batch fit of all readings (``batch``)
                   confirms it. One that is first read later says nothing until it is found.
    LOST           without a reading for ``timeout``, and from a new beginning on until the pose is found again
    DEGRADED       without odometry for ``timeout``; while innovations are larger or less random than declared; while
                   no state fits all readings, with beacons at unknown places
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.beacons.bank import BeaconBank
from mathnavi.estimators.beacons.batch import BatchFit
from mathnavi.estimators.beacons.guarded import GuardedRobot
from mathnavi.estimators.beacons.kernels import DIFFERENCE, STATES
from mathnavi.estimators.beacons.model import ODOMETRY, BeaconModel
from mathnavi.estimators.beacons.refusals import Refusals
from mathnavi.estimators.beacons.separation import SolutionSeparation, mistrust
from mathnavi.estimators.beacons.smoothing import StartFindingModel
from mathnavi.estimators.beacons.witness import TESTED, TestedReadings, pace_of
from mathnavi.estimators.integrity.innovations import InnovationMonitor
from mathnavi.estimators.ranging.model import chi_square_gate
from mathnavi.estimators.stagewise.model import StageBuilder
from mathnavi.estimators.timeout_monitor import InnovationMean, TimeoutMonitor, waiting, worst
from mathnavi.interfaces.bounds import Positive, PositiveFraction, Probability, configuration
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.beacons import BeaconFieldMission, BeaconMission, BeaconQuality, beacons_of

_HEADING = math.radians(20.0)  # [rad] to which a heading is known once the pose is found
_FEWEST = 6  # readings until it is
_UNKNOWN = 0.25  # of the surroundings: standard deviation of a position that is not known any more
_SCALES = ("scale error of speed [-]", "scale error of turn rate [-]", "scale error of ranges [-]")
_GROWTH, _LEAST_GROWTH = 1.05, 4  # of the stages, and number of them, until the batch fit is made again
_TRUSTED = 5.0  # [s] for which mistrusted odometry is tested, times the pace
_LIKELY = 11.3  # square of the separation of odometry that explains an alarm: chi-square of three, one in 100
_SHOWN = 16  # hypotheses that an estimate carries


@configuration
class BeaconBankConfig:
    """Fields of the command line."""

    kernels: ClassVar[str] = "mathnavi.estimators.beacons.batch_ahead"  # compiled before the first run

    gate: Probability = 1e-5
    """probability that a good reading is refused"""
    found: PositiveFraction = 0.05
    """standard deviation of a position that is found, as a share of the diagonal of the surroundings"""
    timeout: Positive = 5.0
    """time without a beacon after which the estimate is lost, and without odometry after which it is degraded [s]"""


class BeaconFilter:
    """Estimator of the pose from beacons or landmarks and odometry: a bank of Kalman filters that finds the start."""

    Config = BeaconBankConfig

    def __init__(self, config: BeaconBankConfig, mission: BeaconMission) -> None:
        self.period = mission.period
        self.model = BeaconModel(mission)
        self.bank = BeaconBank(self.model, chi_square_gate(config.gate))
        self.figures: Mapping[str, tuple[str, ...]] = {"scales": _SCALES, **self.model.figures}
        self._stages, self.counts = StageBuilder(TestedReadings(self.model)), ReadingCounts()
        interval = mission.interval or mission.period
        self._beacons = TimeoutMonitor(config.timeout, interval, of="readings of beacons")
        self._odometry = TimeoutMonitor(config.timeout, mission.period, beyond=Status.DEGRADED, of="odometry")
        self._monitor = InnovationMonitor("readings", 1, interval)
        gate, lasts = chi_square_gate(config.gate), _TRUSTED * pace_of(mission)
        self._separation = None if mission.unknown else SolutionSeparation(self.model, gate, lasts)
        self._innovations = np.full((3, self.model.rows), np.nan)  # nu, their deviations, and whitened ones
        self._fits = InnovationMean(chi_square_gate(config.gate))
        self._farthest = config.found * mission.longest  # [m]
        outliers = max(quality.outliers for quality in mission.qualities if quality is not None)
        self._refusals = Refusals(len(mission.beacons), outliers)
        self.found = mission.start is not None and not mission.unknown
        """whether the pose is known, and at first the places of the beacons"""
        self._read = np.zeros(len(mission.beacons), dtype=int)  # number of readings of each beacon
        self._batch = BatchFit(self.model) if mission.unknown else None
        self._confirmed = self.model.placed.copy()  # (n,) whether a place is known, or was confirmed by the batch fit
        self._due = 0  # stages from which on the batch fit is made again
        self._rival: int | None = None  # beacon with another place that is as good
        self._contradicted = False  # True while what fits all readings best contradicts some
        self._fitted = True  # False while no state fits all readings
        self._refusals_of = Refusals(len(mission.beacons), outliers)  # of the place that a reading contradicts
        self.begun_at = 0
        """number of stages with readings up to the one at which the filters began, itself among them"""
        self._stage = 0
        self._again = False  # True from a new beginning on
        self._used = 0  # readings since the beginning
        self._nis = np.full(2, np.nan)
        if mission.start is not None and mission.begins is not None:
            self._stages.add(mission.begins, (), np.zeros(2))
        if mission.start is not None:
            self._begin(None)

    @staticmethod
    def build(config: BeaconBankConfig, mission: BeaconMission | BeaconFieldMission) -> BeaconFilter | GuardedRobot:
        """Build the estimator of one run, with its monitor where all places are known."""
        known = beacons_of(mission)
        made = BeaconFilter(config, known)
        if known.unknown:
            return made
        return GuardedRobot(made, partial(BeaconFilter, config, replace(known, start=None)))

    @staticmethod
    def sensors(config: BeaconBankConfig, mission: BeaconMission | BeaconFieldMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return beacons_of(mission).sensors_carried()

    @staticmethod
    def quality(config: BeaconBankConfig, mission: BeaconMission | BeaconFieldMission) -> BeaconQuality:
        """Declared quality of the first kind of readings."""
        return next(quality for quality in beacons_of(mission).qualities if quality is not None)

    @staticmethod
    def properties(config: BeaconBankConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            domain_of_attraction=Domain.GLOBAL,
            rate=Rate.ASYMPTOTIC,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.GLOBAL,
            system_domain=Domain.GLOBAL,
            stays_on_truth=False,
            note="from ranges to beacons on a line only once the robot turns; its expected reading is a mean over its "
            "covariance and differs from the true one even on the truth, by less the surer it is",
        )

    @staticmethod
    def stagewise_model(config: BeaconBankConfig, mission: BeaconMission | BeaconFieldMission) -> BeaconModel:
        """Model for the smoother of a whole run."""
        known = beacons_of(mission)
        return StartFindingModel(known, BeaconFilter(config, known))

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]; ``command`` (2,) replaces odometry that there never was.

        ``extra["nis"]`` (2,) is NIS and the number of readings in it, NaN where there was no update,
        ``extra["hypotheses"]`` (16, 3) the poses of the heaviest filters and ``extra["scores"]`` (16,) the logarithms
        of their weights over the largest, NaN where there are fewer; ``extra["scales"]`` (3,) the scale errors of
        speed, turn rate and ranges; ``extra`` also counts the readings that were not used. With beacons at unknown
        places ``extra["beacons"]`` (2 n,) [m] are the places of all, two numbers each, NaN until one is found, and
        ``extra["beacons_covariance"]`` (2 n, 2 n) [m^2] is their covariance, that of known ones zero.
        """
        self._count(measurements)
        if any(self.model.odometry(each) is not None for each in measurements):
            self._odometry.note(t)
        self._nis[:] = self._innovations[:] = np.nan
        for stage in self._stages.add(t, measurements, command):
            if self.bank.begun:
                for h, u in stage.inputs:
                    self.bank.predict(u, h)
                    if self._separation is not None and self._separation.mistrusts:
                        mistrust(self.bank.x, self.bank.P, h)
                    if self._separation is not None and self.found:
                        self._separation.predict(u, h)
                if self._batch is not None:
                    self._batch.move(stage.inputs)
            self._stage += bool(stage.readings)
            for y, tested in stage.readings:
                self._test(y, tested)
                self._take(stage.t, y)
        return self._estimate(t)

    def _count(self, measurements: Sequence[Measurement]) -> None:
        for each in measurements:
            if each.name.endswith(TESTED):
                continue
            reason = self.model.unused(each)
            if reason is None and self._stages.is_late(each.t) and each.name != ODOMETRY:
                reason = Unused.LATE
            if reason is None:
                broken = int(np.isinf(each.value).sum())
                if broken:
                    self.counts.add(Unused.NOT_FINITE, broken)
            elif reason is not Unused.NOT_FINITE or not np.isnan(each.value).all():
                self.counts.add(reason)

    def _begin(self, y: Array | None) -> bool:
        started = self.model.start(None) if y is None else None
        if started is not None:
            self.bank.begin(*started)
            if self._separation is not None:
                self._separation.begin(*started)
        elif y is None or not self.bank.begin_anywhere(y):
            return False
        if self._batch is not None:
            self._begin_batch(started)
        self._used, self.begun_at = 0, self._stage
        self._refusals.clear()
        self._refusals_of.clear()
        return True

    def _test(self, *readings: Array) -> None:
        """Note the innovations of readings (rows,) that are not used yet, by the heaviest filter."""
        if not self.found:
            return
        for y in readings:
            for row in np.flatnonzero(np.isfinite(y)).tolist():
                if (found := self.bank.innovation(row, float(y[row]))) is not None:
                    self._innovations[0, row], self._innovations[1, row] = found[0], math.sqrt(found[1])

    def _take(self, t: float, y: Array) -> None:
        """Condition on the readings y (rows,) of t [s]."""
        if not np.isfinite(y).any():  # of beacons that are left out
            return
        if (not self.bank.begun or (self._is_unknown() and self.found)) and self._begin(y):
            self._again = self._again or self.found
            self.found = False
        if not self.bank.begun:
            return
        known = self.found
        answers = self.bank.condition(y)
        if self._batch is not None:
            self._batch.read(y)
        if self._separation is not None and known:
            self._separation.condition(y)
        squares = np.array([nu * nu / s for _, nu, s, _ in answers])
        refused = np.array([beta < 0.5 for *_, beta in answers], dtype=bool)
        self._note_unknown(y, answers, refused)
        self._used += len(answers)
        for (row, *_), out in zip(answers, refused.tolist(), strict=True):
            self._refusals.note(self.model.entries[row][1], out)
        good = ~refused
        if refused.any() and known:
            self.counts.add(Unused.OUTLIER, int(refused.sum()))
        if good.any():
            self._nis[:] = np.nansum([self._nis[0], squares[good].sum()]), np.nansum([self._nis[1], good.sum()])
        fits = self._fits.fits(squares, self._beacons.converged)
        self._beacons.note(t, agrees=fits)
        if known:
            declared = bool(refused.any()) and self._refusals.as_declared
            for (row, nu, s, _), out in zip(answers, refused.tolist(), strict=True):
                if out and declared:
                    self._innovations[:2, row] = np.nan
                else:
                    self._innovations[2, row] = nu / math.sqrt(s)
                    self._monitor.note(t, np.array([nu]), np.array([[s]]), np.array([[self._noise(row, s)]]))
        elif self._is_found() and self._is_confirmed():
            self.found = True
            self._monitor.begin_again()
            if self._separation is not None:
                self._separation.begin(*self.bank.moments())
            if self._again:
                self._beacons.restart(t)
            self._again = False
        if known:
            self._is_confirmed()
        if self._refusals.are_most() and self._begin(y):
            self._again, self.found = self._again or self.found, False
            self.bank.condition(y)
            if self._batch is not None:
                self._batch.read(y)

    def _note_unknown(
        self, y: Array, answers: Sequence[tuple[int, float, float, float]], refused: NDArray[np.bool_]
    ) -> None:
        """Count what is read of each beacon, and forget the place of one whose readings contradict it for long."""
        for row in np.flatnonzero(np.isfinite(y)).tolist():
            self._read[self.model.entries[row][1]] += 1
        for (row, *_), out in zip(answers, refused.tolist(), strict=True):
            i = self.model.contradicted(*self.model.entries[row])
            self._refusals_of.note(i, out)
            if self.model.columns[i] >= 0 and self._refusals_of.are_most(i):
                self._refusals_of.clear(i)
                self.bank.forget(i)
                self._confirmed[i] = False
                if self._batch is not None:
                    self._batch.forget(i)

    def outliers(self) -> frozenset[tuple[int, int, float]]:
        """Kind, beacon and value of each reading that is an outlier by the batch fit; none with all places known."""
        found = self._batch.fit(self.bank.x[self.bank.best]) if self._batch is not None else None
        return frozenset() if self._batch is None or found is None else self._batch.outliers(found)

    def first_pose(self) -> Array | None:
        """Pose (3,) at which the filters began by the batch fit of all readings since; None without one."""
        return self._batch.first_pose if self._batch is not None else None

    def _begin_batch(self, started: tuple[Array, Array] | None) -> None:
        """Begin the batch fit again: at a start (d,) with its covariance, or anywhere, with what the bank has of all
        but the pose.
        """
        assert self._batch is not None
        if started is None:
            P = self.model.covariance(np.full(3, math.inf))
            P[STATES:, STATES:] = self.bank.P[self.bank.best, STATES:, STATES:]
            started = self.bank.x[self.bank.best], P
        self._batch.begin(*started)
        self._due = 0

    def _is_confirmed(self) -> bool:
        """True if all readings together confirm what the bank has; it then goes on from what fits them.

        That is made again whenever there are 5 % more readings, while all places are where one filter has them.
        """
        if self._batch is None:
            return True
        placed = self.model.placed
        if self._batch.stages < self._due or not (self.bank.places_found(self._farthest, alone=True) | ~placed).all():
            return False
        self._due = math.ceil(_GROWTH * self._batch.stages) + _LEAST_GROWTH
        found, self._rival = self._batch.fit(self.bank.x[self.bank.best]), None
        self._fitted = found is not None
        if found is None:
            return False
        if not (self._confirmed | ~placed).all():
            found, self._rival = self._batch.alone(found)
            if self._rival is not None:
                return False
        P = found.covariance
        if not self._is_exact(P):
            return False
        self._contradicted = self._batch.contradicts(found)
        self.bank.settle(found.state, P)
        self._confirmed = placed.copy()
        return True

    def _is_exact(self, P: Array) -> bool:
        """True if a covariance (d, d) is that of a pose, and of places, that are found."""
        columns = self.model.columns[self.model.placed & (self.model.columns >= 0)]
        variances = np.diag(P)
        places = variances[columns] + variances[columns + 1]
        limit = self._farthest**2
        return float(P[0, 0] + P[1, 1]) <= limit and float(P[2, 2]) <= _HEADING**2 and bool((places <= limit).all())

    def _noise(self, row: int, s: float) -> float:
        """Variance of the reading itself, at most s."""
        kind, _ = self.model.entries[row]
        return min(float(self.model.errors[kind][0]) ** 2, s)

    def _is_found(self) -> bool:
        if self._used < _FEWEST:
            return False
        _, P = self.bank.moments()
        places = self.bank.places_found(self._farthest, alone=True)
        if self.model.mission.unknown and not places.any():
            return False
        places |= self._read == 0
        return float(P[0, 0] + P[1, 1]) <= self._farthest**2 and float(P[2, 2]) <= _HEADING**2 and bool(places.all())

    def _is_unknown(self) -> bool:
        _, P = self.bank.moments()
        return float(P[0, 0] + P[1, 1]) > (_UNKNOWN * self.model.mission.longest) ** 2

    def _estimate(self, t: float) -> Estimate:
        if not self.bank.begun:
            low, high = self.model.mission.box
            deviations = np.array([*(high - low) / math.sqrt(12.0), math.pi / math.sqrt(3.0)])
            x, P = self.model.state(np.array([*(0.5 * (low + high)), 0.0])), self.model.covariance(deviations)
        else:
            x, P = self.bank.moments()
            P = P * self._monitor.inflation
        known = self._separation
        if known is not None and self.found and (better := known.judge(x, P)) is not None:
            x, P = better
            self.bank.settle(x, P)
        status, message = self._status(t, P[:3, :3])
        poses, scores = self.bank.heaviest(_SHOWN)
        extra = {
            "nis": self._nis.copy(),
            "hypotheses": poses,
            "scores": scores,
            "scales": x[3:6].copy(),
            **({} if known is None else {"separation": known.squares.copy(), "protection": known.level.copy()}),
            "innovations": self._innovations[0].copy(),
            "innovation_std": self._innovations[1].copy(),
            "whitened_innovations": self._innovations[2].copy(),
            **self._places(x, P),
            **self.counts.extra,
        }
        return Estimate(t, x[:3].copy(), P[:3, :3].copy(), status, extra, message)

    def _places(self, x: Array, P: Array) -> Mapping[str, Array]:
        """Published places of the beacons: those that are found."""
        found, extra = self.bank.places_found(self._farthest) & self._confirmed, self.model.extra(x, P)
        missing = np.repeat(~found, 2)
        for values in extra.values():
            values[missing] = np.nan
            if values.ndim == 2:
                values[:, missing] = np.nan
        return extra

    def _waits_for(self) -> str:
        """Readings that are missing for a pose, in words."""
        model, mission = self.model, self.model.mission
        lacking = np.flatnonzero(~self.bank.places_found(self._farthest, alone=True)) if self.bank.begun else ()
        if mission.start is None and len(mission.beacons) - len(mission.unknown) == 1:
            return "one beacon at a known place does not say which way is ahead: a second one does, or a known start"
        if DIFFERENCE in model.errors and not model.placed[0] and not self._read[0] and self._read.any():
            return "waits for beacon 0, to which range differences are: its range or bearing, or a known beacon"
        if len(lacking):
            return f"waits until one place is left for each beacon that was not given: {', '.join(map(str, lacking))}"
        return "waits until one pose is left"

    def _status(self, t: float, P: Array) -> tuple[Status, str]:
        status = self._beacons.status(t, P)
        if status is Status.INITIALISING:
            return status, waiting(status, "beacons")
        if status is Status.LOST and (self.found or self._again or not self.model.mission.unknown):
            return status, self._beacons.message
        if not self.found:
            if self._again:
                return Status.LOST, "looks for its pose"
            if self._rival is not None:
                return Status.INITIALISING, f"another place of beacon {self._rival} explains the readings as well"
            return Status.INITIALISING, self._waits_for()
        odometry = Status.OK if self.model.mission.odometry_is_input else self._odometry.status(t)
        odometry = Status.OK if odometry is Status.INITIALISING else odometry
        if not self._fitted:
            return Status.DEGRADED, "no state fits all readings since the beginning"
        if self._contradicted:
            return Status.DEGRADED, "its readings since the beginning contradict what fits them best"
        cause = self._beacons.message or self._odometry.message
        if self._separation is not None:  # its monitor judges
            return worst(status, odometry), cause
        found = worst(status, odometry, self._monitor.status(t))
        return found, (self._monitor.message or cause) if found is not Status.OK else ""

    def separate_again(self) -> None:
        """Begin the filters beside it at its state: those that were led astray say nothing."""
        if self._separation is not None:
            self._separation.begin(*self.bank.moments())

    def mistrust(self) -> bool:
        """Explain an alarm by the odometry, where that is as likely as any beacon; False where it is not."""
        better = None if self._separation is None else self._separation.mistrusted(_LIKELY)
        if better is None:
            return False
        self.bank.settle(*better)
        return True

    def doubt(self, t: float) -> tuple[Status, str]:
        """Status at t [s] by the innovations of all beacons together and by its odometry, and why."""
        if self._separation is not None and self._separation.mistrusts:
            return worst(self._monitor.status(t), Status.DEGRADED), "finds that its odometry is worse than declared"
        return self._monitor.status(t), self._monitor.message
