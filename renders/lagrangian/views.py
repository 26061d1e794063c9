"""Direction from which a run of a Lagrangian system is seen, and the chart of its space."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.models.manifold.attitude import product
from mathnavi.renders.lagrangian.charts import Disc, Globe, MapProjection
from mathnavi.renders.lagrangian.run_data import LagrangianRun

INCHES_HIGH = 7.2  # of a picture that matplotlib draws, whatever its pixels
AZIMUTH, ELEVATION = 62.0, -14.0  # [degrees] of the line of sight
RECENT = 1.2  # [s] of paths that are drawn strongly
BESIDE = 118.0  # [degrees] from the axis about which a body turns to that line: a little towards the camera


def azimuth(run: LagrangianRun) -> float:
    """Return the azimuth [degrees] of the line of sight, next to the axis about which a body turns when fastest."""
    if run.space != "body":
        return AZIMUTH
    fastest = run.log.x[int(np.argmax(np.linalg.norm(run.log.x[:, 4:], axis=1)))]
    q, omega = fastest[:4], np.concatenate([[0.0], fastest[4:]])
    axis = product(product(q, omega), q * (1.0, -1.0, -1.0, -1.0))[1:]
    return math.degrees(math.atan2(axis[1], axis[0])) + BESIDE


def chart_of(run: LagrangianRun) -> MapProjection | None:
    """None for a mechanism, the configurations of which have no picture but itself."""
    if run.space == "hyperbolic-plane":
        return Disc(run.log.x[:, : run.manifold.size])
    return None if run.space is None else Globe(azimuth(run), ELEVATION)
