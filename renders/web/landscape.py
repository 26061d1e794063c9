"""Common part of flights over a terrain: the ground, airframes, radars, plans and cameras."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

import mathnavi.models.aerial
from mathnavi.interfaces.reading.mechanisms import read_spec
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import RadarTrack
from mathnavi.renders.landscape import BASE, OPTICS, TRUE_SPAN, Landscape
from mathnavi.renders.palette import COLOURS, Colour, SceneElement, part_of
from mathnavi.renders.relief import EXAGGERATION, relief, resampled
from mathnavi.renders.web.bodies import body_surfaces, grid_faces, model_shapes, revolved
from mathnavi.renders.web.elements import Camera, Layer, Lines, Mark, Motion, Surface

NODES, PIXELS = 257, 1025  # of the ground and of its picture, along the longer side
QUALITY = 82  # of that picture, a JPEG
MAP_NOTE = f"in the overview and the top view heights are {EXAGGERATION} times as tall as they are"
EARTH: Colour = (0.36, 0.32, 0.27)  # of the sides of the map
ASPECT = 1.5  # width over height of the picture, more or less
DOME_OPACITY = 0.24
RADAR_POSES = 120  # of one that drives
PLAN_STEP = 2.0  # [s] between two points of an arc, or a 200th of the plan
AIRFRAME_GROUP = 2
MARGIN = 0.03  # around the map for the distances along its edges, in lengths of the longer side
DISTANCES = 5  # about as many along the longer side
GLOW = 0.35  # of airframes


def ground(terrain: HeightField) -> list[Surface]:
    """The ground under its relief, and the sides of the map."""
    z = resampled(terrain, min(max(terrain.z.shape), NODES), order=1)
    rows, columns = z.shape
    east, north = np.meshgrid(np.linspace(0.0, terrain.width, columns), np.linspace(0.0, terrain.depth, rows))
    vertices = np.column_stack([east.ravel(), north.ravel(), z.ravel()])
    picture = io.BytesIO()
    Image.fromarray(relief(terrain, PIXELS)).save(picture, "JPEG", quality=QUALITY)
    edge = np.concatenate(
        [np.arange(columns), np.arange(1, rows) * columns + columns - 1,
         (rows - 1) * columns + np.arange(columns - 1)[::-1], np.arange(1, rows - 1)[::-1] * columns, [0]]
    )  # fmt: skip
    rim, base = vertices[edge], float(terrain.z.min()) - BASE * max(terrain.width, terrain.depth) / EXAGGERATION
    lower = rim.copy()
    lower[:, 2] = base
    return [
        Surface(
            vertices, grid_faces(rows, columns), (0.6, 0.6, 0.58), glow=0.9, tall=True, picture=picture.getvalue(),
            picture_box=(0.0, 0.0, terrain.width, terrain.depth),
        ),
        Surface(np.vstack([lower, rim]), grid_faces(2, len(edge)), EARTH, smooth=False, tall=True),
    ]  # fmt: skip


def airframe(motion: str, layer: Layer, colour: Colour | None = None) -> list[Surface]:
    """The airframe of a vehicle, drawn at a size in the picture, in its own colours or all in one."""
    model = read_spec(Path(mathnavi.models.aerial.__file__).parent / "airframe.xml", ValueError).compile()
    still = np.zeros((model.nbody, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (model.nbody, 1))
    shapes = model_shapes(model, [AIRFRAME_GROUP])
    moved = dict.fromkeys(range(model.nbody), motion)
    return body_surfaces(shapes, moved, still, endless=1.0, layer=layer, glow=GLOW, colour=colour, span=TRUE_SPAN)


def airframe_motion(t: Array, x: Array, u: Array, terrain: HeightField) -> Motion:
    """Motion of an airframe of states (n, 6) and accelerations (n, 3), with the ground below it."""
    rows = np.unique(np.linspace(0, len(t) - 1, min(len(t), 1500)).round().astype(np.int64))
    found = [airframe_pose(x[k, :3], x[k, 3:], u[min(k, len(u) - 1)]) for k in rows]
    below = terrain.height(np.clip(x[rows, 0], 0.0, terrain.width), np.clip(x[rows, 1], 0.0, terrain.depth))
    return Motion(t[rows], np.array([p for p, _ in found]), np.array([q for _, q in found]), ground=np.asarray(below))


def path(layer: Layer, places: Array) -> Lines:
    """The whole of a path (n, 3) [m], at all times."""
    return Lines(layer, places, np.array([0, len(places)]), layer.colour, dashed=layer.dashed)


def first_plan(plans: Sequence[Plan]) -> list[Lines]:
    """The whole of the first plan, to rest, at all times; nothing without plans."""
    layer = Layer("first plan, to rest", COLOURS[SceneElement.COMPLETION], dashed=True)
    return [path(layer, np.vstack([at for _, (_, at) in plan_pieces(plan, plan.t_start)])) for plan in plans[:1]]


def scale_marks(terrain: HeightField) -> list[Mark]:
    """Distances along the southern and the western edge, and north."""
    east, north = terrain.width, terrain.depth
    step = round_step(max(east, north) / DISTANCES)
    beside = MARGIN * max(east, north)
    low = float(terrain.z.min())
    named = [(f"{along / 1e3:g} km", (along, -beside, low)) for along in np.arange(step, east, step)]
    named += [
        (f"{up / 1e3:g} km", (-beside, up, float(terrain.height(0.0, up)))) for up in np.arange(step, north, step)
    ]
    named.append(("north", (0.5 * east, north + beside, float(terrain.z[-1].max()))))
    layer = Layer("scale")
    return [Mark(name, layer.colour, np.array(place), layer=layer, dot=False) for name, place in named]


def round_step(step: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is no shorter."""
    power = 10.0 ** math.floor(math.log10(step))
    return power * min(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= step * (1.0 - 1e-9))


def flown(t: Array, places: Array, layer: Layer, width: float = 3.4) -> Lines:
    """The path (n, 3) up to the present."""
    rows = np.unique(np.linspace(0, len(t) - 1, min(len(t), 1500)).round().astype(np.int64))
    return Lines(
        layer, places[rows], np.array([0, len(rows)]), layer.colour, width, times=t[rows], cut="past",
    )  # fmt: skip


def plan_lines(
    plans: Sequence[Plan], adopted: Array, end: float, own: Mapping[SceneElement, Layer], colour: Colour | None = None
) -> list[Lines]:
    """Part of the present plan, adopted at ``adopted`` (n,) [s], that is ahead: optimised, safety, completion."""
    parts: dict[SceneElement, list[list[tuple[Array, Array]]]] = {part: [[] for _ in plans] for part in own}
    for k, (plan, begin) in enumerate(zip(plans, adopted.tolist(), strict=True)):
        pieces = plan_pieces(plan, begin)
        for part, piece in pieces:
            if part in parts:
                parts[part][k].append(piece)
    found = []
    for part, frames in parts.items():
        polylines = [piece for frame in frames for piece in frame]
        if not polylines:
            continue
        counts = [len(t) for t, _ in polylines]
        found.append(
            Lines(
                own[part], np.vstack([places for _, places in polylines]), np.cumsum([0, *counts]),
                colour or COLOURS[part], 2.0 if colour else 3.0, part is SceneElement.COMPLETION,
                times=np.concatenate([t for t, _ in polylines]), cut="ahead",
                frames=np.cumsum([0, *map(len, frames)]), starts=adopted, end=end,
            )
        )  # fmt: skip
    return found


def plan_pieces(plan: Plan, begin: float) -> list[tuple[SceneElement, tuple[Array, Array]]]:
    """The parts of a plan from ``begin`` [s] on: times (m,) [s] and places (m, 3) [m] of each."""
    step = max(PLAN_STEP if plan.t_end - begin > 60.0 else 0.1, (plan.t_end - begin) / 200.0)
    found: list[tuple[SceneElement, tuple[list[Array], list[Array]]]] = []
    for k, phase in enumerate(plan.phase):
        first, last = max(begin, float(plan.t[k])), float(plan.t[k + 1])
        if last <= first:
            continue
        times = np.linspace(first, last, max(2, int(np.ceil((last - first) / step)) + 1))
        s = times[:, None] - plan.t[k]
        places = plan.x[k, :3] + plan.x[k, 3:6] * s + 0.5 * plan.u[k] * s**2
        part = part_of(int(phase))
        if not found or found[-1][0] is not part:
            found.append((part, ([], [])))
        found[-1][1][0].append(times)
        found[-1][1][1].append(places)
    return [(part, (np.concatenate(t), np.vstack(x))) for part, (t, x) in found]


def radar_domes(
    tracks: Sequence[RadarTrack], terrain: HeightField, duration: float
) -> tuple[dict[str, Motion], list[Surface]]:
    """Domes that the radars reach, where they are while they are on."""
    motions, surfaces = {}, []
    for number, track in enumerate(tracks):
        begin, end = max(track.time, 0.0), min(track.until, duration)
        if end <= begin:
            continue
        t = np.linspace(begin, end, RADAR_POSES) if any(track.velocity) else np.array([begin])
        places = np.array([at.position(terrain) for s in t if (at := track.at(min(float(s), end - 1e-6), terrain))])
        name = f"radar {number}"
        motions[name] = Motion(t[: len(places)], places, shown=((begin, end),))
        surfaces.append(dome(track.radar.radius, motion=name))
    return motions, surfaces


def dome(radius: float, motion: str | None = None, centre: Array | None = None) -> Surface:
    """The sphere that a radar reaches, its radius in [m], on a motion or about a centre (3,) [m]."""
    layer = Layer.for_element(SceneElement.RADAR)
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 25)
    vertices, faces = revolved(radius * np.cos(angle), radius * np.sin(angle))
    if centre is not None:
        vertices = vertices + centre
    return Surface(vertices, faces, layer.colour, DOME_OPACITY, motion, layer, glow=0.75, tall=True)


def map_cameras(terrain: HeightField, course: Array) -> list[Camera]:
    """Overview and top view of a course (n, 3) [m], with heights as in every picture of a whole map."""
    land = Landscape(terrain)
    found = []
    for name in ("overview", "top"):
        view = land.view(name, course, 0.0, ASPECT)
        degrees = OPTICS[name].field_of_view
        found.append(
            Camera(
                name, tuple(view.lookat.tolist()), view.distance, view.azimuth, view.elevation,
                field_of_view=degrees, tall=EXAGGERATION, span=0.075,
            )
        )  # fmt: skip
    return found


def chase(name: str, motion: str, distance: float, behind: float, span: float, elevation: float = -17.0) -> Camera:
    """A camera behind a vehicle."""
    return Camera(
        name, (0.0, 0.0, 0.0), distance, 0.0, elevation, motion, behind, 45.0, span=span,
    )  # fmt: skip
