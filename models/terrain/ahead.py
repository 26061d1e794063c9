"""The kernel of sight over terrain, which flights with radars call, compiled ahead (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64

from mathnavi.models.terrain.kernels import sights
from mathnavi.sim.interfaces.compiled import Signature
from mathnavi.sim.interfaces.kernel_types import ONE, TWO, TWO_READ

KERNELS: tuple[Signature, ...] = ((sights, (TWO_READ, float64, ONE, TWO)),)
