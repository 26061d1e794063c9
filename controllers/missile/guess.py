"""First guesses of a flight: a smooth path at constant speed, flown along its tangent.

    P(s) = (1 + 2 s)(1 - s)^2 P_0 + s (1 - s)^2 D_0 + s^2 (3 - 2 s) P_1 - s^2 (1 - s) D_1,     0 <= s <= 1,

Hermite's cubic from the start to the target, with tangents D along the velocity at the start and the aspect angle at
the end. At speed U along it, theta is the angle of the tangent, w = 0, q = theta', and the inputs follow from the
equations of motion: the missile is differentially flat in its place and attitude. The yaw plane's path is a cubic
too, over time, and the nose follows it.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.missile.problem import TerminalCondition
from mathnavi.controllers.missile.shooting import Solved
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.dynamics import Body

TANGENTS = (1.0, 0.5, 2.0)
"""lengths of the tangents over the distance, in the order in which they are tried; only the first in flight, as another
plan follows soon"""

_DENSE = 400  # points of the path whose length is measured


def pitch_guess(start: Array, terminal: TerminalCondition, body: Body, nodes: Array, tangent: float) -> Solved:
    """Guess of the pitch plane's states (N, 6) and inputs (N - 1, 3), (F_1, F_z, I a), from a state (6,)."""
    U, w, theta, place = start[0], start[1], start[3], start[4:]
    speed = max(math.hypot(U, w), 1.0)
    target = terminal.place[[0, 2]]
    tangent_length = tangent * float(np.linalg.norm(target - place))
    c, s = math.cos(theta), math.sin(theta)
    velocity = np.array([U * c + w * s, w * c - U * s])
    ends = tangent_length * np.array([velocity / speed, [math.cos(terminal.theta), -math.sin(terminal.theta)]])
    fine = np.linspace(0.0, 1.0, _DENSE)
    path = _hermite(fine, place, target, *ends)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    T = max(float(length[-1]) / speed, 0.1)
    slope = np.gradient(path, fine, axis=0)
    angle = np.unwrap(np.arctan2(-slope[:, 1], slope[:, 0]))
    angle += 2.0 * math.pi * round((theta - angle[0]) / (2.0 * math.pi))
    angle += terminal.wound_to(angle[-1]).theta - angle[-1]  # rounding
    at = np.interp(nodes * length[-1], length, fine)

    x, times = np.zeros((len(nodes), 6)), nodes * T
    x[:, 0], x[:, 3], x[:, 4:] = speed, np.interp(at, fine, angle), _hermite(at, place, target, *ends)
    theta_rate, x[:, 2] = _rates(x[:, 3], times)
    middle = 0.5 * (x[:-1, 3] + x[1:, 3])
    weight, m = body.mass * body.gravity, body.mass
    inputs = np.column_stack(
        [
            weight * np.sin(middle),
            -m * theta_rate * speed - weight * np.cos(middle),
            body.inertia * np.diff(x[:, 2]) / np.diff(times),
        ]
    )
    return Solved(x, inputs, nodes, T, np.empty(0), math.nan, 0)


def yaw_guess(start: Array, terminal: TerminalCondition, body: Body, pitch: Solved) -> Solved:
    """Guess of the yaw plane's states (N, 4) and inputs (N - 1, 2), (F_2, I b), from ``start`` (4,)."""
    V, _, _, y = start
    T = pitch.duration
    ends = np.array([[y], [terminal.after(T)[1]], [T * V], [T * terminal.velocity[1]]])
    path = _hermite(pitch.nodes, *ends)[:, 0]
    _, velocity = _rates(path, pitch.times)
    psi = np.arctan2(velocity, pitch.x[:, 0])
    _, r = _rates(psi, pitch.times)
    d = np.diff(pitch.times)
    inputs = np.column_stack([body.mass * np.diff(velocity) / d, body.inertia * np.diff(r) / d])
    x = np.column_stack([velocity, r, psi, path])
    return Solved(x, inputs, pitch.nodes, T, np.empty(0), math.nan, 0)


def _rates(values: Array, times: Array) -> tuple[Array, Array]:
    """Rates (N - 1,) of values (N,) between the times (N,), and (N,) at them."""
    between = np.diff(values) / np.diff(times)
    return between, np.interp(times, 0.5 * (times[:-1] + times[1:]), between)


def _hermite(s: Array, start: Array, end: Array, leaving: Array, arriving: Array) -> Array:
    """Points (n, m) of the cubic at s (n,)."""
    t = s[:, None]
    points: Array = (
        (1 + 2 * t) * (1 - t) ** 2 * start
        + t * (1 - t) ** 2 * leaving
        + t**2 * (3 - 2 * t) * end
        - t**2 * (1 - t) * arriving
    )
    return points
