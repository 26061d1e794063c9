"""Faults as wrappers: around a planner (no answer, a wrong answer, a late answer) and around a plant (gusts, jumps).

Every fault draws from a generator that is passed to it, so a run with faults is as reproducible as one without.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Planner, Plant, PlantWithActivations, Sensor
from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Array, Event, Measurement, Plan, PlanRequest, Status
from mathnavi.sim.engine.log import names_of


def _rate(rate: float, what: str) -> float:
    if not 0.0 <= rate <= 1.0:
        raise ArgumentError(f"{what} = {rate!r} is not a rate; allowed: 0 to 1")
    return rate


class FailingSolver:
    """Planner whose solver fails on a fraction ``rate`` of the requests.

    A request without a plan to fall back on is always answered: at the start, and after a breach of the tracking bound.
    This holds for the faults below too.
    """

    def __init__(self, planner: Planner, rate: float, rng: np.random.Generator) -> None:
        self.period = planner.period
        self.wrapped, self._rate, self._rng = planner, _rate(rate, "solver failure rate"), rng

    def plan(self, request: PlanRequest) -> Plan:
        plan = self.wrapped.plan(request)  # called all the same, so that messages reach it
        if request.current is not None and self._rng.random() < self._rate:
            return Plan.failure(Status.SOLVER_FAILED, "injected solver failure", solve_ms=plan.solve_ms)
        return plan


class CorruptedPlan:
    """Planner that answers a fraction ``rate`` of the requests with a plan that contains NaN."""

    def __init__(self, planner: Planner, rate: float, rng: np.random.Generator) -> None:
        self.period = planner.period
        self.wrapped, self._rate, self._rng = planner, _rate(rate, "corrupted plan rate"), rng

    def plan(self, request: PlanRequest) -> Plan:
        plan = self.wrapped.plan(request)
        if request.current is None or not plan.ok or self._rng.random() >= self._rate:
            return plan
        x = plan.x.copy()
        x[int(self._rng.integers(len(x)))] = np.nan
        return dataclasses.replace(plan, x=x)


class Delayed:
    """Planner that needs ``latency`` [s] of simulated time for a fraction ``rate`` of the requests."""

    def __init__(self, planner: Planner, latency: float, rate: float, rng: np.random.Generator) -> None:
        if not (math.isfinite(latency) and latency >= 0.0):
            raise ArgumentError(f"latency = {latency!r} s; allowed: a finite time >= 0")
        self.period = planner.period
        self.wrapped, self._latency, self._rate, self._rng = planner, latency, _rate(rate, "late plan rate"), rng

    def plan(self, request: PlanRequest) -> Plan:
        plan = self.wrapped.plan(request)
        if request.current is None or self._rng.random() >= self._rate:
            return plan
        return dataclasses.replace(plan, ready=request.t + self._latency)


class Disturbance(Protocol):
    """Disturbance that acts on a plant at every step."""

    def act(self, plant: Plant, ticks: int) -> Sequence[Event]:
        """Apply the disturbance to the next step of a number of ticks."""
        ...


class _GaussMarkov:
    """First-order Gauss-Markov process of vectors (3,), one for each vehicle: g' = -g / tau + white noise, clipped to a
    length.

    It is held over a step, and exact from step to step.
    """

    def __init__(self, what: str, unit: str, rms: float, time_constant: float, limit: float) -> None:
        if not (math.isfinite(rms) and rms >= 0.0):
            raise ArgumentError(f"{what} rms = {rms!r} {unit}; allowed: a finite value >= 0")
        if not (math.isfinite(time_constant) and time_constant > 0.0):
            raise ArgumentError(f"{what} time constant = {time_constant!r} s; allowed: a finite value > 0")
        if not limit > 0.0:
            raise ArgumentError(f"{what} limit = {limit!r} {unit}; allowed: > 0")
        self._rms, self._time_constant, self._limit = rms, time_constant, limit
        self._now: dict[str, Array] = {}
        self._over: dict[float, tuple[float, float]] = {}  # by the length of a step: what is kept, what is stirred in

    def next(self, name: str, dt: float, rng: np.random.Generator) -> Array:
        """Return the vector of one vehicle over the next step of dt [s]."""
        if dt not in self._over:
            keep = math.exp(-dt / self._time_constant)
            self._over[dt] = keep, self._rms * math.sqrt(1.0 - keep * keep)
        keep, stir = self._over[dt]
        fresh = rng.standard_normal(3)
        now: Array = keep * self._now[name] + stir * fresh if name in self._now else self._rms * fresh
        self._now[name] = now
        length = math.sqrt(float(now.dot(now)))
        return now * (self._limit / length) if length > self._limit else now


class Gusts:
    """Gusts: first-order Gauss-Markov forces on every vehicle, and moments if their strength is not zero.

    On a vehicle of unit mass a force [N] is a force per mass [m/s^2].
    """

    def __init__(
        self,
        rms: float,
        time_constant: float,
        limit: float,
        rng: np.random.Generator,
        *,
        moment_rms: float = 0.0,
        moment_limit: float = math.inf,
    ) -> None:
        """Set the strengths: rms values on each axis and limits of the vectors' lengths, [N] and [N m], world frame."""
        self._force = _GaussMarkov("gust", "N", rms, time_constant, limit)
        self._moment = _GaussMarkov("gust moment", "N m", moment_rms, time_constant, moment_limit)
        self._turns = moment_rms > 0.0
        self._rng = rng

    def act(self, plant: Plant, ticks: int) -> Sequence[Event]:
        for name in plant.names:
            force = self._force.next(name, ticks * plant.dt, self._rng)
            torque = self._moment.next(name, ticks * plant.dt, self._rng) if self._turns else None
            plant.apply_wrench(name, force, torque)
        return ()


class ConstantWrench:
    """Constant force [N] and torque [N m], both (3,) in the world frame."""

    def __init__(self, force: Sequence[float], torque: Sequence[float]) -> None:
        self._force, self._torque = np.array(force, dtype=np.float64), np.array(torque, dtype=np.float64)
        for value, what, unit in ((self._force, "force", "N"), (self._torque, "torque", "N m")):
            if value.shape != (3,) or not np.isfinite(value).all():
                raise ArgumentError(f"constant {what} = {value.tolist()} {unit}; allowed: three finite numbers")

    def act(self, plant: Plant, ticks: int) -> Sequence[Event]:
        for name in plant.names:
            plant.apply_wrench(name, self._force, self._torque)
        return ()


class PositionJumps:
    """Jumps p := p + w once every period, w uniform in a cube of half-width w_bar [m] (thesis A.7, Table A.3)."""

    def __init__(self, half_width: float, period: float, rng: np.random.Generator) -> None:
        if not (math.isfinite(half_width) and half_width >= 0.0):
            raise ArgumentError(f"position jump = {half_width!r} m; allowed: a finite value >= 0")
        self._half_width, self._period, self._rng = half_width, period, rng
        self._next = period

    def act(self, plant: Plant, ticks: int) -> Sequence[Event]:
        # In the step before, so that the planner finds the vehicle displaced.
        if plant.t < self._next - (ticks + 0.5) * plant.dt:
            return ()
        self._next += self._period
        events: list[Event] = []
        for name in plant.names:
            offset = self._rng.uniform(-self._half_width, self._half_width, 3)
            plant.displace(name, offset)
            events.append(Event(plant.t, name, "position-jump", f"by {np.round(offset, 1).tolist()} m"))
        return events


@dataclass
class Disturbed:
    """Plant with disturbances; everything else is that of the wrapped plant."""

    plant: Plant
    disturbances: Sequence[Disturbance]
    dt: float = field(init=False)

    def __post_init__(self) -> None:
        self.dt = self.plant.dt

    @property
    def t(self) -> float:
        return self.plant.t

    @property
    def names(self) -> tuple[str, ...]:
        return self.plant.names

    def state(self, name: str) -> Array:
        return self.plant.state(name)

    def state_names(self, name: str) -> tuple[str, ...]:
        return self.plant.state_names(name)

    def signal_names(self, name: str) -> SignalNames:
        return names_of(self.plant, name)

    def activation_names(self, name: str) -> tuple[str, ...]:
        return self.plant.activation_names(name) if isinstance(self.plant, PlantWithActivations) else ()

    def activations(self, name: str) -> Array:
        return self.plant.activations(name) if isinstance(self.plant, PlantWithActivations) else np.empty(0)

    def sensor_sizes(self, name: str) -> dict[str, int]:
        return self.plant.sensor_sizes(name)

    def sensors(self, name: str) -> tuple[Sensor, ...]:
        return self.plant.sensors(name)

    def sense(self, name: str) -> Sequence[Measurement]:
        return self.plant.sense(name)

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        self.plant.apply_wrench(name, force, torque)

    def displace(self, name: str, offset: Array) -> None:
        self.plant.displace(name, offset)

    def place(self, name: str, state: Array) -> None:
        self.plant.place(name, state)

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        events = [event for disturbance in self.disturbances for event in disturbance.act(self.plant, ticks)]
        return [*events, *self.plant.step(commands, ticks)]
