"""The kernels of a run with a Kalman filter of a pose, compiled before it (``sim.engine.compilation``).

Its monitor begins with the feasible-set bank where the filter has lost the pose, or does not know it yet.
"""

from __future__ import annotations

from numba.core import types

from mathnavi.estimators.ranging import ahead
from mathnavi.estimators.ranging.bank_kernels import INNOVATIONS, SENSORS, WALL
from mathnavi.estimators.ranging.kalman_kernels import step_within
from mathnavi.estimators.ranging.wall_choice_kernels import condition_among_walls, learn_correlation
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO

KERNELS: tuple[Signature, ...] = (
    *ahead.KERNELS,
    (step_within, (WALL, *(types.float64,) * 4)),
    (condition_among_walls, (ONE, TWO, ONE, WALL, SENSORS, INNOVATIONS)),
    (learn_correlation, (INNOVATIONS,)),
)
