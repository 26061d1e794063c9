"""Replay of a finished run in its MuJoCo model, with the poses of the bodies sample by sample.

A vehicle that is a point has a body ``NAME/airframe`` in the model, which physics does not move; it is placed at the
point, and tilted as the input requires.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signals import Array
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.plant import MujocoPlant


class RecordedMotion:
    """Plant of a run, with the logged motion of its vehicles."""

    def __init__(self, plant: Plant, t: Array, states: Mapping[str, Array], inputs: Mapping[str, Array]) -> None:
        """Set ``t`` (n,) [s], and for each vehicle of the plant its true states (n, nx) and its inputs (n, nu).

        Raises ArgumentError for a plant without bodies in MuJoCo, and for states that are not those of its vehicles.
        """
        body = plant.plant if isinstance(plant, Disturbed) else plant
        if not isinstance(body, MujocoPlant):
            raise ArgumentError("it has no body in MuJoCo, its states are numbers alone; allowed: runs of bodies")
        if set(states) != set(body.names):
            raise ArgumentError(f"it logged {', '.join(states)}; allowed: {', '.join(body.names)}")
        for name, x in states.items():
            size = len(body.state_names(name))
            if x.shape != (len(t), size):
                raise ArgumentError(f"truth.x of {name} is {x.shape}; allowed: {(len(t), size)}")
        self.plant, self.t, self.states, self.inputs = body, t, states, inputs
        bodies = {body.model.body(b).name: b for b in range(body.model.nbody)}
        self._airframes = {name: bodies[f"{name}/airframe"] for name in states if f"{name}/airframe" in bodies}

    @property
    def duration(self) -> float:
        """Duration [s] of the run."""
        return float(self.t[-1])

    def show(self, t: float) -> None:
        """Set the pose of every vehicle at the last sample at or before ``t`` [s]."""
        self.show_sample(max(int(np.searchsorted(self.t, t + TIME_TOLERANCE, side="right")) - 1, 0))

    def show_sample(self, row: int) -> None:
        """Set the pose of every vehicle at a sample."""
        for name in self.states:
            self._place(name, row)

    def body(self, name: str) -> int:
        """Return body that shows the position of a vehicle: its airframe, or the body that its first joint moves."""
        if name in self._airframes:
            return self._airframes[name]
        model = self.plant.model
        first = next(j for j in range(model.njnt) if model.joint(j).name.startswith(f"{name}/"))
        return int(model.jnt_bodyid[first])

    def path(self, name: str, count: int) -> Array:
        """Return the path (k, 3) [m] of that body, at most ``count`` samples, evenly spread."""
        rows = np.unique(np.linspace(0, len(self.t) - 1, min(count, len(self.t))).astype(np.int64))
        at, points = self.body(name), []
        for row in rows:
            self._place(name, int(row))
            points.append(self.plant.data.xpos[at].copy())
        return np.array(points)

    def place(self, name: str, x: Array) -> Array:
        """Return the position (3,) [m] of the body of a vehicle in a state (nx,), without the effect of its input."""
        self._put(name, x, np.zeros(self.inputs[name].shape[1]))
        found: Array = self.plant.data.xpos[self.body(name)].copy()
        return found

    def _place(self, name: str, row: int) -> None:
        self._put(name, self.states[name][row], self.inputs[name][row])

    def _put(self, name: str, x: Array, u: Array) -> None:
        model, data = self.plant.model, self.plant.data
        if name in self._airframes:
            k = int(model.body_mocapid[self._airframes[name]])
            data.mocap_pos[k], data.mocap_quat[k] = airframe_pose(x[:3], x[3:], u)
        self.plant.place(name, x)
