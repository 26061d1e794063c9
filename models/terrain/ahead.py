"""The kernel of sight over terrain, which flights with radars call, compiled ahead (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64

from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO, TWO_READ
from mathnavi.models.terrain.kernels import sights

KERNELS: tuple[Signature, ...] = ((sights, (TWO_READ, float64, ONE, TWO)),)
