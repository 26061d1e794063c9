"""Isolation: which readings explain an alarm, by replays of the last seconds without them.

A search is a generator: it yields after each update that it has run again, so that its caller may spread it over its
own updates, and returns what it has found. Readings that come meanwhile are run too, in the end.

Sets are tried in the order of what they ask for: one ray, then the odometry, then two rays. Without odometry three rays
follow whatever they read, so that it explains nearly everything; but what a ray has done wrong is explained by leaving
out that ray as well, and odometry as declared would hardly agree with the others by chance.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from mathnavi.estimators.integrity.windows import QUIET, Flags, Worst
from mathnavi.estimators.integrity.witness import Restart, Witness
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status

Reading = tuple[float, Sequence[Measurement], Array]
"""time [s], readings, and the input of an update"""

_SUSPECTS = 4  # channels of which pairs are tried
_NOISIEST = 25.0  # kappa: five times the declared deviation
_MARGIN = 1.2  # of kappa over what was found
_RAY, _REBUILT = 2, 3  # what leaving out a channel asks for


@lru_cache(maxsize=256)
def used_channels(channels: int, out: frozenset[int]) -> Flags:
    """True (l,) for the channels that are used; no one writes into it."""
    used: Flags = np.ones(channels, dtype=np.bool_)
    used[list(out)] = False
    return used


@dataclass
class Replay:
    """An estimator with its witness, run over readings."""

    estimator: Estimator
    witness: Witness
    estimate: Estimate | None = None
    worst: Worst = QUIET

    def advance(self, t: float, measurements: Sequence[Measurement], command: Array, out: frozenset[int]) -> Estimate:
        """Update without some channels, and test what it says."""
        witness, before = self.witness, self.estimate
        estimate = self.estimator.update(t, witness.without(measurements, out) if out else measurements, command)
        self.estimate = estimate
        if estimate.covariance is not None:
            used = used_channels(len(witness.names), out)
            self.worst = witness.take(before, estimate, measurements, command, used)
        return estimate

    def copy(self) -> Replay:
        """A copy with its own state."""
        return Replay(copy.deepcopy(self.estimator), self.witness.copy(), self.estimate, self.worst)


@dataclass(frozen=True)
class Start:
    """A copy of an estimator after update k, the channels left out then, and the readings since."""

    k: int
    replay: Replay
    out: frozenset[int]
    past: Sequence[Reading] = ()


@dataclass(frozen=True)
class Explanation:
    """Channels that are left out, the replay without them, whether others would explain as much, and its start."""

    out: frozenset[int]
    replay: Replay
    ambiguous: bool
    k: int


@dataclass(frozen=True)
class Question:
    """Request to a search: the channels that are left out ``now`` and those that are known to be ``stuck``, the
    largest number of rays that may be left out, and whether ``noise`` may be an explanation, or nothing but rays while
    tests are ``strict``.
    """

    now: frozenset[int]
    stuck: frozenset[int]
    most_out: int
    noise: bool = False
    strict: bool = False


Search = Generator[None, None, Explanation | None]


def search(
    starts: Iterable[Start], later: Sequence[Reading], question: Question, restart: Restart | None = None
) -> Search:
    """The smallest set of channels without which the readings since a start agree, from the first start that has one.

    ``later`` are the readings that come while the search goes on; ``restart`` makes estimators without channels that
    they have to be built for.
    """
    for start in starts:
        found = yield from _explanation(start, question, restart)
        if found is None:
            continue
        k = 0
        while k < len(later):
            if not _agrees(found.replay, later[k], found.out):
                break
            k += 1
            yield
        else:
            return found
    return None


def _explanation(start: Start, question: Question, restart: Restart | None) -> Search:
    witness, now, stuck = start.replay.witness, question.now, question.stuck
    rebuilt = witness.rebuilt
    without = restart.without if restart is not None and question.most_out and not question.strict else frozenset[int]()
    rays = [i for i in range(len(witness.names)) if i not in witness.rebuilt]

    def asks(out: frozenset[int]) -> int:
        return _RAY * len(out - rebuilt) + _REBUILT * len(out & rebuilt)

    most = max(question.most_out, len(now))
    sets = [now | stuck, stuck, *(frozenset({i}) | stuck for i in rays), *(frozenset({i}) for i in without)]
    found = list[tuple[float, frozenset[int], Replay]]()
    tried = set[frozenset[int]]()
    for pairs in (False, True):
        if pairs:
            if found or question.most_out < 2:
                break
            whole = _begun(start, start.out, restart, strict=question.strict)
            if whole is None:
                break
            for each in start.past:  # until the end, alarms or not: who is suspicious?
                whole.advance(*each, start.out)
                yield
            suspects = sorted(rays, key=lambda i: -whole.witness.against(i))[:_SUSPECTS]
            sets = [frozenset(each) | stuck for each in combinations(sorted(suspects), 2)]
        for out in sorted(dict.fromkeys(sets), key=asks):
            if out in tried or not 0 < len(out) <= most:
                continue
            if found and asks(out) > asks(found[0][1]):
                break
            tried.add(out)
            replay = _begun(start, out, restart, strict=question.strict)
            if replay is None:
                continue
            worst = yield from _agreement(replay, start.past, out, new=out - start.out)
            if worst is not None:
                found.append((worst, out, replay))
    if found:
        _, out, replay = min(found, key=lambda each: (each[0], sorted(each[1])))
        replay.witness.strict = False
        return Explanation(out, replay, len(found) > 1, start.k)
    if question.noise and not start.out:
        return (yield from _noisier(start, restart))
    return None


def _begun(start: Start, out: frozenset[int], restart: Restart | None, *, strict: bool = False) -> Replay | None:
    """A replay from a start that leaves out some channels; None where no estimator can begin so."""
    replay = start.replay
    if restart is not None and (restart.stands_in or (out ^ start.out) & replay.witness.rebuilt):
        if replay.estimate is None:
            return None
        estimator = restart.begun(replay.estimate, out, replayed=True)
        if estimator is None:
            return None
        replay = Replay(estimator, replay.witness.copy(), replay.estimate, replay.worst)
    else:
        replay = replay.copy()
    replay.witness.strict = strict
    for i in start.out - out:
        replay.witness.forget(i)
    return replay


def _agrees(replay: Replay, reading: Reading, out: frozenset[int]) -> bool:
    """Run a reading; False where a test alarms, or the estimator fails without these channels."""
    try:
        estimate = replay.advance(*reading, out)
    except (ArithmeticError, ValueError):  # LinAlgError is a ValueError
        return False
    if estimate.status is not Status.OK or estimate.covariance is None or replay.worst.ratio > 1.0:
        return False
    return not set(replay.witness.stuck()) - out


def _agreement(
    replay: Replay, past: Sequence[Reading], out: frozenset[int], new: frozenset[int]
) -> Generator[None, None, float | None]:
    """Worst ratio of a replay; None where a test alarms, or a channel that is newly left out is not contradicted.

    An estimator that fails without these channels explains nothing.
    """
    worst, against = 0.0, dict.fromkeys(new, 0.0)
    for each in past:
        agrees = _agrees(replay, each, out)
        yield
        if not agrees:
            return None
        stuck = replay.witness.stuck()
        worst = max(worst, replay.worst.ratio)
        for i in new:
            against[i] = math.inf if i in stuck else max(against[i], replay.witness.against(i))
    return worst if all(each > 1.0 for each in against.values()) else None


def _noisier(start: Start, restart: Restart | None) -> Search:
    """All channels with more noise: only the size of innovations is off, neither their mean nor dead reckoning."""
    whole, replay = (_begun(start, frozenset(), restart) for _ in range(2))
    if whole is None or replay is None:
        return None
    whole.witness.clear()
    for each in start.past:
        whole.advance(*each, frozenset())
        yield
    squares, count = whole.witness.windows.joint(len(start.past))
    kappa = _MARGIN * squares / max(count, 1)
    declared = whole.witness.windows.declared
    if not declared < kappa < _NOISIEST * declared:
        return None
    replay.witness.windows.kappa = kappa
    agreed = yield from _agreement(replay, start.past, frozenset(), frozenset())
    return None if agreed is None else Explanation(frozenset(), replay, False, start.k)
