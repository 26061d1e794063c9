"""The kernels of the tests of readings and of innovations, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.integrity.windows import add, worst_of
from mathnavi.estimators.velocity.gain_covariance import update
from mathnavi.estimators.velocity.innovation_tests import declare, note
from mathnavi.estimators.velocity.reading_errors import refine
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, THREE, TWO, array

_NUMBER, _WHOLE, _FLAG, _COUNTS = types.float64, types.int64, types.boolean, array(1, types.int64)
KERNELS: tuple[Signature, ...] = (
    (add, (TWO, _WHOLE, ONE, ONE)),
    (worst_of, (TWO, _WHOLE, array(1, types.boolean), _COUNTS, _NUMBER, _NUMBER, ONE)),
    (refine, (*(ONE,) * 4, array(1, types.boolean), ONE, ONE)),
    (update, (THREE, _NUMBER, _FLAG, *(ONE,) * 7, _NUMBER)),
    (declare, (ONE, ONE, ONE, _NUMBER)),
    (
        note,
        (
            *(ONE,) * 7,
            _COUNTS,
            _NUMBER,
            _NUMBER,
            _NUMBER,
            _FLAG,
            _FLAG,
            array(1, types.boolean),
            ONE,
            TWO,
            TWO,
            ONE,
            ONE,
            TWO,
            _WHOLE,
            _COUNTS,
            _NUMBER,
            _NUMBER,
            ONE,
            ONE,
            ONE,
        ),
    ),
)
