"""Figures of a run of range localisation, from its log and the truth.

Errors are those of the newest estimate at each sample, modulo the symmetry of the wall. An estimate has
converged if over the last quarter of the run the RMS of its position error is below 0.3 m and that of its heading error
below 0.2 rad.

The posterior Cramér-Rao bound of a robot with range sensors, as recorded.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.estimators.stagewise.model import StagewiseModel
from mathnavi.interfaces.signals import Array, Integers, Status
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.models.unicycle.beacons import BeaconFieldMission, BeaconMission
from mathnavi.models.unicycle.entity import RADIUS
from mathnavi.models.unicycle.kernels import sinc, wrapped
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.engine.log import AgentRecorder, Recording
from mathnavi.sim.metrics.beacon_places import found_figures
from mathnavi.sim.metrics.consistency import normalised_error_squared
from mathnavi.sim.metrics.convergence import last_quarter
from mathnavi.sim.metrics.planning import planner_share
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound, bound_along, judged_bound


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


POSITION, HEADING = 0.3, 0.2
"""largest errors of position [m] and heading [rad] of an estimate that has converged"""


@dataclass(frozen=True, eq=False)
class RangingErrors:
    """Errors of the estimates at the n samples of a run."""

    t: Array  # (n,) [s]
    difference: Array  # (n, 3) [m, m, rad] estimate less truth, modulo the symmetry of the wall; NaN before the first
    nees: Array  # (n,) e' P^-1 e; NaN without a covariance
    covariance: Array  # (n, 3, 3) of the estimates; NaN without one
    found: NDArray[np.bool_]  # (n,) whether the estimator had an estimate

    @staticmethod
    def from_recording(recording: Recording, name: str, mission: RangingMission) -> RangingErrors:
        """Errors of one robot's run."""
        truths, estimates = recording.truths[name], recording.agents[name].estimates
        difference, P = np.full((len(truths), 3), np.nan), np.full((len(truths), 3, 3), np.nan)
        found = np.zeros(len(truths), dtype=bool)
        for k, newest in enumerate(_newest(recording, name)):
            if newest >= 0:
                difference[k] = mission.difference(estimates[newest].x, truths[k, :3])
                found[k] = estimates[newest].status is not Status.INITIALISING
                covariance = estimates[newest].covariance
                if covariance is not None:
                    P[k] = covariance
        return RangingErrors(recording.t, difference, normalised_error_squared(difference, P), P, found)

    @property
    def position(self) -> Array:
        """Errors of the position (n,) [m]."""
        length: Array = np.hypot(self.difference[:, 0], self.difference[:, 1])
        return length

    @property
    def heading(self) -> Array:
        """Errors of the heading (n,) [rad], absolute."""
        size: Array = np.abs(self.difference[:, 2])
        return size

    @property
    def last(self) -> slice:
        """Slice of the samples over which convergence is judged."""
        return last_quarter(self.t)

    @property
    def converged(self) -> bool:
        """True if position and heading are within their limits over the last quarter."""
        return rms(self.position[self.last]) < POSITION and rms(self.heading[self.last]) < HEADING

    def last_above(self, position: float = POSITION, heading: float = HEADING) -> float:
        """Time [s] of the last sample without an estimate or with an error above either limit [m], [rad]; 0 if there is
        none.
        """
        above = np.flatnonzero(~((self.position <= position) & (self.heading <= heading) & self.found))
        return float(self.t[above[-1]]) if len(above) else 0.0


def rms(values: Array) -> float:
    """Root mean square of values (n,)."""
    return float(np.sqrt(np.mean(np.square(values))))


def ranging_summary(
    recording: Recording, name: str, mission: RangingMission, seed: int, wall_seconds: float
) -> dict[str, Any]:
    """Flat summary of one robot's run, with SI units in the names, angles in degrees.

    ``convergence_time_s`` is the last instant at which an error is above its limit, None if the run did not converge;
    the largest errors are those after it. ``efficiency`` is that of the position over the last quarter.
    """
    t, agent = recording.t, recording.agents[name]
    path = recording.truths[name][:, :2]
    errors = RangingErrors.from_recording(recording, name, mission)
    kinds = Counter(event.kind for event in recording.events if event.agent == name)
    converged, last = errors.converged, errors.last
    found = errors.last_above() if converged else math.inf
    settled = t > found
    nees = float(errors.nees[last].mean())
    bound = ranging_bound(recording, name, mission)
    recording.cramer_rao[name] = bound.deviation
    return {
        "converged": converged,
        "position_rms_m": rms(errors.position[last]),
        "heading_rms_deg": math.degrees(rms(errors.heading[last])),
        "convergence_time_s": found if converged else None,
        "position_error_max_m": float(errors.position[settled].max()) if settled.any() else None,
        "heading_error_max_deg": math.degrees(float(errors.heading[settled].max())) if settled.any() else None,
        "nees_mean": nees if math.isfinite(nees) else None,
        **bound.figures(errors.difference[:, :2], last, "the last quarter"),
        "observable": _observable(mission),
        "lost_ranges": _lost(agent, recording.length),
        "initialising_s": _time_in(recording, name, Status.INITIALISING),
        "lost_s": _time_in(recording, name, Status.LOST),
        "degraded_s": _time_in(recording, name, Status.DEGRADED),
        "touched_wall": kinds["contact"] > 0,
        "wall_clearance_min_m": min(mission.curve.distance(place) for place in path) - RADIUS,
        "path_length_m": float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()),
        "run_time_s": float(t[-1]),
        "planner_share": planner_share(float(t[0]), float(t[-1]), agent.plans),
        "inputs_clipped": kinds["input-clipped"],
        "real_time_factor": float(t[-1]) / wall_seconds,
        "seed": seed,
    }


def beacons_summary(
    recording: Recording, name: str, mission: BeaconMission, places: Sequence[tuple[float, float]]
) -> dict[str, Any]:
    """Summary of the places that a robot's estimator has in the end of the beacons that it was not given; empty if it
    was given all.

    Their true places are ``places`` [m]. A standard deviation is that of both coordinates together.
    """
    estimates = recording.agents[name].estimates
    extra = estimates[-1].extra if estimates else {}
    found = {}
    for i in mission.unknown if "beacons" in extra else ():
        at = slice(2 * i, 2 * i + 2)
        if np.isfinite(extra["beacons"][at]).all():
            found[i] = extra["beacons"][at], math.sqrt(float(np.trace(extra["beacons_covariance"][at, at])))
    return found_figures(found, places, mission.unknown, 2)


def _newest(recording: Recording, name: str) -> Integers:
    """Index (n,) of the newest estimate at each sample, -1 before the first."""
    valid = np.array([estimate.t for estimate in recording.agents[name].estimates])
    newest: Integers = np.searchsorted(valid, recording.t + TIME_TOLERANCE, side="right") - 1
    return newest


def _lost(agent: AgentRecorder, length: int) -> float | None:
    """Fraction of single ranges that did not arrive; None without a range sensor."""
    ranges = agent.readings.get("ranges")
    return None if ranges is None else float(np.isnan(ranges[:length]).mean())


def _time_in(recording: Recording, name: str, status: Status) -> float:
    """Time [s] during which the newest estimate had this status, sample by sample."""
    estimates = recording.agents[name].estimates
    held = [newest >= 0 and estimates[newest].status is status for newest in _newest(recording, name)]
    return float(np.diff(recording.t)[np.array(held[:-1], dtype=bool)].sum())


def _observable(mission: RangingMission) -> str | None:
    """Components of the pose, in words, that ranges can determine at most, for any motion; None with beacons."""
    if isinstance(mission, BeaconFieldMission):
        return None
    symmetry = mission.curve.symmetry
    if symmetry == 0:
        return "distance from the centre, heading relative to its direction"
    return "the pose" if symmetry == 1 else f"the pose, up to {symmetry} rotations"
