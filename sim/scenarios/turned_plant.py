"""Plant in a frame rotated about the vertical: forces, torques and displacements come in the user's frame."""

from __future__ import annotations

from mathnavi.interfaces.protocols import Plant
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.mission_frame import MissionFrame
from mathnavi.sim.engine.faults import Disturbed


class TurnedPlant(Disturbed):
    """Plant in the frame of a mission: it rotates external forces, torques and displacements and nothing else."""

    def __init__(self, plant: Plant, frame: MissionFrame) -> None:
        super().__init__(plant, ())
        self._axes = frame.axes

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        self.plant.apply_wrench(name, self._axes @ force, None if torque is None else self._axes @ torque)

    def displace(self, name: str, offset: Array) -> None:
        self.plant.displace(name, self._axes @ offset)
