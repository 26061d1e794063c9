"""Filtered differences of the readings in place of an estimate that the readings contradict.

Over a window of T = 50 ms the estimated rates v^ have to add up to the displacement of the readings, independently of
the model:

    |sum h v^ - sum (y_k - y_{k-1})| / T  <=  s / 2 + 6 sqrt(2) |sigma| / T,

where s is the highest mean rate over such windows, forgotten with a time constant of 1 s, and sigma the standard
deviations of a reading: the declared ones or, if larger, those that the second differences of the readings show, whose
variance is 6 sigma^2. Until this has held once the estimate is initialising. If it stops holding the estimate is lost,
and the output is the newest reading with the differences through a Butterworth low-pass filter. Rates that add up to
more than twice s have diverged.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from mathnavi.estimators.velocity.differences import Differences
from mathnavi.estimators.velocity.readings import innovation, reading_variance
from mathnavi.interfaces.signals import Array, Status
from mathnavi.models.manifold.mission import LagrangianMission
from mathnavi.models.tolerances import TIME_TOLERANCE

_WINDOW = 0.05  # [s] T
_FEWEST = 4  # readings of a window
_MEMORY, _NOISE_MEMORY = 1.0, 0.2  # [s] of s and of sigma
_SHARE, _RUN_AWAY = 0.5, 2.0  # of s
_DEVIATIONS = 6.0 * math.sqrt(2.0)
_CUTOFF = 0.08  # of the rate of the readings


class SafeAnswer:
    """Differences of the readings as a fallback for an observer, and the choice between the two."""

    def __init__(self, mission: LagrangianMission, timeout: float) -> None:
        self._mission, self._manifold = mission, mission.system.manifold
        self._differences = Differences(_CUTOFF / mission.period, timeout, mission)
        self._window = max(_WINDOW, _FEWEST * mission.period)
        self._read = np.ones(self._manifold.dimension)  # 0 for coordinates that nothing reads
        self._past: deque[tuple[float, Array]] = deque()  # (h, displacements (2, n), read and estimated) of the window
        self._T, self._sums = 0.0, np.zeros((2, self._manifold.dimension))  # over it
        self._y: Array | None = None  # the last reading
        self._moved: Array | None = None  # from the one before to it
        self._declared = self._shown = 0.0  # |sigma|^2
        self._scale = 0.0  # s
        self._proven = False  # whether the estimate was trusted at least once
        self.trusted = False  # whether the observer's estimate is to be returned
        self.ran_away = False  # whether its rates have diverged from the readings
        self._events: list[tuple[str, str]] = []

    def ignore(self, coordinates: slice) -> None:
        """Do not compare these coordinates, which nothing reads."""
        self._read[coordinates] = 0.0

    @property
    def status(self) -> Status:
        """Status of an estimate that has its readings."""
        if self.trusted:
            return Status.OK
        return Status.LOST if self._proven else Status.INITIALISING

    def events(self) -> list[tuple[str, str]]:
        """Return the kinds and messages of what has happened since the last call."""
        found, self._events = self._events, []
        return found

    def state(self, age: float) -> Array:
        """State (size + vector_size,) by the differences, an ``age`` [s] after the newest reading."""
        return self._differences.after(age)

    def read(self, y: Array, h: float, estimate: Array | None) -> None:
        """Take a reading y (size,), h [s] after the one before; check the ``estimate`` (size + vector_size,) at it.

        ``estimate`` is None for an observer that starts at this reading.
        """
        self.ran_away = False
        moved = None if self._y is None else innovation(self._manifold, self._y, y)
        if self._y is None or moved is None or not self._differences.correct(y, h):
            self._begin(y)
            return
        self._y, moved = y, self._read * moved
        if self._moved is not None:
            kept = math.exp(-h / _NOISE_MEMORY)
            self._shown = kept * self._shown + (1.0 - kept) * float(np.square(moved - self._moved).sum()) / 6.0
        self._moved = moved
        if estimate is None:
            self._clear()
            self._trust(False)
            return
        x, v = estimate[: self._manifold.size], estimate[self._manifold.size :]
        self._past.append((h, np.stack([moved, h * self._read * self._manifold.components(x, v)])))
        self._T, self._sums = self._T + h, self._sums + self._past[-1][1]
        while self._T - self._past[0][0] >= self._window - TIME_TOLERANCE:
            oldest = self._past.popleft()
            self._T, self._sums = self._T - oldest[0], self._sums - oldest[1]
        if self._window - TIME_TOLERANCE <= self._T:
            self._judge(h)

    def _begin(self, y: Array) -> None:
        """Start at a reading that is not related to those before."""
        self._differences.start(y)
        self._y = y
        self._clear()
        self._declared = self._shown = float(self._read @ reading_variance(self._mission, y))
        self._moved = None

    def _judge(self, h: float) -> None:
        """Check the estimate over the window that ends with the newest reading, h [s] after the one before."""
        T = self._T
        moved, summed = self._sums / T
        self._scale = max(float(np.linalg.norm(moved)), self._scale * math.exp(-h / _MEMORY))
        noise = _DEVIATIONS * math.sqrt(max(self._declared, self._shown)) / T
        self._trust(bool(np.linalg.norm(summed - moved) <= _SHARE * self._scale + noise))
        self.ran_away = not float(np.linalg.norm(summed)) <= _RUN_AWAY * self._scale + noise
        if self.ran_away:
            self._clear()

    def _clear(self) -> None:
        """Forget the window."""
        self._past.clear()
        self._T, self._sums = 0.0, np.zeros((2, self._manifold.dimension))

    def _trust(self, trusted: bool) -> None:
        if self._proven and trusted != self.trusted:
            self._events.append(
                ("estimate-recovered", "the estimated rates are those of the readings again")
                if trusted
                else (
                    "estimate-diverged",
                    "the estimated rates are not those of the readings, whose differences are answered",
                )
            )
        self.trusted = trusted
        self._proven = self._proven or trusted
