"""Which moment of a robot's run each frame of its video shows, from where.

Where the robot is is decided within the first second, often within a fifth of it: that is shown in slow motion, however
short it is, and what follows faster.
"""

from __future__ import annotations

import numpy as np

from mathnavi.renders.drawing import TOUR, checked_camera
from mathnavi.renders.film import Frame, Shot, frames_of
from mathnavi.renders.ranging.run_data import RangingRun

CAMERAS = ("top", "chase")
TURN = 0.0  # [degrees/s]; the camera behind the robot turns with it
SOONEST, LATEST = 0.12, 0.3  # [s] after the first estimate, share of the run, between which it is decided
AFTERWARDS = 1.25  # times as long as until it is decided is shown in slow motion
DECIDING_LENGTH, LAST_LOOK = 5.0, 1.8  # [s of video]
# Shares of the time after it was decided, cameras and lengths [s of video].
TOUR_SHOTS = ((0.16, "chase", 3.6), (0.40, "top", 3.6), (0.18, "chase", 2.6), (0.26, "top", 2.2))
TOLD = {  # changes of the estimator's status
    ("ok", "lost"): "nothing to see: going by the wheels",
    ("lost", "ok"): "it sees again",
    ("ok", "initialising"): "does not believe it: starts again",
}
FORCED_LENGTH = 11.0  # [s of video] after it was decided, where one camera films everything


def begun(run: RangingRun) -> float:
    """[s] the first estimate that says where the robot is; the end of the run if there is none."""
    said = run.beliefs.t[run.said]
    return float(said[0]) if len(said) else run.duration


def decided(run: RangingRun) -> float:
    """[s] when all hypotheses that are left are the same, or without any when it found itself."""
    first = begun(run)
    moment = run.found if run.beliefs.left is None else _agreed(run)
    latest = max(LATEST * run.duration, first)
    return float(np.clip(latest if moment is None else moment, min(first + SOONEST, latest), latest))


def _agreed(run: RangingRun) -> float | None:
    """[s] when the hypotheses first agreed; None if they never did."""
    times = run.beliefs.t[run.agreed]
    return float(times[0]) if len(times) else None


def highlight(run: RangingRun) -> tuple[float, float]:
    """Between which times [s] there is most to see: while more than half of the hypotheses are left."""
    first, left = begun(run), run.beliefs.left
    if left is None or not left.any():
        return first, decided(run)
    many = float(run.beliefs.t[np.flatnonzero(left > 0.5 * left.max())[-1]])
    return first, max(many, first)


def verdict(run: RangingRun) -> str:
    """How it ended."""
    if run.log.summary.get("touched_wall"):
        return "touched the wall"
    rms = run.log.summary.get("position_rms_m")
    told = "" if rms is None else f": {length(float(rms))} off"
    return f"{'found itself' if run.log.summary.get('converged') else 'did not find itself'}{told}"


def length(metres: float) -> str:
    """To be read."""
    return (
        f"{1e3 * metres:.1f} mm" if metres < 0.01 else f"{1e2 * metres:.1f} cm" if metres < 1.0 else f"{metres:.1f} m"
    )


def notices(run: RangingRun) -> list[tuple[float, str]]:
    """(time [s], text) of what a viewer should be told, in order of time."""
    told = [(run.duration, verdict(run))]
    left = run.beliefs.left
    if left is not None and left.any():
        first = int(np.flatnonzero(left)[0])
        told.append((float(run.beliefs.t[first]), f"{left[first]} poses explain what it sees"))
        if (moment := _agreed(run)) is not None:
            told.append((moment, "one is left, and its image" if run.curve.symmetry > 1 else "one is left"))
    elif run.found is not None:
        told.append((run.found, "found itself"))
    changes = [event for event in run.log.events if event.kind == "estimator-status"]
    names = [event.message.partition(":")[0] for event in changes]
    for event, then, now in zip(changes[1:], names, names[1:], strict=False):
        if (then, now) in TOLD:
            told.append((event.t, TOLD[then, now]))
    return sorted(told)


def shots(run: RangingRun, direction: str = TOUR) -> list[Shot]:
    """The shots of the video of a run, in order; they cover the whole run."""
    end = run.duration
    slow = min(AFTERWARDS * decided(run), end)
    if direction != TOUR:
        camera = checked_camera(direction, CAMERAS)
        cuts = ((0.0, slow, DECIDING_LENGTH), (slow, end, FORCED_LENGTH), (end, end, LAST_LOOK))
        return [Shot(camera, *cut) for cut in cuts]
    film, begin = [Shot("top", 0.0, slow, DECIDING_LENGTH)], slow
    for share, camera, length in TOUR_SHOTS:
        finish = begin + share * (end - slow)
        film.append(Shot(camera, begin, finish, length))
        begin = finish
    return [*film, Shot("top", begin, end, LAST_LOOK)]


def storyboard(run: RangingRun, direction: str = TOUR, fps: int = 24) -> list[Frame]:
    """The frames of the video of a run, 1/fps seconds apart."""
    return frames_of(shots(run, direction), notices(run), fps, TURN)
