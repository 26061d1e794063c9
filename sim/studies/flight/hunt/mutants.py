"""Four controllers with one part of the guarantee left out each, for the study ``hunt`` to find.

They are named by their place, "mathnavi.sim.studies.flight.hunt.mutants:NoClearanceCheck", and are no installed
plug-ins. Each certifies its plans itself, with its one defect, and so declares ``certified = False``.

    NoClearanceCheck    a plan is flown however low it is; the planner keeps its clearance at the nodes, softly
    NoStartCheck        a plan is flown wherever it starts; the planner predicts its start at constant velocity
    LatePlansFlown      a plan that is ready after its start is flown all the same, from when it is ready
    HalvedBound         plans are certified for half the distance that the tracker can be from them
"""

from __future__ import annotations

import dataclasses
from functools import partial
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mathnavi.controllers.flight.certificate import Certificate, Refusal, TrackingBound
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.planner import StopAndHover
from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.controllers.flight.plugin import planner as flight_planner
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.height_field import HIGHEST
from mathnavi.sim.interfaces.bounds import FINITE, Count, configuration
from mathnavi.sim.interfaces.protocols import Planner, Tracker
from mathnavi.sim.interfaces.signals import Estimate, Plan, PlanRequest

Parts = tuple[Planner, Tracker]


def _parts(
    config: FlightConfig,
    mission: FlightMission,
    bound: TrackingBound,
    *,
    certificate: type[Certificate] = Certificate,
    certified: type[Certified] = Certified,
    predicted: bool = False,
) -> Parts:
    """Planner and tracker as ``flight`` has them, with the classes and the bound that are given."""
    tracker = CriticallyDamped(mission.control_period, config.bandwidth, tracking_bound(config.bandwidth, mission))
    tracker.bound = bound
    sound = Certificate.of(mission, bound, tracker.held)
    made = certificate(**{entry.name: getattr(sound, entry.name) for entry in dataclasses.fields(sound)})
    raw: Planner = flight_planner(config, mission, bound)
    within = ConstantVelocityStart(raw) if predicted else raw
    fallback = partial(StopAndHover, period=raw.period)
    worst = mission.quality.worst(mission.gust)
    return certified(within, fallback, made, bound, mission.deadline_factor, worst, mission.start_state), tracker


class BlindCertificate(Certificate):
    """A certificate that does not ask for clearance, only for a plan over the map."""

    def check_clearance(self, plan: Plan) -> Refusal | None:
        return Certificate.check_clearance(dataclasses.replace(self, clearance_min=-HIGHEST), plan)


class NoClearanceCheck:
    """Flies plans however low they are."""

    Config = FlightConfig
    certified = False

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Parts:
        """Return the planner of a mission, and the tracker of its plans."""
        return _parts(config, mission, tracking_bound(config.bandwidth, mission), certificate=BlindCertificate)


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


class NoStartCheck:
    """Flies plans wherever they start."""

    Config = FlightConfig
    certified = False

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Parts:
        """Return the planner of a mission, and the tracker of its plans."""
        bound = tracking_bound(config.bandwidth, mission)
        return _parts(config, mission, bound, certified=CertifiedFromAnywhere, predicted=True)


@configuration
class LateConfig(FlightConfig):
    """Fields of ``--planner``."""

    late_every: Count = 4
    """one of so many plans is late"""
    lateness: Annotated[float, Interval(ge=0.0, le=2.0), FINITE] = 0.1
    """how late it is [s]"""


class CertifiedTooEarly(Certified):
    """Certifies plans for when they were asked for; one in ``every`` is ``lateness`` [s] late, and begins then."""

    every = LateConfig.late_every
    lateness = LateConfig.lateness
    _asked = 0

    def plan(self, request: PlanRequest) -> Plan:
        """The plan, later than it was certified for if it is one of those that are late."""
        plan = super().plan(request)
        self._asked += 1
        if not plan.ok or request.current is None or self._asked % self.every:
            return plan
        return dataclasses.replace(plan, t=plan.t + self.lateness)


class LatePlansFlown:
    """Flies plans that are ready after their start."""

    Config = LateConfig
    certified = False

    @staticmethod
    def build(config: LateConfig, mission: FlightMission) -> Parts:
        """Return the planner of a mission, and the tracker of its plans."""
        bound = tracking_bound(config.bandwidth, mission)
        planner, tracker = _parts(config, mission, bound, certified=CertifiedTooEarly)
        assert isinstance(planner, CertifiedTooEarly)
        planner.every, planner.lateness = config.late_every, config.lateness
        return planner, tracker


class HalvedBound:
    """Certifies plans for half of what the tracker may be beside them."""

    Config = FlightConfig
    certified = False

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Parts:
        """Return the planner of a mission, and the tracker of its plans."""
        whole = tracking_bound(config.bandwidth, mission)
        held = None if whole.held is None else 0.5 * whole.held
        half = TrackingBound(
            0.5 * whole.horizontal, 0.5 * whole.vertical, 0.5 * whole.speed, 0.5 * whole.feedback, held
        )
        return _parts(config, mission, half)
