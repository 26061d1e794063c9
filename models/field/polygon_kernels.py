"""Walls of straight segments, compiled: rays, the inside and distances, found through a grid of cells.

A polygon with holes is a table (m, 8) of numbers, in which row 1 + k has the corners x_a, y_a, x_b, y_b [m] of segment
k, the inside on the left of a -> b. With s = k + tau it is the curve

    theta(s) = a_k + tau (b_k - a_k),     tau in [0, 1),

regular but for its corners, with theta''(s) = 0. Row 0 is a header: the grid's corner x, y [m], its cell [m], its
columns and rows, the number of segments, and the rows in which two lists of numbers begin, eight to a row: for each
cell, where its segments begin in the second list, and 1 if its reference point is inside; and the segments of each.

A ray visits the cells along it (Amanatides and Woo, 1987) and ends at the nearest segment that it crosses. Both
segments of a corner use the same sign of e x (corner - p), so no ray slips through between them; the length is exact
but for rounding. A point is inside if the way to it from the reference point of its cell crosses segments twice or not.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array, Integers

WIDTH = 8
"""columns of a table of segments, which a table of Fourier coefficients does not have"""

_REFERENCE_X, _REFERENCE_Y = 0.50137, 0.49871  # share of a cell: seldom in line with walls
_BEFORE_END = 1.0 - 1e-9  # of a segment: s has to tell which one it is
_SLACK = 1e-6  # of a cell, by which a segment counts as in it too


@inner_njit(nogil=True)
def is_polygonal(table: Array) -> bool:
    """True if a wall's table has segments, not Fourier coefficients."""
    return bool(table.shape[1] == WIDTH)


@inner_njit(nogil=True)
def _number(table: Array, row: int, index: int) -> int:
    """Number ``index`` of the list that begins in a ``row``."""
    return int(table[row + index // WIDTH, index % WIDTH])


@njit(cache=True, nogil=True)
def segment_point(table: Array, s: float) -> tuple[float, float]:
    """Point theta(s) [m] of a table of segments."""
    k = int(s)
    tau, row = s - k, table[1 + k]
    return row[0] + tau * (row[2] - row[0]), row[1] + tau * (row[3] - row[1])


@njit(cache=True, nogil=True)
def segment_tangent(table: Array, s: float) -> tuple[float, float]:
    """Derivative theta'(s) [m] of a table of segments."""
    row = table[1 + int(s)]
    return row[2] - row[0], row[3] - row[1]


@njit(cache=True, nogil=True)
def segment_ray(table: Array, x: float, y: float, ex: float, ey: float) -> tuple[float, float]:
    """Length rho [m] of the ray from (x, y) [m] along the unit vector (ex, ey), and s where it ends; NaN, NaN where it
    misses.
    """
    cell, columns, rows = table[0, 2], int(table[0, 3]), int(table[0, 4])
    u, v = (x - table[0, 0]) / cell, (y - table[0, 1]) / cell
    begin = _entry(u, v, ex, ey, columns, rows)
    if math.isnan(begin):
        return math.nan, math.nan
    i = min(max(math.floor(u + begin * ex), 0), columns - 1)
    j = min(max(math.floor(v + begin * ey), 0), rows - 1)
    step_i, step_j = (1 if ex > 0.0 else -1), (1 if ey > 0.0 else -1)
    # Lengths [cells] along the ray to the next column and row, and from one to the next.
    next_i = ((i + (step_i > 0)) - u) / ex if ex != 0.0 else math.inf
    next_j = ((j + (step_j > 0)) - v) / ey if ey != 0.0 else math.inf
    from_i = abs(1.0 / ex) if ex != 0.0 else math.inf
    from_j = abs(1.0 / ey) if ey != 0.0 else math.inf
    starts, lists = int(table[0, 6]), int(table[0, 7])
    rho, found = math.inf, math.nan
    while True:
        c = j * columns + i
        for n in range(_number(table, starts, 2 * c), _number(table, starts, 2 * c + 2)):
            k = _number(table, lists, n)
            ax, ay, bx, by = table[1 + k, 0] - x, table[1 + k, 1] - y, table[1 + k, 2] - x, table[1 + k, 3] - y
            at_a, at_b = ex * ay - ey * ax, ex * by - ey * bx
            if (at_a < 0.0) != (at_b < 0.0):
                tau = at_a / (at_a - at_b)
                along = ex * ax + ey * ay
                length = along + tau * (ex * bx + ey * by - along)
                if 0.0 < length < rho:
                    rho, found = length, k + min(tau, _BEFORE_END)
        if rho <= cell * min(next_i, next_j):
            return rho, found
        if next_i < next_j:
            i += step_i
            next_i += from_i
        else:
            j += step_j
            next_j += from_j
        if i < 0 or j < 0 or i >= columns or j >= rows:
            break
    return (rho, found) if not math.isnan(found) else (math.nan, math.nan)


@inner_njit(nogil=True)
def _entry(u: float, v: float, ex: float, ey: float, columns: int, rows: int) -> float:
    """Length [cells] along a ray at which it enters the grid, 0 from within; NaN where it does not."""
    begin, end = 0.0, math.inf
    for position, direction, size in ((u, ex, columns), (v, ey, rows)):
        if direction == 0.0:
            if position < 0.0 or position > size:
                return math.nan
            continue
        first, last = -position / direction, (size - position) / direction
        begin, end = max(begin, min(first, last)), min(end, max(first, last))
    return begin if begin <= end else math.nan


@njit(cache=True, nogil=True)
def is_within_segments(table: Array, x: float, y: float) -> bool:
    """True if (x, y) [m] is inside; on the wall itself the answer may be either."""
    cell, columns, rows = table[0, 2], int(table[0, 3]), int(table[0, 4])
    u, v = (x - table[0, 0]) / cell, (y - table[0, 1]) / cell
    if not (0.0 <= u < columns and 0.0 <= v < rows):
        return False
    i, j = int(u), int(v)
    starts, lists = int(table[0, 6]), int(table[0, 7])
    c = j * columns + i
    inside = _number(table, starts, 2 * c + 1) == 1
    r_x, r_y = _reference(table, i, j)
    d_x, d_y = x - r_x, y - r_y
    for n in range(_number(table, starts, 2 * c), _number(table, starts, 2 * c + 2)):
        k = _number(table, lists, n)
        ax, ay, bx, by = table[1 + k, 0], table[1 + k, 1], table[1 + k, 2], table[1 + k, 3]
        at_a, at_b = d_x * (ay - r_y) - d_y * (ax - r_x), d_x * (by - r_y) - d_y * (bx - r_x)
        if (at_a < 0.0) != (at_b < 0.0):
            at_r = (bx - ax) * (r_y - ay) - (by - ay) * (r_x - ax)
            at_p = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
            if (at_r < 0.0) != (at_p < 0.0):
                inside = not inside
    return inside


@inner_njit(nogil=True)
def _reference(table: Array, i: int, j: int) -> tuple[float, float]:
    """Reference point [m] of the cell in column i and row j."""
    return table[0, 0] + (i + _REFERENCE_X) * table[0, 2], table[0, 1] + (j + _REFERENCE_Y) * table[0, 2]


@njit(cache=True, nogil=True)
def segment_distance(table: Array, x: float, y: float) -> float:
    """Distance [m] from (x, y) [m] to the nearest segment."""
    cell, columns, rows = table[0, 2], int(table[0, 3]), int(table[0, 4])
    u, v = (x - table[0, 0]) / cell, (y - table[0, 1]) / cell
    starts, lists = int(table[0, 6]), int(table[0, 7])
    square = math.inf
    if not (0.0 <= u < columns and 0.0 <= v < rows):
        for k in range(int(table[0, 5])):
            square = min(square, _square_to(table, k, x, y))
        return math.sqrt(square)
    i, j = int(u), int(v)
    to_edge = min(u - i, v - j, i + 1 - u, j + 1 - v)
    for ring in range(max(columns, rows) + 1):  # cells at this Chebyshev distance from that of the point
        if math.isfinite(square) and square <= (cell * (ring - 1 + to_edge)) ** 2 and ring > 0:
            break
        for row in range(max(j - ring, 0), min(j + ring, rows - 1) + 1):
            whole = row in (j - ring, j + ring)
            column = i - ring
            while column <= i + ring:
                if 0 <= column < columns:
                    c = row * columns + column
                    for n in range(_number(table, starts, 2 * c), _number(table, starts, 2 * c + 2)):
                        square = min(square, _square_to(table, _number(table, lists, n), x, y))
                column += 1 if whole or ring == 0 else 2 * ring
    return math.sqrt(square)


@inner_njit(nogil=True)
def _square_to(table: Array, k: int, x: float, y: float) -> float:
    """Squared distance [m^2] from (x, y) to segment k."""
    ax, ay = table[1 + k, 0], table[1 + k, 1]
    dx, dy = table[1 + k, 2] - ax, table[1 + k, 3] - ay
    along = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)))
    ex, ey = ax + along * dx - x, ay + along * dy - y
    return float(ex * ex + ey * ey)


# ---- the table


@njit(cache=True, nogil=True)
def segment_table(segments: Array, low_x: float, low_y: float, cell: float, columns: int, rows: int) -> Array:
    """Table of ``segments`` (n, 4) [m] with a grid of ``columns`` x ``rows`` cells [m] from (low_x, low_y).

    The grid has to cover them.
    """
    n = len(segments)
    header = np.array([low_x, low_y, cell, columns, rows, n, 0.0, 0.0])
    counts = np.zeros(columns * rows + 1, np.int64)
    _list(segments, header, counts, np.zeros((1, WIDTH)), False)
    total = 0
    for c in range(len(counts)):
        total, counts[c] = total + counts[c], total
    starts = 1 + n
    lists = starts + (2 * len(counts) + WIDTH - 1) // WIDTH
    table = np.zeros((lists + (total + WIDTH - 1) // WIDTH, WIDTH))
    header[6], header[7] = starts, lists
    table[0] = header
    table[1 : 1 + n, :4] = segments
    for c in range(len(counts)):
        table[starts + 2 * c // WIDTH, 2 * c % WIDTH] = counts[c]
    _list(segments, header, counts, table, True)
    _mark_inside(table)
    return table


@inner_njit(nogil=True)
def _list(segments: Array, header: Array, counts: Integers, table: Array, fill: bool) -> None:
    """Count the segments of each cell in ``counts`` (c,) or, to ``fill``, list them in the table from there on."""
    cell, columns, rows, lists = header[2], int(header[3]), int(header[4]), int(header[7])
    for k in range(len(segments)):
        u_a, v_a = (segments[k, 0] - header[0]) / cell, (segments[k, 1] - header[1]) / cell
        u_b, v_b = (segments[k, 2] - header[0]) / cell, (segments[k, 3] - header[1]) / cell
        for j in range(_cell_of(min(v_a, v_b) - _SLACK, rows), _cell_of(max(v_a, v_b) + _SLACK, rows) + 1):
            first, last = _span(u_a, v_a, u_b, v_b, j - _SLACK, j + 1 + _SLACK)
            for i in range(_cell_of(first - _SLACK, columns), _cell_of(last + _SLACK, columns) + 1):
                c = j * columns + i
                if fill:
                    table[lists + counts[c] // WIDTH, counts[c] % WIDTH] = k
                counts[c] += 1


@inner_njit(nogil=True)
def _cell_of(u: float, count: int) -> int:
    return min(max(math.floor(u), 0), count - 1)


@inner_njit(nogil=True)
def _span(u_a: float, v_a: float, u_b: float, v_b: float, low: float, high: float) -> tuple[float, float]:
    """Least and greatest u of the part of a segment with v between ``low`` and ``high``."""
    if v_a == v_b:
        return min(u_a, u_b), max(u_a, u_b)
    first = min(max((low - v_a) / (v_b - v_a), 0.0), 1.0)
    last = min(max((high - v_a) / (v_b - v_a), 0.0), 1.0)
    u_first, u_last = u_a + first * (u_b - u_a), u_a + last * (u_b - u_a)
    return min(u_first, u_last), max(u_first, u_last)


@inner_njit(nogil=True)
def _mark_inside(table: Array) -> None:
    """Mark, in place, the cells whose reference point is inside: by the crossings of the line along their row."""
    columns, rows, n, starts = int(table[0, 3]), int(table[0, 4]), int(table[0, 5]), int(table[0, 6])
    for j in range(rows):
        flips = np.zeros(columns + 1, np.int64)  # of reference points from here on
        _, y = _reference(table, 0, j)
        for k in range(n):
            xa, ya, xb, yb = table[1 + k, 0], table[1 + k, 1], table[1 + k, 2], table[1 + k, 3]
            if (ya > y) != (yb > y):
                x = xa + (y - ya) / (yb - ya) * (xb - xa)
                first = math.ceil((x - table[0, 0]) / table[0, 2] - _REFERENCE_X)
                flips[min(max(first, 0), columns)] += 1
        crossed = 0
        for i in range(columns):
            crossed += flips[i]
            place = 2 * (j * columns + i) + 1
            table[starts + place // WIDTH, place % WIDTH] = crossed % 2


@njit(cache=True, nogil=True)
def crossings(table: Array, after: Integers) -> Integers:
    """Number (n,) of a segment that each one meets, but for the corner with its neighbour; -1 where it meets no other.

    ``after`` (n,) is the segment that follows each.
    """
    columns, rows = int(table[0, 3]), int(table[0, 4])
    starts, lists = int(table[0, 6]), int(table[0, 7])
    met = np.full(len(after), -1)
    for c in range(columns * rows):
        first, last = _number(table, starts, 2 * c), _number(table, starts, 2 * c + 2)
        for m in range(first, last):
            k = _number(table, lists, m)
            for n in range(first, m):
                other = _number(table, lists, n)
                if after[k] == other:
                    meets = _turns_back(table, k, other)
                elif after[other] == k:
                    meets = _turns_back(table, other, k)
                else:
                    meets = _meet(table, k, other)
                if meets:
                    met[k], met[other] = other, k
    return met


@inner_njit(nogil=True)
def _turns_back(table: Array, k: int, after: int) -> bool:
    """True if segment ``after``, which begins where k ends, lies on it."""
    dx, dy = table[1 + k, 2] - table[1 + k, 0], table[1 + k, 3] - table[1 + k, 1]
    ex, ey = table[1 + after, 2] - table[1 + after, 0], table[1 + after, 3] - table[1 + after, 1]
    return bool(dx * ey - dy * ex == 0.0 and dx * ex + dy * ey < 0.0)


@inner_njit(nogil=True)
def _meet(table: Array, k: int, other: int) -> bool:
    """True if two segments cross or touch."""
    a, b = table[1 + k, :2], table[1 + k, 2:4]
    p, q = table[1 + other, :2], table[1 + other, 2:4]
    for j in range(2):
        if max(a[j], b[j]) < min(p[j], q[j]) or max(p[j], q[j]) < min(a[j], b[j]):
            return False
    at_a, at_b = _side(p, q, a), _side(p, q, b)
    at_p, at_q = _side(a, b, p), _side(a, b, q)
    return bool(min(at_a, at_b) <= 0.0 <= max(at_a, at_b) and min(at_p, at_q) <= 0.0 <= max(at_p, at_q))


@inner_njit(nogil=True)
def _side(a: Array, b: Array, p: Array) -> float:
    return float((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]))
