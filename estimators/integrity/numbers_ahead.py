"""The kernels of the tests of numbers of channels, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.integrity.joint_mean import add_clipped, largest
from mathnavi.estimators.integrity.witness import is_possible
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, THREE, TWO, array

_NUMBER, _WHOLE = types.float64, types.int64
KERNELS: tuple[Signature, ...] = (
    (add_clipped, (THREE, _WHOLE, ONE, _NUMBER)),
    (largest, (THREE, *(_WHOLE,) * 3, array(1, _WHOLE), _WHOLE, _NUMBER, ONE)),
    (is_possible, (ONE, TWO)),
)
