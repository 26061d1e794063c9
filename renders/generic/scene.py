"""A run whose scenario has no drawing as a scene: its recorded bodies, paths, plans and estimates, if it has any."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from mathnavi.renders.framing import Box
from mathnavi.renders.generic.log_plan import log_plan
from mathnavi.renders.generic.plan_scene import plan_scene
from mathnavi.renders.generic.run_data import GenericRun, camera_name
from mathnavi.renders.generic.scene_data import SceneData, reach, swept
from mathnavi.renders.palette import COLOURS, SceneElement, vehicle_colour
from mathnavi.renders.scene.arrows import sequence
from mathnavi.renders.scene.bodies import body_surfaces, ghosts, motions_of, multiplied, rotated
from mathnavi.renders.scene.cameras import framing_camera
from mathnavi.renders.scene.elements import Camera, Framed, Layer, Mark, Motion, Pose, Scene
from mathnavi.renders.scene.landscape import flown

FIELD_OF_VIEW, FREE, ASPECT = 36.0, Box(0.1, 0.9, 0.14, 0.88), 1.4
VIDEO_FREE = Box(0.25, 0.90, 0.16, 0.84)  # of a picture of a video, in which all that moves is
FOLLOW_DISTANCE = 7.0  # sizes of a vehicle
FOLLOW = (40.0, -20.0)  # [degrees] azimuth and elevation
SMALLEST = 0.05  # of the extent: a vehicle that is smaller is seen from as far as if it were so large


def generic_scene(run: GenericRun) -> Scene:
    """Return the scene of a run; of a log its plan, of another run without a recorded scene charts alone."""
    if run.scene is None:
        seen = log_plan(run)
        return Scene(run.title, run.duration, ()) if seen is None else plan_scene(run.title, run.duration, seen)
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
        replace(
            framing_camera(name, framed, sight, FIELD_OF_VIEW, aspect=ASPECT),
            shot=name, framed=replace(framed, box=VIDEO_FREE),
        )
        for name, sight in {"fixed": (50.0, -24.0), "top": (90.0, -89.0)}.items()
    ]  # fmt: skip
    lines, marks = [], []
    size = reach(scene)
    for number, (name, body) in enumerate(scene.vehicles.items()):
        colour = vehicle_colour(number) if several else COLOURS[SceneElement.PATH]
        layer = Layer(name if several else SceneElement.PATH.value, colour)
        lines.append(flown(t, a["pos"][:, body].astype(float), layer))
        if f"body {body}" not in motions:
            motions[f"body {body}"] = Motion(t[:1], a["pos"][:1, body].astype(float), a["quat"][:1, body].astype(float))
        if several:
            marks.append(Mark(name, colour, motion=f"body {body}", layer=layer, dot=False))
        distance = FOLLOW_DISTANCE * max(float(size[body]), SMALLEST * scene.extent)
        cameras.append(Camera(f"follow {name}", (0.0, 0.0, 0.0), distance, *FOLLOW, f"body {body}"))
    if several:
        places = a["pos"][:, list(scene.vehicles.values())].astype(float)
        motions["all"] = Motion(t, places.mean(axis=1)).thinned()
        apart = 0.5 * float(np.median(np.ptp(places, axis=1).max(axis=1)))
        distance = FOLLOW_DISTANCE * max(apart, SMALLEST * scene.extent, float(size.max()))
        cameras.append(Camera("follow all", (0.0, 0.0, 0.0), distance, *FOLLOW, "all"))
    cameras[-1] = replace(cameras[-1], shot="track")
    for plan in scene.plans.values():
        known = np.asarray(np.isfinite(plan.pos).all(axis=1))
        kept = [first + np.flatnonzero(known[first:after]) for first, after in pairwise(plan.offsets.tolist())]
        frames, times = [[plan.pos[rows]] for rows in kept], [plan.t[rows] for rows in kept]
        layer = Layer.for_element(SceneElement.PLAN)
        lines += sequence(layer, frames, plan.adopted, float(t[-1]), 2.8, times=times)
    level = float(floors[0].vertices[:, 2].max()) if floors else None
    cameras += _own_cameras(scene)
    return Scene(run.title, run.duration, cameras, motions, surfaces, lines, marks, floor=level)


def _own_cameras(scene: SceneData) -> list[Camera]:
    """Return the cameras of the model."""
    a = scene.arrays
    found: dict[str, Camera] = {}
    parts = (a[f"camera.{part}"] for part in ("names", "body", "pos", "quat", "field_of_view"))
    for name, body, pos, quat, degrees in zip(*parts, strict=True):
        motion = f"body {body}" if scene.moving[body] else None
        if motion is None:
            still = a["quat"][0, body].astype(float)
            pos, quat = a["pos"][0, body] + rotated(still, pos.astype(float)), multiplied(still, quat.astype(float))
        shown = float(np.clip(degrees, 1.0, 170.0))
        camera = Camera(
            str(name), (0.0, 0.0, 0.0), 1.0, 0.0, 0.0, motion, field_of_view=shown, mounted=Pose(pos, quat, None)
        )
        found.setdefault(camera_name(camera.name), camera)
    return [replace(camera, shot=shot) for shot, camera in found.items() if shot]
