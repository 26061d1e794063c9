"""The kernels of mechanisms, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64, int64

from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, array, named
from mathnavi.models.mechanism.forces import Actuated, acceleration
from mathnavi.models.mechanism.kernels import (
    Mechanism,
    connection,
    curvature,
    difference,
    exponential,
    integrate,
    locate,
    logarithm,
    norm_at,
    transport,
)

MECHANISM = named(Mechanism, int64, int64, ONE, ONE, array(1, int64))
KERNELS: tuple[Signature, ...] = (
    (curvature, (MECHANISM, ONE, ONE, ONE)),
    (logarithm, (MECHANISM, ONE, ONE)),
    (transport, (MECHANISM, ONE, ONE, ONE)),
    (exponential, (MECHANISM, ONE, ONE)),
    (difference, (MECHANISM, ONE, ONE)),
    (connection, (MECHANISM, ONE, ONE)),
    (integrate, (MECHANISM, ONE, ONE, float64)),
    (norm_at, (MECHANISM, ONE, ONE)),
    (locate, (MECHANISM, ONE)),
    (acceleration, (named(Actuated, int64, int64, ONE, ONE, ONE, ONE, ONE), ONE, ONE, ONE)),
)
