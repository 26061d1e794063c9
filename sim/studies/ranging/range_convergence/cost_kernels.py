"""All updates of a filter in one compiled loop, to be timed."""

from __future__ import annotations

import numpy as np

from mathnavi.estimators.ranging.bank_kernels import (
    Hypotheses,
    Scoring,
    Symmetry,
    condition_each,
    drop,
    predict_each,
)
from mathnavi.estimators.ranging.kalman_kernels import Innovations, RaySensors
from mathnavi.estimators.ranging.noise_kernels import NoiseSums
from mathnavi.estimators.ranging.particle_kernels import propagate, resampled, roughen, weigh
from mathnavi.models.field.kernels import WallShape
from mathnavi.sim.interfaces.compiled import njit
from mathnavi.sim.interfaces.signals import Array


@njit(cache=True, nogil=True)
def bank_updates(
    bank: Hypotheses,
    z: Array,
    u: Array,
    W: Array,
    wall: WallShape,
    sensors: RaySensors,
    noise: NoiseSums,
    scoring: Scoring,
    innovations: Innovations,
    symmetry: Symmetry,
    dt: float,
) -> int:
    """Hypotheses, in place, over ranges z (n, l) and inputs u (n, 2); returns n."""
    best = 0
    for k in range(len(z)):
        predict_each(bank, u[k], W, wall, dt)
        best, _, _ = condition_each(bank, best, z[k], wall, sensors, noise, scoring, innovations)
        drop(bank, best, scoring, symmetry)
    return len(z)


@njit(cache=True, nogil=True)
def particle_updates(
    x: Array,
    z: Array,
    u: Array,
    deviation: Array,
    wall: WallShape,
    sensors: RaySensors,
    roughening: float,
    dt: float,
    rng: np.random.Generator,
) -> int:
    """Particles x (N, 4) over ranges z (n, l) and inputs u (n, 2); returns n."""
    w = np.full(len(x), 1.0 / len(x))
    for k in range(len(z)):
        propagate(x, u[k], deviation, wall, dt, rng)
        if weigh(x, w, z[k], wall, sensors) < 0.5 * len(x):
            x = x[resampled(w, rng.random())]
            w[:] = 1.0 / len(x)
            roughen(x, roughening, wall, rng)
    return len(z)
