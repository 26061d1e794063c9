"""Sure and wrong: by norm against the largest deviation of a block, for more than a second, and only where it is OK."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.sim.metrics.sure_and_wrong import beyond, lasting, sure_and_wrong

PERIOD = 0.1
T = PERIOD * np.arange(100)


def flags(*stretches: tuple[int, int]) -> np.ndarray:
    made = np.zeros(len(T), dtype=bool)
    for begin, end in stretches:
        made[begin:end] = True
    return made


def test_stretches_of_a_second_are_dropped_and_longer_ones_are_kept() -> None:
    found = lasting(T, flags((5, 15), (20, 31), (40, 41), (89, 100)))
    assert (found == flags((20, 31), (89, 100))).all()


def test_a_rate_that_changes_is_judged_by_its_times() -> None:
    t = np.concatenate([T[:50], T[50] + 0.5 * np.arange(50)])
    found = lasting(t, flags((10, 20), (60, 63)))
    assert (found == flags((60, 63))).all()


@pytest.mark.parametrize(("error", "wrong"), [((0.29, 0.0), False), ((0.31, 0.0), True), ((0.22, 0.22), True)])
def test_a_block_is_judged_by_its_norm_in_the_basis_where_its_covariance_is_largest(
    error: tuple[float, float], wrong: bool
) -> None:
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    P = turn @ np.diag([0.1**2, 0.01**2]) @ turn.T
    assert beyond(np.array([error]), P[np.newaxis])[0] == wrong


def test_what_is_not_ok_or_declares_nothing_is_not_sure_and_blocks_are_apart() -> None:
    error = np.tile([0.0, 0.0, 0.5], (len(T), 1))
    P = np.tile(np.diag([0.1, 0.1, 0.1]) ** 2, (len(T), 1, 1))
    P[50:] = np.nan
    found = sure_and_wrong(T, flags((0, 20), (40, 100)), error, P)
    assert (found[:, 1] == flags((0, 20))).all()  # the second stretch lasts for a second, as long as P is known
    assert not found[:, 0].any()
    assert lasting(T, beyond(error[:, 2:], P[:, 2:, 2:]))[:50].all()


def test_gaussian_errors_are_seldom_beyond_and_never_for_a_second() -> None:
    rng = np.random.default_rng(3)
    error, P = rng.standard_normal((20_000, 3)), np.tile(np.eye(3), (20_000, 1, 1))
    share = beyond(error[:, :2], P[:, :2, :2]).mean()
    assert share == pytest.approx(np.exp(-4.5), rel=0.2)  # of a Rayleigh distribution
    t = PERIOD * np.arange(20_000)
    assert not sure_and_wrong(t, np.ones(20_000, dtype=bool), error, P).any()
