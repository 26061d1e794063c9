"""All of FS_y is found, and nothing else is in it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

from mathnavi.estimators.observability.continuation import End, TracedCurve
from mathnavi.estimators.observability.feasible_set import FeasibleSet, feasible_set
from mathnavi.estimators.observability.range_outputs import RangeOutputs
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.curve import Curve
from tests.estimators.observability.fields import (
    BEAN,
    CIRCLE,
    CURVES,
    EGG,
    ELLIPSE,
    THESIS,
    THESIS_START,
    sensors,
)

STEP = 0.01


def value(outputs: RangeOutputs, x: Array, y: Array) -> float:
    """V_y(x) = |h(x) - y|^2 [m^2], zero on FS_y and only there; infinite outside the wall."""
    r = outputs.at(x)[0] - y
    v = float(r @ r)
    return v if math.isfinite(v) else math.inf


def chart(poses: Array) -> Array:
    return np.column_stack([poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])])


def ends_at_wall(outputs: RangeOutputs, curve: TracedCurve) -> tuple[bool, bool]:
    """Return whether a curve begins and ends within a millimetre of the wall; if not, it closes or a ray grazes
    there."""
    first, last = (
        end is End.BOUNDARY and outputs.curve.distance(x[:2]) <= 1e-3
        for end, x in zip(curve.ends, curve.points[[0, -1]], strict=True)
    )
    return first, last


def assert_feasible(outputs: RangeOutputs, feasible: FeasibleSet) -> None:
    for x in feasible.poses:
        assert value(outputs, x, feasible.y) < 1e-20
        assert ELLIPSE is not outputs.curve or outputs.curve.contains(x[:2])


def assert_found(outputs: RangeOutputs, feasible: FeasibleSet, rng: np.random.Generator, reach: float) -> None:
    """Whatever reads y, found by descent from anywhere, is within ``reach`` of the set."""
    tree = cKDTree(chart(feasible.poses))
    found = [x for _ in range(100) if (x := outputs.fit(feasible.y, outputs.curve.draw(rng))) is not None]
    assert found
    assert tree.query(chart(np.array(found)))[0].max() <= reach


@pytest.mark.parametrize(
    ("curve", "angles"), zip(CURVES.values(), ((-90.0, -45.0), (-60.0, 60.0), (-90.0, -45.0)), strict=True), ids=CURVES
)
def test_with_two_sensors_every_curve_is_found(curve: Curve, angles: tuple[float, float]) -> None:
    rng = np.random.default_rng(1)
    outputs = sensors(curve, *angles)
    x = curve.draw(rng, 0.3)
    feasible = feasible_set(outputs, outputs.at(x)[0], STEP)
    assert_feasible(outputs, feasible)
    assert_found(outputs, feasible, rng, STEP)
    assert cKDTree(chart(feasible.poses)).query(chart(x[None]))[0][0] <= STEP


def test_a_curve_between_the_wall_and_the_grid_is_found() -> None:
    """It keeps within half a millimetre of the wall."""
    outputs = sensors(ELLIPSE, -20.85544481, 81.9776753)
    feasible = feasible_set(outputs, np.array([2.94933505, 0.31701206]), STEP)
    far = sorted(max(ELLIPSE.distance(x[:2]) for x in curve.points[::10]) for curve in feasible.curves)
    assert [d < 1e-3 for d in far] == [True, True, False, False]


def test_at_the_thesis_start_two_curves_run_from_wall_to_wall() -> None:
    """One through the start, and its image under the half-turn of the ellipse."""
    feasible = feasible_set(THESIS, THESIS.at(THESIS_START)[0], STEP)
    assert [curve.ends for curve in feasible.curves] == 2 * [(End.BOUNDARY, End.BOUNDARY)]
    assert all(ends_at_wall(THESIS, curve) == (True, True) for curve in feasible.curves)
    one, other = (chart(curve.points) for curve in feasible.curves)
    assert cKDTree(-other).query(one)[0].max() <= STEP


def test_points_lie_a_step_apart() -> None:
    feasible = feasible_set(THESIS, THESIS.at(THESIS_START)[0], STEP)
    for curve in feasible.curves:
        gaps = np.linalg.norm(np.diff(curve.points, axis=0), axis=1)
        assert gaps.max() < 1.05 * STEP
        assert np.median(gaps) == pytest.approx(STEP, rel=1e-3)


def test_in_an_egg_a_curve_may_close_after_a_turn() -> None:
    outputs = sensors(EGG, -90.0, -45.0)
    (curve,) = feasible_set(outputs, outputs.at(np.array([1.0, -0.4, 0.5 * math.pi]))[0], STEP).curves
    assert curve.closed
    assert abs(curve.points[-1, 2] - curve.points[0, 2]) == pytest.approx(2.0 * math.pi, abs=2.0 * STEP)


def test_in_a_bean_a_curve_may_end_where_a_ray_grazes() -> None:
    outputs = sensors(BEAN, -60.0, 60.0)
    feasible = feasible_set(outputs, outputs.at(np.array([1.0, -0.4, 0.5 * math.pi]))[0], STEP)
    assert any(ends_at_wall(outputs, curve) == (False, False) and not curve.closed for curve in feasible.curves)


def test_in_a_circle_the_curves_are_orbits_of_its_rotations() -> None:
    """With a mirror image where the sensors have one."""
    outputs, x = sensors(CIRCLE, -60.0, 60.0), np.array([0.7, 0.2, 0.3])
    feasible = feasible_set(outputs, outputs.at(x)[0], STEP)
    assert all(curve.closed for curve in feasible.curves)
    radii = {round(float(np.linalg.norm(p)), 6) for curve in feasible.curves for p in curve.points[:, :2]}
    assert round(math.hypot(0.7, 0.2), 6) in radii
    assert len(radii) == len(feasible.curves)


@pytest.mark.parametrize("curve", [ELLIPSE, BEAN], ids=["ellipse", "bean"])
def test_with_three_sensors_there_are_points(curve: Curve) -> None:
    rng = np.random.default_rng(2)
    outputs = sensors(curve, 0.0, 120.0, 240.0)
    feasible = feasible_set(outputs, outputs.at(curve.draw(rng, 0.3))[0])
    assert not feasible.curves
    assert 1 <= len(feasible.points) < 50
    assert_feasible(outputs, feasible)
    assert_found(outputs, feasible, rng, 1e-4)


def test_with_one_sensor_there_is_a_surface_cut_at_headings() -> None:
    rng = np.random.default_rng(3)
    outputs = sensors(ELLIPSE, 0.0)
    feasible = feasible_set(outputs, np.array([1.5]), STEP, slices=3)
    headings = sorted({round(float(x[2]), 9) for x in feasible.poses})
    np.testing.assert_allclose(headings, 2.0 * math.pi * np.arange(3) / 3, atol=1e-8)
    assert_feasible(outputs, feasible)
    s, heading = rng.uniform(0.0, 2.0 * math.pi, 200), headings[1]
    places = ELLIPSE.points(s) - 1.5 * np.array([math.cos(heading), math.sin(heading)])
    places = np.array([p for p in places if ELLIPSE.contains(p, 0.02)])
    at_heading = feasible.poses[np.abs(feasible.poses[:, 2] - heading) < 1e-6]
    assert cKDTree(at_heading[:, :2]).query(places)[0].max() <= STEP


def test_ranges_that_cannot_be_read_have_no_feasible_state() -> None:
    assert len(feasible_set(THESIS, np.array([30.0, 1.0])).poses) == 0
    assert len(feasible_set(sensors(ELLIPSE, 0.0, 120.0, 240.0), np.array([7.0, 7.0, 7.0])).poses) == 0


@pytest.mark.parametrize("y", [[1.0], [1.0, -1.0], [math.nan, 1.0], [1.0, math.inf], [0.0, 1.0]])
def test_readings_that_are_no_ranges_are_refused(y: list[float]) -> None:
    with pytest.raises(ValueError, match="allowed: 2 positive ranges"):
        feasible_set(THESIS, np.array(y))


def test_a_grid_too_coarse_is_refused() -> None:
    with pytest.raises(ValueError, match="grid = 2"):
        feasible_set(THESIS, np.array([1.0, 1.0]), grid=2)
