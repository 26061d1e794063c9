"""Run-time assurance of a flight: the certificate, or the filter, between its planner and its actuators.

A controller may declare ``certifier``: a function in the place of ``Certified.for_mission``, or None for plans that are
flown without a certificate.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, ClassVar

from mathnavi.controllers.flight.certificate import Certificate, TrackingBound
from mathnavi.controllers.flight.certified import Certified, Certifier
from mathnavi.controllers.flight.command_filter import CommandFilter, filtered
from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.controllers.flight.tracker import FASTEST, CriticallyDamped
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightStatus
from mathnavi.sim.plugin.registry import PluginSpec, called, checked_controller
from mathnavi.sim.records.missions import Point
from mathnavi.sim.scenarios.assembler import Assembler

_ROUNDING = 1e-3  # [m] of a clearance


@dataclass(frozen=True)
class FlightAssurance:
    """Assurance of one vehicle: every plan is certified before it is flown, or every command filtered instead."""

    mission: FlightMission  # of a point mass
    certifier: Certifier | None  # None: plans are flown as they come
    filtered: bool
    bound: ClassVar[type] = TrackingBound  # that the tracker states

    @staticmethod
    def for_mission(parts: Assembler, mission: FlightMission) -> FlightAssurance:
        """Assurance that the scenario's field ``filter`` and the controller's ``certifier`` ask for."""
        return FlightAssurance(mission, _certifier(parts.controller), getattr(parts.config, "filter", False))

    @property
    def guaranteed(self) -> bool:
        """True if plans are certified or commands filtered."""
        return self.filtered or self.certifier is not None

    def around(self, planner: Planner, tracker: Any) -> tuple[Planner, Any]:
        """Planner and tracker with this assurance; MissionError if the tracking bound leaves nothing to fly with."""
        if self.filtered:
            return filtered(planner, tracker, CommandFilter.for_mission(self.mission))
        return (planner if self.certifier is None else self.certifier(planner, self.mission, tracker)), tracker


def assured(mission: FlightMission, tracker: Any, *, guaranteed: bool = True) -> dict[str, Any]:
    """Fields of the agent of a point mass by which it flies on without its estimator, and without its tracker.

    Its estimates are of the present, and where one is missing the mission's motion is the best guess. A plan is tracked
    with the tracker's own bound. Where the flight is ``guaranteed`` no command is stronger than a_max.
    """
    bandwidth = min(FlightConfig.bandwidth, FASTEST / mission.control_period)
    spare = CriticallyDamped(mission.control_period, bandwidth, tracker.bound)
    strongest = mission.acceleration_max if guaranteed else math.inf

    def flow(estimate: Estimate, u: Array, dt: float) -> Estimate:
        return dataclasses.replace(estimate, x=mission.flow(estimate.x, u, dt))

    return {
        "start": Estimate(0.0, mission.start_state), "flow": flow, "spare": spare, "estimate_age": 0.0,
        "command_max": strongest,
    }  # fmt: skip


class FirstPlans:
    """First plans by the certified planner of missions that differ in start and target alone, also for a controller
    that declares no certificate.

    A start below the least clearance of a mission before, with its tracking bound, is refused before a planner is
    built: no plan from there would be certified.
    """

    def __init__(self, parts: Assembler) -> None:
        self._parts = parts
        self._certificate: Certificate | None = None

    def plan(self, mission: Any, flight: FlightMission) -> Plan:
        """Return the first plan of a mission whose flight is that of a point mass; a failure if none is certified."""
        if self._certificate is not None and _too_low(self._certificate, flight.start):
            return Plan.failure(FlightStatus.LOW_CLEARANCE, f"the start {flight.start!r} is too low")
        planner, tracker = checked_controller(self._parts.controller, mission, TrackingBound)
        self._certificate = Certificate.for_mission(flight, tracker.bound)
        request = PlanRequest(0.0, 0.0, Estimate(0.0, flight.start_state), None)
        return Certified.for_mission(planner, flight, tracker).plan(request)


def _too_low(certificate: Certificate, start: Point) -> bool:
    x, y, z = start
    return z - float(certificate.terrain.height(x, y)) < certificate.clearance_min - _ROUNDING


def _certifier(controller: PluginSpec) -> Certifier | None:
    declared: Certifier | None = getattr(controller.plugin, "certifier", Certified.for_mission)
    if declared is not None and not callable(declared):
        raise PluginError(
            f"controllers: {called('controllers', controller.name)!r}: certifier = {declared!r}; allowed: None, or a "
            "function (planner, mission, tracker) -> planner"
        )
    return declared
