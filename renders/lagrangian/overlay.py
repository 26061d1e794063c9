"""Overlay of the pictures of a Lagrangian system."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.interfaces.signals import Status
from mathnavi.renders.film import Frame
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.shot_list import amount
from mathnavi.renders.overlay import Overlay, pace
from mathnavi.renders.palette import SceneElement
from mathnavi.sim.plugin.registry import called

SUBJECTS = {
    "body": "a body on a ball joint: attitudes, S³",
    "sphere": "a point on S³, seen through the map of Hopf",
    "hyperbolic-plane": "a point on the hyperbolic plane, in Poincaré's disc",
}


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
