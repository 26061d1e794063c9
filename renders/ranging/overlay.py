"""Overlay of the pictures of a robot that localises itself."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.signals import Status
from mathnavi.renders.film import Frame
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.palette import SceneElement
from mathnavi.renders.ranging.run_data import RangingRun
from mathnavi.renders.ranging.shot_list import length
from mathnavi.sim.plugin.registry import called


def overlay(run: RangingRun, frame: Frame) -> Overlay:
    """Return the overlay of a frame."""
    config, k = run.log.config, run.belief(frame.t)
    named = config.get("estimator", {}).get("name", "no estimator named")
    estimator = called("estimators", named).rpartition(":")[2].replace("_", " ")
    l = run.mission.sensors  # noqa: E741
    title = [
        f"mathnavi · {config['scenario']} · {estimator} · seed {config['seed']}",
        f"{run.curve.name} · {l} range sensor{'s' if l > 1 else ''} · {run.drive} drive",
    ]
    if run.curve.symmetry != 1:
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
        SceneElement.RAY,
        *([SceneElement.LOST_RAY] if np.isnan(run.ranges).any() else []),
        SceneElement.ESTIMATE,
        *([SceneElement.SPREAD] if beliefs.covariance is not None else []),
        *([SceneElement.HYPOTHESIS] if beliefs.hypotheses is not None else []),
        *([SceneElement.BELIEVED] if beliefs.z is not None else []),
        *([SceneElement.IMAGE] if run.curve.symmetry > 1 else []),
    ]
