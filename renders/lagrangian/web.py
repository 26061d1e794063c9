"""A Lagrangian system in the browser: the mechanism with the ghost of its estimate, or a point on a curved surface."""

from __future__ import annotations

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.mechanism.entity import build_spec
from mathnavi.renders.framing import Box
from mathnavi.renders.lagrangian.charts import nose
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.scene import ARROW, GROUPS, TURNING
from mathnavi.renders.lagrangian.tip import Tip
from mathnavi.renders.lagrangian.views import ELEVATION, RECENT, azimuth
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.scene.arrows import arrow, sequence, thinned_rows
from mathnavi.renders.scene.bodies import body_surfaces, ghosts, model_shapes, motions_of, poses, revolved, swept
from mathnavi.renders.scene.cameras import framing_camera
from mathnavi.renders.scene.charts import ESTIMATE, TRUTH, curve
from mathnavi.renders.scene.elements import Camera, Chart, Framed, Layer, Lines, Mark, Motion, Scene, Surface

MOST_POSES, MOST_FRAMES = 1200, 400
MOST_COMPONENTS = 7  # of the velocity, in charts
ON_GEODESIC = 13  # points
FIELD_OF_VIEW, FREE = 28.0, Box(0.10, 0.90, 0.10, 0.88)
PAPER = (0.93, 0.95, 0.97)
OVER = 1.004  # of a globe: where lines on it are drawn


def web_scene(run: LagrangianRun) -> Scene:
    """Return the scene of a run."""
    return _mechanism(run) if run.mechanism is not None else _surface(run)


def lagrangian_charts(run: LagrangianRun) -> list[Chart]:
    """The error of the velocity, and its components."""
    t, (true, found) = run.t_estimate, run.velocity
    error = np.where(run.errors.found > 0.0, np.maximum(run.velocity_error, 1e-9), np.nan)
    charts = [Chart("velocity error", run.unit, [curve("", ESTIMATE, t, error)], [run.tolerance], logarithmic=True)]
    for k, words in enumerate(run.velocity_names[:MOST_COMPONENTS]):
        name, _, unit = words.partition(" [")
        series = [curve("truth", TRUTH, t, true[:, k]), curve("estimate", ESTIMATE, t, found[:, k])]
        charts.append(Chart(name.replace("_", " "), unit.rstrip("]"), series))
    return charts


def _mechanism(run: LagrangianRun) -> Scene:
    """Bodies that MuJoCo moved, their ghosts, the path of its tip and the velocities there."""
    assert run.mechanism is not None
    model = build_spec(run.mechanism).compile()
    rows = thinned_rows(len(run.t), MOST_POSES)
    n, t = run.manifold.size, run.t[rows]
    pos, quat = poses(model, run.log.x[rows, :n])
    moving = np.flatnonzero(model.body_weldid != 0).tolist()
    motions = motions_of(t, pos, quat, moving, "body ")
    own = {b: f"body {b}" for b in moving}
    surfaces = body_surfaces(model_shapes(model, GROUPS), own, (pos[0], quat[0]), endless=20.0 * model.stat.extent)
    floors = [each for each in surfaces if each.checker > 0.0]
    solid = [each for each in surfaces if each.motion is not None]
    for part, places in ((SceneElement.ESTIMATE, _estimates(run, t)), (SceneElement.REFERENCE, _references(run, t))):
        if np.isfinite(places).any():
            found = motions_of(t, *poses(model, places), moving, f"{part.value} ")
            motions |= found
            surfaces += ghosts(solid, {f"body {b}": f"{part.value} {b}" for b in moving}, part, Layer.for_element(part))
    points = swept(solid, motions)
    cameras = [
        framing_camera(name, Framed(points, FREE), sight, FIELD_OF_VIEW)
        for name, sight in {"side": (azimuth(run), ELEVATION), "top": (90.0, -89.0)}.items()
    ]
    level = float(floors[0].vertices[:, 2].max()) if floors else None
    size = float(np.ptp(points, axis=0).max())
    lines = _tip_lines(run, Tip(model, is_ball=run.is_ball), size)
    note = f"errors of the position are drawn {run.magnification:g} times as large as they are"
    return Scene(
        run.log.title, run.duration, cameras, motions, surfaces, lines, (), lagrangian_charts(run), floor=level,
        note=note if run.magnification > 1.0 else "",
    )  # fmt: skip


def _estimates(run: LagrangianRun, t: Array) -> Array:
    """Return positions (n, nq) at which the newest estimate is drawn; NaN before the first."""
    found = np.full((len(t), run.manifold.size), np.nan)
    for i, s in enumerate(t.tolist()):
        k = run.belief(s)
        if k >= 0:
            found[i] = run.drawn(k)
    return found


def _references(run: LagrangianRun, t: Array) -> Array:
    """(n, nq) where a body should be; NaN where nothing asks for it."""
    found = np.full((len(t), run.manifold.size), np.nan)
    for i, s in enumerate(t.tolist()):
        if (reference := run.reference(s)) is not None:
            found[i] = reference
    return found


def _tip_lines(run: LagrangianRun, tip: Tip, size: float) -> list[Lines]:
    """The recent path of the tip, its velocity and the estimate of that."""
    rows = thinned_rows(len(run.t), MOST_POSES)
    places = []
    for row in rows:
        tip.put(run.log.x[row, : run.manifold.size])
        places.append(tip.place)
    layer = Layer.for_element(SceneElement.TRUE_PATH)
    path = Lines(
        layer,
        np.array(places),
        np.array([0, len(rows)]),
        layer.colour,
        3.2,
        times=run.t[rows],
        cut="past",
        trail=RECENT,
    )
    shown = thinned_rows(len(run.t_estimate), MOST_FRAMES)
    velocities = np.array([tip.velocity(run.truth[k]) for k in shown])
    scale = (TURNING if run.is_ball else ARROW) * size / max(float(np.linalg.norm(velocities, axis=1).max()), 1e-9)
    true, found = [], []
    for k, velocity in zip(shown, velocities, strict=True):
        tip.put(run.truth[k, : run.manifold.size])
        true.append(arrow(tip.origin, scale * velocity))
        state = np.concatenate([run.truth[k, : run.manifold.size], run.velocity[1][k]])
        known = run.errors.found[k] > 0.0 and np.isfinite(state).all()
        found.append(arrow(tip.origin, scale * tip.velocity(state)) if known else [])
    t, end = run.t_estimate[shown], run.duration
    return [
        path,
        *sequence(Layer.for_element(SceneElement.FOUND_VELOCITY), found, t, end, 6.5),
        *sequence(Layer.for_element(SceneElement.TRUE_VELOCITY), true, t, end, 2.6),
    ]


def _surface(run: LagrangianRun) -> Scene:
    """Truth and estimate on the globe to which an attitude's nose points, or on the sheet of a hyperboloid."""
    n, is_globe = run.manifold.size, run.space == "sphere"

    def placed(points: Array) -> Array:
        return OVER * nose(points) if is_globe else points[:, [1, 2, 0]] + np.array([0.0, 0.0, 0.004])

    rows = thinned_rows(len(run.t), MOST_POSES)
    t = run.t[rows]
    true, believed = placed(run.log.x[rows, :n]), _estimates(run, t)
    known = np.isfinite(believed).all(axis=1)
    motions = {"truth": Motion(t, true)}
    marks = [Mark("truth", TRUTH, motion="truth")]
    layer = Layer.for_element(SceneElement.TRUE_PATH)
    lines = [Lines(layer, true, np.array([0, len(t)]), layer.colour, 3.2, times=t, cut="past", trail=3.0 * RECENT)]
    if known.any():
        places = placed(believed[known])
        layer = Layer.for_element(SceneElement.ESTIMATE)
        motions["estimate"] = Motion(t[known], places)
        marks.append(Mark("estimate", ESTIMATE, motion="estimate", layer=layer))
        lines.append(
            Lines(
                layer, places, np.array([0, len(places)]), layer.colour, 2.2, times=t[known], cut="past", trail=RECENT
            )
        )
        shown = thinned_rows(len(t), MOST_FRAMES)
        ways = [run.belief(float(t[k])) for k in shown]
        shares = np.linspace(0.0, 1.0, ON_GEODESIC)
        frames = [[placed(np.array([run.towards(k, float(s)) for s in shares]))] if k >= 0 else [] for k in ways]
        lines += sequence(Layer.for_element(SceneElement.GEODESIC), frames, t[shown], run.duration, 3.0)
    if is_globe:
        angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 49)
        vertices, faces = revolved(np.cos(angle), np.sin(angle), 72)
        camera = Camera("side", (0.0, 0.0, 0.0), 4.6, azimuth(run), ELEVATION, field_of_view=30.0)
    else:
        reach = 1.3 * max(float(np.arccosh(np.maximum(run.log.x[:, 0], 1.0)).max()), 0.3)
        rho = np.linspace(0.0, reach, 33)
        vertices, faces = revolved(np.sinh(rho), np.cosh(rho), 72)
        middle = float(np.cosh(0.6 * reach))
        camera = Camera("slant", (0.0, 0.0, middle), 4.4 * float(np.sinh(reach)), 60.0, -38.0, field_of_view=30.0)
    return Scene(
        run.log.title, run.duration, [camera], motions, [Surface(vertices, faces, PAPER, glow=0.25)], lines, marks,
        lagrangian_charts(run),
    )  # fmt: skip
