"""Completion path from the end of a safety manoeuvre to the target, without an optimiser: climb, level flight, descent.

The manoeuvre ends in vertical flight, so the way on is a stack of straight lines: up to a level that clears
everything between here and the target, across, and down onto p_f, each flown at the bounds with a rest at its end
(thesis A.4, Fig. A.2). Over a height field the vertical parts need no check of the terrain; the level is chosen from
it, and the certificate has the last word.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.terrain.height_field import HeightField

_LEVEL_MARGIN = 1.0  # [m] above the clearance, so that rounding cannot violate it in level flight
_NEGLIGIBLE = 1e-9  # [s]


@dataclass
class ArcList:
    """Arcs appended one after the other; each starts exactly where the last one ended."""

    t: list[float]
    x: list[Array]
    u: list[Array]
    phase: list[int]

    @staticmethod
    def begin(t: float, x: Array) -> ArcList:
        """Return an empty list that begins at ``t`` [s] in the state ``x`` (6,)."""
        return ArcList([t], [np.asarray(x, dtype=float)], [], [])

    def add(self, u: Array, duration: float, phase: FlightPhase) -> None:
        """Hold the acceleration ``u`` (3,) [m/s^2] for ``duration`` [s]."""
        if duration <= _NEGLIGIBLE:
            return
        held = np.asarray(u, dtype=float)
        # The operations of ``dynamics.flow`` in its order, so that both give the same last digit: duration**2 is
        # another number once in a thousand. Six numbers are moved on one by one in less time than it takes to call
        # numpy once for each operation.
        half = 0.5 * duration * duration
        x, y, z, v_x, v_y, v_z = self.x[-1].tolist()
        u_x, u_y, u_z = held.tolist()
        p = x + duration * v_x + half * u_x, y + duration * v_y + half * u_y, z + duration * v_z + half * u_z
        self.x.append(np.array([*p, v_x + duration * u_x, v_y + duration * u_y, v_z + duration * u_z]))
        self.t.append(self.t[-1] + duration)
        self.u.append(held)
        self.phase.append(int(phase))

    def wait(self, k: int, duration: float) -> None:
        """Hover for ``duration`` [s] at the rest in which arc k begins, which puts off all that follows."""
        if duration <= _NEGLIGIBLE:
            return
        self.t[k + 1 :] = [self.t[k] + duration, *(t + duration for t in self.t[k + 1 :])]
        self.x.insert(k + 1, self.x[k])
        self.u.insert(k, np.zeros(3))
        self.phase.insert(k, int(FlightPhase.HOVER))

    def rest(self) -> None:
        """Round the velocity that rounding left over to exactly zero."""
        self.x[-1] = np.concatenate([self.x[-1][:3], np.zeros(3)])

    def plan(self, cost: float, solve_ms: float) -> Plan:
        """Return the arcs as a plan with its cost and its solve time [ms]."""
        u = np.array(self.u) if self.u else np.empty((0, 3))
        phase = np.array(self.phase, dtype=np.int64)
        return Plan(np.array(self.t), np.array(self.x), u, phase, cost=cost, solve_ms=solve_ms)


def _straight(arcs: ArcList, direction: Array, distance: float, speed: float, a: float, phase: FlightPhase) -> None:
    """Append a line from rest to rest along ``direction``, flown in the least time under |v| <= speed and |u| <= a."""
    if distance <= 0.0:
        return
    peak = min(speed, math.sqrt(distance * a))
    ramp = peak / a
    arcs.add(a * direction, ramp, phase)
    arcs.add(np.zeros(3), (distance - peak * ramp) / peak, phase)
    arcs.add(-a * direction, ramp, phase)
    arcs.rest()


def complete(
    arcs: ArcList,
    terrain: HeightField,
    target: Array,
    clearance: float,
    speed: float,
    acceleration: float,
    end: float = -math.inf,
    level: float = -math.inf,
    drop_to_hold: float = math.inf,
) -> None:
    """Append the way from vertical flight to rest on the target (3,) [m], not before ``end`` [s]: till then it hovers.

    ``clearance`` [m] is what level flight keeps above the ground, and ``level`` [m] is its least height; ``speed``
    [m/s] and ``acceleration`` [m/s^2] are the bounds the plan may use. Where the descent onto the target is at least
    ``drop_to_hold`` [m] high the plan hovers at its upper end instead: above the target, out of the others' way.
    """
    up = np.array([0.0, 0.0, 1.0])
    rise = float(arcs.x[-1][5])
    arcs.add(-math.copysign(acceleration, rise) * up, abs(rise) / acceleration, FlightPhase.MANOEUVRE)
    arcs.rest()
    first = len(arcs.u)
    here = arcs.x[-1][:3]
    across = target[:2] - here[:2]
    distance = float(np.hypot(*across))
    if distance > 0.0:
        safe = highest_ground(terrain, here[:2], target[:2]) + clearance + _LEVEL_MARGIN
        level = max(here[2], target[2], safe, level)
        _straight(arcs, up, level - here[2], speed, acceleration, FlightPhase.CLIMB)
        _straight(arcs, np.append(across / distance, 0.0), distance, speed, acceleration, FlightPhase.CRUISE)
    drop = float(arcs.x[-1][2] - target[2])
    phase = FlightPhase.DESCENT if drop > 0.0 else FlightPhase.CLIMB
    first = len(arcs.u) if drop >= drop_to_hold else first
    _straight(arcs, -math.copysign(1.0, drop) * up, abs(drop), speed, acceleration, phase)
    arcs.wait(first, end - arcs.t[-1])


def highest_ground(terrain: HeightField, a: Array, b: Array) -> float:
    """Highest point [m] of the triangles under the straight line from a to b (2,) [m]; inf if it leaves the map."""
    span = (b - a) * (1.0 - 1e-12)  # so that rounding does not carry a point on the border off the map
    clearance = terrain.arc_clearance([a[0], a[1], 0.0], [span[0], span[1], 0.0], np.zeros(3), 1.0)
    return -clearance
