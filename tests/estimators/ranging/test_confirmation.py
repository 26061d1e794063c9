"""Confirmation of a pose by a replay of the readings on the way to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mathnavi.estimators.ranging.bank_kernels import no_hypotheses
from mathnavi.estimators.ranging.confirmation import Confirmation
from mathnavi.estimators.ranging.kalman_kernels import RaySensors
from mathnavi.estimators.ranging.model import RangeModel
from mathnavi.estimators.ranging.noise_kernels import WINDOW
from mathnavi.estimators.ranging.replay_kernels import replay
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import BEAN
from mathnavi.models.unicycle.kernels import integrate
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import RangeQuality

WALL, ANGLES, DT, NOISE = BEAN, (0.0, 0.5 * math.pi), 0.02, 0.01
MISSION = RangingMission(WALL, ANGLES, RangeQuality(absolute=NOISE), period=DT)
MODEL, OFF = RangeModel(MISSION), np.array([0.002, -0.001, 0.003])


Way = tuple[Array, Array, Array, Array]


def sensors(absolute: float = NOISE) -> RaySensors:
    return RaySensors(MODEL.angles, 0.0, absolute, 15.0, 0.002, 10.0)


def way(count: int, turn_rate: float = 0.6) -> Way:
    """Poses (n, 3), exact ranges (n, l), inputs (n, 2) and times (n,) of a robot that drives on a circle."""
    poses, u = [np.array([0.2, 0.3, 0.4])], np.array([0.3, turn_rate])
    for _ in range(count - 1):
        poses.append(integrate(poses[-1], u[0], u[1], DT))
    ranges = np.array([WALL.ranges(pose, MODEL.angles)[0] for pose in poses])
    return np.array(poses), ranges, np.tile(u, (count, 1)), DT * np.arange(count)


def replayed(
    x: Array, driven: tuple[Array, Array, Array, Array], slip: float = 0.0
) -> tuple[int, int, float, Array, Array]:
    _, ranges, inputs, times = driven
    found: tuple[int, int, float, Array, Array] = replay(
        np.append(x, 0.0), ranges, inputs, times, MODEL.wall, sensors(), np.zeros(2), 0.0, slip
    )
    return found


def test_without_slip_it_is_the_least_squares_fit_of_the_pose() -> None:
    driven = way(60)
    poses, ranges, inputs, _ = driven
    x = poses[-1] + OFF
    rays, beyond, _, d, P = replayed(x, driven)

    def expected(x: Array) -> Array:
        back, found = x, []
        for k in range(len(inputs) - 1, -1, -1):
            found.append(WALL.ranges(back, MODEL.angles)[0])
            back = integrate(back, inputs[k, 0], inputs[k, 1], -DT)
        return np.concatenate(found[::-1])

    step = 1e-6 * np.eye(3)
    J = np.array([(expected(x + e) - expected(x - e)) / 2e-6 for e in step]).T
    A = J.T @ J / NOISE**2
    assert (rays, beyond) == (2 * len(poses), 0)
    assert np.allclose(P, np.linalg.inv(A + 1e-4 * np.eye(3)), rtol=1e-3)
    assert np.allclose(d, np.linalg.solve(A, J.T @ (ranges.ravel() - expected(x))) / NOISE**2, atol=1e-6)
    assert np.allclose(d, -OFF, atol=2e-4)  # but for the second order


def test_slip_on_the_way_makes_the_readings_say_less() -> None:
    driven = way(60)
    strict, slipping = (np.linalg.eigvalsh(replayed(driven[0][-1], driven, q)[4]) for q in (0.0, 1e-4))
    assert (slipping > 4.0 * strict).all()


def test_a_way_through_the_wall_is_beyond_the_gate() -> None:
    driven = way(100, turn_rate=0.0)
    pose = np.array([*WALL.centre, 0.0])
    outside = np.array([not WALL.contains(pose[:2] - (0.3 * DT * k, 0.0)) for k in range(len(driven[0]))])
    rays, beyond, *_ = replayed(pose, (driven[0], driven[1], 20.0 * driven[2], driven[3]))
    assert rays > 0
    assert beyond >= len(ANGLES)
    assert not outside.any()  # as slowly as it drove the way is within


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
    poses, ranges, inputs, times = way(round(seconds / DT))
    confirmation = Confirmation(MODEL, DT, (1, 0.0, 0.0), is_known=False)
    confirmation.begin(0)
    for rho, u, t in zip(ranges, faster * inputs, times, strict=True):
        confirmation.remember(t, rho, u)
    bank = no_hypotheses(1, len(ANGLES), WINDOW)
    bank.x[0], bank.P[0], bank.slip[0] = np.append(poses[-1] + off, 0.0), 0.0, 1e-3 * (faster - 1.0)
    assert confirmation.confirms(bank, 0, 1e-4 * np.eye(3), sensors(), 2.5, 1.0) == confirmed
    assert confirmation.is_confirmed == confirmed
    assert confirmation.is_refuted == (not confirmed and seconds > 1.0)
    confirmation.change()
    assert not confirmation.is_confirmed
    assert not confirmation.is_refuted


def test_of_a_known_start_nothing_has_to_be_confirmed() -> None:
    assert Confirmation(MODEL, DT, (1, 0.0, 0.0), is_known=True).is_confirmed
