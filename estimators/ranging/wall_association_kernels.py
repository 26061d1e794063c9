"""The wall of a polygon on which each ray of a reading most likely ended, compiled; for estimators over many readings.

Least squares over a window compare a reading with many poses, one after the other, at which a ray may end on another
wall each time. So the wall is chosen once, at a prediction of covariance P: the one of those that the ray may have met
(``wall_choice_kernels``) of the largest

    p_k = (1 - epsilon) w_k N(rho - h_k; 0, s_k),      beta = p_k / (sum_j p_j + epsilon / L).

A ray of which no wall has beta > 0.9 is left out; another's residual counts by beta.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.ranging.kalman_kernels import RaySensors, square_trace
from mathnavi.estimators.ranging.wall_choice_kernels import NODES, line_seen, walls_met
from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.field.kernels import WallShape
from mathnavi.models.unicycle.kernels import mounted

_SURE = 0.9


@njit(cache=True, nogil=True)
def associated(x: Array, P: Array, z: Array, wall: WallShape, sensors: RaySensors) -> Array:
    """Rows (l, 3) of the range z (l,) [m], its wall and beta, at x (4,), P (4, 4); NaN for a ray that is left out."""
    rows, flat = np.full((len(z), 3), np.nan), np.zeros(3)
    lines, weights, PH = np.empty((len(NODES), 7)), np.empty(len(NODES)), np.empty(3)
    for i in range(len(z)):
        if not z[i] > 0.0:
            continue
        count = walls_met(wall, x, P, sensors.rays[i], sensors.relative, sensors.absolute, lines, weights)
        best, most, total = -1, 0.0, sensors.outliers / sensors.longest
        for k in range(count):
            h, H = lines[k, 0], lines[k, 1:4]
            for j in range(3):
                PH[j] = P[j, 0] * H[0] + P[j, 1] * H[1] + P[j, 2] * H[2]
            s = (sensors.relative * h) ** 2 + sensors.absolute**2 + H[0] * PH[0] + H[1] * PH[1] + H[2] * PH[2]
            s += 0.5 * square_trace(P[:3, :3], flat, lines[k, 5], lines[k, 4], 0.0, H)
            p = (1.0 - sensors.outliers) * weights[k] / math.sqrt(2.0 * math.pi * s)
            p *= math.exp(-0.5 * (z[i] - h) ** 2 / s)
            total += p
            if p > most:
                best, most = k, p
        if best >= 0 and most > _SURE * total:
            rows[i, 0], rows[i, 1], rows[i, 2] = z[i], lines[best, 6], most / total
    return rows


@njit(cache=True, nogil=True)
def ranges_to(wall: WallShape, pose: Array, rays: Array, walls: Array) -> tuple[Array, Array]:
    """Ranges h (l,) [m] from a pose (3,) along ``rays`` (l, 3) to the lines through ``walls`` (l,), and H (l, 3).

    NaN where there is no wall, or a ray does not meet its line.
    """
    h, H, line = np.full(len(rays), np.nan), np.full((len(rays), 3), np.nan), np.empty(7)
    for i in range(len(rays)):
        if math.isnan(walls[i]):
            continue
        m_1, m_2 = mounted(rays[i], pose[2])
        begin_1, begin_2, beta = pose[0] + m_1, pose[1] + m_2, pose[2] + rays[i, 0]
        if line_seen(wall[0], int(walls[i]), begin_1, begin_2, beta, m_1, m_2, line):
            h[i] = line[0]
            H[i] = line[1:4]
    return h, H
