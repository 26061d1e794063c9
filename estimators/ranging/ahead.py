"""Compilation of the feasible-set bank's kernels before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64, int64

from mathnavi.estimators.ranging.bank_kernels import Hypotheses, Scoring, condition_each, drop, predict_each
from mathnavi.estimators.ranging.feasible_set_kernels import farthest_points, project, pushed
from mathnavi.estimators.ranging.kalman_kernels import Innovations, RaySensors, expected_ranges, move, within
from mathnavi.estimators.ranging.noise_kernels import NoiseSums, noise_of
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, THREE, TWO, TWO_READ, array, combined, named

WALL = combined(TWO_READ, TWO_READ)
HYPOTHESES = named(Hypotheses, TWO, THREE, ONE, ONE, ONE, TWO, THREE, array(2, int64))
SENSORS = named(RaySensors, ONE, float64, float64, float64, float64, float64)
SUMS = named(NoiseSums, ONE, ONE)
SCORING = named(Scoring, float64, float64, float64, float64)
INNOVATIONS = named(Innovations, ONE, ONE, ONE, ONE)
KERNELS: tuple[Signature, ...] = (
    (condition_each, (HYPOTHESES, int64, ONE, WALL, SENSORS, SUMS, SCORING, INNOVATIONS)),
    (project, (TWO, ONE, ONE, WALL, ONE, int64)),
    (expected_ranges, (WALL, ONE, ONE)),
    (predict_each, (HYPOTHESES, ONE, ONE, WALL, float64, ONE)),
    (move, (ONE, ONE, WALL, float64)),
    (drop, (HYPOTHESES, int64, SCORING, combined(int64, float64, float64))),
    (noise_of, (SUMS,)),
    (pushed, (TWO, TWO, WALL, float64, float64)),
    (within, (WALL, TWO)),
    (farthest_points, (TWO, int64, int64, float64)),
)
