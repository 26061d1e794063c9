"""Flight along corners: straight legs at constant velocity, joined by arcs of constant acceleration.

Leg k leads from corner c_k to c_(k+1) at the velocity v_k. Around corner k the velocity turns from v_(k-1) to v_k in
the least time, T_k = |v_k - v_(k-1)| / a, half of it before and half after the corner would have been passed: a
parabola that touches both legs and passes |v_k - v_(k-1)| T_k / 8 inside the corner. At the last corner the vehicle
rests. Leg k has room for its two turns if

    |v_k| (T_k + T_(k+1)) / 2 <= |c_(k+1) - c_k|.
"""

from __future__ import annotations

import numpy as np

from mathnavi.controllers.flight.completion import ArcList
from mathnavi.interfaces.signals import OPTIMISED, Array

SLOWER = 0.85  # by which a leg without room is slowed down


def fitting(corners: Array, speeds: Array, acceleration: float, fixed: bool) -> Array:
    """Return speeds (n,) [m/s] of the legs between corners (n + 1, 3) [m], reduced until each leg has room for its
    turns.

    With ``fixed`` the first leg is already being flown: its speed is kept, and there is no turn at its beginning.
    """
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    slowed = speeds.copy()
    while True:
        duration = turns(corners, slowed, acceleration, fixed)
        short = slowed * 0.5 * (duration[:-1] + duration[1:]) > length
        if fixed:
            short[1] |= short[0]
            short[0] = False
        if not short.any():
            return slowed
        slowed[short] *= SLOWER


def turns(corners: Array, speeds: Array, acceleration: float, fixed: bool) -> Array:
    """Return the durations T_k (n + 1,) [s] of the turns, the first from rest and the last to rest."""
    velocity = _velocities(corners, speeds)
    change = np.diff(np.vstack([velocity[0] if fixed else np.zeros(3), velocity, np.zeros(3)]), axis=0)
    duration: Array = np.linalg.norm(change, axis=1) / acceleration
    return duration


def flight(t: float, x: Array, corners: Array, speeds: Array, acceleration: float, fixed: bool) -> ArcList:
    """The arcs from the state x (6,) at the first corner, to rest at the last; arc 2 k is turn k, arc 2 k + 1 leg k."""
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    velocity, duration = _velocities(corners, speeds), turns(corners, speeds, acceleration, fixed)
    arcs = ArcList.begin(t, x)
    for k, v in enumerate(velocity):
        _turn(arcs, v, duration[k])
        straight = length[k] / speeds[k] - 0.5 * (duration[k] + duration[k + 1])
        arcs.add(np.zeros(3), straight, OPTIMISED)
    _turn(arcs, np.zeros(3), duration[-1])
    arcs.rest()
    return arcs


def _turn(arcs: ArcList, velocity: Array, duration: float) -> None:
    if duration > 0.0:
        arcs.add((velocity - arcs.x[-1][3:]) / duration, duration, OPTIMISED)


def _velocities(corners: Array, speeds: Array) -> Array:
    """Return the velocities v_k (n, 3) [m/s] of the legs."""
    leg = np.diff(corners, axis=0)
    velocity: Array = leg * (speeds / np.linalg.norm(leg, axis=1))[:, np.newaxis]
    return velocity
