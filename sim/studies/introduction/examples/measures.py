"""Measures of the Introduction's examples: the error of a run against the printed equation."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import expm

from mathnavi.estimators.textbook.kazantzis_kravaris import Immersion
from mathnavi.models.textbook.example_2_2 import error_dynamics
from mathnavi.models.textbook.library import SYSTEMS
from mathnavi.models.textbook.maps import of_numbers
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.scenarios.textbook import VEHICLE

EXAMPLE_2_2 = "mathnavi.sim.studies.introduction.examples.measures:example_2_2"
IN_COORDINATES = "mathnavi.sim.studies.introduction.examples.measures:in_coordinates"

_UNEXCITED = 1e-9  # of the largest mode at the start


def example_2_2(outcome: RunResult) -> dict[str, Any]:
    """Measure the error e = x^ - x of Example 2.2 against its linear equation; the exponent is that of (e_1, e_2)."""
    fields = outcome.config["estimator"]["fields"]
    t, x_hat, x = estimates(outcome)
    matrix = error_dynamics(fields["alpha"], fields["beta"])
    e = x_hat - x
    return {"deviation": _deviation(t, e, matrix), "exponent_per_s": _exponent(t, e[:, :2], matrix[:2, :2])}


def in_coordinates(outcome: RunResult) -> dict[str, Any]:
    """Measure T(x^) - T(x) against d/dt (z - x~) = A (z - x~), with the T and the A of the observer."""
    fields = outcome.config["estimator"]["fields"]
    system = SYSTEMS[outcome.config["fields"]["system"]]
    immersion = Immersion.for_system(system, tuple(fields["poles"]), fields.get("order", 1))
    T = of_numbers(immersion.T, len(system.states))
    t, x_hat, x = estimates(outcome)
    error = np.array([T(one) - T(other) for one, other in zip(x_hat, x, strict=True)])
    lengths = np.linalg.norm(x_hat - x, axis=1)
    return {
        "deviation": _deviation(t, error, immersion.A),
        "exponent_per_s": _exponent(t, error, immersion.A),
        "error_ratio": float(lengths[-1] / lengths[0]),
    }


def estimates(outcome: RunResult) -> tuple[Array, Array, Array]:
    """Times (k,) [s], estimates (k, n) and truths (k, n), up to an escape."""
    recording = outcome.recording
    found = recording.agents[VEHICLE].estimates
    t = np.array([estimate.t for estimate in found])
    escape = outcome.summary["escape_time_s"]
    lived = t <= (np.inf if escape is None else escape)
    x_hat = np.array([estimate.x for estimate in found])
    return t[lived], x_hat[lived], recording.truths[VEHICLE][np.searchsorted(recording.t, t[lived] - 1e-9)]


def predicted(t: Array, start: Array, matrix: Array) -> Array:
    """(k, n) exp(t A) e(0) at equally spaced times (k,)."""
    over_a_period, e = expm((t[1] - t[0]) * matrix), [start]
    for _ in t[1:]:
        e.append(over_a_period @ e[-1])
    return np.array(e)


def _deviation(t: Array, e: Array, matrix: Array) -> float:
    """Largest distance of e (k, n) from exp(t A) e(0), over the largest of the latter."""
    expected = predicted(t, e[0], matrix)
    return float(np.abs(e - expected).max() / np.abs(expected).max())


def _exponent(t: Array, e: Array, matrix: Array) -> float:
    """[1/s] by which the slowest of the modes of A has decayed, or the fastest has grown, in e (k, n).

    In the coordinates of its eigenvectors each mode that the equation has is an exponential by itself.
    """
    _, vectors = np.linalg.eig(matrix)
    modes = np.abs(np.linalg.solve(vectors, e[[0, -1]].T.astype(complex)))  # (n, 2) at first and at last
    excited = modes[modes[:, 0] > _UNEXCITED * modes[:, 0].max()]
    return float(np.log(excited[:, 1] / excited[:, 0]).max() / t[-1])
