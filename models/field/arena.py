"""A closed curve as the wall of a MuJoCo arena: for rangefinders, for collisions and for pictures.

The wall that is sensed is one geom with alpha = 1e-6, near-invisible: MuJoCo's rays pass through geoms with alpha = 0.
An ellipse is the equator, at the height of the sensors, of an ellipsoid, in which a ray from within ends exactly on the
curve (to 1e-14 m). Any other curve is a band of triangles on ``CHORDS`` of its chords, which a ray meets at most

    h^2 kappa / (8 sin gamma)   (h the length of a chord, kappa the curvature, gamma the angle between ray and wall)

too early or too late; in addition MuJoCo keeps vertices as float32. Over 9 000 rays the error was at most 2e-6 m in the
egg and 5e-6 m in the bean.

A polygon is such a band on its sides, which a ray meets where it should but for the vertices in float32.

The wall that is drawn and collides is a ring of boxes just outside, so no ray reaches them; ``polygon_arena`` has those
of a polygon.
"""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.composer_and_mjcf import composer, mjcf
from mathnavi.models.field.curve import Curve
from mathnavi.models.field.polygon import Polygon
from mathnavi.models.field.polygon_arena import boxes_behind, triangles
from mathnavi.models.field.wall import Wall

SENSOR_HEIGHT = 0.163
"""height [m] above the floor of the plane in which ranges are measured"""

CHORDS = 4096
BOXES = 96
WALL_HEIGHT = 0.26  # [m] as drawn
WALL_THICKNESS = 0.05  # [m]
SENSED_GROUP, DRAWN_GROUP, FLOOR_GROUP = 4, 1, 0

_SLIPPERY = 0.001  # friction of the floor, less than that of all that grips on it
_GAP = 5e-4  # [m] from the curve to the boxes outside
_UPRIGHT = 1e3  # half-height of the ellipsoid over its half-axes: its wall is practically vertical
_BARELY = (1.0, 1.0, 1.0, 1e-6)  # seen by rays, not by eyes


class FieldArena(composer.Arena):
    """A floor within a wall. Geoms: ``floor``, ``sensed_wall``, and ``wall_K`` of the drawn one."""

    def _build(self, wall: Wall) -> None:  # the method that dm_control tells its users to override
        super()._build(name=None)
        self._mjcf_root.model = "field"
        low, high = wall.polyline.min(axis=0), wall.polyline.max(axis=0)
        self._floor(0.5 * (low + high), 0.5 * (high - low) + 0.6)
        if isinstance(wall, Curve):
            if wall.is_ellipse:
                self._ellipsoid(wall)
            else:
                self._band(wall)
            self._boxes(wall)
        elif isinstance(wall, Polygon):
            self._mesh(triangles(wall.segments, 0.0, 2.0 * SENSOR_HEIGHT))
            for k, box in enumerate(boxes_behind(wall, WALL_THICKNESS, _GAP)):
                self._box(k, box.middle, box.along, 0.5 * box.length, 0.5 * box.thickness)
        root = self._mjcf_root
        root.statistic.center = (*(0.5 * (low + high)).tolist(), 0.0)
        root.statistic.extent = float(np.linalg.norm(high - low)) / 2.0

    def _floor(self, centre: Array, half: Array) -> None:
        root = self._mjcf_root
        texture = root.asset.add(
            "texture", name="floor", type="2d", builtin="checker", mark="edge", width=256, height=256,
            rgb1=(0.965, 0.962, 0.950), rgb2=(0.945, 0.941, 0.925), markrgb=(0.90, 0.895, 0.875),
        )  # fmt: skip
        material = root.asset.add(
            "material", name="floor", texture=texture, texrepeat=(1.0, 1.0), texuniform="true", specular=0.0,
            shininess=0.0, reflectance=0.0,
        )  # fmt: skip
        root.worldbody.add(
            "geom", name="floor", type="plane", pos=(*centre, 0.0), size=(*half, 1.0), material=material,
            contype=1, conaffinity=0, condim=3, friction=(_SLIPPERY, 0.0, 0.0), group=FLOOR_GROUP,
        )  # fmt: skip

    def _ellipsoid(self, curve: Curve) -> None:
        # theta = centre + A (cos s, sin s) with A = U diag(half) V': an ellipse with its half-axes along U's columns.
        _, (ax, bx, ay, by) = curve.table
        axes, half, _ = np.linalg.svd(np.array([[ax, bx], [ay, by]]))
        self._mjcf_root.worldbody.add(
            "geom", name="sensed_wall", type="ellipsoid", size=(*half, _UPRIGHT * half[0]),
            pos=(*curve.centre, SENSOR_HEIGHT), xyaxes=(*axes[:, 0], 0.0, *axes[:, 1], 0.0),
            rgba=_BARELY, contype=0, conaffinity=0, mass=0, group=SENSED_GROUP,
        )  # fmt: skip

    def _band(self, curve: Curve) -> None:
        points = curve.points(2.0 * math.pi * np.arange(CHORDS) / CHORDS)
        vertices = np.vstack([np.column_stack([points, np.full(CHORDS, z)]) for z in (0.0, 2.0 * SENSOR_HEIGHT)])
        k = np.arange(CHORDS)
        after = np.roll(k, -1)
        faces = np.vstack(
            [np.column_stack([k, after, k + CHORDS]), np.column_stack([after, after + CHORDS, k + CHORDS])]
        )
        self._mesh(vertices[faces])

    def _mesh(self, triangles: Array) -> None:
        root = self._mjcf_root
        mesh = root.asset.add("mesh", name="sensed_wall", file=mjcf.Asset(_stl(triangles), ".stl"), inertia="shell")
        root.worldbody.add(
            "geom", name="sensed_wall", type="mesh", mesh=mesh, rgba=_BARELY, contype=0, conaffinity=0, mass=0,
            group=SENSED_GROUP,
        )  # fmt: skip

    def _boxes(self, curve: Curve) -> None:
        fine = 16  # points of the curve per box
        points = curve.points(2.0 * math.pi * np.arange(BOXES * fine) / (BOXES * fine))
        for k in range(BOXES):
            own = points[np.arange(k * fine, (k + 1) * fine + 1) % len(points)]
            along = own[-1] - own[0]
            length = float(np.linalg.norm(along))
            along /= length
            out = np.array([along[1], -along[0]])
            face = float(((own - own[0]) @ out).max()) + _GAP
            middle = 0.5 * (own[0] + own[-1]) + (face + 0.5 * WALL_THICKNESS) * out
            self._box(k, middle, along, 0.5 * length + 0.3 * WALL_THICKNESS, 0.5 * WALL_THICKNESS)

    def _box(self, k: int, middle: Array, along: Array, half_length: float, half_thickness: float) -> None:
        self._mjcf_root.worldbody.add(
            "geom", name=f"wall_{k}", type="box", pos=(*middle, 0.5 * WALL_HEIGHT),
            size=(half_length, half_thickness, 0.5 * WALL_HEIGHT),
            xyaxes=(*along, 0.0, -along[1], along[0], 0.0), rgba=(0.36, 0.42, 0.50, 1.0),
            contype=2, conaffinity=0, mass=0, group=DRAWN_GROUP,
        )  # fmt: skip


def _stl(triangles: Array) -> bytes:
    """Triangles (n, 3, 3) [m] as a binary STL file."""
    record = np.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    record["corners"] = triangles
    return bytes(80) + np.uint32(len(triangles)).tobytes() + record.tobytes()
