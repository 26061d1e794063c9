"""Fields and sensor sets that the tests of this folder share."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.observability.range_outputs import RangeOutputs
from mathnavi.models.field.curve import BEAN, EGG, Curve, ellipse

ELLIPSE = ellipse(3.763, math.sqrt(2.0))
CIRCLE = ellipse(2.0, 2.0)
CURVES = {"ellipse": ELLIPSE, "egg": EGG, "bean": BEAN}
THESIS_START = np.array([1.0, -1.0, 0.5 * math.pi])


def sensors(curve: Curve, *degrees: float) -> RangeOutputs:
    return RangeOutputs(curve, tuple(math.radians(angle) for angle in degrees))


THESIS = sensors(ELLIPSE, -90.0, -45.0)
