"""The posterior Cramér-Rao bound of a flight by position fixes, as recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound
from mathnavi.sim.metrics.recorded_bounds import judged_bound

if TYPE_CHECKING:  # the compiled kernels take a while to import
    from mathnavi.models.aerial.mission import FlightMission


def flight_bound(recording: Recording, name: str, mission: FlightMission) -> PosteriorBound:
    """Bound of position and velocity (6,) of a point mass under gusts from fixes, judged by the position.

    The model is linear, so the bound is the covariance of a Kalman filter without floors, equal on all axes.
    """
    n, fixes = recording.length, recording.agents[name].readings.get("position")
    if fixes is None:
        return PosteriorBound.none("the estimator reads no position fixes", n)
    if not mission.position_noise > 0.0:
        return PosteriorBound.none("the fixes are declared exact", n)
    from mathnavi.estimators.kalman import AxisModel, clipped_rms  # takes a while to import

    rms = clipped_rms(mission.gust)
    if not rms > 0.0:
        return PosteriorBound.none("the start is exact, no gusts are declared, and so the bound is zero", n)
    axis = AxisModel(rms, mission.gust.time_constant, mission.position_noise)
    recursion = BoundRecursion(covariance=np.diag([0.0, 0.0, rms**2]))
    W = np.array([[1.0 / mission.position_noise, 0.0, 0.0]])
    variance, discrete = np.zeros((n, 2)), dict[float, tuple[Array, Array, Array]]()
    intervals = [0.0, *(round(each, 10) for each in np.diff(recording.t[:n]).tolist())]
    fixed = np.all(np.isfinite(fixes[:n]), axis=1).tolist()
    for k, h in enumerate(intervals):
        if k:
            F, _, Q = discrete.get(h) or discrete.setdefault(h, axis.discretised(h))
            recursion.predict(F, Q)
        if fixed[k]:
            recursion.observe(W)
        now = recursion.variance
        assert now is not None
        variance[k] = now[:2]
    deviation = np.repeat(np.sqrt(np.maximum(variance, 0.0)), 3, axis=1)
    return judged_bound(deviation, (0, 1, 2), "the position")
