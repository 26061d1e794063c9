"""The kernels of the tests of innovations, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.integrity.excess import factor_of
from mathnavi.estimators.integrity.windows import add, worst_of
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO, array, combined

_NUMBER, _WHOLE, _WHOLES = types.float64, types.int64, array(1, types.int64)
KERNELS: tuple[Signature, ...] = (
    (add, (TWO, _WHOLE, ONE, ONE)),
    (worst_of, (TWO, _WHOLE, array(1, types.boolean), _WHOLES, _NUMBER, _NUMBER, ONE)),
    (factor_of, (TWO, _WHOLE, combined(_WHOLE, _WHOLE), _WHOLES, _NUMBER, ONE, ONE, _NUMBER, _NUMBER)),
)
