"""Explore first, then track: once the estimate is certain, a path in the frame of the world is followed.

The estimate is certain when the largest standard deviation of its position and that of its heading are below their
limits; when either exceeds twice its limit, or the estimate is lost, the robot explores again. Plans of the path follow
one another without a break, and the tracker holds the robot to them; only when the estimate is far from the plan does
the robot join the path again.

The path is a pattern about the centre of the field, along the field's longer axis. The robot joins it at the pose that
is reached the soonest by a turn on the spot, a straight line that keeps the margin, and another turn on the spot.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mathnavi.controllers.active_sensing.belief import Belief, pose_on
from mathnavi.controllers.active_sensing.planner import ExplorationPlanner
from mathnavi.controllers.active_sensing.policies import InputSequence, Pattern, check_drivable, path, sampled
from mathnavi.interfaces.errors import FieldError
from mathnavi.interfaces.signals import Array, Plan, PlanRequest
from mathnavi.models.unicycle.kernels import wrapped
from mathnavi.models.unicycle.mission import DrivePhase, RangingMission

_AGAIN = 2.0  # times a limit, above which the robot explores again
_FAR = 0.3  # [m] from the plan, beyond which the path is joined again
_SHARE = 0.7  # of the robot's speed and turn rate that the way to the path takes; the rest is the tracker's
_ENTRIES = 40  # poses of the path at which it may be joined
_STEP = 0.05  # [m] between the points of a line whose clearance is checked
_SAME_TIME = 1e-9  # [s]


class ThenTrack:
    """Planner that explores and, while the estimate is certain, follows a path for ``horizon`` [s] at a time.

    ``position`` [m] and ``heading`` [rad] are the limits of the standard deviations. Events: "tracking" when the path
    is joined, "exploring" when the estimate is no longer certain, "no-way" when no straight way leads onto the path.
    """

    def __init__(
        self, planner: ExplorationPlanner, reference: ReferencePath, position: float, heading: float, horizon: float
    ) -> None:
        self.period = planner.period
        self._planner, self._reference, self._horizon = planner, reference, horizon
        self._limits = np.array([position, heading])
        self._joined: _Joined | None = None
        self._noted = ""

    def plan(self, request: PlanRequest) -> Plan:
        belief = self._planner.beliefs.update(request)
        if not self._is_certain(belief):
            degraded = self._joined is not None
            return self._explore(request, belief, "exploring" if degraded else "", "the estimate is no longer certain")
        if request.current is None:
            return self._explore(request, belief)
        if self._joined is None or _is_far(belief, request.current, request.t):
            return self._join(request, belief, request.current)
        return self._follow(self._joined, request.t_start, pose_on(request.current, request.t_start))

    def _is_certain(self, belief: Belief) -> bool:
        limits = self._limits if self._joined is None else _AGAIN * self._limits
        found = np.array([belief.position_deviation, belief.heading_deviation])
        return belief.is_found and bool(np.isfinite(belief.pose).all() and (found <= limits).all())

    def _explore(self, request: PlanRequest, belief: Belief, note: str = "", message: str = "") -> Plan:
        self._joined = None
        plan = self._planner.explore(request, belief)
        is_new = note and note != self._noted
        self._noted = note
        return dataclasses.replace(plan, notes=(*plan.notes, note), message=message) if is_new else plan

    def _join(self, request: PlanRequest, belief: Belief, current: Plan) -> Plan:
        """The way to the path from the pose that is predicted for the plan's start."""
        pose = belief.predicted(current, request.t, request.t_start).pose
        way = self._reference.way_from(pose)
        if way is None:
            return self._explore(request, belief, "no-way", "no straight line to the path keeps the margin")
        duration, u, arc = way
        self._joined = _Joined(request.t_start + np.concatenate([[0.0], np.cumsum(duration)]), u, arc)
        self._noted = ""
        plan = self._follow(self._joined, request.t_start, pose)
        return dataclasses.replace(plan, notes=("tracking",), message="the estimate is sure")

    def _follow(self, joined: _Joined, t: float, pose: Array) -> Plan:
        """The rest of the way at t [s], from a pose (3,), and the path for the horizon after it."""
        period, begin = self._reference.period, float(joined.t[-1])
        passed = max(0, math.floor((t - begin) / period + _SAME_TIME))
        count = math.ceil(self._horizon / period)
        times = begin + period * (passed + np.arange(count + 1))
        u = self._reference.inputs(joined.arc + passed, count)
        if not passed:
            times, u = np.concatenate([joined.t[:-1], times]), np.vstack([joined.u, u])
        first = int(np.searchsorted(times, t + _SAME_TIME, side="right")) - 1
        times = np.concatenate([[t], times[first + 1 :]])
        return InputSequence(np.diff(times), u[first:], DrivePhase.CRUISE).plan(t, pose, math.nan)


class ReferencePath:
    """The arcs of a pattern about the centre of the field, one for each of the mission's periods.

    Raises FieldError where the robot cannot drive the pattern or the pattern does not keep the margin.
    """

    def __init__(self, pattern: Pattern, mission: RangingMission) -> None:
        check_drivable(pattern, mission)
        self.period = mission.period
        self._mission = mission
        self.poses = _placed(path(pattern, np.zeros(3), mission.period), mission)
        self._u = sampled(pattern, 0.0, mission.period, len(self.poses) - 1)
        distances = [
            mission.curve.distance(p) if mission.curve.contains(p) else -math.inf
            for p in self.poses[:: max(1, len(self.poses) // _ENTRIES), :2]
        ]
        if min(distances) < mission.margin:
            size = np.ptp(self.poses[:, :2], axis=0)
            raise FieldError(
                f"cycle = {pattern.cycle!r}: a path of {size[0]:.3g} by {size[1]:.3g} m about the centre does not keep "
                f"{mission.margin:g} m from the {mission.curve.name}; allowed: a shorter cycle or a lower speed"
            )

    def inputs(self, k: int, count: int) -> Array:
        """Inputs (count, 2) [m/s, rad/s] from arc k on, cycle after cycle."""
        return self._u[np.arange(k, k + count) % len(self._u)]

    def way_from(self, pose: Array) -> tuple[Array, Array, int] | None:
        """Durations (K,) [s] and inputs (K, 2) from a pose (3,) onto the path, and the arc of it that then begins.

        None where no straight line to it keeps the margin.
        """
        entries = np.arange(0, len(self._u), max(1, len(self._u) // _ENTRIES))
        ways = [(*self._line(pose, self.poses[k], backwards), int(k)) for k in entries for backwards in (False, True)]
        for duration, u, k in sorted(ways, key=lambda way: float(way[0].sum())):
            if self._is_clear(pose[:2], self.poses[k, :2]):
                lasts = duration > _SAME_TIME
                return duration[lasts], u[lasts], k
        return None

    def _line(self, pose: Array, entry: Array, backwards: bool) -> tuple[Array, Array]:
        """Durations (3,) [s] and inputs (3, 2) [m/s, rad/s]: turn, drive, turn."""
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
        """True if a line keeps the margin, or its begin's distance where that is less."""
        curve = self._mission.curve
        margin = min(self._mission.margin, curve.distance(begin) - _STEP)
        points = np.linspace(begin, end, 2 + int(np.linalg.norm(end - begin) / _STEP))
        return all(curve.contains(p, margin) for p in points)


@dataclasses.dataclass(frozen=True)
class _Joined:
    """The way onto the path: at ``t[-1]`` arc ``arc`` of the path begins."""

    t: Array  # (K + 1,) [s]
    u: Array  # (K, 2)
    arc: int


def _is_far(belief: Belief, plan: Plan, t: float) -> bool:
    """True if the estimate is far from the pose of a plan at t [s]."""
    x, y, _ = belief.pose - pose_on(plan, t)
    return math.hypot(x, y) > _FAR


def _placed(poses: Array, mission: RangingMission) -> Array:
    """Poses (n + 1, 3) of a cycle, moved about the centre of the field and turned along its longer axis."""
    angle = _longer_axis(mission.curve.polyline) - _longer_axis(poses[:, :2])
    c, s = math.cos(angle), math.sin(angle)
    offset = poses[:, :2] - poses[:-1, :2].mean(axis=0)
    rotated = offset @ np.array([[c, s], [-s, c]])
    return np.column_stack([mission.curve.centre + rotated, poses[:, 2] + angle])


def _longer_axis(points: Array) -> float:
    """Direction [rad] of the longer axis of points (n, 2), the last of which is the first."""
    offset = points[:-1] - points[:-1].mean(axis=0)
    _, _, axes = np.linalg.svd(offset, full_matrices=False)
    return math.atan2(axes[0, 1], axes[0, 0])
