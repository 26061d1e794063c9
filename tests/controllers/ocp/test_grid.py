"""Grids: partitions, and the equidistribution of a monitor function."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.controllers.ocp import grid as grids
from mathnavi.controllers.ocp.grid import Grid


@given(n=st.integers(2, 30), ratio=st.floats(0.7, 1.4))
def test_each_interval_of_a_stretched_grid_is_the_ratio_times_the_one_before(n: int, ratio: float) -> None:
    widths = grids.stretched(n, ratio).widths
    assert len(widths) == n - 1
    assert np.allclose(widths[1:] / widths[:-1], ratio, rtol=1e-6)
    assert widths.sum() == pytest.approx(1.0)


@settings(max_examples=30)
@given(n=st.integers(3, 40), steepness=st.floats(0.0, 20.0), centre=st.floats(0.0, 1.0))
def test_equidistribution_gives_every_interval_the_same_share(n: int, steepness: float, centre: float) -> None:
    def monitor(tau: np.ndarray) -> np.ndarray:
        return 1.0 + steepness * np.exp(-((tau - centre) ** 2) / 0.01)

    nodes = grids.equidistributed(n, monitor).nodes
    fine = np.linspace(0.0, 1.0, 200_001)
    mass = np.concatenate([[0.0], np.cumsum(monitor(0.5 * (fine[1:] + fine[:-1])) * np.diff(fine))])
    shares = np.diff(np.interp(nodes, fine, mass))
    assert np.ptp(shares) < 1e-3 * shares.mean()


def test_a_narrow_peak_is_seen_between_the_nodes_it_was_computed_on() -> None:
    breaks = np.array([0.0, 0.5, 0.50001, 1.0])
    nodes = grids.equidistributed(21, lambda tau: np.where((tau > 0.5) & (tau < 0.50001), 1e7, 1.0), breaks).nodes
    assert np.count_nonzero((nodes >= 0.5) & (nodes <= 0.50001)) >= 19


def test_a_peak_without_measure_leaves_every_interval_a_width() -> None:
    grid = grids.equidistributed(21, lambda tau: np.where(np.abs(tau - 0.3) < 1e-3, 1e300, 1e-300))
    assert grid.widths.min() >= 0.99 * grids.LEAST_WIDTH


def test_splitting_keeps_the_old_nodes() -> None:
    old = grids.stretched(5, 1.5)
    new = grids.split(old, [1, 3, 1, 2])
    assert len(new) == 8
    assert np.isclose(old.nodes[:, None], new.nodes, atol=1e-15).any(axis=1).all()


def test_given_nodes_in_any_unit_become_fractions() -> None:
    assert grids.given([10.0, 15.0, 30.0]).nodes.tolist() == [0.0, 0.25, 1.0]


def test_what_makes_no_grid_is_refused() -> None:
    for n in (1, 0, -3, 2.5, True):
        with pytest.raises(ValueError, match="nodes = "):
            grids.uniform(n)  # type: ignore[arg-type]
    for nodes in ([0.0], [0.0, 0.5], [0.0, 0.6, 0.5, 1.0], [0.0, np.nan, 1.0], [0.1, 1.0], [0.0, 0.5, 0.5, 1.0]):
        with pytest.raises(ValueError, match="grid"):
            Grid(np.array(nodes))
    for value in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(ValueError, match="ratio = "):
            grids.stretched(5, value)
        with pytest.raises(ValueError, match="monitor"):
            grids.equidistributed(5, lambda tau, value=value: np.where(tau > 0.5, value, 1.0))  # type: ignore[misc]
