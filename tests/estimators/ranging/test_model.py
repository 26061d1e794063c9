"""The filters' model of a mission, and when they refuse a ray."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import erfc

from mathnavi.estimators.ranging.model import (
    Gate,
    RangeModel,
    chi_square_gate,
)
from mathnavi.interfaces.reading_counts import ReadingCounts, Unused, unused_in
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.models.unicycle.quality import KnownStart, OdometryQuality, RangeQuality
from tests.estimators.ranging.walls import FIELD, WALLS

LIMIT = chi_square_gate(1e-4)
MISSION = RangingMission(
    FIELD, (-1.0, 1.0), RangeQuality(0.05, 0.03), OdometryQuality((0.04, 0.05), 0.02, slip=(0.03, 0.12))
)

each_wall = pytest.mark.parametrize("curve", WALLS, ids=lambda curve: curve.name.split()[0])


def passed(gate: Gate, *squares: float) -> list[bool]:
    return [bool(each) for each in gate.passes(np.array(squares))]


# ---- errors


def test_errors_are_those_that_the_mission_declares() -> None:
    model = RangeModel(MISSION)
    np.testing.assert_allclose(model.W, [0.05**2, 0.13**2], rtol=1e-6)
    np.testing.assert_allclose(model.range_variance(np.array([2.0, 0.0])), [0.1**2 + 0.03**2, 0.03**2], rtol=1e-4)
    np.testing.assert_allclose(model.covariance((0.1, 0.2, 0.3)), np.diag([0.01, 0.04, 0.09, 0.0004]))


def test_variances_of_what_does_not_err_are_small_and_not_nought() -> None:
    model = RangeModel(RangingMission(FIELD, (0.0,)))
    assert 0.0 < model.range_variance(np.ones(1))[0] < 1e-6
    assert (model.W > 0.0).all()
    assert (model.W < 1e-9).all()


# ---- the start


def test_a_known_start_is_taken_as_it_is_known() -> None:
    known = KnownStart((0.5, 0.2, 0.3), (0.1, 0.2, 0.3))
    x, P = RangeModel(dataclasses.replace(MISSION, start=known)).start()
    np.testing.assert_array_equal(x, [0.5, 0.2, 0.3, 0.0])
    np.testing.assert_allclose(P, np.diag([0.01, 0.04, 0.09, 0.0004]))


@each_wall
def test_an_unknown_start_is_in_the_middle_and_its_covariance_that_of_anywhere(curve: Curve) -> None:
    model = RangeModel(dataclasses.replace(MISSION, curve=curve))
    x, P = model.start()
    anywhere = model.anywhere(np.random.default_rng(1), 20_000)
    assert curve.contains(x)
    assert np.linalg.norm(x[:2] - anywhere[:, :2].mean(axis=0)) < 0.3
    deviations = np.sqrt(np.diag(P))
    np.testing.assert_allclose(deviations, anywhere.std(axis=0), rtol=0.1)
    assert np.linalg.eigvalsh(P)[0] > 0.0


def test_anywhere_is_uniform_within_the_wall() -> None:
    """Over an ellipse a coordinate has variance c_i^2 / 4, over a turn the heading pi^2 / 3."""
    x = RangeModel(MISSION).anywhere(np.random.default_rng(0), 20_000)
    assert x.shape == (20_000, 4)
    expected = [3.763 / 2.0, math.sqrt(2.0) / 2.0, math.pi / math.sqrt(3.0), 0.02]
    np.testing.assert_allclose(x.std(axis=0), expected, rtol=0.03)
    assert (np.abs(x.mean(axis=0)) < 4.0 * np.array(expected) / math.sqrt(20_000)).all()


@each_wall
def test_particles_of_an_unknown_start_are_all_within_the_wall(curve: Curve) -> None:
    x = RangeModel(dataclasses.replace(MISSION, curve=curve)).particles(500, np.random.default_rng(0))
    assert all(curve.contains(each) for each in x)


def test_particles_of_a_known_start_lie_about_it_as_it_is_known() -> None:
    known = KnownStart((0.5, 0.2, 0.3), (0.1, 0.05, 0.3))
    x = RangeModel(dataclasses.replace(MISSION, start=known)).particles(20_000, np.random.default_rng(0))
    np.testing.assert_allclose(x.mean(axis=0), [0.5, 0.2, 0.3, 0.0], atol=0.01)
    np.testing.assert_allclose(x.std(axis=0), [0.1, 0.05, 0.3, 0.02], rtol=0.03)


def test_particles_of_a_start_near_the_wall_are_within_it() -> None:
    known = KnownStart((0.0, 1.4, 0.0), (0.5, 0.5, 0.3))
    x = RangeModel(dataclasses.replace(MISSION, start=known)).particles(500, np.random.default_rng(0))
    assert all(FIELD.contains(each) for each in x)
    assert len(np.unique(x[:, 0])) == 500


# ---- the gate


def test_a_good_ray_is_refused_with_the_probability_of_the_gate() -> None:
    """P(|nu| > a sqrt(s)) = erfc(a / sqrt 2) of a Gaussian."""
    for probability in (1e-6, 1e-4, 0.05, 0.5):
        assert erfc(math.sqrt(chi_square_gate(probability) / 2.0)) == pytest.approx(probability, rel=1e-9)


def test_rays_within_the_gate_pass_and_single_ones_beyond_do_not_and_are_counted() -> None:
    counts = ReadingCounts()
    gate = Gate(1e-4, 3, counts)
    assert passed(gate, 0.0, 0.99 * LIMIT, 1.01 * LIMIT) == [True, True, False]
    assert passed(gate, math.nan, 1.01 * LIMIT, 0.0) == [False, False, True]
    assert unused_in(counts.extra) == {Unused.OUTLIER.value: 2}


def test_after_a_gap_rays_agree_once_they_fit_in_the_mean() -> None:
    """One of four that is an outlier does not matter once in ten readings; three deviations are too much."""

    def agreed(*squares: float) -> bool:
        gate.passes(np.array(squares))
        return gate.agrees(converged=False)

    gate = Gate(1e-4, 4, ReadingCounts())
    gate.passes(np.ones(4))
    assert gate.agrees(converged=True)
    fitting = [agreed(1.0, 1.0, math.nan, 2.0 * LIMIT if k % 10 == 9 else 1.0) for k in range(60)]
    assert not any(fitting[:15])
    assert all(fitting[40:])
    assert not any([agreed(9.0, 9.0, 9.0, 9.0) for _ in range(40)][10:])


def test_what_lasts_passes_after_ten_readings_each_ray_by_itself() -> None:
    gate = Gate(1e-4, 2, ReadingCounts())
    seen = [passed(gate, 2.0 * LIMIT, 0.0) for _ in range(13)]
    assert [first for first, _ in seen] == [False] * 10 + [True] * 3
    assert all(second for _, second in seen)


def test_one_good_reading_and_the_gate_is_shut_again() -> None:
    gate = Gate(1e-4, 1, ReadingCounts())
    for _ in range(9):
        assert passed(gate, 2.0 * LIMIT) == [False]
    assert passed(gate, 0.5 * LIMIT) == [True]
    assert [passed(gate, 2.0 * LIMIT)[0] for _ in range(11)] == [False] * 10 + [True]


def test_a_lost_ray_does_not_pass_and_neither_counts_nor_shuts_the_gate() -> None:
    gate = Gate(1e-4, 1, ReadingCounts())
    assert passed(gate, math.nan) == [False]
    for _ in range(10):
        assert passed(gate, 2.0 * LIMIT) == [False]
        assert passed(gate, math.nan) == [False]
    assert passed(gate, 2.0 * LIMIT) == [True]


def test_what_is_infinite_never_passes() -> None:
    gate = Gate(1e-4, 1, ReadingCounts())
    assert not any(passed(gate, math.inf)[0] for _ in range(30))
