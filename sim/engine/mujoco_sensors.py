"""Reader of MuJoCo's own sensors of a model at the present instant.

A step of MuJoCo leaves in ``sensordata`` the readings at its beginning, or nothing if the model switches sensors off to
save unused computations, for example of rays. So readings are computed when they are requested, once a tick:

    of positions (ranges, encoders, magnetometers)            in place; the next step computes them again
    of velocities and forces (gyros, accelerometers, touch)   by a forward pass on a copy of the simulation, for it
                                                              leaves the solver of the next step another start

so that the simulation does not depend on them. Forces are those that acted over the last tick: its held controls, and
the disturbances on bodies, which the plant clears after a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from mathnavi.interfaces.checks import allowed_for
from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import StateView
from mathnavi.interfaces.signals import Array

_POSITION, _ACCELERATION = int(mujoco.mjtStage.mjSTAGE_POS), int(mujoco.mjtStage.mjSTAGE_ACC)
_NO_SENSORS = int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)  # the whole state on which a forward pass depends


@dataclass(frozen=True)
class MujocoSensor:
    """Sensor (``mathnavi.interfaces.protocols.Sensor``) that is one of MuJoCo's own with its ``noise``.

    Its readings are in the units of MuJoCo's documentation: rad/s of a gyro, N of touch.
    """

    name: str  # of its readings, and of the sensor in the model without the vehicle's name
    size: int
    rate: float | None = None  # [Hz]; None: at every control step
    noise: float = 0.0  # standard deviation of each component, in the unit of the reading

    @staticmethod
    def of(model: mujoco.MjModel, vehicle: str, name: str, rate: float | None = None) -> MujocoSensor:
        """Return the sensor ``VEHICLE/NAME`` of a model, with the size and the ``noise`` that its file states, which
        MuJoCo itself does not add.

        Raises ArgumentError if none exists.
        """
        index = _named(model, vehicle, name)
        return MujocoSensor(name, int(model.sensor_dim[index]), rate, float(model.sensor_noise[index]))

    def read(self, motion: StateView, rng: np.random.Generator) -> Array:
        """Return the present reading (size,)."""
        exact = motion.sensed(self.name)
        return exact + self.noise * rng.standard_normal(self.size) if self.noise else exact


class OwnSensors:
    """MuJoCo's sensors of a simulation."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        self._places: dict[str, tuple[slice, bool]] = {}  # places in sensordata, of positions alone; by the whole name
        self._present = self._present_copy = False
        self._needs_forces = bool((model.sensor_needstage == _ACCELERATION).any())
        self._acted: Array | None = None  # (nbody, 6) what acted on bodies over the last tick; None: what acts now

    def begin_step(self) -> None:
        """Begin a step: the forces on bodies are those in the simulation until its end."""
        self._acted = None

    def end_step(self) -> None:
        """End a step, after which the forces on bodies are cleared, and others may be set for the next one."""
        if self._needs_forces:
            self._acted = self._data.xfrc_applied.copy()

    def passed(self) -> None:
        """Invalidate the readings: something has moved since the sensors were read."""
        self._present = self._present_copy = False

    def read(self, vehicle: str, name: str) -> Array:
        """Return the present reading of the sensor ``VEHICLE/NAME``, a copy.

        Raises ValueError if none exists.
        """
        full = f"{vehicle}/{name}"
        if full not in self._places:
            self._places[full] = self._place_of(vehicle, name)
        place, of_positions = self._places[full]
        data = self._data if of_positions else self._copy
        if of_positions and not self._present:
            self._evaluate()
        elif not of_positions and not self._present_copy:
            self._evaluate_copy()
        reading: Array = data.sensordata[place].copy()
        return reading

    def _place_of(self, vehicle: str, name: str) -> tuple[slice, bool]:
        index = _named(self._model, vehicle, name)
        first = int(self._model.sensor_adr[index])
        place = slice(first, first + int(self._model.sensor_dim[index]))
        return place, int(self._model.sensor_needstage[index]) == _POSITION

    def _evaluate(self) -> None:
        model, data, flags = self._model, self._data, self._model.opt.disableflags
        for stage in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_camlight, mujoco.mj_tendon):
            stage(model, data)
        mujoco.mj_transmission(model, data)
        model.opt.disableflags = flags & ~_NO_SENSORS
        mujoco.mj_sensorPos(model, data)
        model.opt.disableflags = flags
        self._present = True

    def _evaluate_copy(self) -> None:
        model, copy, flags = self._model, self._copy, self._model.opt.disableflags
        mujoco.mj_getState(model, self._data, self._state, _STATE)
        mujoco.mj_setState(model, copy, self._state, _STATE)
        if self._acted is not None:
            copy.xfrc_applied[:] = self._acted
        model.opt.disableflags = flags & ~_NO_SENSORS
        mujoco.mj_forward(model, copy)
        model.opt.disableflags = flags
        self._present_copy = True

    @cached_property
    def _copy(self) -> mujoco.MjData:
        return mujoco.MjData(self._model)

    @cached_property
    def _state(self) -> Array:
        return np.empty(mujoco.mj_stateSize(self._model, _STATE))


def _named(model: mujoco.MjModel, vehicle: str, name: str) -> int:
    """Index of the sensor ``VEHICLE/NAME``; ArgumentError, which lists those of the vehicle, if none exists."""
    known = {model.sensor(i).name: i for i in range(model.nsensor)}
    full, begin = f"{vehicle}/{name}", f"{vehicle}/"
    if full in known:
        return known[full]
    own = [each.removeprefix(begin) for each in known if each.startswith(begin)]
    raise ArgumentError(f"the model has no sensor {full!r}; {allowed_for(name, own)}")
