"""The least clearance of an arc against dense sampling, and the degenerate arcs by name."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.kernels import arc_clearance, height_at

SPACING = 100.0
ROWS, COLUMNS = 7, 9
STILL = np.zeros(3)


def rough(seed: int = 0, rows: int = ROWS, columns: int = COLUMNS, spacing: float = SPACING) -> HeightField:
    return HeightField(np.random.default_rng(seed).uniform(0.0, 300.0, (rows, columns)), spacing)


def ground(terrain: HeightField, x: Array, y: Array) -> Array:
    """Height by barycentric weights of the triangle's corners, written apart from the code under test."""
    rows, columns = terrain.z.shape
    i = np.clip(np.floor(x / terrain.spacing).astype(int), 0, columns - 2)
    j = np.clip(np.floor(y / terrain.spacing).astype(int), 0, rows - 2)
    u, w = x / terrain.spacing - i, y / terrain.spacing - j
    south_west, north_east = terrain.z[j, i], terrain.z[j + 1, i + 1]
    south_east, north_west = terrain.z[j, i + 1], terrain.z[j + 1, i]
    below = (1.0 - u) * south_west + (u - w) * south_east + w * north_east
    above = (1.0 - w) * south_west + (w - u) * north_west + u * north_east
    height: Array = np.where(u >= w, below, above)
    return height


def sampled_clearance(terrain: HeightField, p: Array, v: Array, a: Array, duration: float) -> float:
    """Least clearance over samples, made denser around the lowest ones until it no longer matters."""

    def clearance(t: Array) -> Array:
        x, y, z = (p[k] + v[k] * t + 0.5 * a[k] * t**2 for k in range(3))
        # The map is closed; rounding may put a sample of an arc along its border just outside.
        result: Array = z - ground(terrain, np.clip(x, 0.0, terrain.width), np.clip(y, 0.0, terrain.depth))
        return result

    times = np.linspace(0.0, duration, 2001)
    values = clearance(times)
    least = float(values.min())
    step = times[1]
    for centre in times[np.argsort(values)[:8]]:
        middle, reach = centre, step
        for _ in range(5):
            near = np.clip(np.linspace(middle - reach, middle + reach, 401), 0.0, duration)
            nearby = clearance(near)
            middle, reach = near[nearby.argmin()], reach / 100.0
            least = min(least, float(nearby.min()))
    return least


# Arcs in units of cells and seconds, in halves, so that edges, diagonals and corners are hit often.
halves = st.integers(-8, 8).map(lambda n: 0.5 * n)
components = st.one_of(st.just(0.0), halves, st.floats(-3.0, 3.0, allow_subnormal=False))
durations = st.one_of(st.just(0.0), st.integers(1, 6).map(lambda n: 0.5 * n), st.floats(1e-3, 4.0))


@st.composite
def arcs(draw: st.DrawFn) -> tuple[Array, Array, Array, float]:
    east = draw(st.one_of(st.integers(0, 2 * (COLUMNS - 1)).map(lambda n: 0.5 * n), st.floats(0.0, COLUMNS - 1.0)))
    north = draw(st.one_of(st.integers(0, 2 * (ROWS - 1)).map(lambda n: 0.5 * n), st.floats(0.0, ROWS - 1.0)))
    p = SPACING * np.array([east, north, draw(st.floats(-1.0, 5.0))])
    v = SPACING * np.array([draw(components) for _ in range(3)])
    a = SPACING * np.array([draw(components) for _ in range(3)])
    if draw(st.booleans()):
        v[1], a[1] = v[0], a[0]  # along the diagonals
    return p, v, a, draw(durations)


@settings(max_examples=400)
@given(arcs(), st.integers(0, 3))
def test_clearance_is_that_of_dense_sampling_and_never_above_it(
    arc: tuple[Array, Array, Array, float], seed: int
) -> None:
    terrain = rough(seed)
    p, v, a, duration = arc
    exact = terrain.arc_clearance(p, v, a, duration)
    if exact == -math.inf:
        t = np.linspace(0.0, duration, 20001)
        x, y = (p[k] + v[k] * t + 0.5 * a[k] * t**2 for k in range(2))
        beyond = max(-x.min(), x.max() - terrain.width, -y.min(), y.max() - terrain.depth)
        # Between samples the extreme may lie a little farther out.
        assert beyond > -0.5 * SPACING * 3.0 * (duration / 20000) ** 2 - 1e-9
    else:
        sampled = sampled_clearance(terrain, p, v, a, duration)
        assert exact <= sampled + 1e-9
        assert exact >= sampled - 1e-9


@given(arcs(), st.floats(0.0, 1.0))
def test_clearance_of_an_arc_is_the_least_of_its_two_parts(
    arc: tuple[Array, Array, Array, float], share: float
) -> None:
    terrain = rough()
    p, v, a, duration = arc
    whole = terrain.arc_clearance(p, v, a, duration)
    if whole == -math.inf:
        return
    t = share * duration
    rest = p + v * t + 0.5 * a * t**2
    rest[:2] = np.clip(rest[:2], 0.0, (terrain.width, terrain.depth))
    parts = terrain.path_clearance([p, rest], [v, v + a * t], [a, a], [t, duration - t])
    if np.isfinite(parts).all():  # rounding may push the second part of an arc along the border off the map
        assert parts.min() == pytest.approx(whole, abs=1e-8)


def test_hover_is_the_height_above_ground() -> None:
    terrain = rough()
    p = np.array([333.0, 251.0, 900.0])
    expected = 900.0 - ground(terrain, p[0], p[1])
    assert terrain.arc_clearance(p, STILL, STILL, 10.0) == pytest.approx(expected, abs=1e-12)
    assert terrain.arc_clearance(p, STILL, STILL, 0.0) == pytest.approx(expected, abs=1e-12)


def test_vertical_dive_is_lowest_at_its_vertex() -> None:
    terrain = rough()
    p, v, a = np.array([333.0, 251.0, 900.0]), np.array([0.0, 0.0, -40.0]), np.array([0.0, 0.0, 10.0])
    expected = 900.0 - 40.0**2 / (2.0 * 10.0) - ground(terrain, p[0], p[1])
    assert terrain.arc_clearance(p, v, a, 10.0) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("start", "velocity", "nodes"),
    [
        ((0, 3), (1, 0), [(k, 3) for k in range(9)]),  # along an edge between rows
        ((4, 0), (0, 1), [(4, k) for k in range(7)]),  # along an edge between columns
        ((1, 0), (1, 1), [(k + 1, k) for k in range(7)]),  # along the diagonals
        ((0, 0), (1, 0), [(k, 0) for k in range(9)]),  # along the southern border
        ((8, 6), (0, -1), [(8, k) for k in range(7)]),  # along the eastern border
    ],
)
def test_level_flight_along_edges_is_lowest_above_the_highest_node(
    start: tuple[int, int], velocity: tuple[int, int], nodes: list[tuple[int, int]]
) -> None:
    terrain = rough()
    p, v = SPACING * np.array([*start, 10.0]), SPACING * np.array([*velocity, 0.0])
    highest = max(terrain.z[j, i] for i, j in nodes)
    assert terrain.arc_clearance(p, v, STILL, len(nodes) - 1.0) == pytest.approx(1000.0 - highest, abs=1e-10)


def test_tangency_to_an_edge_does_no_harm() -> None:
    terrain = rough()
    # X(t) = 3 + (t - 2)^2 / 4: touches X = 3 at t = 2, from the east.
    p, v, a = np.array([400.0, 10.0, 1000.0]), np.array([-100.0, 100.0, 0.0]), np.array([50.0, 0.0, 0.0])
    exact = terrain.arc_clearance(p, v, a, 4.0)
    assert exact == pytest.approx(sampled_clearance(terrain, p, v, a, 4.0), abs=1e-9)


def test_an_arc_that_leaves_the_map_only_at_its_vertex_is_refused() -> None:
    terrain = rough()
    p, v, a = np.array([1.0, 300.0, 5000.0]), np.array([-3.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0])
    duration = 3.0
    assert terrain.contains(*(p + v * duration + 0.5 * a * duration**2)[:2])  # both ends are on the map
    assert terrain.arc_clearance(p, v, a, duration) == -math.inf
    assert (
        terrain.arc_clearance(p + np.array([1.25, 0.0, 0.0]), v, a, duration) > 0.0
    )  # now the vertex is on the border


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(10))
def test_what_is_not_finite_has_no_clearance(bad: float, place: int) -> None:
    arc = np.array([300.0, 300.0, 900.0, 1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 2.0])
    arc[place] = bad
    terrain = rough()
    assert arc_clearance(terrain.z, terrain.spacing, arc[:3], arc[3:6], arc[6:9], float(arc[9])) == -math.inf


def test_a_negative_duration_has_no_clearance() -> None:
    assert rough().arc_clearance([300.0, 300.0, 900.0], STILL, STILL, -1.0) == -math.inf


def test_path_clearance_is_arc_clearance_of_each() -> None:
    terrain = rough()
    rng = np.random.default_rng(1)
    p = rng.uniform([0, 0, 200], [800, 600, 900], (200, 3))
    v, a = rng.uniform(-100.0, 100.0, (2, 200, 3))
    duration = rng.uniform(0.0, 3.0, 200)
    one_by_one = [terrain.arc_clearance(*arc) for arc in zip(p, v, a, duration, strict=True)]
    np.testing.assert_array_equal(terrain.path_clearance(p, v, a, duration), one_by_one)


def test_path_clearance_refuses_lengths_that_disagree() -> None:
    with pytest.raises(ValueError, match="disagree on the number of arcs"):
        rough().path_clearance(np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((3, 3)), np.zeros(2))


def test_height_interpolates_the_triangles_and_is_nan_off_the_map() -> None:
    terrain = rough()
    x, y = np.random.default_rng(2).uniform(0.0, 1.0, (2, 500)) * [[terrain.width], [terrain.depth]]
    np.testing.assert_allclose(terrain.height(x, y), ground(terrain, x, y), atol=1e-10)
    assert terrain.height(800.0, 600.0) == pytest.approx(terrain.z[-1, -1], abs=1e-10)
    height_of = njit(lambda z, spacing, x, y: height_at(z, spacing, x, y))
    assert height_of(terrain.z, terrain.spacing, 800.0, 600.0) == terrain.height(800.0, 600.0)
    outside = terrain.height([-1e-9, 800.1, 0.0, math.nan], [0.0, 0.0, 600.1, 0.0])
    assert np.isnan(outside).all()


@given(st.floats(0.01, 1000.0), st.integers(2, 600))
def test_the_far_border_belongs_to_the_map_whatever_the_spacing(spacing: float, nodes: int) -> None:
    terrain = HeightField(np.zeros((2, nodes)), spacing)
    assert terrain.height(terrain.width, terrain.depth) == 0.0
    p = [terrain.width, terrain.depth, 7.0]
    assert terrain.arc_clearance(p, STILL, STILL, 1.0) == 7.0
    assert np.isnan(terrain.height(terrain.width * (1.0 + 1e-12), 0.0))


def test_gradient_is_the_slope_of_the_height_and_the_normal_is_square_to_it() -> None:
    terrain = rough()
    i, j = np.meshgrid(np.arange(COLUMNS - 1), np.arange(ROWS - 1))
    for u, w in ((0.7, 0.2), (0.2, 0.7)):  # within either triangle
        x, y = SPACING * (i + u), SPACING * (j + w)
        gradient = terrain.gradient(x, y)
        np.testing.assert_allclose(
            gradient[..., 0], (terrain.height(x + 1, y) - terrain.height(x - 1, y)) / 2, atol=1e-9
        )
        np.testing.assert_allclose(
            gradient[..., 1], (terrain.height(x, y + 1) - terrain.height(x, y - 1)) / 2, atol=1e-9
        )
        normal = terrain.normal(x, y)
        np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1.0, atol=1e-12)
        np.testing.assert_allclose(normal[..., :2] + normal[..., 2:] * gradient, 0.0, atol=1e-12)


@given(
    st.integers(0, 5),
    st.floats(0.0, 3.5 * SPACING),
    st.floats(0.0, 50.0),
    st.sampled_from([(2, 2), (3, 5), (ROWS, COLUMNS)]),
)
def test_inflated_ground_lies_above_the_highest_ground_of_the_disc(
    seed: int, horizontal: float, vertical: float, shape: tuple[int, int]
) -> None:
    terrain = rough(seed, *shape)
    inflated = terrain.inflated(horizontal, vertical)
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.0, 1.0, (2, 2000)) * [[terrain.width], [terrain.depth]]
    angle, reach = rng.uniform(0.0, 2.0 * np.pi, 2000), horizontal * np.sqrt(rng.uniform(0.0, 1.0, 2000))
    near = terrain.height(x + reach * np.cos(angle), y + reach * np.sin(angle))
    on_map = ~np.isnan(near)
    assert (inflated.height(x, y)[on_map] >= near[on_map] + vertical - 1e-9).all()


@pytest.mark.parametrize("horizontal", [-1.0, math.inf, math.nan])
def test_inflation_refuses_a_disc_without_a_radius(horizontal: float) -> None:
    with pytest.raises(ValueError, match=r"horizontal is .* allowed: a finite number"):
        rough().inflated(horizontal, 0.0)


@pytest.mark.parametrize("vertical", [-1.0, math.inf, math.nan])
def test_inflation_refuses_to_lower_the_ground(vertical: float) -> None:
    with pytest.raises(ValueError, match=r"vertical is"):
        rough().inflated(1.0, vertical)


def test_seventy_kilometres_take_less_than_a_tenth_of_a_millisecond() -> None:
    terrain = rough(0, 513, 513, 160.0)
    arc = ([1000.0, 9000.0, 9000.0], [200.0, 120.0, 0.0], STILL, 300.0)
    terrain.arc_clearance(*arc)
    best = math.inf
    for _ in range(50):  # the best of many, in CPU time: others may use the core and its caches
        begin = time.thread_time()
        terrain.arc_clearance(*arc)
        best = min(best, time.thread_time() - begin)
    assert best < 1e-4
