"""Outcomes of plan requests, and the time of their optimisation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

FAILURES = ("solver-failed", "infeasible", "raised", "not-finite", "malformed")
REJECTIONS = ("low-clearance", "off-map", "bounds", "not-trackable", "deadline", "no-arrival", "wrong-start")


def solve_times(solve_ms: Sequence[float]) -> dict[str, float]:
    """The summary's figures of how long the optimisations took [ms]; NaN without any."""
    times = np.array(solve_ms) if solve_ms else np.array([np.nan])
    return {
        "solve_ms_mean": float(times.mean()),
        "solve_ms_p50": float(np.percentile(times, 50)),
        "solve_ms_p99": float(np.percentile(times, 99)),
        "solve_ms_max": float(times.max()),
    }
