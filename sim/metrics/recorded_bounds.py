"""The posterior Cramér-Rao bound of a recorded run: ranges, a flight by fixes, a missile, a Lagrangian system.

The noise is what the mission declares, without the floors and the reserves that estimators add. A reading counts at the
sample by which it has come. Where readings may be outliers, of the fraction epsilon, their information is 1 - epsilon
times that of good ones, which is at least what a mixture has, so that the bound stays one.

Without process noise the recursion is the Cramér-Rao bound of the start as a parameter, which falls as long as there
are readings; where the start is exact besides, it is zero and says nothing. A bound needs a likelihood that is smooth:
there is none for readings that are exact, or that are rounded more than they are noisy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mathnavi.estimators.kalman import AxisModel, clipped_rms
from mathnavi.estimators.stagewise.model import Piece, StagewiseModel, advanced
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.missile.mission import MissileMission
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.models.unicycle.kernels import sinc, wrapped
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound

_HELD, _JACOBIANS = 0.01, 400  # [s] for which a Jacobian of a Lagrangian system stands, and how many there are at most


def estimates_at(recording: Recording, name: str, size: int) -> Array:
    """The newest estimate (n, size) at each sample; NaN before the first."""
    estimates = recording.agents[name].estimates
    x = np.full((len(recording.t), size), np.nan)
    valid = np.array([estimate.t for estimate in estimates])
    newest = np.searchsorted(valid, recording.t + TIME_TOLERANCE, side="right") - 1
    for k, index in enumerate(newest):
        if index >= 0:
            x[k] = estimates[index].x
    return x


def bound_along(
    model: StagewiseModel,
    x: Array,
    inputs: Sequence[Sequence[Piece]],
    weighted: Sequence[Array],
    recursion: BoundRecursion,
    *,
    kept: Sequence[int] | None = None,
    held: int = 1,
) -> Array:
    """Deviations (n, d) along the true states x (n, nx) of a model; NaN while the bound does not exist.

    ``inputs`` (n - 1) lead from each sample to the next, ``weighted`` (n) are W (m, d) of each sample's readings, of
    the Fisher information W' W. ``kept`` are the components of an error that are not known exactly, all if not given.
    A Jacobian stands for ``held`` transitions.
    """
    rows = np.arange(model.size) if kept is None else np.asarray(kept)
    block = np.ix_(rows, rows)
    deviation = np.full((len(x), model.size), np.nan)
    F = Q = np.zeros(0)
    for k, W in enumerate(weighted):
        if k:
            if (k - 1) % held == 0:
                _, F, Q = advanced(model, x[k - 1], inputs[k - 1])
            recursion.predict(F[block], Q[block])
        if len(W):
            recursion.observe(W[:, rows])
        P = recursion.covariance
        if P is not None:
            deviation[k] = 0.0
            deviation[k, rows] = np.sqrt(np.maximum(np.diag(P), 0.0))
    return deviation


# ---- ranges


def ranging_bound(recording: Recording, name: str, mission: RangingMission) -> PosteriorBound:
    """Bound of a robot's pose (x_1, x_2, phi), judged by the position.

    Where the start is not known, the information about it is zero. The inputs are those that the robot truly had.
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
    return _bound(bound_along(model, x, inputs, weighted, recursion, kept=kept)[:, :3], (0, 1), "the position")


def _driven(before: Array, after: Array, h: float) -> Array:
    """Input (2,) [m/s, rad/s] that leads a unicycle from one pose to another in h [s], along the chord."""
    turned = wrapped(after[2] - before[2])
    direction = before[2] + 0.5 * turned
    chord = (after[0] - before[0]) * math.cos(direction) + (after[1] - before[1]) * math.sin(direction)
    return np.array([chord / (h * sinc(0.5 * turned)), turned / h])


def _of_ranges(model: StagewiseModel, x: Array, rho: Array, outliers: float) -> Array:
    """W (m, 4) of the rays that were read; that their variance depends on the range adds information too."""
    from mathnavi.estimators.stagewise.ranging import RangingModel

    assert isinstance(model, RangingModel)
    _, W = model.residual(x, rho)
    _, slope = model.deviations(x)
    read = np.isfinite(rho) & np.isfinite(W).all(axis=1)
    weighted: Array = (np.sqrt((1.0 - outliers) * (1.0 + 2.0 * np.square(slope)))[:, np.newaxis] * W)[read]
    return weighted


# ---- flight


def flight_bound(recording: Recording, name: str, mission: FlightMission) -> PosteriorBound:
    """Bound of position and velocity (6,) of a point mass under gusts from fixes, judged by the position.

    The model is linear, so that the bound is the covariance of a Kalman filter without floors. The axes are alike.
    """
    n, fixes = recording.length, recording.agents[name].readings.get("position")
    if fixes is None:
        return PosteriorBound.none("the estimator reads no position fixes", n)
    if not mission.position_noise > 0.0:
        return PosteriorBound.none("the fixes are declared exact", n)
    rms = clipped_rms(mission.gust)
    if not rms > 0.0:
        return PosteriorBound.none("the start is exact, no gusts are declared, and so the bound is zero", n)
    axis = AxisModel(rms, mission.gust.time_constant, mission.position_noise)
    recursion = BoundRecursion(covariance=np.diag([0.0, 0.0, rms**2]))
    W = np.array([[1.0 / mission.position_noise, 0.0, 0.0]])
    deviation, discrete = np.zeros((n, 6)), dict[float, tuple[Array, Array, Array]]()
    for k in range(n):
        if k:
            h = round(float(recording.t[k] - recording.t[k - 1]), 10)
            F, _, Q = discrete.get(h) or discrete.setdefault(h, axis.discretised(h))
            recursion.predict(F, Q)
        if np.isfinite(fixes[k]).all():
            recursion.observe(W)
        P = recursion.covariance
        assert P is not None
        deviation[k] = np.repeat(np.sqrt(np.maximum(np.diag(P)[:2], 0.0)), 3)
    return _bound(deviation, (0, 1, 2), "the position")


# ---- missile


def missile_bound(recording: Recording, name: str, mission: MissileMission) -> PosteriorBound:
    """Bound of the thesis' state (nx,) under the declared gusts, judged by the position.

    The gusts that acted are not recorded: the Jacobians are those at none.
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
    return _bound(deviation[:, : coordinates.state_size], judged, "the position")


def _of_state(model: StagewiseModel, x: Array, y: Array) -> Array:
    r, W = model.residual(x, y)
    return W[np.isfinite(r)]


# ---- Lagrangian systems


def lagrangian_bound(recording: Recording, name: str, truth: LagrangianMission) -> PosteriorBound:
    """Bound of the components of (x, v) (2 n,) of a system as it truly is, judged by the velocity.

    No noise acts on the motion of these systems: it is the bound of a start of which nothing is known.
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
    return _bound(deviation, tuple(range(model.rows, model.size)), "the velocity")


def _bound(deviation: Array, judged: tuple[int, ...], quantity: str) -> PosteriorBound:
    if np.isnan(deviation).all():
        return PosteriorBound.none("the readings never determine the whole state", len(deviation))
    return PosteriorBound(deviation, judged, quantity)
