"""Faults and disturbances of a scenario: each is one class, its fields and what it puts around a part of the loop.

    on_planner     around the planner: solver failures, corrupted plans, late plans
    on_sensor      around a sensor: lost readings
    disturbances   around the plant: gusts, jumps

A new one is a class here and its entry: a base of ``EveryFlightFaults``, of what any flight can have, a missile's too,
or of the group of one kind of vehicle. Its fields are flags of all scenarios with that group (``--faults.FIELD``), and
``mathnavi.sim.scenarios.assembler`` puts it in its place. It draws from the random stream that it names.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mathnavi.models.aerial.dynamics import TICK
from mathnavi.models.aerial.mission import GustModel
from mathnavi.models.sensor_faults import Dropout
from mathnavi.sim.engine.faults import (
    CorruptedPlan,
    Delayed,
    Disturbance,
    Disturbed,
    FailingSolver,
    Gusts,
    PositionJumps,
)
from mathnavi.sim.interfaces.checks import check
from mathnavi.sim.interfaces.protocols import Planner, Plant, Sensor
from mathnavi.sim.scenarios.random_streams import RandomStreams

LARGEST = 1e5  # of any field in SI units: beyond it there is no such flight, and numbers begin to overflow

PLANNER_STREAMS = ("solver_failures", "corrupted_plans", "late_plans")


@dataclass(frozen=True)
class Fault:
    """Base of all faults and of their groups: by itself it leaves every part as it is.

    Raises FieldError for a field out of its range.
    """

    group: ClassVar[str] = "faults"  # the field of a scenario's configuration that holds it
    largest: ClassVar[float] = LARGEST  # of its fields in SI units
    stream: ClassVar[str]  # the random stream that it draws from; a group has none of its own

    def __post_init__(self) -> None:
        for kind in kinds(self):
            kind.check_fields(self)

    def check_fields(self) -> None:
        """Raise FieldError for a field of this fault that is out of its range."""

    def on_planner(self, planner: Planner, rng: np.random.Generator) -> Planner:
        """The planner with this fault."""
        return planner

    def on_sensor(self, sensor: Sensor, rng: np.random.Generator) -> Sensor:
        """The sensor with this fault."""
        return sensor

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        """Disturbances of vehicles of a mass [kg] that are planned for every ``period`` [s]."""
        return ()


def kinds(faults: Fault) -> Iterator[type[Fault]]:
    """The faults that a group is made of, in the order of their fields."""
    return (kind for kind in reversed(type(faults).__mro__) if issubclass(kind, Fault) and "stream" in vars(kind))


def with_planner_faults(planner: Planner, groups: Sequence[Fault], streams: RandomStreams) -> Planner:
    """A planner with the faults of these groups."""
    for faults in groups:
        for kind in kinds(faults):
            planner = kind.on_planner(faults, planner, streams[kind.stream])
    return planner


def with_sensor_faults(
    sensors: Sequence[Sensor], groups: Sequence[Fault], streams: RandomStreams
) -> tuple[Sensor, ...]:
    """Sensors with the faults of these groups; each sensor draws from a generator of its own."""
    mounted = tuple(sensors)
    for faults in groups:
        for kind in kinds(faults):
            rngs = streams[kind.stream].spawn(len(mounted))
            mounted = tuple(kind.on_sensor(faults, sensor, rng) for sensor, rng in zip(mounted, rngs, strict=True))
    return mounted


def with_disturbances(
    plant: Plant, groups: Sequence[Fault], streams: RandomStreams, *, mass: float = 1.0, period: float
) -> Plant:
    """A plant with the disturbances of these groups; itself if there are none.

    ``mass`` [kg] is that of its vehicles, ``period`` [s] that of their planners.
    """
    acting = [
        disturbance
        for faults in groups
        for kind in kinds(faults)
        for disturbance in kind.disturbances(faults, mass, period, streams[kind.stream])
    ]
    return Disturbed(plant, acting) if acting else plant


# ---- one class for each


@dataclass(frozen=True)
class SolverFailures(Fault):
    """The solver gives up."""

    stream: ClassVar[str] = "solver_failures"

    solver_failure_rate: float = 0.0
    """fraction of the requests on which the solver gives up"""

    def check_fields(self) -> None:
        check(self.solver_failure_rate, f"{self.group}.solver_failure_rate", 0.0, 1.0)

    def on_planner(self, planner: Planner, rng: np.random.Generator) -> Planner:
        return FailingSolver(planner, self.solver_failure_rate, rng) if self.solver_failure_rate > 0.0 else planner


@dataclass(frozen=True)
class CorruptedPlans(Fault):
    """Plans that contain NaN."""

    stream: ClassVar[str] = "corrupted_plans"

    corrupted_plan_rate: float = 0.0
    """fraction of the requests answered with NaN"""

    def check_fields(self) -> None:
        check(self.corrupted_plan_rate, f"{self.group}.corrupted_plan_rate", 0.0, 1.0)

    def on_planner(self, planner: Planner, rng: np.random.Generator) -> Planner:
        return CorruptedPlan(planner, self.corrupted_plan_rate, rng) if self.corrupted_plan_rate > 0.0 else planner


@dataclass(frozen=True)
class LatePlans(Fault):
    """Plans that come too late."""

    stream: ClassVar[str] = "late_plans"

    late_plan_rate: float = 0.0
    """fraction of the requests answered too late to be of use"""
    late_plan_latency: float = 2.0
    """simulated time that a late answer takes [s]"""

    def check_fields(self) -> None:
        check(self.late_plan_rate, f"{self.group}.late_plan_rate", 0.0, 1.0)
        check(self.late_plan_latency, f"{self.group}.late_plan_latency", 0.0, self.largest)

    def on_planner(self, planner: Planner, rng: np.random.Generator) -> Planner:
        if self.late_plan_rate <= 0.0:
            return planner
        return Delayed(planner, self.late_plan_latency, self.late_plan_rate, rng)


@dataclass(frozen=True)
class Jumps(Fault):
    """The vehicle is displaced at once."""

    stream: ClassVar[str] = "position_jumps"

    position_jump: float = 0.0
    """half-width w of the jump p := p + w once a planning period [m] (Table A.3); carries no guarantee"""

    def check_fields(self) -> None:
        check(self.position_jump, f"{self.group}.position_jump", 0.0, self.largest)

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        return (PositionJumps(self.position_jump, period, rng),) if self.position_jump > 0.0 else ()


@dataclass(frozen=True)
class RandomGusts(Fault):
    """First-order Gauss-Markov forces, in proportion to the mass."""

    stream: ClassVar[str] = "gusts"

    gust_rms: float = 0.0
    """force per mass on each axis [m/s^2]"""
    gust_time_constant: float = 3.0
    """of the gusts' first-order model [s]"""
    gust_limit: float = 4.0
    """longest gust [m/s^2]"""

    def check_fields(self) -> None:
        check(self.gust_rms, f"{self.group}.gust_rms", 0.0, self.largest)
        check(self.gust_time_constant, f"{self.group}.gust_time_constant", TICK, self.largest)
        check(self.gust_limit, f"{self.group}.gust_limit", 0.0, self.largest, open_low=True)

    def disturbances(self, mass: float, period: float, rng: np.random.Generator) -> Sequence[Disturbance]:
        if self.gust_rms <= 0.0:
            return ()
        return (Gusts(mass * self.gust_rms, self.gust_time_constant, mass * self.gust_limit, rng),)

    @property
    def gust_model(self) -> GustModel:
        """The gusts as a mission declares them."""
        return GustModel(self.gust_rms, self.gust_time_constant, self.gust_limit)


@dataclass(frozen=True)
class LostReadings(Fault):
    """Sensors that lose readings."""

    stream: ClassVar[str] = "dropouts"

    dropout_rate: float = 0.0
    """fraction of the sensors' readings that are lost"""

    def check_fields(self) -> None:
        check(self.dropout_rate, f"{self.group}.dropout_rate", 0.0, 1.0)

    def on_sensor(self, sensor: Sensor, rng: np.random.Generator) -> Sensor:
        return Dropout(sensor, self.dropout_rate, rng) if self.dropout_rate > 0.0 else sensor


# ---- groups of them


@dataclass(frozen=True)
class EveryFlightFaults(LatePlans, SolverFailures):
    """Faults that any flight can have, a missile's too; a new one of these is one base more."""


@dataclass(frozen=True)
class FlightFaults(LostReadings, RandomGusts, Jumps, CorruptedPlans, EveryFlightFaults):
    """Faults of aerial vehicles."""
