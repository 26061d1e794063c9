"""The kernels of an arm, those of its motion and of the tests of its encoders, compiled before a run
(``sim.engine.compilation``).
"""

from __future__ import annotations

from mathnavi.estimators.velocity.encoder_faults import leaps
from mathnavi.interfaces.compiled import Signature
from mathnavi.interfaces.kernel_types import ONE, TWO
from mathnavi.models.mechanism import forces

KERNELS: tuple[Signature, ...] = (
    *forces.KERNELS,
    (leaps, (ONE, TWO, ONE, ONE, TWO)),
)
