"""Encoders that repeat themselves, leap or stand are doubted; those of joints that rest, stop or are hit are not."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from mathnavi.estimators.velocity.encoder_faults import EncoderErrors, EncoderFaults, repetitions
from mathnavi.estimators.velocity.reading_errors import ReadingErrors
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.manifold.mission import LagrangianMission, PositionQuality
from mathnavi.models.mechanism.entity import build_model
from mathnavi.models.mechanism.geometry import ScalarJoint
from mathnavi.models.mechanism.system import MechanismSystem
from mathnavi.sim.plugin.registry import load
from tests.estimators.velocity.test_reading_errors import encoded, observed

PERIOD, SIGMA, STEP = 0.005, 5e-4, 2.0 * math.pi / 2.0**14
JOINT = ScalarJoint("elbow", 0, 0, True, -math.inf, math.inf)


def watched(
    y: Array,
    sigma: float = SIGMA,
    shown: float = SIGMA,
    step: float = STEP,
    predicted: Array | None = None,
    touching: bool = False,
) -> tuple[list[str], EncoderFaults]:
    """Doubts (N,) about readings y (N,) of a joint, which are ``predicted`` (N,), or not."""
    found = EncoderFaults([JOINT.name], PERIOD)
    doubts = []
    for k, each in enumerate(y):
        t = PERIOD * k
        seen = np.array([shown**2 + step**2 / 12.0])
        off = None if predicted is None else np.array([each - predicted[k]])
        errors = EncoderErrors(np.array([sigma**2]), seen, seen, np.array([step]))
        found.read(t, np.array([each]), errors, off, touching=touching)
        doubts.append(found.doubt(t))
    return doubts, found


def read(q: Array, sigma: float = SIGMA) -> Array:
    noisy = q + sigma * np.random.default_rng(2).standard_normal(len(q))
    return np.asarray(STEP * np.round(noisy / STEP), np.float64)


def swing(seconds: float) -> Array:
    return np.asarray(np.sin(2.0 * PERIOD * np.arange(round(seconds / PERIOD))), np.float64)


@pytest.mark.parametrize("sigma", [0.8 * STEP, SIGMA, 3.0 * SIGMA])
def test_an_encoder_with_noise_is_stuck_if_it_repeats_itself_and_one_at_rest_is_not(sigma: float) -> None:
    rest = read(np.zeros(4000), sigma)
    assert not any(watched(rest, sigma, sigma)[0])
    y = read(swing(6.0), sigma)
    y[400:800] = y[400]
    doubts, found = watched(y, sigma, sigma)
    enough = repetitions(math.sqrt(0.5 * sigma**2 - 0.5 * STEP**2 / 12.0), STEP)
    assert enough < 50
    assert not any(doubts[:400])
    assert all(doubts[400 + int(enough) : 800])
    assert not any(doubts[1000 + 4 :])
    assert not found.offset.any()


def test_where_rounding_may_be_all_there_is_of_the_noise_an_encoder_may_repeat_itself() -> None:
    """A bound of the noise is declared, and the encoder is better."""
    still = np.zeros(2000)
    assert not any(watched(still, SIGMA, 0.0)[0])
    assert not any(watched(still, 0.0, SIGMA)[0])
    assert repetitions(0.0, STEP) == math.inf
    assert repetitions(0.1 * STEP, STEP) == math.inf


def test_a_leap_is_doubted_and_a_deviation_of_the_position_until_the_encoder_leaps_back() -> None:
    y = read(swing(12.0))
    y[600:2000] += 0.1
    doubts, found = watched(y[:1900])
    assert not any(doubts[:600])
    assert all(doubts[603:1600])
    assert not doubts[1899]
    assert found.offset[0] == pytest.approx(0.1, abs=3e-3)
    _, found = watched(y)
    assert found.offset[0] == 0.0


def test_a_leap_that_the_motion_could_hide_is_found_where_the_motion_is_predicted() -> None:
    q = swing(6.0)
    y = q.copy()
    y[600:] += 0.02  # less than three times what the joint moves from reading to reading
    y = read(y)
    believed = np.where(np.arange(len(q)) > 600, q + 0.02, q)  # by an observer that follows its readings at once
    assert not any(watched(y)[0])
    doubts, found = watched(y, predicted=believed)
    assert not any(doubts[:600])
    assert all(doubts[604:1500])
    assert found.offset == pytest.approx(0.02, abs=4.0 * SIGMA)
    worse = believed + 0.006 * np.sin(0.3 * np.arange(len(q)))  # which are wrong by a third of the leap anyway
    assert not any(watched(y, predicted=worse)[0])


def test_a_sudden_motion_that_is_predicted_is_no_leap() -> None:
    q = swing(6.0)
    q[700:] += 0.1  # as of a light finger that is hit twice between two readings
    assert any(watched(read(q))[0])
    assert not any(watched(read(q), predicted=q)[0])
    late = np.where(np.arange(len(q)) > 700, q, q - 0.1 * (np.arange(len(q)) == 700))
    assert any(watched(read(q), predicted=late)[0])


def test_a_joint_that_touches_something_may_be_bumped() -> None:
    q = swing(4.0)
    bumped = q.copy()
    bumped[600:] += 0.02  # at 4 rad/s
    y = read(bumped)
    believed = np.where(np.arange(len(q)) > 600, bumped, q)
    assert any(watched(y, predicted=believed)[0])
    assert not any(watched(y, predicted=believed, touching=True)[0])
    y[600:] += 0.1
    believed[601:] += 0.1
    assert any(watched(y, predicted=believed, touching=True)[0])


def test_what_a_joint_does_is_no_leap() -> None:
    t = PERIOD * np.arange(2000)
    starts = np.where(t < 5.0, 0.0, 4.0 * (t - 5.0))  # as if it were hit
    stops = np.where(t < 5.0, 4.0 * t, 20.0)
    shakes = 0.02 * np.sin(2.0 * math.pi * 60.0 * t)
    steps = np.floor(t) * STEP
    for q in (starts, stops, shakes, steps, 10.0 * t):
        doubts, found = watched(read(q))
        assert not any(doubts)
        assert not found.offset.any()
    single = read(swing(10.0))
    single[1000] += 0.5  # an outlier
    assert not watched(single)[1].offset.any()


def test_encoders_that_leap_back_along_their_motion_together_are_late_until_they_leap_ahead() -> None:
    ago = 10
    joints = np.column_stack([swing(12.0), np.cos(3.1 * PERIOD * np.arange(2400))])
    noise = SIGMA * np.random.default_rng(3).standard_normal(joints.shape)
    late, off = joints + noise, joints + noise
    late[600:1400] = joints[600 - ago : 1400 - ago] + noise[600:1400]
    off[600:1400] += 0.1
    for readings, delay in ((joints + noise, 0.0), (late, ago * PERIOD), (off, 0.0)):
        found, delays = EncoderFaults(["elbow", "wrist"], PERIOD), []
        for k, y in enumerate(readings):
            seen = np.full(2, SIGMA**2)
            found.read(PERIOD * k, y, EncoderErrors(seen, seen, seen, np.zeros(2)))
            delays.append(found.delay)
        assert not any(delays[:600])
        assert not any(delays[1404:])
        np.testing.assert_allclose(delays[604:1400], delay, atol=2e-3)
        assert not found.offset.any()


@pytest.mark.parametrize("method", ["riemannian_observer", "momentum_observer"])
@pytest.mark.parametrize("declared", [True, False], ids=["declared", "not declared"])
def test_a_dead_encoder_is_not_believed_while_the_model_moves_its_joint(method: str, declared: bool) -> None:
    quality = {"resolution": 14} if declared else {}
    y = encoded("servo-six").copy()
    good = observed("servo-six", method, y[:1300], **quality)
    assert all(each.status is Status.OK for each in good[750:])
    y[:, 1] = y[0, 1]
    dead = observed("servo-six", method, y, **quality)
    assert not any(each.status is Status.OK for each in dead[1000:])
    assert dead[-1].message == "has an encoder that stands: shoulder"


def test_coordinates_that_nothing_reads_do_not_stand_or_leap() -> None:
    mission = LagrangianMission(MechanismSystem(build_model("two-link")), PositionQuality(noise=SIGMA), PERIOD)
    errors, noise = ReadingErrors(mission), SIGMA * np.random.default_rng(4).standard_normal(400)
    errors.ignore(slice(0, 1))
    for k in range(400):
        errors.read(PERIOD * k, np.array([1.0 if k > 300 else 0.0, 0.1 + noise[k]]), None)
    assert not errors.faults.repeats.any()
    assert not errors.faults.offset.any()
    assert errors.faults.doubt(PERIOD * 399) == ""


@pytest.mark.parametrize("method", ["riemannian_observer", "high_gain"])
def test_an_arm_at_rest_where_its_model_would_sag_is_not_said_to_have_a_dead_encoder(method: str) -> None:
    """A model that is wrong is wrong by the same while nothing changes."""
    model = build_model("servo-six")
    mission = LagrangianMission(MechanismSystem(model), PositionQuality(resolution=14), 0.001)
    plugin: Any = load("estimators", method)
    estimator, y, u = plugin.build(plugin.Config(), mission), np.zeros(model.nq), np.zeros(model.nu)
    found = [estimator.update(0.001 * k, [Measurement("position", 0.001 * k, y)], u) for k in range(1500)]
    assert not any("stands" in each.message for each in found)
