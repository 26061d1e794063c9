"""The claims of the study ``consensus``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mathnavi.controllers.arrival.outlier import DELTA
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.studies.fleet.consensus.exchange import KINDS
from mathnavi.sim.studies.fleet.consensus.following import OutlierFound
from mathnavi.sim.studies.fleet.consensus.runs import (
    LOSS,
    SLOW,
    DelayCase,
    DelayFound,
    LinkCase,
    LinkFound,
    RateCase,
    RateFound,
)

WITHIN = 0.05  # of lambda_2
KEPT = 0.02  # of how far an outlier that takes part would move the agreement
ROUNDS = (400, 800, 1600)  # in a planning period


def claims(
    rates: Mapping[RateCase, RateFound],
    late: Mapping[DelayCase, DelayFound],
    over: Mapping[LinkCase, LinkFound],
    everybody: OutlierFound,
    outliers: Mapping[int, OutlierFound],
) -> list[Claim]:
    """Evaluate all three claims."""
    error = {kind: max((_relative(f) for c, f in rates.items() if c.kind == kind), key=abs) for kind in KINDS}
    near = max(map(abs, error.values())) <= WITHIN
    then = {case.fraction: found.rate for case, found in late.items() if case.own == "then"}
    now = [found.rate for case, found in late.items() if case.own == "now"]
    split = all((rate > 0.0) == (fraction < 1.0) for fraction, rate in then.items())
    links_of = {case.name: found for case, found in over.items()}
    switching, halves = links_of["switching"], links_of["matchings"]
    loss = [found for case, found in over.items() if case.name == "loss"]
    links = switching.least >= (1.0 - WITHIN) * switching.reference
    links &= halves.rate >= (1.0 - WITHIN) * halves.reference and min(f.rate for f in loss) > 0.0
    above = max(found.above for found in rates.values())
    moved, drawn = abs(distance_to_average(outliers[ROUNDS[0]])), abs(distance_to_average(everybody))
    finest = abs(distance_to_average(outliers[ROUNDS[-1]]))
    return [
        Claim(
            "fleet.laplacian", "target", "The error decays at the algebraic connectivity on every kind of graph; "
            "delays and switching shown.", "(A.9) to (A.11)",
            f"within {WITHIN:.0%}; a delay below pi / (2 s lambda_n) decays and one above grows; switching decays at "
            "least as its slowest graph",
            f"off by {', '.join(f'{value:+.1%} ({kind})' for kind, value in error.items())}; with "
            f"{', '.join(f'{fraction:g}' for fraction in then)} of that delay at "
            f"{', '.join(f'{rate:+.2f}' for rate in then.values())}, compared with the own value now at "
            f"{span(now, '.2f')}; switching at >= {switching.least:.2f} (slowest graph {switching.reference:.2f}); two "
            f"halves of a ring at {halves.rate:.3f} (their mean {halves.reference:.3f}); {LOSS:.0%} lost: "
            f"{span([f.rate / f.reference for f in loss], '.3f')} of lambda_2",
            bool(near and split and links and min(now) > 0.0),
        ),
        Claim(
            "A.laplacian-rate", "printed", "The protocol reaches consensus globally exponentially, with the speed of "
            "the algebraic connectivity.", "A.8.1, Theorem 8 of [35]",
            "from any start at most exp(-s lambda_2 t), and exactly that in the slowest mode",
            f"random starts {'never' if above <= 1e-9 else f'up to {above:.1%}'} above it; the slowest mode at "
            f"{span([_relative(f) for f in rates.values()], '+.1%')} of it, which is what rounds of s h lambda_2 <= "
            f"{SLOW:g} add to it",
            bool(near and above <= 1e-9),
        ),
        Claim(
            "A.outlier-keeps-value", "printed", "An outlier that sends the average of its neighbours keeps the graph "
            "connected without affecting the consensus value.", "A.8.3",
            f"the others agree on their own average, to {KEPT:.0%} of what the outlier would move it by",
            f"moved by {moved:.2f} s where taking part moves it by {drawn:.1f} s ({moved / drawn:.1%}), for it lags "
            f"by a round: {finest:.2f} s with {ROUNDS[-1] // ROUNDS[0]} times as many rounds; delta = {DELTA:g}",
            bool(moved <= KEPT * drawn and outliers[ROUNDS[0]].spread[1] <= 1e-3),
        ),
    ]  # fmt: skip


def _relative(found: RateFound) -> float:
    return found.rate / found.connectivity - 1.0


def span(values: Sequence[float], form: str) -> str:
    """The least and the largest."""
    return f"{min(values):{form}} to {max(values):{form}}"


def distance_to_average(found: OutlierFound) -> float:
    """[s] of the others' agreement from their own average, in the first period in which the outlier follows."""
    return float(found.agreed[1] - found.others[1])
