"""A worker of a sweep that runs tasks in this process, and is spared the start of another."""

from __future__ import annotations

import pickle
import random
import threading
from collections.abc import Callable

import numpy as np

from mathnavi.sim.sweep import serve
from mathnavi.sim.sweep.child import StoppedError
from mathnavi.sim.sweep.task import Ended, SweepTask


class Here:
    """It runs what a child process would, as it reaches one: pickled. Several of them take turns.

    A task may run a sweep of its own, whose workers are made meanwhile and take turns among themselves.
    """

    _turns = threading.Lock()

    def __init__(self) -> None:
        self._stopped = False
        self._turn = Here._turns

    def run(self, task: SweepTask, content: str, timeout: float | None, compiling: Callable[[], None]) -> Ended:
        if self._stopped:
            raise StoppedError
        assert timeout is None
        with self._turn:
            random.seed(task.seed)
            np.random.seed(task.seed % 2**32)
            Here._turns = threading.Lock()
            try:
                return serve._run(pickle.loads(pickle.dumps(task)), content)
            finally:
                Here._turns = self._turn

    def stop(self) -> None:
        self._stopped = True

    close = stop
