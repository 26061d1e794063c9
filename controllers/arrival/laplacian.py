"""The plug-in ``laplacian``: the Laplacian protocol (A.9) to (A.11) on the fast time scale, scaled by s.

    eta_m' = s sum_l a_lm (eta_l - eta_m),        eta' = -s L eta,

which reaches the average of the starts with the rate s lambda_2. A vehicle integrates its own state over each round of
length h with the values that it received last, held:

    eta_m <- eta_m + sum_l w_lm (eta_l - eta_m),        w_lm = a_lm min(s h, 1 / (2 max(d_l, d_m))).

- w is symmetric, because the two ends of a link know both valencies (each sends its own). So the average is conserved
  on a static graph without loss or delay. The exponential that integrates each state exactly with its neighbours held,
  1 - exp(-s h d_m), conserves sum_m eta_m d_m / (1 - exp(-s h d_m)) instead, which is not the average where valencies
  differ, and is slower than lambda_2 by about s h d_m / 2.
- A state is replaced by a convex combination with at least half of itself, so for every h and every s it stays within
  the received ones, and I - W has its eigenvalues between 0 and 1: no disagreement grows or swings.
- While s h max d <= 1/2 the round is I - s h L, and the rate -ln(1 - s h lambda_2) / h, above s lambda_2 by a
  fraction of about s h lambda_2 / 2. With longer rounds the links saturate and it falls behind.

With a delay tau there are two ways to compare. By default (``own = "now"``) a vehicle compares what it hears with what
it is now: it agrees for any delay (a convex combination still), more slowly, and not quite on the average. With ``own =
"then"`` it compares with what it was when the message was sent, as Olfati-Saber and Murray analyse it: the average is
kept, and it is stable if and only if s tau < pi / (2 lambda_n).

An outlier (A.14) sends the average of its neighbours' values, weighted by a_lm. With links this makes the others' graph
its Schur complement (Kron reduction), whose Laplacian is symmetric again and which is connected if the whole graph is:
their average is kept but for the one round by which the outlier lags.

**Outlier detection** (A.14): a vehicle that cannot adjust its arrival so far follows passively, and may come back.

A vehicle is no outlier while (eta_d - h) / eta_m lies in [1 - delta, 1 + delta], with its own estimate eta_m, the
agreed eta_d and the planning period h. As printed, a vehicle that agrees with all others is nevertheless one once
eta_m < h / delta, for its own estimate has not yet been reduced by the h that eta_d is; in the last 5.6 s of a mission
every vehicle is. So is a vehicle that has arrived (eta_m <= 0). And one vehicle whose estimate is so far off that it
moves the average of n beyond the others' bands, by more than about n delta of theirs, makes outliers of all at once; no
vehicle takes part any more then, and all keep their values.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from typing import Literal

from mathnavi.controllers.arrival.inbox import ConsensusPayload, Inbox, edge_weight
from mathnavi.interfaces.bounds import Positive, PositiveFraction, configuration
from mathnavi.interfaces.checks import check
from mathnavi.interfaces.protocols import Consensus
from mathnavi.interfaces.signals import Message
from mathnavi.models.fleet.graph import Neighbourhood
from mathnavi.models.tolerances import TIME_TOLERANCE

DELTA = 0.3  # the thesis' choice


def is_outlier(agreed: float, own: float, planning_period: float, delta: float = DELTA) -> bool:
    """True if eta_d = ``agreed`` [s] is beyond what a vehicle with eta_m = ``own`` [s] can adjust to (A.14)."""
    return not (own > 0.0 and (1.0 - delta) * own <= agreed - planning_period <= (1.0 + delta) * own)


@configuration
class LaplacianConfig:
    """Fields of the plug-in."""

    scaling: Positive = 20.0
    """gain s of the protocol [1/s]"""
    period: Positive = 1.0 / 60.0
    """time h between two rounds [s]"""
    memory: float = 0.25
    """age beyond which a neighbour's message no longer counts [s]"""
    own: Literal["now", "then"] = "now"
    """own value that a vehicle compares with a received one: the present one, or that when the message was sent"""
    delta: PositiveFraction = DELTA
    """tolerance delta of the outlier detection rule (A.14)"""

    def __post_init__(self) -> None:
        check(self.memory, "memory", self.period)


class Laplacian:
    """The Laplacian protocol (A.10): the average, at the rate of the algebraic connectivity."""

    Config = LaplacianConfig
    within_starts = True

    @staticmethod
    def build(config: LaplacianConfig, mission: Neighbourhood) -> Consensus:
        """Return the consensus of one vehicle."""
        return LaplacianConsensus(config, mission)


class LaplacianConsensus:
    """One vehicle's state eta_m."""

    def __init__(self, config: LaplacianConfig, neighbourhood: Neighbourhood) -> None:
        self.period = config.period
        self._config, self._neighbourhood = config, neighbourhood
        self._inbox = Inbox(neighbourhood, ConsensusPayload.sound, 2.0 * neighbourhood.clock_error)
        self._value = self._own = math.nan
        self._begun = 0.0  # [s] the planning period
        self._outlier = True  # until it has a value to contribute
        self._started = False  # and has not yet sent it
        self._times: list[float] = []  # [s] of its rounds within memory
        self._values: list[float] = []  # eta_m after each

    @property
    def value(self) -> float:
        """Own time eta_m [s], at the end of a planning period the agreed eta_d."""
        return self._value

    @property
    def outlier(self) -> bool:
        """True if the vehicle only follows."""
        return self._outlier

    @property
    def refused(self) -> Mapping[str, int]:
        """Number of messages refused, by the reason."""
        return self._inbox.refused

    def start(self, value: float, now: float = 0.0) -> None:
        """Start a planning period with the vehicle's own eta_m, a time of arrival on the clock of ``now``.

        It decides by (A.14), from the estimate and the agreement of the period that ends, whether it takes part: both
        as times to go from that period's beginning. A vehicle without a finite estimate follows, and one that had none
        before takes part again.
        """
        value = float(value)
        judged = math.isfinite(self._own) and math.isfinite(self._value)
        agreed, own = self._value - self._begun, self._own - self._begun
        beyond = judged and is_outlier(agreed, own, self._neighbourhood.planning_period, self._config.delta)
        self._outlier = beyond or not math.isfinite(value)
        self._own, self._begun = value, now
        if not self._outlier:
            self._value = value
        self._started = True

    def exchange(self, t: float, received: Sequence[Message]) -> ConsensusPayload:
        """Exchange one round at t [s]; the first after a start only sends: what came from the period before counts no
        longer.
        """
        if self._started:
            self._started = False
            self._inbox.begin(t, received)
            self._times, self._values = [], []
        else:
            self._inbox.take(t, received)
        if heard := self._last_heard(t):
            value = self._followed(heard) if self._outlier else self._integrated(heard)
            self._value = value if math.isfinite(value) else self._value
        self._remember(t)
        silent = self._outlier and not heard  # what it holds comes from before the start
        return ConsensusPayload(None if silent else self._value, self._neighbourhood.valency, self._outlier)

    def _last_heard(self, t: float) -> list[tuple[float, float, float, float]]:
        """Return, for each neighbour that sent a value within memory, a_lm, eta_l, d_l, and when it was sent [s]."""
        oldest = t - self._config.memory - TIME_TOLERANCE
        return [
            (self._neighbourhood.weights[name], message.payload.value, message.payload.valency, message.t)
            for name, message in sorted(self._inbox.heard.items())  # sums independent of the order of messages
            if message.t >= oldest and message.payload.value is not None
        ]

    def _followed(self, heard: Sequence[tuple[float, float, float, float]]) -> float:
        total = sum(weight for weight, *_ in heard)
        return _within(sum(weight / total * value for weight, value, *_ in heard), [value for _, value, *_ in heard])

    def _integrated(self, heard: Sequence[tuple[float, float, float, float]]) -> float:
        amount = self._config.scaling * self.period
        moved = [(edge_weight(a, amount, self._neighbourhood.valency, d), value, sent) for a, value, d, sent in heard]
        if self._config.own == "then":
            return self._value + sum(w * (value - self._at(sent)) for w, value, sent in moved)
        kept = 1.0 - sum(w for w, *_ in moved)
        values = [value for _, value, _ in moved]
        return _within(kept * self._value + sum(w * value for w, value, _ in moved), [self._value, *values])

    def _at(self, t: float) -> float:
        """Its own state at an earlier time [s]."""
        return self._values[max(0, bisect_right(self._times, t + TIME_TOLERANCE) - 1)]

    def _remember(self, t: float) -> None:
        self._times.append(t)
        self._values.append(self._value)
        while self._times[0] < t - self._config.memory - self.period:
            del self._times[0], self._values[0]


def _within(value: float, values: Sequence[float]) -> float:
    """Clip a convex combination to the range of what it combines, which rounding may exceed."""
    return min(max(value, min(values)), max(values))
