"""The tip of a mechanism: where it is in a position, and how fast in a state."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mathnavi.interfaces.signals import Array

NOSE = (0.26, 0.0, 0.0)  # [m] of the rigid body
FARTHEST = 0.9  # of the distance of the farthest geom of the last body, beyond which geoms are its tip


class Tip:
    """A point of the last body that has a shape: the middle of what is farthest from its joint."""

    def __init__(self, model: Any, *, is_ball: bool) -> None:
        """``is_ball`` of a body on a ball joint, whose velocity is its rate of turning and whose tip is its nose."""
        self.model, self.data, self._is_ball = model, mujoco.MjData(model), is_ball
        moving = np.flatnonzero(model.body_weldid != 0)
        geoms = {int(b): np.flatnonzero(model.geom_bodyid == b).tolist() for b in moving}
        self.body = max((b for b, own in geoms.items() if own), default=int(moving[-1]))
        self._offset = np.array(NOSE) if is_ball else _farthest(model.geom_pos[geoms[self.body]])

    def put(self, position: Array) -> None:
        """Put the mechanism into a position (nq,)."""
        self.data.qpos[:] = position
        mujoco.mj_kinematics(self.model, self.data)

    @property
    def place(self) -> Array:
        """(3,) [m] the tip."""
        place: Array = self.data.xpos[self.body] + self.data.xmat[self.body].reshape(3, 3) @ self._offset
        return place

    @property
    def origin(self) -> Array:
        """(3,) [m] where the velocity is drawn: the tip, or the middle of a body that turns."""
        middle: Array = self.data.xpos[self.body]
        return middle if self._is_ball else self.place

    def velocity(self, state: Array) -> Array:
        """(3,) of the tip [m/s], or the rate of turning [rad/s], in the world's frame; it is left in that state."""
        nq = self.model.nq
        self.put(state[:nq])
        if self._is_ball:
            turned: Array = self.data.xmat[self.body].reshape(3, 3) @ state[nq:]
            return turned
        mujoco.mj_comPos(self.model, self.data)
        jacobian = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, jacobian, None, self.place, self.body)
        velocity: Array = jacobian @ state[nq:]
        return velocity


def _farthest(places: Array) -> Array:
    """(3,) [m] the middle of those of the places (m, 3) that are farthest from the origin."""
    if not len(places):
        return np.zeros(3)
    distance = np.linalg.norm(places, axis=1)
    middle: Array = places[distance >= FARTHEST * distance.max()].mean(axis=0)
    return middle
