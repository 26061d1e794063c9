"""The model of a flight under gusts that its Kalman filters have: position, velocity and gust of each axis.

    p' = v,   v' = u + g,   g' = -g / tau + w,   w white with intensity 2 rms^2 / tau.

A gust vector clipped to a length has a smaller variance than its rms says; the filters use the variance after clipping.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import gammainc

from mathnavi.interfaces.bounds import Positive, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.linear_noise import discretised

OF_BEACONS = ("fixes", "position_std_max")
"""fields of ``KalmanConfig`` that mean nothing without beacons"""


@configuration
class KalmanConfig:
    """Fields of the command line."""

    timeout: Positive = 1.0
    """time without a fix after which the estimate is lost [s]"""
    start_position_std: Positive | None = None
    """standard deviation of the declared start on each axis [m]; that of the stationary filter if not given"""
    start_velocity_std: Positive | None = None
    """standard deviation of the initial velocity on each axis [m/s]; that of the stationary filter if not given"""
    noise_floor: Positive = 0.1
    """least standard deviation that the filter assumes for a fix, so that R stays positive [m]"""
    gust_floor: Positive = 0.05
    """least rms of the gusts that the filter assumes [m/s^2]; without gusts its gain would fall to zero"""
    fixes: bool = False
    """whether position fixes are read in addition to beacons; only with beacons, without them fixes always are read"""
    position_std_max: Positive = 20.0
    """standard deviation of a position by beacons, in any direction, up to which it is OK, and declared at most [m]"""


@dataclass(frozen=True, eq=False)
class AxisModel:
    """Position, velocity and gust on one axis."""

    gust_rms: float  # [m/s^2]
    time_constant: float  # [s] tau
    fix_std: float  # [m]

    @staticmethod
    def from_config(config: KalmanConfig, mission: FlightMission) -> AxisModel:
        """Model for a configuration and a mission, with the floors of noise and gusts applied."""
        return AxisModel(
            max(clipped_rms(mission.gust), config.gust_floor),
            mission.gust.time_constant,
            max(mission.position_noise, config.noise_floor),
        )

    def discretised(self, h: float) -> tuple[Array, Array, Array]:
        """F (3, 3), B (3, 1) and Q (3, 3) over h [s], exact."""
        A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0 / self.time_constant]])
        intensity = np.diag([0.0, 0.0, 2.0 * self.gust_rms**2 / self.time_constant])
        F, Q = discretised(A, intensity, h)
        return F, np.array([[0.5 * h * h], [h], [0.0]]), Q


def as_stated(P: Array, config: KalmanConfig) -> Array:
    """A covariance P (3, 3) of an axis at the start, but for the standard deviations that the configuration states."""
    P = P.copy()
    for k, stated in enumerate((config.start_position_std, config.start_velocity_std)):
        if stated is not None:
            P[k, :] = P[:, k] = 0.0
            P[k, k] = stated**2
    return P


def clipped_rms(gust: DeclaredGusts) -> float:
    """Rms [m/s^2] on each axis of a gust vector with three independent normal components, clipped to the length L.

    E min(|g|^2, L^2) = 3 s^2 F_5(L^2 / s^2) + L^2 (1 - F_3(L^2 / s^2)), F_k the chi-squared distribution with k degrees
    of freedom, s the rms before clipping.
    """
    if gust.rms == 0.0:
        return 0.0
    ratio = (gust.limit / gust.rms) ** 2
    square = 3.0 * gust.rms**2 * gammainc(2.5, 0.5 * ratio) + gust.limit**2 * (1.0 - gammainc(1.5, 0.5 * ratio))
    return math.sqrt(square / 3.0)
