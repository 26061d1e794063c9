"""The flights that the optimisers find: optimal, exact, and the same where two of them see the same problem."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from mathnavi.controllers.missile.optimiser import JointOptimiser, MissileTrajectory, Optimiser
from mathnavi.controllers.missile.pitch_and_yaw import PitchAndYaw
from mathnavi.controllers.missile.problem import TerminalCondition
from mathnavi.controllers.missile.shooting import Failed
from mathnavi.controllers.ocp.distribution import Equidistributed, Fixed, NodeDistribution
from mathnavi.controllers.ocp.methods.adaptation import solve
from mathnavi.controllers.ocp.problems.missile import missile
from mathnavi.controllers.ocp.transcriptions.low_order import MultipleShooting
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.coordinates import PLANAR, SPATIAL
from mathnavi.models.missile.dynamics import NOMINAL
from mathnavi.models.missile.mission import CASES
from tests.controllers.missile.flights import INPUT_MAX

DOWN = -0.5 * math.pi
NODES = 25
UNIFORM = Fixed()
CLEARANCE = 5.0
IN_PLANE = [0, 2, 3, 5, 7, 9]  # of a state in space


def planar(
    case: str, limits: tuple[float, ...] = INPUT_MAX[PLANAR], nodes: NodeDistribution = UNIFORM
) -> JointOptimiser:
    return JointOptimiser(CASES[case], NOMINAL, PLANAR, limits, NODES, "fatrop", nodes, CLEARANCE)


def joint(case: str) -> JointOptimiser:
    return JointOptimiser(CASES[case], NOMINAL, SPATIAL, INPUT_MAX[SPATIAL], NODES, "fatrop", UNIFORM, CLEARANCE)


def pitch_and_yaw(case: str) -> PitchAndYaw:
    axial, normal, _, moment, _ = INPUT_MAX[SPATIAL]
    limits = axial, normal, normal, moment, moment
    return PitchAndYaw(CASES[case], NOMINAL, limits, limits, NODES, "fatrop", UNIFORM, CLEARANCE)


def condition(
    x: float = 700.0, y: float = 0.0, z: float = 0.0, velocity: tuple[float, float, float] = (0, 0, 0)
) -> TerminalCondition:
    return TerminalCondition(np.array([x, y, z]), np.array(velocity, float), DOWN)


def level(case: str, heading: float = 0.0) -> Array:
    """The spatial start at 10 m."""
    x = np.zeros(10)
    x[[0, 6, 9]] = CASES[case].speed, math.radians(heading), -10.0
    return x


def found(optimiser: Optimiser, start: Array, at: TerminalCondition, t: float = 0.0) -> MissileTrajectory:
    flight = optimiser.optimise(t, start, at)
    assert isinstance(flight, MissileTrajectory), flight
    return flight


@pytest.mark.parametrize("case", ["SM", "FAST"])
def test_the_pitch_plane_is_the_problem_of_the_design_study(case: str) -> None:
    start = level(case)[IN_PLANE]
    flight = found(planar(case), start, condition())
    wanted = solve(missile(case), NODES, scheme=MultipleShooting(2))
    assert flight.cost == pytest.approx(wanted.cost, rel=1e-6)
    assert flight.duration == pytest.approx(wanted.duration, rel=1e-5)
    np.testing.assert_allclose(flight.u, wanted.u[:, 0], rtol=0.0, atol=5.0)


@pytest.mark.parametrize(
    ("make", "start", "at"),
    [
        (planar, level("SM2")[IN_PLANE], condition(velocity=(30.0, 0.0, 0.0))),
        (joint, level("SM2", 20.0), condition(y=150.0, velocity=(20.0, -20.0, 0.0))),
        (pitch_and_yaw, level("SM2", 20.0), condition(y=150.0, velocity=(20.0, -20.0, 0.0))),
        (pitch_and_yaw, level("SM2", -40.0), condition(y=100.0)),
    ],
)
def test_a_flight_starts_where_it_should_joins_and_ends_on_the_target(
    make: Callable[[str], Optimiser], start: Array, at: TerminalCondition
) -> None:
    flight = found(make("SM2"), start, at)
    coordinates = PLANAR if len(start) == 6 else SPATIAL
    np.testing.assert_array_equal(flight.x[0], start)
    for k in range(0, len(flight.u), 7):
        after = coordinates.flow(flight.x[k], flight.u[k], flight.t[k + 1] - flight.t[k])
        np.testing.assert_allclose(flight.x[k + 1], after, rtol=0.0, atol=1e-9)
    assert at.error_of(flight.x[-1], flight.duration, coordinates).norm < 5e-3


@pytest.mark.parametrize(("case", "heading", "y"), [("SM2", 0.0, 150.0), ("SM2", 30.0, 0.0), ("FAST", 0.0, 100.0)])
def test_pitch_and_yaw_taking_turns_come_to_the_optimum_of_the_whole(case: str, heading: float, y: float) -> None:
    start, at = level(case, heading), condition(y=y)
    apart, whole = found(pitch_and_yaw(case), start, at), found(joint(case), start, at)
    assert apart.cost == pytest.approx(whole.cost, rel=5e-3)
    assert np.abs(whole.x[:, 6]).max() > math.radians(5.0)  # the nose has to yaw


def test_in_the_pitch_plane_pitch_and_yaw_are_the_pitch_planner() -> None:
    start = level("SM2")
    apart = found(pitch_and_yaw("SM2"), start, condition())
    plane = found(planar("SM2"), start[IN_PLANE], condition())
    assert apart.duration == pytest.approx(plane.duration, rel=1e-4)
    assert apart.cost == pytest.approx(plane.cost, rel=1e-4)
    np.testing.assert_allclose(apart.x[:, [1, 4, 6, 8]], 0.0, atol=1e-6)


@pytest.mark.parametrize("make", [joint, pitch_and_yaw])
def test_left_and_right_are_alike(make: Callable[[str], Optimiser]) -> None:
    one, other = (found(make("SM2"), level("SM2", side * 20.0), condition(y=side * 100.0)) for side in (1.0, -1.0))
    assert one.cost == pytest.approx(other.cost, rel=1e-6)
    mirrored = np.array([1, -1, 1, 1, -1, 1, -1, 1, -1, 1])
    np.testing.assert_allclose(one.x[-1], mirrored * other.x[-1], atol=1e-3)


def test_a_plan_from_the_last_one_is_the_plan_from_nothing() -> None:
    start, at = level("SM2", 10.0), condition(y=50.0)
    warm = pitch_and_yaw("SM2")
    first = found(warm, start, at)
    later = first.x[30]
    t = float(first.t[30])
    again, fresh = found(warm, later, at, t), found(pitch_and_yaw("SM2"), later, at)
    assert again.cost == pytest.approx(fresh.cost, rel=2e-3)
    assert at.error_of(again.x[-1], again.duration, SPATIAL).norm < 2e-3


def test_limits_are_kept() -> None:
    limits = (2e3, 8e3, 80.0)
    flight = found(planar("SM2", limits), level("SM2")[IN_PLANE], condition())
    reached = np.abs(flight.u).max(axis=0)
    assert (reached <= np.array(limits) * (1.0 + 1e-6)).all()
    assert (reached >= 0.99 * np.array(limits)).any()  # or the test says nothing


def test_pitch_and_yaw_that_ask_for_more_than_the_thrusters_have_are_refused() -> None:
    def optimiser(moment: float, most: float) -> PitchAndYaw:
        limits, hard = (2e4, 6e4, 6e4, moment, moment), (2e4, 6e4, 6e4, most, most)
        return PitchAndYaw(CASES["SM"], NOMINAL, limits, hard, NODES, "ipopt", UNIFORM, CLEARANCE)

    start = level("SM", 40.0)
    failed = optimiser(31.5, 35.0).optimise(0.0, start, condition())
    assert isinstance(failed, Failed)
    assert "times the limit of M" in failed.message
    assert not failed.infeasible
    flight = found(optimiser(31.5, 70.0), start, condition())
    assert 35.0 < np.abs(flight.u[:, 3]).max() <= 70.0


def test_nodes_may_be_equidistributed_while_it_flies() -> None:
    optimiser = planar("SM3", nodes=Equidistributed())
    flight = found(optimiser, level("SM3")[IN_PLANE], condition())
    again = found(optimiser, flight.x[5], condition(), float(flight.t[5]))
    assert np.ptp(np.diff(again.t)) > 0.01
    assert condition().error_of(again.x[-1], again.duration, PLANAR).norm < 2e-3


@pytest.mark.parametrize("make", [joint, pitch_and_yaw])
def test_where_there_is_no_flight_the_reason_is_reported(make: Callable[[str], Optimiser]) -> None:
    start = level("SM2")
    start[6] = math.radians(89.0)  # beyond the yaw that is allowed
    failed = make("SM2").optimise(0.0, start, condition())
    assert isinstance(failed, Failed)
    assert failed.message
