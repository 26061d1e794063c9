"""Isolation: which readings explain an alarm, by replays of the last seconds without them."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from mathnavi.estimators.integrity.windows import QUIET, Flags, Worst
from mathnavi.estimators.integrity.witness import Witness
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Estimate, Measurement, Status

Reading = tuple[float, Sequence[Measurement], Array]
"""time [s], readings, and the input of an update"""

_SUSPECTS = 4  # channels of which pairs are tried
_MEDIAN = 0.455  # of chi-square with one degree of freedom
_NOISIEST = 25.0  # kappa: five times the declared deviation
_MARGIN = 1.2  # of kappa over what was found


@lru_cache(maxsize=256)
def used_channels(channels: int, out: frozenset[int]) -> Flags:
    """True (l,) for the channels that are used; nobody writes into it."""
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
        """A copy with a state of its own."""
        return Replay(copy.deepcopy(self.estimator), self.witness.copy(), self.estimate, self.worst)


@dataclass(frozen=True)
class Explanation:
    """Channels that are left out, the replay without them, and whether others would explain as much."""

    out: frozenset[int]
    replay: Replay
    ambiguous: bool


def explanation(
    start: Replay,
    out_then: frozenset[int],
    past: Sequence[Reading],
    out_now: frozenset[int],
    stuck: frozenset[int],
    most_out: int,
    *,
    noise: bool,
) -> Explanation | None:
    """The smallest set of channels without which the readings since a start agree; with ``noise`` also larger noise.

    Args:
        start: the estimator from before the fault.
        out_then: channels that were left out at the start.
        past: readings since.
        out_now: channels that are left out now.
        stuck: channels that are known to be at fault.
        most_out: largest number of channels that may be left out.
        noise: True if readings that are all noisier are an explanation too.
    """
    channels = range(len(start.witness.names))
    suspects = sorted(channels, key=lambda i: -start.witness.windows.of_channel(i))
    if most_out:
        whole = start.copy()
        for each in past:  # until the end, alarms or not: who is suspicious?
            whole.advance(*each, out_then)
        suspects = sorted(channels, key=lambda i: -whole.witness.windows.of_channel(i))
    sets = [out_now | stuck, stuck] if stuck else [out_now]
    sets += [frozenset({i}) | stuck for i in channels]
    for many in range(2, most_out + 1):
        sets += [frozenset(each) | stuck for each in combinations(sorted(suspects[:_SUSPECTS]), many)]
    tried = [each for each in dict.fromkeys(sets) if 0 < len(each) <= max(most_out, len(out_now))]
    found = list[tuple[float, frozenset[int], Replay]]()
    for out in sorted(tried, key=len):
        if found and len(out) > len(found[0][1]):
            break
        replay = start.copy()
        for i in out_then - out:
            replay.witness.windows.forget(i)
        worst = _agreement(replay, past, out, new=out - out_then)
        if worst is not None:
            found.append((worst, out, replay))
    if found:
        _, out, replay = min(found, key=lambda each: (each[0], sorted(each[1])))
        return Explanation(out, replay, len(found) > 1)
    return _noisier(start, past) if noise and not out_then else None


def _agreement(replay: Replay, past: Sequence[Reading], out: frozenset[int], new: frozenset[int]) -> float | None:
    """Worst ratio of a replay; None where a test alarms, or a channel that is newly left out is not contradicted.

    An estimator that fails without these channels explains nothing.
    """
    worst, against = 0.0, dict.fromkeys(new, 0.0)
    for each in past:
        try:
            estimate = replay.advance(*each, out)
        except (ArithmeticError, ValueError):  # LinAlgError is a ValueError
            return None
        if estimate.status is not Status.OK or estimate.covariance is None:
            return None
        stuck = replay.witness.stuck()
        if replay.worst.ratio > 1.0 or set(stuck) - out:
            return None
        worst = max(worst, replay.worst.ratio)
        for i in new:
            against[i] = math.inf if i in stuck else max(against[i], replay.witness.windows.of_channel(i))
    return worst if all(each > 1.0 for each in against.values()) else None


def _noisier(start: Replay, past: Sequence[Reading]) -> Explanation | None:
    """All channels with more noise: only the size of innovations is off, neither their mean nor dead reckoning."""
    whole = start.copy()
    whole.witness.clear()
    for each in past:
        whole.advance(*each, frozenset())
    squares, count = whole.witness.windows.joint(len(past))
    kappa = _MARGIN * squares / max(count, 1)
    declared = whole.witness.windows.declared
    if not declared < kappa < _NOISIEST * declared:
        return None
    replay = start.copy()
    replay.witness.windows.kappa = kappa
    return (
        None if _agreement(replay, past, frozenset(), frozenset()) is None else Explanation(frozenset(), replay, False)
    )
