"""A robot with range sensors in the browser: field, rays, estimate with its covariance, hypotheses."""

from __future__ import annotations

import io
import math

import numpy as np
from PIL import Image

from mathnavi.interfaces.signals import Array
from mathnavi.models.field.arena import DRAWN_GROUP, SENSOR_HEIGHT
from mathnavi.models.field.curve import Curve
from mathnavi.models.unicycle.entity import build_spec
from mathnavi.renders.palette import COLOURS, SceneElement
from mathnavi.renders.ranging import shapes
from mathnavi.renders.ranging.floor import extent, floor_picture
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.renders.ranging.scene import JUMP, MARKS, PATH, ROBOT_GROUP, TURRET, WALL
from mathnavi.renders.scene.arrows import lifted, sequence, thinned_rows
from mathnavi.renders.scene.bodies import body_surfaces, ghosts, model_shapes, motions_of, poses
from mathnavi.renders.scene.cameras import chase
from mathnavi.renders.scene.charts import ESTIMATE, curve
from mathnavi.renders.scene.elements import Camera, Chart, Layer, Lines, Mark, Scene, Surface
from mathnavi.renders.scene.landscape import flown
from mathnavi.sim.metrics.ranging import HEADING, POSITION

MOST_FRAMES = 500  # of rays and of what is believed
DEVIATIONS = 3.0  # of the ellipse
QUALITY = 88
_CROSS = 0.06 * np.array([[[-1.0, 0.0], [1.0, 0.0]], [[0.0, -1.0], [0.0, 1.0]]])  # [m] where a beacon is believed


def web_scene(run: RangingRun) -> Scene:
    """Return the scene of a robot in its field."""
    model = build_spec(run.curve, run.mission.rays, run.drive, run.friction).compile()
    rows = thinned_rows(len(run.t), 1500)
    positions = run.log.x[rows, : model.nq]
    pos, quat = poses(model, positions)
    moving = [b for b in range(model.nbody) if model.body_weldid[b] != 0]
    motions = motions_of(run.t[rows], pos, quat, moving, "robot ")
    arrays = model_shapes(model, (DRAWN_GROUP, ROBOT_GROUP))
    arrays["geom.rgba"] = np.where((arrays["geom.body"] == 0)[:, None], np.array(WALL), arrays["geom.rgba"])
    robot = body_surfaces(arrays, {b: f"robot {b}" for b in moving}, (pos[0], quat[0]), endless=10.0)
    surfaces = [_floor(run), *robot]
    if run.initialised.any():
        estimates = _estimate_positions(run, rows, positions)
        own = motions_of(run.t[rows], *poses(model, estimates), moving, "estimate ")
        pairs = {f"robot {b}": f"estimate {b}" for b in moving if f"estimate {b}" in own}
        motions |= own
        surfaces += ghosts(robot, pairs, SceneElement.ESTIMATE, Layer.for_element(SceneElement.ESTIMATE))
    chassis = f"robot {moving[0]}"
    centre, half = extent(run.curve)
    low = 2.2 * float(max(half[0] / 1.3, half[1]))
    cameras = [
        Camera("slant", (float(centre[0]), float(centre[1]), 0.0), 1.75 * low, 80.0, -50.0, field_of_view=30.0),
        Camera("top", (float(centre[0]), float(centre[1]), 0.0), 2.0 * low, 90.0, -89.9, field_of_view=30.0),
        chase("follow the robot", chassis, 2.7, 1.5, 0.0, -38.0),
    ]
    lines = [*_paths(run), *_rays(run), *_beliefs(run)]
    marks = [
        Mark("robot", COLOURS[SceneElement.DRIVEN], motion=chassis, dot=False),
        *(
            Mark(f"beacon {i}", COLOURS[SceneElement.BEACON], place=np.array([x, y, SENSOR_HEIGHT]))
            for i, (x, y) in enumerate(run.beacons)
        ),
    ]
    return Scene(
        run.log.title, run.duration, cameras, motions, surfaces, lines, marks, ranging_charts(run), floor=0.0
    )  # fmt: skip


def ranging_charts(run: RangingRun) -> list[Chart]:
    """Errors of the estimate, with the standard deviations that it states, and the ranges."""
    charts = []
    if len(run.beliefs.t):
        t, known = run.beliefs.t, run.initialised
        deviation = run.deviation
        position = [curve("error", ESTIMATE, t, np.where(known, np.maximum(run.position_error, 1e-4), np.nan))]
        heading = [
            curve("error", ESTIMATE, t, np.where(known, np.maximum(np.degrees(run.heading_error), 1e-3), np.nan))
        ]
        if deviation is not None:
            spread = COLOURS[SceneElement.IMAGE]
            position.append(curve("3σ stated", spread, t, DEVIATIONS * deviation[0], dashed=True))
            heading.append(curve("3σ stated", spread, t, np.degrees(DEVIATIONS * deviation[1]), dashed=True))
        charts = [
            Chart("position error", "m", position, [POSITION], logarithmic=True),
            Chart("heading error", "degrees", heading, [math.degrees(HEADING)], logarithmic=True),
        ]
        if run.beliefs.left is not None:
            left = run.beliefs.left.astype(float)
            charts.append(
                Chart("hypotheses left", "", [curve("", COLOURS[SceneElement.HYPOTHESIS], t, left, step=True)])
            )
    colours = ((1.00, 0.50, 0.05), (0.05, 0.42, 0.95), (0.86, 0.10, 0.72), (0.10, 0.78, 0.48))
    names = [f"{math.degrees(angle):.0f}°" for angle in run.mission.angles]
    series = [curve(name, colours[k % 4], run.t, run.ranges[:, k]) for k, name in enumerate(names)]
    return [*charts, Chart("range readings", "m", series)]


def _floor(run: RangingRun) -> Surface:
    """Return the painted floor of the field."""
    centre, half = extent(run.curve)
    west, south, east, north = *(centre - half), *(centre + half)
    picture = io.BytesIO()
    Image.fromarray(floor_picture(run.curve)).save(picture, "JPEG", quality=QUALITY)
    corners = np.array([[west, south, 0.0], [east, south, 0.0], [east, north, 0.0], [west, north, 0.0]])
    return Surface(
        corners, np.array([[0, 1, 2], [0, 2, 3]]), (0.95, 0.95, 0.92), glow=1.0, picture=picture.getvalue(),
        picture_box=(float(west), float(south), float(east), float(north)),
    )  # fmt: skip


def _estimate_positions(run: RangingRun, rows: Array, positions: Array) -> Array:
    """Return estimated positions (n, nq) of the robot at samples; NaN where there is no estimate."""
    found = np.full_like(positions, np.nan)
    for i, row in enumerate(rows):
        k = run.belief(float(run.t[row]))
        if k >= 0:
            found[i] = positions[i]
            found[i, :3] = run.beliefs.x[k]
    return found


def _paths(run: RangingRun) -> list[Lines]:
    """The path that was driven, and that of the estimate but for its jumps."""
    rows = thinned_rows(len(run.t), 1500)
    driven = flown(run.t[rows], lifted(run.pose[rows, :2], PATH), Layer.for_element(SceneElement.DRIVEN), 3.0)
    kept = (
        np.flatnonzero(run.initialised)[thinned_rows(int(run.initialised.sum()), 1500)] if run.initialised.any() else []
    )
    if len(kept) < 2:
        return [driven]
    places, t = run.beliefs.x[kept, :2], run.beliefs.t[kept]
    jumps = np.flatnonzero(np.linalg.norm(np.diff(places, axis=0), axis=1) > JUMP) + 1
    layer = Layer.for_element(SceneElement.ESTIMATE)
    offsets = np.array([0, *jumps, len(kept)])
    return [driven, Lines(layer, lifted(places, 2.0 * PATH), offsets, layer.colour, 2.0, times=t, cut="past")]


def _rays(run: RangingRun) -> list[Lines]:
    """Rays from the turret to the wall; grey where the reading was lost."""
    rows = thinned_rows(len(run.t), MOST_FRAMES)
    read: list[list[Array]] = []
    lost: list[list[Array]] = []
    newest = np.full(run.ranges.shape[1], np.nan)
    measured = np.isfinite(run.ranges)
    for k, row in enumerate(rows):
        since = slice(rows[k - 1] + 1 if k else 0, row + 1)
        for j in range(len(newest)):
            fresh = np.flatnonzero(measured[since, j])
            newest[j] = run.ranges[since, j][fresh[-1]] if len(fresh) else np.nan
        pose, begin = run.pose[row], run.mission.origins(run.pose[row])
        read.append([])
        lost.append([])
        for j, angle in enumerate(run.mission.angles):
            reading = float(newest[j])
            length = reading if math.isfinite(reading) else float(run.true_ranges[row, j])
            along = np.array([math.cos(pose[2] + angle), math.sin(pose[2] + angle)])
            ends = lifted(begin[j] + np.outer([TURRET, length], along), SENSOR_HEIGHT)
            (read if math.isfinite(reading) else lost)[-1].append(ends)
    t, end = run.t[rows], run.duration
    return [
        *sequence(Layer.for_element(SceneElement.RAY), read, t, end, 2.0),
        *sequence(Layer.for_element(SceneElement.LOST_RAY, dashed=True), lost, t, end, 2.0, dashed=True),
    ]


def _beliefs(run: RangingRun) -> list[Lines]:
    """Outlines of the estimate with its ellipse, of the hypotheses, and of the poses that cannot be distinguished."""
    chosen = thinned_rows(len(run.beliefs.t), MOST_FRAMES) if len(run.beliefs.t) else np.array([], dtype=np.int64)
    beliefs = run.beliefs
    spread: list[list[Array]] = []
    guesses: list[list[Array]] = []
    strengths: list[float] = []
    ends: list[list[Array]] = []
    for k in chosen:
        spread.append([])
        guesses.append([])
        ends.append([])
        if not run.initialised[k]:
            continue
        spread[-1].append(lifted(shapes.outline(beliefs.x[k]), MARKS))
        for place, P in run.beacons_believed(int(k)).values():
            axes, direction = shapes.half_axes(P, DEVIATIONS)
            spread[-1].append(lifted(shapes.ellipse(place, axes, direction), MARKS))
            spread[-1] += [lifted(place + cross, MARKS) for cross in _CROSS]
        if beliefs.covariance is not None and np.isfinite(beliefs.covariance[k]).all():
            axes, direction = shapes.half_axes(beliefs.covariance[k], DEVIATIONS)
            spread[-1].append(lifted(shapes.ellipse(beliefs.x[k, :2], axes, direction), MARKS))
        if beliefs.hypotheses is not None:
            own = beliefs.strengths(int(k))
            for j in np.flatnonzero(own > 0.0):
                pose = beliefs.hypotheses[k, j]
                if np.isfinite(pose).all() and not np.allclose(pose, beliefs.x[k]):
                    guesses[-1].append(lifted(shapes.outline(pose), MARKS))
                    strengths.append(0.25 + 0.75 * float(own[j]))
        if beliefs.z is not None and isinstance(run.curve, Curve):
            for place in run.curve.points(beliefs.z[k, :-1]):
                ends[-1].append(lifted(np.array([beliefs.x[k, :2], place]), SENSOR_HEIGHT))
    t, end = beliefs.t[chosen], run.duration
    rows = thinned_rows(len(run.t), MOST_FRAMES)
    images = [[lifted(shapes.outline(image), MARKS) for image in run.images(run.pose[row])[1:]] for row in rows]
    return [
        *sequence(Layer.for_element(SceneElement.ESTIMATE), spread, t, end, 2.0),
        *sequence(Layer.for_element(SceneElement.HYPOTHESIS), guesses, t, end, 2.0, opacities=strengths),
        *sequence(Layer.for_element(SceneElement.BELIEVED), ends, t, end, 1.6, dashed=True),
        *sequence(Layer.for_element(SceneElement.IMAGE, shown=False), images, run.t[rows], end, 1.6),
    ]
