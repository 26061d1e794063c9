"""The kernels of a run with beacons at unknown places (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.beacons import ahead
from mathnavi.estimators.beacons.batch_kernels import cost_of, moved, ray_costs, ring_costs, step, weighed
from mathnavi.estimators.beacons.kernels import expected
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO, combined

_SOLUTION = (TWO, ONE)  # poses and constants
_DATA = (combined(ONE, TWO), TWO, ahead.WHOLES, TWO, TWO, ahead.WHOLES, TWO)  # prior, pieces, readings, places, errors
KERNELS: tuple[Signature, ...] = (
    (step, (*_SOLUTION, *_DATA, types.boolean, types.float64)),
    (cost_of, (*_SOLUTION, *_DATA, types.boolean)),
    (moved, (ONE, ONE, TWO)),
    (weighed, (*(types.float64,) * 4, types.boolean)),
    (expected, (ONE, types.int64, types.int64, TWO, ahead.WHOLES)),
    (ring_costs, (TWO, TWO, ONE, ONE)),
    (ray_costs, (TWO, TWO, ONE, ONE)),
    *ahead.KERNELS,
)
