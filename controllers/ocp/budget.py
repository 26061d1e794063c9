"""Budget of CPU time of a call that solves several programmes: each of them gets what the others have left."""

from __future__ import annotations

import dataclasses
import math

from mathnavi.controllers.ocp.backend import Options
from mathnavi.models.solver_process import cpu_time

_PARTS = 64  # of the budget: a solver that is kept for other calls is built anew only for another number of parts


class Budget:
    """CPU time of a call, ``options.seconds`` from when this is made; a solve may exceed it by a sixty-fourth."""

    def __init__(self, options: Options) -> None:
        """Begin to count."""
        self._seconds, self._began = options.seconds, cpu_time()

    @property
    def spent(self) -> bool:
        """True if nothing is left."""
        return cpu_time() - self._began >= self._seconds

    def left(self, options: Options) -> Options:
        """The options of the next solve, with the time [s] that is left; a sixty-fourth where nothing is."""
        parts = math.ceil(_PARTS * (1.0 - (cpu_time() - self._began) / self._seconds))
        return dataclasses.replace(options, seconds=self._seconds * max(1, parts) / _PARTS)
