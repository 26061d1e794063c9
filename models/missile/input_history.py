"""History of the inputs of delayed thrusters: which one acts when, by the declared delay."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

import numpy as np

from mathnavi.interfaces.signals import Array
from mathnavi.models.tolerances import TIME_TOLERANCE


class InputHistory:
    """The commands of the last ``delay`` [s], each held until the next; before the first one no input acts."""

    def __init__(self, delay: float, size: int) -> None:
        """Begin without a command; ``size`` is the number nu of inputs."""
        self.delay = delay
        self._sent: deque[tuple[float, Array]] = deque()  # when it begins to act [s], and the command
        self._before = np.zeros(size)

    def note(self, t: float, command: Array) -> None:
        """Note a command (nu,) given at t [s]; one that is not finite is not executed."""
        if np.isfinite(command).all():
            self._sent.append((t + self.delay, command.copy()))

    def forget(self, t: float) -> None:
        """Forget the commands that no longer act at t [s]."""
        while self._sent and self._sent[0][0] <= t + TIME_TOLERANCE:
            self._before = self._sent.popleft()[1]

    def acting(self, begin: float, end: float) -> Iterator[tuple[float, Array]]:
        """Durations [s] and inputs (nu,) that act one after the other from ``begin`` to ``end`` [s]."""
        self.forget(begin)
        now, acting = begin, self._before
        for t, command in self._sent:
            if t > end - TIME_TOLERANCE:
                break
            if t > now + TIME_TOLERANCE:
                yield t - now, acting
                now = t
            acting = command
        if end > now + TIME_TOLERANCE:
            yield end - now, acting
