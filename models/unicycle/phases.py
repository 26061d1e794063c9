"""Phases of a robot's plan."""

from __future__ import annotations

from enum import IntEnum


class DrivePhase(IntEnum):
    """Phase of an arc of a robot's plan: inputs for exploration, a turn on the spot or back, a path that is tracked."""

    OPTIMISED = 0
    MANOEUVRE = 1
    CRUISE = 4
