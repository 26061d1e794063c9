"""The invariant behind "never collides, always arrives", whatever the planner answers.

At every planning tick before arrival: the vehicle is on its plan, the plan is certified, and it ends by gamma V_0. A
planner that fails, raises, lies or dawdles in any order changes nothing about it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mathnavi.controllers.flight.certificate import Certificate, TrackingBound
from mathnavi.controllers.flight.certified import Certified
from mathnavi.controllers.flight.completion import ArcList
from mathnavi.controllers.flight.planner import StopAndHover, complete_by
from mathnavi.controllers.flight.plugin import FlightConfig, FlightController
from mathnavi.controllers.flight.tracker import CriticallyDamped, tracking_bound
from mathnavi.estimators.full_state import FullState, FullStateConfig
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Array, Plan, PlanRequest, Status
from mathnavi.models.aerial.dynamics import state_at
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.sim.engine.agent_runner import Agent
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.engine.loop import simulate
from mathnavi.sim.metrics.flight import flown_clearance
from tests import flight

DT = 1.0 / 30.0  # [s] tick of the vehicle without MuJoCo
MISSION = flight.mission(control_period=DT)
BOUND = tracking_bound(0.8, MISSION)
HELD = CriticallyDamped(DT, 0.8, BOUND).held
CERTIFICATE = Certificate.for_mission(MISSION, BOUND, HELD)


def detour(request: PlanRequest, way: Callable[[ArcList], None]) -> Plan:
    """Brake into hover from where the plan being flown is at the hand-over, and go on by ``way``."""
    assert request.current is not None
    arcs = ArcList.begin(request.t_start, state_at(request.current, request.t_start))
    v = arcs.x[-1][3:]
    arcs.add(-v / 10.0, 10.0, FlightPhase.MANOEUVRE)
    arcs.rest()
    way(arcs)
    return arcs.plan(0.0, 0.0)


def straight(arcs: ArcList) -> None:
    """To the target as the crow flies: through the ridge, as long as that is in between."""
    way = CERTIFICATE.target - arcs.x[-1][:3]
    distance = float(np.linalg.norm(way))
    duration = max(2.0 * distance / 290.0, np.sqrt(4.0 * distance / 20.0), 1.0)  # 290 m/s and 20 m/s^2 at most
    for sign in (1.0, -1.0):
        arcs.add(sign * 4.0 * way / duration**2, 0.5 * duration, FlightPhase.CRUISE)
    arcs.rest()


def dawdling(arcs: ArcList) -> None:
    """A minute of hover, and then the way by completion."""
    arcs.add(np.zeros(3), 60.0, FlightPhase.HOVER)
    complete_by(arcs, CERTIFICATE)


def pulsing(arcs: ArcList) -> None:
    """Two seconds of pulses shorter than a control period, and then the way by completion."""
    for _ in range(60):
        for sign in (1.0, -1.0):
            arcs.add(np.array([0.0, 0.0, sign * 30.0]), 0.5 * DT, FlightPhase.CRUISE)
    arcs.rest()
    complete_by(arcs, CERTIFICATE)


def with_nan(array: Array) -> Array:
    out = array.copy()
    out.flat[out.size // 2] = np.nan
    return out


def valid(plan: Plan, request: PlanRequest) -> Plan:
    return plan


def slow(plan: Plan, request: PlanRequest) -> Plan:
    return dataclasses.replace(plan, ready=request.t_start)


def late(plan: Plan, request: PlanRequest) -> Plan:
    return dataclasses.replace(plan, ready=request.t_start + 0.5)


def failing(plan: Plan, request: PlanRequest) -> Plan:
    return Plan.failure(Status.SOLVER_FAILED, "no solution")


def raising(plan: Plan, request: PlanRequest) -> Plan:
    raise FloatingPointError("a bug")


def not_finite(plan: Plan, request: PlanRequest) -> Plan:
    return dataclasses.replace(plan, u=with_nan(plan.u)) if plan.ok else plan


def torn(plan: Plan, request: PlanRequest) -> Plan:
    return dataclasses.replace(plan, u=plan.u[1:]) if plan.ok else plan


def beside(plan: Plan, request: PlanRequest) -> Plan:
    """Certified in itself, but 10 m above the plan being flown."""
    return dataclasses.replace(plan, x=plan.x + np.array([0.0, 0.0, 10.0, 0.0, 0.0, 0.0])) if plan.ok else plan


def overtaken(plan: Plan, request: PlanRequest) -> Plan:
    """A plan that should have started a period ago."""
    return dataclasses.replace(plan, t=plan.t - (request.t_start - request.t)) if plan.ok else plan


def into_the_ridge(plan: Plan, request: PlanRequest) -> Plan:
    return detour(request, straight)


def overdue(plan: Plan, request: PlanRequest) -> Plan:
    return detour(request, dawdling)


def faster_than_commands(plan: Plan, request: PlanRequest) -> Plan:
    return detour(request, pulsing)


def detouring(plan: Plan, request: PlanRequest) -> Plan:
    """May be flown, but is a bad choice."""
    return detour(request, lambda arcs: complete_by(arcs, CERTIFICATE))


def nonsense(plan: Plan, request: PlanRequest) -> Any:
    return None


ANSWERS: tuple[Callable[[Plan, PlanRequest], Plan], ...] = (
    valid,
    slow,
    late,
    failing,
    raising,
    not_finite,
    torn,
    beside,
    overtaken,
    into_the_ridge,
    overdue,
    detouring,
    faster_than_commands,
    nonsense,
)


GRIDS = (
    FlightConfig(nodes=7),
    FlightConfig(),
    FlightConfig(horizon=40.0, stretch=1.2, period=5.0 / 3.0),
    FlightConfig(nodes=7, horizon=25.0, stretch=1.6, period=2.0),
    FlightConfig(nodes=9, horizon=10.0, stretch=0.8, period=10.0),  # the whole plan is flown before the next one
)
STRETCHED = GRIDS[2]


class Scripted:
    """A planner that does to its plans what a script says, the first included."""

    def __init__(self, planner: Planner, script: Sequence[Callable[[Plan, PlanRequest], Plan]]) -> None:
        self.period = planner.period
        self._planner = planner
        self._script: Iterator[Callable[[Plan, PlanRequest], Plan]] = cycle(script)

    def plan(self, request: PlanRequest) -> Plan:
        answer = next(self._script)
        if request.current is None and answer in (into_the_ridge, overdue, detouring, faster_than_commands):
            return Plan.failure(Status.INFEASIBLE, "there is nothing to leave yet")
        return answer(self._planner.plan(request), request)


class Watched:
    """Sees every request, and keeps a list of what is wrong with the plan that is being flown."""

    def __init__(self, planner: Certified, factor: float, certificate: Certificate) -> None:
        self.period = planner.period
        self._planner, self._factor, self._certificate = planner, factor, certificate
        self._flown: Plan | None = None
        self.deadline = np.inf  # [s] gamma V_0
        self.ticks = 0
        self.broken: list[str] = []  # the loop would take an assertion for a planner's bug

    def plan(self, request: PlanRequest) -> Plan:
        if request.current is not None:
            self._examine(request, request.current)
        return self._planner.plan(request)

    def _examine(self, request: PlanRequest, current: Plan) -> None:
        self.ticks += 1
        if self._flown is None:
            self.deadline = self._factor * current.t_end
        elif current is not self._flown:
            gap = float(np.abs(current.x[0] - state_at(self._flown, current.t_start)).max())
            self._expect(gap <= 1e-6, f"jumps by {gap}")
        self._flown = current
        self._expect(current.ready <= current.t_start + 1e-9, "was late")
        self._expect(not BOUND.broken_by(request.estimate.x - state_at(current, request.t)), "is not where it is")
        refusal = self._certificate.check(current)
        self._expect(refusal is None, f"is not certified: {refusal}")
        self._expect(current.t_end <= self.deadline + 1e-9, f"ends at {current.t_end}")

    def _expect(self, truth: bool, message: str) -> None:
        if not truth:
            self.broken.append(message)


def flown(
    planner: Planner,
    script: Sequence[Callable[[Plan, PlanRequest], Plan]],
    mission: FlightMission,
    certificate: Certificate = CERTIFICATE,
    bound: TrackingBound = BOUND,
) -> tuple[Watched, Recording]:
    """The flight until the vehicle arrives, for five minutes at most; the invariant holds at every planning tick."""
    factor = mission.deadline_factor
    fallback = partial(StopAndHover, period=planner.period)
    wrapped = Certified(Scripted(planner, script), fallback, certificate, bound, factor)
    watched = Watched(wrapped, factor, certificate)
    agent = Agent(FullState(FullStateConfig(), mission), watched, CriticallyDamped(DT, 0.8, bound))
    target = np.array(mission.target)
    recording = simulate(
        flight.PointMass(flight.at_rest(mission.start), DT),
        {"vehicle": agent},
        300.0,
        lambda t, truths: bool(np.linalg.norm(truths["vehicle"][:3] - target) <= mission.arrival_radius),
    )
    assert not watched.broken
    return watched, recording


@given(
    script=st.lists(st.sampled_from(ANSWERS), min_size=1, max_size=40),
    config=st.sampled_from(GRIDS),
    factor=st.sampled_from([1.0, 1.1, 1.3]),
)
@settings(max_examples=40)
@example(script=[valid], config=FlightConfig(), factor=1.3)
@example(script=[raising], config=FlightConfig(), factor=1.0)
@example(script=[late], config=FlightConfig(), factor=1.3)
@example(script=[nonsense], config=FlightConfig(), factor=1.3)
@example(script=[overdue], config=FlightConfig(), factor=1.3)
@example(script=[valid, *10 * [detouring]], config=FlightConfig(), factor=1.3)
@example(script=[*3 * [valid], *40 * [into_the_ridge]], config=FlightConfig(), factor=1.3)
@example(script=[valid, *5 * [faster_than_commands]], config=FlightConfig(), factor=1.3)
@example(script=[valid, failing, late], config=STRETCHED, factor=1.0)
@example(script=[*3 * [valid], *40 * [into_the_ridge]], config=STRETCHED, factor=1.3)
def test_whatever_the_planner_answers_the_vehicle_is_safe_and_arrives_in_time(
    script: list[Callable[[Plan, PlanRequest], Plan]], config: FlightConfig, factor: float
) -> None:
    mission: FlightMission = dataclasses.replace(MISSION, deadline_factor=factor)
    planner, _ = FlightController.build(config, mission)
    watched, recording = flown(planner, script, mission)
    assert watched.ticks * watched.period > 15.0  # [s]
    x = recording.truths["vehicle"]
    assert np.linalg.norm(x[-1, :3] - mission.target) <= mission.arrival_radius
    assert recording.t[-1] <= watched.deadline
    assert flown_clearance(recording.t, x, mission).min() >= mission.clearance_min
    assert np.linalg.norm(x[:, 3:], axis=1).max() <= mission.speed_max
    assert np.linalg.norm(recording.agents["vehicle"].commands, axis=1).max() <= mission.acceleration_max + 1e-6


ANYWHERE = tuple(answer for answer in ANSWERS if answer not in (into_the_ridge, overdue, detouring))
AROUND = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)


@given(
    script=st.lists(st.sampled_from(ANYWHERE), min_size=1, max_size=20),
    rows=st.integers(15, 60),
    columns=st.integers(15, 60),
    reach=st.floats(0.0, 25.0),
    over=st.floats(0.0, 20.0),
    spacing=st.sampled_from([120.0, 200.0]),
)
@settings(max_examples=8)
@example(script=[valid], rows=15, columns=60, reach=0.5, over=0.0, spacing=200.0)
@example(script=[valid, failing], rows=60, columns=15, reach=25.0, over=0.0, spacing=120.0)
def test_whatever_its_size_and_the_shape_of_its_map_no_part_of_the_vehicle_is_lower_than_allowed(
    script: list[Callable[[Plan, PlanRequest], Plan]],
    rows: int,
    columns: int,
    reach: float,
    over: float,
    spacing: float,
) -> None:
    terrain = HeightField(flight.mountains().z[:rows, :columns], spacing)
    ends = [
        flight.above(terrain, (share * terrain.width, share * terrain.depth), over + 3.0 * reach + 20.0)
        for share in (0.15, 0.8)
    ]
    mission = FlightMission(terrain, ends[0], ends[1], reach + over, control_period=DT, reach=reach)
    bound = tracking_bound(0.8, mission)
    certificate = Certificate.for_mission(mission, bound)
    planner, _ = FlightController.build(FlightConfig(nodes=7, margin=0.0), mission)
    watched, recording = flown(planner, script, mission, certificate, bound)
    x = recording.truths["vehicle"]
    if not recording.agents["vehicle"].plans:
        np.testing.assert_array_equal(x[-1], x[0])  # without a certified plan it stays where it is
        return
    assert np.linalg.norm(x[-1, :3] - mission.target) <= mission.arrival_radius
    assert recording.t[-1] <= watched.deadline
    for share in (0.5, 1.0):
        east, north = (x[:, axis, None] + share * reach * f(AROUND) for axis, f in enumerate((np.cos, np.sin)))
        assert terrain.contains(east, north).all()
        assert (x[:, 2, None] - terrain.height(east, north)).min() >= mission.clearance_min
