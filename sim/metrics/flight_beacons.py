"""Figures of a flight among beacons: errors of its estimates, beacons that were left out, and the bound by readings."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.aerial.beacon_readings import BeaconRows
from mathnavi.models.aerial.beacons import FlightBeacons
from mathnavi.models.beacon_names import DIFFERENCES
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.sim.engine.log import Recording
from mathnavi.sim.metrics.beacon_places import found_figures
from mathnavi.sim.metrics.convergence import last_quarter
from mathnavi.sim.metrics.posterior_bound import BoundRecursion, PosteriorBound, judged_bound

if TYPE_CHECKING:
    from mathnavi.models.aerial.mission import FlightMission


def beacon_figures(recording: Recording, name: str, beacons: FlightBeacons) -> dict[str, Any]:
    """Figures of the estimates of one vehicle that reads ``beacons``, for the summary."""
    from mathnavi.sim.metrics.consistency import normalised_error_squared  # takes a while to import

    t, estimates = recording.t, recording.agents[name].estimates
    newest = np.searchsorted([each.t for each in estimates], t + TIME_TOLERANCE, side="right") - 1
    begun = newest >= 0
    known = [estimates[k] for k in newest[begun].tolist()]
    error, P = np.full((len(t), 3), np.nan), np.full((len(t), 3, 3), np.nan)
    error[begun] = np.array([each.x[:3] for each in known]) - recording.truths[name][begun, :3]
    P[begun] = [np.full((3, 3), np.nan) if each.covariance is None else each.covariance[:3, :3] for each in known]
    last = last_quarter(t)
    nees = float(normalised_error_squared(error, P)[last].mean())
    statuses, step = [each.status for each in estimates], float(t[1] - t[0])
    out = np.zeros(len(beacons.places), dtype=bool)
    for each in known:
        if (left_out := each.extra.get("left_out")) is not None:
            out |= left_out[: len(out)] > 0.0
    logged = {each: recording.agents[name].readings.get(each) for each in beacons.sensor_names}
    readings = [y[: recording.length, each == DIFFERENCES :] for each, y in logged.items() if y is not None]
    return {
        "position_rms_m": float(np.sqrt(np.square(error[last]).sum(axis=1).mean())),
        "nees_mean": nees if np.isfinite(nees) else None,
        "lost_ranges": _unanswered(readings),
        "initialising_s": statuses.count(Status.INITIALISING) * step,
        "lost_s": statuses.count(Status.LOST) * step,
        "degraded_s": statuses.count(Status.DEGRADED) * step,
        "left_out_beacons": ", ".join(map(str, np.flatnonzero(out))) or None,
    }


def place_figures(recording: Recording, name: str, beacons: FlightBeacons, unknown: Sequence[int]) -> dict[str, Any]:
    """Figures of the places that the estimator of one vehicle has in the end of ``unknown`` beacons, which are at
    ``beacons``; empty without any. A standard deviation is that in the worst direction.
    """
    estimates = recording.agents[name].estimates
    extra = estimates[-1].extra if estimates else {}
    found = {}
    for i in unknown if "beacon_places" in extra else ():
        place = extra["beacon_places"][i]
        if np.isfinite(place).all():
            found[i] = place, float(np.sqrt(np.linalg.eigvalsh(extra["beacon_places_covariance"][i])[-1]))
    return found_figures(found, beacons.array.tolist(), unknown, 1)


def _unanswered(readings: list[Array]) -> float | None:
    """Share of the single numbers (n, m) of sensors that did not arrive, of the times at which any did."""
    asked = [np.isnan(each[np.isfinite(each).any(axis=1)]).ravel() for each in readings]
    return float(np.concatenate(asked).mean()) if any(map(len, asked)) else None


def beacon_bound(recording: Recording, name: str, mission: FlightMission, beacons: FlightBeacons) -> PosteriorBound:
    """Bound of position and velocity (6,) of a point mass under gusts from what it reads of beacons, and from fixes if
    it reads them.

    The derivatives of the readings are those at the true places.
    """
    from mathnavi.estimators.beacons.flight_quality import thrice  # these take a while to import
    from mathnavi.estimators.flight_model import AxisModel, clipped_rms

    agent, n = recording.agents[name], recording.length
    logged, fixes = {each: agent.readings.get(each) for each in beacons.sensor_names}, agent.readings.get("position")
    rms, rows = clipped_rms(mission.gust), BeaconRows(beacons)
    if all(each is None for each in logged.values()):
        return PosteriorBound.none("the estimator reads no beacons", n)
    y = np.full((n, rows.size), np.nan)
    for each, values in logged.items():
        if values is not None:
            y[:, rows.slices[each]] = values[:n]
    if not (rows.variance.min() > 0.0 and rms > 0.0) or (fixes is not None and not mission.position_noise > 0.0):
        return PosteriorBound.none("the readings are declared exact, or no gusts are declared", n)
    axis = AxisModel(rms, mission.gust.time_constant, beacons.noise)
    recursion = BoundRecursion(covariance=thrice(np.diag([0.0, 0.0, rms**2])))
    variance, discrete = np.zeros((n, 6)), dict[float, tuple[Array, Array]]()
    x = recording.truths[name][:n]
    for k, h in enumerate([0.0, *(round(each, 10) for each in np.diff(recording.t[:n]).tolist())]):
        if k:
            if h not in discrete:
                F, _, Q = axis.discretised(h)
                discrete[h] = thrice(F), thrice(Q)
            recursion.predict(*discrete[h])
        read = np.flatnonzero(np.isfinite(y[k]))
        if len(read):
            W = rows.whitened(rows.linear(x[k, :3], read.tolist())[1], read) * np.sqrt(1.0 - beacons.outliers)
            recursion.observe(np.hstack([W, np.zeros((len(W), 6))]))
        if fixes is not None and np.isfinite(fixes[k]).all():
            recursion.observe(np.eye(3, 9) / mission.position_noise)
        now = recursion.variance
        assert now is not None
        variance[k] = now[:6]
    return judged_bound(np.sqrt(np.maximum(variance, 0.0)), (0, 1, 2), "the position")
