"""The posterior Cramér-Rao bound of a Lagrangian system, as recorded."""

from __future__ import annotations

import math

import numpy as np

from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound
from mathnavi.sim.metrics.recorded_bounds import bound_along, judged_bound

_HELD, _JACOBIANS = 0.01, 400  # [s] for which a Jacobian is used, and the largest number of Jacobians


def lagrangian_bound(recording: Recording, name: str, truth: LagrangianMission) -> PosteriorBound:
    """Bound of the components of (x, v) (2 n,) of a system as it truly is, judged by the velocity.

    No noise acts on the motion of these systems: it is the bound for an unknown start.
    """
    from mathnavi.estimators.stagewise.lagrangian import LagrangianModel
    from mathnavi.estimators.velocity.readings import rounding_steps

    n, readings = recording.length, recording.agents[name].readings.get("position")
    x = recording.truths[name]
    if readings is None:
        return PosteriorBound.none("the estimator does not read the position", n)
    if not np.isfinite(x).all():
        return PosteriorBound.none("the true state is not finite", n)
    manifold, noise = truth.system.manifold, truth.reading.noise
    rounding = float(rounding_steps(truth, x[0, : manifold.size]).max())
    if not noise > 0.0:
        return PosteriorBound.none(f"positions are read {'rounded and' if rounding else ''} without noise", n)
    if noise < 0.5 * rounding:
        return PosteriorBound.none("positions are rounded to steps of more than twice their noise", n)
    model = LagrangianModel.as_declared(truth)
    commands = recording.agents[name].commands
    inputs = [((float(h), u),) for h, u in zip(np.diff(recording.t), commands, strict=False)]
    W = math.sqrt(1.0 - truth.reading.jump) * np.eye(model.rows, model.size)
    W /= model.deviation(x[0, : manifold.size])[:, np.newaxis]
    weighted = [W if np.isfinite(row).all() else W[:0] for row in readings[:n]]
    held = max(1, round(_HELD / truth.period), math.ceil(n / _JACOBIANS))
    recursion = BoundRecursion(information=np.zeros((model.size, model.size)))
    deviation = bound_along(model, x, inputs, weighted, recursion, held=held)
    return judged_bound(deviation, tuple(range(model.rows, model.size)), "the velocity")
