"""The contract of every planner behind an entry of ``mathnavi.controllers``, whoever wrote it.

A planner is asked for plans of a mission that fits the type of ``build``'s argument ``mission``.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import types
import typing
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import Any

import numpy as np
import pytest

import mathnavi.models.missile.dynamics
from mathnavi.controllers.active_sensing.belief import pose_on
from mathnavi.controllers.textbook.input_signal import DrivenMission
from mathnavi.interfaces.protocols import ControllerPlugin, Planner
from mathnavi.interfaces.signals import Array, Estimate, Message, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import TICK, state_at
from mathnavi.models.aerial.knowledge import RADARS
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase, FlightStatus
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.missile.mission import MissileMission, Target
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.terrain.visibility import Radar
from mathnavi.models.textbook.library import SYSTEMS
from mathnavi.models.textbook.mission import TextbookMission
from mathnavi.models.textbook.system import System
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.engine.loop import whole_ticks
from tests import flight, quadrotor
from tests.controllers.active_sensing import robots
from tests.controllers.missile import flights

PLUGINS = {
    entry.name: entry
    for entry in entry_points(group="mathnavi.controllers")
    # Plans of a Lagrangian system are a reference's, wherever the estimate is; their own tests hold them.
    if typing.get_type_hints(entry.load().build)["mission"] is not LagrangianMission
}
PERIODS = 12  # requests of a sequence


@dataclass(frozen=True, eq=False)
class Bench:
    """A mission and what is special about its states."""

    mission: Any
    dt: float  # [s] tick
    start: Array  # (nx,)
    hopeless: Sequence[Array]  # (nx,) states from which there is no way on
    message: Message | None  # news that matters, if any does
    assert_well_formed: Callable[[Plan], None]
    state_at: Callable[[Plan, float], Array]

    @property
    def news(self) -> tuple[Message, ...]:
        return () if self.message is None else (self.message,)


def flight_bench() -> Bench:
    mission = flight.mission()
    x, y, z = mission.start
    peak = flight.above(mission.terrain, (6000.0, 6000.0), 60.0)
    return Bench(
        mission,
        TICK,
        flight.at_rest(mission.start),
        (
            flight.at_rest((x, y, z - 400.0)),  # under ground
            flight.at_rest((-5000.0, y, z)),  # off the map
            np.array([x, y, z, 0.0, 0.0, -290.0]),  # diving into the ground
            np.array([x - 1490.0, y, z, -290.0, 0.0, 0.0]),  # leaving the map
            np.array([*peak, 0.0, 0.0, 0.0]) - [800.0, 800.0, 0.0, -200.0, -200.0, 0.0],  # before a slope
        ),
        Message(0.0, "radar warning", RADARS, (Radar(6000.0, 6000.0, 3000.0, 5.0),)),
        flight.assert_well_formed,
        state_at,
    )


def missile_bench() -> Bench:
    mission = flights.mission(case="SM")
    start = mission.start_state
    nowhere = start.copy()
    nowhere[0] = -100.0  # flying backwards, which its attack angle has no value for
    return Bench(
        mission,
        mathnavi.models.missile.dynamics.TICK,
        start,
        (nowhere, np.full(len(start), math.nan)),
        Message(0.0, "target watch", "target", Target((700.0, 0.0, 0.0), (20.0, 0.0, 0.0))),
        lambda plan: assert_meets_target(plan, mission),
        lambda plan, t: mission.coordinates.state_at(plan, t, mission.body),
    )


def assert_meets_target(plan: Plan, mission: MissileMission) -> None:
    """Finite arcs that join, and end on the target."""
    assert len(plan.t) == len(plan.x) == len(plan.u) + 1
    assert (np.diff(plan.t) > 0.0).all()
    assert np.isfinite(plan.x).all()
    assert np.isfinite(plan.u).all()
    for k, (u, d) in enumerate(zip(plan.u, np.diff(plan.t), strict=True)):
        reached = mission.coordinates.flow(plan.x[k], u, float(d), mission.body)
        np.testing.assert_allclose(reached, plan.x[k + 1], atol=1e-5)
    assert flights.miss(plan, mission) < 1e-2


def ranging_bench() -> Bench:
    mission = robots.mission()
    return Bench(
        mission,
        mission.period,
        robots.START,
        (
            np.array([0.0, 2.0, 0.0]),  # outside the wall
            np.array([0.0, 1.35, math.pi / 2.0]),  # about to touch it
            np.full(3, math.nan),
        ),
        None,
        lambda plan: robots.assert_well_formed(plan, mission),
        pose_on,
    )


def quadrotor_bench() -> Bench:
    """Hills of 40 m at a quadrotor's speeds; the planner sees the point mass."""
    mission = QuadrotorMission(quadrotor.flight_mission(quadrotor.hills(), (40.0, 50.0), (350.0, 340.0)))
    x, y, z = mission.flight.start
    return Bench(
        mission,
        TICK,
        mission.flight.start_state,
        (
            flight.at_rest((x, y, z - 20.0)),  # under ground
            flight.at_rest((-50.0, y, z)),  # off the map
            np.array([x, y, z, 0.0, 0.0, -13.0]),  # diving into the ground
            np.array([5.0, y, z, -13.0, 0.0, 0.0]),  # leaving the map
        ),
        Message(0.0, "radar warning", RADARS, (Radar(200.0, 200.0, 90.0, 5.0),)),
        flight.assert_well_formed,
        state_at,
    )


def textbook_bench() -> Bench:
    """A robot that sees two flags; any estimate that is finite leads on."""
    system = SYSTEMS["camera-and-flags"]
    mission = TextbookMission(system, system.start, (0.1,) * len(system.states))
    return Bench(
        mission,
        mission.period,
        mission.start_state,
        (np.full(len(system.states), math.nan), np.full(len(system.states), math.inf)),
        None,
        lambda plan: assert_follows(plan, system),
        lambda plan, t: follow(plan, t, system),
    )


def assert_follows(plan: Plan, system: System) -> None:
    """Finite arcs that join."""
    assert len(plan.t) == len(plan.x) == len(plan.u) + 1
    assert (np.diff(plan.t) > 0.0).all()
    assert np.isfinite(plan.x).all()
    assert np.isfinite(plan.u).all()
    for x, u, d, after in zip(plan.x, plan.u, np.diff(plan.t), plan.x[1:], strict=False):
        np.testing.assert_allclose(system.flow(x, u, float(d)), after, atol=1e-9)


def follow(plan: Plan, t: float, system: System) -> Array:
    """The state of a plan at a time [s]."""
    k = min(max(int(np.searchsorted(plan.t, t, side="right")) - 1, 0), len(plan.u) - 1)
    return system.flow(plan.x[k], plan.u[k], t - float(plan.t[k]))


BENCHES: dict[type, Callable[[], Bench]] = {
    FlightMission: flight_bench,
    MissileMission: missile_bench,
    RangingMission: ranging_bench,
    DrivenMission: textbook_bench,
    QuadrotorMission: quadrotor_bench,
}


@pytest.fixture(params=sorted(PLUGINS))
def plugin(request: pytest.FixtureRequest) -> type[ControllerPlugin]:
    loaded: type[ControllerPlugin] = PLUGINS[request.param].load()
    return loaded


@pytest.fixture
def bench(plugin: type[ControllerPlugin]) -> Bench:
    return bench_of(plugin)


@cache
def bench_of(plugin: type[ControllerPlugin]) -> Bench:
    """The bench that all tests of a plug-in share."""
    kind = typing.get_type_hints(plugin.build)["mission"]
    assert kind in BENCHES, f"{plugin.__name__} is built for {kind.__name__}, for which this suite has no bench yet"
    return BENCHES[kind]()


@pytest.fixture
def planner(plugin: type[ControllerPlugin], bench: Bench) -> Planner:
    return plugin.build(plugin.Config(), bench.mission)[0]


def first_request(bench: Bench, t: float = 0.0) -> PlanRequest:
    return PlanRequest(t, t, Estimate(t, bench.start.copy()), None)


def sequence(planner: Planner, bench: Bench, messages: Sequence[Message] = ()) -> list[tuple[PlanRequest, Plan]]:
    """Requests of a loop without faults, and the answers; without a new plan the last one stays."""
    asked: list[tuple[PlanRequest, Plan]] = []
    current: Plan | None = None
    for k in range(PERIODS):
        t = k * planner.period
        x = bench.start.copy() if current is None else bench.state_at(current, t)
        received = tuple(messages) if k == PERIODS // 2 else ()
        request = PlanRequest(t, t + planner.period if current is not None else t, Estimate(t, x), current, received)
        plan = planner.plan(request)
        asked.append((request, plan))
        current = plan if plan.ok else current
    return asked


@cache
def answers(plugin: type[ControllerPlugin], *, news: bool = False) -> list[tuple[PlanRequest, Plan]]:
    """Requests and answers, with the bench's news if asked for: for the tests that only read them."""
    bench = bench_of(plugin)
    return sequence(plugin.build(plugin.Config(), bench.mission)[0], bench, bench.news if news else ())


def numbers(config: type[Any]) -> list[tuple[type[Any], str, bool]]:
    """The fields of a configuration, and of those within it, that hold a number, and whether it is a real one."""
    found = []
    for name, kind in typing.get_type_hints(config).items():
        kinds = typing.get_args(kind) if isinstance(kind, types.UnionType) else (kind,)
        if {int, float} & set(kinds):
            found.append((config, name, float in kinds))
        if dataclasses.is_dataclass(kind):
            found += numbers(typing.cast(type[Any], kind))
    return found


def test_there_are_planners() -> None:
    assert {"flight", "as_printed", "missile", "active_sensing", "input_signal", "quadrotor"} <= PLUGINS.keys()


def test_its_configuration_is_frozen_and_has_defaults(plugin: type[ControllerPlugin]) -> None:
    config = plugin.Config()
    assert dataclasses.is_dataclass(config)
    for field in dataclasses.fields(config):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(config, field.name, getattr(config, field.name))


def test_a_configuration_out_of_range_is_refused_by_the_name_of_the_field(plugin: type[ControllerPlugin]) -> None:
    fields = numbers(plugin.Config)
    assert fields
    for config, name, real in fields:
        none = (-1,) if name == "seed" else (0, -1)
        for value in (math.nan, math.inf, -math.inf, -1.0) if real else none:
            with pytest.raises(ValueError, match=rf"{name} = .*allowed"):
                config(**{name: value})


@pytest.mark.honoured("plug-in", "controller: period in whole ticks")
def test_conforms_to_the_protocol_and_its_period_is_whole_ticks(planner: Planner, bench: Bench) -> None:
    assert isinstance(planner, Planner)
    assert whole_ticks(planner.period, bench.dt, "period") >= 1


@pytest.mark.parametrize("t", [0.0, 25.0])
def test_the_first_plan_starts_at_once_and_at_the_estimate(planner: Planner, bench: Bench, t: float) -> None:
    plan = planner.plan(first_request(bench, t))
    assert plan.ok, plan.message
    assert plan.t_start == t
    np.testing.assert_array_equal(plan.x[0], bench.start)


@pytest.mark.honoured("plug-in", "controller: plans from the estimate to the target")
def test_a_plan_is_well_formed_and_leads_to_its_end(plugin: type[ControllerPlugin], bench: Bench) -> None:
    plans = [plan for _, plan in answers(plugin) if plan.ok]
    assert len(plans) >= PERIODS // 2
    for plan in plans:
        bench.assert_well_formed(plan)
        assert set(plan.phase) <= set(FlightPhase)


def test_a_later_plan_starts_when_asked_to_and_on_the_plan_being_flown(
    plugin: type[ControllerPlugin], bench: Bench
) -> None:
    for request, plan in answers(plugin)[1:]:
        if plan.ok:
            assert request.current is not None
            assert plan.t_start == pytest.approx(request.t_start, abs=1e-9)
            np.testing.assert_allclose(plan.x[0], bench.state_at(request.current, request.t_start), rtol=0.0, atol=1e-6)


def test_the_same_requests_get_the_same_answers(plugin: type[ControllerPlugin], bench: Bench) -> None:
    again = sequence(plugin.build(plugin.Config(), bench.mission)[0], bench, bench.news)
    for (_, first), (_, second) in zip(answers(plugin, news=True), again, strict=True):
        for name in ("t", "x", "u", "phase"):
            np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
        assert (first.status, first.message, first.notes) == (second.status, second.message, second.notes)
        np.testing.assert_equal(first.cost, second.cost)


def test_what_it_is_asked_is_not_changed(planner: Planner, bench: Bench) -> None:
    current = planner.plan(first_request(bench))
    t = planner.period
    request = PlanRequest(t, 2.0 * t, Estimate(t, bench.state_at(current, t)), current, bench.news)
    x, kept = request.estimate.x.copy(), copy.deepcopy(current)
    planner.plan(request)
    np.testing.assert_array_equal(request.estimate.x, x)
    for name in ("t", "x", "u", "phase"):
        np.testing.assert_array_equal(getattr(current, name), getattr(kept, name))


def test_a_plan_that_was_handed_out_stays_as_it_was(planner: Planner, bench: Bench) -> None:
    first = planner.plan(first_request(bench))
    kept = copy.deepcopy(first)
    sequence(planner, bench)
    for name in ("t", "x", "u", "phase"):
        np.testing.assert_array_equal(getattr(first, name), getattr(kept, name))


@pytest.mark.honoured("plug-in", "controller: messages, of which some are strange")
def test_news_reach_it_and_strange_messages_do_not_matter(plugin: type[ControllerPlugin], bench: Bench) -> None:
    topic = bench.message.topic if bench.message is not None else "target"
    strange = (Message(0.0, "somebody", "weather", "fine"), Message(0.0, "somebody", topic, "nonsense"))
    plain, informed = answers(plugin), answers(plugin, news=True)
    puzzled = sequence(plugin.build(plugin.Config(), bench.mission)[0], bench, strange)
    heard = any(
        plan.ok != other.ok or not np.array_equal(plan.x, other.x)
        for (_, plan), (_, other) in zip(plain, informed, strict=True)
    )
    assert heard is (bench.message is not None)
    for (_, plan), (_, other) in zip(plain, puzzled, strict=True):
        np.testing.assert_array_equal(plan.x, other.x)


def test_where_there_is_no_way_on_the_answer_says_so_or_is_well_formed(planner: Planner, bench: Bench) -> None:
    for state in bench.hopeless:
        plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, state), None))
        assert isinstance(plan.status, Status | FlightStatus)
        if plan.ok:  # what it is worth is for a certificate to say
            bench.assert_well_formed(plan)
        else:
            assert plan.message


def test_it_takes_the_time_of_its_optimisation(plugin: type[ControllerPlugin]) -> None:
    times = [plan.solve_ms for _, plan in answers(plugin)]
    assert all(math.isnan(ms) or ms >= 0.0 for ms in times)
    assert np.isfinite(times).any()
