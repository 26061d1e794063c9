"""The kernels of active sensing, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64, int64

from mathnavi.controllers.active_sensing.kernels import (
    PredictionHorizon,
    RangeSensors,
    WallTable,
    clearance,
    expected_traces,
    nodes_within,
    sigma_poses,
)
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO, TWO_READ, array, named
from mathnavi.models.field.kernels import is_inside
from mathnavi.models.unicycle.kernels import integrate, integrate_jacobians, sinc, wrapped

WALL = named(WallTable, TWO_READ, TWO_READ)
SENSORS = named(RangeSensors, ONE, ONE)
HORIZON = named(PredictionHorizon, float64, int64, float64)
MOTION = (ONE, float64, float64, float64)  # pose, inputs and duration
KERNELS: tuple[Signature, ...] = (
    (expected_traces, (WALL, SENSORS, HORIZON, ONE, TWO, TWO, array(1, int64))),
    (nodes_within, (WALL, TWO, float64, TWO, float64, int64)),
    (sigma_poses, (WALL, ONE, TWO, float64, float64)),
    (clearance, (WALL, float64, float64)),
    (is_inside, (TWO_READ, TWO_READ, float64, float64)),
    (integrate, MOTION),
    (integrate_jacobians, MOTION),
    (sinc, (float64,)),
    (wrapped, (float64,)),
)
