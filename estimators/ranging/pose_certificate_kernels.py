"""Branch and bound over all poses in a room for those that explain a set of ranges, compiled.

Seen from a pose x = (p, phi), reading j says that the wall is at

    q_j(x) = p + R_phi a_j,      a_j the ray's end in the robot's own axes.

The wall's distance d, positive within, is there at most the error of the range. It is 1-Lipschitz, and over a box of
half-widths h of p and w of phi a point p + R_phi a moves by m = sqrt(2) h + |a| w at most. So no pose of a box about x
explains the readings if, with the bounds b_j, the standard deviations sigma_j and the largest errors g_j of the motion,

    |d(q_j(x))| > b_j + m_j   for more j than there may be outliers,   or, without outliers,
    sum_j max(0, |d(q_j(x))| - g_j - m_j)^2 / sigma_j^2 > limit,

nor if the robot, or a point of a ray before its end, would be beyond the wall: d(p + R_phi a) < -g - m. A box that no
test refutes is divided; the poses that are left are found by least squares and checked against cast rays.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import inner_njit, njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import WallShape, cast_ray, is_inside, wall_distance
from mathnavi.models.unicycle.kernels import wrapped

DistanceGrid = tuple[Array, float, float, float, float]
"""signed distances (n_x, n_y) [m] at nodes, the first node x, y [m], the cell [m], and the largest error [m] of the
nearest node's value"""

Tests = tuple[Array, int, float]
"""rows (x, y, length, bound, g, sigma) (m, 6) [m] of points in the robot's axes, first those that have to be on the
wall, then those that have to be within it; the number of the former that may be outliers; and the limit of their sum"""

_SIDE = 0.5  # [m] of the first boxes
_SECTORS = 16  # of headings, first
_STACK = 100_000  # boxes that wait, more than the first ones
_REFUTED = 10  # boxes at least that may be examined for each first one: of a floor there are more than of a room
_ITERATIONS = 12
_PAD = 2  # cells of the grid beyond the wall


@njit(cache=True, nogil=True)
def distance_grid(wall: WallShape, nodes: int, chord_error: float) -> DistanceGrid:
    """Grid of signed distances, ``nodes`` along its longer side, of a wall whose chords err by ``chord_error`` [m]."""
    coefficients, polyline = wall
    low_x, low_y = polyline[:, 0].min(), polyline[:, 1].min()
    high_x, high_y = polyline[:, 0].max(), polyline[:, 1].max()
    cell = max(high_x - low_x, high_y - low_y) / nodes
    low_x, low_y = low_x - _PAD * cell, low_y - _PAD * cell
    n_x = math.ceil((high_x - low_x) / cell) + _PAD + 1
    n_y = math.ceil((high_y - low_y) / cell) + _PAD + 1
    values = np.empty((n_x, n_y))
    for i in range(n_x):
        for j in range(n_y):
            x, y = low_x + i * cell, low_y + j * cell
            distance = wall_distance(coefficients, polyline, x, y)
            values[i, j] = distance if is_inside(coefficients, polyline, x, y) else -distance
    return values, low_x, low_y, cell, cell / math.sqrt(2.0) + 2.0 * chord_error


@njit(cache=True, nogil=True)
def _distance(grid: DistanceGrid, x: float, y: float) -> float:
    """Signed distance [m] at the node nearest to (x, y); beyond the grid an upper bound of it."""
    values, low_x, low_y, cell, _ = grid
    n_x, n_y = values.shape
    u, v = (x - low_x) / cell, (y - low_y) / cell
    out_x, out_y = max(0.0, -u, u - (n_x - 1)), max(0.0, -v, v - (n_y - 1))
    if out_x > 0.0 or out_y > 0.0:
        return -cell * (math.sqrt(out_x * out_x + out_y * out_y) + (_PAD - 1))
    return float(values[int(u + 0.5), int(v + 0.5)])


@inner_njit(nogil=True)
def _refuting(grid: DistanceGrid, tests: Tests, ends: int, box: Array) -> int:
    """Index of the test that refutes the box, beginning with its own; -1 where none does."""
    rows, outliers, limit = tests
    c, s, first = math.cos(box[2]), math.sin(box[2]), int(box[5])
    shift = math.sqrt(2.0) * box[3] + grid[4]
    wrong, total = 0, 0.0
    for n in range(len(rows)):
        j = n + first
        if j >= len(rows):
            j -= len(rows)
        ax, ay = rows[j, 0], rows[j, 1]
        d = _distance(grid, box[0] + c * ax - s * ay, box[1] + s * ax + c * ay)
        moved = shift + rows[j, 2] * box[4]
        if j >= ends:
            if d < -rows[j, 4] - moved:
                return j
            continue
        if abs(d) > rows[j, 3] + moved:
            wrong += 1
            if wrong > outliers:
                return j
        beyond = max(0.0, abs(d) - rows[j, 4] - moved) / rows[j, 5]
        total += beyond * beyond
        if total > limit:
            return j
    return -1


@inner_njit(nogil=True)
def _fitted(grid: DistanceGrid, rows: Array, start: Array) -> Array:
    """Pose (3,) near ``start`` from which the ends of the rays ``rows`` are nearest to the wall, by Gauss-Newton."""
    pose, cell = start[:3].copy(), grid[3]
    H, g, A = np.empty(3), np.empty(3), np.empty((3, 3))
    for _ in range(_ITERATIONS):
        A[:], g[:] = 1e-6 * np.eye(3), 0.0
        c, s = math.cos(pose[2]), math.sin(pose[2])
        for j in range(len(rows)):
            ax, ay = rows[j, 0], rows[j, 1]
            dx, dy = c * ax - s * ay, s * ax + c * ay
            qx, qy = pose[0] + dx, pose[1] + dy
            d = _distance(grid, qx, qy)
            H[0] = (_distance(grid, qx + 2 * cell, qy) - _distance(grid, qx - 2 * cell, qy)) / (4 * cell)
            H[1] = (_distance(grid, qx, qy + 2 * cell) - _distance(grid, qx, qy - 2 * cell)) / (4 * cell)
            H[2] = H[1] * dx - H[0] * dy
            weight = 1.0 / rows[j, 3] ** 2
            for a in range(3):
                g[a] -= weight * H[a] * d
                for b in range(3):
                    A[a, b] += weight * H[a] * H[b]
        step = np.linalg.solve(A, g)
        longest = np.abs(step).max()
        pose += step * min(1.0, 0.3 / max(longest, 1e-12))
        if longest < 1e-4:
            break
    pose[2] = wrapped(pose[2])
    return pose


@njit(cache=True, nogil=True)
def explains(wall: WallShape, rays: Array, outliers: int, limit: float, pose: Array) -> bool:
    """True if a pose (3,) explains ``rays`` (m, 7), by casting them.

    A ray is its start (2,) [m] and direction [rad] in the robot's axes, its range, the error that the motion may add,
    its standard deviation, and its bound [m].
    """
    coefficients, polyline = wall
    c, s, wrong, total = math.cos(pose[2]), math.sin(pose[2]), 0, 0.0
    for j in range(len(rays)):
        x, y = pose[0] + c * rays[j, 0] - s * rays[j, 1], pose[1] + s * rays[j, 0] + c * rays[j, 1]
        if not is_inside(coefficients, polyline, x, y):
            return False
        rho, _ = cast_ray(coefficients, polyline, x, y, pose[2] + rays[j, 2])
        residual = abs(rho - rays[j, 3])
        if not residual <= rays[j, 6]:
            wrong += 1
        total += (max(0.0, residual - rays[j, 4]) / rays[j, 5]) ** 2
        if wrong > outliers or total > limit:
            return False
    return True


@inner_njit(nogil=True)
def _is_near(poses: Array, count: int, x: Array, h: float, w: float, radius: float, angle: float) -> bool:
    """True if the box of half-widths h [m], w [rad] about x is within ``radius`` [m], ``angle`` [rad] of one pose."""
    for k in range(count):
        dx, dy = x[0] - poses[k, 0], x[1] - poses[k, 1]
        near = math.sqrt(dx * dx + dy * dy) + math.sqrt(2.0) * h <= radius
        if near and abs(wrapped(x[2] - poses[k, 2])) + w <= angle:
            return True
    return False


@njit(cache=True, nogil=True)
def search(
    wall: WallShape,
    grid: DistanceGrid,
    tests: Tests,
    rays: Array,
    estimate: Array,
    nearby: tuple[float, float],
    sizes: Array,
    limits: tuple[int, int],
) -> tuple[Array, int, int]:
    """Search for poses that explain ``rays`` and are not ``nearby`` ([m], [rad]) the ``estimate`` (3,).

    ``sizes`` (2, 2) [m, rad] are the half-widths of a box at which a pose in it is sought, and those at which it is
    left as undecided; ``limits`` are the largest numbers of poses found and of boxes examined. Returns the poses (k,
    3), the number of undecided boxes, -1 if a limit ended the search, and the number of boxes examined.
    """
    polyline = wall[1]
    most, most_boxes = limits
    radius, angle = nearby
    poses = np.empty((most + 1, 3))
    poses[0], count = estimate, 1
    rows, outliers, limit = tests
    ends = len(rays)
    far = max(0.5, rows[:ends, 2].mean())  # [m] at which a turn counts as much as a shift
    low_x, low_y = polyline[:, 0].min(), polyline[:, 1].min()
    n_x = math.ceil((polyline[:, 0].max() - low_x) / _SIDE)
    n_y = math.ceil((polyline[:, 1].max() - low_y) / _SIDE)
    firsts = n_x * n_y * _SECTORS
    most_boxes = max(most_boxes, _REFUTED * firsts)
    stack, top = np.zeros((_STACK + firsts, 7)), 0  # x, y, phi, h, w, the first test, 1 where a pose was sought
    for i in range(n_x):
        for j in range(n_y):
            for k in range(_SECTORS):
                box = stack[top]
                box[0], box[1] = low_x + (i + 0.5) * _SIDE, low_y + (j + 0.5) * _SIDE
                box[2] = -math.pi + (k + 0.5) * 2.0 * math.pi / _SECTORS
                box[3], box[4] = 0.5 * _SIDE, math.pi / _SECTORS
                top += 1
    undecided, boxes = 0, 0
    box = np.empty(7)
    while top > 0:
        top -= 1
        box[:] = stack[top]
        boxes += 1
        if boxes > most_boxes or top + 4 > len(stack):
            return poses[1:count].copy(), -1, boxes
        x, y, phi, h, w = box[0], box[1], box[2], box[3], box[4]
        if _is_near(poses, count, box, h, w, radius, angle):
            continue
        j = _refuting(grid, tests, ends, box)
        if j >= 0:
            if top > 0:  # its neighbour is refuted by the same test more often than not
                stack[top - 1, 5] = float(j)
            continue
        if h <= sizes[1, 0] and w <= sizes[1, 1]:
            undecided += 1
            continue
        if h <= sizes[0, 0] and w <= sizes[0, 1] and box[6] == 0.0:
            box[6] = 1.0
            pose = _fitted(grid, rows[:ends], box)
            if not _is_near(poses, count, pose, 0.0, 0.0, radius, angle) and explains(
                wall, rays, outliers, limit, pose
            ):
                if count > most:
                    return poses[1:count].copy(), -1, boxes
                poses[count] = pose
                count += 1
                if _is_near(poses, count, box, h, w, radius, angle):
                    continue
        if math.sqrt(2.0) * h > far * w:
            for k in range(4):
                stack[top] = box
                stack[top, 0] = x + (0.5 * h if k & 1 else -0.5 * h)
                stack[top, 1] = y + (0.5 * h if k & 2 else -0.5 * h)
                stack[top, 3] = 0.5 * h
                top += 1
        else:
            for k in range(2):
                stack[top] = box
                stack[top, 2] = wrapped(phi + (0.5 * w if k else -0.5 * w))
                stack[top, 4] = 0.5 * w
                top += 1
    return poses[1:count].copy(), undecided, boxes
