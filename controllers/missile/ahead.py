"""The kernels of missile guidance, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64

from mathnavi.controllers.missile.optimiser import _flown, _lowest
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO, combined
from mathnavi.models.missile.kernels import (
    flow,
    from_joints,
    inverse_dynamics,
    joint_accelerations,
    states_on,
    to_joints,
)

NUMBERS = combined(float64, float64, float64, float64)
KERNELS: tuple[Signature, ...] = (
    (_flown, (ONE, ONE, TWO, NUMBERS, float64)),
    (_lowest, (ONE, float64, ONE, NUMBERS, float64)),
    (states_on, (ONE, TWO, TWO, ONE, NUMBERS, float64)),
    (flow, (ONE, ONE, float64, NUMBERS, float64)),
    (joint_accelerations, (TWO, TWO, NUMBERS)),
    (inverse_dynamics, (TWO, TWO, NUMBERS)),
    (from_joints, (TWO,)),
    (to_joints, (TWO,)),
)
