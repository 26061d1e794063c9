"""The loop: whole ticks, plans in time or not at all, failures on record, messages once."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.protocols import Plant, Sensor
from mathnavi.interfaces.signals import (
    OPTIMISED,
    Array,
    Estimate,
    Event,
    Measurement,
    Message,
    Plan,
    PlanRequest,
    Status,
)
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.plan_status import FlightStatus
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.loop import Loop, simulate, whole_ticks
from tests import flight

DT, PERIOD = 0.1, 0.5  # [s]
START = flight.at_rest((0.0, 0.0, 100.0))


@dataclass
class ReadsState:
    """An estimator that notes what it is given."""

    period: float = DT
    calls: list[tuple[float, tuple[Measurement, ...], Array]] = field(default_factory=list)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        self.calls.append((t, tuple(measurements), command.copy()))
        return Estimate(t, measurements[-1].value)


@dataclass
class Answers:
    """A planner that notes what it is asked and answers by a function."""

    answer: Callable[[PlanRequest], Plan]
    period: float = PERIOD
    asked: list[PlanRequest] = field(default_factory=list)

    def plan(self, request: PlanRequest) -> Plan:
        self.asked.append(request)
        return self.answer(request)


@dataclass
class Follows:
    """A tracker without feedback that notes which plan it is given."""

    period: float = DT
    flown: list[tuple[float, Plan]] = field(default_factory=list)

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
        self.flown.append((t, plan))
        return (state_at(plan, t + self.period)[3:] - state_at(plan, t)[3:]) / self.period


def there_and_stop(request: PlanRequest) -> Plan:
    """A second of thrust to the east and one back, from the plan being flown."""
    x = [request.estimate.x if request.current is None else state_at(request.current, request.t_start)]
    for push in (1.0, -1.0):
        p, v = x[-1][:3], x[-1][3:]
        u = np.array([push, 0.0, 0.0])
        x.append(np.concatenate([p + v + 0.5 * u, v + u]))
    t = request.t_start + np.arange(3.0)
    return Plan(t, np.array(x), np.array([[1.0, 0, 0], [-1.0, 0, 0]]), np.zeros(2, np.int64))


def later(answer: Callable[[PlanRequest], Plan]) -> Callable[[PlanRequest], Plan]:
    """A good plan first, and ``answer`` from then on."""
    return lambda request: there_and_stop(request) if request.current is None else answer(request)


@dataclass
class Flight:
    """Parts of a loop, and what came out."""

    answer: Callable[[PlanRequest], Plan] = there_and_stop
    messages: Sequence[Message] = ()
    estimator: ReadsState = field(default_factory=ReadsState)
    tracker: Follows = field(default_factory=Follows)
    duration: float = 4.0

    def __post_init__(self) -> None:
        self.planner = Answers(self.answer)
        self.plant = flight.PointMass(START, DT)

    def run(self, finished: Callable[[float, Mapping[str, Array]], bool] | None = None) -> Recording:
        agent = Agent(self.estimator, self.planner, self.tracker, messages=self.messages)
        return simulate(self.plant, {"vehicle": agent}, self.duration, finished)


def kinds(recording: Recording) -> list[str]:
    return [event.kind for event in recording.events]


@given(ticks=st.integers(1, 10_000_000), dt=st.sampled_from([1.0 / 300.0, 0.1, 0.002, 1.0 / 7.0]))
def test_whole_multiples_of_a_tick_are_counted_exactly(ticks: int, dt: float) -> None:
    assert whole_ticks(ticks * dt, dt, "period") == ticks


@given(ticks=st.integers(0, 10_000), part=st.floats(0.01, 0.99))
def test_other_periods_are_refused_with_both_numbers(ticks: int, part: float) -> None:
    period, dt = (ticks + part) / 300.0, 1.0 / 300.0
    with pytest.raises(ValueError, match="whole number of physics ticks") as refusal:
        whole_ticks(period, dt, "the period")
    assert repr(period) in str(refusal.value)
    assert repr(dt) in str(refusal.value)


@pytest.mark.parametrize("period", [0.0, -0.1, math.nan, math.inf])
def test_what_is_no_period_is_refused(period: float) -> None:
    with pytest.raises(ValueError, match="whole number of physics ticks"):
        whole_ticks(period, DT, "the period")


@pytest.mark.parametrize("part", ["estimator", "planner", "tracker", "duration"])
def test_a_rate_that_does_not_divide_is_refused_at_the_start(part: str) -> None:
    flown = Flight(duration=0.25 if part == "duration" else 4.0)
    if part != "duration":
        getattr(flown, part).period = 0.25
    with pytest.raises(ValueError, match=rf"{part}.*= 0\.25 s .* 0\.1 s"):
        flown.run()
    assert not flown.planner.asked


def test_an_agent_without_a_vehicle_is_refused_by_name() -> None:
    agent = Agent(ReadsState(), Answers(there_and_stop), Follows())
    with pytest.raises(ValueError, match=r"\['ghost'\] have no vehicle.*\['vehicle'\]"):
        simulate(flight.PointMass(START, DT), {"ghost": agent}, 1.0)


def test_the_planner_is_asked_one_period_ahead_of_its_plans_start() -> None:
    flown = Flight()
    flown.run()
    first, *others = flown.planner.asked
    assert (first.t, first.t_start, first.current) == (0.0, 0.0, None)
    for k, request in enumerate(others, start=1):
        assert request.t == pytest.approx(k * PERIOD)
        assert request.t_start == pytest.approx(request.t + PERIOD)
        assert request.current is not None
        assert request.estimate.t == request.t


def test_a_plan_takes_over_at_its_own_start_and_not_before() -> None:
    flown = Flight()
    recording = flown.run()
    assert [t for t, _ in recording.agents["vehicle"].plans] == pytest.approx([0.0, *[PERIOD * k for k in range(2, 9)]])
    for t, plan in flown.tracker.flown:
        assert plan.t_start <= t + 1e-9


def test_each_reading_reaches_the_estimator_once_with_the_command_held_since() -> None:
    flown = Flight(estimator=ReadsState(period=5 * DT), tracker=Follows(period=5 * DT))
    recording = flown.run()
    times = [reading.t for _, readings, _ in flown.estimator.calls for reading in readings]
    assert times == pytest.approx([k * DT for k in range(len(times))])
    commands = recording.agents["vehicle"].commands
    for k, (t, _, command) in enumerate(flown.estimator.calls[1:], start=1):
        assert t == pytest.approx(5 * DT * k)
        np.testing.assert_array_equal(command, commands[k - 1])


def test_an_estimator_slower_than_the_tracker_is_refused() -> None:
    with pytest.raises(ValueError, match="with old estimates"):
        Flight(estimator=ReadsState(period=2 * DT)).run()


def test_a_command_is_held_for_the_trackers_period() -> None:
    flown = Flight(tracker=Follows(period=2 * DT))
    commands = flown.run().agents["vehicle"].commands
    np.testing.assert_array_equal(commands[0:40:2], commands[1:41:2])
    assert len(flown.tracker.flown) == 21


@pytest.mark.parametrize("delay", [PERIOD + 0.001, 2.0])
def test_a_late_plan_is_dropped_at_its_start_and_never_retimed(delay: float) -> None:
    flown = Flight(later(lambda r: dataclasses.replace(there_and_stop(r), ready=r.t + delay)))
    recording = flown.run()
    assert len(recording.agents["vehicle"].plans) == 1
    late = [event for event in recording.events if event.kind == "late"]
    assert [event.t for event in late] == pytest.approx([request.t_start for request in flown.planner.asked[1:-1]])
    assert all(plan.t.tolist() == flown.tracker.flown[0][1].t.tolist() for _, plan in flown.tracker.flown)


def test_a_slow_plan_that_is_ready_in_time_is_flown() -> None:
    flown = Flight(later(lambda r: dataclasses.replace(there_and_stop(r), ready=r.t_start)))
    assert len(flown.run().agents["vehicle"].plans) == 8


def test_a_planner_that_raises_is_on_record_and_the_last_plan_flies_on() -> None:
    def broken(request: PlanRequest) -> Plan:
        raise KeyError("a bug")

    flown = Flight(later(broken))
    recording = flown.run()
    raised = [event for event in recording.events if event.kind == "raised"]
    assert len(raised) == len(flown.planner.asked) - 1
    assert "KeyError" in raised[0].message
    np.testing.assert_allclose(flown.plant.state("vehicle"), [1.0, 0.0, 100.0, 0.0, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize(
    ("status", "kind", "message"),
    [
        (Status.SOLVER_FAILED, "solver-failed", "because"),
        (Status.INFEASIBLE, "infeasible", "because"),
        # what is for a certificate to say, or for the loop
        (FlightStatus.LOW_CLEARANCE, "infeasible", f"{FlightStatus.LOW_CLEARANCE.value}: because"),
        (Status.NOT_ADMITTED, "malformed", "the plan's status is <Status.NOT_ADMITTED"),
    ],
)
def test_a_failed_plan_is_on_record_and_never_flown(status: Status, kind: str, message: str) -> None:
    flown = Flight(later(lambda r: Plan.failure(status, "because")))
    recording = flown.run()
    assert len(recording.agents["vehicle"].plans) == 1
    assert kinds(recording) == 8 * [kind]
    assert recording.events[0].message.startswith(message)


def test_notes_of_a_plan_become_events_when_it_is_adopted() -> None:
    flown = Flight(later(lambda r: dataclasses.replace(there_and_stop(r), notes=("rebased",), message="off by 3 m")))
    recording = flown.run()
    assert kinds(recording) == 7 * ["Answers: rebased"]  # with the name of the planner's class
    assert recording.events[0].t == pytest.approx(2 * PERIOD)
    assert recording.events[0].message == "off by 3 m"


def test_without_any_plan_the_vehicle_gets_no_command() -> None:
    flown = Flight(lambda request: Plan.failure(Status.INFEASIBLE))
    recording = flown.run()
    assert not flown.tracker.flown
    np.testing.assert_array_equal(recording.agents["vehicle"].commands, 0.0)
    assert all(request.t_start == request.t for request in flown.planner.asked)


def test_a_message_is_delivered_once_at_the_first_request_after_its_time() -> None:
    messages = [Message(t, "somebody", "radar", t) for t in (1.2, 0.0, 0.7, 0.6, 99.0)]
    flown = Flight(messages=messages)
    recording = flown.run()
    heard = [(request.t, m.payload) for request in flown.planner.asked for m in request.messages]
    np.testing.assert_allclose(heard, [(0.0, 0.0), (1.0, 0.6), (1.0, 0.7), (1.5, 1.2)])
    assert kinds(recording) == 4 * ["message"]


def test_a_command_that_is_not_finite_or_not_given_is_not_passed_on_and_reported_once_an_episode() -> None:
    @dataclass
    class Stumbles(Follows):
        def command(self, t: float, estimate: Estimate, plan: Plan) -> Array:
            good = Follows.command(self, t, estimate, plan)
            if 2.0 < t < 2.2:
                raise KeyError("a bug")
            return good * np.nan if 0.35 < t < 0.75 else good

    recording = Flight(later(lambda r: Plan.failure(Status.INFEASIBLE)), tracker=Stumbles()).run()
    commands = recording.agents["vehicle"].commands
    assert np.isfinite(commands).all()
    np.testing.assert_array_equal(commands[4:8], commands[[3, 3, 3, 3]])
    first, second = (event.message for event in recording.events if event.kind == "command-unusable")
    assert "nan" in first
    assert second.startswith("KeyError: 'a bug' (")
    assert second.endswith("; the last usable command is held")


def test_the_referee_ends_the_flight() -> None:
    recording = Flight().run(lambda t, truths: bool(truths["vehicle"][0] > 0.3))
    assert recording.truths["vehicle"][-1, 0] > 0.3
    assert (recording.truths["vehicle"][:-1, 0] <= 0.3).all()
    assert len(recording.t) == len(recording.truths["vehicle"]) == recording.length


def test_without_a_referee_it_lasts_its_duration() -> None:
    recording = Flight().run()
    np.testing.assert_allclose(recording.t, np.arange(41) * DT)


def test_the_log_holds_what_was_flown() -> None:
    arrays = Flight().run().arrays()
    n, plans = len(arrays["t"]), len(arrays["plan.adopted"])
    assert arrays["truth.x"].shape == arrays["estimate.x"].shape == arrays["measurement.full_state"].shape == (n, 6)
    assert arrays["command.u"].shape == (n, 3)
    assert arrays["plan.offsets"].shape == (plans + 1,)
    assert arrays["plan.offsets"][-1] == len(arrays["plan.t"]) == len(arrays["plan.x"]) == len(arrays["plan.u"])
    last = arrays["plan.offsets"][1:].astype(int) - 1
    assert np.isnan(arrays["plan.u"][last]).all()
    assert (arrays["plan.phase"][last] == -1).all()
    assert (np.delete(arrays["plan.phase"], last) == OPTIMISED).all()


class Pair:
    """Two point masses as one plant."""

    names = ("east", "west")

    def __init__(self) -> None:
        self.dt = DT
        self._vehicles = {
            name: flight.PointMass(START + np.array([x, 0, 0, 0, 0, 0]), DT)
            for name, x in zip(self.names, (50.0, -50.0), strict=True)
        }

    @property
    def t(self) -> float:
        return self._vehicles["east"].t

    def state(self, name: str) -> Array:
        return self._vehicles[name].state("vehicle")

    def state_names(self, name: str) -> tuple[str, ...]:
        return self._vehicles[name].state_names("vehicle")

    def sensor_sizes(self, name: str) -> dict[str, int]:
        return self._vehicles[name].sensor_sizes("vehicle")

    def sensors(self, name: str) -> tuple[Sensor, ...]:
        return self._vehicles[name].sensors("vehicle")

    def sense(self, name: str) -> Sequence[Measurement]:
        return self._vehicles[name].sense("vehicle")

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        self._vehicles[name].apply_wrench("vehicle", force, torque)

    def displace(self, name: str, offset: Array) -> None:
        self._vehicles[name].displace("vehicle", offset)

    def place(self, name: str, state: Array) -> None:
        self._vehicles[name].place("vehicle", state)

    def step(self, commands: Mapping[str, Array], ticks: int = 1) -> Sequence[Event]:
        for name, vehicle in self._vehicles.items():
            vehicle.step({"vehicle": commands.get(name, np.zeros(3))}, ticks)
        return []


def test_several_vehicles_fly_by_themselves_and_are_logged_by_name() -> None:
    plant = Pair()
    assert isinstance(plant, Plant)
    agents = {name: Agent(ReadsState(), Answers(there_and_stop), Follows()) for name in plant.names}
    arrays = simulate(plant, agents, 2.0).arrays()
    alone = Flight(duration=2.0).run().arrays()
    for name, x in (("east", 50.0), ("west", -50.0)):
        np.testing.assert_allclose(arrays[f"{name}.truth.x"] - [x, 0, 0, 0, 0, 0], alone["truth.x"], atol=1e-9)
        np.testing.assert_allclose(arrays[f"{name}.command.u"], alone["command.u"], atol=1e-9)


def test_progress_is_reported_once_a_simulated_second_and_every_step_is_watched() -> None:
    reported, watched = list[float](), list[float]()
    agent = Agent(ReadsState(), Answers(there_and_stop), Follows())
    recording = simulate(
        flight.PointMass(START, DT),
        {"vehicle": agent},
        4.0,
        progress=reported.append,
        watch=lambda loop: watched.append(loop.t),
    )
    assert reported == pytest.approx([float(k) for k in range(4)], abs=0.11)
    assert watched == recording.t.tolist()


@pytest.mark.parametrize(("estimator", "tracker", "steps"), [(1, 1, 1), (5, 5, 5), (2, 4, 2), (5, 25, 5)])
def test_the_loop_steps_and_logs_at_the_common_rate_of_its_parts(estimator: int, tracker: int, steps: int) -> None:
    dt = DT / 5
    agent = Agent(ReadsState(estimator * dt), Answers(there_and_stop, 50 * dt), Follows(tracker * dt))
    recording = simulate(flight.PointMass(START, dt), {"vehicle": agent}, 150 * dt)
    np.testing.assert_allclose(np.diff(recording.t), steps * dt)
    assert recording.t[-1] == pytest.approx(150 * dt)
    assert len(agent.estimator.calls) == 150 // estimator + 1  # type: ignore[attr-defined]


def test_the_control_rate_does_not_change_what_is_flown() -> None:
    dt = DT / 5
    seldom, often = (
        simulate(
            flight.PointMass(START, dt),
            {"vehicle": Agent(ReadsState(every * dt), Answers(there_and_stop), Follows(5 * dt))},
            4.0,
        )
        for every in (5, 1)
    )
    np.testing.assert_array_equal(seldom.truths["vehicle"], often.truths["vehicle"][::5])


def test_a_duration_that_ends_between_two_control_steps_is_kept() -> None:
    agent = Agent(ReadsState(0.5), Answers(there_and_stop), Follows(0.5))
    assert simulate(flight.PointMass(START, DT), {"vehicle": agent}, 1.2).t.tolist() == pytest.approx([0, 0.5, 1, 1.2])


@dataclass
class Fails(ReadsState):
    """An estimator whose answers are unusable from a call on."""

    answer: Callable[[float], Any] = lambda t: 1 / 0
    since: int = 20

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        estimate = super().update(t, measurements, command)
        return self.answer(t) if len(self.calls) > self.since else estimate  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("answer", "expected"),
    [
        (lambda t: 1 / 0, "ZeroDivisionError"),
        (lambda t: None, "update() returned NoneType; allowed: Estimate"),
        (lambda t: Estimate(t, np.full(6, np.nan)), "allowed: finite numbers"),
        (lambda t: Estimate(t, np.zeros(3)), "shape (3,); allowed: (6,), as before"),
    ],
)
def test_an_estimator_that_fails_is_reported_once_and_the_vehicle_keeps_its_plan(
    answer: Callable[[float], Any], expected: str
) -> None:
    flown = Flight(estimator=Fails(answer=answer))
    recording = flown.run()
    (event,) = [event for event in recording.events if event.kind == "estimate-unusable"]
    assert event.t == pytest.approx(20 * DT)
    assert expected in event.message
    statuses = [estimate.status for estimate in recording.agents["vehicle"].estimates]
    assert statuses == [Status.OK] * 20 + [Status.LOST] * 21
    assert recording.t[-1] == pytest.approx(flown.duration)
    assert flown.tracker.flown[-1][1].ok


def test_without_any_estimate_nothing_is_planned_and_nothing_raised() -> None:
    recording = Flight(estimator=Fails(since=0)).run()
    assert kinds(recording) == ["estimate-unusable"]
    assert not recording.agents["vehicle"].plans
    assert "estimate.x" not in recording.arrays()


def test_the_commands_of_a_flight_given_from_outside_lead_the_same_way() -> None:
    flown, again = Flight(), Flight()
    recording = flown.run()
    loop = Loop(again.plant, {"vehicle": Agent(again.estimator, again.planner, again.tracker)}, again.duration)
    assert (loop.t, loop.over) == (0.0, False)
    for u in recording.agents["vehicle"].commands:
        loop.observe()
        loop.command("vehicle", u)
        if not loop.over:
            loop.advance()
    assert loop.over
    arrays = loop.recording.end().arrays()
    assert all(np.array_equal(values, arrays[name]) for name, values in recording.arrays().items() if name in arrays)
    assert {"t", "truth.x", "estimate.x", "command.u", "measurement.full_state"} <= set(arrays)
    assert not again.planner.asked
    assert not again.tracker.flown


def test_a_flight_can_be_handed_over_from_one_control_step_to_the_next() -> None:
    given = Flight(messages=[Message(0.0, "tower", "news", 1.0)])
    agent = Agent(given.estimator, given.planner, given.tracker, messages=given.messages)
    loop = Loop(given.plant, {"vehicle": agent}, 1.0)
    loop.observe()
    loop.command("vehicle", np.zeros(3))
    assert not loop.recording.events
    loop.advance()
    for _ in range(4):
        loop.control_step()
        loop.advance()
    loop.control_step()
    assert kinds(loop.recording) == ["message"]
    assert given.planner.asked[0].t == pytest.approx(PERIOD)
    assert given.tracker.flown
