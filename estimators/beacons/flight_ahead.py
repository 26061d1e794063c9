"""The kernels of a flight among beacons, compiled before it (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.beacons.flight_kernels import condition_flights, flight_separations, predict_flights
from mathnavi.estimators.integrity import innovations_ahead, numbers_ahead
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, THREE, TWO, array

_NUMBER, _WHOLES = types.float64, array(1, types.int64)
_FLIGHTS = (TWO, THREE)  # states and covariances
KERNELS: tuple[Signature, ...] = (
    (predict_flights, (*_FLIGHTS, TWO, ONE, TWO)),
    (condition_flights, (*_FLIGHTS, ONE, _WHOLES, _WHOLES, TWO, ONE, _NUMBER, _NUMBER, _WHOLES, ONE)),
    (flight_separations, (ONE, TWO, *_FLIGHTS, _NUMBER, TWO)),
    *innovations_ahead.KERNELS,
    *numbers_ahead.KERNELS,
)
