"""Angles modulo a turn."""

from __future__ import annotations

import math
from typing import TypeVar

from mathnavi.interfaces.signals import Array

Angle = TypeVar("Angle", float, Array)


def wrapped(angle: Angle) -> Angle:
    """Wrap an angle [rad], or each of an array of them (...,), into [-pi, pi).

    ``mathnavi.models.unicycle.kernels.wrapped`` is for compiled code.
    """
    within: Angle = (angle + math.pi) % (2.0 * math.pi) - math.pi
    return within
