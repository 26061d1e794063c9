"""The kernels of the tests of declared noise, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.integrity.windows import add, worst_of
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO, array

_NUMBER, _WHOLE = types.float64, types.int64
KERNELS: tuple[Signature, ...] = (
    (add, (TWO, _WHOLE, ONE, ONE)),
    (worst_of, (TWO, _WHOLE, array(1, types.boolean), array(1, types.int64), _NUMBER, _NUMBER, ONE)),
)
