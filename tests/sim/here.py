"""A worker of a sweep that runs tasks in this process, and is spared the start of another."""

from __future__ import annotations

import pickle
import random
from collections.abc import Callable

import numpy as np

from mathnavi.sim.sweep import serve
from mathnavi.sim.sweep.child import StoppedError
from mathnavi.sim.sweep.task import Ended, SweepTask


class Here:
    """It runs what a child process would, as it reaches one: pickled."""

    def __init__(self) -> None:
        self._stopped = False

    def run(self, task: SweepTask, content: str, timeout: float | None, compiling: Callable[[], None]) -> Ended:
        if self._stopped:
            raise StoppedError
        assert timeout is None
        random.seed(task.seed)
        np.random.seed(task.seed % 2**32)
        return serve._run(pickle.loads(pickle.dumps(task)), content)

    def stop(self) -> None:
        self._stopped = True

    close = stop
