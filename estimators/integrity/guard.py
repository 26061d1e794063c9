"""The monitor of integrity: it drives an estimator, decides whether its word holds, and names the channel at fault.

Everything that it tests is published: estimates, and the readings that the estimator was given (``Witness``). Where a
test alarms, the readings of the last seconds are run again from a copy of the estimator that is older than the fault,
without each single channel and without pairs of the most suspicious (``isolation``). The smallest set without which
nothing alarms, and whose readings contradict the estimate without them, is left out; the estimator of that replay takes
the place of the contaminated one, so that the estimate is right again at once.

    OK -> DEGRADED      at the first alarm; also while channels are left out, or the noise is found larger than declared
    DEGRADED -> LOST    where nothing explains the alarm for 0.75 s
    LOST -> OK          once the state was found again and no test alarms for 5 s
    DEGRADED -> OK      once all channels are used again and no test alarms for 2 s

A channel that is left out is used again once its own tests have passed for 2 s, and each further time for twice as
long. The status of the estimator itself is never improved upon.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mathnavi.estimators.integrity.isolation import Explanation, Replay, explanation
from mathnavi.estimators.integrity.windows import ENERGY, IMPOSSIBLE, JOINT, MEAN, RECKONED, Windows
from mathnavi.estimators.integrity.witness import Recovery, Witness, is_plausible
from mathnavi.estimators.timeout_monitor import worst
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.reading_counts import COUNTS, Unused
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status

_SNAPSHOT, _MEMORY = 0.5, 8.0  # [s] between copies of the estimator, and for which they and the readings are kept
_SETTLED = 2.0  # [s] without an alarm until the estimate is OK again, or for the first time where that is asked
_FOUND = 5.0  # [s] likewise, after it was lost
_READMITTED, _LONGEST = 2.0, 30.0  # [s] for which a channel has to pass its tests, at first and at most
_PATIENCE = 0.75  # [s] for which an alarm may stay without an explanation
_RETRIED = 0.25  # [s] between two attempts to explain one
_WORDS = {MEAN: "its mean", ENERGY: "its spread", JOINT: "all readings together", RECKONED: "dead reckoning"}


class Snapshot(NamedTuple):
    """Copy of estimator and witness after update k, and the channels that were left out."""

    k: int
    copy: Replay
    out: frozenset[int]


class Guarded:
    """An estimator with its monitor.

    ``extra["left_out"]`` (l,) of an estimate is 1 for a channel that was left out, else 0; ``extra["integrity"]`` (1,)
    the worst statistic over its threshold.
    """

    def __init__(
        self,
        estimator: Estimator,
        witness: Witness,
        *,
        recovery: Recovery | None = None,
        trusted: bool = True,
        most_out: int = 2,
    ) -> None:
        """Put the monitor beside an estimator.

        Args:
            estimator: the estimator; its period [s] is that of the updates.
            witness: tests of its channels.
            recovery: how it begins again; None for an estimator that finds its state by itself.
            trusted: True if the estimate is OK as soon as the estimator says so, False if no test may have alarmed for
                2 s before.
            most_out: number of channels that may be left out together; 0 where none can be spared.
        """
        self.period = estimator.period
        self._now, self._recovery = Replay(estimator, witness), recovery
        self._counting = self._now  # whose numbers of unused readings were published last
        self._counted = self._uncounted = np.zeros(len(Unused))
        self._channels = len(witness.names)
        self._most_out = min(most_out, self._channels - 1)
        self._state, self._message = Status.OK if trusted else Status.INITIALISING, ""
        self._begun = False  # whether the estimator was OK for long enough yet
        self._out: frozenset[int] = frozenset()
        self._astray = False  # True for an estimator that has to begin again
        self._k = self._quiet = 0
        self._next_attempt, self._unexplained = 0, -1
        self._past: deque[tuple[float, Sequence[Measurement], Array]] = deque(maxlen=self._updates(_MEMORY) + 1)
        self._snapshots: list[Snapshot] = []
        self._settled, self._found, self._retried = map(self._updates, (_SETTLED, _FOUND, _RETRIED))
        self._between = self._updates(_SNAPSHOT)
        self._passed = np.zeros(len(witness.names), dtype=np.int64)  # updates for which a channel has passed its tests
        self._wait = np.full(len(witness.names), self._updates(_READMITTED))

    @property
    def estimator(self) -> Estimator:
        """The estimator beside which the monitor is now."""
        return self._now.estimator

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate at t [s] with the worse of two statuses, the estimator's and the monitor's.

        ``measurements`` are the readings since the last update, ``command`` (nu,) the input held since then.
        """
        self._k += 1
        self._past.append((t, tuple(measurements), command.copy()))
        ratio = 0.0
        if self._astray and self._recovery is not None:
            self._recover(t, measurements, command)
        estimate = self._now.advance(t, measurements, command, self._out)
        tested = self._now.worst
        if estimate.status is not Status.OK or estimate.covariance is None or tested.test == IMPOSSIBLE:
            self._not_ok(estimate)
        else:
            ratio, test, channel = tested
            stuck = self._now.witness.stuck()
            if ratio > 1.0 or (stuck and set(stuck) - self._out):
                self._alarmed(frozenset(stuck) - self._out, _WORDS.get(test, "a reading"), channel)
            else:
                self._calm()
        return self._published(estimate if self._now.estimate is None else self._now.estimate, ratio)

    def _updates(self, seconds: float) -> int:
        return max(1, round(seconds / self.period))

    def _published(self, estimate: Estimate, ratio: float) -> Estimate:
        """The estimate with the worst of both statuses."""
        left_out = np.zeros(self._channels)
        if self._out:
            left_out[list(self._out)] = 1.0
        extra = {**estimate.extra, "left_out": left_out, "integrity": np.array([ratio])}
        if COUNTS in extra:
            extra[COUNTS] = self._count(extra[COUNTS])
        P, status, message = estimate.covariance, estimate.status, estimate.message
        if self._state is not Status.OK:
            status, message, excess = worst(status, self._state), self._message or message, self._windows.excess
            P = P if P is None or excess <= 1.0 else excess * P
        return Estimate(estimate.t, estimate.x, P, status, extra, message)

    def _count(self, unused: Array) -> Array:
        """Numbers of unused readings so far, those of estimators that were replaced included."""
        if self._counting is not self._now:
            self._counting, self._uncounted = self._now, self._counted - unused
        self._counted = unused + self._uncounted
        return self._counted

    @property
    def _windows(self) -> Windows:
        return self._now.witness.windows

    def _not_ok(self, estimate: Estimate) -> None:
        """Decide on an estimate that the estimator itself does not call OK, or that is impossible."""
        waits = estimate.status in (Status.DEGRADED, Status.LOST) and is_plausible(estimate)
        if self._begun and self._snapshots and not waits:  # it has given up what it knew: by a fault?
            if self._k >= self._next_attempt:
                self._alarmed(frozenset(), "the estimator's own tests", -1)
            return
        self._now.witness.clear()
        self._quiet, self._snapshots = 0, []
        if not is_plausible(estimate) and estimate.status is Status.OK:
            self._state, self._message, self._astray = Status.LOST, "is not finite, or its covariance is none", True

    def _calm(self) -> None:
        """Count an update without an alarm: settle, readmit channels, keep a copy."""
        self._quiet += 1
        windows, due = self._windows, self._k % self._between == 0 or not self._snapshots
        noisy = windows.kappa > windows.declared
        if self._state is Status.OK and self._begun and not (due or noisy or self._out or self._unexplained >= 0):
            return  # nothing changes
        if not self._begun and self._quiet >= self._settled:  # what the start was wrong by is no evidence any more
            self._begun, self._snapshots = True, []
            self._now.witness.clear()
            due = True
        if self._quiet >= self._retried:
            self._unexplained = -1
        needed = self._found if self._state is Status.LOST else self._settled
        if self._out:
            self._readmit()
        if noisy and self._quiet >= needed:
            squares, count = windows.joint(self._settled)
            if count and squares < 1.5 * windows.declared * count:
                windows.kappa, noisy, self._quiet = windows.declared, False, 0
        if self._quiet >= needed and not self._out and not noisy:
            self._state, self._message, self._astray = Status.OK, "", False
        elif self._quiet >= needed and self._state is not Status.INITIALISING:
            self._state = Status.DEGRADED
        if self._state is not Status.LOST and due and self._now.estimate is not None:
            kept = self._k - self._updates(_MEMORY)
            self._snapshots = [each for each in self._snapshots if each.k >= kept]
            self._snapshots.append(Snapshot(self._k, self._now.copy(), self._out))

    def _readmit(self) -> None:
        """Use a channel again that has passed its own tests for long enough."""
        windows, stuck = self._windows, self._now.witness.stuck()
        for i in sorted(self._out):
            passes = windows.is_quiet(i, self._updates(_READMITTED)) and i not in stuck
            self._passed[i] = self._passed[i] + 1 if passes else 0
            if self._passed[i] >= self._wait[i]:
                self._out -= {i}
                windows.forget(i)
                self._passed[i], self._quiet = 0, 0
                self._wait[i] = min(2 * self._wait[i], self._updates(_LONGEST))
                self._message = self._left_out() if self._out else f"uses {self._now.witness.names[i]} again"

    def _alarmed(self, stuck: frozenset[int], what: str, channel: int) -> None:
        """Explain an alarm by channels that are left out or by more noise; else the estimate is lost."""
        self._quiet = 0
        if self._state in (Status.LOST, Status.INITIALISING) and self._recovery is not None:
            self._astray = True  # nothing is known that a replay could go back to
            self._message = self._message or "looks for its state by other means"
            return
        if self._state is Status.LOST:
            return
        if self._k < self._next_attempt:
            return
        if not self._begun and self._recovery is None:  # it has not found its state yet: by itself it will
            self._state, self._message = Status.INITIALISING, "waits until its readings agree with it"
            self._now.witness.clear()
            self._snapshots = []
            return
        if self._state is not Status.INITIALISING:
            self._state = Status.DEGRADED
        named = f"{what} of {self._now.witness.names[channel]}" if channel >= 0 else what
        self._message = f"disagrees with its readings: {named}"
        self._unexplained = self._k if self._unexplained < 0 else self._unexplained
        impatient = self._k - self._unexplained >= self._updates(_PATIENCE)
        if not self._begun and not impatient:  # the covariance of a start may be wrong for a moment: test from now on
            self._now.witness.clear()
            self._snapshots = []
            return
        self._next_attempt = self._k + self._retried
        if found := self._explained(stuck, late=impatient):
            self._adopt(found)
        elif impatient:
            self._state, self._snapshots, self._out, self._unexplained = Status.LOST, [], frozenset(), -1
            self._astray = True
            self._now.witness.clear()

    def _explained(self, stuck: frozenset[int], *, late: bool) -> Explanation | None:
        """The explanation from a copy that is older than the fault, or from the oldest; ``late`` also by noise."""
        if not self._snapshots:
            return None
        old = [each for each in self._snapshots if self._k - each.k >= self._updates(1.5)]
        starts = list(dict.fromkeys(([len(old) - 1] if old else []) + [0]))
        past = list(self._past)
        for at in starts:
            start = self._snapshots[at]
            since = past[len(past) - (self._k - start.k) :]
            found = explanation(start.copy.copy(), start.out, since, self._out, stuck, self._most_out, noise=late)
            if found is not None:
                self._snapshots = self._snapshots[: at + 1]
                return found
        return None

    def _adopt(self, found: Explanation) -> None:
        """Go on with the estimator of a replay."""
        self._now = found.replay
        self._out, self._unexplained = found.out, -1
        self._passed[:] = 0
        if found.out:
            self._message = self._left_out() + (", or another one" if found.ambiguous else "")
        else:
            self._message = f"finds {np.sqrt(self._windows.excess):.1f} times the declared noise"
            self._snapshots = []

    def _left_out(self) -> str:
        return "leaves out " + ", ".join(self._now.witness.names[i] for i in sorted(self._out))

    def _recover(self, t: float, measurements: Sequence[Measurement], command: Array) -> None:
        """Begin again once the state is known."""
        assert self._recovery is not None
        found = self._recovery.found(t, measurements, command)
        if found is not None:
            self._now = Replay(found, self._now.witness)
            self._quiet, self._astray = 0, False
            self._now.witness.clear()
            self._message = "has begun again"


def alone(estimator: Estimator) -> Estimator:
    """The estimator without its monitor, if it has one."""
    return estimator.estimator if isinstance(estimator, Guarded) else estimator
