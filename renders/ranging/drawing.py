"""Drawing of robots that localise themselves by ranges (``mathnavi.renders.drawing``): shots, annotations, overlay.

The pose of the robot is found within the first second, often within a fifth of a second: that is shown in slow motion,
however short it is; the rest is shown faster.
"""

from __future__ import annotations

import math
from itertools import accumulate

import numpy as np

from mathnavi.interfaces.signals import Status
from mathnavi.renders.drawing import Drawing
from mathnavi.renders.film import TOUR, Annotation, Frame, Shot, consecutive
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.painter import SceneDrawing
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.ranging.run_data import RangingRun, load_run
from mathnavi.sim.plugin.registry import called

CAMERAS = ("top", "chase")
TURN = 0.0  # [degrees/s]; the camera behind the robot turns with it
SOONEST, LATEST = 0.12, 0.3  # [s] after the first estimate, share of the run, between which it is decided
AFTERWARDS = 1.25  # times as long as until it is decided is shown in slow motion
DECIDING_LENGTH, LAST_MOMENT = 5.0, 1.8  # [s of video]
# Shares of the time after it was decided, cameras and lengths [s of video].
TOUR_SHOTS = ((0.16, "chase", 3.6), (0.40, "top", 3.6), (0.18, "chase", 2.6), (0.26, "top", 2.2))
ANNOTATED = {  # changes of the estimator's status
    ("ok", "lost"): "nothing to see: going by the wheels",
    ("lost", "ok"): "it sees again",
    ("lost", "degraded"): "it sees again",
    ("ok", "initialising"): "does not believe it: starts again",
}
FORCED_LENGTH = 11.0  # [s of video] after it was decided, where one camera films everything


def begun(run: RangingRun) -> float:
    """Return the time [s] of the first estimate of the robot's pose; the end of the run without one."""
    known = run.beliefs.t[run.initialised]
    return float(known[0]) if len(known) else run.duration


def decided(run: RangingRun) -> float:
    """Time [s] at which all hypotheses that are left are the same, or without any when it found itself."""
    first = begun(run)
    moment = run.found if run.beliefs.left is None else _agreed(run)
    latest = max(LATEST * run.duration, first)
    return float(np.clip(latest if moment is None else moment, min(first + SOONEST, latest), latest))


def _agreed(run: RangingRun) -> float | None:
    """Time [s] at which the hypotheses first agreed; None if they never did."""
    times = run.beliefs.t[run.agreed]
    return float(times[0]) if len(times) else None


def highlight(run: RangingRun) -> tuple[float, float]:
    """Return the times [s] between which there is most to see: while more than half of the hypotheses are left."""
    first, left = begun(run), run.beliefs.left
    if left is None or not left.any():
        return first, decided(run)
    many = float(run.beliefs.t[np.flatnonzero(left > 0.5 * left.max())[-1]])
    return first, max(many, first)


def verdict(run: RangingRun) -> str:
    """Return the outcome of the run in a few words."""
    if run.log.summary.get("touched_wall"):
        return "touched the wall"
    rms = run.log.summary.get("position_rms_m")
    error = "" if rms is None else f": {length(float(rms))} off"
    return f"{'found itself' if run.log.summary.get('converged') else 'did not find itself'}{error}"


def length(metres: float) -> str:
    """A length [m] with the digits and the unit that a viewer can use."""
    return (
        f"{1e3 * metres:.1f} mm" if metres < 0.01 else f"{1e2 * metres:.1f} cm" if metres < 1.0 else f"{metres:.1f} m"
    )


def annotations_of(run: RangingRun) -> list[Annotation]:
    """Return the annotations of a video, in order of time."""
    shown = [(run.duration, verdict(run))]
    left = run.beliefs.left
    if left is not None and left.any():
        first = int(np.flatnonzero(left)[0])
        shown.append((float(run.beliefs.t[first]), f"{left[first]} poses explain what it sees"))
        if (moment := _agreed(run)) is not None:
            shown.append((moment, "one is left, and its image" if run.symmetry > 1 else "one is left"))
    elif run.found is not None:
        shown.append((run.found, "found itself"))
    changes = [event for event in run.log.events if event.kind == "estimator-status"]
    names = [event.message.partition(":")[0] for event in changes]
    for event, then, now in zip(changes[1:], names, names[1:], strict=False):
        if (then, now) in ANNOTATED:
            shown.append((event.t, ANNOTATED[then, now]))
    return sorted(shown)


def shot_list(run: RangingRun, direction: str = TOUR) -> list[Shot]:
    """Return the shots of a video by one of the cameras or of the tour, in order; they cover the whole run."""
    end = run.duration
    slow = min(AFTERWARDS * decided(run), end)
    if direction != TOUR:
        lengths = (DECIDING_LENGTH, FORCED_LENGTH, LAST_MOMENT)
        return consecutive((0.0, slow, end, end), [(direction, length) for length in lengths])
    cuts = (0.0, *accumulate((share * (end - slow) for share, _, _ in TOUR_SHOTS), initial=slow))
    way = ((camera, length) for _, camera, length in TOUR_SHOTS)
    last = Shot("top", cuts[-1], end, LAST_MOMENT)
    return [*consecutive(cuts, (("top", DECIDING_LENGTH), *way)), last]


def overlay(run: RangingRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    config, k = run.log.config, run.belief(frame.t)
    named = config.get("estimator", {}).get("name", "no estimator named")
    estimator = called("estimators", named).rpartition(":")[2].replace("_", " ")
    count, seen = (run.mission.sensors, "range sensor") if run.reads_walls else (len(run.beacons), "beacon")
    title = [
        f"mathnavi · {config['scenario']} · {estimator} · seed {config['seed']}",
        f"{run.curve.name} · {count} {seen}{'s' if count > 1 else ''} · {run.drive} drive",
    ]
    if run.symmetry != 1:
        title.append("errors modulo the symmetry of the wall")
    place, heading, place_note, heading_note = "–", "–", "", ""
    if k >= 0:
        place, heading = length(float(run.position_error[k])), f"{math.degrees(run.heading_error[k]):.1f}°"
        if run.deviation is not None and math.isfinite(run.deviation[0][k]):
            metres, radians = (3.0 * float(values[k]) for values in run.deviation)
            place_note, heading_note = f"3σ {length(metres)}", f"3σ {math.degrees(radians):.1f}°"
    return Overlay(
        title=title,
        numbers=(
            ("TIME", f"{frame.t:.2f} s", pace(frame, run.duration)),
            ("POSITION OFF BY", place, place_note),
            ("HEADING OFF BY", heading, heading_note),
        ),
        state=_state(run, frame.t, k),
        legend=_legend(run),
    )


def _state(run: RangingRun, t: float, k: int) -> str:
    status = run.status(t)
    if k < 0:
        return "not knowing where it is"
    if status is Status.LOST:
        return "sees nothing"
    if run.beliefs.left is None:
        return "estimating"
    left = int(run.beliefs.left[k])
    return f"{left} hypothes{'i' if left == 1 else 'e'}s left"


def _legend(run: RangingRun) -> list[SceneElement]:
    """Elements that pictures of this run show."""
    beliefs = run.beliefs
    return [
        SceneElement.DRIVEN,
        *([SceneElement.RAY] if run.reads_walls or len(run.beacons) else []),
        *([SceneElement.LOST_RAY] if run.reads_walls and np.isnan(run.ranges).any() else []),
        *([SceneElement.BEACON] if len(run.beacons) else []),
        SceneElement.ESTIMATE,
        *([SceneElement.SPREAD] if beliefs.covariance is not None else []),
        *([SceneElement.HYPOTHESIS] if beliefs.hypotheses is not None else []),
        *([SceneElement.BELIEVED] if beliefs.z is not None else []),
        *([SceneElement.IMAGE] if run.symmetry > 1 else []),
    ]


drawing = Drawing(
    cameras=CAMERAS,
    still_camera="top",
    load_run=load_run,
    shot_list=shot_list,
    highlight=highlight,
    annotations=annotations_of,
    painter=SceneDrawing("mathnavi.renders.ranging.scene:RangingScene", overlay, annotations_of),
    report="mathnavi.renders.ranging.report:report",
    web="mathnavi.renders.ranging.web:web_scene",
    figure="mathnavi.renders.ranging.field_figure:field_figure",
    turn=TURN,
)
