"""Flights of a point mass under gusts among beacons, and what the Kalman filter says of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.flight_model import KalmanConfig
from mathnavi.estimators.kalman import Kalman
from mathnavi.estimators.stagewise.verdict import Sample
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status
from mathnavi.models.aerial.beacons import FailingBeacons, FlightBeacons
from mathnavi.models.aerial.dynamics import flow
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.beacon_names import BeaconKind
from mathnavi.models.terrain.height_field import HeightField

FOUR = ((0.0, 0.0, 50.0), (6000.0, 0.0, 900.0), (0.0, 6000.0, 300.0), (6000.0, 6000.0, 10.0))
SIX = (*FOUR, (3000.0, 3000.0, 1200.0), (3000.0, 500.0, 0.0))
FLAT = tuple((x, y, 100.0) for x, y, _ in FOUR)
PERIOD, EVERY = 1.0 / 30.0, 3  # [s] of the estimator, and periods between readings
THREE_SIGMA = 14.16  # e' P^-1 e of a position that is off by as much as one in 370 is


@dataclass(frozen=True, eq=False)
class Flown:
    """What was estimated of a flight, at each of its times."""

    t: Array
    ok: NDArray[np.bool_]
    nees: Array  # e' P^-1 e of the position
    error: Array  # (n, 3) [m]
    left_out: Array  # (n, l)
    messages: list[str]
    ratio: Array  # (n, m) innovations over their deviations
    estimates: list[Estimate]
    mission: FlightMission
    samples: list[Sample]

    @property
    def sure_and_wrong(self) -> float:
        """Share of the time that it is OK and off by more than three sigma, in spells longer than a second."""
        wrong = np.concatenate([[False], self.ok & (self.nees > THREE_SIGMA), [False]])
        begins, ends = (np.flatnonzero(np.diff(wrong.astype(int)) == sign) for sign in (1, -1))
        spells = ends - begins
        return float(spells[spells * PERIOD > 1.0].sum()) / len(self.t)


def mission_of(beacons: FlightBeacons, start: tuple[float, float, float]) -> FlightMission:
    """A flight over a plain, with gusts of 1 m/s^2."""
    return FlightMission(
        HeightField(np.zeros((3, 3)), 3000.0), start, (5000.0, 5000.0, 500.0), gust=DeclaredGusts(1.0),
        beacons=beacons, position_noise=2.0, control_period=PERIOD,
    )  # fmt: skip


def flight(
    places: tuple[tuple[float, float, float], ...],
    seed: int,
    duration: float = 40.0,
    *,
    failing: tuple[int, float | None] | None = None,
    height: float = 400.0,
    swing: float = 60.0,
    sinks: float = 0.0,
    gap: tuple[float, float] = (0.0, 0.0),
    config: KalmanConfig | None = None,
    read: tuple[BeaconKind, ...] = ("ranges",),
    angle: float = 0.02,
    unknown: tuple[int, ...] = (),
    straight: bool = False,
    fixes_end: float = math.inf,
    fails_at: float = 15.0,
    bearing_noise: float = 0.002,
) -> Flown:
    """A flight about its start, ``swing`` [m] up and down; ``sinks`` [m/s] besides that.

    ``failing`` is the number of a beacon that ``fails_at`` [s], and its offset [m], None: stuck, with an ``angle``
    [rad] of bearings; in the ``gap`` [s] there are no readings, and from ``fixes_end`` [s] on no fixes. The estimator
    is not given the places of the beacons ``unknown``. A flight that is ``straight`` goes 30 m/s east.
    """
    rng = np.random.default_rng(seed)
    start = (*rng.uniform(1500.0, 4500.0, 2).tolist(), height + 50.0 * rng.uniform(-1.0, 1.0))
    beacons = FlightBeacons(places, read=read, bearing_noise=bearing_noise)
    told = replace(beacons, places=tuple(None if i in unknown else place for i, place in enumerate(places)))
    mission, config = mission_of(told, start), config or KalmanConfig()
    estimator = Kalman.build(config, mission)
    read_by = beacons.sensors(mission.terrain)
    sensors: Sequence[Sensor] = read_by
    if failing is not None:
        sensors = [FailingBeacons(each, failing[:1], fails_at, failing[1], angle) for each in read_by]
    gust, keep = mission.gust, math.exp(-PERIOD / mission.gust.time_constant)
    x, g, u = mission.start_state, np.zeros(3), np.zeros(3)
    phases = rng.uniform(0.0, 2.0 * math.pi, 3)
    rows, messages, estimates, samples = [], [], [], []
    for k in range(round(duration / PERIOD)):
        t, readings = k * PERIOD, []
        if k % EVERY == 0:
            values = {each.name: each.read(View(x), rng) for each in sensors}
            fix = x[:3] + mission.position_noise * rng.standard_normal(3)
            if not gap[0] <= t < gap[1]:
                readings = [Measurement(name, t, value) for name, value in values.items() if value is not None]
                readings += [Measurement("position", t, fix)] if config.fixes and t < fixes_end else []
        samples.append((t, readings, u))
        estimate = estimator.update(t, readings, u)
        assert estimate.covariance is not None
        e, P = estimate.x[:3] - x[:3], estimate.covariance[:3, :3]
        ratio = estimate.extra["innovations"] / estimate.extra["innovation_std"]
        out = estimate.extra["left_out"]
        rows.append([t, estimate.status is Status.OK, e @ np.linalg.solve(P, e), *e, *out, *ratio])
        messages.append(estimate.message)
        estimates.append(estimate)
        swings = np.array([900.0, 900.0, swing])
        rates = np.array([0.05, 0.04, 0.08])
        aim = mission.start + swings * (np.sin(rates * t + phases) - np.sin(phases)) - [0.0, 0.0, sinks * t]
        aim = mission.start + np.array([30.0 * t, 0.0, 0.0]) if straight else aim
        u = np.clip(0.3 * (aim - x[:3]) - x[3:], -20.0, 20.0)
        x = flow(x, u + g * min(1.0, gust.limit / max(float(np.linalg.norm(g)), 1e-9)), PERIOD)
        g = keep * g + gust.rms * math.sqrt(1.0 - keep**2) * rng.standard_normal(3)
    table = np.array(rows)
    n = len(table[0]) - estimate.extra["innovations"].size
    return Flown(
        table[:, 0],
        table[:, 1].astype(bool),
        table[:, 2],
        table[:, 3:6],
        table[:, 6:n],
        messages,
        table[:, n:],
        estimates,
        mission,
        samples,
    )


class View:
    """A motion with a state."""

    def __init__(self, x: Array) -> None:
        self.x, self.acceleration = x, np.zeros(3)

    def sensed(self, name: str) -> Array:
        raise AssertionError(name)
