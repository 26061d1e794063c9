"""Outlier detection rule (A.14): a vehicle that cannot adjust its arrival so far follows passively, and may come back.

A vehicle is no outlier while (eta_d - h) / eta_m lies in [1 - delta, 1 + delta], with its own estimate eta_m, the
agreed eta_d and the planning period h. As printed, a vehicle that agrees with all others is nevertheless one once
eta_m < h / delta, for its own estimate has not yet been reduced by the h that eta_d is; in the last 5.6 s of a mission
every vehicle is. So is a vehicle that has arrived (eta_m <= 0). And one vehicle whose estimate is so far off that it
moves the average of n beyond the others' bands, by more than about n delta of theirs, makes outliers of all at once; no
vehicle takes part any more then, and all keep their values.
"""

from __future__ import annotations

DELTA = 0.3  # the thesis' choice


def is_outlier(agreed: float, own: float, planning_period: float, delta: float = DELTA) -> bool:
    """True if eta_d = ``agreed`` [s] is beyond what a vehicle with eta_m = ``own`` [s] can adjust to (A.14)."""
    return not (own > 0.0 and (1.0 - delta) * own <= agreed - planning_period <= (1.0 + delta) * own)
