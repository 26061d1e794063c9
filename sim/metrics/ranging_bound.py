"""The posterior Cramér-Rao bound of a robot with range sensors, as recorded."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.estimators.stagewise.model import StagewiseModel
from mathnavi.interfaces.signals import Array
from mathnavi.models.unicycle.kernels import sinc, wrapped
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound
from mathnavi.sim.metrics.recorded_bounds import bound_along, judged_bound


def ranging_bound(recording: Recording, name: str, mission: RangingMission) -> PosteriorBound:
    """Bound of a robot's pose (x_1, x_2, phi), judged by the position.

    If the start is not known, the information about it is zero. The inputs are the robot's true ones.
    """
    from mathnavi.estimators.stagewise.ranging import RangingModel  # compiled kernels take a while to import

    n, readings = recording.length, recording.agents[name].readings.get("ranges")
    ranging, bias = mission.ranging, mission.odometry.bias
    if readings is None:
        return PosteriorBound.none("there are no ranges", n)
    if not (ranging.relative > 0.0 or ranging.absolute > 0.0):
        return PosteriorBound.none("the ranges are declared exact", n)
    if mission.curve.symmetry == 0:
        return PosteriorBound.none("in a circle the pose is not observable", n)
    model = RangingModel(mission)
    x = np.column_stack([recording.truths[name][:, :3], np.zeros(n)])
    steps = zip(x[:-1], x[1:], np.diff(recording.t).tolist(), strict=True)
    inputs = [((h, _driven(before, after, h)),) for before, after, h in steps]
    weighted = [_of_ranges(model, *row, ranging.outliers) for row in zip(x, readings[:n], strict=True)]
    kept = (0, 1, 2, 3) if bias > 0.0 else (0, 1, 2)
    if mission.start is None:
        J = np.zeros((4, 4))
        J[3, 3] = 1.0 / bias**2 if bias > 0.0 else 0.0
        recursion = BoundRecursion(information=J[np.ix_(kept, kept)])
    else:
        recursion = BoundRecursion(covariance=model.start(None)[1][np.ix_(kept, kept)])
    return judged_bound(bound_along(model, x, inputs, weighted, recursion, kept=kept)[:, :3], (0, 1), "the position")


def _driven(before: Array, after: Array, h: float) -> Array:
    """Input (2,) [m/s, rad/s] that leads a unicycle from one pose to another in h [s], along the chord."""
    turned = wrapped(after[2] - before[2])
    direction = before[2] + 0.5 * turned
    chord = (after[0] - before[0]) * math.cos(direction) + (after[1] - before[1]) * math.sin(direction)
    return np.array([chord / (h * sinc(0.5 * turned)), turned / h])


def _of_ranges(model: StagewiseModel, x: Array, rho: Array, outliers: float) -> Array:
    """Matrix W (m, 4) of the rays that were read, with the information in the dependence of their variance on the
    range.
    """
    from mathnavi.estimators.stagewise.ranging import RangingModel

    assert isinstance(model, RangingModel)
    _, W = model.residual(x, rho)
    _, slope = model.deviations(x)
    read = np.isfinite(rho) & np.isfinite(W).all(axis=1)
    weighted: Array = (np.sqrt((1.0 - outliers) * (1.0 + 2.0 * np.square(slope)))[:, np.newaxis] * W)[read]
    return weighted
