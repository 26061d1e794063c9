"""Active sensing first, then tracking: when it switches, how well it keeps the path, and when it goes back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.controllers.active_sensing.policies import Circle, FigureEight
from mathnavi.controllers.active_sensing.then_track import ReferencePath
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.models.field.curve import BEAN, EGG, Curve
from mathnavi.models.unicycle.mission import DrivePhase
from tests.controllers.active_sensing.robots import FIELD, START, assert_well_formed, built, fly, mission

PATH = {"then": "figure-eight", "speed": 0.3}


def off_path(flown: Array, then: str, curve: Curve) -> float:
    """[m] how far the points (n, 2) flown are off the path at most."""
    pattern = FigureEight(0.3, 8.0) if then == "figure-eight" else Circle(0.3, 8.0)
    points = ReferencePath(pattern, mission(curve)).poses[:, :2]
    return max(float(np.linalg.norm(points - p, axis=1).min()) for p in flown)


@pytest.mark.parametrize(("curve", "then"), [(EGG, "figure-eight"), (BEAN, "circle")])
def test_the_path_is_joined_and_kept_again_and_again(curve: Curve, then: str) -> None:
    task = mission(curve)
    flight = fly(built(task, then=then, speed=0.3), task, START, 22.0)
    assert flight.kinds == ["tracking"]
    assert flight.clearance(curve) >= task.margin - 0.01
    flown = np.array(flight.truth)
    assert off_path(flown[-1000:, :2], then, curve) < 2e-3
    np.testing.assert_allclose(flown[-1, :2], flown[-801, :2], atol=1e-4)  # a cycle later
    for plan in flight.plans:
        assert_well_formed(plan, task)


def test_it_explores_until_the_estimate_is_certain() -> None:
    task = mission()
    believing = lambda t, truth: Estimate(t, truth.copy(), (0.2 if t < 3.0 else 0.01) ** 2 * np.eye(3))  # noqa: E731
    flight = fly(built(task, **PATH), task, START, 6.0, believing)
    assert flight.events == [(pytest.approx(3.0), "tracking")]
    for plan in flight.plans:
        assert (int(plan.phase[0]) == DrivePhase.CRUISE) is (plan.t_start > 3.1)


@pytest.mark.parametrize("worse", ["unsure", "lost"])
def test_when_the_estimate_degrades_it_explores_again(worse: str) -> None:
    task = mission()

    def believing(t: float, truth: Array) -> Estimate:
        bad = 4.0 <= t < 6.0
        size = 0.3 if bad and worse == "unsure" else 0.01
        return Estimate(t, truth.copy(), size**2 * np.eye(3), Status.LOST if bad and worse == "lost" else Status.OK)

    flight = fly(built(task, **PATH), task, START, 10.0, believing)
    switches = [(t, kind) for t, kind in flight.events if kind != "blind"]
    assert [kind for _, kind in switches] == ["tracking", "exploring", "tracking"]
    assert switches[1][0] == pytest.approx(4.0)
    assert switches[2][0] == pytest.approx(6.0)


def test_a_little_less_sure_is_still_sure_enough() -> None:
    task = mission()
    believing = lambda t, truth: Estimate(t, truth.copy(), (0.04 if t < 2.0 else 0.07) ** 2 * np.eye(3))  # noqa: E731
    assert fly(built(task, **PATH), task, START, 5.0, believing).kinds == ["tracking"]


def test_after_an_estimate_that_jumps_it_explores_for_a_second_and_joins_the_path_anew() -> None:
    task, jump = mission(), np.array([1.2, 0.2, 0.0])
    believing = lambda t, truth: Estimate(t, truth + (jump if t >= 5.0 else 0.0), 1e-6 * np.eye(3))  # noqa: E731
    flight = fly(built(task, **PATH), task, START, 12.0, believing)
    assert flight.kinds == ["tracking", "exploring", "tracking"]
    assert flight.events[1][0] == pytest.approx(5.0)


def test_noise_of_the_estimate_moves_the_robot_no_more_than_itself() -> None:
    task, rng = mission(), np.random.default_rng(0)
    deviation = np.array([0.02, 0.02, 0.02])
    believing = lambda t, truth: Estimate(t, truth + deviation * rng.standard_normal(3), np.diag(deviation**2))  # noqa: E731
    flown = np.array(fly(built(task, **PATH), task, START, 25.0, believing).truth)
    assert off_path(flown[-1000:, :2], "figure-eight", FIELD) < 0.03


def test_a_path_is_kept_in_spite_of_wheels_that_turn_too_slowly() -> None:
    """The robot carries out 95 % of its command; without feedback it would be .5 m off after a cycle."""
    task = mission()
    planner, tracker = built(task, **PATH)

    class Weak:
        period = tracker.period

        def command(self, t: float, estimate: Estimate, plan: object) -> Array:
            return 0.95 * tracker.command(t, estimate, plan)  # type: ignore[arg-type]

    flown = np.array(fly((planner, Weak()), task, START, 25.0).truth)
    assert off_path(flown[-1000:, :2], "figure-eight", FIELD) < 0.03


def test_the_path_lies_about_the_centre_along_the_longer_axis() -> None:
    for curve, angle in ((FIELD, 0.0), (Curve(((0.5, 0.0, 1.0, 0.0), (0.0, -1.5, 3.0, 0.0))), math.pi / 2.0)):
        points = ReferencePath(FigureEight(0.5, 8.0), mission(curve)).poses[:-1, :2] - curve.centre
        np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=1e-9)
        long, short = (
            np.ptp(points @ np.array([[math.cos(angle)], [math.sin(angle)]])),
            np.ptp(points @ np.array([[-math.sin(angle)], [math.cos(angle)]])),
        )
        assert (long, short) == (pytest.approx(1.5, abs=2e-3), pytest.approx(0.556, abs=2e-3))


def test_a_path_that_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match=r"cycle = 40\.0: a path of .* does not keep 0\.3 m from the ellipse"):
        built(mission(), then="figure-eight", cycle=40.0)


def test_round_a_corner_there_is_no_way_until_the_robot_has_come_round_it() -> None:
    """Beyond the concave part of this wall no straight line leads to a path about its centre."""
    bent = Curve(((0.0, 0.0, 0.0, 0.0), (2.8, 0.0, 0.0, 1.6), (0.0, 0.0, -1.3, 0.0)), "bent")
    task, behind = mission(bent, margin=0.2), np.array([2.25, -0.85, 1.0])
    assert bent.contains(behind, task.margin)
    assert ReferencePath(Circle(0.05, 8.0), task).way_from(behind) is None
    flight = fly(built(task, then="circle", speed=0.05), task, behind, 3.0)
    assert flight.kinds == ["no-way"]
    assert flight.clearance(bent) > 0.19
