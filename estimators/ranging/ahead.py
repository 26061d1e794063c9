"""The kernels of a run with the feasible-set bank and its monitor, compiled before it (``sim.engine.compilation``)."""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.integrity import pose_kernels, windows, witness
from mathnavi.estimators.ranging import bank_kernels
from mathnavi.estimators.ranging.bank_kernels import WALL
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, THREE, TWO, array, combined, named

_NUMBER, _WHOLE, _FLAGS = types.float64, array(1, types.int64), array(1, types.boolean)
_BRANCHES = named(pose_kernels.Branches, TWO, THREE, TWO, _WHOLE)
_REPEATS = named(pose_kernels.Repeats, ONE, ONE, ONE, _WHOLE)
MONITOR: tuple[Signature, ...] = (
    (pose_kernels.predicted, (ONE, TWO, ONE, ONE, _NUMBER, _NUMBER)),
    (pose_kernels.innovations, (WALL, ONE, combined(_NUMBER, _NUMBER, _NUMBER), ONE, TWO, ONE, _FLAGS)),
    (pose_kernels.reckoned, (_BRANCHES, _WHOLE, ONE, ONE, ONE, _NUMBER, _NUMBER)),
    (pose_kernels.branch, (_BRANCHES, ONE, TWO)),
    (pose_kernels.note_repeats, (_REPEATS, ONE, ONE)),
    (windows._add, (TWO, types.int64, ONE, ONE, _NUMBER)),
    (windows._worst, (TWO, types.int64, _FLAGS, _WHOLE, _NUMBER, _NUMBER, ONE)),
    (witness._is_possible, (ONE, TWO)),
)
KERNELS: tuple[Signature, ...] = bank_kernels.KERNELS + MONITOR
