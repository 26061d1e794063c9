"""Reader of MuJoCo's own sensors of a model at the present instant.

A step of MuJoCo leaves in ``sensordata`` the readings at its beginning, or nothing if the model switches sensors off to
save unused computations, for example of rays. So readings that follow from the positions are computed when they are
requested, once a tick. The next step computes them again, so the simulation does not depend on it.
"""

from __future__ import annotations

import mujoco

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array

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
