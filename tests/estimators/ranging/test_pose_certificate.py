"""Certificates of poses: what is certified is alone, and what is not is listed, held against poses drawn densely."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from mathnavi.estimators.ranging.certified import RangeCertified, RangeCertifiedConfig
from mathnavi.estimators.ranging.pose_certificate import PoseCertificate, PoseCertificateConfig
from mathnavi.estimators.ranging.pose_certificate_kernels import distance_grid, explains
from mathnavi.interfaces.signals import Array, Measurement
from mathnavi.models.field.curve import BEAN, EGG, Curve, ellipse
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import OdometryQuality, RangeQuality

FOUR, TWO = (0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi), (0.0, 0.5 * math.pi)
U, DT = np.array([0.5, 0.5]), 0.05
STARTS = {"ellipse": (0.8, -0.6, 0.4), "bean": (1.2, -0.4, 0.3), "egg": (0.6, -0.7, 0.2)}
WALLS = {"ellipse": ellipse(3.0, 1.8), "bean": BEAN, "egg": EGG}
CONFIG = PoseCertificateConfig()


def mission(curve: Curve, angles: tuple[float, ...] = FOUR, noise: float = 0.02) -> RangingMission:
    return RangingMission(curve, angles, RangeQuality(noise), OdometryQuality((0.02, 0.02)), period=DT)


def driven(
    task: RangingMission, start: tuple[float, ...], seed: int = 0, config: PoseCertificateConfig = CONFIG, u: Array = U
) -> tuple[PoseCertificate, Array]:
    """A certificate that has seen 4.5 s of a drive, and the true pose at its end."""
    certificate, rng, x = PoseCertificate(config, task), np.random.default_rng(seed), np.array(start)
    for k in range(91):
        x = task.flow(x, u, DT) if k else x
        rho = task.curve.ranges(x, task.alpha)[0]
        noisy = rho * (1.0 + task.ranging.relative * rng.standard_normal(len(rho)))
        certificate.note(k * DT, noisy, u + 0.02 * rng.standard_normal(2))
    return certificate, x


def apart(one: Array, other: Array) -> tuple[float, float]:
    """Distance [m] and angle [rad]."""
    return math.hypot(*(one - other)[:2]), abs(math.remainder(one[2] - other[2], 2.0 * math.pi))


def test_in_a_wall_without_symmetry_the_true_pose_is_certified() -> None:
    certificate, x = driven(mission(BEAN), STARTS["bean"])
    found = certificate.check(x)
    assert found.certified
    assert found.complete
    assert found.others.shape == (0, 3)


@pytest.mark.parametrize("seed", range(3))
def test_in_an_ellipse_the_image_is_listed(seed: int) -> None:
    task = mission(WALLS["ellipse"])
    certificate, x = driven(task, STARTS["ellipse"], seed)
    found = certificate.check(x)
    assert not found.certified
    (image,) = task.curve.images(x)[1:]
    distance, angle = apart(found.others[0], image)
    assert distance < 0.2
    assert angle < 0.2


def test_a_wall_that_four_turns_map_onto_itself_has_three_images() -> None:
    square = Curve(((0.0,) * 4, (2.0, 0.0, 0.0, 2.0), (0.0,) * 4, (0.2, 0.0, 0.0, -0.2)), "square")
    assert square.symmetry == 4
    certificate, x = driven(mission(square), (0.5, -0.6, 0.3))
    found = certificate.check(x)
    assert not found.certified
    for image in square.images(x)[1:]:
        assert any(apart(other, image)[0] < 0.3 for other in found.others)


def test_a_wrong_pose_is_not_certified_and_the_true_one_is_listed() -> None:
    certificate, x = driven(mission(BEAN), STARTS["bean"])
    found = certificate.check(x + np.array([0.9, 0.1, 1.0]))
    assert not found.certified
    assert min(apart(other, x)[0] for other in found.others) < 0.2


@pytest.mark.parametrize(("name", "angles"), [("ellipse", FOUR), ("bean", TWO), ("egg", FOUR)])
def test_no_pose_that_explains_the_readings_is_missing_from_a_complete_answer(
    name: str, angles: tuple[float, ...]
) -> None:
    """Drawn all over the room, and densely about the answers: what explains is near the estimate or another."""
    rng, checked, config = np.random.default_rng(1), 0, dataclasses.replace(CONFIG, radius=0.8, angle=0.8)
    wall, polyline = WALLS[name].wall, WALLS[name].polyline
    for seed in range(2):
        certificate, x = driven(mission(WALLS[name], angles, 0.01), STARTS[name], seed, config)
        found = certificate.check(x)
        assert found.complete
        answers = [certificate.at_middle(each) for each in (x, *found.others)]
        low, high = [*polyline.min(axis=0), -math.pi], [*polyline.max(axis=0), math.pi]
        clouds = [answer + 0.1 * rng.standard_normal((1500, 3)) for answer in answers]
        rays, _, outliers, limit = certificate.constraints()
        poses = np.vstack([rng.uniform(low, high, (8000, 3)), *clouds])
        explained = [pose for pose in poses if explains(wall, rays, outliers, limit, pose)]
        checked += len(explained)
        for pose in explained:
            near = [apart(pose, answer) for answer in answers]
            assert any(distance <= 0.8 and angle <= 0.8 for distance, angle in near)
    assert checked > 30


def test_the_true_pose_explains_its_readings_with_the_declared_probability() -> None:
    """Of 40 runs with a probability of .05 six or fewer exclude it, as in 98.6 % of such series."""
    config, missed = dataclasses.replace(CONFIG, probability=0.05), 0
    task = mission(EGG, noise=0.05)
    for seed in range(40):
        certificate, x = driven(task, STARTS["egg"], seed, config)
        rays, _, outliers, limit = certificate.constraints()
        missed += not explains(EGG.wall, rays, outliers, limit, certificate.at_middle(x))
    assert missed <= 6


def test_with_declared_outliers_the_true_pose_is_still_certified() -> None:
    task = dataclasses.replace(mission(BEAN), ranging=RangeQuality(0.01, outliers=0.05))
    certificate, x, rng = PoseCertificate(CONFIG, task), np.array(STARTS["bean"]), np.random.default_rng(3)
    for k in range(91):
        x = task.flow(x, U, DT) if k else x
        rho = BEAN.ranges(x, task.alpha)[0] * (1.0 + 0.01 * rng.standard_normal(4))
        certificate.note(k * DT, np.where(rng.random(4) < 0.05, rng.uniform(0.1, 5.0, 4), rho), U)
    assert certificate.check(x).certified


def test_on_the_spot_with_one_ray_nothing_is_certified() -> None:
    certificate, x = driven(mission(BEAN, (0.0,)), STARTS["bean"], u=np.zeros(2))
    found = certificate.check(x)
    assert not found.certified
    assert not found.complete


def test_without_readings_or_with_too_much_noise_nothing_is_certified() -> None:
    certificate = PoseCertificate(CONFIG, mission(BEAN))
    certificate.note(0.0, np.full(4, np.nan), U)
    assert not certificate.check(np.zeros(3)).certified
    noisy, x = driven(mission(BEAN, noise=0.3), STARTS["bean"])
    assert not noisy.check(x).certified


def test_the_grid_of_distances_errs_by_no_more_than_it_says() -> None:
    values, low_x, low_y, cell, slack = distance_grid(BEAN.wall, 120, 1e-3)
    rng = np.random.default_rng(0)
    for x, y in rng.uniform([-2.5, -1.0], [2.5, 2.0], (200, 2)):
        nearest = values[round((x - low_x) / cell), round((y - low_y) / cell)]
        exact = BEAN.distance(np.array([x, y])) * (1.0 if BEAN.contains(np.array([x, y])) else -1.0)
        assert abs(nearest - exact) <= slack


def test_the_plug_in_says_so_in_the_estimate_once_it_has_found_the_pose() -> None:
    task, x, rng = mission(BEAN, noise=0.01), np.array(STARTS["bean"]), np.random.default_rng(2)
    estimator = RangeCertified.build(RangeCertifiedConfig(every=0.5), task)
    answers = []
    for k in range(140):
        x = task.flow(x, U, DT) if k else x
        rho = BEAN.ranges(x, task.alpha)[0] * (1.0 + 0.01 * rng.standard_normal(4))
        readings = [Measurement("ranges", k * DT, rho), Measurement("odometry", k * DT, U)]
        answers.append(estimator.update(k * DT, readings, U).extra["certified"][0])
    assert np.isnan(answers[:70]).all()
    assert answers[-1] == 1.0
    blind = estimator.update(140 * DT + 5.0, [], U)
    assert np.isnan(blind.extra["certified"][0])
