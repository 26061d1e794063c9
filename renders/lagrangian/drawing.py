"""Drawing of mechanisms and points on curved spaces, with their velocity observers (``mathnavi.renders.drawing``).

Where the first estimate of the velocity is wrong, it is found within a second: that is shown in slow motion. A picture
is of the scene, and next to it the panel of its velocity.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from mathnavi.interfaces.signals import Status
from mathnavi.renders.drawing import Drawing, Painter
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, consecutive
from mathnavi.renders.lagrangian.chart_scene import ChartScene
from mathnavi.renders.lagrangian.panel import VelocityPanel
from mathnavi.renders.lagrangian.run_data import LagrangianRun, load_run
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.palette import Picture, SceneElement
from mathnavi.sim.plugin.registry import called
from mathnavi.sim.records.figure_names import SHORTFALL

CAMERAS = ("panel", "scene")
AFTERWARDS, MOST_SLOW = 1.3, 0.4  # times as long as until it is found, share of the run, that is shown in slow motion
SLOW_LENGTH, LAST_MOMENT = 5.5, 1.7  # [s of video]
LENGTHS = (5.0, 11.0)  # [s of video] least and most of what is not in slow motion
CLEAR = 0.02  # [s] after the start, from which on a first estimate is annotated
ANNOTATED = {  # changes of the estimator's status
    (Status.OK, Status.LOST): "lost: no usable readings",
    (Status.LOST, Status.OK): "it has readings again",
    (Status.LOST, Status.DEGRADED): "it has readings again",
}
SUBJECTS = {
    "body": "a body on a ball joint: attitudes, S³",
    "sphere": "a point on S³, seen through the map of Hopf",
    "hyperbolic-plane": "a point on the hyperbolic plane, in Poincaré's disc",
}
PANEL = 0.375  # of the width of a picture


def slow_until(run: LagrangianRun) -> float:
    """Return the time [s] at which the slow motion ends; 0 without slow motion."""
    if not run.has_begun_wrong:
        return 0.0
    longest = MOST_SLOW * run.duration
    return longest if run.found_from is None else min(AFTERWARDS * run.found_from, longest)


def highlight(run: LagrangianRun) -> tuple[float, float]:
    """Return times [s] between which there is most to see: while the velocity is found; else the middle of the run."""
    if not run.has_begun_wrong:
        return 0.4 * run.duration, 0.6 * run.duration
    return 0.0, 0.6 * slow_until(run)


def is_good(run: LagrangianRun) -> bool:
    """True if the run fulfilled its requirements."""
    return SHORTFALL not in run.log.summary


def amount(value: float) -> str:
    """A number with the digits that a viewer can use."""
    if value == 0.0:
        return "0"
    return f"{value:#.2g}" if 1e-4 <= value < 10.0 else f"{value:.1f}" if 10.0 <= value < 1e4 else f"{value:.1e}"


def verdict(run: LagrangianRun) -> str:
    """Return the outcome of the run in a few words."""
    if run.diverged:
        return f"the motion diverged after {run.duration:.3g} s"
    rms = run.log.summary.get("velocity_rms")
    error = "" if rms is None else f": {amount(float(rms))} {run.unit} off"
    found = rms is not None and float(rms) <= run.tolerance
    return f"{'velocity found' if found else 'velocity not found'}{error}"


def annotations_of(run: LagrangianRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time; of each change of status only the first."""
    shown = [(run.duration, verdict(run))]
    known = run.t_estimate[run.errors.found > 0.0]
    if not len(known):
        shown.append((0.0, "no usable reading yet"))
    elif float(known[0]) > CLEAR:
        shown.append((float(known[0]), "first estimate"))
    if run.has_begun_wrong and run.found_from is not None:
        shown.append((run.found_from, "velocity found to one percent"))
    if "settled_at_s" in run.log.summary:
        settled = run.log.summary["settled_at_s"]
        is_on_it = settled is not None
        shown.append((settled if is_on_it else run.duration, f"{'' if is_on_it else 'not '}settled on the reference"))
    times = [event.t for event in run.log.events if event.kind == "estimator-status"]
    changes: dict[str, float] = {}
    for before, t in pairwise(times):
        if text := ANNOTATED.get((run.log.status(before), run.log.status(t))):
            changes.setdefault(text, t)
    return sorted([*shown, *((t, text) for text, t in changes.items())])


def shot_list(run: LagrangianRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole run."""
    camera = CAMERAS[0] if direction == TOUR else direction
    slow, end = slow_until(run), run.duration
    length = float(np.clip(end - slow, *LENGTHS))
    beginning = consecutive((0.0, slow), [(camera, SLOW_LENGTH)]) if slow > 0.0 else []
    return [*beginning, *consecutive((slow, end, end), ((camera, length), (camera, LAST_MOMENT)))]


def subject(run: LagrangianRun) -> str:
    """The moving system in a few words."""
    if run.space is not None:
        return SUBJECTS[run.space]
    joints = run.manifold.dimension
    return f"{str(run.mechanism).rpartition('/')[2]}: {joints} degree{'s' if joints > 1 else ''} of freedom"


def overlay(run: LagrangianRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    config, k = run.log.config, run.belief(frame.t)
    estimator = called("estimators", str(config["estimator"]["name"])).rpartition(":")[2].replace("_", " ")
    speed = float(np.linalg.norm(run.log.x[run.index(frame.t), run.manifold.size :]))
    found, error, place, note = "", "–", "–", ""
    if k >= 0 and math.isfinite(run.velocity_error[k]):
        found = f"estimated {float(np.linalg.norm(run.velocity[1][k])):.2f}"
        error = amount(float(run.velocity_error[k]))
        place = distance(run, k)
        note = f"drawn ×{run.magnification:,.0f}" if run.magnification > 1.0 else ""
    return Overlay(
        title=[f"mathnavi · {config['scenario']} · {estimator} · seed {config['seed']}", subject(run)],
        numbers=(
            ("TIME", f"{frame.t:.2f} s", pace(frame, run.duration)),
            (f"VELOCITY OFF BY [{run.unit}]", error, ""),
            (f"SPEED [{run.unit}]", f"{speed:.2f}", found),
            ("POSITION OFF BY", place, note),
        ),
        state=_state(run, frame.t, k),
        legend=_legend(run, frame.camera),
    )


def distance(run: LagrangianRun, k: int) -> str:
    """Position error of estimate k as text: the largest of its coordinates about the truth."""
    apart = run.apart(k)
    if apart is None:
        return "half a turn"
    apart = np.abs(apart)
    most = int(np.argmax(apart))
    largest = float(apart[most])
    if run.mechanism is None:
        return f"{largest:.4f}"
    if run.manifold.size == run.manifold.dimension and run.states[most].endswith("[m]"):
        return f"{1e6 * largest:.0f} µm" if largest < 1e-3 else f"{1e3 * largest:.0f} mm"
    degrees = math.degrees(largest)
    return f"{degrees:.2f}°" if degrees >= 0.01 else f"{1e6 * largest:.0f} µrad"


def _state(run: LagrangianRun, t: float, k: int) -> str:
    if k < 0:
        return "waiting for a reading"
    if run.log.status(t) is Status.LOST:
        return "lost: no usable readings"
    return "velocity known" if run.velocity_error[k] <= run.tolerance else "finding the velocity"


def _legend(run: LagrangianRun, camera: str) -> list[SceneElement]:
    """Elements that the picture shows."""
    reference = [SceneElement.REFERENCE] if run.reference(run.duration) is not None else []
    if run.mechanism is None:
        return [SceneElement.TRUE_PATH, SceneElement.ESTIMATE, SceneElement.GEODESIC]
    geodesic = [SceneElement.GEODESIC] if run.space == "body" and camera == "panel" else []
    return [
        SceneElement.TRUE_PATH,
        SceneElement.ESTIMATE,
        *reference,
        *geodesic,
        SceneElement.TRUE_VELOCITY,
        SceneElement.FOUND_VELOCITY,
    ]


MECHANISM = SceneDrawing("mathnavi.renders.lagrangian.scene:MechanismScene", overlay, annotations_of)
POINT = SceneDrawing(ChartScene, overlay, annotations_of)


@dataclass(frozen=True, eq=False)
class LagrangianPainter:
    """Opens what a camera needs when its first frame is drawn."""

    run: LagrangianRun
    width: int
    height: int
    samples: int
    stack: ExitStack

    def paint(self, frame: Frame) -> Picture:
        """Draw the picture (height, width, 3)."""
        if frame.camera == "scene":
            return self._whole.paint(frame)
        return np.hstack([self._beside.paint(frame), self._panel.picture(frame.t)])

    @cached_property
    def _panel_width(self) -> int:
        return round(PANEL * self.width)

    @cached_property
    def _panel(self) -> VelocityPanel:
        return VelocityPanel(self.run, self._panel_width, self.height)

    @cached_property
    def _beside(self) -> Painter:
        return self._open(self.width - self._panel_width)

    @cached_property
    def _whole(self) -> Painter:
        return self._open(self.width)

    def _open(self, width: int) -> Painter:
        scene = POINT if self.run.mechanism is None else MECHANISM
        return self.stack.enter_context(scene(self.run, width, self.height, self.samples))


@contextmanager
def painting(run: LagrangianRun, width: int, height: int, samples: int) -> Iterator[LagrangianPainter]:
    """Return a painter of pictures of a size in pixels; OpenGL's backend must have been chosen."""
    with ExitStack() as stack:
        yield LagrangianPainter(run, width, height, samples, stack)


drawing = Drawing(
    cameras=CAMERAS,
    still_camera=CAMERAS[0],
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=painting,
    report="mathnavi.renders.lagrangian.report:report",
    web="mathnavi.renders.lagrangian.web:web_scene",
    figure="mathnavi.renders.lagrangian.report:velocity_figure",
)
