"""Augmented Monte Carlo localisation of a robot that reads ranges, with KLD sampling.

Particles (``particle_kernels``) start where the robot may be, as many as the cells that they occupy need. If readings
become less likely than before, a share max(0, 1 - w_fast / w_slow) of the particles is drawn again from anywhere;
w_slow and w_fast are averages of their likelihood over a long and a short time (Probabilistic Robotics, table 8.3). The
estimate is the mean of the heaviest cluster.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import Annotated

import numpy as np
from annotated_types import Gt, Interval
from scipy.special import ndtri

from mathnavi.estimators.integrity.guard import Guarded
from mathnavi.estimators.integrity.ranging import guarded
from mathnavi.estimators.ranging.kalman_kernels import step_within
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.particle_clusters import Cells, Clusters, clusters_of, fold
from mathnavi.estimators.ranging.particle_kernels import propagate, resample, weigh
from mathnavi.estimators.ranging.pose_filter import PoseFilterConfig, RangeEkf
from mathnavi.estimators.ranging.reader import RangeReader
from mathnavi.estimators.timeout_monitor import waiting
from mathnavi.interfaces.bounds import CountInMemory, Positive, Probability, Seed, Within, configuration
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.innovations import published
from mathnavi.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality

_KNOWN = 2.0 / 3.0  # weight of the heaviest cluster, twice that of all others, with which the pose is known
_RECOVERING = 0.25  # share of new particles above which there is resampling at any n_eff
_GATE = math.inf  # nothing is refused: the likelihood accounts for outliers


@configuration
class RangeParticleConfig:
    """Fields of the command line."""

    min_particles: CountInMemory = 500
    """least number of particles"""
    max_particles: CountInMemory = 5000
    """greatest number of particles, which is used at first if the start is unknown"""
    kld_error: Annotated[float, Within(Interval(gt=0.0, le=1.0), allowed="> 0 and <= 1")] = 0.05
    """bound epsilon of the Kullback-Leibler divergence from the posterior over the cells"""
    kld_probability: Probability = 0.99
    """probability 1 - delta with which the bound kld_error holds"""
    cell_position: Positive = 0.1
    """side of a cell in position [m]"""
    cell_heading: Annotated[float, Within(Interval(gt=1e-3, le=2.0), allowed="> 0.001 and <= 2")] = 0.1
    """side of a cell in heading [rad]"""
    recovery_slow: Positive = 10.0
    """time over which the likelihood is averaged for w_slow [s]"""
    recovery_fast: Positive = 0.5
    """time over which the likelihood is averaged for w_fast [s]"""
    outliers: Annotated[float, Within(Interval(gt=0.0, lt=1.0), allowed="> 0 and < 1")] = 0.02
    """least share epsilon of outliers that the likelihood assumes, however few are declared"""
    spread: Annotated[float, Gt(0.0)] = 0.3
    """largest standard deviation of the heaviest cluster with which the pose is known [m, rad]"""
    timeout: Positive = 0.5
    """time without a range after which the estimate is lost [s]"""
    seed: Seed = 0
    """seed of the particles"""

    def __post_init__(self) -> None:
        if self.min_particles > self.max_particles:
            raise FieldError(
                f"min_particles = {self.min_particles!r}; allowed: at most max_particles, {self.max_particles}"
            )
        if self.recovery_fast >= self.recovery_slow:
            raise FieldError(
                f"recovery_fast = {self.recovery_fast!r}; allowed: less than recovery_slow, {self.recovery_slow:g} s"
            )


class RangeParticle:
    """Estimator of the pose from ranges and odometry: augmented Monte Carlo localisation (AMCL)."""

    Config = RangeParticleConfig

    def __init__(self, config: RangeParticleConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._config, self._model, self._reader = config, RangeModel(mission), RangeReader(mission, config.timeout)
        sensors = self._model.sensors(_GATE)
        self._sensors = sensors._replace(outliers=max(sensors.outliers, config.outliers))
        self._symmetry = (mission.curve.symmetry, *mission.curve.centre)
        self._cells = Cells(config.cell_position, max(3, round(2.0 * math.pi / config.cell_heading)))
        self._kld = (config.kld_error, float(ndtri(config.kld_probability)))
        self._limits = (config.min_particles, config.max_particles)
        self._rng = np.random.default_rng(config.seed)
        self._x = self._model.particles(config.max_particles, self._rng)
        self._w = np.full(config.max_particles, 1.0 / config.max_particles)
        self._mean, _ = self._model.start()
        self._slow = self._fast = 0.0  # w_slow, w_fast
        self._averaged = 0  # likelihoods in them
        self._t = mission.begins  # [s] of the particles; None before the first call
        self._innovations = np.full((2, mission.sensors), np.nan)  # [m] of the last call, and their deviations

    @staticmethod
    def build(config: RangeParticleConfig, mission: RangingMission) -> Guarded:
        """Build the estimator of one run, with its monitor of integrity."""
        replayed = partial(RangeEkf, PoseFilterConfig(timeout=config.timeout))
        return guarded(partial(RangeParticle, config), mission, stand_in=replayed)

    @staticmethod
    def sensors(config: RangeParticleConfig, mission: RangingMission) -> tuple[Sensor, ...]:
        """Sensors that the robot has to carry for this estimator."""
        return mission.sensors_carried()

    @staticmethod
    def quality(config: RangeParticleConfig, mission: RangingMission) -> RangeQuality:
        """Declared quality of the ranges."""
        return mission.ranging

    @staticmethod
    def properties(config: RangeParticleConfig) -> ObserverProperties:
        """Properties of the observer (Table 2.1)."""
        return ObserverProperties(
            domain_of_attraction=Domain.NONE,
            rate=Rate.NONE,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.GLOBAL,
            system_domain=Domain.GLOBAL,
            stays_on_truth=False,
            note="its particles are random: a small error remains",
        )

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]; ``command`` (2,) replaces missing odometry.

        ``extra`` has ``effective`` (1,), n_eff, ``particles`` (1,), their number, and ``weight`` (1,), that of the
        heaviest cluster; ``innovations`` (l,) [m] and ``innovation_std`` (l,) [m] are those of the rays by all
        particles before they are weighed (``interfaces.innovations``). It also counts the readings that were not used,
        by ray.
        """
        self._innovations[:] = np.nan
        model = self._model
        rho, u = self._reader.read(t, measurements, command)
        self._reader.note(t)
        dt = 0.0 if self._t is None else t - self._t
        if dt > 0.0:
            propagate(self._x, u, np.sqrt(model.W), model.scale, model.wall, dt, self._rng)
        self._t = t
        effective = 1.0 / float(np.square(self._w).sum())
        if self._reader.rays:
            effective, likelihood = weigh(self._x, self._w, rho, model.wall, self._sensors, self._innovations)
            self._average(likelihood, dt)
        if self._symmetry[0] > 1:
            fold(self._x, self._mean[2], *self._symmetry)
        clusters = clusters_of(self._x, self._w, self._cells)
        estimate = self._estimate(t, clusters, effective)
        random = max(0.0, 1.0 - self._fast / self._slow) if self._slow > 0.0 else 0.0
        if effective < 0.5 * len(self._w) or random > _RECOVERING:
            self._x = resample(
                self._x, self._w, clusters, random, self._limits, self._kld, self._cells, model.scale, model.wall,
                self._rng,
            )  # fmt: skip
            self._w = np.full(len(self._x), 1.0 / len(self._x))
        return estimate

    def _average(self, likelihood: float, dt: float) -> None:
        """Average a likelihood into w_slow and w_fast, as a plain mean until the averaging time has passed."""
        self._averaged += 1
        least = 1.0 / self._averaged
        self._slow += max(least, min(1.0, dt / self._config.recovery_slow)) * (likelihood - self._slow)
        self._fast += max(least, min(1.0, dt / self._config.recovery_fast)) * (likelihood - self._fast)

    def _estimate(self, t: float, clusters: Clusters, effective: float) -> Estimate:
        best = int(np.argmax(clusters.weight))
        centre, offset = self._x[clusters.origin[best]], clusters.offset[best].copy()
        offset[:2] *= step_within(self._model.wall, *centre[:2], *offset[:2])  # of a wall that is not convex
        self._mean = centre + offset
        self._mean[2] = math.remainder(self._mean[2], 2.0 * math.pi)
        P = clusters.covariance[best, :3, :3].copy()
        weight = float(clusters.weight[best])
        is_known = weight >= _KNOWN and np.diag(P).max() < self._config.spread**2
        status = self._reader.status(t, P) if is_known else Status.INITIALISING
        figures = {"effective": effective, "particles": float(len(self._w)), "weight": weight}
        extra = {name: np.array([value]) for name, value in figures.items()} | published(self._innovations)
        extra |= self._reader.counts.extra
        wanted = "ranges" if is_known else f"more ranges: the heaviest cluster holds {weight:.2f} of the weight"
        return Estimate(t, self._mean[:3].copy(), P, status, extra, waiting(status, wanted) or self._reader.message)
