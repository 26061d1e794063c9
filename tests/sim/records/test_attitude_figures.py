"""Errors of attitudes on quaternions that are made by hand."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.estimators.invariant.inclination_kernels import quaternion_covariance, turned
from mathnavi.interfaces.signals import Array
from mathnavi.models.inertial_mission import STATES
from mathnavi.models.quaternion import rotation
from mathnavi.sim.records.attitude_figures import (
    attitude_errors,
    attitude_figures,
    continued,
    inclination_covariance,
    is_quaternion,
)

Q = turned(np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.7, -0.4, 1.9]))


def world_turned(q: Array, theta: Array) -> Array:
    """Quaternion (4,) of q turned by theta (3,) [rad] about the axes of the world."""
    return turned(q, rotation(q).T @ theta)


@pytest.mark.parametrize(
    ("tilt", "heading"), [((0.3, 0.0), 0.0), ((0.0, -0.2), 1.0), ((0.1, 0.2), -2.5), ((0, 0), 3.0)]
)
def test_a_turn_about_the_vertical_and_one_about_a_horizontal_axis_are_told_apart(
    tilt: tuple[float, float], heading: float
) -> None:
    q = world_turned(world_turned(Q, np.array([0.0, 0.0, heading])), np.array([*tilt, 0.0]))
    for sign in (1.0, -1.0):
        inclination, turn = attitude_errors(sign * q[None], Q[None])
        assert inclination[0] == pytest.approx(tilt, abs=1e-9)
        assert turn[0] == pytest.approx(heading, abs=1e-9)


def test_the_covariance_of_the_components_gives_that_of_the_inclination() -> None:
    root = 0.1 * np.random.default_rng(0).standard_normal((3, 3))
    P = root @ root.T
    back = inclination_covariance(Q[None], quaternion_covariance(Q, P)[None])[0]
    np.testing.assert_allclose(back, P[:2, :2], atol=1e-12)


def test_errors_as_large_as_declared_have_a_nees_of_one_and_others_are_counted() -> None:
    rng, n = np.random.default_rng(1), 2000
    truth = np.tile(Q, (n, 1))
    q = np.array([world_turned(Q, e) for e in rng.standard_normal((n, 3)) * [0.02, 0.02, 0.0]])
    P = np.array([quaternion_covariance(each, np.diag([4e-4, 4e-4, 3.0])) for each in q])
    usable = np.arange(n) >= 100
    figures = attitude_figures(q, P, usable, truth)
    assert figures["nees_mean"] == pytest.approx(1.0, abs=0.1)
    assert figures["usable_share"] == pytest.approx(0.95)
    assert figures["wrong_share"] < 0.01
    assert figures["inclination_rms_deg"] == pytest.approx(np.degrees(0.02 * np.sqrt(2.0)), rel=0.05)
    assert attitude_figures(q, 0.04 * P, usable, truth)["wrong_share"] > 0.5
    truth[50:] = np.nan
    assert attitude_figures(q, P, usable, truth) == {"usable_share": 0.0, "wrong_share": 0.0}


def test_signs_of_quaternions_are_made_continuous_and_their_names_are_known() -> None:
    row = np.array([world_turned(Q, np.array([0.0, 0.0, 0.1 * k])) for k in range(40)])
    flipped = row * np.where(np.arange(40) % 3 == 1, -1.0, 1.0)[:, None]
    np.testing.assert_allclose(continued(flipped), row if row[0] @ flipped[0] > 0.0 else -row, atol=1e-12)
    assert is_quaternion(STATES)
    assert not is_quaternion(("x [m]", "y [m]", "heading [rad]"))
    assert not is_quaternion(("w", "x", "y"))
