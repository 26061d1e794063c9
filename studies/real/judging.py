"""Figures of the estimates of a pose against a reference, a row for each log and estimator.

Root mean squares and NEES are over the times at which the estimate may be used, but for the one *all*, of position at
all times. **Sure and wrong** is defined in
``mathnavi.sim.metrics.sure_and_wrong``: OK, with an error of position or heading above three deviations for more than a
second; a share of all times. **Lock** is the time from the start to the first estimate that may be used and is near,
as are all that may be used in the ``KEPT`` seconds after it. NEES is divided by the number of states: one of an
estimator that errs as it declares.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mathnavi.interfaces.signals import Array, Integers
from mathnavi.models.angles import wrapped
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.reference_figures import reference_figures
from mathnavi.sim.records.sensor_log import EstimateHistory
from mathnavi.sim.records.table import Row

STATES = ("x [m]", "y [m]", "heading [rad]")
POSITION, HEADING = 0.3, 0.2  # [m, rad] within which a pose is near
KEPT = 5.0  # [s]
COLUMNS = (
    *("part", "log", "case", "beams", "estimator", "start", "found", "position_rms_m", "position_rms_all_m"),
    *("heading_rms_deg", "inclination_rms_deg", "total_rms_deg", "velocity_rms_rad_s", "last_error_m", "nees"),
    *("beacons_rms_m", "beacons_max_m", "mapped_share"),
    *("usable_share", "wrong_share", "lock_s", "update_us", "setting"),
)
"""columns of NAME.csv"""


def row(**given: Any) -> Row:
    """A row of the study; NaN in what is not given. KeyError for another column."""
    if unknown := given.keys() - set(COLUMNS):
        raise KeyError(f"{', '.join(sorted(unknown))}; allowed: {', '.join(COLUMNS)}")
    return {name: given.get(name, math.nan) for name in COLUMNS}


def pose_figures(found: EstimateHistory, at: Integers, truth: Array, near: tuple[float, float]) -> dict[str, float]:
    """Figures of the estimates in rows ``at`` (n,) against poses ``truth`` (n, 3), by the columns of a row."""
    part = replace(
        found,
        t=found.t[at],
        x=found.x[at],
        covariance=found.covariance[at],
        status=tuple(found.status[k] for k in at.tolist()),
        message=(),
        extra={},
    )
    figures = reference_figures(part, part.t, truth, STATES)
    error = part.x - truth
    error[:, 2] = wrapped(error[:, 2])
    wrong = sure_and_wrong(part.t, part.ok, error, part.covariance).any(axis=1)
    return {
        "position_rms_m": figures["position_rms_m"],
        "position_rms_all_m": float(np.sqrt(np.square(error[:, :2]).sum(axis=1).mean())),
        "heading_rms_deg": figures["heading_rms_deg"],
        "nees": figures["nees_mean"],
        "usable_share": figures["usable_share"],
        "wrong_share": float(wrong.mean()),
        "lock_s": _lock(part.t, part.usable, error, near),
    }


def _lock(t: Array, usable: NDArray[np.bool_], error: Array, near: tuple[float, float]) -> float:
    """Time [s] from the first estimate to the lock; NaN if there is none."""
    is_near = (np.hypot(*error[:, :2].T) <= near[0]) & (np.abs(error[:, 2]) <= near[1])
    for k in np.flatnonzero(usable & is_near).tolist():
        after = (t >= t[k]) & (t <= t[k] + KEPT)
        if is_near[after & usable].all():
            return float(t[k] - t[0])
    return math.nan


def timed(name: str, run: Callable[[], EstimateHistory], first: Callable[[], object]) -> tuple[EstimateHistory, float]:
    """Estimates, and the CPU time of one update [us], without that in which its kernels are loaded.

    ``first`` runs the same estimator over a few readings; it is called once in a process for each ``name``.
    """
    if name not in _loaded():
        first()
        _loaded().add(name)
    begun = time.process_time()
    found = run()
    return found, MeasuredTime(1e6 * (time.process_time() - begun) / len(found.t))


@cache
def _loaded() -> set[str]:
    """Names of the estimators whose kernels this process has loaded."""
    return set()
