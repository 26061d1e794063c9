"""The kernels of a quadrotor's flight, compiled before it (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64, int64

from mathnavi.controllers.flight.ahead import CERTIFYING, PLAN, PLANNING
from mathnavi.controllers.quadrotor.kernels import (
    advanced,
    attitude_of,
    limited,
    moments,
    rates_of,
    target_at,
    within_tilt,
)
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, ONE_READ, TWO
from mathnavi.models.aerial.kernels import arc_at, state_on
from mathnavi.models.quadrotor.allocation import allocated
from mathnavi.models.quaternion import rotation

STEP = (float64, float64, float64, float64)
OWN: tuple[Signature, ...] = (
    (moments, (TWO, ONE, TWO, ONE, ONE, ONE, ONE, ONE)),
    (rates_of, (TWO, ONE, ONE, float64, float64)),
    (attitude_of, (ONE, float64)),
    (rotation, (ONE,)),
    (allocated, (ONE, TWO, float64)),
    (within_tilt, (ONE, float64, float64)),
    (limited, (ONE, float64)),
    (advanced, (TWO, *PLAN, *STEP)),
    (advanced, (TWO, ONE, TWO, TWO, *STEP)),
    (target_at, (*PLAN, int64, float64)),
    (arc_at, (ONE_READ, float64)),
    (state_on, (ONE, TWO, TWO, float64)),
)
KERNELS = (*PLANNING, *OWN, *CERTIFYING)
