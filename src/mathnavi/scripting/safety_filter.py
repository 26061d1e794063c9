"""Safety filter for any commands, on arrays: without scenario, loop and plug-in.

Map frame and states as in ``mathnavi.scripting.flight``; a command is an acceleration (3,) [m/s^2] that is held for
a period.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.command_filter import CANDIDATES, CommandFilter
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.failures import raising
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.models.aerial.dynamics import CONTROL_TICKS, TICK
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.scripting.flight import Terrain, ground_of, point_of


class SafetyFilter:
    """Filter that flies a proposed command if a certified way to rest remains after it, else the nearest that has one.

        safe = mn.SafetyFilter("jacksboro", target, clearance_min=50.0)
        u, info = safe.step(t, x, proposed)

    ``step`` is called once every ``period``. If no command near the proposed one can be certified, the plan that was
    certified last is flown: to rest, up, and on to the ``target``. The method is in
    ``mathnavi.controllers.flight.command_filter``. It guards against the ground and the edge of the map, not against
    other vehicles.
    """

    def __init__(
        self,
        terrain: Terrain,
        target: Sequence[float],
        *,
        period: float = CONTROL_TICKS * TICK,
        clearance_min: float = 50.0,
        speed_max: float = 300.0,
        acceleration_max: float = 40.0,
        arrival_radius: float = 50.0,
        position_noise: float = 0.0,
        gust_rms: float = 0.0,
        gust_time_constant: float = 3.0,
        bandwidth: float = 0.8,
        candidates: int = CANDIDATES,
    ) -> None:
        """Keep ``clearance_min`` [m], ``speed_max`` [m/s] and ``acceleration_max`` [m/s^2] at every instant.

        ``target`` (3,) [m] is where the plan behind every command comes to rest, within ``arrival_radius`` [m].
        ``position_noise`` [m] is the standard deviation of a state's position on each axis, and gusts push with
        ``gust_rms`` [m/s^2] over ``gust_time_constant`` [s]: the guarantee holds for the values declared here, with the
        tracker of ``bandwidth`` [rad/s] that follows the stored plan. More ``candidates`` never change commands more,
        and may change them less.

        Raises TerrainError for an unknown terrain, MissionError for any other wrong argument.
        """
        ground = ground_of(terrain)
        for name, value, least in (
            ("period", period, 0.0), ("clearance_min", clearance_min, None), ("speed_max", speed_max, 0.0),
            ("acceleration_max", acceleration_max, 0.0), ("arrival_radius", arrival_radius, 0.0),
            ("position_noise", position_noise, None), ("gust_rms", gust_rms, None),
            ("gust_time_constant", gust_time_constant, 0.0),
        ):  # fmt: skip
            if not (np.isfinite(value) and (value > 0.0 if least is not None else value >= 0.0)):
                bound = ">" if least is not None else ">="
                raise MissionError(f"{name} = {value!r}; allowed: a finite number {bound} 0")
        with raising(MissionError):
            place = point_of("target", target)
            bare = FlightMission(
                ground, place, place, clearance_min, speed_max, acceleration_max, arrival_radius=arrival_radius,
                position_noise=position_noise, gust=DeclaredGusts(gust_rms, gust_time_constant), control_period=period,
            )  # fmt: skip
            mission = dataclasses.replace(bare, quality=bare.full_state_quality(None, period))
            bound_kept = tracking_bound(bandwidth, mission)
            self._filter = CommandFilter(mission, CriticallyDamped(period, bandwidth, bound_kept), candidates)
        self.interventions = 0
        """number of steps so far at which another command than the proposed one was flown"""

    @property
    def bound(self) -> TrackingBound:
        """Distance that the vehicle may have from its plan, by which the ground is raised."""
        return self._filter.bound

    def step(
        self, t: float, x: ArrayLike, proposed: ArrayLike, covariance: ArrayLike | None = None, *, lost: bool = False
    ) -> tuple[Array, dict[str, Any]]:
        """Return the command (3,) [m/s^2] to hold from t [s] on for a period, and ``info`` on the decision.

        ``x`` (6,) [m, m/s] is the estimate of the state, ``covariance`` (6, 6) its covariance if it has one, and
        ``lost`` is True if it cannot be relied on. ``info`` holds

            intervened     True if the command differs from ``proposed``, which is otherwise returned bit for bit
            interventions  number of them so far
            flown          "proposed", "nearest" or "stored plan"
            reason         why the proposed command is not certified
            distance       [m/s^2] between the two
            margin         [m] of clearance beyond clearance_min and tracking bound, until the plan flown has stopped
            guaranteed     False while the guarantee is lost, and ``announced`` why
            breach         True if the vehicle was outside the tracking bound of the plan stored before

        Raises MissionError for arrays of another shape, and for a t that is not one period after the last.
        """
        state, u = np.array(x, dtype=np.float64), np.array(proposed, dtype=np.float64)
        declared = None if covariance is None else np.array(covariance, dtype=np.float64)
        if declared is not None and declared.shape != (6, 6):
            raise MissionError(f"covariance has shape {declared.shape}; allowed: (6, 6)")
        estimate = Estimate(t, state, declared, Status.LOST if lost else Status.OK)
        with raising(MissionError):
            answer = self._filter.step(float(t), estimate, u)
        self.interventions += answer.intervened
        return answer.u, {**answer.info(), "interventions": self.interventions}
