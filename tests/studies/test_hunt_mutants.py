"""Each mutant of the study ``hunt`` lacks the check that it is named after, which the product has."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.flight.certificate import Certificate, remainder
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.guarantee import GuaranteeState
from mathnavi.controllers.flight.planner import StopAndHover
from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.controllers.flight.tracker import tracking_bound
from mathnavi.interfaces.signals import Estimate, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import DeclaredGusts, FlightMission
from mathnavi.models.aerial.plan_status import FlightStatus
from mathnavi.sim.search.space import drawn
from mathnavi.studies.flight.guarantee_holes import (
    BlindCertificate,
    CertifiedFromAnywhere,
    CertifiedTooEarly,
    ConstantVelocityStart,
    HalvedBound,
    LatePlansFlown,
    NoClearanceCheck,
    NoStartCheck,
)
from mathnavi.studies.flight.hunt_spaces import HOLES, HoledHunt
from tests.flight import mission

CONFIG = FlightConfig()


@pytest.fixture(scope="module")
def flight() -> FlightMission:
    return mission(gust=DeclaredGusts(1.0, 3.0, 4.0), position_noise=1.0)


@pytest.fixture(scope="module")
def certificate(flight: FlightMission) -> Certificate:
    return Certificate.for_mission(flight, tracking_bound(CONFIG.bandwidth, flight))


@pytest.fixture(scope="module")
def plan(flight: FlightMission, certificate: Certificate) -> Plan:
    """A certified plan from the start."""
    made = StopAndHover(certificate, 5.0 / 3.0).plan(PlanRequest(0.0, 0.0, Estimate(0.0, flight.start_state), None))
    assert certificate.check(made) is None
    return made


class Answers:
    """A planner with one answer; it keeps what it was asked."""

    period = 5.0 / 3.0

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self.request: Any = None

    def plan(self, request: PlanRequest) -> Plan:
        self.request = request
        return self._plan


@pytest.mark.parametrize("mutant", [NoClearanceCheck, NoStartCheck, LatePlansFlown, HalvedBound])
def test_every_mutant_begins_at_the_start_and_doubts_a_lost_estimate(mutant: Any, flight: FlightMission) -> None:
    raw, tracker = mutant.build(mutant.Config(grid_nodes=5), flight)
    planner = getattr(mutant, "certifier", Certified.for_mission)(raw, flight, tracker)
    planner._planner = Answers(Plan.failure(Status.SOLVER_FAILED))
    beside = Estimate(0.0, flight.start_state + np.array([0.01, 0.01, -0.01, 0.0, 0.0, 0.0]))
    first = planner.plan(PlanRequest(0.0, 0.0, beside, None))
    assert first.x[0].tolist() == flight.start_state.tolist()
    uncertain = dataclasses.replace(beside, covariance=np.eye(6) * 1e4)
    assert planner.monitor(PlanRequest(0.1, 2.0, uncertain, first)) is None
    assert planner.guarantee.state is GuaranteeState.LOST


def test_one_certificate_does_not_see_the_ground(certificate: Certificate, plan: Plan) -> None:
    higher = dataclasses.replace(certificate, clearance_min=1e3)
    blind = BlindCertificate(**{entry.name: getattr(higher, entry.name) for entry in dataclasses.fields(higher)})
    refused = higher.check(plan)
    assert refused is not None
    assert refused.status is FlightStatus.LOW_CLEARANCE
    assert blind.check(plan) is None
    outside = dataclasses.replace(plan, x=plan.x + np.array([0.0, 1e6, 0.0, 0.0, 0.0, 0.0]))
    assert blind.check_clearance(outside) is not None


@pytest.mark.parametrize(("kind", "flown"), [(Certified, False), (CertifiedFromAnywhere, True)])
def test_one_certified_planner_starts_anywhere(
    kind: type[Certified], flown: bool, flight: FlightMission, certificate: Certificate, plan: Plan
) -> None:
    t, period = 1.0, Answers.period
    behind = dataclasses.replace(plan, t=plan.t + t + period)  # where the vehicle was at the beginning
    bound = tracking_bound(CONFIG.bandwidth, flight)
    planner = kind(Answers(behind), lambda made: StopAndHover(made, period), certificate, bound, 1.3)
    answer = planner.plan(PlanRequest(t, t + period, Estimate(t, state_at(plan, t)), plan))
    assert answer.ok is flown
    assert flown or answer.status is FlightStatus.WRONG_START


def test_one_planner_begins_where_the_vehicle_would_be_at_constant_velocity(plan: Plan) -> None:
    within = Answers(plan)
    x = np.array([1.0, 2.0, 3.0, 10.0, 0.0, -4.0])
    ConstantVelocityStart(within).plan(PlanRequest(4.0, 6.0, Estimate(4.0, x), plan))
    assert within.request.current is None
    assert within.request.estimate.x.tolist() == [21.0, 2.0, -5.0, 10.0, 0.0, -4.0]


def test_one_planner_flies_a_late_plan_from_when_it_is_ready(
    flight: FlightMission, certificate: Certificate, plan: Plan
) -> None:
    t, period = 1.0, Answers.period
    following = remainder(plan, t + period)
    late = dataclasses.replace(following, ready=t + period + 0.3)
    bound = tracking_bound(CONFIG.bandwidth, flight)
    request = PlanRequest(t, t + period, Estimate(t, state_at(plan, t)), plan)
    for answer, begins in ((following, t + period), (late, t + period + 0.3)):
        planner = CertifiedTooEarly(Answers(answer), lambda made: StopAndHover(made, period), certificate, bound, 1.3)
        flown = planner.plan(request)
        assert (flown.ready <= flown.t_start, flown.t_start) == (True, pytest.approx(begins))


def test_one_tracker_declares_half_of_its_bound(flight: FlightMission) -> None:
    whole = tracking_bound(CONFIG.bandwidth, flight)
    _, tracker = HalvedBound.build(CONFIG, flight)
    halves = dataclasses.astuple(tracker.bound)  # type: ignore[attr-defined]
    assert halves == pytest.approx([0.5 * value for value in dataclasses.astuple(whole)])


@pytest.mark.parametrize("holed", HOLES, ids=lambda holed: holed.mutant.name)
def test_what_a_mutant_certifies_is_asked_by_the_loop_as_the_products_is(holed: HoledHunt) -> None:
    """No fault stands between: it would hide the monitor of every control step."""
    middle = [0.45, 0.3, 0.3, 0.6, 0.6, *(0.5 for _ in holed.mutant.space[5:])]
    for hunt in (holed.mutant, holed.product):
        planner = hunt.make(drawn(hunt.space, middle)).build().agents["vehicle"].planner
        assert isinstance(planner, Certified)
