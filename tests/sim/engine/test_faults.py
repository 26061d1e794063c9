"""Faults: as often as they say, the same for the same seed, and otherwise out of the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mathnavi.interfaces.protocols import Planner, Plant
from mathnavi.interfaces.signals import Array, Estimate, Event, Plan, PlanRequest, Status
from mathnavi.sim.engine.faults import (
    ConstantWrench,
    CorruptedPlan,
    Delayed,
    Disturbed,
    FailingSolver,
    Gusts,
    PositionJumps,
)
from tests import flight

START = flight.at_rest((0.0, 0.0, 100.0))
GOOD = Plan(
    np.array([0.0, 1.0, 2.0]),
    np.vstack([START, START + np.array([0.5, 0, 0, 1.0, 0, 0]), START + np.array([1.0, 0, 0, 0, 0, 0])]),
    np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]),
    np.zeros(2, np.int64),
    solve_ms=0.25,
)
FIRST = PlanRequest(0.0, 0.0, Estimate(0.0, START), None)
LATER = PlanRequest(10.0, 11.0, Estimate(10.0, START), GOOD)


@dataclass
class Good:
    """A planner without faults."""

    period: float = 1.0
    asked: list[PlanRequest] = field(default_factory=list)

    def plan(self, request: PlanRequest) -> Plan:
        self.asked.append(request)
        return GOOD


Wrap = Callable[[Planner, float, np.random.Generator], Planner]

FAULTS: dict[str, tuple[Wrap, Callable[[Plan], bool]]] = {
    "fails": (FailingSolver, lambda plan: plan.status is Status.SOLVER_FAILED),
    "corrupts": (CorruptedPlan, lambda plan: bool(np.isnan(plan.x).any())),
    "delays": (lambda planner, rate, rng: Delayed(planner, 2.5, rate, rng), lambda plan: plan.ready == 12.5),
}

fault = pytest.mark.parametrize("name", FAULTS)


@fault
@pytest.mark.parametrize("rate", [0.0, 0.3, 1.0])
def test_a_planners_fault_strikes_at_its_rate(name: str, rate: float) -> None:
    wrap, struck = FAULTS[name]
    planner = wrap(Good(), rate, np.random.default_rng(0))
    assert isinstance(planner, Planner)
    assert planner.period == 1.0
    hits = [struck(planner.plan(LATER)) for _ in range(2000)]
    assert abs(np.mean(hits) - rate) <= 4.0 * math.sqrt(rate * (1.0 - rate) / 2000)


@fault
def test_what_is_not_struck_is_the_planners_own_answer(name: str) -> None:
    wrap, struck = FAULTS[name]
    planner = wrap(Good(), 0.5, np.random.default_rng(0))
    plans = [planner.plan(LATER) for _ in range(50)]
    assert all(plan is GOOD for plan in plans if not struck(plan))


@fault
def test_the_first_plan_is_never_struck(name: str) -> None:
    wrap, _ = FAULTS[name]
    planner = wrap(Good(), 1.0, np.random.default_rng(0))
    assert all(planner.plan(FIRST) is GOOD for _ in range(20))


@fault
def test_every_request_reaches_the_planner(name: str) -> None:
    inner = Good()
    planner = FAULTS[name][0](inner, 1.0, np.random.default_rng(0))
    for request in (FIRST, LATER, LATER):
        planner.plan(request)
    assert inner.asked == [FIRST, LATER, LATER]


@fault
def test_the_same_seed_strikes_the_same_requests(name: str) -> None:
    wrap, struck = FAULTS[name]

    def hits(seed: int) -> list[bool]:
        planner = wrap(Good(), 0.5, np.random.default_rng(seed))
        return [struck(planner.plan(LATER)) for _ in range(100)]

    assert hits(1) == hits(1) != hits(2)


@fault
@pytest.mark.parametrize("rate", [-0.1, 1.1, math.nan, math.inf])
def test_what_is_no_rate_is_refused(name: str, rate: float) -> None:
    with pytest.raises(ValueError, match=r"rate = .*allowed: 0 to 1"):
        FAULTS[name][0](Good(), rate, np.random.default_rng(0))


@pytest.mark.parametrize("latency", [-1.0, math.nan, math.inf])
def test_what_is_no_latency_is_refused(latency: float) -> None:
    with pytest.raises(ValueError, match="latency"):
        Delayed(Good(), latency, 0.5, np.random.default_rng(0))


def test_the_least_faults_are_allowed() -> None:
    rng = np.random.default_rng(0)
    assert Delayed(Good(), 0.0, 1.0, rng).plan(LATER).ready == LATER.t
    assert blown(0.0, 1e-3, 1e-3, 2).tolist() == [[0.0] * 3] * 2
    plant = flight.PointMass(START, 0.1)
    PositionJumps(0.0, 0.1, rng).act(plant, 1)
    np.testing.assert_array_equal(plant.state("vehicle"), START)


def test_a_corrupted_plan_leaves_the_planners_own_alone() -> None:
    CorruptedPlan(Good(), 1.0, np.random.default_rng(0)).plan(LATER)
    assert np.isfinite(GOOD.x).all()


def test_a_failure_keeps_the_time_that_the_solver_took() -> None:
    assert FailingSolver(Good(), 1.0, np.random.default_rng(0)).plan(LATER).solve_ms == GOOD.solve_ms


class Forces(flight.PointMass):
    """A point mass that notes the forces on it."""

    def __init__(self) -> None:
        super().__init__(START, 0.05)
        self.forces: list[Array] = []
        self.torques: list[Array] = []

    def apply_wrench(self, name: str, force: Array, torque: Array | None = None) -> None:
        self.forces.append(force.copy())
        self.torques += [] if torque is None else [torque.copy()]
        super().apply_wrench(name, force, torque)


def blown(rms: float, time_constant: float, limit: float, ticks: int, seed: int = 0) -> Array:
    """(ticks, 3) forces of a gust."""
    plant, gusts = Forces(), Gusts(rms, time_constant, limit, np.random.default_rng(seed))
    for _ in range(ticks):
        assert list(gusts.act(plant, 1)) == []
    return np.array(plant.forces)


def test_gusts_have_their_strength_and_their_memory() -> None:
    force = blown(1.5, 2.0, 1e9, 100_000)
    np.testing.assert_allclose(force.std(axis=0), 1.5, rtol=0.1)
    np.testing.assert_allclose(force.mean(axis=0), 0.0, atol=0.15)
    lag = round(2.0 / 0.05)
    memory = (force[lag:] * force[:-lag]).mean() / (force**2).mean()
    assert memory == pytest.approx(math.exp(-1.0), abs=0.06)


@given(rms=st.floats(0.0, 50.0), limit=st.floats(0.1, 10.0), seed=st.integers(0, 1000))
def test_no_gust_is_longer_than_its_limit(rms: float, limit: float, seed: int) -> None:
    force = blown(rms, 3.0, limit, 50, seed)
    assert np.linalg.norm(force, axis=1).max() <= limit * (1.0 + 1e-12)


def test_the_same_seed_gives_the_same_gusts() -> None:
    np.testing.assert_array_equal(blown(1.0, 3.0, 4.0, 100, 5), blown(1.0, 3.0, 4.0, 100, 5))
    assert not np.array_equal(blown(1.0, 3.0, 4.0, 100, 5), blown(1.0, 3.0, 4.0, 100, 6))


def test_moments_come_beside_the_forces_and_keep_a_limit_of_their_own() -> None:
    plant = Forces()
    gusts = Gusts(300.0, 2.0, 900.0, np.random.default_rng(2), moment_rms=20.0, moment_limit=50.0)
    for _ in range(20_000):
        gusts.act(plant, 1)
    force, torque = np.array(plant.forces), np.array(plant.torques)
    np.testing.assert_allclose(torque.std(axis=0), 19.0, rtol=0.1)  # clipped
    assert np.linalg.norm(torque, axis=1).max() <= 50.0 * (1.0 + 1e-12)
    assert abs(np.corrcoef(force[:, 0], torque[:, 0])[0, 1]) < 0.15
    with pytest.raises(ValueError, match="gust moment rms"):
        Gusts(1.0, 1.0, 1.0, np.random.default_rng(0), moment_rms=-1.0)


def test_without_a_strength_of_theirs_there_are_no_moments() -> None:
    plant = Forces()
    Gusts(1.0, 1.0, 2.0, np.random.default_rng(0)).act(plant, 1)
    assert plant.torques == []


def test_a_constant_wrench_never_changes() -> None:
    plant, wrench = Forces(), ConstantWrench((400.0, 0.0, -10.0), (0.0, 20.0, 0.0))
    for _ in range(3):
        assert list(wrench.act(plant, 4)) == []
    np.testing.assert_array_equal(plant.forces, [[400.0, 0.0, -10.0]] * 3)
    np.testing.assert_array_equal(plant.torques, [[0.0, 20.0, 0.0]] * 3)
    for wrong in ((1.0, 2.0), (1.0, 2.0, math.nan)):
        with pytest.raises(ValueError, match="constant torque"):
            ConstantWrench((0.0, 0.0, 0.0), wrong)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("gust rms", (-1.0, 3.0, 4.0)),
        ("gust rms", (math.nan, 3.0, 4.0)),
        ("time constant", (1.0, 0.0, 4.0)),
        ("gust limit", (1.0, 3.0, 0.0)),
        ("gust limit", (1.0, 3.0, math.nan)),
    ],
)
def test_what_is_no_gust_is_refused(name: str, arguments: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match=name):
        Gusts(*arguments, np.random.default_rng(0))


def test_a_jump_displaces_the_vehicle_just_before_each_planning_period() -> None:
    plant = flight.PointMass(START, 0.1)
    disturbed = Disturbed(plant, [PositionJumps(20.0, 0.5, np.random.default_rng(3))])
    assert isinstance(disturbed, Plant)
    positions = [disturbed.state("vehicle")[:3]]
    events: list[Event] = []
    for _ in range(21):
        events += disturbed.step({"vehicle": np.zeros(3)})
        positions.append(disturbed.state("vehicle")[:3])
    jumps = np.diff(positions, axis=0)
    ticks = np.flatnonzero(jumps.any(axis=1)) + 1  # the tick that finds the vehicle displaced
    np.testing.assert_array_equal(ticks, [5, 10, 15, 20])
    assert np.abs(jumps).max() <= 20.0
    assert [event.kind for event in events] == 4 * ["position-jump"]
    np.testing.assert_array_equal(disturbed.state("vehicle")[3:], 0.0)


@pytest.mark.parametrize("half_width", [-1.0, math.nan, math.inf])
def test_what_is_no_jump_is_refused(half_width: float) -> None:
    with pytest.raises(ValueError, match="position jump"):
        PositionJumps(half_width, 1.0, np.random.default_rng(0))


def test_a_plant_without_disturbances_is_the_plant() -> None:
    plant, twin = Disturbed(flight.PointMass(START, 0.1), []), flight.PointMass(START, 0.1)
    rng = np.random.default_rng(0)
    for _ in range(50):
        u = rng.normal(size=3)
        plant.step({"vehicle": u})
        twin.step({"vehicle": u})
    assert (plant.t, plant.dt, plant.names) == (twin.t, twin.dt, twin.names)
    np.testing.assert_array_equal(plant.state("vehicle"), twin.state("vehicle"))
    assert plant.state_names("vehicle") == twin.state_names("vehicle")
    assert plant.sensor_sizes("vehicle") == twin.sensor_sizes("vehicle")
    assert plant.sensors("vehicle") == twin.sensors("vehicle")
    np.testing.assert_array_equal(plant.sense("vehicle")[0].value, twin.sense("vehicle")[0].value)
