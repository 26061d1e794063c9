"""All updates of a filter in one compiled loop, to be timed."""

from __future__ import annotations

from typing import NamedTuple

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
from mathnavi.estimators.ranging.particle_clusters import Cells, clusters_of
from mathnavi.estimators.ranging.particle_kernels import propagate, resample, weigh
from mathnavi.models.field.kernels import WallShape
from mathnavi.sim.interfaces.compiled import njit
from mathnavi.sim.interfaces.signals import Array

_KLD = (0.05, 2.33)  # epsilon and z, which decide nothing where the number of particles stays


class RecordedReadings(NamedTuple):
    """Readings and inputs of a run."""

    z: Array  # (n, l) [m] ranges
    u: Array  # (n, 2) [m/s, rad/s] inputs
    dt: float  # [s] from one to the next


class Quality(NamedTuple):
    """Noise of a robot's motion and sensors."""

    W: Array  # (2,) variances of the odometry
    sensors: RaySensors
    noise: NoiseSums
    innovations: Innovations


@njit(cache=True, nogil=True)
def bank_updates(
    bank: Hypotheses, run: RecordedReadings, wall: WallShape, quality: Quality, scoring: Scoring, symmetry: Symmetry
) -> int:
    """Update hypotheses, in place, by all n readings of a run; returns n."""
    z, u, dt = run
    W, sensors, noise, innovations = quality
    best = 0
    for k in range(len(z)):
        predict_each(bank, u[k], W, wall, dt, np.ones(2))
        best, _, _ = condition_each(bank, best, z[k], wall, sensors, noise, scoring, innovations)
        drop(bank, best, scoring, symmetry)
    return len(z)


@njit(cache=True, nogil=True)
def particle_updates(
    x: Array,
    z: Array,
    u: Array,
    deviation: Array,
    scale: float,
    wall: WallShape,
    sensors: RaySensors,
    cells: Cells,
    dt: float,
    rng: np.random.Generator,
) -> int:
    """Particles x (n, 4), whose number stays, over ranges z (m, l) and inputs u (m, 2); returns m."""
    w, limits = np.full(len(x), 1.0 / len(x)), (len(x), len(x))
    for k in range(len(z)):
        propagate(x, u[k], deviation, scale, wall, dt, rng)
        effective, _ = weigh(x, w, z[k], wall, sensors)
        clusters = clusters_of(x, w, cells)
        if effective < 0.5 * len(x):
            x = resample(x, w, clusters, 0.0, limits, _KLD, cells, scale, wall, rng)
            w[:] = 1.0 / len(x)
    return len(z)
