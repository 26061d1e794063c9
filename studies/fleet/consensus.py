"""Section A.8.1 measured: rate of the Laplacian protocol by kind of graph, with delays, changing links and outliers.

All values are exchanged in messages through the network of ``mathnavi.sim.engine.network``, in rounds so short that
they approximate the continuous time of (A.11), unless stated otherwise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
from annotated_types import Le
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.controllers.arrival.laplacian import DELTA
from mathnavi.interfaces.bounds import Condition, Count, Within, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.fleet.message_exchange import (
    FAR,
    KINDS,
    LOSS,
    PLANNING,
    SLOW,
    ClockCase,
    DelayCase,
    LinkCase,
    OutlierCase,
    RateCase,
    clocks_agree,
    delayed,
    over_links,
    rate_on,
    with_outlier,
)
from mathnavi.studies.framework.drawing import HALO, annotate, styled_figure
from mathnavi.studies.framework.study import Jobs, Row, Setup, StudyResult

WITHIN = 0.05  # of lambda_2
KEPT = 0.02  # of how far an outlier that takes part would move the agreement
ROUNDS = (400, 800, 1600)  # in a planning period
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
LINKS = {
    "switching": "line, ring and complete graph in turn",
    "matchings": "two halves of a ring in turn, neither connected",
}
_MARKS = {
    "line": ("#0d5fa8", "o", 11.0),  # larger, for some rings have the same connectivity
    "ring": ("#e07b00", "s", 6.0),
    "complete": ("#0f9472", "D", 7.0),
    "random": ("#c2183b", "^", 7.0),
}
_BELOW, _ABOVE = "#0d5fa8", "#c2183b"
_LEAST = 1e-6  # disagreement that is drawn


@configuration
class ConsensusConfig:
    """Sample sizes: cases that are computed."""

    sizes: Annotated[Count, Within(Le(len(_SIZES)), allowed=f"1 to {len(_SIZES)}")] = 3
    """number of fleet sizes, of 4, 8 and 16 vehicles"""
    seeds: Count = 5
    """number of random graphs of each size, and of draws of lost messages"""
    vehicles: EvenCount = 8
    """number of vehicles on the graphs with long rounds, delays, links that change, and clocks"""


class ConsensusStudy:
    """The Laplacian protocol: its rate, delays, switching links, lost messages, outliers, clocks."""

    Config = ConsensusConfig
    quick = ConsensusConfig(sizes=2, seeds=2)
    title = "Consensus: the rate of the Laplacian protocol"
    on_terrain = False

    @staticmethod
    def run(config: ConsensusConfig, setup: Setup) -> StudyResult:
        many = config.vehicles
        jobs = Jobs()
        jobs.add("rates", rate_on, [
            RateCase(kind, n, seed)
            for n in reversed(_SIZES[: config.sizes])  # the longest first
            for kind in KINDS
            for seed in range(config.seeds if kind == "random" else 1)
        ])  # fmt: skip
        jobs.add("coarse", rate_on, [RateCase(kind, many, 0, amount) for kind in KINDS for amount in _AMOUNTS])
        jobs.add("delays", delayed, [DelayCase(part, own, many) for own in ("then", "now") for part in _FRACTIONS])
        jobs.add("links", over_links, [LinkCase(name, 0, many) for name in ("switching", "matchings")])
        jobs.add("loss", over_links, [LinkCase("loss", seed, many) for seed in range(config.seeds)])
        jobs.add("clocks", clocks_agree, [replace(case, n=many) for case in _CLOCKS])
        jobs.add("everybody", with_outlier, [OutlierCase(ROUNDS[0], None)])
        jobs.add("outliers", with_outlier, [OutlierCase(rounds) for rounds in ROUNDS])
        found = jobs.done(setup)
        return StudyResult(
            summary=(
                "Each vehicle holds one number, sends it to its neighbours once a round and moves it by (A.10) scaled "
                "by s; rates are over s. Starts are the slowest mode and a tenth of noise for rates.",
            ),
            rows=[{name: value for name, value in row.items() if name != "above"} for row in found["rates"]],
            tables=_tables(found),
            figure=_figure(found),
            caption="(a) Measured decay of the disagreement against the algebraic connectivity. (b) A delay below and "
            "above pi / (2 s lambda_n) on every link; solid: compared with a vehicle's own value then, dashed: now. "
            "(c) Links that change or lose messages; dashed: what they are held against. (d) An outlier in the middle "
            "of a line sends the average of its neighbours; dotted: the average of the others' own numbers.",
            claims=_claims(found),
        )  # fmt: skip


# ---- tables


def _tables(found: Mapping[str, list[Row]]) -> tuple[Table, ...]:
    per, many, loss = len(_AMOUNTS), found["coarse"][0]["vehicles"], found["loss"]
    order = sorted(found["rates"], key=lambda f: (KINDS.index(f["graph"]), f["vehicles"], f["seed"]))
    return (
        Table.of("Rate of decay over lambda_2", order, (
            ("graph", lambda f: f"{f['graph']} {f['seed']}" if f["graph"] == "random" else f["graph"]),
            ("vehicles", "vehicles"), ("lambda_2", "{lambda_2:.4f}"),
            ("rate / lambda_2", lambda f: f"{f['rate'] / f['lambda_2']:.4f}"),
            ("rounds to the maximum, diameter", "{rounds_to_maximum}, {diameter}"),
        )),
        Table(f"Rate over lambda_2 in long rounds, {many} vehicles", ("s h d_max", *KINDS),
              [(f"{amount:g}", *(f"{f['rate'] / f['lambda_2']:.3f}" for f in found["coarse"][row::per]))
               for row, amount in enumerate(_AMOUNTS)]),
        Table.of("Delay on every link of a random graph", found["delays"], (
            ("delay over the bound", "{fraction:g}"), ("compared with one's own value", "own"),
            ("rate", "{rate:+.3f}"),
            ("rate by theory", lambda f: "" if math.isnan(f["predicted"]) else f"{f['predicted']:+.3f}"),
            ("average moved", "{average_moved:.1e}"),
        )),
        Table("Links", ("what", "rate", "held against", "average moved"),
              [*((LINKS[f["links"]], f"{f['rate']:.3f}, slowest stay {f['least']:.3f}", f"{f['reference']:.3f}",
                  f"{f['average_moved']:.1e}") for f in found["links"]),
               (f"a ring that loses {LOSS:.0%}", _span([f["rate"] for f in loss], ".3f"), f"{loss[0]['reference']:.3f}",
                f"at most {max(f['average_moved'] for f in loss):.1e}")]),
        Table.of(f"Clocks on a line of {many}", found["clocks"], (
            ("delays", "delays"), ("apart at first [s]", "{first:.2f}"),
            ("corrected clocks apart [s]", "{last:.2g}"), ("delays' asymmetry allows [s]", "{allowed:.2g}"),
        )),
        Table.of("An outlier in the middle of a line of 8, second planning period",
                 (*found["everybody"], *found["outliers"]), (
            ("rounds", lambda f: f"{f['rounds']}, it {'takes part' if f['delta'] is None else 'follows'}"),
            ("the others agree off their own average by [s]", "{shift:+.4f}"),
            ("all apart at the end [s]", lambda f: f"{f['spread'][1]:.1e}"),
        )),
    )  # fmt: skip


def _span(values: Sequence[float], form: str) -> str:
    """Return the least and the largest value as text."""
    return f"{min(values):{form}} to {max(values):{form}}"


# ---- claims


def _claims(found: Mapping[str, list[Row]]) -> list[Claim]:
    error = {kind: max((f["off"] for f in found["rates"] if f["graph"] == kind), key=abs) for kind in KINDS}
    near = max(map(abs, error.values())) <= WITHIN
    then = {f["fraction"]: f["rate"] for f in found["delays"] if f["own"] == "then"}
    now = [f["rate"] for f in found["delays"] if f["own"] == "now"]
    split = all((rate > 0.0) == (fraction < 1.0) for fraction, rate in then.items())
    switching, halves = found["links"]
    links = switching["least"] >= (1.0 - WITHIN) * switching["reference"]
    links &= halves["rate"] >= (1.0 - WITHIN) * halves["reference"] and min(f["rate"] for f in found["loss"]) > 0.0
    above = max(f["above"] for f in found["rates"])
    (everybody,), first = found["everybody"], found["outliers"][0]
    moved, drawn, finest = (abs(f["shift"]) for f in (first, everybody, found["outliers"][-1]))
    return [
        Claim(
            "fleet.laplacian", "target", "The error decays at the algebraic connectivity on every kind of graph; "
            "delays and switching shown.", "(A.9) to (A.11)",
            f"within {WITHIN:.0%}; a delay below pi / (2 s lambda_n) decays and one above grows; switching decays at "
            "least as its slowest graph",
            f"off by {', '.join(f'{value:+.1%} ({kind})' for kind, value in error.items())}; with "
            f"{', '.join(f'{fraction:g}' for fraction in then)} of that delay at "
            f"{', '.join(f'{rate:+.2f}' for rate in then.values())}, compared with the own value now at "
            f"{_span(now, '.2f')}; switching at >= {switching['least']:.2f} "
            f"(slowest graph {switching['reference']:.2f}); "
            f"two halves of a ring at {halves['rate']:.3f} (their mean {halves['reference']:.3f}); {LOSS:.0%} lost: "
            f"{_span([f['rate'] / f['reference'] for f in found['loss']], '.3f')} of lambda_2",
            bool(near and split and links and min(now) > 0.0),
        ),
        Claim(
            "A.laplacian-rate", "printed", "The protocol reaches consensus globally exponentially, with the speed of "
            "the algebraic connectivity.", "A.8.1, Theorem 8 of [35]",
            "from any start at most exp(-s lambda_2 t), and exactly that in the slowest mode",
            f"random starts {'never' if above <= 1e-9 else f'up to {above:.1%}'} above it; the slowest mode at "
            f"{_span([f['off'] for f in found['rates']], '+.1%')} of it, which is what rounds of s h lambda_2 <= "
            f"{SLOW:g} add to it",
            bool(near and above <= 1e-9),
        ),
        Claim(
            "A.outlier-keeps-value", "printed", "An outlier that sends the average of its neighbours keeps the graph "
            "connected without affecting the consensus value.", "A.8.3",
            f"the others agree on their own average, to {KEPT:.0%} of what the outlier would move it by",
            f"moved by {moved:.2f} s where taking part moves it by {drawn:.1f} s ({moved / drawn:.1%}), for it lags "
            f"by a round: {finest:.2f} s with {ROUNDS[-1] // ROUNDS[0]} times as many rounds; delta = {DELTA:g}",
            bool(moved <= KEPT * drawn and first["spread"][1] <= 1e-3),
        ),
    ]  # fmt: skip


# ---- what is drawn


def _figure(found: Mapping[str, list[Row]]) -> Figure:
    with styled_figure((12.0, 8.6)) as page:
        axes = page.subplots(2, 2)
        _draw_rates(axes[0, 0], found["rates"])
        _draw_delays(axes[0, 1], found["delays"])
        _draw_links(axes[1, 0], (*found["links"], found["loss"][0]))
        _draw_outlier(axes[1, 1], found["outliers"][0])
    return page


def _draw_rates(axes: Axes, rates: Sequence[Row]) -> None:
    axes.set_title("(a) the rate is the algebraic connectivity")
    ends = np.array([0.025, 25.0])
    axes.plot(ends, ends, color=INK, lw=1.0, ls=(0, (4, 3)))
    for kind in KINDS:
        found = [f for f in rates if f["graph"] == kind]
        error = max((f["off"] for f in found), key=abs)
        colour, marker, size = _MARKS[kind]
        axes.plot(
            [f["lambda_2"] for f in found], [f["rate"] for f in found], marker, ms=size, color=colour, mec="white",
            label=f"{kind}, off by at most {abs(error):.1%}",
        )  # fmt: skip
    numbers = sorted({f["vehicles"] for f in rates})
    axes.set(xscale="log", yscale="log", xlabel=r"$\lambda_2$", ylabel="measured rate of decay over $s$")
    axes.legend(loc="upper left", title=f"{', '.join(map(str, numbers))} vehicles", alignment="left")


def _draw_delays(axes: Axes, delays: Sequence[Row]) -> None:
    axes.set_title(r"(b) delays $\tau$ around the bound $\pi / (2 s \lambda_n)$")
    then, now = ({f["fraction"]: f for f in delays if f["own"] == own} for own in ("then", "now"))
    shown = [fraction for fraction in (0.9, 1.1, 1.5) if fraction in then]
    colours = dict(zip(shown, (_BELOW, "#e07b00", _ABOVE), strict=True))
    for fraction, colour in colours.items():
        axes.plot(then[fraction]["t"], then[fraction]["size"], color=colour, lw=1.4)
    for fraction, colour in colours.items():
        axes.plot(now[fraction]["t"], now[fraction]["size"], color=colour, lw=1.8, ls=(0, (5, 2)))
        found = then[fraction]
        tail = found["t"] > 0.8 * found["t"][-1]
        annotate(axes, f"{fraction:g} of it", (found["t"][-1], float(found["size"][tail].max())), (5, 0), va="center",
                 color=colour, weight="bold", path_effects=HALO)  # fmt: skip
    axes.set(yscale="log", xlabel="time over the bound", ylabel="disagreement over the first")
    axes.plot([], [], color=INK, ls="-", label="own value when it was sent")
    axes.plot([], [], color=INK, ls=(0, (5, 2)), lw=1.8, label="own value now: agrees for any delay")
    axes.set(xlim=(0.0, 35.0), ylim=(1e-4, 3e4))
    axes.legend(loc="upper left", title="compared with", alignment="left")


def _draw_links(axes: Axes, links: Sequence[Row]) -> None:
    axes.set_title("(c) links that change or lose messages")
    named = (
        (_MARKS["complete"][0], "line, ring, complete in turn; dashed: line"),
        (_MARKS["line"][0], "two halves of a ring in turn; dashed: their mean"),
        (_MARKS["random"][0], rf"ring that loses {LOSS:.0%}; dashed: without loss"),
    )
    for found, (colour, label) in zip(links, named, strict=True):
        kept = found["size"] >= _LEAST
        axes.plot(found["t"][kept], found["size"][kept], color=colour, lw=1.8, label=label)
        t = np.array([0.0, 30.0])
        axes.plot(t, np.exp(-found["reference"] * t), color=colour, lw=1.0, ls=(0, (4, 3)))
    axes.set(yscale="log", xlabel="time $s t$", ylabel="disagreement over the first", xlim=(0.0, 28.0))
    axes.set_ylim(_LEAST, 20.0)
    axes.legend(loc="upper right")


def _draw_outlier(axes: Axes, found: Row) -> None:
    axes.set_title("(d) an outlier follows and comes back")
    steps = len(found["others"])
    per = len(found["t"]) // steps
    for step in range(steps):
        block = slice(step * per, (step + 1) * per)
        t, values = found["t"][block], found["values"][block]
        if found["follows"][step]:
            axes.axvspan(PLANNING * step, PLANNING * (step + 1), color="#f3e3d0", lw=0.0)
        axes.plot(t, np.delete(values, FAR, axis=1), color=_BELOW, lw=1.0)
        axes.plot(t, _shown(values[:, FAR], bool(found["follows"][step])), color=_ABOVE, lw=1.8)
        ends = [PLANNING * step, PLANNING * (step + 1)]
        axes.plot(ends, [found["others"][step]] * 2, color=INK, lw=1.2, ls=":", zorder=4)
    axes.plot([], [], color=_BELOW, label="seven vehicles")
    axes.plot([], [], color=_ABOVE, label="the eighth; shaded: it only follows")
    axes.plot([], [], color=INK, ls=":", label="average of the seven's own numbers")
    top = float(found["others"][0]) + 40.0
    annotate(axes, f"from {found['values'][0, FAR]:.0f} s", (0.0, top), (4, -10), color=_ABOVE, weight="bold")
    axes.set(xlabel="time [s], planning periods of 5/3 s", ylabel="arrival time $\\eta$ [s]", ylim=(None, top))
    axes.set_xticks(PLANNING * np.arange(steps + 1), [f"{PLANNING * k:.1f}" for k in range(steps + 1)])
    axes.grid(visible=False)
    axes.legend(loc="upper right")


def _shown(values: Array, follows: bool) -> Array:
    """Return the values that an outlier sends; NaN in its first round, in which it sends nothing."""
    shown = values.copy()
    if follows:
        shown[0] = np.nan
    return shown
