"""The plug-in ``barrier``, a peer: a control barrier function filter around a go-to-goal law.

After A. D. Ames et al., arXiv 1903.11199 (the filter), and W. Xiao, C. Belta, arXiv 1903.04706 (relative degree two):

    u = argmin |u - u_nom|^2   subject to   h'' + 2 p h' + p^2 h >= 0,   (v_max^2 - |v|^2)' + p (v_max^2 - |v|^2) >= 0,
                                            |u| <= a_max.

u_nom = k (v_wanted - v), v_wanted down the gradient of the length to go that all planners here use.

Our interpretation: h = z - E(x, y) - h_min needs a smooth ground, and one that rises no sooner than the vehicle can
follow, so E is a spline above the raised triangles (``cover``). Down to a target that lies below E leads a funnel,
h = z - F(x, y), as smooth; the safe set is the union of both, and of the two barriers the larger one is used
(P. Glotfelter, J. Cortes, M. Egerstedt, 2017). Where the rows contradict each other the barrier comes first. A plan is
the closed loop of law and filter over a horizon, with a stop behind it, so that it can be tracked like the others'
plans and goes on when an answer is lost. The method has no fallback; none is added.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from functools import lru_cache
from typing import Annotated

import numpy as np
from annotated_types import Interval
from scipy.ndimage import maximum_filter, uniform_filter

from mathnavi.controllers.flight.certificate import Certificate
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.flight.cost_to_go import FactoredCost, factored_cost
from mathnavi.controllers.flight.plugin import GridLayers, GridNodes
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.controllers.peers.barrier_kernels import BarrierLaw, BarrierShape, SplineCost, closed_loop
from mathnavi.controllers.peers.commitment import hovering, stop_and_climb
from mathnavi.interfaces.bounds import FINITE, NonNegative, Positive, PositiveFraction, configuration
from mathnavi.interfaces.protocols import Planner, Tracker
from mathnavi.interfaces.signals import Array, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.knowledge import Knowledge
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.terrain.height_field import HeightField

_ROUNDING = 10.0  # [m] of the funnel's tip
_LIFT, _NEAR = 0.4, 0.25  # of the arrival radius: the funnel's tip above the target, where the law has arrived
_RAYS, _RINGS = 256, 300  # on which the ground around the target is sampled
_REACH = 8.0  # cells of the map: the length of those rays
_FLATTEST = 0.1  # funnel


@configuration
class BarrierConfig:
    """Fields of ``--planner``."""

    speed: PositiveFraction = 1.0
    """speed of the go-to-goal law, over v_max"""
    approach: Positive = 0.25
    """deceleration of the law towards the target, over a_max"""
    gain: Positive = 0.8
    """gain of the law's velocity error [1/s]"""
    decay: Positive = 0.8
    """rate p at which the barriers may decay [1/s]"""
    smoothing: NonNegative = 640.0
    """radius of the mean by which the ground is smoothed, in addition to the spline's smoothing [m]"""
    horizon: Annotated[float, Interval(gt=0.0, le=600.0), FINITE] = 20.0
    """horizon over which the closed loop is computed [s]"""
    period: Annotated[float, Interval(gt=0.0, le=600.0), FINITE] = 5.0 / 3.0
    """time between two computations of the closed loop [s]"""
    step: Annotated[float, Interval(ge=0.003, le=1.0), FINITE] = 0.1
    """time for which an input is held [s]"""
    grid_nodes: GridNodes = 65
    """number of nodes of the length-to-go's grid along the longer side of the map"""
    grid_layers: GridLayers = 9
    """number of layers of the length-to-go's grid"""
    bandwidth: Positive = 0.8
    """bandwidth of the tracker [rad/s]"""


class BarrierFlight:
    """Control barrier function filter around a go-to-goal law, a peer."""

    Config = BarrierConfig
    certifier = None  # it has its own rule

    @staticmethod
    def build(config: BarrierConfig, mission: FlightMission) -> tuple[Planner, Tracker]:
        """Return the planner of a mission, and the tracker of its plans."""
        bound = tracking_bound(config.bandwidth, mission)
        tracker = CriticallyDamped(mission.control_period, config.bandwidth, bound)
        return BarrierFilter(config, mission, Certificate.for_mission(mission, bound)), tracker


class BarrierFilter:
    """The closed loop of a go-to-goal law and its barrier filter, computed ahead."""

    def __init__(self, config: BarrierConfig, mission: FlightMission, certificate: Certificate) -> None:
        self._config = config
        self.period, self._step = (_whole(each, mission.control_period) for each in (config.period, config.step))
        self._update(mission.knowledge, certificate)

    def plan(self, request: PlanRequest) -> Plan:
        """The closed loop from the plan being flown, and a stop; a failure for an estimate that is not finite."""
        began = time.thread_time()
        known = self._knowledge.updated_with(request.messages)
        if known is not self._knowledge:
            self._update(known, self._certificate.updated_with(request.messages))
        start = request.estimate.x if request.current is None else state_at(request.current, request.t_start)
        if not np.isfinite(start).all():
            return Plan.failure(Status.NOT_FINITE, f"the start is {start.tolist()}")
        arcs = self._closed_loop(request.t_start, start)
        stop_and_climb(arcs, self._certificate.acceleration_max, 0.0)
        return replace(hovering(arcs, self.period), solve_ms=1e3 * (time.thread_time() - began))

    def _update(self, known: Knowledge, certificate: Certificate) -> None:
        self._knowledge, self._certificate = known, certificate
        self._cost = _cost_to_go(known, self._config.grid_nodes, self._config.grid_layers)
        self._cover = cover(certificate.terrain, self._config.smoothing)
        level = certificate.target[2] - certificate.clearance_min
        slope = funnel_slope(certificate.terrain, certificate.target, level, _LIFT * certificate.arrival_radius)
        self._funnel = np.array(
            [*certificate.target[:2], level + _LIFT * certificate.arrival_radius + certificate.clearance_min, slope,
             _ROUNDING]
        )  # fmt: skip

    def _closed_loop(self, t: float, start: Array) -> ArcList:
        config, certificate, cost = self._config, self._certificate, self._cost
        shape = BarrierShape(self._cover, certificate.terrain.spacing, certificate.clearance_min, self._funnel)
        law = BarrierLaw(
            speed=config.speed * certificate.speed_max,
            approach=config.approach,
            gain=config.gain,
            decay=config.decay,
            speed_max=certificate.speed_max,
            acceleration_max=certificate.acceleration_max,
            near=_NEAR * certificate.arrival_radius,
        )
        steps = max(1, round(config.horizon / self._step))
        x, u = closed_loop(start, shape, SplineCost(cost.ground, cost.ratio, cost.scales), law, self._step, steps)
        times = t + self._step * np.arange(len(x))
        return ArcList(times.tolist(), list(x), list(u), [int(FlightPhase.OPTIMISED)] * len(u))


def _whole(duration: float, period: float) -> float:
    """The whole number of control periods [s] nearest to a duration [s], at least one."""
    return max(1, round(duration / period)) * period


@lru_cache(maxsize=8)
def cover(terrain: HeightField, smoothing: float) -> Array:
    """Coefficients of a cubic spline that lies nowhere below the triangles of a terrain.

    A coefficient is the mean, over n = smoothing / spacing cells around its node, of the greatest height within n + 2
    cells of each. The spline over a cell is a mean of such means, and every greatest height in it counts the cell's
    four corners.
    """
    n = round(min(smoothing, max(terrain.width, terrain.depth)) / terrain.spacing)
    highest = maximum_filter(terrain.z, size=2 * (n + 2) + 1, mode="nearest")
    mean = uniform_filter(highest, size=2 * n + 1, mode="nearest")
    return np.ascontiguousarray(np.pad(mean, 1, mode="edge"))


def funnel_slope(terrain: HeightField, target: Array, level: float, lift: float) -> float:
    """Slope of the funnel whose tip is ``lift`` [m] above ``level`` [m], the target's less h_min, over all the ground.

    Near the target (3,) [m] the ground is sampled on rays, beyond that every node counts where it might be nearest.
    """
    reach = _REACH * terrain.spacing
    spacing = reach / _RINGS
    r = spacing * np.arange(1, _RINGS + 1)
    angle = 2.0 * math.pi * np.arange(_RAYS) / _RAYS
    x, y = (target[k] + r[:, None] * direction(angle) for k, direction in ((0, np.cos), (1, np.sin)))
    near = np.nan_to_num(terrain.height(x, y), nan=-math.inf)
    rows, columns = terrain.z.shape
    east, north = np.meshgrid(terrain.spacing * np.arange(columns), terrain.spacing * np.arange(rows))
    distance = np.hypot(east - target[0], north - target[1]) - math.sqrt(2.0) * terrain.spacing
    far = distance > reach - math.sqrt(2.0) * terrain.spacing
    height = np.concatenate([near.ravel(), terrain.z[far]])
    radius = np.concatenate([np.repeat(r, _RAYS), distance[far]])
    return max(_FLATTEST, float(((height - level - lift) / (np.hypot(radius, _ROUNDING) - _ROUNDING)).max()))


@lru_cache(maxsize=8)
def _cost_to_go(knowledge: Knowledge, nodes: int, layers: int) -> FactoredCost:
    return factored_cost(knowledge.terrain, np.array(knowledge.target), knowledge.radars, nodes, layers)
