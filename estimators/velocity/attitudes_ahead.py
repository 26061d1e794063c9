"""The kernels of a body that turns, those of its motion and of the tests of its attitude sensor, compiled before a run
(``sim.engine.compilation``).
"""

from __future__ import annotations

from mathnavi.estimators.velocity.encoder_faults import leaps
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO
from mathnavi.models.manifold import attitude

KERNELS: tuple[Signature, ...] = (
    *attitude.KERNELS,
    (leaps, (ONE, TWO, ONE, ONE, TWO)),
)
