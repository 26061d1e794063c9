"""Observations of a flight for a learner, from an estimate and the charted map; compiled, with a row for each vehicle.

    velocity         (3,) [m/s] map frame
    target           (3,) [m] from the vehicle to the target, map frame
    clearance        (1,) [m] height above the ground below
    clearance_ahead  (4,) [m] height above ground 1, 2, 4 and 8 s on, at the present velocity
    slope_ahead      (4,) rise of the ground there over a metre in the direction of flight
    horizon          (8, 3) [m] height of the ground over the vehicle: from the bearing of the target to the left, every
                     45 degrees, as far away as v_max leads in 2, 5 and 12 s

Off the map the ground counts as level, at the height of the map's highest point.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.compiled import njit
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.kernels import surface_at

AHEAD = np.array([1.0, 2.0, 4.0, 8.0])  # [s]
DISTANCES = np.array([2.0, 5.0, 12.0])  # [s] at v_max
BEARINGS = 8
COMPONENTS = {
    "velocity": (slice(0, 3), (3,)),
    "target": (slice(3, 6), (3,)),
    "clearance": (slice(6, 7), (1,)),
    "clearance_ahead": (slice(7, 11), (4,)),
    "slope_ahead": (slice(11, 15), (4,)),
    "horizon": (slice(15, 39), (BEARINGS, len(DISTANCES))),
}
"""columns of a row and shape of each observation, by name"""
_SIZE = 39
_STANDING = 1e-9  # [m/s] of a velocity without a direction


def flight_views(terrain: HeightField, speed_max: float, x: Array, targets: Array) -> Array:
    """Rows (n, 39) of estimates x (n, 6) [m, m/s] and the places of their targets (n, 3) [m]."""
    rows = np.empty((len(x), _SIZE))
    _fill(terrain.z, terrain.spacing, float(terrain.z.max()), speed_max, x, targets, rows)
    return rows


def components(rows: Array) -> dict[str, Array]:
    """Observations by name: from a row (39,) each in its shape, from rows (n, 39) with a leading n."""
    return {name: rows[..., part].reshape(*rows.shape[:-1], *shape) for name, (part, shape) in COMPONENTS.items()}


@njit(cache=True, nogil=True)
def _ground(z: Array, spacing: float, highest: float, x: float, y: float) -> tuple[float, float, float]:
    height, east, north = surface_at(z, spacing, x, y)
    if math.isnan(height):
        return highest, 0.0, 0.0
    return height, east, north


@njit(cache=True, nogil=True)
def _fill(z: Array, spacing: float, highest: float, speed_max: float, x: Array, targets: Array, rows: Array) -> None:
    for n in range(x.shape[0]):
        px, py, pz, vx, vy, vz = x[n]
        row = rows[n]
        row[0:3] = x[n, 3:6]
        for axis in range(3):
            row[3 + axis] = targets[n, axis] - x[n, axis]
        row[6] = pz - _ground(z, spacing, highest, px, py)[0]
        bearing = math.atan2(row[4], row[3])
        speed = math.hypot(vx, vy)
        east, north = math.cos(bearing), math.sin(bearing)
        if speed > _STANDING:
            east, north = vx / speed, vy / speed
        for k in range(AHEAD.size):
            height, slope_x, slope_y = _ground(z, spacing, highest, px + vx * AHEAD[k], py + vy * AHEAD[k])
            row[7 + k] = pz + vz * AHEAD[k] - height
            row[11 + k] = slope_x * east + slope_y * north
        for k in range(BEARINGS):
            angle = bearing + 2.0 * math.pi * k / BEARINGS
            for j in range(DISTANCES.size):
                distance = speed_max * DISTANCES[j]
                height, _, _ = _ground(
                    z, spacing, highest, px + distance * math.cos(angle), py + distance * math.sin(angle)
                )
                row[15 + k * DISTANCES.size + j] = height - pz
