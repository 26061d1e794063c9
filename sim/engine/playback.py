"""Playback of a finished run as a plant, so that the loop can run another estimator over its measurements and inputs.

Truth, readings and inputs are the recorded ones at every sample, independent of the present commands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signal_names import SignalNames
from mathnavi.interfaces.signals import OPTIMISED, Array, Estimate, Event, Measurement, Plan, PlanRequest
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.sensing import every


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """Log of the run of one vehicle, at n samples."""

    t: Array  # (n,) [s]
    x: Array  # (n, nx) the truth
    u: Array  # (n, nu) held from each sample to the next
    readings: Mapping[str, Array]  # (n, m) by sensor, NaN where none was due since the last sample
    signals: SignalNames


class RecordedPlant:
    """Plant of one vehicle's finished run (``mathnavi.interfaces.protocols.Plant``)."""

    def __init__(self, name: str, run: RecordedRun, dt: float, sensors: Sequence[Sensor]) -> None:
        """Build the plant at the first sample of ``run``, with ticks of dt [s] and the readings of ``sensors``.

        Raises ValueError if the samples are not at whole ticks, a sensor's readings are not in the run or of another
        length, or some of them may not be because it is read more often than at control steps.
        """
        self.dt = dt
        self._name, self._run, self._sensors = name, run, tuple(sensors)
        self._ticks = np.rint(run.t / dt).astype(np.int64)  # of the samples
        if not np.array_equal(self._ticks * dt, run.t):
            raise ArgumentError(f"the run was sampled between physics ticks; allowed: at multiples of {dt:g} s")
        apart = int(np.diff(self._ticks).max(initial=1))
        self._every = [every(sensor, dt) for sensor in sensors]
        for sensor, ticks in zip(sensors, self._every, strict=True):
            kept = {key: values.shape[1] for key, values in run.readings.items()}
            if kept.get(sensor.name) != sensor.size:
                measured = ", ".join(f"{key} ({size})" for key, size in kept.items()) or "nothing"
                raise ArgumentError(f"it reads {sensor.name} ({sensor.size}), and the run measured {measured}")
            if 0 < ticks < apart:
                raise ArgumentError(
                    f"it reads {sensor.name} every {ticks * dt:g} s, and of what came between two samples, "
                    f"{apart * dt:g} s apart, the run has the last"
                )
        self._row = 0

    @property
    def t(self) -> float:
        return float(self._run.t[self._row])

    @property
    def names(self) -> tuple[str, ...]:
        return (self._name,)

    def state(self, name: str) -> Array:
        x: Array = self._run.x[self._row].copy()
        return x

    def state_names(self, name: str) -> tuple[str, ...]:
        return self._run.signals.states

    def signal_names(self, name: str) -> SignalNames:
        return self._run.signals

    def sensor_sizes(self, name: str) -> dict[str, int]:
        return {sensor.name: sensor.size for sensor in self._sensors}

    def sensors(self, name: str) -> tuple[Sensor, ...]:
        return self._sensors

    def sense(self, name: str) -> Sequence[Measurement]:
        """Return the readings of this sample in order of time, those of one time in the order of the sensors."""
        now = int(self._ticks[self._row])
        before = int(self._ticks[self._row - 1]) if self._row else -1
        read: list[tuple[int, Measurement]] = []
        for sensor, ticks in zip(self._sensors, self._every, strict=True):
            due = now - now % ticks if ticks else now
            value = self._run.readings[sensor.name][self._row]
            if due > before and not np.isnan(value).all():
                read.append((due, Measurement(sensor.name, due * self.dt, value.copy())))
        return [measurement for _, measurement in sorted(read, key=lambda pair: pair[0])]

    def samples(self) -> Iterator[tuple[float, Sequence[Measurement], Array]]:
        """Yield time [s], readings, and the input (nu,) held since the sample before, zero at the first one, from the
        first sample to the last; the plant is at the first one again afterwards.
        """
        held = np.zeros_like(self._run.u[0])
        for row, u in enumerate(self._run.u):
            self._row = row
            yield self.t, self.sense(self._name), held
            held = u
        self._row = 0

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        raise ArgumentError("what is over cannot be pushed; allowed: no forces")

    def displace(self, name: str, offset: Array) -> None:
        raise ArgumentError("what is over cannot be moved; allowed: no displacement")

    def place(self, name: str, state: Array) -> None:
        raise ArgumentError("what is over cannot be moved; allowed: no other state")

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        """Advance to the next sample, which must be ``ticks`` ticks ahead; ``commands`` (nu,) by name are not used."""
        ahead = int(self._ticks[self._row + 1] - self._ticks[self._row])
        if ticks != ahead:
            raise ArgumentError(
                f"the next sample is {ahead} ticks ahead; allowed: a step of that number, not of {ticks}"
            )
        self._row += 1
        return ()


class RecordedInputs:
    """Planner and tracker that return the inputs of a finished run."""

    def __init__(self, run: RecordedRun, period: float) -> None:
        """Set the ``period`` [s] from one sample to the next."""
        self.period = period
        self._run = run

    def plan(self, request: PlanRequest) -> Plan:
        """Return a plan, which the tracker needs but does not use."""
        ends, nothing = np.array([request.t_start, request.t_start + self.period]), np.empty((2, 0))
        return Plan(ends, nothing, nothing[:1], np.array([OPTIMISED], dtype=np.int64))

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        held: Array = self._run.u[int(np.searchsorted(self._run.t, t - TIME_TOLERANCE))].copy()
        return held
