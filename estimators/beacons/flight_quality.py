"""Quality of a flight among beacons: what its filter assumes, and what a mission may declare of its estimate."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_discrete_are

from mathnavi.estimators.flight_model import AxisModel, KalmanConfig, as_stated, clipped_rms
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.beacon_readings import LEAST_ANGLE
from mathnavi.models.aerial.beacons import FlightBeacons, least_information, slant_ranges
from mathnavi.models.aerial.mission import EstimateQuality, FlightMission
from mathnavi.models.sensor_faults import longest_gap

_WORST = 0.05  # share of places that are worse than the declared quality
_GRID, _HEIGHTS = 12, (0.0, 150.0, 400.0)  # points along a side of the map, and heights [m] above h_min
_I3 = np.eye(3)


def beacons_of(mission: FlightMission) -> FlightBeacons:
    """Return the beacons of a mission; MissionError without any."""
    if mission.beacons is None:
        raise MissionError("beacons = None; allowed: one beacon or more, for an estimator that reads them")
    return mission.beacons


def axis_model(config: KalmanConfig, mission: FlightMission) -> AxisModel:
    """Model of an axis, whose fixes are as exact as a range; if only bearings are read, as the place that one tells
    across its direction, of the beacon that is nearest to the start.
    """
    beacons = beacons_of(mission)
    noise = max(beacons.noise, config.noise_floor)
    if beacons.read == ("bearings",):
        nearest = float(slant_ranges(beacons.array, np.array(mission.start))[0].min())
        farthest = nearest if math.isfinite(nearest) else beacons.longest
        noise = max(max(beacons.bearing_noise, LEAST_ANGLE) * farthest, config.noise_floor)
    return AxisModel(max(clipped_rms(mission.gust), config.gust_floor), mission.gust.time_constant, noise)


def start_covariance(config: KalmanConfig, mission: FlightMission) -> Array:
    """Initial covariance (3, 3) of an axis: that of a start which is known as well as fixes would tell it that are as
    exact as a range, except where the configuration gives a deviation.
    """
    return as_stated(_stationary(axis_model(config, mission), 1.0 / beacons_of(mission).rate)[0], config)


def quality(config: KalmanConfig, mission: FlightMission) -> EstimateQuality:
    """Quality among the beacons: that of a filter with fixes that tell as much as their readings do at a bad place.

    Readings are worth fixes of variance 1 / lambda, lambda the least eigenvalue of their information; it is the one
    that a twentieth of all places are below. There a vehicle does not stay, and if it does the covariance of the
    estimate says so, and the guarantee of the flight ends. Where they are worth less than ``position_std_max``
    promises, or nothing, the estimate is not OK, so that is what is declared.
    """
    beacons, model = beacons_of(mission), axis_model(config, mission)
    interval = longest_gap(
        1.0 / beacons.rate, 1.0 - (1.0 - mission.dropout_rate) * (1.0 - beacons.dropout), config.timeout
    )
    least = float(np.quantile(least_information(beacons, mission.terrain, airspace(mission)), _WORST))
    declared = config.position_std_max**2
    std = 1.0 / math.sqrt(least) if least > 0.0 else math.inf
    low = high = min(model.fix_std, std)
    while std > high and _stationary(replace(model, fix_std=high), interval)[0][0, 0] < declared:
        low, high = high, 2.0 * high
    if std > high:
        for _ in range(30):
            middle = math.sqrt(low * high)
            below = _stationary(replace(model, fix_std=middle), interval)[0][0, 0] < declared
            low, high = (middle, high) if below else (low, middle)
        std = min(std, high)
    before, correction = _stationary(replace(model, fix_std=std), interval)
    return EstimateQuality(before, correction / interval, estimates_gust=True, age=interval)


def airspace(mission: FlightMission) -> Array:
    """Places (k, 3) [m] over the box around beacons, start and target, at and above the least clearance.

    Ends that are not known yet are not part of it.
    """
    terrain, places = mission.terrain, [*beacons_of(mission).places, mission.start, mission.target]
    known = np.array([place[:2] for place in places if place is not None and all(map(math.isfinite, place))])
    low, high = (np.clip(each, 0.0, (terrain.width, terrain.depth)) for each in (known.min(axis=0), known.max(axis=0)))
    x, y = (np.linspace(low[axis], high[axis], _GRID) for axis in (0, 1))
    east, north = (each.ravel() for each in np.meshgrid(x, y))
    ground = np.asarray(terrain.height(east, north)) + mission.clearance_min
    return np.concatenate([np.column_stack([east, north, ground + above]) for above in _HEIGHTS])


def thrice(block: Array) -> Array:
    """Matrix (9, 9) of three axes that are alike from that of one (3, 3)."""
    return np.asarray(np.kron(block, _I3), np.float64)


def _stationary(model: AxisModel, interval: float) -> tuple[Array, Array]:
    """Stationary covariance (3, 3) of an axis just before a fix, and the covariance of what a fix changes."""
    F, _, Q = model.discretised(interval)
    H, R = np.array([[1.0, 0.0, 0.0]]), np.array([[model.fix_std**2]])
    before = solve_discrete_are(F.T, H.T, Q, R)
    before = 0.5 * (before + before.T)
    correction = before @ H.T @ np.linalg.solve(H @ before @ H.T + R, H @ before)
    return before, 0.5 * (correction + correction.T)
