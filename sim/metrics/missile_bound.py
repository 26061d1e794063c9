"""The posterior Cramér-Rao bound of a missile, as recorded."""

from __future__ import annotations

import numpy as np

from mathnavi.estimators.stagewise.model import StagewiseModel
from mathnavi.interfaces.signals import Array
from mathnavi.models.missile.mission import MissileMission
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound
from mathnavi.sim.metrics.recorded_bounds import bound_along, judged_bound


def missile_bound(recording: Recording, name: str, mission: MissileMission) -> PosteriorBound:
    """Bound of the thesis' state (nx,) under the declared gusts, judged by the position.

    The gusts that acted are not recorded: the Jacobians are those without gusts.
    """
    n, readings = recording.length, recording.agents[name].readings.get("full_state")
    coordinates = mission.coordinates
    if readings is None:
        return PosteriorBound.none("the estimator does not read the state", n)
    if not (mission.noise.deviations(coordinates) > 0.0).all():
        return PosteriorBound.none("some part of the state is declared to be read exactly", n)
    if not mission.gust.force > 0.0 and not mission.gust.moment > 0.0:
        return PosteriorBound.none("the start is exact, no gusts are declared, and so the bound is zero", n)
    from mathnavi.estimators.stagewise.missile import MissileModel  # CasADi takes a while to import

    model = MissileModel.as_declared(mission)
    x = np.column_stack([coordinates.from_joints(recording.truths[name]), np.zeros((n, coordinates.input_size))])
    commands, t = recording.agents[name].commands, recording.t
    inputs = [model.inputs(float(t[k]), float(t[k + 1]), (), commands[k]) for k in range(n - 1)]
    weighted = [_of_state(model, *row) for row in zip(x, readings[:n], strict=True)]
    start = model.start(None)
    deviation = bound_along(model, x, inputs, weighted, BoundRecursion(covariance=start[1]))
    judged = tuple(k for k, state in enumerate(coordinates.states) if state in ("x_e", "y_e", "z_e"))
    return judged_bound(deviation[:, : coordinates.state_size], judged, "the position")


def _of_state(model: StagewiseModel, x: Array, y: Array) -> Array:
    r, W = model.residual(x, y)
    return W[np.isfinite(r)]
