"""Shot list of the video of a robot's run, and the annotations over it.

The pose of the robot is found within the first second, often within a fifth of a second: that is shown in slow motion,
however short it is, and what follows faster.
"""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from mathnavi.renders.film import TOUR, Annotation, Shot, consecutive
from mathnavi.renders.ranging.run_data import RangingRun

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
            shown.append((moment, "one is left, and its image" if run.curve.symmetry > 1 else "one is left"))
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
