"""The kernels by which vehicles keep apart, compiled before they fly (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64

from mathnavi.controllers.flight.ahead import PLAN
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO
from mathnavi.models.aerial.kernels import state_on
from mathnavi.models.aerial.plan_distance import _least_squared

KERNELS: tuple[Signature, ...] = (
    (_least_squared, (*PLAN, *PLAN, float64, float64)),
    (state_on, (ONE, TWO, TWO, float64)),
)
