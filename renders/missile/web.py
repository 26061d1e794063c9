"""A missile in the browser: its body and force, path, plan, the target with its path and velocity."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.entity import build_spec
from mathnavi.renders.framing import Box
from mathnavi.renders.missile.run_data import MissileRun
from mathnavi.renders.missile.scene import DRAWN, SPAN, TARGET_RADIUS
from mathnavi.renders.palette import COLOURS, Colour, SceneElement
from mathnavi.renders.scene.arrows import arrow, sequence, thinned_rows
from mathnavi.renders.scene.bodies import body_surfaces, model_shapes, motions_of, poses
from mathnavi.renders.scene.cameras import chase, framing_camera
from mathnavi.renders.scene.charts import TRUTH, curve
from mathnavi.renders.scene.elements import Camera, Chart, Framed, Layer, Lines, Mark, Motion, Scene
from mathnavi.renders.scene.landscape import flown

GROUND_GROUP = 1
GROUND: Colour = (0.56, 0.60, 0.47)
SQUARE = 20.0  # [m]
MOST_FRAMES, PLAN_POINTS = 400, 60
LONGEST = 2.2  # of the span of the missile: the largest force
LIFT = 0.4  # [m] over the ground
VELOCITY_TIME = 2.0  # [s] of motion of the target that its arrow is long
FIELD_OF_VIEW, FREE = 30.0, Box(0.06, 0.94, 0.12, 0.85)


def web_scene(run: MissileRun) -> Scene:
    """Return the scene of a missile's flight."""
    model = build_spec(run.coordinates, run.input_max.tolist()).compile()
    half = len(run.coordinates.joints)
    rows = thinned_rows(len(run.t), 1500)
    t = run.t[rows]
    pos, quat = poses(model, run.log.x[rows, :half])
    moving = [b for b in range(model.nbody) if model.body_weldid[b] != 0 and model.body_mocapid[b] < 0]
    motions = motions_of(t, pos, quat, moving, "missile ")
    shapes = model_shapes(model, (GROUND_GROUP, DRAWN))
    targets = [b for b in range(model.nbody) if model.body_mocapid[b] >= 0]
    times = run.t[thinned_rows(len(run.t), MOST_FRAMES)]
    places = np.array([run.target_at(float(s)) for s in times])
    motions["target"] = Motion(times, places)
    names = {body: f"missile {body}" for body in moving} | dict.fromkeys(targets, "target")
    layer = Layer.for_element(SceneElement.FLOWN)
    surfaces = body_surfaces(shapes, names, (pos[0], quat[0]), endless=4000.0, floor=(GROUND, SQUARE))
    own = {f"missile {body}" for body in moving}
    surfaces = [replace(each, span=SPAN) if each.motion in own else each for each in surfaces]
    missile = next(name for name in motions if name.startswith("missile"))
    drawn = [flown(run.t, run.path, layer), *_plans(run), *_forces(run), *_target(run, times, places)]
    return Scene(
        run.log.title, run.duration,
        [*_cameras(run), chase("follow the missile", missile, 7.0 * SPAN, 0.15, 0.0)],
        motions, surfaces, drawn,
        [Mark(SceneElement.TARGET.value, COLOURS[SceneElement.TARGET], motion="target")],
        missile_charts(run),
        floor=0.0,
    )  # fmt: skip


def missile_charts(run: MissileRun) -> list[Chart]:
    """Distance to the target, speed, angle of attack and thrusters."""
    t = run.t
    samples = t[thinned_rows(len(t), 600)]
    distance = np.array([max(run.distance(float(s)), 1e-2) for s in samples])
    charts = [
        Chart("distance to the target", "m", [curve("", TRUTH, samples, distance)], [run.miss_allowed],
              logarithmic=True),
        Chart("speed", "m/s", [curve("", TRUTH, t, run.speed)]),
        Chart("angle of attack", "degrees", [curve("", TRUTH, t, np.degrees(run.attack))]),
    ]  # fmt: skip
    forces = run.u / np.where(run.input_max > 0.0, run.input_max, 1.0)
    colours = ((1.00, 0.50, 0.05), (0.05, 0.42, 0.95), (0.86, 0.10, 0.72), (0.10, 0.78, 0.48), (0.4, 0.4, 0.5))
    series = [curve(f"input {k + 1}", colours[k % 5], t, forces[:, k], step=True) for k in range(forces.shape[1])]
    return [*charts, Chart("thrusters, share of the limit", "", series, [-1.0, 1.0])]


def _cameras(run: MissileRun) -> list[Camera]:
    """Return cameras from the side, with the whole path in view, and from above."""
    ends = np.array([run.target_at(0.0), run.target_at(run.duration)])
    points = np.vstack([run.path, ends + TARGET_RADIUS, ends - TARGET_RADIUS])
    azimuth = float(np.degrees(run.azimuth))
    return [
        replace(framing_camera(name, Framed(points, FREE), sight, FIELD_OF_VIEW), span=0.10)
        for name, sight in {"side": (azimuth + 90.0, -8.0), "slant": (azimuth + 50.0, -24.0)}.items()
    ]


def _plans(run: MissileRun) -> list[Lines]:
    """The part of each plan that is ahead."""
    each = (
        (begin, plan.t_end, run.plan_ahead(begin, PLAN_POINTS))
        for begin, plan in zip(run.log.adopted.tolist(), run.log.plans, strict=True)
    )
    kept = [(begin, end, places) for begin, end, places in each if len(places) > 1]
    times = [begin + (end - begin) * np.linspace(0.0, 1.0, PLAN_POINTS) ** 1.7 for begin, end, _ in kept]
    starts, frames = np.array([begin for begin, *_ in kept]), [[places] for *_, places in kept]
    return sequence(Layer.for_element(SceneElement.PLAN), frames, starts, run.duration, 3.0, times=times)


def _forces(run: MissileRun) -> list[Lines]:
    """The force of the thrusters, as an arrow at the missile."""
    rows = thinned_rows(len(run.t), MOST_FRAMES)
    forces = np.array([run.axes(float(run.t[k])) @ run.coordinates.input_in_space(run.u[k])[:3] for k in rows])
    scale = LONGEST * SPAN / max(float(np.linalg.norm(forces, axis=1).max()), run.weight)
    frames = [arrow(run.path[k], scale * force) for k, force in zip(rows, forces, strict=True)]
    return sequence(Layer.for_element(SceneElement.FORCE), frames, run.t[rows], run.duration, 3.0)


def _target(run: MissileRun, t: Array, places: Array) -> list[Lines]:
    """The path of the target and, as an arrow, its velocity."""
    found = []
    if float(np.ptp(places, axis=0).max()) > 1.0:
        layer = Layer.for_element(SceneElement.TARGET_PATH)
        lifted = places + np.array([0.0, 0.0, LIFT])
        found.append(Lines(layer, lifted, np.array([0, len(t)]), layer.colour, 2.0, times=t, cut="past"))
    frames = [
        arrow(place + np.array([0.0, 0.0, 2.0 * LIFT]), VELOCITY_TIME * run.target_velocity(float(s)))
        for s, place in zip(t, places, strict=True)
    ]
    return [*found, *sequence(Layer.for_element(SceneElement.VELOCITY), frames, t, run.duration, 2.6)]
