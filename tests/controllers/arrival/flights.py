"""Plans in free space, and how far apart they are at dense samples."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.dynamics import flow, state_at


def arcs(start: Array, u: Array, durations: Array, t: float = 0.0) -> Plan:
    """A plan from the state (6,) on with inputs (K, 3), each for its duration [s]; then it rests at once."""
    x = [np.asarray(start, dtype=np.float64)]
    for a, h in zip(u, durations, strict=True):
        x.append(flow(x[-1], a, h))
    breaks = t + np.concatenate([[0.0], np.cumsum(durations)])
    return Plan(breaks, np.array(x), np.reshape(u, (len(u), 3)), np.zeros(len(u), np.int64))


def straight(start: tuple[float, float, float], v: tuple[float, float, float], duration: float, t: float = 0.0) -> Plan:
    """At constant velocity."""
    return arcs(np.array([*start, *v]), np.zeros((1, 3)), np.array([duration]), t)


def hover(p: Array, t: float = 0.0) -> Plan:
    """Rest at p (3,)."""
    return Plan(np.array([t]), np.array([[*p, 0.0, 0.0, 0.0]]), np.empty((0, 3)), np.empty(0, np.int64))


def to_rest(start: Array, target: Array, half: float, t: float) -> Plan:
    """From the state (6,) to rest at the target (3,), in two arcs of ``half`` [s] each."""
    p, v = start[:3], start[3:]
    first = (target - p - 1.5 * half * v) / half**2
    return arcs(start, np.array([first, -first - v / half]), np.array([half, half]), t)


def sampled_distances(a: Plan, b: Plan, t: float, count: int) -> tuple[Array, Array]:
    """Times from t to rest, the breakpoints with them, and the distance at each."""
    breaks = np.concatenate([a.t, b.t])
    times = np.unique(np.concatenate([np.linspace(t, max(breaks.max(), t), count), breaks[breaks >= t]]))
    return times, np.linalg.norm(state_at(a, times)[:, :3] - state_at(b, times)[:, :3], axis=1)
