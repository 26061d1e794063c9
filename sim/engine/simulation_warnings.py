"""Warnings of MuJoCo about a simulation, as events.

MuJoCo counts what goes wrong in a step and steps on: a position, velocity or acceleration that is not finite, or beyond
1e10, with which the simulation is lost; contacts or constraints that are left out for want of memory; an inertia that
is close to singular; controls beyond 1e10, in place of which zeros act.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from mathnavi.interfaces.signals import DIVERGED, Event

_BAD_POSITION, _BAD_VELOCITY, _BAD_ACCELERATION = (
    int(kind)
    for kind in (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
)
_LOST = {_BAD_POSITION: "a position", _BAD_VELOCITY: "a velocity", _BAD_ACCELERATION: "an acceleration"}
"""quantity that ends the simulation, by warning"""


class SimulationWarnings:
    """Warnings of one simulation, each kind of which is reported once."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, vehicles: Sequence[str]) -> None:
        self._model, self._vehicles = model, vehicles
        # views that follow the simulation
        self._counts, self._indices, self._v = data.warning.number, data.warning.lastinfo, data.qvel
        self._forces = data.qfrc_passive, data.qfrc_actuator, data.qfrc_constraint
        self._reported: set[int] = set()
        self.lost = False
        """whether the simulation has diverged"""

    @property
    def pending(self) -> bool:
        """True if there is something to be taken or cleared."""
        return bool(self._counts.any()) or not math.isfinite(self._v.dot(self._v))

    def clear(self) -> None:
        """Forget the warnings: the steps that caused them were taken back."""
        self._counts[:] = 0

    def taken(self, t: float) -> list[Event]:
        """Return the events of the tick that ends at t [s], and forget its warnings."""
        found = {kind: int(self._indices[kind]) for kind in np.flatnonzero(self._counts).tolist()}
        if not np.isfinite(self._v).all():  # before MuJoCo sees it, in the next step
            found.setdefault(_BAD_VELOCITY, int(np.isfinite(self._v).argmin()))
        self.clear()
        events = [
            self._divergence(t, kind, index) if kind in _LOST else self._warning(t, kind, index)
            for kind, index in found.items()
            if kind not in self._reported
        ]
        self._reported.update(found)
        diverged = [event for event in events if event.kind == DIVERGED][: 0 if self.lost else 1]
        self.lost |= bool(diverged)  # what follows is a consequence
        return [*(event for event in events if event.kind != DIVERGED), *diverged]

    def _warning(self, t: float, kind: int, index: int) -> Event:
        agent = self._vehicles[0] if len(self._vehicles) == 1 else ""
        return Event(t, agent, "physics-warning", mujoco.mju_warningText(kind, index))

    def _divergence(self, t: float, kind: int, index: int) -> Event:
        force = np.abs(np.sum(self._forces, axis=0))
        if kind == _BAD_POSITION:
            joint = int(np.searchsorted(self._model.jnt_qposadr, index, side="right")) - 1
        else:
            # MuJoCo names the first joint beyond its limit, which may be one that the force on another pulls along.
            by_force = kind == _BAD_ACCELERATION and np.isfinite(force).all()
            joint = int(self._model.dof_jntid[force.argmax() if by_force else index])
        full = self._model.joint(joint).name
        vehicle, _, name = full.partition("/")
        where = name if len(self._vehicles) == 1 else full
        message = f"the simulation diverged in the joint {where!r}: {_LOST[kind]} that is not finite, or beyond 1e10"
        return Event(t, vehicle, DIVERGED, message)
