"""A path that is kept once the robot knows where it is: a pattern about the centre of the field, and the way to it.

The pattern lies along the field's longer axis. From a pose the robot joins it at the pose of it that is reached the
soonest by a turn on the spot, a straight line and another turn on the spot, the line keeping the margin.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.controllers.active_sensing.open_loop import Pattern, check_drivable, held, path
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.interfaces.signals import Array

_SHARE = 0.7  # of the robot's speed and turn rate that the way to the path takes; the rest is the tracker's
_ENTRIES = 40  # poses of the path at which it may be joined
_STEP = 0.05  # [m] between the points of a line that are looked at
_NOTHING = 1e-9  # [s]


class Reference:
    """The arcs of a pattern, one for each of the mission's periods.

    Raises ValueError where the robot cannot drive the pattern or the pattern does not keep the margin.
    """

    def __init__(self, pattern: Pattern, mission: RangingMission) -> None:
        check_drivable(pattern, mission)
        self.period = mission.period
        self._mission = mission
        self.poses = _placed(path(pattern, np.zeros(3), mission.period), mission)
        self._u = held(pattern, 0.0, mission.period, len(self.poses) - 1)
        apart = [
            mission.curve.distance(p) if mission.curve.contains(p) else -math.inf
            for p in self.poses[:: max(1, len(self.poses) // _ENTRIES), :2]
        ]
        if min(apart) < mission.margin:
            size = np.ptp(self.poses[:, :2], axis=0)
            raise ValueError(
                f"cycle = {pattern.cycle!r}: a path of {size[0]:.3g} by {size[1]:.3g} m about the centre does not keep "
                f"{mission.margin:g} m from the {mission.curve.name}; allowed: a shorter cycle or a lower speed"
            )

    def inputs(self, k: int, count: int) -> Array:
        """(count, 2) from its arc k on, again and again."""
        return self._u[np.arange(k, k + count) % len(self._u)]

    def way(self, pose: Array) -> tuple[Array, Array, int] | None:
        """Durations (K,) [s] and inputs (K, 2) from a pose (3,) onto the path, and the arc of it that then begins.

        None where no straight line to it keeps the margin.
        """
        entries = np.arange(0, len(self._u), max(1, len(self._u) // _ENTRIES))
        ways = [(*self._line(pose, self.poses[k], backwards), int(k)) for k in entries for backwards in (False, True)]
        for duration, u, k in sorted(ways, key=lambda way: float(way[0].sum())):
            if self._is_clear(pose[:2], self.poses[k, :2]):
                took = duration > _NOTHING
                return duration[took], u[took], k
        return None

    def _line(self, pose: Array, entry: Array, backwards: bool) -> tuple[Array, Array]:
        """Durations (3,) and inputs (3, 2): turn, drive, turn."""
        speed, turn_rate = _SHARE * self._mission.speed_max, _SHARE * self._mission.turn_rate_max
        dx, dy = float(entry[0] - pose[0]), float(entry[1] - pose[1])
        heading = math.atan2(dy, dx) + (math.pi if backwards else 0.0)
        first, last = wrapped(heading - float(pose[2])), wrapped(float(entry[2]) - heading)
        u = np.array(
            [
                [0.0, math.copysign(turn_rate, first)],
                [-speed if backwards else speed, 0.0],
                [0.0, math.copysign(turn_rate, last)],
            ]
        )
        return np.array([abs(first) / turn_rate, math.hypot(dx, dy) / speed, abs(last) / turn_rate]), u

    def _is_clear(self, begin: Array, end: Array) -> bool:
        """Whether a line keeps the margin, but for where its begin does not."""
        curve = self._mission.curve
        margin = min(self._mission.margin, curve.distance(begin) - _STEP)
        points = np.linspace(begin, end, 2 + int(np.linalg.norm(end - begin) / _STEP))
        return all(curve.contains(p, margin) for p in points)


def _placed(poses: Array, mission: RangingMission) -> Array:
    """Poses (n + 1, 3) of a cycle, moved so that they lie about the centre of the field along its longer axis."""
    turn = _longer_axis(mission.curve.polyline) - _longer_axis(poses[:, :2])
    c, s = math.cos(turn), math.sin(turn)
    offset = poses[:, :2] - poses[:-1, :2].mean(axis=0)
    turned = offset @ np.array([[c, s], [-s, c]])
    return np.column_stack([mission.curve.centre + turned, poses[:, 2] + turn])


def _longer_axis(points: Array) -> float:
    """[rad] of points (n, 2) of which the last is the first."""
    offset = points[:-1] - points[:-1].mean(axis=0)
    _, _, axes = np.linalg.svd(offset, full_matrices=False)
    return math.atan2(axes[0, 1], axes[0, 0])
