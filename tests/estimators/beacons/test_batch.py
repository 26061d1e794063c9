"""The batch fit of beacons at unknown places: its steps, its covariance, and other places that fit as well."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.beacons.batch import BatchFit
from mathnavi.estimators.beacons.batch_kernels import cost_of, moved, step
from mathnavi.estimators.beacons.model import BeaconModel, bend
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.beacons import exact_readings
from mathnavi.models.unicycle.kernels import integrate

PLACES = np.array([(9.0, 6.0), (-4.0, 7.0)])
QUALITY = mn.BeaconQuality(0.05, outliers=0.02)
START = mn.KnownStart((0.0, 0.0, 0.0), (1e-3, 1e-3, 1e-3))
MISSION = mn.BeaconMission(
    (None, None), ranges=QUALITY, range_scale=0.02, odometry=mn.OdometryQuality((0.02, 0.01), 0.01), period=0.2,
    start=START, surroundings=20.0,
)  # fmt: skip


def driven(turn: float, count: int = 60) -> tuple[BatchFit, BeaconModel, Array]:
    """A batch fit of a drive with exact readings of both beacons, its model, and the state at the end."""
    model = BeaconModel(MISSION)
    batch, pose = BatchFit(model), np.zeros(3)
    model.placed[:] = True
    batch.begin(model.state(pose), model.covariance(np.array(START.deviation)))
    u = np.array([1.0, turn, 1e-4, 1e-5])
    for _ in range(count):
        pose = integrate(pose, u[0], u[1], 0.2)
        batch.move([(0.2, u)])
        batch.read(exact_readings(PLACES, 0, pose))
    return batch, model, np.concatenate([pose, np.zeros(3), PLACES.ravel()])


def _second(cost: Callable[[Array], float], z: Array, i: int, j: int) -> float:
    """Second derivative of a cost by numbers i and j."""
    e = 1e-4 * np.eye(len(z))
    return (
        cost(z + e[i] + e[j]) - cost(z + e[i] - e[j]) - cost(z - e[i] + e[j]) + cost(z - e[i] - e[j])
    ) / 4e-8  # fmt: skip


def test_derivatives_of_a_motion_are_those_of_differences() -> None:
    pieces = np.array([(0.3, 1.2, 0.7, 1e-3, 1e-4), (0.2, 0.9, -0.2, 1e-3, 1e-4)])
    X, theta = np.array([1.0, -2.0, 0.4]), np.array([0.02, -0.03, 0.0])
    _, A, B, Q = moved(X, theta, pieces)
    for k, e in enumerate(1e-6 * np.eye(3)):
        assert (moved(X + e, theta, pieces)[0] - moved(X - e, theta, pieces)[0]) / 2e-6 == pytest.approx(A[:, k])
        if k < 2:
            assert (moved(X, theta + e, pieces)[0] - moved(X, theta - e, pieces)[0]) / 2e-6 == pytest.approx(B[:, k])
    assert np.linalg.eigvalsh(Q)[0] > 0.0


def test_a_step_is_that_of_the_whole_system_and_its_information_that_of_the_newest_state() -> None:
    batch, model, state = driven(0.2, count=5)
    pieces, firsts, readings = batch._data()
    found = batch.fit(state)
    assert found is not None
    rng = np.random.default_rng(0)
    X, theta = found.X + 1e-4 * rng.standard_normal(found.X.shape), found.theta.copy()
    errors = batch._errors * [1.0, 1.0, 0.0, 1.0]  # Gaussian, so that Gauss and Newton's matrix is the cost's
    rest = (batch._prior, pieces, firsts, readings, model.places, model.columns, errors, False)
    dX, dtheta, information = step(X, theta, *rest, 0.0)
    n = X.size

    def cost(z: Array) -> float:
        return float(cost_of(X + z[:n].reshape(X.shape), theta + z[n:], *rest))

    z = np.concatenate([dX.ravel(), dtheta])
    least = cost(z)
    assert least < cost(np.zeros_like(z))
    for _ in range(20):
        assert cost(z + 1e-4 * rng.standard_normal(len(z))) > least
    hessian = np.array([[_second(cost, z, i, j) for j in range(len(z))] for i in range(len(z))])
    covariance = np.linalg.inv(hessian)[-len(found.state) :, -len(found.state) :]
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.linalg.inv(information) / scale == pytest.approx(covariance / scale, abs=0.05)


def test_of_a_bend_the_true_places_are_found_from_an_image_and_no_other_is_as_good() -> None:
    batch, model, state = driven(0.15)
    begin = state.copy()
    begin[model.columns[0] : model.columns[0] + 2] += (0.7, -1.1)
    found = batch.fit(begin)
    assert found is not None
    assert found.state == pytest.approx(state, abs=1e-2)
    alone, rival = batch.alone(found)
    assert rival is None
    assert np.sqrt(np.diag(alone.covariance)[6:]).max() < 0.5


def test_of_a_straight_path_the_image_of_a_beacon_is_as_good() -> None:
    batch, model, state = driven(0.0)
    found = batch.fit(state)
    assert found is not None
    rival = batch.rival(found)
    assert rival is not None
    i, other = rival
    k = int(model.columns[i]) - 3
    assert other.theta[k : k + 2] == pytest.approx(PLACES[i] * (1.0, -1.0), abs=0.1)
    assert batch.alone(found)[1] is not None


def test_without_the_oldest_readings_the_fit_and_its_covariance_stay() -> None:
    batch, _, state = driven(0.15)
    found = batch.fit(state)
    assert found is not None
    batch._marginalise(found, batch._data())
    assert batch.stages < 35
    again = batch.fit(state)
    assert again is not None
    assert again.state == pytest.approx(found.state, abs=1e-3)
    assert np.diag(again.covariance) == pytest.approx(np.diag(found.covariance), rel=0.02)


def test_a_filter_is_not_surer_than_its_readings_make_it() -> None:
    """Of drives of which the filter alone was sure and wrong, by 2 to 5 m, with all places unknown."""
    from tests.estimators.beacons.drives import wandering

    for seed in (9, 28):
        asked, driven_, places = wandering(seed)
        found = mn.estimate("beacon_bank", asked, driven_.log)
        at = np.flatnonzero(found.usable)
        assert len(at)
        off = found.extra["beacons"][at] - places.ravel()
        for i in range(4):
            own = slice(2 * i, 2 * i + 2)
            P = found.extra["beacons_covariance"][at, own, own]
            squares = np.einsum("ki,ki->k", off[:, own], np.linalg.solve(P, off[:, own, None])[..., 0])
            assert (squares > 13.8).mean() < 0.005, "beyond the region of 99.9 %"
        assert np.abs(off[-1]).max() < 2.5


def test_a_beacon_that_is_forgotten_leaves_what_is_known_of_the_other() -> None:
    batch, model, state = driven(0.15)
    found = batch.fit(state)
    assert found is not None
    batch._marginalise(found, batch._data())
    batch.forget(0)
    again = batch.fit(state)
    assert again is not None
    deviation, before = (np.sqrt(np.diag(each.covariance)) for each in (again, found))
    k, other = (int(model.columns[i]) for i in (0, 1))
    assert deviation[k : k + 2] == pytest.approx([MISSION.longest] * 2, rel=0.01)
    assert again.state[other : other + 2] == pytest.approx(PLACES[1], abs=0.02)
    assert (deviation[other : other + 2] > before[other : other + 2]).all()
    assert (deviation[other : other + 2] < 0.3).all()


def test_of_an_arc_the_covariance_holds_what_is_within_three_deviations_along_it() -> None:
    rho, sigma = 4.0, 0.3
    P = np.diag([0.02, sigma]) ** 2  # seen along x_1: across the arc, and along it
    P = P + bend(P, rho)
    for share in np.linspace(-3.0, 3.0, 13):
        angle = share * sigma / rho
        off = rho * np.array([np.cos(angle) - 1.0, np.sin(angle)])
        assert off @ np.linalg.solve(P, off) < 13.8, "the region of 99.9 %"
    assert np.trace(bend(P, 1e-9)) <= P[1, 1] * (1.0 + 1e-9)
    assert np.trace(bend(P, 1e3)) < 1e-6
