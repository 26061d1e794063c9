"""The certificate refuses everything that may not be flown, for the right reason, and nothing else."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pytest

from mathnavi.controllers.flight.certificate import Certificate, TrackingBound, pass_time, remainder
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.completion import ArcList, complete
from mathnavi.controllers.flight.guarantee import GuaranteeState
from mathnavi.controllers.flight.held_input import NO_LAG, HeldInput
from mathnavi.controllers.flight.planner import StopAndHover, complete_by
from mathnavi.interfaces.signals import Array, Estimate, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from tests import flight

BOUND = TrackingBound(2.0, 3.0, 1.0, 2.0)
PERIOD = 2.0  # [s]


@pytest.fixture(scope="module")
def mission() -> FlightMission:
    return flight.mission()


@pytest.fixture(scope="module")
def certificate(mission: FlightMission) -> Certificate:
    return Certificate.for_mission(mission, BOUND)


@pytest.fixture(scope="module")
def good(certificate: Certificate, mission: FlightMission) -> Plan:
    """A plan that is certified: by completion, from the start at t = 0."""
    return StopAndHover(certificate, PERIOD).plan(first_request(mission))


def first_request(mission: FlightMission) -> PlanRequest:
    return PlanRequest(0.0, 0.0, Estimate(0.0, flight.at_rest(mission.start)), None)


def later_request(good: Plan, t: float = 10.0) -> PlanRequest:
    return PlanRequest(t, t + PERIOD, Estimate(t, state_at(good, t)), good)


def with_nan(array: Array) -> Array:
    out = array.copy()
    out.flat[out.size // 2] = np.nan
    return out


def straight_through(certificate: Certificate, good: Plan) -> Plan:
    """From rest to rest along the straight line to the target, through the mountain."""
    arcs = ArcList.begin(0.0, good.x[0])
    way = certificate.target - good.x[0, :3]
    duration = 2.0 * float(np.linalg.norm(way)) / 250.0  # 250 m/s half-way
    for sign in (1.0, -1.0):
        arcs.add(sign * 4.0 * way / duration**2, 0.5 * duration, FlightPhase.CRUISE)
    arcs.rest()
    return arcs.plan(0.0, 0.0)


def over_the_edge(certificate: Certificate, good: Plan) -> Plan:
    """Off the map and back, and then the good way on."""
    arcs = ArcList.begin(0.0, good.x[0])
    for sign in (-1.0, 1.0, 1.0, -1.0):
        arcs.add(sign * np.array([30.0, 0.0, 0.0]), 8.0, FlightPhase.CRUISE)
    arcs.rest()
    complete_by(arcs, certificate)
    return arcs.plan(0.0, 0.0)


def pushed(certificate: Certificate, good: Plan, way: Array) -> Plan:
    """There and back on a straight line, a little harder than is allowed, and then the good way on."""
    arcs = ArcList.begin(0.0, good.x[0])
    for sign in (1.0, -1.0, -1.0, 1.0):
        arcs.add(sign * 1.01 * certificate.acceleration_max * way, 1.0, FlightPhase.CRUISE)
    arcs.rest()
    complete_by(arcs, certificate)
    return arcs.plan(0.0, 0.0)


def scaled(good: Plan, factor: float) -> Plan:
    """The same path flown ``factor`` times as fast."""
    x = good.x.copy()
    x[:, 3:] *= factor
    return dataclasses.replace(good, t=good.t / factor, x=x, u=good.u * factor**2)


def shifted(good: Plan, offset: Array) -> Plan:
    return dataclasses.replace(good, x=good.x + offset)


def jumping(plan: Plan, k: int, offset: Array) -> Plan:
    """The plan with one of its states elsewhere."""
    x = plan.x.copy()
    x[k] += offset
    return dataclasses.replace(plan, x=x)


def backwards(plan: Plan) -> Plan:
    t = plan.t.copy()
    t[1], t[2] = t[2], t[1]
    return dataclasses.replace(plan, t=t)


BAD: dict[str, tuple[Status, Callable[[Certificate, Plan], Plan]]] = {
    "no arcs": (Status.MALFORMED, lambda c, p: Plan(p.t[:1], p.x[:1], p.u[:0], p.phase[:0])),
    "empty": (Status.MALFORMED, lambda c, p: Plan(p.t[:0], p.x[:0], p.u[:0], p.phase[:0])),
    "an input too few": (Status.MALFORMED, lambda c, p: dataclasses.replace(p, u=p.u[:-1])),
    "a phase too few": (Status.MALFORMED, lambda c, p: dataclasses.replace(p, phase=p.phase[:-1])),
    "a phase that does not exist": (Status.MALFORMED, lambda c, p: dataclasses.replace(p, phase=p.phase + 99)),
    "states of the wrong width": (Status.MALFORMED, lambda c, p: dataclasses.replace(p, x=p.x[:, :5])),
    "time runs backwards": (Status.MALFORMED, lambda c, p: backwards(p)),
    "a jump of the position": (Status.MALFORMED, lambda c, p: jumping(p, 0, np.array([1e-3, 0.0, 0.0, 0.0, 0.0, 0.0]))),
    "a jump of the speed": (Status.MALFORMED, lambda c, p: jumping(p, -1, np.array([0.0, 0.0, 0.0, 0.0, 1e-3, 0.0]))),
    "an arc beyond all measure": (
        Status.MALFORMED,
        lambda c, p: dataclasses.replace(p, t=np.append(p.t[:-1], 1e300)),
    ),
    "a NaN among the states": (Status.NOT_FINITE, lambda c, p: dataclasses.replace(p, x=with_nan(p.x))),
    "a NaN among the inputs": (Status.NOT_FINITE, lambda c, p: dataclasses.replace(p, u=with_nan(p.u))),
    "a NaN among the times": (Status.NOT_FINITE, lambda c, p: dataclasses.replace(p, t=with_nan(p.t))),
    "never ends": (Status.NOT_FINITE, lambda c, p: dataclasses.replace(p, t=np.append(p.t[:-1], np.inf))),
    "through the mountain": (FlightStatus.LOW_CLEARANCE, straight_through),
    "a little too low": (FlightStatus.LOW_CLEARANCE, lambda c, p: shifted(p, np.array([0, 0, -45.0, 0, 0, 0]))),
    "over the edge of the map": (FlightStatus.OFF_MAP, over_the_edge),
    "too fast": (FlightStatus.BOUNDS, lambda c, p: scaled(p, 1.01)),
    "pushed too hard across": (FlightStatus.BOUNDS, lambda c, p: pushed(c, p, np.array([0.6, 0.8, 0.0]))),
    "pushed too hard upwards": (FlightStatus.BOUNDS, lambda c, p: pushed(c, p, np.array([0.0, 0.0, 1.0]))),
    "beside the target": (FlightStatus.NO_ARRIVAL, lambda c, p: shifted(p, np.array([60.0, 0, 500.0, 0, 0, 0]))),
    "only half of the way": (
        FlightStatus.NO_ARRIVAL,
        lambda c, p: dataclasses.replace(p, t=p.t[:4], x=p.x[:4], u=p.u[:3], phase=p.phase[:3]),
    ),
    "does not stop": (
        FlightStatus.NO_ARRIVAL,
        lambda c, p: dataclasses.replace(p, t=p.t[:-1], x=p.x[:-1], u=p.u[:-1], phase=p.phase[:-1]),
    ),
}


def test_what_may_be_flown_is_certified(certificate: Certificate, good: Plan) -> None:
    assert certificate.check(good) is None


@pytest.mark.parametrize("name", BAD)
def test_what_may_not_be_flown_is_refused_for_the_right_reason(name: str, certificate: Certificate, good: Plan) -> None:
    status, spoil = BAD[name]
    refusal = certificate.check(spoil(certificate, good))
    assert refusal is not None
    assert refusal.status is status, refusal.message
    assert refusal.message


def test_the_clearance_is_exact_not_sampled(certificate: Certificate, mission: FlightMission, good: Plan) -> None:
    raised = certificate.terrain.path_clearance(good.x[:-1, :3], good.x[:-1, 3:], good.u, np.diff(good.t)).min()
    for margin, status in ((1e-6, None), (-1e-6, FlightStatus.LOW_CLEARANCE)):
        demanding = dataclasses.replace(certificate, clearance_min=float(raised) - margin)
        refusal = demanding.check(good)
        assert (refusal.status if refusal else None) is status


def test_the_bounds_left_to_a_plan_are_the_missions_less_the_trackers(
    certificate: Certificate, mission: FlightMission
) -> None:
    assert certificate.speed_max == mission.speed_max - BOUND.speed
    assert certificate.acceleration_max == mission.acceleration_max - BOUND.feedback
    assert (certificate.terrain.z >= mission.terrain.z + BOUND.vertical).all()


@pytest.mark.parametrize(
    ("name", "bound"),
    [
        ("speed_max", TrackingBound(1.0, 1.0, 300.0, 1.0)),
        ("acceleration_max", TrackingBound(1.0, 1.0, 1.0, 41.0)),
        ("arrival_radius", TrackingBound(40.0, 40.0, 1.0, 1.0)),
    ],
)
def test_a_tracker_that_needs_everything_is_refused(name: str, bound: TrackingBound, mission: FlightMission) -> None:
    with pytest.raises(ValueError, match=f"{name} = .* leaves nothing"):
        Certificate.for_mission(mission, bound)


def test_a_pass_is_the_first_breakpoint_at_the_target(certificate: Certificate, good: Plan) -> None:
    assert pass_time(good, certificate.target, 0.0) == good.t_end
    assert pass_time(good, certificate.target, good.t_end) == math.inf


def test_what_remains_of_a_plan_at_its_end_is_a_second_of_rest(certificate: Certificate, good: Plan) -> None:
    rest = remainder(good, good.t_end + 5.0)
    assert certificate.check(rest) is None
    assert rest.t.tolist() == [good.t_end + 5.0, good.t_end + 6.0]
    np.testing.assert_array_equal(rest.x, good.x[[-1, -1]])


class Answers:
    """A planner that always gives the same answer, or raises it."""

    period = PERIOD

    def __init__(self, answer: Plan | Exception) -> None:
        self.answer = answer

    def plan(self, request: PlanRequest) -> Plan:
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


def certified(certificate: Certificate, planner: Answers, factor: float = 1.3) -> Certified:
    return Certified(planner, partial(StopAndHover, period=PERIOD), certificate, BOUND, factor)


def moved(plan: Plan, seconds: float) -> Plan:
    return dataclasses.replace(plan, t=plan.t + seconds)


def braking_plan(certificate: Certificate, good: Plan, wait: float = 0.0) -> Plan:
    """A possible answer to ``later_request``: brake, wait, complete."""
    request = later_request(good)
    arcs = ArcList.begin(request.t_start, state_at(good, request.t_start))
    v = arcs.x[-1][3:]
    arcs.add(-v / 10.0, 10.0, FlightPhase.MANOEUVRE)
    arcs.rest()
    arcs.add(np.zeros(3), wait, FlightPhase.HOVER)
    complete_by(arcs, certificate)
    return arcs.plan(0.0, 0.0)


def test_the_first_plan_sets_the_deadline(certificate: Certificate, good: Plan, mission: FlightMission) -> None:
    wrapped = certified(certificate, Answers(good))
    plan = wrapped.plan(first_request(mission))
    np.testing.assert_array_equal(plan.x, good.x)
    assert wrapped.deadline == pytest.approx(1.3 * good.t_end)


def test_a_certified_answer_is_passed_on(certificate: Certificate, good: Plan, mission: FlightMission) -> None:
    planner = Answers(good)
    wrapped = certified(certificate, planner)
    wrapped.plan(first_request(mission))
    planner.answer = braking_plan(certificate, good)
    plan = wrapped.plan(later_request(good))
    assert plan.ok, plan.message


def test_a_plan_cannot_be_changed_once_it_is_certified(
    certificate: Certificate, good: Plan, mission: FlightMission
) -> None:
    answer = dataclasses.replace(good, x=good.x.copy())
    plan = certified(certificate, Answers(answer)).plan(first_request(mission))
    answer.x[1:, 2] -= 2000.0
    np.testing.assert_array_equal(plan.x, good.x)
    with pytest.raises(ValueError, match="read-only"):
        plan.x[1:, 2] -= 2000.0


@pytest.mark.parametrize("replanned", [True, False])
def test_a_pass_after_which_the_mission_goes_on_is_missed_once_and_never_shortens_the_time(
    certificate: Certificate, mission: FlightMission, replanned: bool
) -> None:
    beyond = certificate.target + np.array([-400.0, -400.0, 1000.0])  # a go-around
    arcs = ArcList.begin(0.0, flight.at_rest(mission.start))
    complete_by(arcs, certificate)
    there = arcs.t[-1]
    complete(arcs, certificate.terrain, beyond, certificate.clearance_min, 200.0, 20.0)
    complete_by(arcs, certificate)
    plan = arcs.plan(0.0, 0.0)
    planner = Answers(plan)
    wrapped = certified(certificate, planner)
    current, missed = wrapped.plan(first_request(mission)), []
    for t in np.arange(0.0, there + 3.0 * planner.period, planner.period):
        request = PlanRequest(t, t + planner.period, Estimate(t, state_at(plan, t)), current)
        k = int(np.searchsorted(plan.t, request.t_start, side="right")) - 1  # the remaining plan, the pass cut off
        begun = state_at(plan, request.t_start)
        rest = dataclasses.replace(
            plan,
            t=np.append(request.t_start, plan.t[k + 1 :]),
            x=np.vstack([begun, plan.x[k + 1 :]]),
            u=plan.u[k:],
            phase=plan.phase[k:],
        )
        planner.answer = rest if replanned else Plan.failure(Status.SOLVER_FAILED)
        deadline, answer = wrapped.deadline, wrapped.plan(request)
        if "missed-pass" in answer.notes:
            missed.append(t)
            assert wrapped.deadline >= deadline
        current = answer if answer.ok else current
    assert len(missed) == 1
    assert there < missed[0] <= there + planner.period


@pytest.mark.parametrize("side", ["west", "east"])
def test_a_plan_along_the_edge_of_the_map_leaves_the_tracker_room(mission: FlightMission, side: str) -> None:
    bound = TrackingBound(5.0, 5.0, 1.0, 1.0)
    for inside, status in ((5.5, None), (4.5, FlightStatus.OFF_MAP)):
        x = inside if side == "west" else mission.terrain.width - inside
        ends = [flight.above(mission.terrain, (x, y), 300.0) for y in (1500.0, 9000.0)]
        edge = dataclasses.replace(mission, start=ends[0], target=ends[1])
        certificate = Certificate.for_mission(edge, bound)
        arcs = ArcList.begin(0.0, flight.at_rest(edge.start))
        complete_by(arcs, certificate)
        refusal = certificate.check(arcs.plan(0.0, 0.0))
        assert (refusal.status if refusal else None) is status


def test_an_error_that_is_not_a_number_breaks_the_bound() -> None:
    bound = TrackingBound(5.0, 5.0, 1.0, 1.0)
    assert not bound.broken_by(np.zeros(6))
    assert bound.broken_by(np.full(6, np.nan))


ANSWERS: dict[str, tuple[Status, Callable[[Certificate, Plan], Plan | Exception]]] = {
    "fails": (Status.SOLVER_FAILED, lambda c, p: Plan.failure(Status.SOLVER_FAILED, "no")),
    "raises": (Status.RAISED, lambda c, p: ZeroDivisionError("division by zero")),
    "starts too early": (FlightStatus.WRONG_START, lambda c, p: moved(braking_plan(c, p), -0.5)),
    "starts beside the plan": (
        FlightStatus.WRONG_START,
        lambda c, p: shifted(braking_plan(c, p), np.array([1e-3, 0.0, 0.0, 0.0, 0.0, 0.0])),
    ),
    "leads through the mountain": (FlightStatus.LOW_CLEARANCE, straight_through),
    "comes to the target after the deadline": (FlightStatus.DEADLINE, lambda c, p: braking_plan(c, p, wait=p.t_end)),
    "is NaN": (
        Status.NOT_FINITE,
        lambda c, p: dataclasses.replace(braking_plan(c, p), x=with_nan(braking_plan(c, p).x)),
    ),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_that_may_not_be_flown_becomes_a_failure_that_says_why(
    name: str, certificate: Certificate, good: Plan, mission: FlightMission
) -> None:
    status, answer = ANSWERS[name]
    planner = Answers(good)
    wrapped = certified(certificate, planner)
    wrapped.plan(first_request(mission))
    planner.answer = answer(certificate, good)
    plan = wrapped.plan(later_request(good))
    assert plan.status is status, plan.message
    assert plan.message


@pytest.mark.parametrize("name", ANSWERS)
def test_a_first_answer_that_may_not_be_flown_is_replaced_by_the_fallback_plan(
    name: str, certificate: Certificate, good: Plan, mission: FlightMission
) -> None:
    if name == "comes to the target after the deadline":
        return  # at the start there is none yet
    plan = certified(certificate, Answers(ANSWERS[name][1](certificate, good))).plan(first_request(mission))
    assert plan.ok
    assert plan.notes == ("fallback-plan",)
    assert certificate.check(plan) is None


def test_a_first_answer_that_is_late_is_replaced_by_the_fallback_plan(
    certificate: Certificate, good: Plan, mission: FlightMission
) -> None:
    plan = certified(certificate, Answers(dataclasses.replace(good, ready=0.5))).plan(first_request(mission))
    assert plan.ok
    assert plan.ready <= plan.t_start
    assert plan.notes == ("fallback-plan",)


def test_a_vehicle_off_its_plan_is_planned_for_from_where_it_is(
    certificate: Certificate, good: Plan, mission: FlightMission
) -> None:
    wrapped = certified(certificate, Answers(good), factor=1.0)
    wrapped.plan(first_request(mission))
    request = later_request(good, 30.0)  # at full speed: to stop costs time
    x = request.estimate.x + np.array([30.0, 0.0, 10.0, 0.0, 0.0, 0.0])
    plan = wrapped.plan(dataclasses.replace(request, estimate=Estimate(request.t, x)))
    assert plan.ok
    assert {"tracking-breach", "deadline-lost", "rebased"} <= set(plan.notes)
    assert wrapped.deadline == plan.t_end > good.t_end
    assert plan.t_start == request.t
    np.testing.assert_array_equal(plan.x[0], x)
    assert certificate.check(plan) is None


def test_a_vehicle_off_its_plan_without_a_way_on_is_a_loss_that_is_announced(
    certificate: Certificate, good: Plan, mission: FlightMission
) -> None:
    wrapped = certified(certificate, Answers(good))
    wrapped.plan(first_request(mission))
    request = later_request(good)
    under_ground = np.array([*flight.above(mission.terrain, flight.START, -100.0), 0.0, 0.0, 0.0])
    plan = wrapped.plan(dataclasses.replace(request, estimate=Estimate(request.t, under_ground)))
    assert not plan.ok
    assert plan.notes == ("tracking-breach",)
    assert wrapped.guarantee.state is GuaranteeState.LOST


def test_the_loss_of_an_estimate_is_announced_once_and_its_return_too(
    certificate: Certificate, good: Plan, mission: FlightMission
) -> None:
    wrapped = certified(certificate, Answers(good))
    wrapped.plan(first_request(mission))

    def lost(t: float) -> PlanRequest:
        request = later_request(good, t)
        return dataclasses.replace(request, estimate=dataclasses.replace(request.estimate, status=Status.LOST))

    assert wrapped.events() == [("guarantee-held", "a certified plan is flown within its tracking bound")]
    assert wrapped.monitor(lost(3.0)) is None
    assert wrapped.events() == [("guarantee-lost", Status.LOST.value)]
    assert wrapped.monitor(lost(3.1)) is None
    assert not wrapped.events()
    for step, t, state in (
        (wrapped.plan, 4.0, GuaranteeState.HELD), (wrapped.plan, 6.0, GuaranteeState.LOST),
        (wrapped.monitor, 6.1, GuaranteeState.HELD),
    ):  # fmt: skip
        step(lost(t) if state is GuaranteeState.LOST else later_request(good, t))
        assert [kind for kind, _ in wrapped.events()] == [f"guarantee-{state.value}"]


@dataclass(frozen=True)
class Counts(HeldInput):
    """A held input whose lag is the time [s] over which it was carried on."""

    lags: list[float] = field(default_factory=list)

    def after(self, plan: Plan, lag: Array, begin: float, end: float) -> Array:
        return lag + (end - begin)

    def greatest(self, plan: Plan, lag: Array = NO_LAG) -> float:
        self.lags.append(float(lag[0]))
        return 0.0


def test_a_lag_is_carried_on_to_a_plan_that_starts_on_the_last_one(
    certificate: Certificate, good: Plan, mission: FlightMission
) -> None:
    held = Counts(0.1, 1.0, math.inf)
    planner = Answers(good)
    wrapped = certified(dataclasses.replace(certificate, held=held), planner)
    wrapped.plan(first_request(mission))
    planner.answer = onward = braking_plan(certificate, good)
    wrapped.plan(later_request(good))
    for current in (onward, shifted(onward, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]))):
        wrapped.plan(later_request(current, 14.0))
    assert held.lags == pytest.approx([0.0, 12.0, 16.0, 4.0])


def test_a_deadline_before_the_first_arrival_is_refused(certificate: Certificate, good: Plan) -> None:
    with pytest.raises(ValueError, match="deadline_factor"):
        certified(certificate, Answers(good), factor=0.9)
