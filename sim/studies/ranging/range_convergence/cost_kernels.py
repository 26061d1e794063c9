"""All updates of a filter in one compiled loop, to be timed."""

from __future__ import annotations

import numpy as np
from numba import njit

from mathnavi.estimators.ranging.bank_kernels import condition_each, drop, predict_each
from mathnavi.estimators.ranging.particle_kernels import propagate, resampled, roughen, weigh
from mathnavi.sim.interfaces.signals import Array

_MEMORY = 0.98  # of the misfit, which costs the same whatever it is


@njit(cache=True, nogil=True)
def bank_updates(
    x: Array,
    P: Array,
    z: Array,
    u: Array,
    W: Array,
    relative: float,
    absolute: float,
    coefficients: Array,
    polyline: Array,
    angles: Array,
    gate: float,
    forgetting: float,
    lowest: float,
    twin: float,
    rotations: int,
    c_1: float,
    c_2: float,
    dt: float,
) -> int:
    """Hypotheses x (K, 4), P (K, 4, 4), in place, over ranges z (n, l) and inputs u (n, 2); returns n."""
    score, misfit, best = np.zeros(len(x)), np.ones(len(x)), 0
    for k in range(len(z)):
        predict_each(x, P, score, u[k], W, coefficients, polyline, dt)
        best, _, _ = condition_each(
            x,
            P,
            score,
            misfit,
            best,
            z[k],
            coefficients,
            polyline,
            angles,
            relative,
            absolute,
            gate,
            forgetting,
            _MEMORY,
        )
        drop(x, P, score, best, lowest, twin, rotations, c_1, c_2)
    return len(z)


@njit(cache=True, nogil=True)
def particle_updates(
    x: Array,
    z: Array,
    u: Array,
    deviation: Array,
    relative: float,
    absolute: float,
    coefficients: Array,
    polyline: Array,
    angles: Array,
    gate: float,
    roughening: float,
    dt: float,
    rng: np.random.Generator,
) -> int:
    """Particles x (N, 4) over ranges z (n, l) and inputs u (n, 2); returns n."""
    w = np.full(len(x), 1.0 / len(x))
    for k in range(len(z)):
        propagate(x, u[k], deviation, coefficients, polyline, dt, rng)
        if weigh(x, w, z[k], coefficients, polyline, angles, relative, absolute, gate) < 0.5 * len(x):
            x = x[resampled(w, rng.random())]
            w[:] = 1.0 / len(x)
            roughen(x, roughening, coefficients, polyline, rng)
    return len(z)
