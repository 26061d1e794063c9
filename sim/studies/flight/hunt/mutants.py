"""Four controllers with one part of the guarantee left out each, for the study ``hunt`` to find.

They are named by their place, "mathnavi.sim.studies.flight.hunt.mutants:NoClearanceCheck", and are no installed
plug-ins. All else is as ``flight`` has it: faults act on the planner, within what certifies its plans.

    NoClearanceCheck    a plan is flown however low it is; the planner keeps its clearance at the nodes, softly
    NoStartCheck        a plan is flown wherever it starts; the planner predicts its start at constant velocity
    LatePlansFlown      a plan that is ready after its start is flown all the same, from when it is ready
    HalvedBound         plans are certified for half the distance that the tracker can be from them
"""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np

from mathnavi.controllers.flight.certificate import Certificate, Refusal, TrackingBound
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.planner import StopAndHover
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.flight.plugin import planner as flight_planner
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HIGHEST
from mathnavi.sim.interfaces.protocols import Planner, Tracker
from mathnavi.sim.interfaces.signals import Estimate, Plan, PlanRequest

Parts = tuple[Planner, Tracker]


def _certified(
    planner: Planner,
    mission: FlightMission,
    tracker: CriticallyDamped,
    *,
    certificate: type[Certificate] = Certificate,
    kind: type[Certified] = Certified,
) -> Certified:
    """The planner behind a certificate, as ``Certified.for_mission`` makes it, with the classes that are given."""
    sound = Certificate.for_mission(mission, tracker.bound, tracker.held)
    made = certificate(**{entry.name: getattr(sound, entry.name) for entry in dataclasses.fields(sound)})
    fallback = partial(StopAndHover, period=planner.period)
    worst = mission.quality.worst(mission.gust)
    return kind(planner, fallback, made, tracker.bound, mission.deadline_factor, worst, mission.start_state)


class BlindCertificate(Certificate):
    """A certificate that does not ask for clearance, only for a plan over the map."""

    def check_clearance(self, plan: Plan) -> Refusal | None:
        return Certificate.check_clearance(dataclasses.replace(self, clearance_min=-HIGHEST), plan)


class NoClearanceCheck(FlightController):
    """Flies plans however low they are."""

    certified = staticmethod(partial(_certified, certificate=BlindCertificate))  # type: ignore[assignment]


class ConstantVelocityStart:
    """A planner that starts from where the vehicle would be at constant velocity."""

    def __init__(self, planner: Planner) -> None:
        self.period = planner.period
        self._planner = planner

    def plan(self, request: PlanRequest) -> Plan:
        """The plan from the predicted start."""
        x = request.estimate.x
        start = np.concatenate([x[:3] + (request.t_start - request.t) * x[3:], x[3:]])
        estimate = Estimate(request.t_start, start)
        return self._planner.plan(dataclasses.replace(request, estimate=estimate, current=None))


class CertifiedFromAnywhere(Certified):
    """Certifies plans wherever they start."""

    def _examined(self, plan: Plan, request: PlanRequest) -> Plan:
        if not plan.ok:
            return plan
        here = Estimate(plan.t_start, plan.x[0])
        return super()._examined(plan, dataclasses.replace(request, estimate=here, current=None))


class NoStartCheck(FlightController):
    """Flies plans wherever they start."""

    certified = staticmethod(partial(_certified, kind=CertifiedFromAnywhere))  # type: ignore[assignment]

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Parts:
        """Return the planner of a mission, and the tracker of its plans."""
        planner, tracker = FlightController.build(config, mission)
        return ConstantVelocityStart(planner), tracker


class CertifiedTooEarly(Certified):
    """Certifies plans for when they were asked for, and has those that are late begin when they are ready."""

    def plan(self, request: PlanRequest) -> Plan:
        """The plan, later than it was certified for if it is late."""
        plan = super().plan(request)
        late = plan.ready - plan.t_start if plan.ok else 0.0
        return dataclasses.replace(plan, t=plan.t + late) if late > 0.0 else plan


class LatePlansFlown(FlightController):
    """Flies plans that are ready after their start."""

    certified = staticmethod(partial(_certified, kind=CertifiedTooEarly))  # type: ignore[assignment]


class HalvedBound(FlightController):
    """Certifies plans for half of what the tracker may be beside them."""

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Parts:
        """Return the planner of a mission, and the tracker of its plans."""
        whole = tracking_bound(config.bandwidth, mission)
        held = None if whole.held is None else 0.5 * whole.held
        half = TrackingBound(
            0.5 * whole.horizontal, 0.5 * whole.vertical, 0.5 * whole.speed, 0.5 * whole.feedback, held
        )
        tracker = CriticallyDamped(mission.control_period, config.bandwidth, whole)
        tracker.bound = half
        return flight_planner(config, mission, half), tracker
