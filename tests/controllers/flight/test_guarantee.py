"""The guarantee as a state machine: whatever the plug-ins answer, and in any order, it is never held and then broken.

The oracle is written apart from the machine: the true clearance and the true speed at every tick, and the table of the
page on guarantees as data, of what an answer leads to.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from mathnavi.controllers.flight import guarantee
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.command_filter import CommandFilter, filtered
from mathnavi.controllers.flight.guarantee import GuaranteeState, Rule
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.estimators.full_state import FullState, FullStateConfig
from mathnavi.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest, Status
from mathnavi.models.aerial.knowledge import TERRAIN
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.hill import Hill, with_hills
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.loop import Loop
from mathnavi.sim.scenarios.flight_assurance import assured
from tests import flight

DT = 1.0 / 30.0  # [s] tick of the vehicle without MuJoCo, and a control period
MISSION = flight.mission(control_period=DT)
HELD, LOST, ENDANGERED, NOT_YET = (
    GuaranteeState.HELD, GuaranteeState.LOST, GuaranteeState.ENDANGERED, GuaranteeState.NOT_YET,
)  # fmt: skip
STEPS = round(FlightConfig(nodes=7).replan_period(DT) / DT)  # of a planning period

Answer = Callable[[Estimate], Any]
ESTIMATES: dict[str, Answer] = {
    "good": lambda good: good,
    "raises": lambda good: 1 / 0,
    "none": lambda good: None,
    "list": lambda good: good.x.tolist(),
    "nine states": lambda good: dataclasses.replace(good, x=np.zeros(9)),
    "nan": lambda good: dataclasses.replace(good, x=good.x * np.nan),
    "stale": lambda good: dataclasses.replace(good, t=good.t - 1.0),
    "future": lambda good: dataclasses.replace(good, t=good.t + 1.0),
    "negative": lambda good: dataclasses.replace(good, covariance=-np.eye(6)),
    "unsure": lambda good: dataclasses.replace(good, covariance=1e4 * np.eye(6)),
    "lost": lambda good: dataclasses.replace(good, status=Status.LOST),
    "gust": lambda good: dataclasses.replace(good, extra={"gust": np.zeros(2)}),
}
COMMANDS: dict[str, Callable[[Array], Any]] = {
    "good": lambda good: good,
    "raises": lambda good: 1 / 0,
    "list": lambda good: good.tolist(),
    "nan": lambda good: good * np.nan,
    "four": lambda good: np.zeros(4),
    "strong": lambda good: good + np.array([0.0, 0.0, 1.01 * MISSION.acceleration_max]),
}
PLANS: dict[str, Callable[[Plan], Any]] = {
    "good": lambda good: good,
    "raises": lambda good: 1 / 0,
    "none": lambda good: None,
    "list": lambda good: dataclasses.replace(good, x=good.x.tolist()),
    "torn": lambda good: dataclasses.replace(good, u=good.u[1:]),
    "elsewhere": lambda good: dataclasses.replace(good, x=good.x + 50.0),
    "forges": lambda good: Plan.failure(Status.SOLVER_FAILED, notes=("guarantee-held",)),
}
# What the page on guarantees says: of a vehicle on its plan, the state at a step at which a part answers so.
TABLE = {
    ("estimate", "good"): HELD, ("command", "good"): HELD, ("command", "list"): HELD,
    **{("plan", name): HELD for name in PLANS},
    **{("estimate", name): LOST for name in ESTIMATES if name != "good"},
    **{("command", name): LOST for name in COMMANDS if name not in ("good", "list")},
}  # fmt: skip


class Strange:
    """Estimator, planner or tracker of a stranger that answers as it is told."""

    def __init__(self, part: Any, answers: dict[str, Any]) -> None:
        self.part, self.answers, self.told = part, answers, "good"
        self.period = part.period

    def __getattr__(self, name: str) -> Any:
        return getattr(self.part, name)

    def update(self, t: float, measurements: Sequence[Any], command: Array) -> Any:
        return self.answers[self.told](self.part.update(t, measurements, command))

    def plan(self, request: PlanRequest) -> Any:
        plan = self.part.plan(request)
        return self.answers[self.told](plan) if plan.ok else plan

    def command(self, t: float, estimate: Estimate, plan: Plan) -> Any:
        return self.answers[self.told](self.part.command(t, estimate, plan))


class Flown:
    """A flight, step by step, whose parts can be told what to answer."""

    def __init__(self, *, behind_filter: bool = False, messages: Sequence[Message] = (), wait: bool = False) -> None:
        maker, tracker = FlightController.build(FlightConfig(nodes=7), MISSION)
        self.estimator = Strange(FullState(FullStateConfig(), MISSION), ESTIMATES)
        self.planner, self.tracker = Strange(maker, PLANS), Strange(tracker, COMMANDS)
        if behind_filter:
            command_filter = CommandFilter.for_mission(MISSION)
            self.guarantee = command_filter.guarantee
            planner, tracker = filtered(self.planner, self.tracker, command_filter)
        else:
            planner, tracker = Certified.for_mission(self.planner, MISSION, tracker), self.tracker  # type: ignore[assignment]
            self.guarantee = planner.guarantee  # type: ignore[attr-defined]
        agent = Agent(self.estimator, planner, tracker, messages=messages, **assured(MISSION, tracker))
        self.plant = flight.PointMass(MISSION.start_state, DT)
        self.loop = Loop(self.plant, {"vehicle": agent}, 600.0)

    def step(self, steps: int = 1) -> Iterator[GuaranteeState]:
        """Fly some steps; the state of the guarantee after the decisions of each."""
        for _ in range(steps):
            self.loop.control_step()
            assert self.guarantee.state is not None
            yield self.guarantee.state
            self.loop.advance()

    def fly(self, steps: int = 1) -> GuaranteeState:
        return list(self.step(steps))[-1]


def broken(mission: FlightMission, x: Array) -> str:
    """Which promise the true state x (6,) breaks; "" for none."""
    height = x[2] - float(mission.terrain.height(x[0], x[1]))
    if not height >= mission.clearance_min - 1e-6:
        return f"{height:.2f} m above the ground"
    speed = float(np.linalg.norm(x[3:]))
    return "" if speed <= mission.speed_max + 1e-6 else f"{speed:.2f} m/s"


@pytest.mark.parametrize(("part", "answer"), sorted(TABLE))
def test_an_answer_leads_to_the_state_that_the_page_says(part: str, answer: str) -> None:
    flown = Flown()
    assert flown.fly(STEPS) is HELD
    {"estimate": flown.estimator, "plan": flown.planner, "command": flown.tracker}[part].told = answer
    states = [state for state, told in zip(flown.step(2 * STEPS), range(2 * STEPS), strict=True) if told >= 0]
    assert {TABLE[part, answer]} == {*states}
    flown.estimator.told = flown.tracker.told = flown.planner.told = "good"
    assert flown.fly(2 * STEPS) is HELD
    told = [event.kind for event in flown.loop.recording.events if event.kind.startswith("guarantee-")]
    assert told == ["guarantee-held"] + (["guarantee-lost", "guarantee-held"] if LOST in states else [])


@pytest.mark.parametrize("answer", sorted(COMMANDS))
@pytest.mark.parametrize("plan", sorted(PLANS))
def test_behind_the_filter_neither_a_planner_nor_a_tracker_loses_the_guarantee(answer: str, plan: str) -> None:
    flown = Flown(behind_filter=True)
    flown.tracker.told, flown.planner.told = answer, plan
    assert {*flown.step(STEPS + 5)} == {HELD}
    assert all(isinstance(each.x, np.ndarray) for _, each in flown.loop.recording.agents["vehicle"].plans)


def test_an_estimator_that_never_answers_is_a_loss_from_the_start_and_the_plan_is_flown_by_prediction() -> None:
    flown = Flown()
    flown.estimator.told = "raises"
    assert {*flown.step(3 * STEPS)} == {LOST}
    assert np.linalg.norm(flown.plant.state("vehicle")[3:]) > 10.0
    assert not broken(MISSION, flown.plant.state("vehicle"))


def test_a_first_estimate_that_contradicts_the_mission_is_announced_and_then_relied_on() -> None:
    flight_of = begun_elsewhere()
    assert next(flight_of) is ENDANGERED


def test_an_estimator_that_begins_later_is_not_a_loss_yet() -> None:
    flown = Flown()
    flown.estimator.answers = {
        "good": lambda good: dataclasses.replace(good, status=Status.INITIALISING), "ready": lambda good: good,
    }  # fmt: skip
    assert {*flown.step(3)} == {NOT_YET}
    flown.estimator.told = "ready"
    assert {*flown.step(3)} == {HELD}


def begun_elsewhere() -> Iterator[GuaranteeState]:
    """A vehicle that is not where its mission starts."""
    flown = Flown()
    flown.plant.displace("vehicle", np.array([30.0, 0.0, 0.0]))
    flown.estimator.answers = {"good": lambda good: dataclasses.replace(good, x=flown.plant.state("vehicle"))}
    yield from flown.step()


def displaced() -> Iterator[GuaranteeState]:
    """A vehicle that is moved 30 m aside, from where there is a plan."""
    flown = Flown()
    yield from flown.step(STEPS + 3)
    flown.plant.displace("vehicle", np.array([30.0, 0.0, 0.0]))
    yield from flown.step(2)  # the reading of the first was taken before


def overtaken_by_a_map() -> Iterator[GuaranteeState]:
    """A hill in the way that becomes known in time."""
    (x, y, _), (x_f, y_f, _) = MISSION.start, MISSION.target
    ground = with_hills(MISSION.terrain, (Hill(x + 0.5 * (x_f - x), y + 0.5 * (y_f - y), 2000.0, 1200.0),))
    yield from Flown(messages=[Message(10.0, "survey", TERRAIN, ground)]).step(round(10.0 / DT) + 1)


def walled() -> Iterator[GuaranteeState]:
    """A wall around the vehicle that becomes known, and no way out."""
    x, y, z = MISSION.start
    ground = with_hills(MISSION.terrain, (Hill(x, y, 300.0, z),))
    yield from Flown(messages=[Message(1.0, "survey", TERRAIN, ground)]).step(round(1.0 / DT) + 1)


def too_fast() -> Iterator[GuaranteeState]:
    """An estimate that is faster than the plan, and than v_max."""
    flown = Flown()
    yield from flown.step(STEPS)
    flown.estimator.answers = {
        "good": lambda good: dataclasses.replace(good, x=np.array([*good.x[:3], 400.0, 0.0, 0.0]))
    }  # fmt: skip
    yield from flown.step()


def told(part: str, answer: str) -> Callable[[], Iterator[GuaranteeState]]:
    def flight_of() -> Iterator[GuaranteeState]:
        flown = Flown()
        yield from flown.step(STEPS + 1)  # after a planning instant
        {"estimate": flown.estimator, "command": flown.tracker}[part].told = answer
        yield from flown.step()

    return flight_of


def waiting() -> Iterator[GuaranteeState]:
    flown = Flown()
    flown.estimator.answers = {"good": lambda good: dataclasses.replace(good, status=Status.INITIALISING)}
    yield from flown.step()


# A flight that each rule decides in its last step, by the state that the page names.
DECIDED: dict[str, tuple[Callable[[], Iterator[GuaranteeState]], GuaranteeState]] = {
    "waiting": (waiting, NOT_YET),
    "doubt": (told("estimate", "unsure"), LOST),
    "untracked": (told("command", "nan"), LOST),
    "uncertified": (walled, LOST),
    "outside": (displaced, ENDANGERED),
    "danger": (overtaken_by_a_map, ENDANGERED),
    "fast": (too_fast, ENDANGERED),
}


@pytest.mark.parametrize("rule_of", DECIDED)
def test_every_rule_decides_a_flight_and_without_it_the_table_is_not_kept(
    rule_of: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mutants of the machine: each lacks one rule, and is found."""
    fly, expected = DECIDED[rule_of]
    assert list(fly())[-1] is expected
    probe = guarantee.Evidence(**{rule_of: "probe"})

    def decides(each: Rule) -> bool:
        return each.reason(probe) == "probe"

    assert sum(map(decides, guarantee.RULES)) == 1
    monkeypatch.setattr(guarantee, "RULES", tuple(each for each in guarantee.RULES if not decides(each)))
    assert list(fly())[-1] is not expected


def test_a_machine_that_is_not_stepped_between_planning_instants_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The eighth mutant: nothing is concluded from what is monitored."""
    monkeypatch.setattr(Certified, "monitor", lambda self, request: None)
    fly, expected = DECIDED["doubt"]
    with pytest.raises(AssertionError):
        assert list(fly())[-1] is expected


class AnyAnswers(RuleBasedStateMachine):
    """Any sequence of answers: while the guarantee is held, the next tick keeps the clearance and the speed."""

    behind_filter = False

    @initialize()
    def begin(self) -> None:
        self.flown = Flown(behind_filter=self.behind_filter)
        self.broken = ""

    @rule(name=st.sampled_from(sorted(ESTIMATES)))
    def estimates(self, name: str) -> None:
        self.flown.estimator.told = name

    @rule(name=st.sampled_from(sorted(COMMANDS)))
    def commands(self, name: str) -> None:
        self.flown.tracker.told = name

    @rule(name=st.sampled_from(sorted(PLANS)))
    def plans(self, name: str) -> None:
        self.flown.planner.told = name

    @rule(steps=st.sampled_from([1, 7, STEPS, 6 * STEPS]))
    def fly(self, steps: int) -> None:
        flown, before = self.flown, LOST
        for state in chain(flown.step(steps), [LOST]):  # the last is at the tick after the last step
            wrong = broken(MISSION, flown.plant.state("vehicle"))
            if wrong and HELD in (before, state):
                self.broken = f"{wrong} at {flown.plant.t:.3f} s"
            before = state

    @invariant()
    def kept(self) -> None:
        assert not getattr(self, "broken", "")


class AnyAnswersFiltered(AnyAnswers):
    """The same behind the filter."""

    behind_filter = True


AnyAnswers.TestCase.settings = AnyAnswersFiltered.TestCase.settings = settings(
    max_examples=6, stateful_step_count=10, deadline=None
)
TestAnyAnswers = AnyAnswers.TestCase
TestAnyAnswersFiltered = AnyAnswersFiltered.TestCase
