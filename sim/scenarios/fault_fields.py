"""Faults and disturbances of a scenario: each is one class with its fields and its wrapper of a part of the loop.

    on_planner     around the planner: solver failures, corrupted plans, late plans
    on_sensor      around a sensor: lost readings
    disturbances   around the plant: gusts, jumps

A new fault is a class here and an entry: a base of ``CommonFlightFaults``, for faults of every flight, a missile's
included, or of the group of one kind of vehicle. Its fields are flags of all scenarios with that group
(``--faults.FIELD``), and ``mathnavi.sim.scenarios.assembler`` applies it. It names a random stream, even if it draws
nothing.

A disturbance acts; it is not declared. What tracking bounds allow for is ``FlightMission.gust`` (``flight_parts``,
``controllers.flight.tracker``, ``controllers.quadrotor.bound``); a force beyond that carries no guarantee.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from annotated_types import Ge, Interval, Le

from mathnavi.interfaces.angles import Radians
from mathnavi.interfaces.bounds import FINITE, Fraction, NonNegative, Positive, configuration
from mathnavi.interfaces.field_table import TOGETHER
from mathnavi.interfaces.protocols import Planner, Sensor
from mathnavi.models.aerial.beacons import FailingBeacons, FlightBeaconSensor
from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.aerial.mission import DeclaredGusts
from mathnavi.models.sensor_faults import Dropout
from mathnavi.sim.engine.faults import CorruptedPlan, Delayed, Disturbance, FailingSolver, Gusts, PositionJumps

LARGEST = 1e5  # of any field in SI units: no flight needs more, and numbers begin to overflow

Magnitude = Annotated[NonNegative, Le(LARGEST)]
PositiveMagnitude = Annotated[Positive, Le(LARGEST)]
Factor = Annotated[float, Interval(ge=0.1, le=10.0), FINITE]
"""factor of a quantity of the true vehicle over that of the declared one"""

PLANNER_STREAMS = ("solver_failures", "corrupted_plans", "late_plans")


@configuration(prefix="faults.")
class Fault:
    """Base of all faults and of their groups, which leaves every part unchanged."""

    stream: ClassVar[str]  # the random stream that it draws from; a group has none

    def __init_subclass__(cls, **options: Any) -> None:
        """Refuse a fault that acts without a random stream: ``kinds`` would skip it."""
        super().__init_subclass__(**options)
        acts = [name for name in ("on_planner", "on_sensor", "disturbances") if name in vars(cls)]
        if acts and "stream" not in vars(cls):
            raise TypeError(f"{cls.__qualname__} has {acts[0]}() and no stream; allowed: a ClassVar stream, its name")

    def on_planner(self, planner: Planner, rng: np.random.Generator) -> Planner:
        """Planner with this fault."""
        return planner

    def on_sensor(self, sensor: Sensor, rng: np.random.Generator) -> Sensor:
        """Sensor with this fault."""
        return sensor

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        """Disturbances of vehicles with a mass [kg] and a planning period [s]."""
        return ()


def kinds(faults: Fault) -> Iterator[type[Fault]]:
    """Faults of a group, in the order of their fields."""
    return (kind for kind in reversed(type(faults).__mro__) if issubclass(kind, Fault) and "stream" in vars(kind))


# ---- one class for each


@configuration(prefix="faults.")
class SolverFailures(Fault):
    """Failures of the solver."""

    stream: ClassVar[str] = "solver_failures"

    solver_failure_rate: Fraction = 0.0
    """fraction of the requests on which the solver fails"""

    def on_planner(self, planner: Planner, rng: np.random.Generator) -> Planner:
        return FailingSolver(planner, self.solver_failure_rate, rng) if self.solver_failure_rate > 0.0 else planner


@configuration(prefix="faults.")
class CorruptedPlans(Fault):
    """Plans that contain NaN."""

    stream: ClassVar[str] = "corrupted_plans"

    corrupted_plan_rate: Fraction = 0.0
    """fraction of the requests answered with NaN"""

    def on_planner(self, planner: Planner, rng: np.random.Generator) -> Planner:
        return CorruptedPlan(planner, self.corrupted_plan_rate, rng) if self.corrupted_plan_rate > 0.0 else planner


@configuration(prefix="faults.")
class LatePlans(Fault):
    """Plans that come too late."""

    stream: ClassVar[str] = "late_plans"

    late_plan_rate: Fraction = 0.0
    """fraction of the requests answered too late to be of use"""
    late_plan_latency: Magnitude = 2.0
    """simulated time that a late answer takes [s]"""

    def on_planner(self, planner: Planner, rng: np.random.Generator) -> Planner:
        if self.late_plan_rate <= 0.0:
            return planner
        return Delayed(planner, self.late_plan_latency, self.late_plan_rate, rng)


@configuration(prefix="faults.")
class Jumps(Fault):
    """Sudden displacements of the vehicle."""

    stream: ClassVar[str] = "position_jumps"

    position_jump: Magnitude = 0.0
    """half-width of the random jump p := p + w once a planning period [m] (Table A.3); carries no guarantee"""

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        return (PositionJumps(self.position_jump, period, rng),) if self.position_jump > 0.0 else ()


@configuration(prefix="faults.")
class RandomGusts(Fault):
    """First-order Gauss-Markov forces, in proportion to the mass."""

    stream: ClassVar[str] = "gusts"

    gust_rms: Magnitude = 0.0
    """rms of the random force per mass on each axis [m/s^2]"""
    gust_time_constant: Annotated[float, Interval(ge=TICK, le=LARGEST), FINITE] = 3.0
    """time constant of the gusts' first-order model [s]"""
    gust_limit: PositiveMagnitude = 4.0
    """largest magnitude of a gust [m/s^2]"""

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        if self.gust_rms <= 0.0:
            return ()
        return (Gusts(mass * self.gust_rms, self.gust_time_constant, mass * self.gust_limit, rng),)

    @property
    def declared_gusts(self) -> DeclaredGusts:
        """Gusts as the mission declares them."""
        return DeclaredGusts(self.gust_rms, self.gust_time_constant, self.gust_limit)


@configuration(prefix="faults.")
class LostReadings(Fault):
    """Sensors that lose readings."""

    stream: ClassVar[str] = "dropouts"

    dropout_rate: Fraction = 0.0
    """fraction of the sensors' readings that are lost"""

    def on_sensor(self, sensor: Sensor, rng: np.random.Generator) -> Sensor:
        return Dropout(sensor, self.dropout_rate, rng) if self.dropout_rate > 0.0 else sensor


@configuration(prefix="faults.")
class BeaconFaults(Fault):
    """Beacons that fail on the way; what is read of them is not declared to be wrong."""

    stream: ClassVar[str] = "beacon_faults"  # it draws nothing

    beacons: Annotated[tuple[Annotated[int, Ge(0)], ...], TOGETHER] = ()
    """numbers of the beacons that fail, from 0 on"""
    beacon_fault: Literal["stuck", "offset"] = "stuck"
    """fault of these beacons; stuck: the last reading before is read again and again; offset: the reading is off"""
    beacon_offset: Annotated[float, Interval(ge=-LARGEST, le=LARGEST), FINITE] = 5.0
    """error of the ranges and range differences of beacons that fail by an offset [m]"""
    beacon_angle: Annotated[float, Radians(-math.pi, math.pi)] = 0.1
    """error of the azimuths and elevations of beacons that fail by an offset [rad]"""
    beacons_fail_at: Magnitude = 10.0
    """time at which these beacons fail [s]"""

    def on_sensor(self, sensor: Sensor, rng: np.random.Generator) -> Sensor:
        if not (self.beacons and isinstance(sensor, FlightBeaconSensor)):
            return sensor
        offset = None if self.beacon_fault == "stuck" else self.beacon_offset
        return FailingBeacons(sensor, self.beacons, self.beacons_fail_at, offset, self.beacon_angle)


# ---- groups of them


@configuration(prefix="faults.")
class CommonFlightFaults(LatePlans, SolverFailures):
    """Faults of safe-flight, simultaneous-arrival, quadrotor-canyon and missile-guidance."""


@configuration(prefix="faults.")
class AerialFaults(LostReadings, RandomGusts, Jumps, CorruptedPlans, CommonFlightFaults):
    """Faults of safe-flight, simultaneous-arrival and quadrotor-canyon."""


@configuration(prefix="faults.")
class SafeFlightFaults(AerialFaults, BeaconFaults):
    """Faults of safe-flight."""
