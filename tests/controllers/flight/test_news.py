"""Messages in flight: the guarantee is kept, or its loss announced, at every planning instant."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mathnavi.controllers.flight.certificate import Certificate, remainder
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.guarantee import GuaranteeState
from mathnavi.controllers.flight.planner import StopAndHover
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.estimators.full_state import FullState, FullStateConfig
from mathnavi.interfaces.signals import Estimate, Message, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.knowledge import RADARS, TARGET, TERRAIN
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.hill import Hill, with_hills
from mathnavi.models.terrain.visibility import Radar
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.metrics.flight import flown_clearance
from tests import flight

DT = 1.0 / 30.0  # [s] tick of the vehicle without MuJoCo
MISSION = flight.mission(control_period=DT)
BOUND = tracking_bound(0.8, MISSION)
CERTIFICATE = Certificate.for_mission(MISSION, BOUND)
FACTOR = 1.3


class Watched:
    """Asks the certified planner, and holds it to what it says of the map as it is known."""

    def __init__(self, planner: Certified) -> None:
        self.period = planner.period
        self.planner, self.events, self._certificate = planner, planner.events, CERTIFICATE
        self.broken: list[str] = []  # the loop would take an assertion for a planner's bug

    def plan(self, request: PlanRequest) -> Plan:
        answer = self.planner.plan(request)
        self._examine(request, answer)
        return answer

    def monitor(self, request: PlanRequest) -> Plan | None:
        answer = self.planner.monitor(request)
        if request.messages:  # without news nothing is announced again
            self._examine(request, answer)
        return answer

    def _examine(self, request: PlanRequest, answer: Plan | None) -> None:
        self._certificate = self._certificate.updated_with(request.messages)
        if request.current is None:
            return
        at_once = answer is not None and answer.ok and answer.t_start <= request.t
        flown = answer if at_once and answer is not None else remainder(request.current, request.t)
        danger, state = self._certificate.check_clearance(flown), self.planner.guarantee.state
        if (danger is not None) != (state is GuaranteeState.LOST):
            self.broken.append(f"at {request.t:.2f} s {danger}, and {state}")


def flown(news: Sequence[Message], ground: HeightField = MISSION.terrain) -> tuple[Recording, Watched, list[str]]:
    """The flight of a vehicle that receives ``news``, until it arrives, hits ``ground``, or for five minutes."""
    raw, _ = FlightController.build(FlightConfig(nodes=7), MISSION)
    planner = Certified(raw, partial(StopAndHover, period=raw.period), CERTIFICATE, BOUND, FACTOR)
    watched = Watched(planner)
    agent = Agent(FullState(FullStateConfig(), MISSION), watched, CriticallyDamped(DT, 0.8, BOUND), messages=news)
    targets = [message.payload for message in news if message.topic == TARGET]
    last = max((message.t for message in news), default=0.0)
    target = np.array(targets[-1] if targets else MISSION.target)

    def finished(t: float, truths: dict[str, np.ndarray]) -> bool:
        x, y, z = truths["vehicle"][:3]
        arrived = np.linalg.norm(truths["vehicle"][:3] - target) <= MISSION.arrival_radius and t > last
        return bool(arrived) or not z > float(ground.height(x, y))

    recording = simulate(
        flight.PointMass(flight.at_rest(MISSION.start), DT),
        {"vehicle": agent},
        300.0,
        finished,  # type: ignore[arg-type]
    )
    return recording, watched, kinds(recording)


def kinds(recording: Recording) -> list[str]:
    """Kinds of events, without the name of the planner of this test that passed them on."""
    return [event.kind.removeprefix("Watched: ") for event in recording.events]


def arrives(recording: Recording, target: Sequence[float]) -> bool:
    return math.dist(recording.truths["vehicle"][-1, :3].tolist(), target) <= MISSION.arrival_radius


def hill_ahead(share: float, radius: float, height: float) -> HeightField:
    """The ground with a hill on the straight line to the target, at a share of its length."""
    (x, y, _), (x_f, y_f, _) = MISSION.start, MISSION.target
    return with_hills(MISSION.terrain, (Hill(x + share * (x_f - x), y + share * (y_f - y), radius, height),))


@given(
    share=st.floats(0.15, 0.8), radius=st.floats(600.0, 2500.0), height=st.floats(100.0, 1500.0), t=st.floats(0.0, 35.0)
)
@settings(max_examples=8, deadline=None)
@example(share=0.5, radius=1500.0, height=900.0, t=0.0)
@example(share=0.5, radius=800.0, height=1200.0, t=14.9)
def test_over_a_map_that_was_wrong_the_vehicle_is_safe_or_says_that_it_is_not(
    share: float, radius: float, height: float, t: float
) -> None:
    ground = hill_ahead(share, radius, height)
    recording, watched, said = flown([Message(t, "survey", TERRAIN, ground)], ground)
    assert not watched.broken
    updated = recording.t >= t
    clear = flown_clearance(recording.t, recording.truths["vehicle"], dataclasses.replace(MISSION, terrain=ground))
    if "guarantee-lost" not in said and arrives(recording, MISSION.target):
        assert clear[updated[:-1]].min() >= MISSION.clearance_min
    assert arrives(recording, MISSION.target) or "guarantee-lost" in said or not updated[-1]


def test_a_hill_in_the_way_that_is_known_in_time_is_flown_around() -> None:
    ground = hill_ahead(0.5, 2000.0, 1200.0)
    recording, watched, said = flown([Message(10.0, "survey", TERRAIN, ground)], ground)
    assert not watched.broken
    assert "plan-endangered" in said
    assert "guarantee-lost" not in said
    assert arrives(recording, MISSION.target)
    mission = dataclasses.replace(MISSION, terrain=ground)
    assert flown_clearance(recording.t, recording.truths["vehicle"], mission).min() >= MISSION.clearance_min


def test_a_map_that_was_wrong_is_checked_as_soon_as_the_correction_arrives() -> None:
    """Between two planning instants; what was to take over at the next one does not."""
    ground = hill_ahead(0.5, 1500.0, 1200.0)
    for t in (15.2, 16.1):  # [s] planning instants are 15 and 16.67
        recording, watched, _ = flown([Message(t, "survey", TERRAIN, ground)], ground)
        assert not watched.broken
        endangered = [
            event.t for event, kind in zip(recording.events, kinds(recording), strict=True) if kind == "plan-endangered"
        ]
        assert endangered[0] == pytest.approx(t, abs=DT)
        taken = [(at, plan) for at, plan in recording.agents["vehicle"].plans if at >= t - DT]
        assert taken[0][0] == pytest.approx(endangered[0])
        for (_, before), (at, after) in pairwise(taken):
            np.testing.assert_allclose(after.x[0], state_at(before, at), atol=1e-6)


def test_ground_that_is_higher_elsewhere_changes_nothing_of_the_guarantee() -> None:
    elsewhere = with_hills(MISSION.terrain, (Hill(10_500.0, 1500.0, 1000.0, 500.0),))
    _, watched, said = flown([Message(10.0, "survey", TERRAIN, elsewhere)], elsewhere)
    assert not watched.broken
    assert {"plan-endangered", "guarantee-lost", "rebased"}.isdisjoint(said)


def test_a_target_that_moves_is_followed_and_moves_the_deadline() -> None:
    beyond = flight.above(MISSION.terrain, (2000.0, 9000.0), 150.0)
    recording, watched, said = flown([Message(20.0, "watch", TARGET, beyond)])
    assert not watched.broken
    assert arrives(recording, beyond)
    assert "guarantee-lost" not in said
    assert flown_clearance(recording.t, recording.truths["vehicle"], MISSION).min() >= MISSION.clearance_min


def certified(*answers: Plan | None) -> tuple[Certified, Plan]:
    """A planner that answers from a list, None for its own answer, and the first plan."""

    class Listed:
        def __init__(self) -> None:
            self.planner, _ = FlightController.build(FlightConfig(nodes=7), MISSION)
            self.period, self.answers = self.planner.period, list(answers)

        def plan(self, request: PlanRequest) -> Plan:
            plan = self.planner.plan(request)
            answer = self.answers.pop(0) if request.current is not None and self.answers else None
            return plan if answer is None else answer

    listed = Listed()
    planner = Certified(listed, partial(StopAndHover, period=listed.period), CERTIFICATE, BOUND, FACTOR)
    first = PlanRequest(0.0, 0.0, Estimate(0.0, flight.at_rest(MISSION.start)), None)
    return planner, planner.plan(first)


def asked(planner: Certified, current: Plan, t: float, *news: Message) -> Plan:
    estimate = Estimate(t, state_at(current, t))
    return planner.plan(PlanRequest(t, t + planner.period, estimate, current, news))


def test_a_target_without_a_plan_to_it_is_announced_once_and_so_is_its_return() -> None:
    nothing = Plan.failure(Status.SOLVER_FAILED, "no solution")
    planner, current = certified(None, nothing, nothing, None)
    h = planner.period
    moved = Message(h, "watch", TARGET, flight.above(MISSION.terrain, (2000.0, 9000.0), 150.0))
    assert asked(planner, current, h).ok
    assert asked(planner, current, 2 * h, moved).notes == ("arrival-lost",)
    assert asked(planner, current, 3 * h).notes == ()
    before = planner.deadline
    following = asked(planner, current, 4 * h)
    assert following.ok
    assert planner.deadline == before  # it has not taken over yet
    notes = asked(planner, following, 5 * h).notes
    assert "arrival-regained" in notes
    assert ("deadline-moved" in notes) == (following.t_end > before)
    assert following.t_end <= planner.deadline == planner.promised


def test_a_plan_that_does_not_take_over_is_none() -> None:
    """Whoever did not let it: the deadline stays, and the loss is announced."""
    planner, current = certified()
    h, before = planner.period, planner.deadline
    moved = Message(h, "watch", TARGET, flight.above(MISSION.terrain, (2000.0, 9000.0), 150.0))
    assert asked(planner, current, h, moved).ok
    assert "arrival-lost" in asked(planner, current, 2 * h).notes
    assert "arrival-lost" not in asked(planner, current, 3 * h).notes
    assert planner.deadline == before


@pytest.mark.parametrize("lost", [False, True])
def test_off_its_plan_over_a_wrong_map_it_takes_the_way_with_more_clearance(lost: bool) -> None:
    """Off its bound, or without an estimate, at the instant at which the map changes, and no plan to be had."""
    nothing = [Plan.failure(Status.SOLVER_FAILED, "no solution")] * 9
    tried = 0
    for seconds in np.arange(2.0, 5.0, 0.5):
        planner, current = certified(*nothing)
        t = 6 * planner.period
        x, y, _ = state_at(current, t + seconds)[:3]
        ground = with_hills(MISSION.terrain, (Hill(float(x), float(y), 700.0, 300.0),))
        estimate = Estimate(t, state_at(current, t) + np.array([0.0, 0.0, 0.0 if lost else 100.0, 0.0, 0.0, 0.0]))
        estimate = dataclasses.replace(estimate, status=Status.LOST if lost else Status.OK)
        messages = (Message(t, "survey", TERRAIN, ground),)
        answer = planner.plan(PlanRequest(t, t + planner.period, estimate, current, messages))
        least = CERTIFICATE.updated_with(messages).clearances
        uncertified = planner.guarantee.state is GuaranteeState.LOST
        if answer.ok and uncertified:
            tried += "uncertified-plan" in answer.notes
            assert least(answer).min() > least(remainder(current, t)).min()
        elif not answer.ok:
            assert uncertified
    assert tried > 0 or lost


def test_a_guarantee_that_was_lost_is_regained_when_there_is_a_plan_again() -> None:
    nothing = [Plan.failure(Status.SOLVER_FAILED, "no solution")]
    planner, current = certified(*nothing)
    t = 6 * planner.period
    x, y, _ = state_at(current, t + 2.0)[:3]
    walled = with_hills(MISSION.terrain, (Hill(float(x), float(y), 500.0, 900.0),))
    lost = asked(planner, current, t, Message(t, "survey", TERRAIN, walled))
    assert planner.guarantee.state is GuaranteeState.LOST
    flown = lost if lost.ok else current
    asked(planner, flown, t + planner.period, Message(t, "survey", TERRAIN, MISSION.terrain))
    assert [kind for kind, _ in planner.events()] == ["guarantee-held", "guarantee-lost", "guarantee-held"]


def test_a_map_is_checked_whatever_the_estimate_is_and_a_state_of_another_size_is_a_loss() -> None:
    planner, current = certified()
    t = 6 * planner.period
    x, y, _ = state_at(current, t + 8.0)[:3]
    ground = with_hills(MISSION.terrain, (Hill(float(x), float(y), 900.0, 900.0),))
    messages = (Message(t, "survey", TERRAIN, ground),)
    malformed = planner.plan(PlanRequest(t, t + planner.period, Estimate(t, np.zeros(7)), current, messages))
    assert "plan-endangered" in malformed.notes
    assert planner.guarantee.state is GuaranteeState.LOST
    assert planner.guarantee.reason == "the estimate's state has shape (7,); allowed: (6,)"


def test_messages_that_cannot_be_are_recorded_and_change_nothing() -> None:
    planner, current = certified()
    strange = Message(1.0, "stranger", TARGET, (math.nan, 0.0, 0.0)), Message(1.0, "stranger", RADARS, "many")
    strange += (Message(1.0, "stranger", TARGET, (10**400, 1, 1)),)
    answer = asked(planner, current, planner.period, *strange)
    assert answer.ok
    assert answer.notes[0] == "message-ignored"
    calm, same = certified()
    np.testing.assert_array_equal(answer.x, asked(calm, same, calm.period).x)


def test_radars_appear_move_and_vanish() -> None:
    """The length to go grows where one stands, and is what it was when it has gone."""
    planner, _ = FlightController.build(FlightConfig(nodes=7), MISSION)
    place = np.array([MISSION.start])
    lengths = []
    for radars in ((), (Radar(6000.0, 6000.0, 3000.0, 5.0),), (Radar(11_000.0, 1000.0, 800.0, 5.0),), ()):
        current = planner.plan(
            PlanRequest(
                0.0, 0.0, Estimate(0.0, flight.at_rest(MISSION.start)), None, (Message(0.0, "r", RADARS, radars),)
            )
        )
        assert current.ok
        lengths.append(float(planner.length_to_go(place)[0]))  # type: ignore[attr-defined]
    before, near, elsewhere, after = lengths
    assert near > 1.02 * before
    assert abs(elsewhere / before - 1.0) < 0.01
    assert after == before
