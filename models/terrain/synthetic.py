"""Terrains without a file: canyons generated from a number, and level ground.

**Canyons**: a plateau of sandstone, cut by a winding gorge with a branch, in ledges.

The gorge's middle is a curve from west to east,

    y(x) = y_0 + A_1 sin(2 pi x / L_1 + phi_1) + A_2 sin(2 pi x / L_2 + phi_2),

and that of its branch leaves it for the north and ends on the plateau. With d [m] the distance to the nearest curve,
perturbed by noise so that walls have alcoves and spurs, w half the width of the floor and W that of a wall, the
ground is

    z = floor + (plateau - floor) ledges((d - w) / W),

``ledges`` a stair of steep bands of hard rock with gentler ones of soft rock between them: on all walls at the same
heights, as strata are. Floor and plateau are rough by noise whose octaves halve in size and in height.

One generator, seeded by the number, draws everything. Heights are whole multiples of 1/64 m, so that the last bits of
a platform's sines do not change a digest.

**Level ground**: over it the height of a flight is its clearance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import zoom
from scipy.spatial import cKDTree

from mathnavi.interfaces.errors import TerrainError
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField

_PLAIN_NODES, _PLAIN_SPACING = 49, 20.0  # a side of 960 m


def plain(height: int = 100) -> HeightField:
    """Level ground of 960 m by 960 m, ``height`` [m] above sea level."""
    heights = np.full((_PLAIN_NODES, _PLAIN_NODES), float(height))
    return HeightField(
        heights, _PLAIN_SPACING, f"plain {height}", "made up by mathnavi.models.terrain.synthetic", "Apache-2.0"
    )


_SIDE, _SPACING = 640.0, 4.0  # [m]
_GRAIN = 64.0  # [1/m]
_BANDS = 4  # of hard rock
_HARD = 0.45  # share of a ledge's width that is steep
_CLIMB = 0.62  # share of the way along the branch after which its floor climbs to the plateau


@dataclass(frozen=True)
class Canyon:
    """Parameters of the ground; lengths in metres."""

    number: int
    y_0: float
    amplitudes: tuple[float, float]  # A_1, A_2
    lengths: tuple[float, float]  # L_1, L_2
    phases: tuple[float, float]  # [rad] phi_1, phi_2
    floor: tuple[float, float]  # height in the west, and in the east
    half_width: float  # w
    wall: float  # W
    plateau: float  # height
    fork: float  # x at which the branch leaves

    @staticmethod
    def drawn(number: int, rng: np.random.Generator) -> Canyon:
        """Draw the canyon of a number."""
        west = float(rng.uniform(1205.0, 1215.0))
        return Canyon(
            number=number,
            y_0=float(rng.uniform(0.40, 0.50)) * _SIDE,
            amplitudes=(float(rng.uniform(34.0, 43.0)), float(rng.uniform(7.0, 11.0))),
            lengths=(float(rng.uniform(320.0, 390.0)), float(rng.uniform(130.0, 170.0))),
            phases=(float(rng.uniform(0.0, 2.0 * math.pi)), float(rng.uniform(0.0, 2.0 * math.pi))),
            floor=(west, west + float(rng.uniform(2.0, 5.0))),
            half_width=float(rng.uniform(13.0, 17.0)),
            wall=float(rng.uniform(66.0, 76.0)),
            plateau=west + float(rng.uniform(96.0, 110.0)),
            fork=float(rng.uniform(0.42, 0.62)) * _SIDE,
        )

    def middle(self, x: Array) -> Array:
        """Ordinate y (n,) [m] of the gorge's middle at x (n,) [m]."""
        y = np.full_like(x, self.y_0)
        for amplitude, length, phase in zip(self.amplitudes, self.lengths, self.phases, strict=True):
            y += amplitude * np.sin(2.0 * math.pi * x / length + phase)
        return y

    def branch(self) -> Array:
        """Middle (n, 2) [m] of the branch, from the gorge to its end."""
        s = np.linspace(0.0, 1.0, 200)
        foot = float(self.middle(np.array([self.fork]))[0])
        north = foot + s * (0.97 * _SIDE - foot)
        offset = 0.16 * _SIDE * s + 26.0 * np.sin(2.0 * math.pi * 1.3 * s) * np.minimum(1.0, 4.0 * s)
        return np.column_stack([self.fork + offset, north])


def canyon(number: int = 0) -> HeightField:
    """Canyon of a number: 161 x 161 nodes at 4 m, walls of some 100 m.

    Raises TerrainError for a negative number.
    """
    if number < 0:
        raise TerrainError(f"canyon number = {number}; allowed: a whole number >= 0")
    rng = np.random.default_rng([number, 0xCA])
    plan = Canyon.drawn(number, rng)
    count = round(_SIDE / _SPACING) + 1
    axis = _SPACING * np.arange(count)
    x, y = np.meshgrid(axis, axis)
    # Beyond the map the gorge goes on, so that its ends are not walls.
    along = np.linspace(-60.0, _SIDE + 60.0, 1600)
    # No wall comes so far that it would close the floor.
    push = np.minimum(8.0 * _noise(rng, count, 5) + 1.5 * _noise(rng, count, 16), 0.5 * plan.half_width)
    gorge = _distance(np.column_stack([along, plan.middle(along)]), x, y)[0] + push
    to_branch, place = _distance(plan.branch(), x, y)
    up = np.clip((place - _CLIMB) / (1.0 - _CLIMB), 0.0, 1.0)

    floor = plan.floor[0] + (plan.floor[1] - plan.floor[0]) * x / _SIDE
    top = plan.plateau + 7.0 * _noise(rng, count, 4) + 2.0 * _noise(rng, count, 20)
    rough = 0.7 * _noise(rng, count, 28)
    main = floor + (top - floor) * _ledges((gorge - plan.half_width) / plan.wall)
    bed = floor + (top - floor) * _smooth(up)
    side = bed + (top - bed) * _ledges((to_branch + push - 0.8 * plan.half_width) / (0.85 * plan.wall))
    z = np.minimum(main, side) + rough
    return HeightField(
        np.round(z * _GRAIN) / _GRAIN,
        _SPACING,
        f"canyon {number}",
        "made up by mathnavi.models.terrain.synthetic",
        "Apache-2.0",
    )


def _ledges(share: Array) -> Array:
    """Height from 0 to 1 over shares 0 to 1 of a wall: bands of hard rock, each steep and then gentle."""
    s = np.clip(share, 0.0, 1.0) * _BANDS
    k = np.minimum(np.floor(s), _BANDS - 1)
    part = s - k
    steep = np.clip(part / _HARD, 0.0, 1.0)
    gentle = np.clip((part - _HARD) / (1.0 - _HARD), 0.0, 1.0)
    risen: Array = (k + 0.6 * _smooth(steep) + 0.4 * gentle) / _BANDS
    return risen


def _smooth(s: Array) -> Array:
    smooth: Array = s * s * (3.0 - 2.0 * s)
    return smooth


def _distance(curve: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Distance [m] from each node to a curve (n, 2), and the share of the way along it, 0 to 1, at that point."""
    distance, nearest = cKDTree(curve).query(np.stack([x, y], axis=-1).reshape(-1, 2))
    return distance.reshape(x.shape), nearest.reshape(x.shape) / (len(curve) - 1.0)


def _noise(rng: np.random.Generator, count: int, cells: int) -> Array:
    """Noise (count, count) of deviation 1: octaves from ``cells`` bumps a side on, each half as large and as high."""
    total = np.zeros((count, count))
    share, n = 1.0, cells
    while n < count // 2:
        grid = rng.standard_normal((n + 3, n + 3))
        total += share * zoom(grid, (count + 8) / (n + 2.0), order=3, grid_mode=False)[4 : count + 4, 4 : count + 4]
        share, n = 0.5 * share, 2 * n
    normalised: Array = (total - total.mean()) / total.std()
    return normalised
