"""The kernels of a run with beacons at known places and of its monitor (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.beacons.kernels import condition, merged, predict, separations
from mathnavi.estimators.integrity import innovations_ahead, numbers_ahead
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, THREE, TWO, array

_NUMBER, _WHOLE, WHOLES = types.float64, types.int64, array(1, types.int64)
_FILTERS = (TWO, THREE)  # states and covariances
KERNELS: tuple[Signature, ...] = (
    (predict, (*_FILTERS, *(_NUMBER,) * 5)),
    (condition, (*_FILTERS, ONE, _NUMBER, _WHOLE, _WHOLE, TWO, WHOLES, ONE, TWO)),
    (separations, (ONE, TWO, TWO, THREE, _NUMBER, _NUMBER, ONE, TWO)),
    (merged, (*_FILTERS, ONE, *(_NUMBER,) * 3)),
    *innovations_ahead.KERNELS,
    *numbers_ahead.KERNELS,
)
