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

Of a range y_j to a beacon at b_j the function is |q_j(x) - b_j| - s y_j in place of the wall's distance, q_j(x) being
the place of the robot at that reading. It is 1-Lipschitz in q_j too; the scale s of all ranges is one more coordinate
of a box, of half-width v, and adds y_j v to m_j. Errors of readings are then max(1, s + v) times as large. Each reading
says an interval of s for a box of poses; scales that more of them contradict than may be outliers are taken off it.
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
wall, then those that have to be within it; the number of the former that may be outliers; and the limit of their sum,
without the largest of them that may be outliers. With beacons a row goes on with b_j (2,) and y_j: (m, 9)"""

_WALL = 6  # columns of a test of a wall
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
def _off(grid: DistanceGrid, rows: Array, j: int, scale: float, x: float, y: float) -> float:
    """Value [m] of the function of row j at (x, y), zero where its reading is exact."""
    if rows.shape[1] > _WALL:
        dx, dy = x - rows[j, 6], y - rows[j, 7]
        return math.sqrt(dx * dx + dy * dy) - scale * float(rows[j, 8])
    return _distance(grid, x, y)


@inner_njit(nogil=True)
def _trimmed(squares: Array, outliers: int) -> float:
    """Sum of squares without the largest that may be outliers."""
    return float(np.sort(squares)[: len(squares) - outliers].sum())


@inner_njit(nogil=True)
def _refuting(grid: DistanceGrid, tests: Tests, ends: int, box: Array) -> int:
    """Index of the test that refutes the box, beginning with its own; -1 where none does."""
    rows, outliers, limit = tests
    c, s, first = math.cos(box[2]), math.sin(box[2]), int(box[5])
    shift = math.sqrt(2.0) * box[3] + grid[4]
    wrong, total, scale, among_beacons = 0, 0.0, box[7], rows.shape[1] > _WALL
    trims = outliers > 0 and limit < math.inf
    squares = np.zeros(ends if trims else 0)
    larger = max(1.0, scale + box[8]) if among_beacons else 1.0
    for n in range(len(rows)):
        j = n + first
        if j >= len(rows):
            j -= len(rows)
        ax, ay = rows[j, 0], rows[j, 1]
        d = _off(grid, rows, j, scale, box[0] + c * ax - s * ay, box[1] + s * ax + c * ay)
        moved = shift + rows[j, 2] * box[4]
        if among_beacons:
            moved += rows[j, 8] * box[8]
        if j >= ends:
            if d < -rows[j, 4] - moved:
                return j
            continue
        if abs(d) > larger * rows[j, 3] + moved:
            wrong += 1
            if wrong > outliers:
                return j
        beyond = max(0.0, abs(d) - larger * rows[j, 4] - moved) / (larger * rows[j, 5])
        if trims:
            squares[j] = beyond * beyond
            continue
        total += beyond * beyond
        if total > limit:
            return j
    return first if trims and _trimmed(squares, outliers) > limit else -1


@inner_njit(nogil=True)
def _contracts(rows: Array, outliers: int, box: Array) -> bool:
    """Take off scales of a box that more readings contradict than may be outliers; False if none is left."""
    c, s, shift, larger = math.cos(box[2]), math.sin(box[2]), math.sqrt(2.0) * box[3], max(1.0, box[7] + box[8])
    least, most = np.empty(len(rows)), np.empty(len(rows))
    for j in range(len(rows)):
        ax, ay = rows[j, 0], rows[j, 1]
        dx, dy = box[0] + c * ax - s * ay - rows[j, 6], box[1] + s * ax + c * ay - rows[j, 7]
        rho, error = math.sqrt(dx * dx + dy * dy), shift + rows[j, 2] * box[4] + larger * rows[j, 3]
        least[j], most[j] = (rho - error) / rows[j, 8], (rho + error) / rows[j, 8]
    low = max(box[7] - box[8], np.sort(least)[len(rows) - 1 - outliers])
    high = min(box[7] + box[8], np.sort(most)[outliers])
    box[7], box[8] = 0.5 * (low + high), 0.5 * (high - low)
    return bool(low <= high)


@njit(cache=True, nogil=True)
def fitted(grid: DistanceGrid, rows: Array, start: Array, size: int, scales: tuple[float, float]) -> Array:
    """Pose (3,), with a scale (4,), near a box ``start`` where the functions of ``rows`` are nearest to zero, by
    Gauss-Newton; an end of a ray that is far off counts little among beacons, where it may be an outlier.
    """
    cell, scale = grid[3], 1.0
    pose = np.empty(size)
    pose[:3] = start[:3]
    if size > 3:
        pose[3] = start[7]
    H, g, A = np.zeros(size), np.empty(size), np.empty((size, size))
    for _ in range(_ITERATIONS):
        A[:], g[:] = 1e-6 * np.eye(size), 0.0
        if size > 3:
            scale = pose[3]
        c, s = math.cos(pose[2]), math.sin(pose[2])
        for j in range(len(rows)):
            ax, ay = rows[j, 0], rows[j, 1]
            dx, dy = c * ax - s * ay, s * ax + c * ay
            qx, qy = pose[0] + dx, pose[1] + dy
            d = _off(grid, rows, j, scale, qx, qy)
            right = _off(grid, rows, j, scale, qx + 2 * cell, qy)
            H[0] = (right - _off(grid, rows, j, scale, qx - 2 * cell, qy)) / (4 * cell)
            above = _off(grid, rows, j, scale, qx, qy + 2 * cell)
            H[1] = (above - _off(grid, rows, j, scale, qx, qy - 2 * cell)) / (4 * cell)
            H[2] = H[1] * dx - H[0] * dy
            weight = 1.0 / rows[j, 3] ** 2
            if size > 3:
                H[3] = -rows[j, 8] if scales[1] > 0.0 else 0.0
                weight /= 1.0 + (2.0 * d / rows[j, 3]) ** 2
            for a in range(size):
                g[a] -= weight * H[a] * d
                for b in range(size):
                    A[a, b] += weight * H[a] * H[b]
        step = np.linalg.solve(A, g)
        longest = np.abs(step).max()
        pose += step * min(1.0, 0.3 / max(longest, 1e-12))
        if longest < 1e-4:
            break
    pose[2] = wrapped(pose[2])
    if size > 3:
        pose[3] = min(max(pose[3], scales[0] - scales[1]), scales[0] + scales[1])
    return pose


@njit(cache=True, nogil=True)
def explains(wall: WallShape, rays: Array, outliers: int, limit: float, pose: Array) -> bool:
    """True if a pose (3,) explains ``rays`` (m, 7), by casting them; with a scale (4,) ranges to beacons (m, 9).

    A ray is its start (2,) [m] and direction [rad] in the robot's axes, its range, the error that the motion may add,
    its standard deviation, and its bound [m]; of a beacon its place (2,) [m] follows, and the direction is not used.
    """
    coefficients, polyline = wall
    among_beacons, trims = len(pose) > 3, outliers > 0 and limit < math.inf
    scale = pose[3] if among_beacons else 1.0
    larger = max(1.0, scale) if among_beacons else 1.0
    squares = np.zeros(len(rays))
    c, s, wrong, total = math.cos(pose[2]), math.sin(pose[2]), 0, 0.0
    for j in range(len(rays)):
        x, y = pose[0] + c * rays[j, 0] - s * rays[j, 1], pose[1] + s * rays[j, 0] + c * rays[j, 1]
        if among_beacons:
            rho = math.hypot(x - rays[j, 7], y - rays[j, 8])
        elif is_inside(coefficients, polyline, x, y):
            rho, _ = cast_ray(coefficients, polyline, x, y, pose[2] + rays[j, 2])
        else:
            return False
        residual = abs(rho - scale * rays[j, 3])
        if not residual <= larger * rays[j, 6]:
            wrong += 1
        squares[j] = (max(0.0, residual - larger * rays[j, 4]) / (larger * rays[j, 5])) ** 2
        total += squares[j]
        if wrong > outliers or (total > limit and not trims):
            return False
    return not trims or _trimmed(squares, outliers) <= limit


@inner_njit(nogil=True)
def _is_near(
    poses: Array, count: int, x: Array, h: float, w: float, nearby: tuple[float, float], point: tuple[float, float]
) -> bool:
    """True if the box of half-widths h [m], w [rad] about x is ``nearby`` ([m], [rad]) one pose, at a ``point`` [m] in
    the robot's axes.
    """
    radius, angle = nearby
    ax, ay = point
    c, s, arm = math.cos(x[2]), math.sin(x[2]), math.sqrt(ax * ax + ay * ay)
    for k in range(count):
        dc, ds = c - math.cos(poses[k, 2]), s - math.sin(poses[k, 2])
        dx, dy = x[0] - poses[k, 0] + dc * ax - ds * ay, x[1] - poses[k, 1] + ds * ax + dc * ay
        near = math.sqrt(dx * dx + dy * dy) + math.sqrt(2.0) * h + arm * w <= radius
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
    point: tuple[float, float] = (0.0, 0.0),
    scales: tuple[float, float] = (1.0, 0.0),
) -> tuple[Array, int, int]:
    """Search for poses that explain ``rays`` and are not ``nearby`` ([m], [rad]) the ``estimate`` (3,).

    ``sizes`` (3, 2) [m, rad] are the half-widths of the first boxes, which cover the box around the wall, those of a
    box at which a pose in it is sought, and those at which it is left as undecided; ``limits`` are the largest numbers
    of poses found and of boxes examined. Near is what is so at a ``point`` [m] in the robot's axes. Among beacons the
    ``estimate`` and poses have a scale (4,), which is within ``scales``, their middle and half-width. Returns the poses
    (k, 3) or (k, 4), the number of undecided boxes, -1 if a limit ended the search, and the number of boxes examined.
    """
    polyline = wall[1]
    most, most_boxes = limits
    poses = np.empty((most + 1, len(estimate)))
    poses[0], count = estimate, 1
    rows, outliers, limit = tests
    ends = len(rays)
    far = max(0.5, rows[:ends, 2].mean())  # [m] at which a turn counts as much as a shift
    low_x, low_y = polyline[:, 0].min(), polyline[:, 1].min()
    reach = rows[:ends, 8].mean() if rows.shape[1] > _WALL else 0.0  # [m] by which a scale counts as much as a shift
    side, sectors = 2.0 * sizes[0, 0], math.ceil(math.pi / sizes[0, 1] - 1e-9)
    n_x = math.ceil((polyline[:, 0].max() - low_x) / side)
    n_y = math.ceil((polyline[:, 1].max() - low_y) / side)
    firsts = n_x * n_y * sectors
    most_boxes = max(most_boxes, _REFUTED * firsts)
    # x, y, phi, h, w, the first test, 1 where a pose was sought, the scale s, v
    stack, top = np.zeros((_STACK + firsts, 9)), 0
    for i in range(n_x):
        for j in range(n_y):
            for k in range(sectors):
                box = stack[top]
                box[0], box[1] = low_x + (i + 0.5) * side, low_y + (j + 0.5) * side
                box[2] = -math.pi + (k + 0.5) * 2.0 * math.pi / sectors
                box[3], box[4] = 0.5 * side, math.pi / sectors
                box[7], box[8] = scales
                top += 1
    undecided, boxes = 0, 0
    box = np.empty(9)
    while top > 0:
        top -= 1
        box[:] = stack[top]
        boxes += 1
        if boxes > most_boxes or top + 4 > len(stack):
            return poses[1:count].copy(), -1, boxes
        x, y, phi, h, w = box[0], box[1], box[2], box[3], box[4]
        if _is_near(poses, count, box, h, w, nearby, point):
            continue
        if box[8] > 0.0 and not _contracts(rows, outliers, box):
            continue
        j = _refuting(grid, tests, ends, box)
        if j >= 0:
            if top > 0:  # its neighbour is refuted by the same test more often than not
                stack[top - 1, 5] = float(j)
            continue
        if h <= sizes[2, 0] and w <= sizes[2, 1] and reach * box[8] <= sizes[2, 0]:
            undecided += 1
            continue
        if h <= sizes[1, 0] and w <= sizes[1, 1] and reach * box[8] <= sizes[1, 0] and box[6] == 0.0:
            box[6] = 1.0
            pose = fitted(grid, rows[:ends], box, len(estimate), scales)
            if len(estimate) > 3 and _is_near(poses, count, pose, 0.0, 0.0, nearby, point):
                pose[:3], pose[3] = box[:3], box[7]  # of a set that is larger than what is near its best pose
            if not _is_near(poses, count, pose, 0.0, 0.0, nearby, point) and explains(
                wall, rays, outliers, limit, pose
            ):
                if count > most:
                    return poses[1:count].copy(), -1, boxes
                poses[count] = pose
                count += 1
                if _is_near(poses, count, box, h, w, nearby, point):
                    continue
        if reach * box[8] > max(math.sqrt(2.0) * h, far * w):
            for k in range(2):
                stack[top] = box
                stack[top, 7] = box[7] + (0.5 * box[8] if k else -0.5 * box[8])
                stack[top, 8] = 0.5 * box[8]
                top += 1
        elif math.sqrt(2.0) * h > far * w:
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
