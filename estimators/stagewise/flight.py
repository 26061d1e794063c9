"""The point mass under gusts as a ``StagewiseModel``: the state (p, v, g) on three axes, fixes of the position.

The model of ``mathnavi.estimators.kalman``: linear, and discretised exactly; among beacons with what is read of them
instead of fixes, or beside them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mathnavi.estimators.beacons.flight_quality import axis_model, start_covariance
from mathnavi.estimators.flight_model import AxisModel, KalmanConfig, clipped_rms
from mathnavi.estimators.kalman import first_covariance
from mathnavi.estimators.stagewise.model import Piece, refused
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.reading_counts import Unused
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.aerial.beacon_readings import LEAST_ANGLE, BeaconRows
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.aerial.mission import FlightMission

_EYE = np.eye(3)


class FlightModel:
    """Model of position, velocity and gust (9,), [m, m/s, m/s^2] on each axis."""

    size, rows = 9, 3

    def __init__(self, mission: FlightMission, axis: AxisModel, P: Array) -> None:
        """``P`` (3, 3) is the covariance of (p, v, g) on one axis at the start."""
        self._mission, self._axis, self._P = mission, axis, P
        self._discrete: dict[float, tuple[Array, Array, Array]] = {}
        self._is_known = True  # False while the next reading is where it begins

    @staticmethod
    def from_config(config: KalmanConfig, mission: FlightMission) -> FlightModel:
        """Model of the estimator ``kalman`` with its configuration."""
        if mission.beacons is not None:
            if mission.beacons.unknown:
                raise MissionError(
                    f"beacons {mission.beacons.unknown!r} at unknown places with a smoother; allowed: places that are "
                    "known, such as those that the filter has found"
                )
            return FlightBeaconModel(config, mission, mission.beacons)
        return FlightModel(mission, AxisModel.from_config(config, mission), first_covariance(config, mission))

    @staticmethod
    def as_declared(mission: FlightMission) -> FlightModel:
        """Model with the noise that the mission declares and no other; the start is exact."""
        rms = clipped_rms(mission.gust)
        axis = AxisModel(rms, mission.gust.time_constant, mission.position_noise)
        return FlightModel(mission, axis, np.diag([0.0, 0.0, rms**2]))

    def start(self, reading: Array | None) -> tuple[Array, Array] | None:
        if self._is_known:
            P: Array = np.asarray(np.kron(self._P, _EYE), np.float64)
            return np.concatenate([self._mission.start, np.zeros(6)]), P
        if reading is None:
            return None
        self._is_known = True
        deviations = (self._axis.fix_std, self._mission.speed_max, self._axis.gust_rms)
        return np.concatenate([reading, np.zeros(6)]), np.diag(np.square(np.repeat(deviations, 3)))

    def inputs(self, begin: float, end: float, measurements: Sequence[Measurement], command: Array) -> Sequence[Piece]:
        return ((end - begin, command.copy()),)

    def reading(self, measurement: Measurement) -> Array | None:
        return measurement.value.copy() if measurement.name == "position" else None

    def unused(self, measurement: Measurement) -> Unused | None:
        return refused(measurement, "position")

    def restart(self) -> bool:
        self._is_known = False
        return True

    def transition(self, x: Array, u: Array, h: float) -> tuple[Array, Array, Array]:
        key = round(h, 10)
        if key not in self._discrete:
            F, B, Q = self._axis.discretised(h)
            F, B, Q = (np.asarray(np.kron(block, _EYE), np.float64) for block in (F, B, Q))
            self._discrete[key] = F, B, Q
        F, B, Q = self._discrete[key]
        return F @ x + B @ u, F, Q

    def residual(self, x: Array, y: Array) -> tuple[Array, Array]:
        W = np.eye(3, 9) / self._axis.fix_std
        return (y - x[:3]) / self._axis.fix_std, W

    def noise(self, x: Array, y: Array) -> Array:
        return np.full(3, self._axis.fix_std)

    def sum(self, x: Array, e: Array) -> Array:
        return x + e

    def difference(self, other: Array, x: Array) -> Array:
        return other - x

    def limits(self, x: Array) -> tuple[Array, Array]:
        """Limits of the error: the gust on each axis is within the declared length of its vector."""
        high = np.full(9, np.inf)
        high[6:] = max(self._mission.gust.limit, 3.0 * self._axis.gust_rms)
        return -high - x, high - x

    def extra(self, x: Array, P: Array) -> Mapping[str, Array]:
        return {"gust": x[6:].copy()}

    def reported(self, x: Array, P: Array) -> tuple[Array, Array]:
        return x[:6].copy(), P[:6, :6].copy()


class FlightBeaconModel(FlightModel):
    """Model with the numbers (m,) that are read of beacons, in the order of ``BeaconRows``, and behind them a fix (3,)
    [m] where the configuration asks for it.
    """

    def __init__(self, config: KalmanConfig, mission: FlightMission, beacons: FlightBeacons) -> None:
        super().__init__(mission, axis_model(config, mission), start_covariance(config, mission))
        self._read = BeaconRows(beacons, config.noise_floor, LEAST_ANGLE)
        self._places = dict(self._read.slices)
        self.rows = self._read.size
        self._fix_std = max(mission.position_noise, config.noise_floor)
        if config.fixes:
            self._places["position"] = slice(self.rows, self.rows + 3)
            self.rows += 3

    def reading(self, measurement: Measurement) -> Array | None:
        if self.unused(measurement) is not None:
            return None
        y = np.full(self.rows, np.nan)
        y[self._places[measurement.name]] = measurement.value
        return y

    def unused(self, measurement: Measurement) -> Unused | None:
        own = self._places.get(measurement.name)
        if own is None:
            return Unused.UNKNOWN_SENSOR
        if measurement.value.shape != (own.stop - own.start,):
            return Unused.MALFORMED
        return Unused.NOT_FINITE if np.isinf(measurement.value).any() else None

    def residual(self, x: Array, y: Array) -> tuple[Array, Array]:
        r, W, m = np.full(self.rows, np.nan), np.full((self.rows, 9), np.nan), self._read.size
        read, fixed = np.flatnonzero(np.isfinite(y[:m])), m + np.flatnonzero(np.isfinite(y[m:]))
        W[np.append(read, fixed)] = 0.0
        if len(read):
            h, H = self._read.linear(x[:3], read.tolist())
            r[read] = self._read.whitened(self._read.innovations(y[read], h, read), read)
            W[read, :3] = self._read.whitened(H, read)
        r[fixed], W[fixed, :3] = (y[fixed] - x[fixed - m]) / self._fix_std, _EYE[fixed - m] / self._fix_std
        return r, W
