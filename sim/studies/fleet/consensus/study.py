"""Section A.8.1 measured: the Laplacian protocol's rate on graphs of each kind, and what delays, links and outliers do.

Every value passes through the network of ``mathnavi.sim.engine.network`` in messages, in rounds short enough that they
are nearly the continuous time of (A.11), unless said otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

from annotated_types import Le

from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Condition, Count, Within, configuration
from mathnavi.sim.studies.fleet.consensus import claims
from mathnavi.sim.studies.fleet.consensus.claims import ROUNDS, distance_to_average, span
from mathnavi.sim.studies.fleet.consensus.exchange import KINDS
from mathnavi.sim.studies.fleet.consensus.figure import figure
from mathnavi.sim.studies.fleet.consensus.following import (
    ClockCase,
    ClockFound,
    OutlierCase,
    OutlierFound,
    clocks_agree,
    with_outlier,
)
from mathnavi.sim.studies.fleet.consensus.runs import (
    LOSS,
    DelayCase,
    DelayFound,
    LinkCase,
    LinkFound,
    RateCase,
    RateFound,
    delayed,
    over_links,
    rate_on,
)
from mathnavi.sim.studies.framework.jobs import Jobs
from mathnavi.sim.studies.framework.study import Setup, StudyResult

_SIZES = (4, 8, 16)
_MOST = 256  # vehicles
EvenCount = Annotated[  # a ring has two halves
    int,
    Condition(
        lambda count: _SIZES[0] <= count <= _MOST and count % 2 == 0, f"an even number from {_SIZES[0]} to {_MOST}"
    ),
]
_FRACTIONS = (0.5, 0.9, 1.1, 1.5)  # of the bound on the delay
_AMOUNTS = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0)  # s h d_max
_CLOCKS = (
    ClockCase("the same both ways, 20 ms", (0.02, 0.02), (0.02, 0.02)),
    ClockCase("30 ms there, 10 ms back", (0.03, 0.03), (0.01, 0.01)),
    ClockCase("0 to 40 ms, drawn", (0.0, 0.04), (0.0, 0.04)),
    ClockCase("20 ms, clocks drift by up to 50 ppm", (0.02, 0.02), (0.02, 0.02), 5e-5),
    ClockCase("20 ms, drift, rates agreed upon", (0.02, 0.02), (0.02, 0.02), 5e-5, 2.0),
)


@configuration
class ConsensusConfig:
    """Sample sizes: cases that are computed."""

    sizes: Annotated[Count, Within(Le(len(_SIZES)), allowed=f"1 to {len(_SIZES)}")] = 3
    """numbers of vehicles: 4, 8, 16"""
    seeds: Count = 5
    """random graphs of each size, and draws of lost messages"""
    vehicles: EvenCount = 8
    """on the graphs with long rounds, delays, links that change and clocks"""


class ConsensusStudy:
    """The Laplacian protocol: its rate, delays, switching links, lost messages, outliers, clocks."""

    Config = ConsensusConfig
    quick = ConsensusConfig(sizes=2, seeds=2)
    title = "Consensus: the rate of the Laplacian protocol"
    on_terrain = False

    @staticmethod
    def run(config: ConsensusConfig, setup: Setup) -> StudyResult:
        jobs = Jobs()
        cases = [
            RateCase(kind, n, seed)
            for n in reversed(_SIZES[: config.sizes])  # the longest first
            for kind in KINDS
            for seed in range(config.seeds if kind == "random" else 1)
        ]
        many = config.vehicles
        links = [LinkCase(name, 0, many) for name in ("switching", "matchings")]
        links += [LinkCase("loss", seed, many) for seed in range(config.seeds)]
        delays = [DelayCase(fraction, own, many) for own in ("then", "now") for fraction in _FRACTIONS]
        clocks = [replace(case, n=many) for case in _CLOCKS]
        jobs.add("rate", rate_on, cases)
        jobs.add("coarse", rate_on, [RateCase(kind, many, 0, amount) for kind in KINDS for amount in _AMOUNTS])
        jobs.add("delay", delayed, delays)
        jobs.add("links", over_links, links)
        jobs.add("clocks", clocks_agree, clocks)
        jobs.add("outlier", with_outlier, [OutlierCase(ROUNDS[0], None), *map(OutlierCase, ROUNDS)])
        done: dict[str, list[Any]] = jobs.done(setup)
        rates = dict(zip(cases, done["rate"], strict=True))
        late = dict(zip(delays, done["delay"], strict=True))
        over = dict(zip(links, done["links"], strict=True))
        everybody, outliers = done["outlier"][0], dict(zip(ROUNDS, done["outlier"][1:], strict=True))
        return StudyResult(
            summary=(
                "Each vehicle holds one number, sends it to its neighbours once a round and moves it by (A.10) scaled "
                "by s; rates are over s. Starts are the slowest mode and a tenth of noise for rates.",
            ),
            rows=[
                {
                    **{"graph": case.kind, "vehicles": case.n, "seed": case.seed, "lambda_2": found.connectivity},
                    **{"rate": found.rate, "off": found.rate / found.connectivity - 1.0},
                    **{"average_moved": found.moved, "diameter": found.diameter},
                    "rounds_to_maximum": found.rounds_to_maximum,
                }
                for case, found in rates.items()
            ],
            tables=_tables(rates, done["coarse"], late, over, dict(zip(clocks, done["clocks"], strict=True)),
                           everybody, outliers, many),
            figure=figure(rates, late, over, outliers[ROUNDS[0]]),
            caption="(a) Measured decay of the disagreement against the algebraic connectivity. (b) A delay below and "
            "above pi / (2 s lambda_n) on every link; solid: compared with a vehicle's own value then, dashed: now. "
            "(c) Links that change or lose messages; dashed: what they are held against. (d) An outlier in the middle "
            "of a line sends the average of its neighbours; dotted: the average of the others' own numbers.",
            claims=claims.claims(rates, late, over, everybody, outliers),
        )  # fmt: skip


# ---- tables


def _tables(
    rates: Mapping[RateCase, RateFound],
    coarse: Sequence[RateFound],
    late: Mapping[DelayCase, DelayFound],
    over: Mapping[LinkCase, LinkFound],
    clocks: Mapping[ClockCase, ClockFound],
    everybody: OutlierFound,
    outliers: Mapping[int, OutlierFound],
    many: int,
) -> tuple[Table, ...]:
    loss = [found for case, found in over.items() if case.name == "loss"]
    per = len(_AMOUNTS)
    return (
        Table("Rate of decay over lambda_2", ("graph", "vehicles", "lambda_2", "rate / lambda_2", "rounds to the "
              "maximum, diameter"),
              [(_named(case), case.n, f"{f.connectivity:.4f}", f"{f.rate / f.connectivity:.4f}",
                f"{f.rounds_to_maximum}, {f.diameter}") for case, f in sorted(rates.items(), key=_order)]),
        Table(f"Rate over lambda_2 in long rounds, {many} vehicles", ("s h d_max", *KINDS),
              [(f"{amount:g}", *(f"{coarse[k * per + row].rate / coarse[k * per + row].connectivity:.3f}"
                                 for k in range(len(KINDS)))) for row, amount in enumerate(_AMOUNTS)]),
        Table("Delay on every link of a random graph", ("delay over the bound", "compared with one's own value",
              "rate", "rate by theory", "average moved"),
              [(f"{case.fraction:g}", case.own, f"{f.rate:+.3f}",
                "" if math.isnan(f.predicted) else f"{f.predicted:+.3f}", f"{f.moved:.1e}")
               for case, f in late.items()]),
        Table("Links", ("what", "rate", "held against", "average moved"),
              [*((_LINKS[case.name], f"{f.rate:.3f}, slowest stay {f.least:.3f}", f"{f.reference:.3f}",
                  f"{f.moved:.1e}") for case, f in over.items() if case.name != "loss"),
               (f"a ring that loses {LOSS:.0%}", span([f.rate for f in loss], ".3f"), f"{loss[0].reference:.3f}",
                f"at most {max(f.moved for f in loss):.1e}")]),
        Table(f"Clocks on a line of {many}", ("delays", "apart at first [s]", "corrected clocks apart [s]",
              "delays' asymmetry allows [s]"),
              [(case.name, f"{f.first:.2f}", f"{f.last:.2g}", f"{f.allowed:.2g}") for case, f in clocks.items()]),
        Table("An outlier in the middle of a line of 8, second planning period", ("rounds", "the others agree off "
              "their own average by [s]", "all apart at the end [s]"),
              [(f"{ROUNDS[0]}, it takes part", f"{distance_to_average(everybody):+.4f}", f"{everybody.spread[1]:.1e}"),
               *((f"{rounds}, it follows", f"{distance_to_average(f):+.4f}", f"{f.spread[1]:.1e}")
                 for rounds, f in outliers.items())]),
    )  # fmt: skip


_LINKS = {
    "switching": "line, ring and complete graph in turn",
    "matchings": "two halves of a ring in turn, neither connected",
}


def _named(case: RateCase) -> str:
    return f"{case.kind} {case.seed}" if case.kind == "random" else case.kind


def _order(item: tuple[RateCase, RateFound]) -> tuple[int, int, int]:
    case = item[0]
    return KINDS.index(case.kind), case.n, case.seed
