"""Two-point tensors: the identities of D.3 to D.4.4, as they are true and as they are printed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.constant_curvature import ConstantCurvature, TwoPoint, sphere
from mathnavi.studies.riemannian.contraction import table_d_1
from mathnavi.studies.riemannian.identities import residuals


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from([2, 3, 5]), st.sampled_from([1.0, -1.0]))
def test_the_identities_hold(seed: int, n: int, kappa: float) -> None:
    found = residuals(seed, n, kappa)
    assert {name: value for name, value in found.items() if value > 1e-7 and "printed" not in name} == {}


def test_misprints_do_not() -> None:
    found = [residuals(seed, 3, kappa) for kappa in (1.0, -1.0) for seed in range(5)]
    for name in ("D.12 printed", "D.19 printed", "D.25 printed"):
        assert max(one[name] for one in found) > 0.1


def test_three_brackets_of_table_d_1_are_misprinted() -> None:
    table = table_d_1(3)
    assert max(true for _, true in table.values()) < 1e-10
    assert {name for name, (printed, _) in table.items() if printed > 1e-3} == {
        "[X^H, Y^H]", "[X^H, Y^V]", "[X^H, Z]",
    }  # fmt: skip


@pytest.mark.parametrize("kappa", [1.0, -1.0, 0.0])
def test_series_near_the_truth_join_the_closed_forms(kappa: float) -> None:
    space, rng = ConstantCurvature(3, kappa), np.random.default_rng(2)
    x = space.draw(rng)
    direction = space.draw_vector(rng, x)
    w = rng.standard_normal(3)
    pairs = [TwoPoint(space, x, space.exp(x, theta * direction)) for theta in (9.99e-4, 1.01e-3)]
    for name in ("hessian", "mixed"):
        below, above = (off_flat(pair, getattr(pair, name)(space.vector(pair.xi, w)), name, w) for pair in pairs)
        assert below == pytest.approx(above, rel=2e-3, abs=1e-9)
    exact = TwoPoint(space, x, x)
    assert exact.hessian(space.vector(x, w)) == pytest.approx(space.vector(x, w))
    assert exact.mixed(space.vector(x, w)) == pytest.approx(-space.vector(x, w))


def off_flat(pair: TwoPoint, found: Array, name: str, w: Array) -> Array:
    """By how much, over theta^2, a map is off that of a flat space: the identity, or less the transport."""
    space = pair.space
    here = space.vector(pair.xi, w)
    at, flat = (pair.xi, here) if name == "hessian" else (pair.x, -pair.to_x(here))
    return space.components(at, found - flat) / pair.theta**2


def test_the_hessian_is_flat_along_and_bent_across() -> None:
    space = sphere(2)
    xi = space.origin
    pair = TwoPoint(space, space.exp(xi, np.array([0.0, 1.2, 0.0])), xi)
    assert pair.hessian(np.array([0.0, 1.0, 0.0])) == pytest.approx([0.0, 1.0, 0.0])
    assert pair.hessian(np.array([0.0, 0.0, 1.0])) == pytest.approx([0.0, 0.0, 1.2 / np.tan(1.2)])
