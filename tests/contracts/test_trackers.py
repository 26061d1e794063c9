"""The contract of every tracker behind an entry of ``mathnavi.controllers``, whoever wrote it."""

from __future__ import annotations

import dataclasses
import math
import typing
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from typing import Any, Protocol, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mathnavi.models.missile.dynamics
from mathnavi.controllers.active_sensing.belief import pose_on
from mathnavi.controllers.textbook.input_signal import DrivenMission
from mathnavi.interfaces.protocols import ControllerPlugin, Tracker
from mathnavi.interfaces.signals import OPTIMISED, Array, Estimate, Plan
from mathnavi.models.aerial.dynamics import TICK, flow, state_at
from mathnavi.models.aerial.mission import DeclaredGusts, EstimateQuality, FlightMission
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.missile.mission import MissileMission
from mathnavi.models.quadrotor.mission import QuadrotorMission
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.engine.faults import Gusts
from mathnavi.sim.engine.loop import whole_ticks
from tests import flight
from tests.controllers.active_sensing import robots
from tests.controllers.missile import flights

PLUGINS = {
    entry.name: entry
    for entry in entry_points(group="mathnavi.controllers")
    # A signal follows no plan of a vehicle, a reference of a Lagrangian system is no plan from where it is, and what a
    # quadrotor is asked for are thrusts, not its plan's accelerations; their own tests hold them.
    if typing.get_type_hints(entry.load().build)["mission"] not in (DrivenMission, LagrangianMission, QuadrotorMission)
}
GUST = DeclaredGusts(1.5, 3.0, 4.0)


@dataclass(frozen=True, eq=False)
class Bench:
    """A vehicle with a plan to fly and the gusts it meets."""

    mission: Any
    plan: Plan
    input_max: float  # on the Euclidean norm
    reference: Callable[[Plan, float], Array]
    dt: float = TICK  # [s]
    tolerance: float = 1e-6  # of an input


def slalom() -> Plan:
    """Nine arcs, none of them a whole number of ticks, from rest to rest."""
    rng = np.random.default_rng(3)
    duration = rng.uniform(0.7, 2.3, 9)
    u = rng.uniform(-15.0, 15.0, (9, 3))
    u[-1] = -(duration[:-1] @ u[:-1]) / duration[-1]
    t, x = [0.0], [flight.at_rest(flight.mission().start)]
    for a, d in zip(u, duration, strict=True):
        t.append(t[-1] + float(d))
        x.append(flow(x[-1], a, float(d)))
    x[-1] = flight.at_rest(x[-1][:3])
    return Plan(np.array(t), np.array(x), u, np.full(9, OPTIMISED))


def flight_bench() -> Bench:
    mission = flight.mission(gust=GUST, quality=EstimateQuality.exact(GUST))
    return Bench(mission, slalom(), mission.acceleration_max, state_at)


def missile_bench() -> Bench:
    mission = flights.mission()

    def reference(plan: Plan, t: float) -> Array:
        return mission.coordinates.state_at(plan, t, mission.body)

    return Bench(mission, flights.first_plan(mission), math.inf, reference, mathnavi.models.missile.dynamics.TICK, 1e-3)


def ranging_bench() -> Bench:
    mission = robots.mission()
    return Bench(mission, robots.winding_path(mission), math.inf, pose_on, mission.period)


BENCHES: dict[type, Callable[[], Bench]] = {
    FlightMission: flight_bench,
    MissileMission: missile_bench,
    RangingMission: ranging_bench,
}
CERTIFIED = sorted(
    name
    for name, entry in PLUGINS.items()
    if typing.get_type_hints(entry.load().build)["mission"] is FlightMission  # which is flown within a stated bound
)
certified = pytest.mark.parametrize("plugin", CERTIFIED, indirect=True)


@pytest.fixture(params=sorted(PLUGINS), scope="module")
def plugin(request: pytest.FixtureRequest) -> type[ControllerPlugin]:
    loaded: type[ControllerPlugin] = PLUGINS[request.param].load()
    return loaded


@pytest.fixture(scope="module")
def bench(plugin: type[ControllerPlugin]) -> Bench:
    kind = typing.get_type_hints(plugin.build)["mission"]
    assert kind in BENCHES, f"{plugin.__name__} is built for {kind.__name__}, for which this suite has no bench yet"
    return BENCHES[kind]()


class BoundedTracker(Tracker, Protocol):
    """A tracker that says how well it tracks."""

    @property
    def bound(self) -> Any: ...


@pytest.fixture(scope="module")
def tracker(plugin: type[ControllerPlugin], bench: Bench) -> BoundedTracker:
    return cast(BoundedTracker, plugin.build(plugin.Config(), bench.mission)[1])


def on_plan(bench: Bench, t: float, error: Array | None = None) -> Estimate:
    x = bench.reference(bench.plan, t)
    return Estimate(t, x if error is None else x + error)


def test_conforms_to_the_protocol(tracker: BoundedTracker, bench: Bench) -> None:
    assert isinstance(tracker, Tracker)
    assert whole_ticks(tracker.period, bench.dt, "period") >= 1


@pytest.mark.honoured("plug-in", "tracker: the bound that it states")
@certified
def test_states_the_bound_that_it_keeps(tracker: BoundedTracker) -> None:
    stated = dataclasses.asdict(tracker.bound)
    assert stated.keys() >= {"horizontal", "vertical", "speed", "feedback"}
    assert all(math.isfinite(value) and value > 0.0 for value in stated.values())


def test_on_the_plan_it_commands_the_plans_input(tracker: BoundedTracker, bench: Bench) -> None:
    for k, (t, end) in enumerate(zip(bench.plan.t[:-1], bench.plan.t[1:], strict=True)):
        middle = 0.5 * float(t + end)
        command = tracker.command(middle, on_plan(bench, middle), bench.plan)
        np.testing.assert_allclose(command, bench.plan.u[k], rtol=0.0, atol=bench.tolerance)


def test_across_the_end_of_an_arc_it_commands_the_mean(tracker: BoundedTracker, bench: Bench) -> None:
    for k, t in enumerate(bench.plan.t[1:-1]):
        before = float(t) - 0.25 * tracker.period
        command = tracker.command(before, on_plan(bench, before), bench.plan)
        mean = 0.25 * bench.plan.u[k] + 0.75 * bench.plan.u[k + 1]
        np.testing.assert_allclose(command, mean, rtol=0.0, atol=bench.tolerance)


@certified
def test_after_the_end_of_the_plan_it_holds_the_rest(tracker: BoundedTracker, bench: Bench) -> None:
    for late in (0.0, 1.0, 1e6):
        t = bench.plan.t_end + late
        np.testing.assert_allclose(tracker.command(t, on_plan(bench, t), bench.plan), 0.0, atol=1e-6)
        displaced = tracker.command(t, on_plan(bench, t, np.full(6, 50.0)), bench.plan)
        assert np.isfinite(displaced).all()


direction = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array).filter(lambda d: float(np.linalg.norm(d)) > 1e-3)


@certified
@given(direction=direction, size=st.floats(1e-3, 1e4), of_speed=st.booleans(), part=st.floats(0.01, 0.99))
def test_the_feedback_points_against_the_error_and_keeps_its_bound(
    tracker: BoundedTracker, bench: Bench, direction: Array, size: float, of_speed: bool, part: float
) -> None:
    t = part * bench.plan.t_end
    error = np.zeros(6)
    error[3 * of_speed : 3 * of_speed + 3] = size * direction / np.linalg.norm(direction)
    there = tracker.command(t, on_plan(bench, t), bench.plan)
    feedback = tracker.command(t, on_plan(bench, t, error), bench.plan) - there
    length, unit = float(np.linalg.norm(feedback)), error[3 * of_speed : 3 * of_speed + 3] / size
    assert length <= tracker.bound.feedback * (1.0 + 1e-9)
    assert feedback @ unit <= -0.999 * length < 0.0


@certified
def test_an_input_that_leaves_room_for_the_feedback_keeps_the_vehicles_bound(
    tracker: BoundedTracker, bench: Bench
) -> None:
    room = bench.input_max - tracker.bound.feedback
    scale = room / float(np.linalg.norm(bench.plan.u, axis=1).max())
    x = bench.plan.x.copy()
    x[:, 3:] *= scale
    x[:, :3] = x[0, :3] + scale * (x[:, :3] - x[0, :3])
    plan = dataclasses.replace(bench.plan, x=x, u=bench.plan.u * scale)
    rng = np.random.default_rng(0)
    for t in np.linspace(0.0, plan.t_end, 200):
        estimate = Estimate(float(t), bench.reference(plan, float(t)) + rng.normal(0.0, 30.0, 6))
        assert np.linalg.norm(tracker.command(float(t), estimate, plan)) <= bench.input_max + 1e-6


@certified
@pytest.mark.parametrize("seed", range(2))
def test_in_gusts_it_keeps_its_stated_bound(tracker: BoundedTracker, bench: Bench, seed: int) -> None:
    plant, bound = flight.PointMass(bench.plan.x[0], TICK), tracker.bound
    gusts = Gusts(GUST.rms, GUST.time_constant, GUST.limit, np.random.default_rng(seed))
    every = whole_ticks(tracker.period, TICK, "period")
    command, t, x = np.zeros(3), [], []
    for k in range(round(20.0 / TICK)):
        t.append(plant.t)
        x.append(plant.state("vehicle"))
        if k % every == 0:
            command = tracker.command(plant.t, Estimate(plant.t, x[-1]), bench.plan)
        gusts.act(plant, 1)
        plant.step({"vehicle": command})
    error = np.array(x) - state_at(bench.plan, np.array(t))
    largest = np.max([np.hypot(*error[:, :2].T), np.abs(error[:, 2]), np.linalg.norm(error[:, 3:], axis=1)], axis=1)
    assert (largest <= [bound.horizontal, bound.vertical, bound.speed]).all()
    assert largest[0] > 0.1 * bound.horizontal  # the bound is not an empty one


@pytest.mark.parametrize("more", [-1, 1])
def test_an_estimate_of_another_shape_is_refused_and_not_read_beyond_its_end(
    tracker: BoundedTracker, bench: Bench, more: int
) -> None:
    wrong = np.zeros(bench.plan.x.shape[1] + more)
    with pytest.raises(ValueError, match="shape"):
        tracker.command(1.0, Estimate(1.0, wrong), bench.plan)


@certified
def test_a_plan_of_whole_numbers_is_flown_as_any_other(tracker: BoundedTracker, bench: Bench) -> None:
    x = np.array([[0, 0, 500, 0, 0, 0], [0, 0, 500, 3, 0, 0]])
    whole = Plan(np.array([0.0, 1.0]), x, np.array([[3, 0, 0]]), np.zeros(1, np.int64))
    exact = dataclasses.replace(whole, x=x.astype(float), u=whole.u.astype(float))
    for t in (0.3, 0.7):
        estimate = Estimate(t, bench.reference(exact, t))
        np.testing.assert_allclose(tracker.command(t, estimate, whole), tracker.command(t, estimate, exact))
