"""The task of one aerial vehicle: get from a start to a target over a terrain (thesis, A.3).

A mission is what everybody may know: the bounds, the map, the declared quality of the sensors and of the estimator. It
holds no truth of a run.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from models.aerial.dynamics import CONTROL_TICKS, TICK
from models.terrain.height_field import HeightField
from models.terrain.visibility import Radar
from sim.signals import Array


@dataclass(frozen=True)
class GustModel:
    """First-order Gauss-Markov force per unit mass on each axis, its vector clipped to a length."""

    rms: float = 0.0  # [m/s^2] on each axis, before clipping
    time_constant: float = 3.0  # [s]
    limit: float = 4.0  # [m/s^2] on the Euclidean norm


@dataclass(frozen=True, eq=False)
class EstimateQuality:
    """How good a state estimate is in the stationary case, for one axis with the state (position, velocity, gust).

    With the estimate x^ = x - e the estimator declares P = cov(e) and W, the covariance per second that its corrections
    feed into x^ (for a Kalman filter L R L', the truth's own driving noise for an exact sensor). The closed loop's
    stationary covariance follows from both by one Lyapunov equation.
    """

    error: Array  # (3, 3) P, units [m, m/s, m/s^2]
    driving: Array  # (3, 3) W, the same units squared per second
    estimates_gust: bool = False  # whether an estimate carries the gust as extra["gust"], (3,) [m/s^2]

    @staticmethod
    def exact(gust: GustModel) -> EstimateQuality:
        """A sensor that reads the state without error: only the gusts drive the loop."""
        driving = np.zeros((3, 3))
        driving[2, 2] = 2.0 * gust.rms**2 / gust.time_constant
        return EstimateQuality(np.zeros((3, 3)), driving)


@dataclass(frozen=True, eq=False)
class FlightMission:
    """From ``start`` at rest to within ``arrival_radius`` of ``target`` by gamma V_0, never below ``clearance_min``."""

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
    gust: GustModel = GustModel()
    quality: EstimateQuality = field(default_factory=lambda: EstimateQuality.exact(GustModel()))
    control_period: float = CONTROL_TICKS * TICK  # [s] of estimator and tracker
    radars: tuple[Radar, ...] = ()  # known from the start; others come as messages
