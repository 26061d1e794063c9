"""Time and memory against size, and the first limit that is met at a hundred times today's size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, Within, configuration
from mathnavi.renders.figures import BOUND
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Row, Setup, StudyResult
from mathnavi.studies.introduction.cost_measurement import (
    CURVES,
    Measured,
    ScalingCurve,
    SizedCase,
    SweepCase,
    measured,
    swept,
    written,
)

FACTOR = 100.0  # times today's size
MACHINES, CORES, MISSION = 100, 2, 1.4  # of a cluster; [s] CPU time of a mission
WORKERS = (1, 2, 4)
DELAYS = (None, 0.0, 0.05)  # [s] no cluster, a cluster, and one that is far away
LEAST_MEMORY = 1.0  # [MB] that counts as more than chance
PROPORTIONAL, CONSTANT = 1.15, 0.15  # exponents that count as such
LEAST_FIT = 3  # the largest sizes that an exponent is fitted to
_MOST = 1e9  # times a size
Rows = Sequence[dict[str, Any]]


@configuration
class ScalingConfig:
    """Sample sizes: measurements."""

    repetitions: Count = 3
    """number of measurements of each size"""
    sizes: Annotated[Count, Within(Interval(ge=2, le=16))] = 16
    """largest number of sizes of each curve"""
    trials: Annotated[Count, Within(Interval(ge=10, le=100_000))] = 200
    """number of trials of a sweep"""
    worker_counts: Annotated[Count, Within(Interval(ge=1, le=len(WORKERS)))] = len(WORKERS)
    """number of process counts of a sweep, of 1, 2, 4"""
    slow_network: bool = True
    """whether to measure sweeps on a cluster too, if Dask is installed"""


class Scaling:
    """Growth of time and memory with maps, plans, fleets, estimators and sweeps."""

    Config = ScalingConfig
    quick = ScalingConfig(repetitions=1, sizes=2, trials=10, worker_counts=1, slow_network=False)
    title = "Time and memory against size"
    on_terrain = False

    @staticmethod
    def run(config: ScalingConfig, setup: Setup) -> StudyResult:
        """Run the study with the sizes and repetitions of ``config``."""
        cases = [
            SizedCase(name, size, seed)
            for name, curve in CURVES.items()
            for size in curve.sizes[: config.sizes]
            for seed in range(config.repetitions)
        ]
        curves = medians(cases, setup.compute(measured, cases))
        delays = DELAYS if config.slow_network else DELAYS[:1]
        sweeps = tuple(SweepCase(w, config.trials, delay) for delay in delays for w in WORKERS[: config.worker_counts])
        (rates,) = setup.compute(swept, [sweeps])  # alone: they are measured by the clock on the wall
        (commit,) = setup.compute(written, [config.trials])
        found = grown(curves)
        first = min(found, key=lambda each: each.factor)
        return StudyResult(
            summary=(
                f"Medians of {config.repetitions}, CPU time of one process, memory beyond what the process had. An "
                "exponent is fitted to the three largest sizes. "
                f"At {FACTOR:g} times today's size {_breaks(found)} What breaks first is {first.name}, at "
                f"{_times(first.factor)} today's {first.curve.today} {first.curve.size}.",
                of_cluster(rates, commit),
            ),
            rows=[*curves, *rates],
            tables=(_growth_table(found), _sweep_table(rates)),
            figure=_figure(found, rates),
            caption=(
                "Cost against size, and in grey the memory beside it; red, as far as it serves; dotted, today's size. "
                "Last: trials that do nothing, a second."
            ),
            claims=claims(found),
        )  # fmt: skip


def claims(found: Sequence[Growth]) -> list[Claim]:
    """Evaluate the claims of the study."""
    p = {each.name: each.exponent for each in found}
    build, flight = 0.5 * p["map, built"], 0.5 * p["map, flown"]  # nodes go with the square of the side
    return [
        Claim(
            "scaling.map", "target", "A larger map costs what its nodes cost to read, and nothing in flight.", "A.5",
            f"against its nodes, the exponent of the build is at most {PROPORTIONAL:g}, of a flight {CONSTANT:g}",
            f"{build:.2f} and {flight:.2f}", build <= PROPORTIONAL and flight <= CONSTANT,
        ),
        Claim(
            "scaling.fleet", "target", "A vehicle costs the same in a large fleet.", "A.8",
            f"the exponent of the whole fleet is at most {PROPORTIONAL:g}", f"{p['fleet']:.2f}",
            p["fleet"] <= PROPORTIONAL,
        ),
        Claim(
            "scaling.hundred", "target", f"At {FACTOR:g} times today's size everything serves.", "A.8",
            "every curve's limit is met", _breaks(found), all(each.factor >= FACTOR for each in found),
        ),
    ]  # fmt: skip


def _breaks(found: Sequence[Growth]) -> str:
    broken = sorted((each for each in found if each.factor < FACTOR), key=lambda each: each.factor)
    if not broken:
        return "everything serves."
    listed = ", ".join(f"{each.name} (at {_times(each.factor)}, {each.curve.because})" for each in broken)
    return f"these no longer serve: {listed}."


def _times(factor: float) -> str:
    return "any size" if math.isinf(factor) else f"{factor:.3g} times"


def of_cluster(rates: Rows, commit: float) -> str:
    """Return a text on the rate of a cluster and its bottleneck, from rows of sweeps and the time [s] of a commit."""
    needed = MACHINES * CORES / MISSION
    far = [trials_a_second(row) for row in rates if row["delay_s"]]
    parts = {"the store's single writer": 1.0 / commit}
    if far:
        parts[f"the scheduler, with workers {DELAYS[-1]:g} s away,"] = max(far)
    first = min(parts, key=lambda part: parts[part])
    held = " and ".join(f"{part} {rate:.0f}" for part, rate in parts.items())
    verdict = "holds" if parts[first] >= needed else "does not hold"
    return (
        f"A cluster of {MACHINES} machines with {CORES} cores each flies {MACHINES * CORES} missions side by side, and "
        f"none of them sooner, for a mission is one process. With {MISSION:g} s a mission {needed:.0f} end in a "
        f"second. Of trials that do nothing {held} take a second: the sweep {verdict}, and the first limit, "
        f"{first.rstrip(',')}, is met at {parts[first] * MISSION / CORES:.0f} machines."
    )


def _growth_table(found: Sequence[Growth]) -> Table:
    head = ("", "from", "to", "cost there", "exponent", "memory there [MB]", "its exponent", "serves up to, of today's")
    body = [
        (
            f"{each.name}: {each.curve.size}", each.sizes[0], each.sizes[-1], f"{each.costs[-1]:.3g} {each.curve.unit}",
            f"{each.exponent:.2f}", f"{each.memory[-1]:.3g}", f"{each.memory_exponent:.2f}", _times(each.factor),
        )
        for each in found
    ]  # fmt: skip
    return Table("Growth", head, body)


def _sweep_table(rates: Rows) -> Table:
    return Table.of("Trials that do nothing", rates, (
        ("", _place), ("workers", "size"), ("start [s]", "{start_wall_s:.2f}"),
        ("ms a trial", lambda row: f"{1e3 * row['cost_wall_s']:.2f}"),
        ("trials a second", lambda row: f"{trials_a_second(row):.0f}"),
    ))  # fmt: skip


def _place(row: Row) -> str:
    return "processes" if row["delay_s"] is None else f"Dask, {1e3 * row['delay_s']:g} ms away"


def trials_a_second(row: Row) -> float:
    """Return the rate [1/s] of a sweep; infinite if all trials had ended when the last worker's first one had."""
    return 1.0 / row["cost_wall_s"] if row["cost_wall_s"] > 0.0 else math.inf


def _figure(found: Sequence[Growth], rates: Rows) -> Figure:
    columns = 4
    rows = math.ceil((len(found) + 1) / columns)
    with styled_figure((3.6 * columns, 3.1 * rows)) as page:
        drawn = page.subplots(rows, columns, squeeze=False).ravel()
        for axes, each in zip(drawn, found, strict=False):
            axes.plot(each.sizes, each.costs, "o-", color="#0d5fa8")
            if 0.0 < each.factor < FACTOR:
                axes.axhline(each.curve.limit, color=BOUND, ls="--", lw=1.2)
            axes.axvline(each.curve.today, color="0.6", ls=":", lw=1.0)
            if max(each.memory) >= LEAST_MEMORY:
                beside = axes.twinx()
                beside.plot(each.sizes, each.memory, "s--", color="0.55", ms=3.0, lw=1.0)
                beside.set(ylabel="MB", ylim=(0.0, None))
                beside.grid(visible=False)
            axes.set(xscale="log", yscale="log", xlabel=each.curve.size, ylabel=each.curve.unit)
            middle = math.sqrt(min(each.costs) * max(each.costs))  # a cost that does not grow shows as such
            axes.set_ylim(min(axes.get_ylim()[0], middle / 5.0), max(axes.get_ylim()[1], 5.0 * middle))
            axes.minorticks_off()
            axes.set_xticks(each.sizes, [str(size) for size in each.sizes], fontsize=7.0)
            axes.set_title(f"{each.name}: exponent {each.exponent:.2f}")
        axes = drawn[len(found)]
        for place in dict.fromkeys(map(_place, rates)):
            group = [row for row in rates if _place(row) == place]
            axes.plot([row["size"] for row in group], [trials_a_second(row) for row in group], "o-", label=place)
        axes.set(xlabel="workers", ylabel="trials a second", ylim=(0.0, None), title="sweep")
        axes.legend()
        for unused in drawn[len(found) + 1 :]:
            unused.set_axis_off()
    return page


def medians(cases: Sequence[SizedCase], results: Sequence[Measured]) -> Rows:
    """Return rows of the curves: medians over the repetitions."""
    by_size: dict[tuple[str, int], list[Measured]] = {}
    for case, result in zip(cases, results, strict=True):
        by_size.setdefault((case.curve, case.size), []).append(result)
    return [
        {
            "curve": curve, "size": size, "unit": CURVES[curve].unit,
            "cost_wall_s": float(np.median([each.cost for each in group])),
            "memory_wall_s": float(np.median([each.memory for each in group])),
        }
        for (curve, size), group in by_size.items()
    ]  # fmt: skip


class Growth:
    """Measured curve, from its rows."""

    def __init__(self, name: str, rows: Rows) -> None:
        self.name, self.curve = name, CURVES[name]
        self.sizes: list[int] = [row["size"] for row in rows]
        self.costs: list[float] = [row["cost_wall_s"] for row in rows]
        self.memory: list[float] = [row["memory_wall_s"] for row in rows]  # [MB]

    @property
    def exponent(self) -> float:
        return exponent(self.sizes, self.costs)

    @property
    def memory_exponent(self) -> float:
        """Exponent of the memory; NaN if the memory is too small to be measured."""
        seen = min(self.memory[-LEAST_FIT:]) >= LEAST_MEMORY
        return exponent(self.sizes, self.memory) if seen else math.nan

    @property
    def factor(self) -> float:
        """Largest usable size as a multiple of today's."""
        return serves_up_to(self.curve, self.sizes, self.costs)


def grown(rows: Rows) -> list[Growth]:
    """Return the measured curves from their rows."""
    names = dict.fromkeys(row["curve"] for row in rows)
    return [Growth(name, [row for row in rows if row["curve"] == name]) for name in names]


def exponent(sizes: Sequence[int], costs: Sequence[float]) -> float:
    """Return p of cost ~ size^p, by least squares of logarithms over the largest sizes."""
    x, y = np.log(sizes[-LEAST_FIT:]), np.log(costs[-LEAST_FIT:])
    return float(np.polyfit(x, y, 1)[0])


def serves_up_to(curve: ScalingCurve, sizes: Sequence[int], costs: Sequence[float]) -> float:
    """Return the size at which the limit is met as a multiple of today's, by the fit through the largest size.

    Infinite if that is more than a billion times.
    """
    if costs[-1] >= curve.limit:
        within = [size for size, cost in zip(sizes, costs, strict=True) if cost < curve.limit]
        return max(within, default=0) / curve.today
    p = exponent(sizes, costs)
    further = math.log(curve.limit / costs[-1]) / p if p > 0.0 else math.inf
    return sizes[-1] * math.exp(further) / curve.today if further < math.log(_MOST) else math.inf
