"""Cases of the study ``mismatch``: errors that were not declared, and the measure of a run.

The robot drives by the default inputs, ``active``, from a start that is drawn and not known, two sensors at ±60° unless
a case says otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.models.field.curve import Curve
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.sim.interfaces.signals import Array, Estimate, Status
from mathnavi.sim.metrics.ranging import HEADING, POSITION, RangingErrors
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.scenarios.range_localisation import VEHICLE
from mathnavi.sim.sweep.trial import Trial, trial

DECLARED, DECLARED_4 = "as declared", "as declared, 4 sensors"
NEARLY_ROUND = "nearly round wall"

Flags = NDArray[np.bool_]

_FOUR = (0.0, 90.0, 180.0, -90.0)  # [deg]
_ROUND = ((0.0, 0.0, 0.0, 0.0), (2.2, 0.0, 0.0, 2.16), (0.03, 0.0, 0.0, 0.03))  # [m]

CASES: Mapping[str, Mapping[str, Any]] = {
    DECLARED: {},
    DECLARED_4: {"sensors": _FOUR},
    "range noise 10 % for 5 %": {"mismatch.range_noise": 2.0},
    "30 % outliers": {"mismatch.outliers": 0.3},
    "odometry 5 % off": {"noise.odometry_bias": 0.0, "mismatch.odometry_bias": 0.05},
    "wheels, friction 0.15": {"drive": "differential", "friction": 0.15},
    "wheels, friction 0.4": {"drive": "differential", "friction": 0.4},
    "wheels, friction 0.15, 4 sensors": {"drive": "differential", "friction": 0.15, "sensors": _FOUR},
    NEARLY_ROUND: {"field.shape": "fourier", "field.coefficients": _ROUND},
}
"""fields of the scenario, by case"""

MODEL_HOLDS = (DECLARED, DECLARED_4)


def flight(case: str, seed: int, seconds: float) -> Trial:
    """A run of a case."""
    fields = {**CASES[case], "duration": seconds}
    return trial("range-localisation", seed, fields=fields, measure=f"{__name__}:honesty")


def honesty(outcome: RunResult) -> dict[str, Any]:
    """A measure: over the last quarter of a run, how often the estimator was sure, and how right it then was.

    ``known`` is the share of samples with the status OK, and ``nees_known`` the mean NEES of those, None without any.
    ``ok_and_wrong`` is the share of samples at which the status is OK and the error beyond .3 m or .2 rad, and
    ``sure_and_wrong`` that of those at which two standard deviations of the estimate are less than both, too.
    """
    recording, record = outcome.recording, outcome.config["mission"]
    mission = RangingMission(Curve(tuple(map(tuple, record["coefficients"])), record["field"]), (0.0,))
    errors = RangingErrors.from_recording(recording, VEHICLE, mission)
    last, (known, sure) = errors.last, _known(outcome, recording.t)
    beyond = (errors.position > POSITION) | (errors.heading > HEADING)
    nees = errors.nees[last][known[last]]
    return {
        "known": float(known[last].mean()),
        "ok_and_wrong": float((known & beyond)[last].mean()),
        "sure_and_wrong": float((sure & beyond)[last].mean()),
        "nees_known": float(nees.mean()) if len(nees) else None,
    }


def _known(outcome: RunResult, t: Array) -> tuple[Flags, Flags]:
    """Masks (n,) of the times [s] whose newest estimate has the status OK, and of those where it is sure besides."""
    estimates = outcome.recording.agents[VEHICLE].estimates
    newest = np.searchsorted([estimate.t for estimate in estimates], t + TIME_TOLERANCE, side="right") - 1
    known = np.array([k >= 0 and estimates[k].status is Status.OK for k in newest], dtype=bool)
    sure = np.array(
        [is_known and _is_sure(estimates[k]) for k, is_known in zip(newest, known, strict=True)], dtype=bool
    )
    return known, sure


def _is_sure(estimate: Estimate) -> bool:
    """True if two standard deviations are within the limits of an estimate that has converged."""
    P = estimate.covariance
    if P is None:
        return True
    return bool(4.0 * np.linalg.eigvalsh(P[:2, :2])[-1] < POSITION**2 and 4.0 * P[2, 2] < HEADING**2)
