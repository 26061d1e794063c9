"""Plant whose physics is an ordinary differential equation x' = f(x, u), for systems without a body.

Between two readings the state follows the solution to a stated error (``mathnavi.models.runge_kutta``); ticks only
determine when sensors may be read. A solution that leaves every bound in finite time ends its vehicle: that is an
event, "escaped", stamped with its time. The state of the last tick before it is kept; from then on nothing moves and no
sensor is read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import Array, Event, Measurement
from mathnavi.sim.engine.sensing import mounted

_ROUND_OFF = 1e-9  # [ticks]


class Law(Protocol):
    """Law of motion of a vehicle with nx states, nu inputs and ny outputs."""

    @property
    def states(self) -> tuple[str, ...]:
        """Name and unit (nx,) of each component of the state, for example "x_1 [m]"."""
        ...

    @property
    def inputs(self) -> tuple[str, ...]:
        """Name and unit (nu,) of each component of the input."""
        ...

    def reach(self, x: Array, u: Array, dt: float) -> tuple[Array, float]:
        """Return state (nx,) after dt [s] with u (nu,) held, and dt; a shorter time if the solution escapes before."""
        ...

    def rate(self, x: Array, u: Array) -> Array:
        """Return x' (nx,)."""
        ...

    def output(self, x: Array, u: Array) -> Array:
        """Return y = h(x, u) (ny,)."""
        ...


@dataclass(frozen=True)
class OdeVehicle:
    """Start, sensors and input of a vehicle whose dynamics are an ODE."""

    law: Law
    start: Array  # (nx,) the state at t = 0
    sensors: tuple[Sensor, ...] = ()


class OdeMotion:
    """State view of an ODE (``mathnavi.interfaces.protocols.StateView``)."""

    def __init__(self, law: Law) -> None:
        self._law = law
        self.state = np.zeros(len(law.states))
        self.u = np.zeros(len(law.inputs))  # held since the last step began

    @property
    def x(self) -> Array:
        """State (nx,), a copy."""
        return self.state.copy()

    @property
    def acceleration(self) -> Array:
        """Second half of x': the accelerations if x = (positions, velocities)."""
        return self._law.rate(self.state, self.u)[len(self.state) // 2 :]

    def sensed(self, name: str) -> Array:
        """Return h(x, u) (ny,) for the name "output"; ArgumentError for another name."""
        if name != "output":
            raise ArgumentError(f"an ODE has no sensor {name!r}; allowed: 'output'")
        return self._law.output(self.state, self.u)


class _Vehicle:
    """State of one vehicle while it moves."""

    def __init__(self, name: str, given: OdeVehicle, dt: float, rng: np.random.Generator) -> None:
        self.name, self.law = name, given.law
        self.motion = OdeMotion(given.law)
        self.sensors = mounted(name, given.sensors, dt, rng)
        self.readings: list[Measurement] = []  # since the last sample
        self.escaped: float | None = None  # [s]
        self.place(given.start, "start")

    def place(self, state: Array, what: str) -> None:
        x, n = np.array(state, dtype=np.float64), len(self.law.states)
        if x.shape != (n,) or not np.isfinite(x).all():
            raise ArgumentError(f"vehicle {self.name!r}: {what} = {x.tolist()}; allowed: {n} finite numbers")
        self.motion.state, self.escaped = x, None

    def command(self, t: float, command: Array | None) -> None:
        u = np.zeros(len(self.law.inputs)) if command is None else np.array(command, dtype=np.float64)
        if u.shape != self.motion.u.shape or not np.isfinite(u).all():
            allowed = f"{len(self.law.inputs)} finite numbers"
            raise ArgumentError(f"vehicle {self.name!r}: command = {u.tolist()} at {t:.3f} s; allowed: {allowed}")
        self.motion.u = u

    def advance(self, tick: int, ticks: int, dt: float) -> Event | None:
        """Advance from a tick by a number of ticks; return the event if the solution escapes on the way."""
        if self.escaped is not None:
            return None
        x, u = self.motion.state, self.motion.u
        after, reached = self.law.reach(x, u, ticks * dt)
        if reached < ticks * dt:
            whole = int(reached / dt + _ROUND_OFF)  # ticks before the escape
            self.motion.state = self.law.reach(x, u, whole * dt)[0]
            self.escaped = tick * dt + reached
            where = np.array2string(self.motion.state, precision=4)
            return Event(self.escaped, self.name, "escaped", f"leaves every bound; {where} at the tick before")
        self.motion.state = after
        return None

    def read(self, tick: int, dt: float, *, at_control_step: bool) -> None:
        """Read the sensors that are due at a tick."""
        for each in self.sensors if self.escaped is None else ():
            if each.due(tick, at_control_step):
                value = each.sensor.read(self.motion, each.rng)
                if value is not None:
                    self.readings.append(Measurement(each.sensor.name, tick * dt, value))


class OdePlant:
    """Plant of vehicles that each obey an ODE (``mathnavi.interfaces.protocols.Plant``)."""

    def __init__(self, vehicles: Mapping[str, OdeVehicle], dt: float, rng: np.random.Generator) -> None:
        """Build the plant at t = 0 with ticks of dt [s]; each sensor draws from its own stream, spawned from ``rng``.

        Raises ValueError if there is no vehicle, a start does not fit its law, or the period of a sensor is not a
        whole number of ticks.
        """
        if not vehicles:
            raise ArgumentError("a plant needs at least one vehicle")
        self.dt = dt
        self._tick = 0
        self._vehicles = {
            name: _Vehicle(name, vehicle, dt, generator)
            for (name, vehicle), generator in zip(vehicles.items(), rng.spawn(len(vehicles)), strict=True)
        }

    @property
    def t(self) -> float:
        return self._tick * self.dt

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._vehicles)

    def state(self, name: str) -> Array:
        return self._vehicle(name).motion.x

    def state_names(self, name: str) -> tuple[str, ...]:
        return self._vehicle(name).law.states

    def signal_names(self, name: str) -> SignalNames:
        law, sensors = self._vehicle(name).law, self.sensors(name)
        stated = {sensor.name: names for sensor in sensors if (names := tuple(getattr(sensor, "numbers", ())))}
        return SignalNames(law.states, law.inputs, stated)

    def sensor_sizes(self, name: str) -> dict[str, int]:
        return {sensor.name: sensor.size for sensor in self.sensors(name)}

    def sensors(self, name: str) -> tuple[Sensor, ...]:
        return tuple(each.sensor for each in self._vehicle(name).sensors)

    def escaped(self, name: str) -> float | None:
        """Return the time [s] when the vehicle left every bound; None if it has not."""
        return self._vehicle(name).escaped

    def sense(self, name: str) -> Sequence[Measurement]:
        vehicle = self._vehicle(name)
        vehicle.read(self._tick, self.dt, at_control_step=True)
        readings, vehicle.readings = vehicle.readings, []
        return readings

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        """Refuse a force (3,) [N] and torque (3,) [N m] by ArgumentError: there is no body to push."""
        raise ArgumentError(f"vehicle {name!r} is an ODE without a body; allowed: no forces on it")

    def displace(self, name: str, offset: Array) -> None:
        """Refuse an offset (3,) [m] by ArgumentError: there is no body to move; ``place`` sets the state."""
        raise ArgumentError(f"vehicle {name!r} is an ODE without a body; allowed: no displacement of it")

    def place(self, name: str, state: Array) -> None:
        self._vehicle(name).place(state, "state")

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        """Advance by a number of ticks with inputs (nu,) by name held, zero without one. The only event is "escaped".

        Raises ValueError for a command that does not fit or is not finite.
        """
        events: list[Event] = []
        for vehicle in self._vehicles.values():
            vehicle.readings.clear()
            vehicle.command(self.t, commands.get(vehicle.name))
            begin, end = self._tick, self._tick + ticks
            for tick in (*self._due(vehicle, begin, end), end):
                if (event := vehicle.advance(begin, tick - begin, self.dt)) is not None:
                    events.append(event)
                if tick < end:
                    vehicle.read(tick, self.dt, at_control_step=False)
                begin = tick
        self._tick += ticks
        return events

    def _due(self, vehicle: _Vehicle, begin: int, end: int) -> list[int]:
        """Return the ticks in between at which a sensor of the vehicle is read."""
        return [k for k in range(begin + 1, end) if any(each.due(k, at_control_step=False) for each in vehicle.sensors)]

    def _vehicle(self, name: str) -> _Vehicle:
        try:
            return self._vehicles[name]
        except KeyError:
            raise ArgumentError(f"the plant has no vehicle {name!r}; it has {list(self._vehicles)}") from None
