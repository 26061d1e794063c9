"""Colours of the elements, the same in videos, figures and reports, and the type of a picture."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from mathnavi.models.aerial.plan_status import FlightPhase

Picture = NDArray[np.uint8]  # (height, width, 3) red, green, blue; row 0 on top
Colour = tuple[float, float, float]  # red, green, blue in [0, 1]


class SceneElement(Enum):
    """Element of a scene, a line or a mark; the value is its name in a legend."""

    FLOWN = "flown"
    PATH = "path"
    OPTIMISED = "optimised plan"
    MANOEUVRE = "safety manoeuvre"
    COMPLETION = "completion path"
    RADAR = "radar"
    START = "start"
    TARGET = "target"
    PLAN = "plan ahead"
    FORCE = "force of the thrusters"
    VELOCITY = "velocity of the target"
    DRIVEN = "path driven"
    ESTIMATE = "estimate"
    SPREAD = "1σ and 3σ of it"
    HYPOTHESIS = "hypotheses"
    BELIEVED = "ends of rays, as believed"
    RAY = "rays and readings"
    LOST_RAY = "lost ray"
    BEACON = "beacon"
    IMAGE = "indistinguishable pose"
    TARGET_PATH = "path of the target"
    TRUE_PATH = "truth"
    TRUE_VELOCITY = "velocity"
    FOUND_VELOCITY = "velocity, estimated"
    REFERENCE = "reference"
    GEODESIC = "geodesic to the estimate"


COLOURS: dict[SceneElement, Colour] = {
    SceneElement.FLOWN: (1.00, 0.50, 0.05),
    SceneElement.PATH: (1.00, 0.50, 0.05),
    SceneElement.OPTIMISED: (0.05, 0.42, 0.95),
    SceneElement.MANOEUVRE: (0.86, 0.10, 0.72),
    SceneElement.COMPLETION: (0.10, 0.78, 0.48),
    SceneElement.RADAR: (0.85, 0.05, 0.15),
    SceneElement.START: (0.98, 0.98, 0.98),
    SceneElement.TARGET: (1.00, 0.85, 0.05),
    SceneElement.PLAN: (0.05, 0.42, 0.95),
    SceneElement.FORCE: (0.10, 0.78, 0.48),
    SceneElement.VELOCITY: (0.86, 0.10, 0.72),
    SceneElement.DRIVEN: (1.00, 0.50, 0.05),
    SceneElement.ESTIMATE: (0.05, 0.42, 0.95),
    SceneElement.SPREAD: (0.05, 0.42, 0.95),
    SceneElement.BEACON: (0.93, 0.68, 0.10),
    SceneElement.HYPOTHESIS: (0.86, 0.10, 0.72),
    SceneElement.BELIEVED: (0.05, 0.42, 0.95),
    SceneElement.RAY: (0.02, 0.58, 0.47),
    SceneElement.LOST_RAY: (0.52, 0.57, 0.63),
    SceneElement.IMAGE: (0.42, 0.48, 0.55),
    SceneElement.TARGET_PATH: (1.00, 0.85, 0.05),
    SceneElement.TRUE_PATH: (1.00, 0.50, 0.05),
    SceneElement.TRUE_VELOCITY: (1.00, 0.50, 0.05),
    SceneElement.FOUND_VELOCITY: (0.05, 0.42, 0.95),
    SceneElement.REFERENCE: (0.10, 0.78, 0.48),
    SceneElement.GEODESIC: (0.86, 0.10, 0.72),
}


# Of the vehicles of a fleet, in their order: distinguishable over snow and rock, on white and on black.
VEHICLES: tuple[Colour, ...] = (
    (1.00, 0.50, 0.05),
    (0.10, 0.45, 1.00),
    (0.90, 0.10, 0.75),
    (0.98, 0.80, 0.00),
    (0.00, 0.78, 0.92),
    (0.90, 0.08, 0.12),
    (0.40, 0.85, 0.10),
    (0.50, 0.20, 0.88),
    (1.00, 0.60, 0.75),
    (0.00, 0.55, 0.50),
    (0.60, 0.25, 0.05),
    (0.70, 0.70, 1.00),
    (0.15, 0.20, 0.62),
    (0.62, 0.05, 0.35),
    (0.55, 0.98, 0.75),
    (0.40, 0.44, 0.50),
)


def vehicle_colour(k: int) -> Colour:
    """Colour of the k-th vehicle of a fleet; colours repeat after sixteen."""
    return VEHICLES[k % len(VEHICLES)]


def part_of(phase: int) -> SceneElement:
    """The part of a plan that an arc of this phase belongs to."""
    return {FlightPhase.OPTIMISED: SceneElement.OPTIMISED, FlightPhase.MANOEUVRE: SceneElement.MANOEUVRE}.get(
        FlightPhase(phase), SceneElement.COMPLETION
    )


def hexadecimal(colour: Colour) -> str:
    """#rrggbb."""
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in colour)
