"""The kernels of a run with the feasible-set bank and its monitor, compiled before it (``sim.engine.compilation``)."""

from __future__ import annotations

from mathnavi.estimators.integrity import ahead
from mathnavi.estimators.ranging import bank_kernels, replay_kernels
from mathnavi.interfaces.compiled import Signature

KERNELS: tuple[Signature, ...] = bank_kernels.KERNELS + replay_kernels.KERNELS + ahead.KERNELS
