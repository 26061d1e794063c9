"""Exact geometry of arcs over a triangulated height field, compiled.

The ground is the surface that MuJoCo collides with: heights z[j, i] at the nodes (i, j) of a square grid, every cell
cut along its diagonal (i, j)-(i + 1, j + 1), linear on each of the two triangles. In cell units X = x / spacing and
Y = y / spacing, the triangle below the diagonal (X - i >= Y - j) has the corner (i + 1, j), the other (i, j + 1).

Along an arc of constant acceleration X, Y and the height are quadratic in time, so on each triangle the clearance is
one quadratic. The arc changes triangles where X, Y or X - Y is an integer; between two such times its least clearance
is at an end or at the vertex. That gives the least clearance of the whole arc in closed form, without sampling.

Every function takes plain arrays and scalars, so that other compiled code can call it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import float64
from numpy.typing import NDArray

from mathnavi.interfaces.compiled import Signature, inner_njit, njit
from mathnavi.interfaces.kernel_types import ONE, TWO, TWO_READ
from mathnavi.interfaces.signals import Array

Booleans = NDArray[np.bool_]

SIGHT_TOLERANCE = 1e-6
"""depth [m] below the ground beyond which a sight line is blocked: a point that rests on the ground can be seen"""


class Arc(NamedTuple):
    """The arc p + v t + a t^2 / 2 over 0 <= t <= duration, in the map frame."""

    px: float  # [m]
    py: float
    pz: float
    vx: float  # [m/s]
    vy: float
    vz: float
    ax: float  # [m/s^2]
    ay: float
    az: float
    duration: float  # [s]


@inner_njit(error_model="numpy")
def _triangle(z: Array, x: float, y: float) -> tuple[int, int, float, float]:
    """Cell (i, j) and slope (g_x, g_y) [m per cell] of the triangle under the point (x, y) [cells].

    Both triangles of a cell have the corner (i, j), so the ground is z[j, i] + g_x (x - i) + g_y (y - j).
    """
    i = min(max(math.floor(x), 0), z.shape[1] - 2)
    j = min(max(math.floor(y), 0), z.shape[0] - 2)
    if x - i >= y - j:
        return i, j, z[j, i + 1] - z[j, i], z[j + 1, i + 1] - z[j, i + 1]
    return i, j, z[j + 1, i + 1] - z[j + 1, i], z[j + 1, i] - z[j, i]


@inner_njit(error_model="numpy")
def _last(nodes: int, spacing: float) -> float:
    """The far border [cells]: nodes - 1, rounded as x / spacing is for a point x [m] on the border."""
    return ((nodes - 1) * spacing) / spacing


@inner_njit(error_model="numpy")
def surface_at(z: Array, spacing: float, x: float, y: float) -> tuple[float, float, float]:
    """Height [m] and gradient (dH/dx, dH/dy) of the ground z (rows, cols) [m] at (x, y) [m]; NaN off the map."""
    x_cells = x / spacing
    y_cells = y / spacing
    if not (0.0 <= x_cells <= _last(z.shape[1], spacing) and 0.0 <= y_cells <= _last(z.shape[0], spacing)):
        return math.nan, math.nan, math.nan
    i, j, slope_x, slope_y = _triangle(z, x_cells, y_cells)
    height = z[j, i] + slope_x * (x_cells - i) + slope_y * (y_cells - j)
    return height, slope_x / spacing, slope_y / spacing


@inner_njit(error_model="numpy")
def height_at(z: Array, spacing: float, x: float, y: float) -> float:
    """Height [m] of the ground z (rows, cols) [m] at (x, y) [m]; NaN off the map."""
    height, _, _ = surface_at(z, spacing, x, y)
    return height


@njit(cache=True, error_model="numpy")
def surface(z: Array, spacing: float, x: Array, y: Array) -> Array:
    """Height [m] and gradient (n, 3) of the ground z (rows, cols) [m] at each of the points x, y (n,) [m]."""
    result = np.empty((x.size, 3))
    for n in range(x.size):
        result[n, 0], result[n, 1], result[n, 2] = surface_at(z, spacing, x[n], y[n])
    return result


@inner_njit(error_model="numpy")
def _vertex_time(b: float, a: float, duration: float) -> float:
    """Time of the vertex of c + b t + a t^2, clipped to [0, duration]; ``duration`` if a = 0."""
    if a == 0.0:
        return duration
    return min(max(-b / (2.0 * a), 0.0), duration)


@inner_njit(error_model="numpy")
def _crossing_times(times: Array, count: int, c: float, b: float, a: float, duration: float) -> int:
    """Append to ``times``, in order, the times in [0, duration] at which f(t) = c + b t + a t^2 is an integer.

    f is monotone up to its vertex and after it, so each part meets its integers in order: no sorting is needed. The
    root before the vertex is the smaller one, the root after it the larger. Returns the new count.
    """
    if a == 0.0 and b == 0.0:
        return count  # along an edge or not moving: one triangle, either one on the edge
    vertex = _vertex_time(b, a, duration)
    for part in range(2):
        begin = 0.0 if part == 0 else vertex
        end = vertex if part == 0 else duration
        if end <= begin:
            continue
        f_begin = c + begin * (b + a * begin)
        f_end = c + end * (b + a * end)
        step = 1 if f_end >= f_begin else -1
        first = math.ceil(step * f_begin)
        last = math.floor(step * f_end)
        for level in range(first, last + 1):
            constant = c - step * level
            root = math.sqrt(max(b * b - 4.0 * a * constant, 0.0))
            s = -0.5 * (b + root) if b >= 0.0 else -0.5 * (b - root)
            if a == 0.0:
                t = constant / s
            elif s == 0.0:
                t = 0.0
            elif part == 0:
                t = min(s / a, constant / s)
            else:
                t = max(s / a, constant / s)
            begin = min(max(t, begin), end)  # from here on: the latest crossing, so that rounding keeps the order
            times[count] = begin
            count += 1
    return count


@inner_njit(error_model="numpy")
def _crossing_bound(c: float, b: float, a: float, duration: float) -> int:
    """An upper bound of the number of times that ``_crossing_times`` appends."""
    vertex = _vertex_time(b, a, duration)
    f_vertex = c + vertex * (b + a * vertex)
    f_end = c + duration * (b + a * duration)
    return int(abs(f_vertex - c)) + int(abs(f_end - f_vertex)) + 4


@inner_njit(error_model="numpy")
def _stays_within(c: float, b: float, a: float, duration: float, limit: float) -> bool:
    """True if 0 <= c + b t + a t^2 <= limit over all of [0, duration]."""
    vertex = _vertex_time(b, a, duration)
    f_vertex = c + vertex * (b + a * vertex)
    f_end = c + duration * (b + a * duration)
    return min(c, f_vertex, f_end) >= 0.0 and max(c, f_vertex, f_end) <= limit


@inner_njit(error_model="numpy")
def _least_clearance(z: Array, spacing: float, arc: Arc, stop_below: float) -> float:
    """``arc_clearance``, which may return early with any clearance of the arc that is less than ``stop_below``."""
    px, py, pz, vx, vy, vz, ax, ay, az, duration = arc
    if not (math.isfinite(px + py + pz + vx + vy + vz + ax + ay + az + duration) and duration >= 0.0):
        return -math.inf
    # X(t) = x0 + x1 t + x2 t^2 and Y in the same form, in cells; height above sea level pz + vz t + h2 t^2, in metres.
    x0, x1, x2 = px / spacing, vx / spacing, 0.5 * ax / spacing
    y0, y1, y2 = py / spacing, vy / spacing, 0.5 * ay / spacing
    h2 = 0.5 * az
    on_map_east = _stays_within(x0, x1, x2, duration, _last(z.shape[1], spacing))
    on_map_north = _stays_within(y0, y1, y2, duration, _last(z.shape[0], spacing))
    if not (on_map_east and on_map_north):
        return -math.inf

    d0, d1, d2 = x0 - y0, x1 - y1, x2 - y2
    times = np.empty(
        _crossing_bound(x0, x1, x2, duration)
        + _crossing_bound(y0, y1, y2, duration)
        + _crossing_bound(d0, d1, d2, duration)
    )
    none = int(np.int64(0))  # a literal would be another type, and the kernel compiled once more for it
    end_x = _crossing_times(times, none, x0, x1, x2, duration)
    end_y = _crossing_times(times, end_x, y0, y1, y2, duration)
    end_d = _crossing_times(times, end_y, d0, d1, d2, duration)

    least: float = pz - height_at(z, spacing, px, py)
    t, n_x, n_y, n_d = 0.0, 0, end_x, end_y
    while t < duration:
        t_next = duration
        if n_x < end_x:
            t_next = min(t_next, times[n_x])
        if n_y < end_y:
            t_next = min(t_next, times[n_y])
        if n_d < end_d:
            t_next = min(t_next, times[n_d])
        # Past every crossing that is due; a doubled one then makes no additional piece.
        while n_x < end_x and times[n_x] <= t_next:
            n_x += 1
        while n_y < end_y and times[n_y] <= t_next:
            n_y += 1
        while n_d < end_d and times[n_d] <= t_next:
            n_d += 1
        if t_next <= t:
            continue
        middle = 0.5 * (t + t_next)
        i, j, slope_x, slope_y = _triangle(z, x0 + middle * (x1 + x2 * middle), y0 + middle * (y1 + y2 * middle))
        c = pz - z[j, i] - slope_x * (x0 - i) - slope_y * (y0 - j)
        b = vz - slope_x * x1 - slope_y * y1
        a = h2 - slope_x * x2 - slope_y * y2
        least = min(least, c + t * (b + a * t), c + t_next * (b + a * t_next))
        if a > 0.0:
            vertex = -b / (2.0 * a)
            if t < vertex < t_next:
                least = min(least, c + vertex * (b + a * vertex))
        if least < stop_below:
            return least
        t = t_next
    return least


@njit(cache=True, error_model="numpy")
def arc_clearance(z: Array, spacing: float, p: Array, v: Array, a: Array, duration: float) -> float:
    """Least height above ground [m] of p + v t + a t^2 / 2 over 0 <= t <= duration [s].

    p (3,) [m], v (3,) [m/s] and a (3,) [m/s^2] are in the map frame. -inf if the arc leaves the map, if an argument is
    not finite or if the duration is negative.
    """
    arc = Arc(p[0], p[1], p[2], v[0], v[1], v[2], a[0], a[1], a[2], duration)
    return _least_clearance(z, spacing, arc, -math.inf)


@njit(cache=True, error_model="numpy")
def path_clearance(z: Array, spacing: float, p: Array, v: Array, a: Array, duration: Array) -> Array:
    """``arc_clearance`` (K,) [m] of K arcs: p (K, 3) [m], v (K, 3) [m/s], a (K, 3) [m/s^2], duration (K,) [s]."""
    result = np.empty(duration.size)
    for k in range(duration.size):
        arc = Arc(p[k, 0], p[k, 1], p[k, 2], v[k, 0], v[k, 1], v[k, 2], a[k, 0], a[k, 1], a[k, 2], duration[k])
        result[k] = _least_clearance(z, spacing, arc, -math.inf)
    return result


@njit(cache=True, error_model="numpy")
def sight(z: Array, spacing: float, p: Array, q: Array) -> bool:
    """True if the segment from p (3,) to q (3,) [m] lies on the map, nowhere deeper than ``SIGHT_TOLERANCE``.

    The ends are put in one order first, so that rounding cannot make p see q but not q see p.
    """
    px, py, pz = p[0], p[1], p[2]
    qx, qy, qz = q[0], q[1], q[2]
    if px > qx or (px == qx and (py > qy or (py == qy and pz > qz))):
        px, py, pz, qx, qy, qz = qx, qy, qz, px, py, pz
    segment = Arc(px, py, pz, qx - px, qy - py, qz - pz, 0.0, 0.0, 0.0, 1.0)
    least = _least_clearance(z, spacing, segment, -SIGHT_TOLERANCE)
    return least >= -SIGHT_TOLERANCE


@njit(cache=True, error_model="numpy")
def sights(z: Array, spacing: float, p: Array, points: Array) -> Booleans:
    """``sight`` (n,) from p (3,) [m] to each of the points (n, 3) [m]."""
    result = np.empty(points.shape[0], np.bool_)
    for n in range(points.shape[0]):
        result[n] = sight(z, spacing, p, points[n])
    return result


# Kernels that are compiled before a run (``sim.engine.compilation``), for arguments of these types.
KERNELS: tuple[Signature, ...] = ((sights, (TWO_READ, float64, ONE, TWO)),)
