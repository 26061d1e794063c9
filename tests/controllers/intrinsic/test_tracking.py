"""Intrinsic tracking: from anywhere onto the reference, as the law of its error says, and only where inputs suffice."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.intrinsic.law import InverseForce, TrackingGains, wanted_force
from mathnavi.controllers.intrinsic.references import AttitudeReference, AttitudeTracking, JointTracking
from mathnavi.interfaces.signals import Array, Estimate, PlanRequest, Status
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, hyperbolic_space, sphere
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.manifold.systems import PointSystem, RigidBody, linear
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.system import MechanismSystem
from tests.mechanisms import chain

GEARED = """<mujoco><worldbody><body><joint name="hinge" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body></worldbody>
<actuator><motor joint="hinge" gear="100" ctrllimited="true" ctrlrange="-.2 .2"/></actuator></mujoco>"""
BODY, GAINS, H = RigidBody(0.05), TrackingGains(9.0, 6.0), 0.005


def followed(start: Array, seconds: float) -> list[float]:
    """Angles [rad] of a body to the reference, its state being known."""
    reference, manifold = AttitudeReference(1.0, 1.5, H), BODY.manifold
    inverse, x, angles = InverseForce(BODY), start, []
    for k in range(round(seconds / H)):
        wanted = reference.state(k)
        feedforward = inverse(wanted[:4], wanted[4:], reference.acceleration(k))
        u = inverse(x[:4], x[4:], wanted_force(BODY, GAINS, x, wanted, feedforward))
        x = BODY.flow(x, u, H)
        angles.append(2.0 * manifold.distance(x[:4], reference.state(k + 1)[:4]))
    return angles


@settings(max_examples=10)
@given(st.integers(0, 2**32 - 1))
def test_a_body_finds_the_reference_from_anywhere(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = followed(np.concatenate([sphere(3).draw(rng), rng.uniform(-3.0, 3.0, 3)]), 4.0)
    assert angles[-1] < 0.02


def test_the_error_falls_as_its_law_says() -> None:
    """e'' + 6 e' + 9 e = 0 from e(0) = .5, e'(0) = 0, about an axis that the reference does not turn about."""
    start = np.array([math.cos(0.25), math.sin(0.25), 0.0, 0.0])
    rest, none, x = np.array([1.0, 0, 0, 0, 0, 0, 0]), np.zeros(3), np.concatenate([start, np.zeros(3)])
    inverse, found = InverseForce(BODY), []
    for _ in range(200):
        x = BODY.flow(x, inverse(x[:4], x[4:], wanted_force(BODY, GAINS, x, rest, none)), H)
        found.append(2.0 * math.asin(x[1]))
    t = H * np.arange(1, 201)
    assert found == pytest.approx(0.5 * (1.0 + 3.0 * t) * np.exp(-3.0 * t), abs=0.005)


@pytest.mark.parametrize("space", [sphere(2), hyperbolic_space(2)], ids=["sphere", "hyperbolic"])
def test_beside_a_reference_that_moves_it_falls_alike_on_every_curvature(space: ConstantCurvature) -> None:
    """|v_r|^2 = 16 > k_p: without the term of the curvature the error would grow on the hyperbolic plane."""
    system, none = PointSystem(space, linear(0.0, 0)), np.zeros(3)
    o = space.origin
    reference = system.state(o, space.vector(o, np.array([4.0, 0.0])))
    beside = space.exp(o, space.vector(o, np.array([0.0, 0.02])))
    x = system.state(beside, space.transport(o, beside, reference[3:]))
    found = []
    for _ in range(200):
        wanted = wanted_force(system, GAINS, x, reference, none)
        x, reference = system.flow(x, wanted, H), system.flow(reference, none, H)
        found.append(space.distance(x[:3], reference[:3]))
    t = H * np.arange(1, 201)
    assert found == pytest.approx(0.02 * (1.0 + 3.0 * t) * np.exp(-3.0 * t), abs=6e-4)


def test_an_input_is_found_within_the_range_of_its_actuator(tmp_path: Path) -> None:
    path = tmp_path / "geared.xml"
    path.write_text(GEARED, encoding="utf-8")
    system = MechanismSystem(build_model(path))
    x, v, u = np.array([0.3]), np.array([0.5]), np.array([0.03])
    assert InverseForce(system)(x, v, system.force(x, v, u)) == pytest.approx(u)


@pytest.mark.parametrize("axis", range(3))
def test_from_exactly_half_a_turn_away_one_of_the_two_ways_is_taken(axis: int) -> None:
    rest, x = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(7)
    x[1 + axis] = 1.0
    inverse = InverseForce(BODY)
    for _ in range(600):
        x = BODY.flow(x, inverse(x[:4], x[4:], wanted_force(BODY, GAINS, x, rest, np.zeros(3))), H)
    assert abs(x[0]) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("angle", [1.0, 3.0])
def test_a_body_with_a_full_inertia_finds_the_reference(angle: float, tmp_path: Path) -> None:
    path = tmp_path / "body.xml"
    motors = "".join(f'<motor joint="ball" gear="{gear}"/>' for gear in ("1 0 0", "0 1 0", "0 0 1"))
    path.write_text(
        '<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="ball" type="ball"/>'
        '<inertial pos="0 0 0" mass="1" fullinertia="0.02 0.05 0.055 0.005 -0.004 0.003"/></body></worldbody>'
        f"<actuator>{motors}</actuator></mujoco>"
    )
    mission = LagrangianMission(MechanismSystem(build_model(path)), period=H)
    planner, tracker = AttitudeTracking.build(AttitudeTracking.Config(), mission)
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle) / math.sqrt(3.0)
    x = np.array([c, s, -s, s, 0.0, 0.0, 0.0])
    for begin in range(0, 800, 100):
        plan = planner.plan(PlanRequest(begin * H, begin * H, Estimate(0.0, x), None))
        assert plan.ok, plan.message
        for k in range(begin, begin + 100):
            x = mission.system.flow(x, tracker.command(k * H, Estimate(k * H, x), plan), H)
    assert x[:4] @ plan.x[100][:4] == pytest.approx(math.copysign(1.0, x[:4] @ plan.x[100][:4]), abs=1e-4)


def test_a_mechanism_keeps_its_reference() -> None:
    mission = LagrangianMission(MechanismSystem(build_model("two-link")))
    planner, tracker = JointTracking.build(JointTracking.Config(), mission)
    start = np.zeros(4)
    plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, start), None))
    assert plan.ok
    assert len(plan.t) == len(plan.x) == len(plan.u) + 1
    x = plan.x[0]
    for k in range(200):
        x = mission.system.flow(x, tracker.command(k * 1e-3, Estimate(k * 1e-3, x), plan), 1e-3)
    assert x == pytest.approx(plan.x[200], abs=3e-3)
    with pytest.raises(ValueError, match="shape"):
        tracker.command(0.0, Estimate(0.0, np.zeros(5)), plan)


def test_plans_are_the_reference_whatever_the_estimate_says() -> None:
    mission = LagrangianMission(BODY)
    planner, tracker = AttitudeTracking.build(AttitudeTracking.Config(), mission)
    first = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, mission.start_state), None))
    second = planner.plan(PlanRequest(0.1, 0.1, Estimate(0.1, mission.start_state), first))
    assert np.array_equal(first.x[100:], second.x[:101])
    nothing = Estimate(0.0, np.full(7, math.nan))
    assert planner.plan(PlanRequest(0.2, 0.2, nothing, second)).status is Status.NOT_FINITE
    blind = Estimate(0.0, mission.start_state, status=Status.INITIALISING)
    assert np.array_equal(tracker.command(0.0, blind, first), np.zeros(3))


def test_inputs_that_do_not_suffice_are_refused() -> None:
    with pytest.raises(ValueError, match=r"inputs that move .* allowed for tracking: one for each"):
        InverseForce(PointSystem(hyperbolic_space(2), linear(1.0, 0)))
    with pytest.raises(ValueError, match="joint_tracking on the attitudes; allowed: on slides and hinges"):
        JointTracking.build(JointTracking.Config(), LagrangianMission(BODY))
    with pytest.raises(ValueError, match=r"attitude_tracking on .*; allowed: on the attitudes"):
        AttitudeTracking.build(AttitudeTracking.Config(), LagrangianMission(MechanismSystem(build_model("two-link"))))


@pytest.mark.parametrize("name", ["servo-six", "servo-gripper"])
def test_servos_are_inverted_by_their_own_law_and_no_saturation_stops_a_plan(name: str) -> None:
    """At 2 rad from its set point a servo is saturated: a probe of its input would find no effect."""
    mission = LagrangianMission(MechanismSystem(build_model(name)))
    system, n = mission.system, mission.system.manifold.size
    inverse, x, v = InverseForce(system), np.full(n, 0.02), np.full(n, 0.01)
    u = np.full(len(system.inputs), 0.021)
    assert inverse(x, v, system.force(x, v, u)) == pytest.approx(u, abs=1e-9)
    ranges = np.array([[-3.0, 3.0] if "six" in name else [-2.0, 2.0]] * 6).T
    far = np.concatenate([ranges[1], x[6:]])
    saturated = inverse(far, 30.0 + 0.0 * v, np.zeros(n))
    assert np.isfinite(saturated).all()
    assert (np.abs(saturated[:6]) <= ranges[1]).all()
    planner, _ = JointTracking.build(JointTracking.Config(), mission)
    plan = planner.plan(PlanRequest(0.0, 0.0, Estimate(0.0, np.zeros(2 * n)), None))
    assert plan.ok, plan.message
    limited = system.joint_ranges
    assert (plan.x[:, :n] >= limited[0]).all()
    assert (plan.x[:, :n] <= limited[1]).all()


def test_an_actuator_with_a_law_of_the_user_s_is_refused_by_name() -> None:
    other = '<actuator><general name="odd" joint="joint_0" gaintype="user"/></actuator>'
    with pytest.raises(ValueError, match="actuators = odd; allowed for tracking"):
        InverseForce(MechanismSystem(chain("h", other)))
