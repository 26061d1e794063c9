"""Integrity of a smoothed run: the monitor of the run's filter, and the residuals of the smoother.

The filter is run over the log. What its monitor leaves out at a time, the smoother leaves out too, and since the
earliest time at which the fault may have begun. Where the filter is DEGRADED or LOST, the smoother is DEGRADED, unless
a channel was left out for that also since then.

The filter's innovations tell of a fault when it begins, not of one that the filter has followed; the smoother's
residuals do. Where the model holds, those of a linear smoother, whitened by the noise of the readings, have the
covariance I - W P W' <= I. So over each window of n of them, of one row or of all, sum r^2 exceeds the quantile of
chi^2 with n degrees of freedom, and (sum r)^2 / n that with one, with no more than its probability.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from mathnavi.estimators.integrity.guard import MEMORY, Guarded
from mathnavi.estimators.integrity.windows import Flags
from mathnavi.estimators.stagewise.model import AssociatingModel, StagewiseModel
from mathnavi.estimators.stagewise.smoother import SmoothedStates
from mathnavi.interfaces.protocols import Estimator
from mathnavi.interfaces.signals import Array, Measurement, Status
from mathnavi.models.tolerances import TIME_TOLERANCE

Sample = tuple[float, Sequence[Measurement], Array]
"""time [s], readings since the sample before, and the input (nu,) held since then"""
_WINDOWS = (0.5, 2.0, 5.0, 20.0)  # [s]
_IN_BUILDING = 2.0  # [s] before a doubt in which its cause may have begun, where that is a wrong wall as a rule
_CHANCE = 1e-7  # of an alarm of a test
_CONTRADICTED = "its readings contradict the smoothed run"


@dataclass(frozen=True, eq=False)
class FilterVerdict:
    """Judgement of a run by its filter, at the times t (n,) [s] of its samples."""

    t: Array
    doubts: tuple[str, ...]  # (n,) why it is not sure; empty where it is
    left_out: Array | None  # (n, l) 1 for a channel that is left out, of a filter that can leave channels out
    samples: tuple[Sample, ...]  # without the readings of those channels

    def at(self, t: float) -> tuple[str, Array | None]:
        """The doubt at t [s], and the channels (l,) left out."""
        k = max(0, int(np.searchsorted(self.t, t + TIME_TOLERANCE, side="right")) - 1)
        return self.doubts[k], None if self.left_out is None else self.left_out[k]


def filter_verdict(estimator: Estimator, model: StagewiseModel, samples: Iterable[Sample]) -> FilterVerdict:
    """Run the filter of a smoother's model over all samples of a run."""
    run = tuple(samples)
    doubts, out = list[str](), list[Array]()
    for t, readings, command in run:
        estimate = estimator.update(t, readings, command)
        unsure = estimate.status in (Status.DEGRADED, Status.LOST)
        doubts.append((estimate.message or "is not sure of its estimate") if unsure else "")
        if isinstance(estimator, Guarded):
            out.append(np.asarray(estimate.extra["left_out"], np.float64))
    times = np.array([each[0] for each in run])
    left_out = np.array(out) if out else np.zeros((len(run), 0))
    memory = estimator.memory if isinstance(estimator, Guarded) else MEMORY
    before = _IN_BUILDING if _is_ambiguous(model) else memory
    found = _since_before(times, doubts, np.asarray(left_out.any(axis=1), np.bool_), before)
    if not isinstance(estimator, Guarded) or not out:
        return FilterVerdict(times, found, None, run)
    until = np.searchsorted(times, times + memory, side="right").tolist()
    left_out = np.array([left_out[k:last].max(axis=0) for k, last in enumerate(until)])
    kept = tuple(
        (at, estimator.without(readings, frozenset(np.flatnonzero(row).tolist())) if row.any() else readings, command)
        for (at, readings, command), row in zip(run, left_out, strict=True)
    )
    return FilterVerdict(times, found, left_out, kept)


def _is_ambiguous(model: StagewiseModel) -> bool:
    return isinstance(model, AssociatingModel) and model.is_ambiguous


def _since_before(t: Array, doubts: Sequence[str], explained: Flags, before: float) -> tuple[str, ...]:
    """Doubts (n,) at t (n,) [s], each since ``before`` [s], for the fault behind it may have begun then; where it is
    ``explained`` (n,) by what is left out, the rest was right meanwhile.
    """
    n = len(t)
    open_ones = np.array([bool(doubt) for doubt in doubts], dtype=bool) & ~explained
    following = np.minimum.accumulate(np.where(open_ones, np.arange(n), n)[::-1])[::-1].tolist()
    return tuple(
        doubts[k] or (doubts[after] if after < n and t[after] <= t[k] + before else "")
        for k, after in enumerate(following)
    )


def contradictions(model: StagewiseModel, states: SmoothedStates) -> list[tuple[float, float]]:
    """Times [s], from the reading before to that after, of windows whose residuals cannot be chance.

    A model that associates readings with walls compares them with its map by itself. Of one whose state has constants,
    such as a scale error, all times: what makes these wrong makes the whole run wrong.
    """
    if _is_ambiguous(model):
        return []
    t, residuals = [], []
    for at, x, readings in zip(states.t.tolist(), states.x, states.used, strict=True):
        for y in readings:
            t.append(at)
            residuals.append(model.residual(x, y)[0])
    if not t:
        return []
    times, r = np.array(t), np.array(residuals)
    before, after = [-np.inf, *t[:-1]], [*t, np.inf]
    found = [(before[k], after[end]) for k, end in improbable(times, r, _WINDOWS)]
    return [(-np.inf, np.inf)] if found and getattr(model, "has_constants", False) else _united(found)


def improbable(t: Array, r: Array, windows: Sequence[float]) -> list[tuple[int, int]]:
    """First one and end of those whitened residuals r (n, m) at t (n,), over windows of each row and of all, that
    cannot be chance; NaN for none.
    """
    found = []
    for row in (*range(r.shape[1]), None):
        values = r if row is None else r[:, [row]]
        known = np.isfinite(values)
        values = np.where(known, values, 0.0)
        n, mean, energy = (
            np.concatenate([[0.0], np.cumsum(each.sum(axis=1))]) for each in (known, values, np.square(values))
        )
        for window in windows:
            ends = np.searchsorted(t, t + window, side="left")
            count = n[ends] - n[:-1]
            asked = np.maximum(count, 1.0)
            wrong = energy[ends] - energy[:-1] > chdtri(asked, _CHANCE)
            if row is not None:
                wrong |= np.square(mean[ends] - mean[:-1]) / asked > chdtri(1, _CHANCE)
            found += [(k, int(ends[k])) for k in np.flatnonzero(wrong & (count > 0.0)).tolist()]
    return found


def _united(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Spans that do not overlap."""
    united: list[tuple[float, float]] = []
    for begin, end in sorted(spans):
        if united and begin <= united[-1][1]:
            united[-1] = united[-1][0], max(end, united[-1][1])
        else:
            united.append((begin, end))
    return united


class Verdict:
    """Judgement of a smoothed run by its filter and by its residuals."""

    def __init__(self, by_filter: FilterVerdict | None, spans: Sequence[tuple[float, float]]) -> None:
        """``spans`` are the ``contradictions``; without a filter they alone count."""
        self._by_filter = by_filter
        self._begins = np.array([begin for begin, _ in spans])
        self._ends = np.array([end for _, end in spans])

    def at(self, t: float) -> tuple[str, Array | None]:
        """Why the smoothed run is not sure at t [s], empty where it is, and the channels (l,) that are left out."""
        doubt, out = ("", None) if self._by_filter is None else self._by_filter.at(t)
        k = int(np.searchsorted(self._begins, t + TIME_TOLERANCE, side="right")) - 1
        if k >= 0 and t <= self._ends[k] + TIME_TOLERANCE:
            return _CONTRADICTED, out
        return doubt, out
