"""Certificates among beacons: what is certified is alone and holds the truth, and what is not is said."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import mathnavi as mn
from mathnavi.estimators.beacons.certificate import BeaconCertificate, BeaconCertificateConfig
from mathnavi.estimators.beacons.certified import BeaconCertified
from mathnavi.estimators.ranging.pose_certificate import composed, relative
from mathnavi.interfaces.errors import MissionError
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.beacons import exact_readings
from mathnavi.models.unicycle.kernels import integrate

FOUR = ((3.0, 2.0), (-3.0, 2.5), (-2.5, -3.0), (3.5, -2.0))
TWO = ((3.0, 0.0), (-3.0, 0.0))
START, NOISE, DT, EVERY = (0.6, -0.8, 0.8), 0.05, 0.1, 5
BEND, STRAIGHT = (0.5, 0.4), (0.2, 0.0)
TWO_PARTS = np.concatenate([np.tile(BEND, (110, 1)), np.tile(STRAIGHT, (190, 1))])
CONFIG = BeaconCertificateConfig()


def mission(places: Any = FOUR, **changes: Any) -> mn.BeaconMission:
    given = {"ranges": mn.BeaconQuality(NOISE), "odometry": mn.OdometryQuality((0.03, 0.03), 0.01), "period": DT}
    return mn.BeaconMission(places, **(given | {"interval": EVERY * DT, "surroundings": 2.0} | changes))


def drive(task: mn.BeaconMission, u: Any, seconds: float, seed: int, scale: float = 0.0) -> tuple[mn.SensorLog, Array]:
    """A log of a drive by inputs u (2,), or (n, 2), with the declared errors, but for a scale error that is given, and
    the true poses.
    """
    rng, x, count = np.random.default_rng(seed), np.array(START), round(seconds / DT)
    u = np.broadcast_to(u, (count, 2))
    quality, places = task.ranges, task.places
    assert quality is not None
    truth, ranges = np.empty((count, 3)), np.full((count, len(places)), np.nan)
    bias = 1.0 + task.odometry.bias * rng.standard_normal(2)
    odometry = bias * u + np.array(task.odometry.noise) * rng.standard_normal((count, 2))
    for k in range(count):
        x = integrate(x, u[k, 0], u[k, 1], DT) if k else x
        truth[k] = x
        if k % EVERY == 0:
            read = (1.0 + scale) * exact_readings(places, 0, x) + quality.absolute * rng.standard_normal(len(places))
            out = rng.random(len(places)) < quality.outliers
            ranges[k] = np.where(out, rng.uniform(0.1, task.longest, len(places)), read)
    t = DT * np.arange(count)
    return mn.SensorLog(t, {"beacon_ranges": ranges, "odometry": odometry}), truth


def take(certificate: BeaconCertificate, log: mn.SensorLog, k: int) -> None:
    """Note sample ``k`` of a log."""
    rows, t = {name: values[k] for name, values in log.readings.items()}, float(log.t[k])
    read = [mn.Measurement(name, t, row) for name, row in rows.items() if np.isfinite(row).any()]
    certificate.note(t, read, np.zeros(2))


def noted(task: mn.BeaconMission, log: mn.SensorLog, config: BeaconCertificateConfig = CONFIG) -> BeaconCertificate:
    certificate = BeaconCertificate(config, task)
    for k in range(len(log.t)):
        take(certificate, log, k)
    return certificate


def explained(certificate: BeaconCertificate, poses: Array, scale_errors: Array) -> Array:
    """Whether poses (n, 3) at the middle reading with scale errors (n,) explain the ranges, by their equation."""
    rays, _, outliers, limit, _ = certificate.constraints()
    x, y, phi = poses.T[:, :, None]
    scale = 1.0 / (1.0 + scale_errors[:, None])
    place_x = x + np.cos(phi) * rays[:, 0] - np.sin(phi) * rays[:, 1]
    place_y = y + np.sin(phi) * rays[:, 0] + np.cos(phi) * rays[:, 1]
    off = np.abs(np.hypot(place_x - rays[:, 7], place_y - rays[:, 8]) - scale * rays[:, 3])
    times = np.maximum(1.0, scale)
    squares = np.sort((np.maximum(0.0, off - times * rays[:, 4]) / (times * rays[:, 5])) ** 2, axis=1)
    kept: Array = squares[:, : len(rays) - outliers].sum(axis=1) <= limit
    return kept & ((off > times * rays[:, 6]).sum(axis=1) <= outliers)


def test_the_true_pose_explains_its_ranges_with_the_declared_probability() -> None:
    """Of 40 runs with a probability of .05 six or fewer exclude it, as in 98.6 % of such series."""
    config, missed = dataclasses.replace(CONFIG, probability=0.05), 0
    for seed in range(40):
        task = mission(range_scale=0.02)
        scale = 0.02 * float(np.random.default_rng(100 + seed).standard_normal())
        log, truth = drive(task, BEND, 6.0, seed, scale)
        certificate = noted(task, log, config)
        missed += not explained(certificate, certificate.at_middle(truth[-1])[None], np.array([scale]))[0]
    assert missed <= 6


@pytest.mark.parametrize("outliers", [0.0, 0.05])
def test_every_pose_that_explains_the_ranges_is_within_the_published_bounds(outliers: float) -> None:
    """Drawn densely about the truth, with a scale of all ranges that is not known."""
    task = mission(ranges=mn.BeaconQuality(NOISE, outliers=outliers), range_scale=0.02)
    log, truth = drive(task, BEND, 6.0, 3, 0.03)
    certificate, estimate = noted(task, log), truth[-1] + [0.05, -0.05, 0.03]
    found = certificate.check(estimate, 0.03)
    assert found.certified
    rng, middle = np.random.default_rng(1), certificate.at_middle(estimate)
    poses = middle + rng.uniform(-1, 1, (60_000, 3)) * [0.8, 0.8, 0.6]
    poses = poses[explained(certificate, poses, rng.uniform(-0.02, 0.08, len(poses)))]
    assert len(poses) > 20
    since = relative(middle, estimate)
    steps = np.array([composed(pose, since) for pose in poses]) - estimate
    assert np.hypot(steps[:, 0], steps[:, 1]).max() <= found.bounds[0]
    assert np.abs((steps[:, 2] + math.pi) % (2.0 * math.pi) - math.pi).max() <= found.bounds[1]


def test_a_wrong_pose_is_not_certified_and_the_true_one_is_listed() -> None:
    task = mission()
    log, truth = drive(task, BEND, 6.0, 0)
    found = noted(task, log).check(truth[-1] + [2.5, 1.0, 1.5], 0.0)
    assert not found.certified
    assert min(math.hypot(*(other - truth[-1])[:2]) for other in found.others) < 0.4


def test_two_beacons_do_not_tell_a_straight_drive_from_its_mirror_image_and_a_bend_does() -> None:
    task = mission(TWO)
    log, truth = drive(task, STRAIGHT, 11.0, 1)
    found = noted(task, log).check(truth[-1], 0.0)
    mirrored = truth[-1] * [1.0, -1.0, -1.0]
    assert not found.certified
    assert min(math.hypot(*(other - mirrored)[:2]) for other in found.others) < 0.4
    log, truth = drive(task, BEND, 11.0, 1)
    assert noted(task, log).check(truth[-1], 0.0).certified


def test_a_robot_that_was_certified_is_not_confused_with_its_mirror_image_later() -> None:
    """The same ranges alone are explained by both."""
    task = mission(TWO)
    log, truth = drive(task, TWO_PARTS[:160], 16.0, 1)
    known, new = BeaconCertificate(CONFIG, task), BeaconCertificate(CONFIG, task)
    for k, t in enumerate(log.t.tolist()):
        take(known, log, k)
        if t == pytest.approx(10.9):
            assert known.check(truth[k], 0.0).certified
        if t >= 11.0 - DT:
            take(new, log, k)
        if t > 12.0 and k % 10 == 0:
            found = known.check(truth[k], 0.0)
            assert found.certified
            assert not len(found.others)
    alone = new.check(truth[-1], 0.0)
    mirrored = truth[-1] * [1.0, -1.0, -1.0]
    assert not alone.certified
    assert min(math.hypot(*(other - mirrored)[:2]) for other in alone.others) < 0.4


def test_history_ends_where_odometry_is_missing() -> None:
    task = mission(TWO)
    log, truth = drive(task, TWO_PARTS[:280], 28.0, 1)
    odometry = np.array(log.readings["odometry"])
    odometry[112:150] = np.nan
    certificate = BeaconCertificate(CONFIG, task)
    log = mn.SensorLog(log.t, {**log.readings, "odometry": odometry})
    for k, t in enumerate(log.t.tolist()):
        take(certificate, log, k)
        if t == pytest.approx(10.9):
            assert certificate.check(truth[k], 0.0).certified
    found = certificate.check(truth[-1], 0.0)
    assert not found.certified
    assert len(found.others)


def test_a_robot_that_was_carried_away_is_listed_where_it_is_whatever_history_says() -> None:
    task = mission()
    log, truth = drive(task, BEND, 26.0, 2)
    places, away = np.array(task.places), np.array([-7.0, 6.0])
    shifted = dataclasses.replace(task, beacons=tuple(map(tuple, places - away)))  # seen from where it was carried to
    ranges = np.array(log.readings["beacon_ranges"])
    ranges[110:] = np.array(drive(shifted, BEND, 26.0, 2)[0].readings["beacon_ranges"])[110:]
    log = mn.SensorLog(log.t, {**log.readings, "beacon_ranges": ranges})
    certificate = BeaconCertificate(CONFIG, task)
    for k in range(len(log.t)):
        take(certificate, log, k)
        if k == 109:
            assert certificate.check(truth[k], 0.0).certified
    found = certificate.check(truth[-1], 0.0)
    assert not found.certified
    assert min(math.hypot(*((other - truth[-1])[:2] - away)) for other in found.others) < 0.5


def test_bounds_hold_while_they_are_carried_on() -> None:
    task = mission(TWO)
    for seed in range(3):
        log, truth = drive(task, TWO_PARTS, 30.0, seed)
        found = mn.estimate("beacon_certified", task, log)
        ok = np.array([status is mn.Status.OK for status in found.status])
        late = log.t > 15.0
        assert ok[late].mean() > 0.9
        error = np.abs(found.x - truth)
        heading = np.abs((found.x[:, 2] - truth[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)
        assert (np.hypot(error[:, 0], error[:, 1]) <= found.extra["bounds"][:, 0])[ok].all()
        assert (heading <= found.extra["bounds"][:, 1])[ok].all()


def test_more_outliers_than_are_declared_are_no_explanation() -> None:
    task = mission()
    log, truth = drive(mission(ranges=mn.BeaconQuality(NOISE, outliers=0.1)), BEND, 6.0, 4)
    found = noted(task, log).check(truth[-1], 0.0)
    assert found.complete
    assert not found.certified


def test_the_plug_in_is_ok_only_while_it_is_certified_and_then_its_bounds_hold() -> None:
    task = mission(ranges=mn.BeaconQuality(NOISE, outliers=0.05))
    log, truth = drive(task, BEND, 14.0, 5)
    found = mn.estimate("beacon_certified", task, log)
    ok = np.array([status is mn.Status.OK for status in found.status])
    assert ok[-1]
    np.testing.assert_array_equal(ok, found.extra["certified"][:, 0] == 1.0)
    error = found.x - truth
    heading = np.abs((error[:, 2] + math.pi) % (2.0 * math.pi) - math.pi)
    assert (np.hypot(error[:, 0], error[:, 1]) <= found.extra["bounds"][:, 0])[ok].all()
    assert (heading <= found.extra["bounds"][:, 1])[ok].all()


def test_from_two_beacons_on_a_straight_drive_the_plug_in_is_never_ok_and_says_why() -> None:
    task = mission(TWO)
    log, _ = drive(task, STRAIGHT, 14.0, 1)
    known = dataclasses.replace(task, start=mn.KnownStart(START, (0.1, 0.1, 0.1)))
    estimator, said = BeaconCertified.build(BeaconCertified.Config(), known), []
    for k, t in enumerate(log.t.tolist()):
        rows = {name: values[k] for name, values in log.readings.items()}
        read = [mn.Measurement(name, t, row) for name, row in rows.items() if np.isfinite(row).any()]
        said.append(estimator.update(t, read, np.zeros(2)))
    assert {each.status for each in said} == {mn.Status.DEGRADED}, "its start is known, so it may be used"
    assert "other poses" in said[-1].message
    assert said[-1].extra["certified"] == [0.0]
    assert np.isnan([each.extra["bounds"] for each in said]).all(), "nothing bounds a pose that is not certified"


def test_without_ranges_it_is_refused() -> None:
    with pytest.raises(MissionError, match="beacon_certified without ranges"):
        BeaconCertified.build(BeaconCertified.Config(), mission(ranges=None, bearings=mn.BeaconQuality(0.02)))


def test_beacons_at_unknown_places_certify_nothing() -> None:
    task = dataclasses.replace(mission(), start=mn.KnownStart(START), beacons=(*TWO, None))
    with pytest.raises(MissionError, match="allowed: places that are known"):
        BeaconCertified.build(BeaconCertified.Config(), task)


def test_a_beacon_at_fault_is_left_out_of_the_certificate_too() -> None:
    task = mission(start=mn.KnownStart(START, (0.1, 0.1, 0.1)))
    log, truth = drive(task, BEND, 60.0, 3)
    ranges = np.array(log.readings["beacon_ranges"])
    ranges[200:, 1] += 1.0
    found = mn.estimate("beacon_certified", task, mn.SensorLog(log.t, {**log.readings, "beacon_ranges": ranges}))
    assert found.extra["left_out"][-1].tolist() == [0.0, 1.0, 0.0, 0.0]
    assert found.extra["certified"][-1] == 1.0
    error = np.hypot(*(found.x - truth)[300:, :2].T)
    assert np.sqrt(np.square(error).mean()) < 0.1
