"""A finished run put back into the MuJoCo model that it was run in: the bodies where they were, sample by sample.

A vehicle that is a point has a body ``NAME/airframe`` in the model, which physics does not move; it is put where the
point is, and tilted as the input asks for.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.faults import Disturbed
from mathnavi.sim.engine.plant import MujocoPlant
from mathnavi.sim.interfaces.errors import ArgumentError
from mathnavi.sim.interfaces.protocols import Plant
from mathnavi.sim.interfaces.signals import Array


class RecordedMotion:
    """The plant of a run, and what was logged of its vehicles."""

    def __init__(self, plant: Plant, t: Array, states: Mapping[str, Array], inputs: Mapping[str, Array]) -> None:
        """``t`` (n,) [s], and for each vehicle of the plant its true states (n, nx) and its inputs (n, nu).

        ArgumentError for a plant without bodies in MuJoCo, and for states that are not those of its vehicles.
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
        """[s]."""
        return float(self.t[-1])

    def show(self, t: float) -> None:
        """Put every vehicle where it was at the last sample at or before ``t`` [s]."""
        self.show_sample(max(int(np.searchsorted(self.t, t + TIME_TOLERANCE, side="right")) - 1, 0))

    def show_sample(self, row: int) -> None:
        """Put every vehicle where it was at a sample."""
        for name in self.states:
            self._place(name, row)

    def body(self, name: str) -> int:
        """The body of a vehicle that shows where it is: its airframe, or what its first joint moves."""
        if name in self._airframes:
            return self._airframes[name]
        model = self.plant.model
        first = next(j for j in range(model.njnt) if model.joint(j).name.startswith(f"{name}/"))
        return int(model.jnt_bodyid[first])

    def path(self, name: str, count: int) -> Array:
        """(k, 3) [m] where that body was, at ``count`` samples at most, evenly spread."""
        rows = np.unique(np.linspace(0, len(self.t) - 1, min(count, len(self.t))).astype(np.int64))
        at, points = self.body(name), []
        for row in rows:
            self._place(name, int(row))
            points.append(self.plant.data.xpos[at].copy())
        return np.array(points)

    def place(self, name: str, x: Array) -> Array:
        """(3,) [m] where the body of a vehicle is in a state (nx,), its input aside."""
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
