"""The kernels of motion on a sphere and of attitudes, compiled before a run (``sim.engine.compilation``)."""

from __future__ import annotations

from numba import float64

from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE
from mathnavi.models.manifold.attitude import _curvature, _exponential, _logarithm, _transported, nearer
from mathnavi.models.manifold.kernels import distance, inner, project

KERNELS: tuple[Signature, ...] = (
    (_transported, (ONE, ONE, ONE)),
    (_logarithm, (ONE, ONE)),
    (_exponential, (ONE, ONE)),
    (_curvature, (ONE, ONE)),
    (nearer, (ONE, ONE)),
    (distance, (float64, ONE, ONE)),
    (inner, (float64, ONE, ONE)),
    (project, (float64, ONE)),
)
