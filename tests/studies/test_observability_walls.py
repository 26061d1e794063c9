"""The walls that are compared differ in what they are compared for, and in nothing else that could be helped."""

from __future__ import annotations

import numpy as np
import pytest

from mathnavi.studies.ranging.observability_measures import (
    FAMILIES,
    HALF_AXES,
    MARGIN,
    STANDARD,
    MapCase,
    drawn_start,
    driven_path,
    egged,
    spread,
)

CASES = [case for family in FAMILIES.values() for case in family]
IDS = [f"{case.family}-{case.value:.3g}-{case.sensors}" for case in CASES]


@pytest.mark.parametrize("case", CASES, ids=IDS)
def test_every_wall_has_the_standard_area(case: MapCase) -> None:
    assert case.curve.area == pytest.approx(STANDARD.area, rel=1e-9)


def test_walls_have_the_symmetry_that_they_are_there_for() -> None:
    assert [case.curve.symmetry for case in FAMILIES["symmetry"]] == [1, 2, 3, 4, 5, 6]
    assert {case.curve.symmetry for case in FAMILIES["eccentricity"]} == {2}
    assert [case.curve.symmetry for case in FAMILIES["asymmetry"]] == [2, 1, 1, 1, 1, 1]


def test_an_ellipse_has_the_ratio_that_it_is_called_by() -> None:
    for case in FAMILIES["eccentricity"]:
        low, high = case.curve.polyline.min(axis=0), case.curve.polyline.max(axis=0)
        assert np.divide(*(high - low)) == pytest.approx(case.value, rel=1e-4)


def test_an_egg_departs_from_its_ellipse_as_configured() -> None:
    far = [np.abs(egged(d).polyline - egged(0.0).polyline).max() for d in (0.01, 0.02, 0.1)]
    assert far[0] == pytest.approx(0.5 * far[1], rel=0.02)
    assert far[0] < far[1] < far[2]


def test_a_pose_from_anywhere_spreads_as_wide_as_the_wall() -> None:
    x_1, x_2, phi = spread(STANDARD)
    assert (x_1, x_2) == pytest.approx((0.5 * HALF_AXES[0], 0.5 * HALF_AXES[1]), rel=0.1)
    assert phi == pytest.approx(np.pi / np.sqrt(3.0), rel=0.1)


@pytest.mark.parametrize("case", [CASES[0], CASES[6], CASES[-1]], ids=[IDS[0], IDS[6], IDS[-1]])
def test_from_a_drawn_start_the_figure_of_eight_keeps_the_margin(case: MapCase) -> None:
    for seed in range(3):
        x = drawn_start(case.curve, np.random.default_rng(seed))
        c, s = np.cos(x[2]), np.sin(x[2])
        path = x[:2] + driven_path()[:, :2] @ np.array([[c, s], [-s, c]])
        assert min(case.curve.distance(p) for p in path) >= MARGIN
        np.testing.assert_allclose(path[-1], path[0], atol=0.02)
