"""What the study of observers' declared properties measures of a run (thesis Table 2.1), whatever scenario it is of."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Any

import numpy as np

from sim.plugins import load
from sim.scenarios.experiment import Outcome
from sim.signals import Array, Status

MEASURE = "sim.studies.property_measures:property_figures"

DECAYED = 0.1  # of the error at the start, below which an error has decayed
_LATE = 0.9  # of a run, from which on its last tenth lasts
_FALLEN = 1e-2  # of the error at the start: what falls to it may be exponential
_FLOOR = 1e-6  # likewise: below it other things than the observer's own dynamics are measured
_STEADY = 0.25  # of the first half's rate of decay, that of the second half of an exponential is at least
_EXACT = 1e-9


class Decay(IntEnum):
    """How an error falls, by what is the stronger claim; the names are those of ``Rate``."""

    BOUNDED = 0
    ASYMPTOTIC = 1
    EXPONENTIAL = 2
    FINITE_TIME = 3


def property_figures(outcome: Outcome) -> dict[str, Any]:
    """Of the length of the error, from the first estimate that is not initialising on.

    ``told`` is that of the start that the estimator was told of (NaN if it was not), ``ratio`` that of the last tenth of
    the run over it, ``peak`` the largest over it; ``largest`` is in the units of the state.
    """
    told = _told(outcome)
    t, error = errors(outcome)
    if len(t) < 3:
        return {"told": told, "largest": math.nan, "ratio": math.inf, "peak": math.inf, "decay": int(Decay.BOUNDED)}
    scale = told if told > 0.0 else math.nan
    late = float(np.sqrt(np.mean(np.square(error[t >= _LATE * t[-1]]))))
    return {
        "told": told,
        "largest": float(error.max()),
        "ratio": late / scale,
        "peak": float(error.max()) / scale,
        "decay": int(decay(t, error, float(error[0]) if math.isnan(scale) else scale)),
    }


def errors(outcome: Outcome) -> tuple[Array, Array]:
    """Times (k,) [s] and lengths of the error (k,), of the estimates that are not initialising, up to an escape."""
    recording = outcome.recording
    ((name, agent),) = recording.agents.items()
    ready = [estimate for estimate in agent.estimates if estimate.status is not Status.INITIALISING]
    escape = outcome.summary.get("escape_time_s")
    ready = [estimate for estimate in ready if escape is None or estimate.t <= escape]
    if not ready:
        return np.empty(0), np.empty(0)
    t, x = np.array([estimate.t for estimate in ready]), np.array([estimate.x for estimate in ready])
    truth = recording.truths[name][np.searchsorted(recording.t, t - 1e-9)]
    scenario = load("scenarios", outcome.config["scenario"])
    config = scenario.Config(**{})  # the errors of the scenarios here depend on their systems and walls only
    return t, np.linalg.norm(np.array(list(scenario.errors(config, x, truth).values())), axis=0)
