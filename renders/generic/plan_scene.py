"""Plan of a recorded log in the browser: paths up to the present, walls, and beacons as they are known by then."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.renders.framing import Box
from mathnavi.renders.generic.log_plan import ESTIMATE, REFERENCE, LogPlan
from mathnavi.renders.palette import COLOURS, SceneElement
from mathnavi.renders.plan import DEVIATIONS, deviation
from mathnavi.renders.ranging import shapes
from mathnavi.renders.scene.arrows import lifted, sequence, thinned_rows
from mathnavi.renders.scene.cameras import framing_camera
from mathnavi.renders.scene.elements import INK_COLOUR, MOST_POSES, Framed, Layer, Lines, Mark, Motion, Scene, Surface

FIELD_OF_VIEW, FREE = 30.0, Box(0.08, 0.92, 0.1, 0.9)
SIGHTS = {"top": (90.0, -89.9), "slant": (80.0, -50.0)}  # [degrees] azimuth and elevation of the cameras
MOST_FRAMES = 300  # of the places of beacons
CROSS = 0.008  # half the length of a cross where a beacon was found, in diagonals of the plan
WALLS = Layer("walls")
FLOOR, BELOW, FLOOR_COLOUR = 1.5, 2e-4, (0.93, 0.93, 0.90)  # margin and depth of the floor, in diagonals of the plan


def plan_scene(title: str, duration: float, plan: LogPlan) -> Scene:
    """Return the scene of a plan, in the plane z = 0, of a log of a duration [s]."""
    framed = Framed(lifted(plan.points, 0.0), FREE)
    cameras = [framing_camera(name, framed, sight, FIELD_OF_VIEW) for name, sight in SIGHTS.items()]
    lines, motions, marks = list[Lines](), dict[str, Motion](), list[Mark]()
    if plan.wall is not None:
        outlines = [lifted(each, 0.0) for each in plan.wall.outlines]
        offsets = np.cumsum([0, *map(len, outlines)])
        lines.append(Lines(WALLS, np.vstack(outlines), offsets, WALLS.colour, 3.0))
    paths = (
        (REFERENCE, SceneElement.REFERENCE.value, plan.t, plan.reference),
        (ESTIMATE, ESTIMATE.value, plan.t_estimate, plan.estimate),
    )
    for part, name, t, places in paths:
        known = np.flatnonzero(np.isfinite(places).all(axis=1)) if places.shape[1] else np.empty(0, dtype=np.int64)
        if len(known) < 2:
            continue
        rows = known[thinned_rows(len(known), MOST_POSES)]
        layer = Layer(name, COLOURS[part])
        lines.append(_path(layer, t[rows], places[rows], plan.jump))
        motions[name] = Motion(t[rows], lifted(places[rows], 0.0), shown=((float(t[rows[0]]), float(t[rows[-1]])),))
        marks.append(Mark(name, layer.colour, motion=name, layer=layer))
    colour = COLOURS[SceneElement.BEACON]
    marks += [Mark(f"beacon {i}", colour, np.array([*place, 0.0])) for i, place in plan.beacons.items()]
    marks += [
        Mark(f"beacon {i}, σ {deviation(P):.2g} m", COLOURS[ESTIMATE], np.array([*place, 0.0]), dot=False)
        for i, (place, P) in plan.last_found.items()
    ]
    return Scene(title, duration, cameras, motions, [_floor(plan)], [*lines, *_found(plan, duration)], marks)


def _floor(plan: LogPlan) -> Surface:
    """A plain floor below the plan."""
    size = float(np.linalg.norm(np.ptp(plan.points, axis=0)))
    low, high = plan.points.min(axis=0) - FLOOR * size, plan.points.max(axis=0) + FLOOR * size
    corners = np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
    return Surface(lifted(corners, -BELOW * size), np.array([[0, 1, 2], [0, 2, 3]]), FLOOR_COLOUR, glow=1.0)


def _path(layer: Layer, t: Array, places: Array, jump: float) -> Lines:
    """A path through places (n, 2) up to the present, but for its jumps."""
    jumps = np.flatnonzero(np.linalg.norm(np.diff(places, axis=0), axis=1) > jump) + 1
    offsets = np.array([0, *jumps, len(t)], dtype=np.int64)
    return Lines(layer, lifted(places, 0.0), offsets, layer.colour, 3.0, times=t, cut="past")


def _found(plan: LogPlan, duration: float) -> list[Lines]:
    """Ellipses and crosses of the beacons that were found by each time."""
    if not plan.places.shape[1]:
        return []
    half = CROSS * float(np.linalg.norm(np.ptp(plan.points, axis=0)))
    cross = half * np.array([[[-1.0, 0.0], [1.0, 0.0]], [[0.0, -1.0], [0.0, 1.0]]])
    chosen, frames = thinned_rows(len(plan.t_estimate), MOST_FRAMES), list[list[Array]]()
    for k in chosen.tolist():
        frames.append([])
        for place, P in plan.found(k).values():
            frames[-1].append(lifted(shapes.ellipse(place, *shapes.half_axes(P, DEVIATIONS)), 0.0))
            frames[-1] += [lifted(place + each, 0.0) for each in cross]
    return sequence(Layer("beacons as found", INK_COLOUR), frames, plan.t_estimate[chosen], duration, 2.0)
