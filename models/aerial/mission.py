"""The task of one aerial vehicle: get from a start to a target over a terrain (thesis, A.3).

A mission is the common knowledge of all parts: the bounds, the map, the declared quality of the sensors and of the
estimator. It holds no truth of a run.

**Sensors of the aerial vehicle**: true motion to readings.

A sensor is a frozen description; ``read`` draws its noise from the generator it is given. It keeps no time: the plant
reads it ``rate`` times a second, or at every control step where ``rate`` is None.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from mathnavi.interfaces.bounds import NonNegative, configuration
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.aerial.dynamics import CONTROL_TICKS, HULL_RADIUS, TICK, flow
from mathnavi.models.aerial.knowledge import Knowledge
from mathnavi.models.sensor_faults import longest_gap, rms_gap
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar
from mathnavi.models.tolerances import TIME_TOLERANCE


@configuration(prefix="{name} sensor: ")
class FullStateSensor:
    """Position and velocity, (6,) [m, m/s], map frame: the position with a noise uniform in a cube, the velocity exact.

    Section A.7 of the thesis draws the position noise from U(-w, w) on each axis; w = sqrt(3) position_noise.
    """

    position_noise: NonNegative = 0.0  # [m] standard deviation on each axis
    rate: float | None = None  # [Hz]; None: every control step
    name: str = "full_state"
    size: int = 6

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the state (6,) [m, m/s] of ``motion``; ``rng`` draws the noise."""
        if self.position_noise == 0.0:
            return motion.x
        half_width = math.sqrt(3.0) * self.position_noise
        noise: Array = np.concatenate([rng.uniform(-half_width, half_width, 3), np.zeros(3)])
        return motion.x + noise


@configuration(prefix="{name} sensor: ")
class PositionSensor:
    """Position fixes, (3,) [m], with Gaussian noise."""

    noise: NonNegative = 0.0  # [m] standard deviation on each axis
    rate: float | None = 10.0  # [Hz]; None: every control step
    name: str = "position"
    size: int = 3

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the position (3,) [m] of ``motion``; ``rng`` draws the noise."""
        position = motion.x[:3]
        return position + self.noise * rng.standard_normal(3) if self.noise > 0.0 else position.copy()


@configuration(prefix="{name} sensor: ")
class AccelerationSensor:
    """Net acceleration over the last tick, gusts included, (3,) [m/s^2], with Gaussian noise."""

    noise: NonNegative = 0.0  # [m/s^2] standard deviation on each axis
    rate: float | None = None  # [Hz]; None: every control step
    name: str = "acceleration"
    size: int = 3

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Read the acceleration (3,) [m/s^2] of ``motion``; ``rng`` draws the noise."""
        acceleration = motion.acceleration
        return acceleration + self.noise * rng.standard_normal(3) if self.noise > 0.0 else acceleration.copy()


@dataclass(frozen=True)
class DeclaredGusts:
    """Gusts that a mission declares: a first-order Gauss-Markov force per unit mass on each axis, map frame.

    w' = -w / time_constant + white noise, with the standard deviation ``rms`` on each axis; the vector is clipped to
    the length ``limit``. Tracking bounds and estimators allow for these; the gusts that act are a disturbance.
    """

    rms: float = 0.0  # [m/s^2] on each axis, before clipping
    time_constant: float = 3.0  # [s] of the correlation
    limit: float = 4.0  # [m/s^2] on the Euclidean norm

    def held(self, period: float) -> DeclaredGusts:
        """Continuous model of gusts that are drawn again, and held, every ``period`` [s].

        Held, a gust of autocorrelation rho = exp(-h / tau) from one period to the next changes a velocity as much in
        the long run as a continuous one of the time constant (h / 2) (1 + rho) / (1 - rho), which is never less than
        tau.
        """
        ratio = 0.5 * period / self.time_constant
        return replace(self, time_constant=self.time_constant * ratio / math.tanh(ratio))


@dataclass(frozen=True, eq=False)
class EstimateQuality:
    """Quality of a state estimate in the stationary case, for one axis with the state (position, velocity, gust).

    With the estimate x^ = x - e the estimator declares P = cov(e) and W, the covariance per second that its corrections
    feed into x^ (for a Kalman filter L R L', the truth's own driving noise for an exact sensor). The closed loop's
    stationary covariance follows from both by one Lyapunov equation.
    """

    error: Array  # (3, 3) P, units [m, m/s, m/s^2]
    driving: Array  # (3, 3) W, the same units squared per second
    estimates_gust: bool = False  # whether an estimate carries the gust as extra["gust"], (3,) [m/s^2]
    age: float = 0.0  # [s]
    rms_age: float = 0.0  # [s] root of the mean square of that time
    held: float = 0.0  # [s] that an independent error of the position stays: it drives the loop, no filter is between

    def worst(self, gust: DeclaredGusts) -> tuple[float, float]:
        """Standard deviations of position [m] and velocity [m/s] at that age; a constant gust bounds every other."""
        position, velocity = math.sqrt(self.error[0, 0]), math.sqrt(self.error[1, 1])
        if self.estimates_gust:
            return position, velocity
        return math.hypot(position, 0.5 * gust.rms * self.age**2), math.hypot(velocity, gust.rms * self.age)

    @staticmethod
    def exact(gust: DeclaredGusts) -> EstimateQuality:
        """Quality of a sensor that reads the state without error: only the gusts drive the loop."""
        driving = np.zeros((3, 3))
        driving[2, 2] = 2.0 * gust.rms**2 / gust.time_constant
        return EstimateQuality(np.zeros((3, 3)), driving)


@dataclass(frozen=True, eq=False)
class FlightMission:
    """Flight from rest at ``start`` to ``arrival_radius`` of ``target`` by gamma V_0, never below ``clearance_min``."""

    state_names: ClassVar[tuple[str, ...]] = (
        *("position_x [m]", "position_y [m]", "position_z [m]"),
        *("velocity_x [m/s]", "velocity_y [m/s]", "velocity_z [m/s]"),
    )

    terrain: HeightField
    start: tuple[float, float, float]  # [m] map frame
    target: tuple[float, float, float]  # [m] map frame, p_f
    clearance_min: float = 50.0  # [m] h_min
    speed_max: float = 300.0  # [m/s] v_max
    acceleration_max: float = 40.0  # [m/s^2] a_max
    deadline_factor: float = 1.3  # gamma
    arrival_radius: float = 50.0  # [m] r_f
    position_noise: float = 0.0  # [m] standard deviation of a position reading, per axis
    position_rate: float = 10.0  # [Hz] of the position fixes
    dropout_rate: float = 0.0  # fraction of the sensors' readings that are lost
    gust: DeclaredGusts = DeclaredGusts()
    quality: EstimateQuality = field(default_factory=lambda: EstimateQuality.exact(DeclaredGusts()))
    control_period: float = CONTROL_TICKS * TICK  # [s] of estimator and tracker
    radars: tuple[Radar, ...] = ()  # known from the start; others come as messages
    cruise_level: float = -math.inf  # [m] below which no completion path flies level: of a fleet, each has its own
    reach: float = HULL_RADIUS  # [m] of the body, every way from its centre
    reach_in_terrain: bool = False  # True if the terrain was raised for the reach, so that h_min is of every part
    beacons: FlightBeacons | None = None  # whose ranges an estimator may read; None: there are none

    @property
    def knowledge(self) -> Knowledge:
        """Knowledge before the start, which messages may change."""
        return Knowledge(self.terrain, self.target, self.radars)

    # ---- interface of an estimator to the vehicle, common to all missions

    @property
    def input_size(self) -> int:
        """Number 3 of inputs: the acceleration."""
        return 3

    @property
    def start_state(self) -> Array:
        """State (6,) [m, m/s] at t = 0: at rest."""
        return np.array([*self.start, 0.0, 0.0, 0.0])

    def flow(self, x: Array, u: Array, dt: float) -> Array:
        """State (6,) after the input u (3,) [m/s^2] was held for dt [s] from x (6,) [m, m/s], in still air."""
        return flow(x, u, dt)

    def full_state_sensor(self, rate: float | None) -> FullStateSensor:
        """Sensor that reads the whole state ``rate`` times a second, or at every control step if it is None."""
        return FullStateSensor(self.position_noise, rate)

    def full_state_covariance(self, age: float) -> Array:
        """Covariance (6, 6) [m, m/s] of a reading propagated for ``age`` [s]; a constant gust bounds every other."""
        effect = self.gust.rms * np.array([0.5 * age * age, age])  # on position [m] and velocity [m/s]
        axis = np.outer(effect, effect)
        axis[0, 0] += self.position_noise**2
        covariance: Array = np.einsum("ij,kl->ikjl", axis, np.eye(3)).reshape(6, 6)
        return covariance

    def full_state_quality(self, rate: float | None, timeout: float) -> EstimateQuality:
        """Quality of full-state readings: independent position noise; only the gusts drive the loop.

        ``rate`` [Hz] and ``timeout`` [s] are those of the estimator (``full_state_sensor``).
        """
        error = np.diag([self.position_noise**2, 0.0, 0.0])
        interval = self.control_period if rate is None else 1.0 / rate
        gap = longest_gap(interval, self.dropout_rate, timeout)
        # A reading at every control step is never old when it is used.
        rms = rms_gap(interval, self.dropout_rate, timeout)
        driving = EstimateQuality.exact(self.gust).driving
        if gap <= self.control_period + TIME_TOLERANCE:
            return EstimateQuality(error, driving, held=self.control_period)
        # Each reading's error stays until the next one.
        return EstimateQuality(error, driving, age=gap, rms_age=rms, held=max(interval, rms))
