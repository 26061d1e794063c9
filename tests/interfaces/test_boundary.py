"""What goes in to a plug-in cannot be changed there, and what comes out is what it says or is refused."""

from __future__ import annotations

import asyncio
import copy
import dataclasses
from collections.abc import Callable, Iterator
from decimal import Decimal
from itertools import repeat
from typing import Any

import numpy as np
import pytest

from mathnavi.controllers.flight.certificate import TrackingBound
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.interfaces.boundary import (
    Unusable,
    answered,
    guest,
    handed,
    lent,
    numbers,
    own_copy,
    usable_command,
    usable_estimate,
    usable_events,
    usable_plan,
)
from mathnavi.interfaces.errors import PluginError
from mathnavi.interfaces.signals import Estimate, Message, Plan, PlanRequest, Status
from mathnavi.models.aerial.knowledge import TERRAIN
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightStatus
from mathnavi.sim.plugin.registry import PluginSpec, checked_controller
from tests import flight

MISSION = flight.mission()


def estimate() -> Estimate:
    return Estimate(1.0, np.arange(6.0), np.eye(6), extra={"gust": np.zeros(3)})


def plan() -> Plan:
    return Plan(np.array([0.0, 1.0]), np.zeros((2, 6)), np.zeros((1, 3)), np.zeros(1, np.int64))


def request() -> PlanRequest:
    return PlanRequest(1.0, 2.0, estimate(), plan(), (Message(1.0, "survey", TERRAIN, flight.mountains()),))


def changed(part: Any, seen: set[int] | None = None) -> None:
    """Change all that can be changed of an object and of what it holds, by every way that there is."""
    seen = set() if seen is None else seen
    if id(part) in seen:
        return
    seen.add(id(part))
    if isinstance(part, np.ndarray):
        for array in (part, part.base):
            if isinstance(array, np.ndarray):
                try:
                    array.setflags(write=True)
                    array[...] = 77
                except ValueError:
                    pass
        part.shape = (part.size, 1)
    elif dataclasses.is_dataclass(part):
        for field in dataclasses.fields(part):
            changed(getattr(part, field.name), seen)
            object.__setattr__(part, field.name, None)
    elif isinstance(part, tuple | list):
        for each in part:
            changed(each, seen)
    elif isinstance(part, dict):
        for each in part.values():
            changed(each, seen)
        part.clear()


def told(part: Any) -> Any:
    """All that an object holds, as plain values."""
    if isinstance(part, np.ndarray):
        return part.shape, part.tobytes()
    if dataclasses.is_dataclass(part) and not isinstance(part, type):
        return {field.name: told(getattr(part, field.name)) for field in dataclasses.fields(part)}
    if isinstance(part, tuple | list):
        return [told(each) for each in part]
    return {name: told(value) for name, value in part.items()} if isinstance(part, dict) else repr(part)


@pytest.mark.parametrize(
    ("lend", "make"),
    [(own_copy, estimate), (handed, request), (lent, lambda: MISSION), (lent, lambda: [np.ones(3), {"a": np.ones(2)}])],
    ids=["estimate", "request", "mission", "payload"],
)
def test_what_a_plug_in_does_to_what_it_was_given_changes_nothing(
    lend: Callable[[Any], Any], make: Callable[[], Any]
) -> None:
    own = make()
    before, given = told(own), lend(own)
    assert told(given) == before
    changed(given)
    assert told(own) == before


class MissionChanger(FlightController):
    """Controller of a stranger that makes its mission easier."""

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Any:
        built = FlightController.build(config, mission)
        changed(mission)
        return built


class BoundChanger(FlightController):
    """Controller of a stranger whose tracker widens its bound once it flies."""

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Any:
        planner, tracker = FlightController.build(config, mission)

        class Tracker:
            period, bound, held = tracker.period, Widening(**vars(tracker.bound)), tracker.held

        Tracker.command = tracker.command  # type: ignore[attr-defined]
        return planner, Tracker()


class Widening(TrackingBound):
    """Bound that nothing breaks."""

    def how_far(self, error: Any) -> str:
        return ""


class HeldChanger(FlightController):
    """Controller of a stranger whose tracker has a lag of its own kind."""

    @staticmethod
    def build(config: FlightConfig, mission: FlightMission) -> Any:
        planner, tracker = FlightController.build(config, mission)
        tracker.held = type("Lagless", (), {"period": tracker.period})()
        tracker.command = tracker.command  # a method of its own
        return planner, tracker


def spec(plugin: type) -> PluginSpec:
    return PluginSpec.with_fields(plugin, nodes=7, grid_nodes=17)


def test_a_mission_that_a_plug_in_changes_is_its_own() -> None:
    before = told(MISSION)
    checked_controller(spec(MissionChanger), MISSION, TrackingBound)
    assert told(MISSION) == before


def test_what_a_tracker_stated_stays_what_it_was() -> None:
    _, tracker = checked_controller(spec(BoundChanger), MISSION, TrackingBound)
    assert type(tracker.bound) is TrackingBound
    before = tracker.bound
    object.__setattr__(tracker.wrapped.bound, "horizontal", 1e9)
    tracker.wrapped.period = 100.0
    assert tracker.bound.horizontal == before.horizontal < 1e3
    assert tracker.period == MISSION.control_period
    assert guest(tracker) == "Tracker"
    assert copy.copy(tracker).bound == before


def test_a_lag_of_another_kind_is_refused() -> None:
    with pytest.raises(PluginError, match=r"held = .*; allowed: None, or a HeldInput"):
        checked_controller(spec(HeldChanger), MISSION, TrackingBound)


def test_a_part_with_a_replaced_method_is_a_guest_and_a_name_is_a_word() -> None:
    _, tracker = FlightController.build(FlightConfig(nodes=7), MISSION)
    assert guest(tracker) == ""
    tracker.command = lambda t, estimate, plan: np.zeros(3)  # type: ignore[method-assign]
    assert guest(tracker) == "CriticallyDamped"
    assert guest(type("guarantee-held: x", (), {})()) == "guarantee_held__x"


NO_NUMBERS = {
    "strings": ["1", "2"], "complex": np.array([1.0 + 1.0j, 2.0]), "objects": [Decimal(1), Decimal(2)],
    "ragged": [[1.0], [2.0, 3.0]], "nothing": None, "times": np.array(["2020-01-01"], "M8[s]"),
}  # fmt: skip


@pytest.mark.parametrize("name", NO_NUMBERS)
def test_what_is_no_real_number_is_refused_wherever_it_comes_from(name: str) -> None:
    values: Any = NO_NUMBERS[name]
    assert isinstance(answered(numbers, values), Unusable)
    assert isinstance(usable_command(values, (2,)), Unusable)
    for answer in (dataclasses.replace(estimate(), x=values), dataclasses.replace(estimate(), covariance=values)):
        if answer.covariance is not None:
            assert isinstance(usable_estimate(answer, 1.0), Unusable)
    assert isinstance(usable_plan(dataclasses.replace(plan(), x=values)), Unusable)


def test_numbers_of_any_kind_are_numbers_and_a_masked_one_is_missing() -> None:
    for values in ([1, 2], (1.0, 2.0), np.array([1, 2], np.float32), np.array([1, 2])):
        command = usable_command(values, (2,))
        assert isinstance(command, np.ndarray)
        assert command.dtype == np.float64
        assert command.tolist() == [1.0, 2.0]
    masked = np.ma.masked_array([1.0, 2.0], [True, False])
    assert isinstance(usable_command(masked, (2,)), Unusable)
    assert isinstance(usable_command(masked, (2,), own=True), Unusable)


class AlwaysOk(Plan):
    """Plan of a stranger that calls itself one whatever its status is."""

    @property
    def ok(self) -> bool:
        return True


@pytest.mark.parametrize(
    ("status", "becomes"),
    [
        (Status.OK, Status.OK), (Status.SOLVER_FAILED, Status.SOLVER_FAILED),
        (FlightStatus.DEADLINE, Status.INFEASIBLE), (Status.LATE, None), (Status.LOST, None), ("ok", None),
    ],
)  # fmt: skip
def test_a_plan_is_a_plan_of_the_loop_and_says_what_a_planner_can_know(status: Any, becomes: Status | None) -> None:
    made = plan()
    answer = usable_plan(AlwaysOk(made.t, made.x, made.u, made.phase, status, notes=("guarantee-held",)), "Mine")
    if becomes is None:
        assert isinstance(answer, Unusable)
        return
    assert type(answer) is Plan
    assert (answer.status, answer.ok) == (becomes, becomes is Status.OK)
    assert answer.notes == ("Mine: guarantee-held",)


class Cancelled(BaseException):
    """What a plug-in might raise besides an Exception."""


@pytest.mark.parametrize("error", [ValueError, SystemExit, asyncio.CancelledError, Cancelled, GeneratorExit])
def test_whatever_is_raised_is_an_answer_that_cannot_be_used(error: type[BaseException]) -> None:
    def raises() -> None:
        raise error("why")

    answer = answered(raises)
    assert isinstance(answer, Unusable)
    assert answer.reason.startswith(f"{error.__name__}: ")


def test_the_user_may_interrupt_a_plug_in() -> None:
    def raises() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        answered(raises)


def endless() -> Iterator[tuple[str, str]]:
    return repeat(("again", ""))


@pytest.mark.parametrize("call", [3, lambda: 3, lambda: ["abc"], endless, lambda: 1 / 0])
def test_events_that_are_none_are_refused(call: Any) -> None:
    assert isinstance(usable_events(call, "Mine"), Unusable)


def test_events_carry_the_name_of_their_plug_in_on_one_line() -> None:
    assert usable_events(lambda: [("guarantee-held", "x"), ("a\nb", "y")], "Mine") == (
        ("Mine: guarantee-held", "x"), ("Mine: a b", "y"),
    )  # fmt: skip
    assert usable_events(list, "Mine") == ()
