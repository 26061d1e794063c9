"""Terminal cost Psi: what is left to pay from a point to the target (thesis A.5).

Dijkstra's algorithm on a grid whose layers follow the terrain gives the distance D from every node to the target,
lengths inside a threat counted (1 + weight) fold. Two interpolants turn the node values into Psi(p):

* ``FactoredCost``: Psi(p) = (beta / v_c) (sqrt(|p - p_f|^2 + l^2) tau(p) - l). The ratio tau of D to the length that
  the same grid would measure over flat, empty ground is interpolated by a tricubic spline in the stretched coordinates
  (layer, row, column); the root carries the distance itself. Psi decreases towards the target from everywhere, its
  gradient is continuous, and the grid's preference for its own directions cancels in the ratio.
* ``TrilinearCost``: (beta / v_c) D interpolated linearly in each cell, as in the thesis as printed. It has stationary
  points.

The thesis leaves Psi's unit open. With a running cost |a|^2 + beta, beta has the unit of a cost per second, so a
distance costs beta / v_c per metre, v_c the speed at which flying on costs as much as Psi falls (150 m/s).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from mathnavi.controllers.flight import spline
from mathnavi.controllers.flight.shortest_paths import distances
from mathnavi.controllers.flight.spline import TARGET_LENGTH, cost_many
from mathnavi.interfaces.signals import Array
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import Radar

REFERENCE_SPEED = 150.0  # [m/s] v_c
THREAT_SMOOTHING = 0.7  # [cells] standard deviation: a threat's sharp edge would trap every interpolant
_LOWEST_LAYER = 120.0  # [m] above ground
_ROUNDING = 1e-9  # [cells]


@dataclass(frozen=True, eq=False)
class TerrainGrid:
    """Nodes in horizontal layers stretched on the terrain; the target is a node.

    Node (k, i, j) lies at x = x_0 + j spacing, y = y_0 + i spacing, z = ground[i, j] + level_0 + k layer_spacing.
    """

    x_0: float  # [m]
    y_0: float  # [m]
    spacing: float  # [m] between rows and columns
    ground: Array  # (rows, columns) [m]
    level_0: float  # [m] height of the lowest layer above ground
    layer_spacing: float  # [m]
    layers: int
    target: tuple[int, int, int]  # (layer, row, column)

    @staticmethod
    def around(terrain: HeightField, target: Array, nodes: int, layers: int, height: float = 2400.0) -> TerrainGrid:
        """Build a grid of ``nodes`` along the map's longer side, moved so that the target is a node, equally spaced.

        No node lies off the map, where nothing is known of ground and radars, so moved there is one less. Across a map
        that is very narrow there are at least two, closer together both ways.
        """
        sides = terrain.width, terrain.depth
        spacing = min(max(sides) / (nodes - 1), 0.5 * min(sides))
        (x_0, x, j), (y_0, y, i) = (
            _nodes_along(side, spacing, float(at)) for side, at in zip(sides, target[:2], strict=True)
        )
        ground = terrain.height(*np.meshgrid(x, y))
        above = float(target[2]) - float(ground[i, j])
        step = height / (layers - 1)
        k = min(round(max(0.0, above - _LOWEST_LAYER) / step), layers - 1)
        # The layer that is to hold the target is moved onto it: by its spacing, or, for the lowest, by its level.
        level_0 = above if k == 0 else _LOWEST_LAYER
        layer_spacing = step if k == 0 else (above - _LOWEST_LAYER) / k
        return TerrainGrid(x_0, y_0, spacing, ground, level_0, layer_spacing, layers, (k, i, j))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of layers, rows and columns."""
        return (self.layers, *self.ground.shape)

    @cached_property
    def positions(self) -> Array:
        """Positions (layers, rows, columns, 3) [m] of the nodes."""
        k, i, j = np.meshgrid(*(np.arange(n, dtype=float) for n in self.shape), indexing="ij")
        x, y = self.x_0 + self.spacing * j, self.y_0 + self.spacing * i
        return np.stack([x, y, self.ground + self.level_0 + self.layer_spacing * k], axis=-1)

    def flat_distance(self) -> Array:
        """Distance (layers, rows, columns) [m] from the target by the 26-neighbour graph over flat ground.

        On a flat layer the shortest way over (m, n) cells is min(m, n) diagonals and the rest straight; the height
        difference is joined by Pythagoras.
        """
        k, i, j = self.target
        m, n = np.abs(np.arange(self.shape[1]) - i)[:, None], np.abs(np.arange(self.shape[2]) - j)[None, :]
        level = self.spacing * (np.maximum(m, n) + (math.sqrt(2.0) - 1.0) * np.minimum(m, n))
        rise = self.positions[..., 2] - self.positions[k, i, j, 2]
        distance: Array = np.hypot(level, rise)
        return distance


def _nodes_along(side: float, spacing: float, at: float) -> tuple[float, Array, int]:
    """Place of the first node [m], all nodes [m], and index of that ``at`` the target [m], in 0 to ``side`` [m]."""
    before = math.floor(at / spacing + _ROUNDING)
    begin = at - before * spacing
    count = before + math.floor((side - at) / spacing + _ROUNDING) + 1
    # Rounding must not carry a node off the map.
    return begin, np.clip(begin + spacing * np.arange(count), 0.0, side), before


def threat_density(grid: TerrainGrid, terrain: HeightField, radars: Sequence[Radar]) -> Array:
    """Sum of weight times visibility at each node, smoothed, (layers, rows, columns)."""
    density = np.zeros(grid.shape)
    if not radars:
        return density
    from scipy.ndimage import gaussian_filter  # takes a while to import

    nodes = np.clip(grid.positions, [0.0, 0.0, -np.inf], [terrain.width, terrain.depth, np.inf])  # but for rounding
    for radar in radars:
        x, y, z = np.moveaxis(nodes - radar.position(terrain), -1, 0)  # a norm over so short an axis takes long
        near = np.sqrt(x * x + y * y + z * z) <= radar.radius
        seen = np.zeros(grid.shape)
        seen[near] = radar.exposed(terrain, nodes[near])
        density += radar.weight * gaussian_filter(seen, THREAT_SMOOTHING, mode="nearest")
    return density


def node_distance(grid: TerrainGrid, density: Array) -> Array:
    """Cheapest way from every node to the target by Dijkstra, (layers, rows, columns) [m].

    The cost of an edge is c_ij = length (1 + mean threat density of its ends) (thesis A.5).
    """
    source = int(np.ravel_multi_index(grid.target, grid.shape))
    return distances(grid.positions[..., 2], grid.spacing, density, source)


@dataclass(frozen=True, eq=False)
class FactoredCost:
    """Psi without its factor beta / v_c: a length [m]. Coordinates outside the grid are clipped to its edge."""

    grid: TerrainGrid
    target: Array  # (3,) [m] p_f
    ground: Array  # spline coefficients of the grid's ground [m]
    ratio: Array  # spline coefficients of tau

    @staticmethod
    def build(grid: TerrainGrid, distance: Array) -> FactoredCost:
        """Return the cost-to-go of node distances (layers, rows, columns) [m] on a grid."""
        ratio = np.sqrt(distance**2 + TARGET_LENGTH**2) / np.sqrt(grid.flat_distance() ** 2 + TARGET_LENGTH**2)
        target = grid.positions[grid.target]
        return FactoredCost(grid, target, spline.coefficients(grid.ground), spline.coefficients(ratio))

    @cached_property
    def scales(self) -> Array:
        """Numbers (8,) of the grid for the kernels: x_0, y_0, spacing, level_0, layer_spacing, target x, y, z."""
        g = self.grid
        return np.array([g.x_0, g.y_0, g.spacing, g.level_0, g.layer_spacing, *self.target])

    def __call__(self, points: Array) -> Array:
        """Length-to-go [m] at (n, 3) points [m]."""
        return cost_many(self.ground, self.ratio, self.scales, np.atleast_2d(points))[0]

    def gradient(self, points: Array) -> Array:
        """Gradient (n, 3) at points (n, 3) [m]."""
        return cost_many(self.ground, self.ratio, self.scales, np.atleast_2d(points))[1]


@dataclass(frozen=True, eq=False)
class TrilinearCost:
    """D interpolated linearly in each cell of the stretched grid, as printed: a length [m].

    The thesis gives no value outside the grid. Here coordinates are clipped to its edge, and the height above its top
    layer is added, else a climb would cost nothing up there, and nothing would end it. The horizontal distance from
    the grid, which is less than a cell on the map, is added too.
    """

    grid: TerrainGrid
    target: Array
    distance: Array  # (layers, rows, columns) [m]

    def __call__(self, points: Array) -> Array:
        """Length-to-go [m] at (n, 3) points [m]."""
        return self._evaluate(points)[0]

    def gradient(self, points: Array) -> Array:
        """Gradient (n, 3) at points (n, 3) [m], one-sided on the faces of cells."""
        return self._evaluate(points)[1]

    def _evaluate(self, points: Array) -> tuple[Array, Array]:
        g, p = self.grid, np.atleast_2d(points)
        layers, rows, columns = g.shape
        raw_v, raw_w = (p[:, 1] - g.y_0) / g.spacing, (p[:, 0] - g.x_0) / g.spacing
        v, w = np.clip(raw_v, 0.0, rows - 1.0), np.clip(raw_w, 0.0, columns - 1.0)
        beside = np.stack([raw_w - w, raw_v - v])  # [cells] east, north
        distance = np.hypot(*beside)
        outward = np.divide(beside, distance, out=np.zeros_like(beside), where=distance > 0.0)
        i, j = np.minimum(v.astype(int), rows - 2), np.minimum(w.astype(int), columns - 2)
        fv, fw = v - i, w - j
        corner = g.ground[i, j], g.ground[i, j + 1], g.ground[i + 1, j], g.ground[i + 1, j + 1]
        low, high = corner[0] + fw * (corner[1] - corner[0]), corner[2] + fw * (corner[3] - corner[2])
        ground = low + fv * (high - low)
        ground_x = (raw_w == w) * ((1 - fv) * (corner[1] - corner[0]) + fv * (corner[3] - corner[2])) / g.spacing
        ground_y = (raw_v == v) * (high - low) / g.spacing
        raw = (p[:, 2] - ground - g.level_0) / g.layer_spacing
        u = np.clip(raw, 0.0, layers - 1.0)
        inside, above = (raw == u).astype(float), (raw > layers - 1.0).astype(float)
        k = np.minimum(u.astype(int), layers - 2)
        fu = u - k
        d = self.distance
        face = [
            (1 - fv) * ((1 - fw) * d[k + a, i, j] + fw * d[k + a, i, j + 1])
            + fv * ((1 - fw) * d[k + a, i + 1, j] + fw * d[k + a, i + 1, j + 1])
            for a in (0, 1)
        ]
        along_w = [
            (1 - fv) * (d[k + a, i, j + 1] - d[k + a, i, j]) + fv * (d[k + a, i + 1, j + 1] - d[k + a, i + 1, j])
            for a in (0, 1)
        ]
        along_v = [
            (1 - fw) * (d[k + a, i + 1, j] - d[k + a, i, j]) + fw * (d[k + a, i + 1, j + 1] - d[k + a, i, j + 1])
            for a in (0, 1)
        ]
        value = (1 - fu) * face[0] + fu * face[1] + above * (raw - u) * g.layer_spacing
        value += distance * g.spacing
        up = inside * (face[1] - face[0]) / g.layer_spacing + above
        east = (raw_w == w) * ((1 - fu) * along_w[0] + fu * along_w[1]) / g.spacing - up * ground_x + outward[0]
        north = (raw_v == v) * ((1 - fu) * along_v[0] + fu * along_v[1]) / g.spacing - up * ground_y + outward[1]
        return value, np.stack([east, north, up], axis=-1)


@lru_cache(maxsize=2)
def _grid(terrain: HeightField, target: tuple[float, float, float], nodes: int, layers: int) -> TerrainGrid:
    return TerrainGrid.around(terrain, np.array(target), nodes, layers)


def factored_cost(
    terrain: HeightField,
    target: Array,
    radars: Sequence[Radar],
    nodes: int,
    layers: int,
    ground: HeightField | None = None,
) -> FactoredCost:
    """Compute grid, threats, shortest paths and spline in one call, for a target (3,) [m].

    The layers follow ``ground``, which is ``terrain`` raised for body and tracker where plans are; radars stand on the
    terrain itself, which is what hides from them.
    """
    grid = _grid(ground or terrain, tuple(target.tolist()), nodes, layers)
    return FactoredCost.build(grid, node_distance(grid, threat_density(grid, terrain, radars)))


def trilinear_cost(
    terrain: HeightField, target: Array, radars: Sequence[Radar], nodes: int, layers: int
) -> TrilinearCost:
    """Compute the cost-to-go to a target (3,) [m] with the interpolation of the thesis as printed."""
    grid = _grid(terrain, tuple(target.tolist()), nodes, layers)
    return TrilinearCost(grid, grid.positions[grid.target], node_distance(grid, threat_density(grid, terrain, radars)))
