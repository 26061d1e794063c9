"""One colour for each thing, the same in videos, figures and reports, and what a picture is."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from sim.signals import Phase

Picture = NDArray[np.uint8]  # (height, width, 3) red, green, blue; row 0 on top
Colour = tuple[float, float, float]  # red, green, blue in [0, 1]


class Part(Enum):
    """What a line or a mark stands for; the value is its name in a legend."""

    FLOWN = "flown"
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
    IMAGE = "indistinguishable pose"
    TARGET_PATH = "path of the target"
    TRUE_PATH = "truth"
    TRUE_VELOCITY = "velocity"
    FOUND_VELOCITY = "velocity, estimated"
    REFERENCE = "reference"
    GEODESIC = "geodesic to the estimate"


COLOURS: dict[Part, Colour] = {
    Part.FLOWN: (1.00, 0.50, 0.05),
    Part.OPTIMISED: (0.05, 0.42, 0.95),
    Part.MANOEUVRE: (0.86, 0.10, 0.72),
    Part.COMPLETION: (0.10, 0.78, 0.48),
    Part.RADAR: (0.85, 0.05, 0.15),
    Part.START: (0.98, 0.98, 0.98),
    Part.TARGET: (1.00, 0.85, 0.05),
    Part.PLAN: (0.05, 0.42, 0.95),
    Part.FORCE: (0.10, 0.78, 0.48),
    Part.VELOCITY: (0.86, 0.10, 0.72),
    Part.DRIVEN: (1.00, 0.50, 0.05),
    Part.ESTIMATE: (0.05, 0.42, 0.95),
    Part.SPREAD: (0.05, 0.42, 0.95),
    Part.HYPOTHESIS: (0.86, 0.10, 0.72),
    Part.BELIEVED: (0.05, 0.42, 0.95),
    Part.RAY: (0.02, 0.58, 0.47),
    Part.LOST_RAY: (0.52, 0.57, 0.63),
    Part.IMAGE: (0.42, 0.48, 0.55),
    Part.TARGET_PATH: (1.00, 0.85, 0.05),
    Part.TRUE_PATH: (1.00, 0.50, 0.05),
    Part.TRUE_VELOCITY: (1.00, 0.50, 0.05),
    Part.FOUND_VELOCITY: (0.05, 0.42, 0.95),
    Part.REFERENCE: (0.10, 0.78, 0.48),
    Part.GEODESIC: (0.86, 0.10, 0.72),
}


# Of the vehicles of a fleet, in their order: to be told apart over snow and rock, on white and on black.
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
    """Of the k-th vehicle of a fleet; they repeat after sixteen."""
    return VEHICLES[k % len(VEHICLES)]


def part_of(phase: int) -> Part:
    """The part of a plan that an arc of this phase belongs to."""
    return {Phase.OPTIMISED: Part.OPTIMISED, Phase.MANOEUVRE: Part.MANOEUVRE}.get(Phase(phase), Part.COMPLETION)


def hexadecimal(colour: Colour) -> str:
    """#rrggbb."""
    return "#" + "".join(f"{round(255 * channel):02x}" for channel in colour)
