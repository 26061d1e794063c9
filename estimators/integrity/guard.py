"""The monitor of integrity: it drives an estimator, decides whether its word holds, and names the channel at fault.

Everything that it tests is published: estimates, and the readings that the estimator was given (``Witness``). Where a
test alarms, the readings of the last seconds are run again from a copy of the estimator that is older than the fault,
without each single channel and without pairs of the most suspicious (``isolation``). The smallest set without which
nothing alarms, and whose readings contradict the estimate without them, is left out; the estimator of that replay takes
the place of the contaminated one, so that the estimate is right again at once. Replays are spread over the updates, so
that they take about a fifth of the period.

    OK -> DEGRADED      at the first alarm; also while channels are left out, or the noise is found larger than declared
    DEGRADED -> LOST    where nothing explains the alarm for 0.75 s, and no search is under way
    LOST -> OK          once the state was found again and no test alarms for 5 s
    DEGRADED -> OK      once all channels are used again and no test alarms for 2 s

A channel that is left out is used again once its own tests have passed for 2 s, and each further time for twice as
long. The status of the estimator itself is never improved upon.

An estimator that puts a fault down to something else, as one does that finds the slip of wheels where a ray drifts,
fails none of these tests. Where tests fail that are strict about that, the last seconds are searched for a ray without
which they do not. Wheels that slip more than declared and several readings that are wrong look the same: for 5 s the
word is DEGRADED, and an estimator that begins anew is run along (``rival``), as it is for one that is lost.

Where nothing has explained an alarm, its cause may last, and what has found its state again may follow that: for 20 s
the covariance of a pose by ranges is widened by what a fault of one ray may do.

``extra["protection"]`` is what the error of the estimate is within while a fault has not been found yet, if one channel
is at fault (``pose_protection``).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mathnavi.estimators.integrity.isolation import Explanation, Question, Reading, Replay, Search, Start, search
from mathnavi.estimators.integrity.rival import Rivalry, Verdict
from mathnavi.estimators.integrity.windows import ENERGY, IMPOSSIBLE, JOINT, MEAN, RECKONED, SEPARATED, Windows
from mathnavi.estimators.integrity.witness import Recovery, Restart, Witness, is_plausible
from mathnavi.estimators.timeout_monitor import worst
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.reading_counts import COUNTS, Unused
from mathnavi.interfaces.signal_names import figure_names
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status

_SNAPSHOT = 0.5  # [s] between copies of the estimator
MEMORY = 8.0
"""time [s] for which copies and readings are kept: a fault that is named began no earlier, but for the ``pace``"""
_SETTLED = 2.0  # [s] without an alarm until the estimate is OK again, or for the first time where that is asked
_FOUND = 5.0  # [s] likewise, after it was lost
_READMITTED, _LONGEST = 2.0, 30.0  # [s] for which a channel has to pass its tests, at first and at most
_PATIENCE = 0.75  # [s] for which an alarm may stay without an explanation
_WIDENED = 20.0  # [s] after it was lost for which its covariance covers what may have been the cause
_RETRIED = 0.25  # [s] between two attempts to explain one
_OLD = 1.5  # [s] before an alarm: a fault began later than that, as a rule
_SUSPECTED, _UNSUSPECTED = 1.0, 30.0  # [s] between two searches for what strict tests suspect, at first and at most
_SHARE = 0.2  # of the period that replays may take
COST = 1.5e-4
"""[s] of an update that is run again, on a common computer"""
_DOUBT = "finds that its wheels slip more than declared, unless several of its readings are wrong"
_WORDS = {
    MEAN: "the mean error", ENERGY: "the spread", JOINT: "all readings together", RECKONED: "dead reckoning",
    SEPARATED: "an estimate that trusts less",
}  # fmt: skip
_STATISTIC = ("integrity, statistic [-]",)


class Guarded:
    """An estimator with its monitor.

    ``extra["left_out"]`` (l,) of an estimate is 1 for a channel that was left out, else 0; ``extra["integrity"]`` (1,)
    the worst statistic over its threshold; ``extra["protection"]`` (k,) the protection level, NaN if it is not known.
    """

    def __init__(
        self,
        estimator: Estimator,
        witness: Witness,
        *,
        recovery: Recovery | None = None,
        restart: Restart | None = None,
        trusted: bool = True,
        unfound: bool = False,
        most_out: int = 2,
        cost: float = COST,
        rival: Callable[[], Estimator] | None = None,
        common: Array | None = None,
        pace: float = 1.0,
    ) -> None:
        """Attach the monitor to an estimator.

        Args:
            estimator: the estimator; its period [s] is that of the updates.
            witness: tests of its channels.
            recovery: how it begins again; None for an estimator that finds its state by itself.
            restart: how it begins at an estimate; None for one that cannot.
            trusted: True if the estimate is OK as soon as the estimator says so, False if no test may have alarmed for
                2 s before.
            unfound: True for one that cannot find its state: it waits for ``recovery`` to find it.
            most_out: number of channels that may be left out together; 0 where none can be spared.
            cost: time [s] of an update that is run again.
            rival: maker of an estimator that finds its state by itself, to compare with; None for no such.
            common: covariance of errors that no reading tells, added to that of each estimate; None for no such.
            pace: factor of all times of the monitor, for channels that are read more rarely than twice a second.
        """
        self.period, self._pace = estimator.period, pace
        self.memory = pace * MEMORY
        """time [s] before an alarm in which the fault began"""
        self._now, self._recovery, self._restart = Replay(estimator, witness), recovery, restart
        self._counted: Array = np.zeros(len(Unused))
        self._earlier: Array | None = None  # unused readings of estimators before
        self._common = common
        self._channels = len(witness.names)
        self._none_out = np.zeros(self._channels)
        self._none_out.flags.writeable = False
        self._most_out = max(0, min(most_out, self._channels - 1 - len(witness.rebuilt)))
        self._first = Status.OK if trusted else Status.INITIALISING  # word of one that has found its state at first
        self._state, self._message = self._first, ""
        self._begun = False  # whether the estimator was OK for long enough yet
        self._out: frozenset[int] = frozenset()
        self._astray = self._unfound = unfound  # True for one that has to begin again, and that never has
        self._k = self._quiet = 0
        self._next_attempt, self._unexplained = 0, -1
        self._past: deque[Reading] = deque(maxlen=self._updates(MEMORY) + 1)
        self._snapshots: list[Start] = []
        self._search: Search | None = None
        self._later: list[Reading] = []  # readings since it began
        self._asked = Question(frozenset(), frozenset(), 0)
        self._replayed = max(1, round(_SHARE * self.period / cost))  # updates that are run again in one
        self._next_suspicion, self._suspected = 0, self._updates(_SUSPECTED)
        self._settled, self._found, self._retried = map(self._updates, (_SETTLED, _FOUND, _RETRIED))
        self._between = self._updates(_SNAPSHOT)
        self._rivalry = Rivalry(rival, self._settled, self._retried)
        self._lost_at, self._widened = -math.inf, self._updates(_WIDENED)  # the last update in which it was lost
        self._doubted = -self._found  # the last update in which a strict test failed
        self._passed = np.zeros(len(witness.names), dtype=np.int64)  # updates for which a channel has passed its tests
        self._wait = np.full(len(witness.names), self._updates(_READMITTED))

    @property
    def estimator(self) -> Estimator:
        """The estimator next to which the monitor is now."""
        return self._now.estimator

    @property
    def figures(self) -> Mapping[str, tuple[str, ...]]:
        """Names of the numbers of ``extra``: those of the estimator, and of what the monitor adds."""
        witness = self._now.witness
        added = {"left_out": tuple(witness.names), "integrity": _STATISTIC, "protection": witness.levels}
        return {**figure_names(self.estimator), **added}

    @property
    def left_out(self) -> frozenset[int]:
        """Channels that are left out now."""
        return self._out

    def without(self, measurements: Sequence[Measurement], out: frozenset[int]) -> Sequence[Measurement]:
        """The readings without some channels; those for which an estimator has to be rebuilt stay as they are."""
        return self._now.witness.without(measurements, out)

    def update(self, t: float, measurements: Sequence[Measurement], command: Array) -> Estimate:
        """Estimate at t [s] with the worse of two statuses, the estimator's and the monitor's.

        ``measurements`` are the readings since the last update, ``command`` (nu,) the input held since then.
        """
        self._k += 1
        self._past.append((t, tuple(measurements), command.copy()))
        if self._search is not None:
            self._later.append(self._past[-1])
        ratio = 0.0
        if self._astray and self._recovery is not None:
            self._recover(t, measurements, command)
        estimate = self._now.advance(t, measurements, command, self._out)
        if COUNTS in estimate.extra:
            unused = estimate.extra[COUNTS]
            self._counted = unused if self._earlier is None else self._earlier + unused
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
            if self._now.witness.doubtful:
                self._doubted = self._k
        if self._search is not None:
            self._go_on()
        if self._state is Status.LOST:
            self._lost_at = self._k
        if self._in_doubt or self._astray or self._state is Status.LOST:
            self._compare(self._past[-1], self._doubted == self._k)
        else:
            self._rivalry.end()
        return self._published(estimate, ratio)

    @property
    def _in_doubt(self) -> bool:
        """True while it may be that not wheels that slip, but wrong readings, were explained by them."""
        return self._k - self._doubted < self._found

    def _compare(self, reading: Reading, doubted: bool) -> None:
        """Run a freshly begun estimator, and continue with it where it is the better one."""
        verdict, better = self._rivalry.judge(reading, self._now, self._out, lost=self._astray, failed=doubted)
        if better is not None:
            self._replace(better, anew=True)
            self._snapshots, self._search, self._quiet = [], None, 0
            if self._state is Status.INITIALISING and not self._begun:
                self._state, self._message = self._first, ""
            self._astray, self._unexplained = False, -1
        elif verdict is Verdict.AGREES:
            self._astray = False

    def _updates(self, seconds: float) -> int:
        return max(1, round(self._pace * seconds / self.period))

    def _published(self, own: Estimate, ratio: float) -> Estimate:
        """The estimate with the worst of both statuses: the estimator's ``own``, or that of one that replaced it."""
        estimate = own if self._now.estimate is None else self._now.estimate
        left_out = self._none_out
        if self._out:
            left_out = np.zeros(self._channels)
            left_out[list(self._out)] = 1.0
        P, status, message = estimate.covariance, estimate.status, estimate.message
        shown = own if estimate is own or estimate.extra.keys() != own.extra.keys() else estimate  # one may stand in
        level = self._now.witness.protection
        extra = {**shown.extra, "left_out": left_out, "integrity": np.array([ratio]), "protection": level}
        if P is None:
            level[:] = np.nan
        if self._earlier is not None and COUNTS in extra:
            extra[COUNTS] = self._counted
        if self._state is not Status.OK:
            status, message, excess = worst(status, self._state), self._message or message, self._windows.excess
            P = P if P is None or excess <= 1.0 else excess * P
        elif self._in_doubt:
            status, message = worst(status, Status.DEGRADED), message or _DOUBT
        if self._common is not None and P is not None:
            P = P + self._common
        if P is not None and self._k - self._lost_at < self._widened:
            P = self._now.witness.widened(P)
        return Estimate(estimate.t, estimate.x, P, status, extra, message)

    def _replace(self, replay: Replay, *, anew: bool) -> None:
        """Go on with another estimator, one that has begun ``anew`` or was replayed; what was counted so far stays."""
        counted = None if anew or replay.estimate is None else replay.estimate.extra.get(COUNTS)
        self._earlier = self._counted if counted is None else self._counted - counted
        self._now = replay

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
        if self._state is Status.LOST and self._unexplained < 0:
            self._unexplained = self._k
        if self._recovery is not None and self._is_impatient and Status.LOST in (estimate.status, self._state):
            self._lose()  # it refuses its readings since an alarm, or since it has begun again
        self._now.witness.clear()
        self._quiet, self._snapshots, self._search = 0, [], None
        if not is_plausible(estimate) and estimate.status is Status.OK:
            self._state, self._message, self._astray = Status.LOST, "is not finite, or its covariance is none", True

    def _calm(self) -> None:
        """Count an update without an alarm: settle, readmit channels, keep a copy."""
        self._quiet += 1
        if self._unfound:
            return
        if self._search is not None and not self._asked.strict:
            if self._quiet < self._found:
                return  # nothing is decided yet
            self._search = None  # what has passed meanwhile need not be explained any more
        witness = self._now.witness
        windows, due = witness.windows, self._k % self._between == 0 or not self._snapshots
        noisy, suspicious = windows.kappa > windows.declared, witness.suspicious
        changes = due or noisy or suspicious or self._out or self._unexplained >= 0
        if self._state is Status.OK and self._begun and not changes:
            return
        if not self._begun and self._quiet >= self._settled:  # what the start was wrong by is no evidence any more
            self._begun, self._snapshots = True, []
            self._now.witness.clear()
            due = True
        self._unexplained = -1 if self._quiet >= self._retried else self._unexplained
        needed = self._found if self._state is Status.LOST else self._settled
        if self._out:
            self._readmit()
        if noisy and self._quiet >= needed:
            squares, count = windows.joint(self._settled)
            if count and squares < 1.5 * windows.declared * count:
                windows.kappa, noisy, self._quiet = windows.declared, False, 0
                windows.clear()  # what was read with more noise is no evidence any more
                if self._state is Status.LOST:  # it is found, and has to pass without that noise too
                    self._state = Status.DEGRADED
        if self._quiet >= needed and not self._out and not noisy:
            self._state, self._message, self._astray = Status.OK, "", False
        elif self._quiet >= needed and self._state is not Status.INITIALISING:
            self._state = Status.DEGRADED
        if self._state is not Status.LOST and due and self._now.estimate is not None:
            kept = self._k - self._updates(MEMORY)
            self._snapshots = [each for each in self._snapshots if each.k >= kept]
            self._snapshots.append(Start(self._k, self._now.copy(), self._out))
        if suspicious and self._begun and self._k >= self._next_suspicion and self._search is None:
            self._ask(Question(self._out, frozenset(), min(1, self._most_out), strict=True))

    def _readmit(self) -> None:
        """Use a channel again that has passed its own tests for long enough."""
        witness = self._now.witness
        stuck = witness.stuck()
        for i in sorted(self._out):
            passes = witness.is_quiet(i, self._updates(_READMITTED)) and i not in stuck
            self._passed[i] = self._passed[i] + 1 if passes else 0
            if self._passed[i] >= self._wait[i] and self._takes_back(i):
                self._out -= {i}
                witness.forget(i)
                self._passed[i], self._quiet = 0, 0
                self._wait[i] = min(2 * self._wait[i], self._updates(_LONGEST))
                self._message = self._left_out() if self._out else f"uses {witness.names[i]} again"

    def _takes_back(self, channel: int) -> bool:
        """Prepare the estimator for a channel that is used again; False if it cannot be."""
        now = self._now
        if channel not in now.witness.rebuilt:
            return True
        assert self._restart is not None
        assert now.estimate is not None
        begun = self._restart.begun(now.estimate, self._out - {channel}, replayed=False)
        if begun is not None:
            self._replace(Replay(begun, now.witness, now.estimate), anew=True)
        return begun is not None

    def _alarmed(self, stuck: frozenset[int], what: str, channel: int) -> None:
        """Explain an alarm by channels that are left out or by more noise; else the estimate is lost."""
        self._quiet = 0
        if self._state in (Status.LOST, Status.INITIALISING) and self._recovery is not None:
            self._astray = True  # nothing is known that a replay could go back to
            self._message = self._message or "looks for its state by other means"
            return
        if self._state is Status.LOST:
            self._astray = self._rivalry.exists
            return
        if self._search is not None and self._asked.strict:
            self._search = None
        if self._search is not None or self._k < self._next_attempt:
            return
        if not self._begun and self._recovery is None:  # it has not found its state yet: by itself it will
            self._state, self._message = Status.INITIALISING, "waits until its readings agree with it"
            self._astray = self._rivalry.exists
            self._now.witness.clear()
            self._snapshots = []
            return
        if self._state is not Status.INITIALISING:
            self._state = Status.DEGRADED
        named = f"{what} of {self._now.witness.names[channel]}" if channel >= 0 else what
        self._message = f"disagrees with its readings: {named}"
        self._unexplained = self._k if self._unexplained < 0 else self._unexplained
        if not (self._begun or self._is_impatient):  # the covariance of a start may be wrong for a moment: test anew
            self._now.witness.clear()
            self._snapshots = []
            return
        self._next_attempt = self._k + self._retried
        self._ask(Question(self._out, stuck, self._most_out, noise=self._is_impatient))

    def _ask(self, question: Question) -> None:
        """Begin a search from a copy that is older than the fault, and from the oldest."""
        past = list(self._past)
        known = [each for each in self._snapshots if self._k - each.k <= len(past)]  # whose readings since are kept
        old = [each for each in known if self._k - each.k >= self._updates(_OLD)]
        chosen = {each.k: each for each in [*old[-1:], *known[:1]]}.values()
        starts = [replace(each, past=past[len(past) - (self._k - each.k) :]) for each in chosen]
        self._later, self._asked = [], question
        self._search = search(starts, self._later, question, self._restart)

    def _go_on(self) -> None:
        """Run some updates of the search, and decide by what it has found."""
        assert self._search is not None
        try:
            for _ in range(self._replayed):
                next(self._search)
        except StopIteration as end:
            self._search = None
            if end.value is not None:
                self._adopt(end.value)
            elif self._asked.strict:
                self._next_suspicion = self._k + self._suspected
                self._suspected = min(2 * self._suspected, self._updates(_UNSUSPECTED))
            elif self._asked.noise:
                self._lose()
            else:
                self._next_attempt = self._k

    def _adopt(self, found: Explanation) -> None:
        """Go on with the estimator of a replay."""
        replay, anew = found.replay, self._restart is not None and self._restart.stands_in
        if anew and self._restart is not None and replay.estimate is not None:
            begun = self._restart.begun(replay.estimate, found.out, replayed=False)
            if begun is None:
                return
            replay = Replay(begun, replay.witness, replay.estimate, replay.worst)
        self._replace(replay, anew=anew)
        self._snapshots = [each for each in self._snapshots if each.k <= found.k]
        self._out, self._unexplained = found.out, -1
        self._passed[:], self._quiet = 0, 0
        self._state = Status.DEGRADED if self._state is Status.OK else self._state
        if found.out:
            self._message = self._left_out() + (", or another one" if found.ambiguous else "")
        else:
            self._message = f"finds {np.sqrt(self._windows.excess):.1f} times the declared noise"
            self._snapshots = []

    @property
    def _is_impatient(self) -> bool:
        """True where an alarm has not been explained for too long."""
        return 0 <= self._unexplained <= self._k - self._updates(_PATIENCE)

    def _lose(self) -> None:
        """Nothing explains the alarm: the estimate is lost."""
        self._state, self._snapshots, self._out, self._unexplained = Status.LOST, [], frozenset(), -1
        self._astray = True
        self._now.witness.clear()

    def _left_out(self) -> str:
        return "leaves out " + ", ".join(self._now.witness.names[i] for i in sorted(self._out))

    def _recover(self, t: float, measurements: Sequence[Measurement], command: Array) -> None:
        """Begin again once the state is known."""
        assert self._recovery is not None
        found = self._recovery.found(t, measurements, command)
        if found is not None:
            self._replace(Replay(found, self._now.witness), anew=True)
            self._message = "has begun" if self._unfound else "has begun again"
            self._quiet, self._astray, self._unfound = 0, False, False
            self._now.witness.clear()


def alone(estimator: Estimator) -> Estimator:
    """The estimator without its monitor, if it has one."""
    return estimator.estimator if isinstance(estimator, Guarded) else estimator
