"""Inputs that drive a unicycle along fixed patterns, without feedback."""

from __future__ import annotations

import math

from scipy.special import jn_zeros

_CLOSED = float(jn_zeros(0, 1)[0])
"""amplitude A [rad] of the heading for which the mean of e^{i A sin}, which is J_0(A), is zero: the path closes"""


def circle(t: float, speed: float, turn_rate: float) -> tuple[float, float]:
    """Input u [m/s, rad/s] at t [s]: a circle of radius speed / turn_rate."""
    return speed, turn_rate


def figure_eight(t: float, speed: float, period: float) -> tuple[float, float]:
    """Input u [m/s, rad/s] at t [s]: a closed figure of eight, phi = phi_0 + A sin(2 pi t / period), A the first zero
    of J_0.

    It starts at one of its ends, across its axis, which points to the left; it is 0.375 speed x period long and 0.139
    wide.
    """
    rate = 2.0 * math.pi / period
    return speed, _CLOSED * rate * math.cos(rate * t)


def straight(t: float, speed: float, period: float) -> tuple[float, float]:
    """Input u [m/s, rad/s] at t [s]: forth and back along a line, speed x period / 4 to either side of the start."""
    return (-speed if 0.25 <= (t / period) % 1.0 < 0.75 else speed), 0.0
