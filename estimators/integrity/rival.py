"""Rivals: an estimator whose word is in doubt is compared with a second one, freshly begun.

An estimator that finds by itself that wheels slip follows nearly all readings from a wrong pose too: where the motion
is free, three rays do not contradict any of three coordinates, and no test of its innovations fails. So one that knows
nothing of the past takes the readings along. Where it is elsewhere and passes all tests without any slip for a while
in which the first does not, it is the better one. Where it fails a test, another one begins; where it is at the same
place, it has nothing to add.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto

from mathnavi.estimators.integrity.isolation import Reading, Replay
from mathnavi.estimators.integrity.windows import QUIET
from mathnavi.estimators.integrity.witness import Witness
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Estimate, Status


class Verdict(Enum):
    """Verdict of the readings so far on a rival."""

    OPEN = auto()
    AGREES = auto()
    FAILED = auto()
    BETTER = auto()


class Rival:
    """An estimator that has begun without what another one believes, with tests that no slip excuses."""

    def __init__(self, estimator: Estimator, witness: Witness, out: frozenset[int]) -> None:
        """``witness`` is that of the other one, of which a copy begins again; the channels in ``out`` are left out."""
        tests = witness.copy()
        tests.clear()
        tests.windows.kappa, tests.strict = tests.windows.declared, True
        self.replay, self.out = Replay(estimator, tests), out
        self._passed, self._alone = 0, False  # updates since it is sure; whether the other one has failed in them

    def judge(self, reading: Reading, other: Estimate, *, lost: bool, failed: bool, needed: int) -> Verdict:
        """Take a reading, and compare with the ``other`` estimate of that time, which has ``failed`` a test or not.

        Where the other one is ``lost``, the rival is better as soon as it is sure; else where it has passed all tests
        for as many updates as are ``needed``, and the other one has not.
        """
        replay = self.replay
        estimate = replay.advance(*reading, self.out)
        if estimate.status is not Status.OK or estimate.covariance is None:
            replay.witness.clear()
            replay.worst, self._passed, self._alone = QUIET, 0, False
            return Verdict.OPEN
        if replay.worst.ratio > 1.0:
            return Verdict.FAILED
        self._passed, self._alone = self._passed + 1, self._alone or failed
        if other.covariance is not None and replay.witness.agree(estimate, other):
            return Verdict.AGREES
        return Verdict.BETTER if lost or (self._alone and self._passed >= needed) else Verdict.OPEN


class Rivalry:
    """The rivals of an estimator, one after the other."""

    def __init__(self, begin: Callable[[], Estimator] | None, needed: int, pause: int) -> None:
        """``begin`` makes an estimator that finds its state by itself, None for no such; one that has nothing more to
        say is followed by the next after a ``pause`` [updates].
        """
        self.exists = begin is not None
        self._begin, self._needed, self._pause = begin, needed, pause
        self._rival: Rival | None = None
        self._paused = 0

    def end(self) -> None:
        """Go on without a rival."""
        self._rival = None

    def judge(
        self, reading: Reading, now: Replay, out: frozenset[int], *, lost: bool, failed: bool
    ) -> tuple[Verdict, Replay | None]:
        """Return the verdict of the reading on a rival of the estimator ``now``, without the channels in ``out``, and
        the rival where it is the better one; see ``Rival.judge``.
        """
        self._paused -= 1
        if self._begin is None or now.estimate is None or out & now.witness.rebuilt:
            return Verdict.OPEN, None
        if self._rival is not None and self._rival.out != out:
            self._rival = None
        if self._rival is None:
            if self._paused > 0:
                return Verdict.OPEN, None
            self._rival = Rival(self._begin(), now.witness, out)
        rival = self._rival
        verdict = rival.judge(reading, now.estimate, lost=lost, failed=failed, needed=self._needed)
        if verdict is not Verdict.OPEN:
            self._rival, self._paused = None, self._pause
        rival.replay.witness.strict = verdict is not Verdict.BETTER
        return verdict, rival.replay if verdict is Verdict.BETTER else None
