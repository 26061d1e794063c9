"""Judgement of a run under a fault, in the study of integrity: how long is an estimate sure and wrong?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.estimators.integrity.windows import Flags
from mathnavi.interfaces.signals import Array, Estimate, Status
from mathnavi.sim.metrics.sure_and_wrong import LASTING, POSE, lasting, sure_and_wrong


@dataclass(frozen=True)
class Timing:
    """Times of a run [s]: between its updates, of the fault, and until which its start may be wrong."""

    period: float
    onset: float
    end: float
    settled: float


@dataclass(frozen=True)
class Watched:
    """A run of an estimator under a fault."""

    estimator: str
    fault: str
    seed: int
    monitored: bool


@dataclass(frozen=True)
class Outcome:
    """Result of a run."""

    position: float  # share of the time from the fault on in which it is sure and wrong
    rest: float  # likewise, of the heading, or of the velocity of a flight, or of its attitude
    false: float  # share of the time before the fault in which it is not OK, from 3 s on
    detected: float  # [s] from the fault until it is not OK; NaN if it always is
    recovered: float  # [s] from the end of the fault until it is OK and right for good; NaN if it never is
    judged: float  # share of the time from the fault on in which it is sure and wrong, or beyond its protection level
    # while the fault cannot be found yet; one that publishes no level promises nothing then
    kept: float  # share of the time from the fault on, while it is OK, in which the error is within the level
    level: float  # [m] median of the level of the position in that time
    findable: float  # [s] from the fault until it can be found; NaN if it never can


def judged(
    estimates: Sequence[Estimate],
    truth: Array,
    found: Flags,
    timing: Timing,
    *,
    persists: bool = False,
    blocks: tuple[slice, ...] = POSE,
) -> Outcome:
    """Judge the estimates of a run by the truth (n, d) of poses, or of what the ``blocks`` are; ``found`` (n,) says
    from when on the fault can be found. One recovers from a fault that ``persists`` while it does.
    """
    period = timing.period
    ok = np.array([each.status is Status.OK for each in estimates])
    difference = np.array([each.x for each in estimates]) - truth
    if blocks is POSE:
        difference[:, 2] -= 2.0 * math.pi * np.round(difference[:, 2] / (2.0 * math.pi))
    none, no_level = np.full((truth.shape[1],) * 2, math.nan), np.full(len(blocks), math.nan)
    P = np.array([none if each.covariance is None else each.covariance for each in estimates])
    level = np.array([each.extra.get("protection", no_level) for each in estimates])
    times: Array = period * np.arange(len(ok), dtype=np.float64)
    errors = np.column_stack([np.linalg.norm(difference[:, block], axis=1) for block in blocks])
    wrong = sure_and_wrong(times, ok, difference, P, blocks).T
    beyond = [lasting(times, ok & each) for each in (errors > level).T]
    onset, end = round(timing.onset / period), round((timing.onset if persists else timing.end) / period)
    later = slice(onset, None)
    missing = np.flatnonzero(~ok[onset:])
    bad = np.flatnonzero(~ok | wrong.any(axis=0))
    whole = int(bad[-1]) + 1 if len(bad) else 0  # the update from which on it is right for good
    settled, sure = len(ok) - round(LASTING / period), np.flatnonzero(ok[later] & ~np.isnan(level[later, 0])) + onset
    first, before = np.flatnonzero(found[later]), ~ok[round(timing.settled / period) : onset]
    return Outcome(
        position=wrong[0][later].mean().item(),
        rest=wrong[1:, later].any(axis=0).mean().item(),
        false=before.mean().item() if len(before) else 0.0,
        detected=period * float(missing[0]) if len(missing) else math.nan,
        recovered=period * max(0, whole - end) if whole <= settled else math.nan,
        judged=np.where(found, wrong, beyond)[:, later].any(axis=0).mean().item(),
        kept=(errors <= level)[sure].all(axis=1).mean().item() if len(sure) else math.nan,
        level=float(np.median(level[sure, 0])) if len(sure) else math.nan,
        findable=period * float(first[0]) if len(first) else math.nan,
    )
