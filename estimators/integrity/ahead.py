"""The kernels of the monitor of a pose, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.integrity.pose_kernels import begin_branch, observe
from mathnavi.estimators.integrity.windows import worst_of_channel
from mathnavi.estimators.integrity.witness import is_possible
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, THREE, TWO, TWO_READ, array

_NUMBER, _WHOLE, _FLAGS = types.float64, array(1, types.int64), array(1, types.boolean)
_FIXED = (TWO_READ, TWO_READ, TWO, ONE, _WHOLE, ONE)  # wall, rays, constants, lengths, thresholds
_KEPT = (TWO, TWO, TWO, THREE, ONE, ONE)  # sums, branches, repeats, responses, what has happened since, levels
_FOUND = (types.int64, _NUMBER, _NUMBER, _NUMBER)  # k, kappa, sigma, slip
_UPDATE = (ONE, TWO, ONE, TWO, _NUMBER, ONE, ONE, ONE, _FLAGS, types.boolean)  # estimates, dt, readings, rays
KERNELS: tuple[Signature, ...] = (
    (observe, (*_FIXED, *_KEPT, *_FOUND, *_UPDATE)),
    (begin_branch, (TWO, THREE, ONE, TWO)),
    (is_possible, (ONE, TWO)),
    (worst_of_channel, (TWO, types.int64, types.int64, _WHOLE, _NUMBER, _NUMBER, ONE)),
)
