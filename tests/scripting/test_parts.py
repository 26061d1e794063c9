"""Parts on their own: they do what they do in the loop, and say what is wrong with what they are given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

import mathnavi as mn
from mathnavi.controllers.ocp.methods.adaptation import redistribute
from mathnavi.controllers.ocp.problems.library import PROBLEMS

START, TARGET = (3000.0, 4000.0, 900.0), (26000.0, 27000.0, 1200.0)
ARM = """
<mujoco><worldbody><body><joint name="hinge" axis="0 1 0" damping="0.1"/>
<geom type="capsule" size="0.04" fromto="0 0 0 0 0 -0.5" mass="1"/></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>
"""


@pytest.fixture(scope="module")
def plan() -> mn.FlightPlan:
    return mn.plan_flight("jacksboro", START, TARGET)


def test_a_plan_is_what_the_scenario_flies(plan: mn.FlightPlan) -> None:
    """Without disturbances the vehicle follows the plan to the end of the mission."""
    run = mn.run("safe-flight", terrain="jacksboro", start=START, target=TARGET)
    np.testing.assert_allclose(plan.state(run.t)[:, :3], run["truth.x"][:, :3], atol=1e-6)
    assert 0.0 < plan.arrival - run.t[-1] < 1.0  # the run ends within the radius of arrival


def test_a_plan_starts_at_rest_ends_at_rest_and_is_certified(plan: mn.FlightPlan) -> None:
    np.testing.assert_allclose(plan.state(-1.0), [*START, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(plan.state(1e4), [*TARGET, 0.0, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(plan.state(plan.arrival)[:3], TARGET, atol=1e-3)
    verdict = mn.certify(plan, "jacksboro", target=TARGET)
    assert verdict
    assert verdict.clearance == plan.clearance("jacksboro") >= 50.0
    assert plan.input(1e4).tolist() == [0.0, 0.0, 0.0]
    assert len(plan.clearances("jacksboro")) == len(plan.u)
    assert "26000" in repr(plan)


def test_the_first_answer_alone_is_a_whole_plan_too() -> None:
    first = mn.plan_flight("jacksboro", START, TARGET, replan=False)
    assert mn.certify(first, "jacksboro", target=TARGET)
    moving = mn.plan_flight("jacksboro", (*START, 50.0, 0.0, 0.0), TARGET, replan=False)
    assert moving.state(0.0)[3] == 50.0


def test_a_radar_is_avoided(plan: mn.FlightPlan) -> None:
    middle = plan.state(0.5 * plan.arrival)[:2]
    around = mn.plan_flight("jacksboro", START, TARGET, radars=[mn.Radar(*middle.tolist(), 3000.0, 10.0)])
    path = around.state(np.linspace(0.0, around.arrival, 500))[:, :2]
    before = plan.state(np.linspace(0.0, plan.arrival, 500))[:, :2]
    assert np.linalg.norm(path - middle, axis=1).min() > np.linalg.norm(before - middle, axis=1).min() + 500.0


@pytest.mark.parametrize(
    ("bounds", "why"),
    [
        ({"clearance_min": 500.0}, "closer to the ground"),
        ({"speed_max": 100.0}, "speed or acceleration"),
        ({"acceleration_max": 10.0}, "speed or acceleration"),
        ({"target": (0.0, 0.0, 1000.0)}, "does not come to rest at the target"),
        ({"tracking": (0.0, 40.0)}, "closer to the ground"),
    ],
)
def test_a_plan_that_breaks_a_bound_is_refused_and_says_why(
    plan: mn.FlightPlan, bounds: dict[str, object], why: str
) -> None:
    verdict = mn.certify(plan, "jacksboro", **bounds)  # type: ignore[arg-type]
    assert not verdict
    assert why in verdict.reason
    assert why in repr(verdict)


def test_a_plan_of_ones_own_is_integrated_exactly_and_judged() -> None:
    ground = mn.HeightField(np.zeros((11, 11)), 100.0)
    own = mn.FlightPlan.from_inputs([0, 10, 20], [100, 100, 60, 0, 0, 0], [[2, 1, 0], [-2, -1, 0]])
    np.testing.assert_allclose(own.x[-1], [300.0, 200.0, 60.0, 0.0, 0.0, 0.0])
    assert own.clearance(ground) == 60.0
    assert mn.certify(own, ground)
    broken = mn.Plan(own.t, own.x + np.eye(3, 6), own.u, own.plan.phase)
    assert mn.certify(broken, ground).status is mn.Status.MALFORMED
    leaving = mn.FlightPlan.from_inputs([0, 10, 20], [100, 100, 60, 0, 0, 0], [[-4, 0, 0], [4, 0, 0]])
    assert mn.certify(leaving, ground).status is mn.FlightStatus.OFF_MAP


@pytest.mark.parametrize("space", [mn.Sphere(2), mn.HyperbolicSpace(2), mn.EuclideanSpace(3)])
def test_a_geodesic_is_observed_on_any_space(space: object) -> None:
    observer = mn.IntrinsicObserver(space, bandwidth=5.0)
    origin = space.origin
    direction = space.vector(origin, np.eye(space.dimension)[0])
    for t in np.arange(0.0, 3.0, 0.01):
        position = space.exp(origin, 0.5 * t * direction)
        estimate = observer.step(0.01, position)
    np.testing.assert_allclose(estimate.position, position, atol=1e-3)
    np.testing.assert_allclose(estimate.velocity, space.transport(origin, position, 0.5 * direction), atol=1e-2)
    assert estimate.status is mn.Status.OK
    assert len(repr(estimate).splitlines()) == 1 + 2 * space.size


def test_a_force_and_a_potential_are_taken_into_account() -> None:
    observer = mn.IntrinsicObserver(mn.EuclideanSpace(1), bandwidth=2.0, potential=lambda p: 9.81 * p[0])
    for t in np.arange(0.0, 3.0, 0.01):
        estimate = observer.step(0.01, [-0.5 * 9.81 * t**2 + 0.5 * t**2], [1.0])
    assert estimate.velocity[0] == pytest.approx(-8.81 * t, rel=0.02)


def test_a_reading_may_be_lost_and_steps_may_differ() -> None:
    observer = mn.IntrinsicObserver(mn.EuclideanSpace(1), bandwidth=5.0)
    t = 0.0
    for k in range(400):
        dt = 0.005 if k % 2 else 0.015
        t += dt
        estimate = observer.step(dt, None if k % 5 == 4 else [2.0 * t])
    assert estimate.t == pytest.approx(t)
    assert estimate.velocity[0] == pytest.approx(2.0, abs=0.01)


@pytest.mark.parametrize("method", ["riemannian_observer", "high_gain", "lagrangian_ekf", "filtered_differences"])
def test_the_velocities_of_any_mechanism_are_observed(method: str, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    model = mujoco.MjModel.from_xml_path(str(path))
    data, observer = mujoco.MjData(model), mn.VelocityObserver(path, method)
    alone = mn.VelocityObserver(model, method)
    for k in range(1000):
        data.ctrl[:] = np.cos(0.004 * k)
        mujoco.mj_step(model, data)
        estimate, same = (each.step(model.opt.timestep, data.qpos, data.ctrl) for each in (observer, alone))
    assert estimate.velocity == pytest.approx(data.qvel, abs=0.05)
    np.testing.assert_allclose(estimate.velocity, same.velocity, atol=1e-9)
    assert "hinge" in repr(estimate)


def test_a_pose_is_found_from_anywhere_within_measured_corners() -> None:
    corners = np.array([(0.0, 0.0), (4.0, -0.2), (4.6, 2.0), (2.4, 3.2), (0.2, 2.4)])
    wall = mn.wall_through(corners[::-1], order=8)  # clockwise
    assert wall.area > 0.0
    assert min(wall.distance(corner) for corner in corners) < 0.3
    angles, pose = [0.0, np.pi / 2], np.array([1.5, 1.0, 0.3])
    bank = mn.FeasibleSetBank(wall, angles, period=0.02)
    for _ in range(400):
        pose += 0.02 * np.array([0.5 * np.cos(pose[2]), 0.5 * np.sin(pose[2]), 0.6])
        estimate = bank.step(0.02, wall.ranges(pose, angles)[0], [0.5, 0.6])
    np.testing.assert_allclose(estimate.pose[:2], pose[:2], atol=0.02)
    assert estimate.covariance is not None
    assert "±" in repr(estimate)
    assert bank.step(0.02, None, [0.0, 0.0]).t == pytest.approx(401 * 0.02)


def test_a_problem_is_stated_and_solved() -> None:
    ocp = mn.OptimalControlProblem("least effort")
    x, v, u = ocp.state("x"), ocp.state("v"), ocp.control("u")
    ocp.duration(1.0), ocp.minimise(running=u**2 / 2), ocp.dynamics(x, v), ocp.dynamics(v, u)
    ocp.start(x, 0.0), ocp.start(v, 0.0), ocp.end(x, 1.0), ocp.end(v, 0.0)
    for solution in (ocp.solve(20), ocp.solve(method="refine")):
        assert solution.ok
        assert solution.cost == pytest.approx(6.0)
        np.testing.assert_allclose(solution["x"], 3.0 * solution.t**2 - 2.0 * solution.t**3, atol=1e-9)
        np.testing.assert_allclose(solution["u"], 6.0 - 12.0 * solution.t, atol=1e-6)
        assert repr(solution).startswith("least effort, ")
    with pytest.raises(KeyError, match="allowed: x, v, u"):
        solution["y"]


def test_a_problem_of_the_literature_is_solved_by_its_name() -> None:
    solution = mn.OptimalControlProblem("Bryson-Denham").solve()
    assert solution.cost == pytest.approx(PROBLEMS["Bryson-Denham"].optimum, abs=1e-3)


def stated(*calls: str) -> Callable[[], object]:
    def solve() -> object:
        ocp = mn.OptimalControlProblem("mine")
        for name in calls:
            ocp.state(name)
        return ocp.solve()

    return solve


GROUND = "jacksboro"
WRONG: dict[str, tuple[type[ValueError], str, Callable[[], object]]] = {
    "terrain": (mn.TerrainError, "nowhere", lambda: mn.plan_flight("nowhere", START, TARGET)),
    "start below ground": (mn.MissionError, "under ground", lambda: mn.plan_flight(GROUND, (0, 0, 0), TARGET)),
    "start of two numbers": (mn.MissionError, "start = ", lambda: mn.plan_flight(GROUND, (0, 0), TARGET)),
    "target off the map": (mn.MissionError, "off the map", lambda: mn.plan_flight(GROUND, START, (-1, 0, 900))),
    "start too fast": (
        mn.MissionError,
        "no certified plan",
        lambda: mn.plan_flight(GROUND, (*START, 0.0, 0.0, -290.0), TARGET),
    ),
    "controller of others": (
        mn.PluginError,
        "is for a MissileMission",
        lambda: mn.plan_flight(GROUND, START, TARGET, controller="missile"),
    ),
    "plan's shapes": (mn.MissionError, "allowed", lambda: mn.FlightPlan.from_inputs([0, 1], [0] * 6, [[0, 0]])),
    "plan's times": (mn.MissionError, "increase", lambda: mn.FlightPlan.from_inputs([1, 0], [0] * 6, [[0, 0, 0]])),
    "observer's field": (mn.FieldError, "did you mean", lambda: mn.IntrinsicObserver(mn.Sphere(3), bandwith=3.0)),
    "observer's value": (mn.FieldError, "bandwidth", lambda: mn.IntrinsicObserver(mn.Sphere(3), bandwidth=-1.0)),
    "potential of a body": (
        mn.FieldError,
        "potential",
        lambda: mn.IntrinsicObserver(mn.RigidBody(1.0), potential=lambda p: p[0]),
    ),
    "reading's shape": (mn.FieldError, r"y has shape", lambda: mn.IntrinsicObserver(mn.Sphere(3)).step(0.1, [1.0])),
    "step back": (mn.FieldError, "dt = -1", lambda: mn.IntrinsicObserver(mn.Sphere(2)).step(-1.0, None)),
    "input's shape": (mn.FieldError, "u = ", lambda: mn.IntrinsicObserver(mn.Sphere(2)).step(0.1, None, [1.0])),
    "bare heights": (mn.TerrainError, "HeightField", lambda: mn.plan_flight(np.zeros((9, 9)), START, TARGET)),
    "not its functions": (mn.ProblemError, r"functions\(\)", lambda: redistribute(mn.OptimalControlProblem("own"), 9)),
    "mechanism": (mn.FieldError, "mechanism = ", lambda: mn.VelocityObserver("nowhere.xml")),
    "method": (mn.PluginError, "did you mean high_gain", lambda: mn.VelocityObserver("two-link", "hi_gain")),
    "no sensors": (mn.FieldError, "angles", lambda: mn.FeasibleSetBank(mn.ellipse(3.0, 2.0), [])),
    "ranges": (mn.FieldError, "ranges", lambda: mn.FeasibleSetBank(mn.ellipse(3, 2), [0]).step(1, [1, 2], [0, 0])),
    "corners": (mn.FieldError, "points", lambda: mn.wall_through([(0, 0), (1, 1)])),
    "crossing wall": (mn.FieldError, "crosses", lambda: mn.wall_through([(0, 0), (2, 2), (2, 0), (0, 1.5)])),
    "nothing stated": (mn.ProblemError, "did you mean Goddard", lambda: mn.OptimalControlProblem("Godard").solve()),
    "no dynamics": (mn.ProblemError, "no dynamics for x", stated("x")),
}


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_named(what: str) -> None:
    kind, words, call = WRONG[what]
    with pytest.raises(kind, match=words):
        call()
