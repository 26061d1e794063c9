"""Sensors that a vehicle carries, with the data that a plant needs to read each when it is due.

Reader of MuJoCo's own sensors of a model at the present instant.

A step of MuJoCo leaves in ``sensordata`` the readings at its beginning, or nothing if the model switches sensors off to
save unused computations, for example of rays. So readings that follow from the positions are computed when they are
requested, once a tick. The next step computes them again, so the simulation does not depend on it.

Saturation of the input of a vehicle to its bounds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Sensor
from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.loop import whole_ticks


@dataclass(frozen=True)
class Mounted:
    """Sensor mounted on a vehicle."""

    sensor: Sensor
    every: int  # ticks from one reading to the next; 0: at every control step
    rng: np.random.Generator  # of its own

    def due(self, tick: int, at_control_step: bool) -> bool:
        """Return True if it is read at a tick, which may be that of a control step."""
        return tick % self.every == 0 if self.every else at_control_step


def mounted(vehicle: str, sensors: Sequence[Sensor], dt: float, rng: np.random.Generator) -> list[Mounted]:
    """Mount the sensors of a vehicle in a plant with ticks of dt [s], each with its own stream, spawned from ``rng``.

    Raises ArgumentError if two have one name, or the period of one is not a whole number of ticks.
    """
    if len({sensor.name for sensor in sensors}) != len(sensors):
        raise ArgumentError(f"vehicle {vehicle!r} carries two sensors of one name: {[s.name for s in sensors]}")
    generators = rng.spawn(len(sensors))
    return [
        Mounted(sensor, every(sensor, dt), generator) for sensor, generator in zip(sensors, generators, strict=True)
    ]


def every(sensor: Sensor, dt: float) -> int:
    """Return the ticks of dt [s] from one reading to the next, 0 for a sensor without a rate; ValueError for a
    fraction.
    """
    if sensor.rate is None:
        return 0
    if not (math.isfinite(sensor.rate) and sensor.rate > 0.0):
        raise ArgumentError(f"sensor {sensor.name!r}: rate = {sensor.rate!r} Hz; allowed: a finite rate > 0")
    return whole_ticks(1.0 / sensor.rate, dt, f"the period of sensor {sensor.name!r} at {sensor.rate!r} Hz")


_POSITION = int(mujoco.mjtStage.mjSTAGE_POS)
_NO_SENSORS = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)


class OwnSensors:
    """MuJoCo's sensors of a simulation."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        self._places: dict[str, slice] = {}  # places in sensordata, by the whole name
        self._present = False

    def passed(self) -> None:
        """Invalidate the readings: something has moved since the sensors were read."""
        self._present = False

    def read(self, vehicle: str, name: str) -> Array:
        """Return the present reading of the sensor ``VEHICLE/NAME``, a copy.

        Raises ValueError if there is none, or none that follows from the positions alone.
        """
        full = f"{vehicle}/{name}"
        if full not in self._places:
            self._places[full] = self._place_of(vehicle, full)
        if not self._present:
            self._evaluate()
        reading: Array = self._data.sensordata[self._places[full]].copy()
        return reading

    def _place_of(self, vehicle: str, full: str) -> slice:
        model = self._model
        known = {model.sensor(i).name: i for i in range(model.nsensor)}
        own = [name for name in known if name.startswith(f"{vehicle}/")]
        usable = [name for name in own if int(model.sensor_needstage[known[name]]) == _POSITION]
        if full not in usable:
            raise ArgumentError(f"the model has no sensor {full!r} that follows from positions; allowed: {usable}")
        first = int(model.sensor_adr[known[full]])
        return slice(first, first + int(model.sensor_dim[known[full]]))

    def _evaluate(self) -> None:
        model, data, flags = self._model, self._data, self._model.opt.disableflags
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_tendon):
            stage(model, data)
        mujoco.mj_transmission(model, data)
        model.opt.disableflags = flags & ~_NO_SENSORS
        mujoco.mj_sensorPos(model, data)
        model.opt.disableflags = flags
        self._present = True


ROUND_OFF = 1e-9  # relative excess of an input that is not worth an event


def input_bound(name: str, input_max: float | Array, size: int) -> Callable[[Array], tuple[Array, str]]:
    """Return a function of an input (nu,) to the saturated input (nu,) and a message; "" if nothing was saturated."""
    limits = np.asarray(input_max, dtype=np.float64)
    if limits.shape not in ((), (size,)) or not (limits > 0.0).all():
        raise ArgumentError(f"vehicle {name!r}: input_max = {input_max!r}; allowed: one number > 0, or {size} of them")

    def length_bounded(command: Array) -> tuple[Array, str]:
        length, longest = math.sqrt(command.dot(command)), float(limits)
        if length <= longest:
            return command, ""
        clipped = length > longest * (1.0 + ROUND_OFF)
        message = f"an input of length {length:.6g} was shortened to {longest:.6g}" if clipped else ""
        return command * (longest / length), message

    def each_bounded(command: Array) -> tuple[Array, str]:
        excess = np.abs(command) > limits * (1.0 + ROUND_OFF)
        message = f"the input {np.round(command, 6).tolist()} is beyond {limits.tolist()}" if excess.any() else ""
        return np.clip(command, -limits, limits), message

    return each_bounded if limits.shape else length_bounded
