"""Shot list of the video of a run, and the annotations over it.

Where the first estimate of the velocity is wrong, it is found within a second: that is shown in slow motion.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mathnavi.interfaces.signals import Status
from mathnavi.renders.film import TOUR, Annotation, Shot, consecutive
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.sim.records.figure_names import SHORTFALL

CAMERAS = ("panel", "scene")
RECENT = 1.2  # [s] of paths that are drawn strongly
AFTERWARDS, MOST_SLOW = 1.3, 0.4  # times as long as until it is found, share of the run, that is shown in slow motion
SLOW_LENGTH, LAST_MOMENT = 5.5, 1.7  # [s of video]
LENGTHS = (5.0, 11.0)  # [s of video] least and most of what is not in slow motion
CLEAR = 0.02  # [s] after the start, from which on a first estimate is annotated
ANNOTATED = {  # changes of the estimator's status
    (Status.OK, Status.LOST): "lost: no usable readings",
    (Status.LOST, Status.OK): "it has readings again",
}


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
