"""Confirmation of a pose by a replay of the readings on the way to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.ranging.bank_kernels import add, no_hypotheses
from mathnavi.estimators.ranging.confirmation import Confirmation
from mathnavi.estimators.ranging.kalman_kernels import RaySensors
from mathnavi.estimators.ranging.last_readings import LastReadings, Way
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.noise_kernels import WINDOW
from mathnavi.estimators.ranging.replay_kernels import Fit, Reckoning, refit, replay
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality

WALL, ANGLES, DT, NOISE = BEAN, (0.0, 0.5 * math.pi), 0.02, 0.01
MISSION = RangingMission(WALL, ANGLES, RangeQuality(absolute=NOISE), period=DT)
MODEL, OFF = RangeModel(MISSION), np.array([0.002, -0.001, 0.003])
CANDIDATES, NO_SYMMETRY = MODEL.anywhere(np.random.default_rng(0), 300), (1, 0.0, 0.0)


def sensors(absolute: float = NOISE) -> RaySensors:
    return RaySensors(MODEL.rays, 0.0, absolute, 15.0, 0.002, 10.0)


def driven(count: int, turn_rate: float = 0.6) -> tuple[Array, Way]:
    """Poses (n, 3) of a robot that drives on a circle, and its readings, which are exact."""
    poses, u = [np.array([0.2, 0.3, 0.4])], np.array([0.3, turn_rate])
    for _ in range(count - 1):
        poses.append(integrate(poses[-1], u[0], u[1], DT))
    ranges = np.array([WALL.ranges(pose, MODEL.angles)[0] for pose in poses])
    return np.array(poses), Way(ranges, np.tile(u, (count, 1)), DT * np.arange(count))


def replayed(x: Array, way: Way, slip: float = 0.0) -> Fit:
    fit: Fit = replay(np.append(x, 0.0), way, MODEL.wall, sensors(), Reckoning(np.zeros(2), 0.0, slip))
    return fit


def test_without_slip_it_is_the_least_squares_fit_of_the_pose() -> None:
    poses, way = driven(60)
    x = poses[-1] + OFF
    fit = replayed(x, way)

    def expected(x: Array) -> Array:
        back, found = x, []
        for k in range(len(way.inputs) - 1, -1, -1):
            found.append(WALL.ranges(back, MODEL.angles)[0])
            back = integrate(back, way.inputs[k, 0], way.inputs[k, 1], -DT)
        return np.concatenate(found[::-1])

    step = 1e-6 * np.eye(3)
    J = np.array([(expected(x + e) - expected(x - e)) / 2e-6 for e in step]).T
    A = J.T @ J / NOISE**2
    assert (fit.rays, fit.beyond) == (2 * len(poses), 0)
    assert np.allclose(fit.P, np.linalg.inv(A + 1e-4 * np.eye(3)), rtol=1e-3)
    assert np.allclose(fit.d, np.linalg.solve(A, J.T @ (way.ranges.ravel() - expected(x))) / NOISE**2, atol=1e-6)
    assert np.allclose(fit.d, -OFF, atol=2e-4)  # but for the second order


def test_slip_on_the_way_makes_the_readings_say_less() -> None:
    poses, way = driven(60)
    strict, slipping = (np.linalg.eigvalsh(replayed(poses[-1], way, q).P) for q in (0.0, 1e-4))
    assert (slipping > 4.0 * strict).all()


def test_from_poses_near_the_truth_a_fit_ends_there() -> None:
    poses, way = driven(60)
    states = np.column_stack((poses[-1] + 0.05 * np.random.default_rng(0).standard_normal((5, 3)), np.zeros(5)))
    nis, covariances = refit(states, way, MODEL.wall, sensors(), Reckoning(np.zeros(2), 0.0, 0.0))
    assert np.allclose(states[:, :3], poses[-1], atol=1e-3)
    assert (nis < 1.0).all()
    assert np.allclose(covariances, replayed(poses[-1], way).P, rtol=0.1)


def test_a_way_through_the_wall_is_beyond_the_gate() -> None:
    _, way = driven(100, turn_rate=0.0)
    middle = np.array([*WALL.centre, 0.0])
    assert replayed(middle, way).rays == 2 * len(way.times)
    fit = replayed(middle, way._replace(inputs=20.0 * way.inputs))
    assert fit.beyond >= len(ANGLES)
    assert not WALL.contains(middle[:2] - (20.0 * 0.3 * way.times[-1], 0.0))


@pytest.mark.parametrize(
    ("off", "seconds", "faster", "confirmed"),
    [
        ((0.0, 0.0, 0.0), 2.2, 1.0, True),
        ((0.0, 0.0, 0.0), 0.8, 1.0, False),  # too short a way
        ((0.2, -0.1, 0.1), 2.2, 1.0, False),
        ((0.0, 0.0, 0.0), 2.2, 1.2, False),  # wheels that slip: two rays do not determine a pose without odometry
    ],
)
def test_a_pose_is_confirmed_by_readings_that_determine_it(
    off: tuple[float, float, float], seconds: float, faster: float, confirmed: bool
) -> None:
    (poses, way), last = driven(round(seconds / DT)), LastReadings(200, len(ANGLES))
    confirmation = Confirmation(MODEL, last, CANDIDATES, NO_SYMMETRY, is_known=False)
    for rho, u, t in zip(way.ranges, faster * way.inputs, way.times, strict=True):
        last.remember(t, rho, u)
    bank = no_hypotheses(1, len(ANGLES), WINDOW)
    bank.x[0], bank.P[0], bank.slip[0] = np.append(poses[-1] + off, 0.0), 0.0, 1e-3 * (faster - 1.0)
    others = confirmation.attempt(bank, 0, 1e-4 * np.eye(3), sensors(), 2.5, 1.0)
    assert confirmation.is_confirmed == confirmed
    assert confirmation.is_refuted == (not confirmed and seconds > 1.0)
    for x in others.states:  # of those that are wrong, the truth
        assert np.abs(x[:3] - poses[-1]).max() < 0.02
    confirmation.change()
    assert not confirmation.is_confirmed
    assert not confirmation.is_refuted


def test_a_pose_that_fits_as_well_is_found_before_another_is_confirmed() -> None:
    """At rest two rays fit many poses; on a way that goes round a square, four."""
    square = Polygon((((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)),))
    model = RangeModel(RangingMission(square, ANGLES, RangeQuality(absolute=NOISE), period=DT))
    last, pose, u = LastReadings(200, len(ANGLES)), np.array([0.3, 0.2, 0.4]), np.array([0.3, 0.6])
    for k in range(100):
        pose = integrate(pose, u[0], u[1], DT) if k else pose
        last.remember(DT * k, square.ranges(pose, model.angles)[0], u)
    bank = no_hypotheses(8, len(ANGLES), WINDOW)
    bank.x[0], bank.score[0], bank.P[0] = np.append(pose, 0.0), 0.0, 1e-4 * np.eye(4)
    candidates = model.anywhere(np.random.default_rng(0), 300)
    for symmetry, count in ((NO_SYMMETRY, 3), ((4, 0.0, 0.0), 0)):
        confirmation = Confirmation(model, last, candidates, symmetry, is_known=False)
        others = confirmation.attempt(bank, 0, 1e-4 * np.eye(3), sensors(), 2.5, 1.0)
        assert len(others.states) == count
        assert confirmation.is_confirmed == (count == 0)
        turned = np.arctan2(others.states[:, 1], others.states[:, 0]) - np.arctan2(pose[1], pose[0])
        assert np.allclose(np.sort(np.mod(turned, 2.0 * math.pi)), 0.5 * math.pi * np.arange(1, count + 1), atol=0.02)
        add(bank, 0, others.states, others.covariances, symmetry)
        assert np.isfinite(bank.score).sum() == 4


def test_of_a_known_start_nothing_has_to_be_confirmed() -> None:
    last = LastReadings(200, len(ANGLES))
    assert Confirmation(MODEL, last, CANDIDATES, NO_SYMMETRY, is_known=True).is_confirmed
