"""Estimates, covariances and hypotheses of a robot with range sensors, from a run's log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.signals import Array, Integers

FADED = 20.0  # log-likelihood below the best at which a hypothesis is as good as ruled out


@dataclass(frozen=True, eq=False)
class Beliefs:
    """Output of the estimator at k times; None where it has none of the kind."""

    t: Array  # (k,) [s]
    x: Array  # (k, 3) pose [m, m, rad]
    covariance: Array | None  # (k, 3, 3); NaN where there is none
    nis: Array | None  # (k, 2) normalised innovation squared and its degrees of freedom; NaN where no update
    hypotheses: Array | None  # (k, m, 3) poses; NaN where dropped
    scores: Array | None  # (k, m) log-likelihoods less the best one; NaN where dropped
    z: Array | None  # (k, l + 1) s_1, ..., s_l, phi [rad] of the observer (C.5)
    value: Array | None  # (k, 2) V_rho and |Q|^2 / 2 of the estimate

    @cached_property
    def left(self) -> Integers | None:
        """(k,) how many hypotheses there are."""
        return None if self.scores is None else np.isfinite(self.scores).sum(axis=1)

    def strengths(self, k: int) -> Array:
        """(m,) in [0, 1], 1 for the best hypothesis at ``t[k]``, 0 for one that is ruled out; empty without any."""
        if self.scores is None:
            return np.empty(0)
        scores = np.where(np.isfinite(self.scores[k]), self.scores[k], -np.inf)
        best = max(float(scores.max()), -1e300)  # there may be none
        strengths: Array = np.clip(1.0 - (best - scores) / FADED, 0.0, 1.0)
        return strengths


def read_beliefs(arrays: Mapping[str, Array], sensors: int) -> Beliefs:
    """Read the estimator's output from the arrays of a log; ValueError for shapes that do not fit ``Beliefs``."""
    t = arrays.get("estimate.t", np.empty(0))
    k = len(t)
    x = shaped(arrays, "estimate.x", (k, 3))
    many = arrays["estimate.scores"].shape[-1] if "estimate.scores" in arrays else 0
    return Beliefs(
        t,
        np.empty((0, 3)) if x is None else x,
        shaped(arrays, "estimate.covariance", (k, 3, 3)),
        shaped(arrays, "estimate.nis", (k, 2)),
        shaped(arrays, "estimate.hypotheses", (k, many, 3)),
        shaped(arrays, "estimate.scores", (k, many)),
        shaped(arrays, "estimate.z", (k, sensors + 1)),
        shaped(arrays, "estimate.value", (k, 2)),
    )


def shaped(arrays: Mapping[str, Array], name: str, shape: tuple[int, ...]) -> Array | None:
    """An array of the log, None if it is not there; ArgumentError for another shape."""
    if name not in arrays:
        return None
    if arrays[name].shape != shape:
        raise ArgumentError(f"{name} has shape {arrays[name].shape}; allowed: {shape}")
    return arrays[name]
