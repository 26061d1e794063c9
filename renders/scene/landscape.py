"""Common part of flights over a terrain: airframes, radars, plans and cameras."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import mathnavi.models.aerial
from mathnavi.interfaces.reading.mechanisms import read_spec
from mathnavi.interfaces.signals import Array, Plan
from mathnavi.models.aerial.entity import airframe_pose
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.models.terrain.visibility import RadarTrack
from mathnavi.renders.framing import Box
from mathnavi.renders.palette import COLOURS, Colour, SceneElement, part_of
from mathnavi.renders.relief import EXAGGERATION
from mathnavi.renders.scene.arrows import sequence, thinned_rows
from mathnavi.renders.scene.bodies import body_surfaces, model_shapes, revolved
from mathnavi.renders.scene.cameras import framing_camera
from mathnavi.renders.scene.elements import (
    MOST_POSES,
    Camera,
    Framed,
    Layer,
    Lines,
    Mark,
    Motion,
    Surface,
)
from mathnavi.renders.scene.ground import BASE

MAP_NOTE = f"in views of the map heights are {EXAGGERATION} times as tall as they are"
DOME_OPACITY = 0.24
RADAR_POSES = 120  # of one that drives
AIRFRAME_GROUP = 2
TRUE_SPAN = 12.0  # [m] of the airframe
MARGIN = 0.03  # around the map for the distances along its edges, in lengths of the longer side
DISTANCES = 5  # about as many along the longer side
GLOW = 0.35  # of airframes
FINE = 1.0  # [m] by which a plan that bends may be off, as it is drawn
MOST_PIECES = 1000  # of an arc
# The top view is taken from far away, so that it looks like a map.
FIELD_OF_VIEW = {"overview": 30.0, "top": 8.0}  # [degrees]
FILL = {"overview": 0.97, "top": 0.95}  # share of the picture that the map takes
MARGIN, LEAST = 0.12, 0.03  # around what happens: of its size, and of the map's width at least
PART_BOX = Box(0.06, 0.94, 0.12, 0.9)  # of the picture, for it
PART = 0.6  # of the shorter side of a map: places that are less far apart have a view of their own
ELEVATION, SIDEWAYS = -36.0, 24.0  # [degrees] of the overview, and off north-up


def airframe(motion: str, layer: Layer, colour: Colour | None = None) -> list[Surface]:
    """The airframe of a vehicle, drawn at a size in the picture, in its own colours or all in one."""
    model = read_spec(Path(mathnavi.models.aerial.__file__).parent / "airframe.xml", ValueError).compile()
    still = np.zeros((model.nbody, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (model.nbody, 1))
    shapes = model_shapes(model, [AIRFRAME_GROUP])
    moved = dict.fromkeys(range(model.nbody), motion)
    return body_surfaces(shapes, moved, still, endless=1.0, layer=layer, glow=GLOW, colour=colour, span=TRUE_SPAN)


def airframe_motion(t: Array, x: Array, u: Array, terrain: HeightField) -> Motion:
    """Motion of an airframe of states (n, 6) and accelerations (n, 3), with the ground below it."""
    rows = thinned_rows(len(t), MOST_POSES)
    found = [airframe_pose(x[k, :3], x[k, 3:], u[min(k, len(u) - 1)]) for k in rows]
    return vehicle_motion(t[rows], np.array([p for p, _ in found]), np.array([q for _, q in found]), terrain)


def vehicle_motion(t: Array, places: Array, quat: Array | None, terrain: HeightField) -> Motion:
    """Motion through places (n, 3) [m] at attitudes (n, 4), with the ground below it."""
    below = terrain.height(np.clip(places[:, 0], 0.0, terrain.width), np.clip(places[:, 1], 0.0, terrain.depth))
    return Motion(t, places, quat, ground=np.asarray(below)).thinned()


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
    rows = thinned_rows(len(t), MOST_POSES)
    return Lines(layer, places[rows], np.array([0, len(rows)]), layer.colour, width, times=t[rows], cut="past")


def plan_lines(
    plans: Sequence[Plan],
    adopted: Array,
    end: float,
    own: Mapping[SceneElement, Layer],
    colour: Colour | None = None,
    fine: float = FINE,
) -> list[Lines]:
    """Part of the present plan, adopted at ``adopted`` (n,) [s], that is ahead: optimised, safety, completion."""
    pieces = [plan_pieces(plan, begin, fine) for plan, begin in zip(plans, adopted.tolist(), strict=True)]
    found = []
    for part, layer in own.items():
        found += sequence(
            layer, [[places for kind, (_, places) in each if kind is part] for each in pieces], adopted, end,
            2.0 if colour else 3.0, colour=colour or COLOURS[part], dashed=part is SceneElement.COMPLETION,
            times=[t for each in pieces for kind, (t, _) in each if kind is part],
        )  # fmt: skip
    return found


def plan_pieces(plan: Plan, begin: float, fine: float = FINE) -> list[tuple[SceneElement, tuple[Array, Array]]]:
    """The parts of a plan from ``begin`` [s] on: times (m,) [s] and places (m, 3) [m] of each.

    Between two of its points a plan is at most ``fine`` [m] from the straight line.
    """
    found: list[tuple[SceneElement, tuple[list[Array], list[Array]]]] = []
    for k, phase in enumerate(plan.phase):
        first, last = max(begin, float(plan.t[k])), float(plan.t[k + 1])
        if last <= first:
            continue
        pieces = math.ceil(
            min((last - first) * math.sqrt(float(np.linalg.norm(plan.u[k])) / (8.0 * fine)), MOST_PIECES)
        )
        times = np.linspace(first, last, max(pieces, 1) + 1)
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
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 33)
    vertices, faces = revolved(radius * np.cos(angle), radius * np.sin(angle), 64)
    if centre is not None:
        vertices = vertices + centre
    return Surface(vertices, faces, layer.colour, DOME_OPACITY, motion, layer, glow=0.75, tall=True)


def corners(terrain: HeightField, low: float, high: float) -> Array:
    """(8, 3) [m] of the box over the map between two heights [m]."""
    return np.array([[x, y, z] for x in (0.0, terrain.width) for y in (0.0, terrain.depth) for z in (low, high)])


def map_cameras(terrain: HeightField, course: Array) -> list[Camera]:
    """Overview and top view, which the whole map fills, its heights multiplied.

    The overview is turned a little from north-up, to the side from which a course (3,) crosses the picture.
    """
    low, high = float(terrain.z.min()), float(terrain.z.max())
    box = corners(terrain, low - BASE * terrain.width / EXAGGERATION, 0.6 * high + 0.4 * low)
    azimuth = 90.0 + (SIDEWAYS if course[0] * course[1] >= 0.0 else -SIDEWAYS)
    found = []
    for name, sight in {"overview": (azimuth, ELEVATION), "top": (90.0, -89.9)}.items():
        edges = 0.5 - 0.5 * FILL[name], 0.5 + 0.5 * FILL[name]
        framed = Framed(box, Box(*edges, *edges))
        found.append(map_camera(name, framed, sight, low=low, tall=EXAGGERATION))
    return found


def mission_cameras(terrain: HeightField, places: Array, course: Array) -> list[Camera]:
    """Overview and top view of what happens, and where that is a small part of the map a view of the whole map too.

    ``places`` (n, 3) [m] are those of paths, plans and targets. Pictures and videos take the first two.
    """
    whole = map_cameras(terrain, course)
    low, high = places.min(axis=0), places.max(axis=0)
    size = float((high - low)[:2].max())
    if size > PART * min(terrain.width, terrain.depth):
        return whole
    margin = max(MARGIN * size, LEAST * terrain.width)
    around = np.array(
        [[x, y, z] for x in (low[0] - margin, high[0] + margin) for y in (low[1] - margin, high[1] + margin)
         for z in (low[2], high[2])]
    )  # fmt: skip
    framed, base = Framed(around, PART_BOX), float(terrain.z.min())
    return [
        *(map_camera(each.name, framed, (each.azimuth, each.elevation), low=base, tall=EXAGGERATION) for each in whole),
        replace(whole[0], name="whole map", shot=""),
    ]


def map_camera(name: str, framed: Framed, sight: tuple[float, float], *, low: float = 0.0, tall: float = 1.0) -> Camera:
    """A camera of a whole map, of the same name in videos."""
    found = framing_camera(name, framed, sight, FIELD_OF_VIEW[name], low=low, tall=tall)
    return replace(found, span=0.075, shot=name)
