"""A particle filter for a robot that reads ranges, resampled by filterpy.

Sampling importance resampling (``particle_kernels``): propagation and weights are compiled, and when N_eff falls below
N / 2 filterpy's systematic resampling draws the particles anew, which are then roughened. Where the start is unknown
the particles are uniform over all that is within the wall. The estimate is the mean of the particles around the place
where there are most.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.ranging.model import RangeModel, chi_square_gate
from mathnavi.estimators.ranging.particle_kernels import mode, propagate, roughen, weigh
from mathnavi.estimators.timeout_monitor import TimeoutMonitor
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality
from mathnavi.sim.interfaces.bounds import CountInMemory, Positive, Probability, Seed, configuration
from mathnavi.sim.interfaces.observer_properties import Domain, InputDependence, ObserverProperties, Rate
from mathnavi.sim.interfaces.protocols import Sensor
from mathnavi.sim.interfaces.signals import Array, Estimate, Integers, Measurement

_RADIUS = 0.4  # [m, rad] of the particles that count as one place
_STARTS = 16  # places that are looked at


@configuration
class RangeParticleConfig:
    """Fields of the command line."""

    particles: CountInMemory = 1000
    """N"""
    roughening: Positive = 0.1
    """kappa: standard deviation of what is added after resampling, over the particles' extent and N^(-1/4)"""
    gate: Probability = 1e-4
    """probability of a good range beyond which no range is thought less likely"""
    timeout: Positive = 0.5
    """without a range after which the estimate is lost [s]"""
    seed: Seed = 0
    """of the particles"""


class RangeParticle:
    """Estimator of the pose from ranges and odometry: particles."""

    Config = RangeParticleConfig

    def __init__(self, config: RangeParticleConfig, mission: RangingMission) -> None:
        self.period = mission.period
        self._model, self._timeout_monitor = RangeModel(mission), TimeoutMonitor(config.timeout)
        self._sensors = self._model.sensors(chi_square_gate(config.gate))
        self._rng, self._roughening = np.random.default_rng(config.seed), config.roughening
        self._x = self._model.particles(config.particles, self._rng)
        self._w = np.full(config.particles, 1.0 / config.particles)
        self._mean, _ = self._model.start()
        self._t: float | None = None  # [s] of the particles; None before the first call

    @staticmethod
    def build(config: RangeParticleConfig, mission: RangingMission) -> RangeParticle:
        """Build the estimator of one run."""
        return RangeParticle(config, mission)

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
        """Table 2.1."""
        return ObserverProperties(
            domain_of_attraction=Domain.NONE,
            rate=Rate.NONE,
            input_dependence=InputDependence.NON_UNIFORM,
            observer_domain=Domain.GLOBAL,
            system_domain=Domain.GLOBAL,
            stays_on_truth=False,
            note="roughening keeps it from the truth: it comes near, and no nearer",
        )

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate (3,) [m, m, rad] at t [s]; ``command`` (2,) stands in where odometry says nothing.

        ``extra["effective"]`` (1,) is N_eff.
        """
        model, rho = self._model, self._model.ranges(measurements)
        self._timeout_monitor.note(t, not np.isnan(rho).all())
        if self._t is not None and t > self._t:
            u = model.input(measurements, command)
            propagate(self._x, u, np.sqrt(model.W), model.wall, t - self._t, self._rng)
        self._t = t
        if not np.isnan(rho).all():
            self._condition(rho)
        self._mean, P = mode(self._x, self._w, self._mean, _RADIUS, _STARTS, model.wall)
        effective = np.array([1.0 / np.square(self._w).sum()])
        return Estimate(
            t, self._mean[:3].copy(), 0.5 * (P + P.T), self._timeout_monitor.status(t), {"effective": effective}
        )

    def _condition(self, rho: Array) -> None:
        model = self._model
        effective = weigh(self._x, self._w, rho, model.wall, self._sensors)
        if effective < 0.5 * len(self._w):
            self._x = self._x[_systematic(self._w, self._rng)]
            self._w[:] = 1.0 / len(self._w)
            roughen(self._x, self._roughening, model.wall, self._rng)


def _systematic(w: Array, rng: np.random.Generator) -> Integers:
    """filterpy's indices (N,) for weights (N,).

    It draws from numpy's global generator, which is therefore seeded for it and then put back, and reads beyond the
    last weight where round-off leaves their sum below one.
    """
    from filterpy.monte_carlo import systematic_resample  # takes .7 s to import

    whole = w / w.sum()
    whole[-1] += 1e-9
    state = np.random.get_state()
    np.random.seed(int(rng.integers(2**32)))
    try:
        chosen: Integers = systematic_resample(whole).astype(np.int64)
    finally:
        np.random.set_state(state)
    return chosen
