"""A run in the browser whose scenario has no drawing: its recorded scene, if it has one, and charts of its log."""

from __future__ import annotations

import numpy as np

from mathnavi.renders.framing import Box
from mathnavi.renders.generic.run_data import GenericRun
from mathnavi.renders.generic.scene_data import reach, swept
from mathnavi.renders.palette import COLOURS, SceneElement, vehicle_colour
from mathnavi.renders.scene.bodies import body_surfaces, ghosts, motions_of
from mathnavi.renders.scene.cameras import framing_camera
from mathnavi.renders.scene.elements import Camera, Framed, Layer, Lines, Mark, Motion, Scene
from mathnavi.renders.scene.landscape import flown

FIELD_OF_VIEW, FREE, ASPECT = 36.0, Box(0.1, 0.9, 0.14, 0.88), 1.4
FOLLOW_DISTANCE = 7.0  # sizes of a vehicle
SMALLEST = 0.05  # of the extent: a vehicle that is smaller is seen from as far as if it were so large


def web_scene(run: GenericRun) -> Scene:
    """Return the scene of a run; without a recorded scene charts alone."""
    if run.scene is None:
        return Scene(run.title, run.duration, ())
    scene = run.scene
    a, t = scene.arrays, scene.t
    several = len(scene.vehicles) > 1
    moving = np.flatnonzero(scene.moving).tolist()
    motions = motions_of(t, a["pos"], a["quat"], moving, "body ")
    surfaces = body_surfaces(
        a, {body: f"body {body}" for body in moving}, (a["pos"][0], a["quat"][0]), endless=40.0 * scene.extent
    )
    floors = [each for each in surfaces if each.checker > 0.0]
    if scene.has_ghost():
        own = motions_of(t, a["estimate.pos"], a["estimate.quat"], moving, "estimate ")
        pairs = {f"body {body}": f"estimate {body}" for body in moving if f"estimate {body}" in own}
        motions |= own
        surfaces += ghosts(surfaces, pairs, SceneElement.ESTIMATE, Layer.for_element(SceneElement.ESTIMATE))
    framed = Framed(swept(scene), FREE)
    cameras = [
        framing_camera(name, framed, sight, FIELD_OF_VIEW, aspect=ASPECT)
        for name, sight in {"fixed": (50.0, -24.0), "top": (90.0, -89.0)}.items()
    ]
    lines, marks = [], []
    size = reach(scene)
    for number, (name, body) in enumerate(scene.vehicles.items()):
        colour = vehicle_colour(number) if several else COLOURS[SceneElement.FLOWN]
        layer = Layer(name if several else SceneElement.FLOWN.value, colour)
        lines.append(flown(t, a["pos"][:, body].astype(float), layer))
        if f"body {body}" not in motions:
            motions[f"body {body}"] = Motion(t[:1], a["pos"][:1, body].astype(float), a["quat"][:1, body].astype(float))
        if several:
            marks.append(Mark(name, colour, motion=f"body {body}", layer=layer, dot=False))
        distance = FOLLOW_DISTANCE * max(float(size[body]), SMALLEST * scene.extent)
        cameras.append(Camera(f"follow {name}", (0.0, 0.0, 0.0), distance, 40.0, -20.0, f"body {body}"))
    for plan in scene.plans.values():
        known = np.isfinite(plan.pos).all(axis=1)
        kept = np.concatenate([[0], np.cumsum(known)])
        lines.append(
            Lines(
                Layer.for_element(SceneElement.PLAN), plan.pos[known], kept[plan.offsets],
                COLOURS[SceneElement.PLAN], 2.8, times=plan.t[known], cut="ahead",
                frames=np.arange(len(plan.adopted) + 1), starts=plan.adopted, end=float(t[-1]),
            )
        )  # fmt: skip
    level = float(floors[0].vertices[:, 2].max()) if floors else None
    return Scene(run.title, run.duration, cameras, motions, surfaces, lines, marks, floor=level)
