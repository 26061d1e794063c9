"""Time and memory of everything that can grow, against its size, and what breaks first at a hundred times today's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import matplotlib
import numpy as np
from annotated_types import Interval
from matplotlib.figure import Figure

from mathnavi.renders.figures import BOUND, STYLE
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, Within, configuration
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.introduction.scaling.curves import (
    CURVES,
    LEAST_FIT,
    Measured,
    ScalingCurve,
    SizedCase,
    exponent,
    measured,
    serves_up_to,
)
from mathnavi.sim.studies.introduction.scaling.sweeps import SweepCase, SweepRate, swept, written

FACTOR = 100.0  # times today's size
MACHINES, CORES, MISSION = 100, 2, 1.4  # of a cluster; [s] CPU time of a mission
WORKERS = (1, 2, 4)
DELAYS = (None, 0.0, 0.05)  # [s] no cluster, a cluster, and one that is far away
LEAST_MEMORY = 1.0  # [MB] that counts as more than chance
PROPORTIONAL, CONSTANT = 1.15, 0.15  # exponents that count as such


@configuration
class ScalingConfig:
    """Sample sizes: measurements."""

    repetitions: Count = 3
    """of each size"""
    sizes: Annotated[Count, Within(Interval(ge=2, le=16))] = 16
    """at most, of each curve"""
    trials: Annotated[Count, Within(Interval(ge=10, le=100_000))] = 200
    """of a sweep"""
    worker_counts: Annotated[Count, Within(Interval(ge=1, le=len(WORKERS)))] = len(WORKERS)
    """how many of 1, 2, 4 processes for a sweep"""
    slow_network: bool = True
    """whether sweeps on a cluster are measured too, where Dask is installed"""


@dataclass(frozen=True)
class Growth:
    """A curve as it was measured."""

    name: str
    curve: ScalingCurve
    sizes: tuple[int, ...]
    costs: tuple[float, ...]  # medians
    memory: tuple[float, ...]  # [MB] medians

    @property
    def exponent(self) -> float:
        return exponent(self.sizes, self.costs)

    @property
    def memory_exponent(self) -> float:
        """That of the memory; NaN where it is too little to be seen."""
        seen = self.memory[-LEAST_FIT:]
        return exponent(self.sizes, self.memory) if seen and min(seen) >= LEAST_MEMORY else math.nan

    @property
    def factor(self) -> float:
        """Times today's size up to which it serves."""
        return serves_up_to(self.curve, self.sizes, self.costs)


class Scaling:
    """Growth of time and memory."""

    Config = ScalingConfig
    quick = ScalingConfig(repetitions=1, sizes=2, trials=10, worker_counts=1, slow_network=False)
    title = "Time and memory against size"
    on_terrain = False

    @staticmethod
    def run(config: ScalingConfig, setup: Setup) -> StudyResult:
        """Run the study."""
        cases = [
            SizedCase(name, size, seed)
            for name, curve in CURVES.items()
            for size in curve.sizes[: config.sizes]
            for seed in range(config.repetitions)
        ]
        found = grown(cases, setup.compute(measured, cases))
        delays = DELAYS if config.slow_network else DELAYS[:1]
        sweeps = tuple(SweepCase(w, config.trials, delay) for delay in delays for w in WORKERS[: config.worker_counts])
        (rates,) = setup.compute(swept, [sweeps])  # alone: they are measured by the clock on the wall
        (commit,) = setup.compute(written, [config.trials])
        first = min(found, key=lambda each: each.factor)
        return StudyResult(
            summary=(
                f"Medians of {config.repetitions}, CPU time of one process, memory beyond what the process had. An "
                "exponent is fitted to the three largest sizes. "
                f"At {FACTOR:g} times today's size {_breaks(found)} What breaks first is {first.name}, at "
                f"{_times(first.factor)} today's {first.curve.today} {first.curve.size}.",
                of_cluster(rates, commit),
            ),
            rows=[*_curve_rows(found), *_sweep_rows(rates)],
            tables=(_growth_table(found), _sweep_table(rates)),
            figure=_figure(found, rates),
            caption=(
                "Cost against size, and in grey the memory beside it; red, as far as it serves; dotted, today's size. "
                "Last: trials that do nothing, a second."
            ),
            claims=claims(found),
        )  # fmt: skip


def grown(cases: Sequence[SizedCase], results: Sequence[Measured]) -> list[Growth]:
    """The curves, of the medians over the repetitions."""
    by_size: dict[str, dict[int, list[Measured]]] = {}
    for case, result in zip(cases, results, strict=True):
        by_size.setdefault(case.curve, {}).setdefault(case.size, []).append(result)
    return [
        Growth(
            name, CURVES[name], tuple(sizes),
            tuple(float(np.median([each.cost for each in group])) for group in sizes.values()),
            tuple(float(np.median([each.memory for each in group])) for group in sizes.values()),
        )
        for name, sizes in by_size.items()
    ]  # fmt: skip


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


def _curve_rows(found: Sequence[Growth]) -> list[dict[str, Any]]:
    return [
        {"curve": each.name, "size": size, "unit": each.curve.unit, "cost_wall_s": cost, "memory_wall_s": memory}
        for each in found
        for size, cost, memory in zip(each.sizes, each.costs, each.memory, strict=True)
    ]


def _sweep_rows(rates: Sequence[SweepRate]) -> list[dict[str, Any]]:
    return [
        {"curve": "sweep", "size": rate.workers, "unit": "s a trial", "delay_s": rate.delay,
         "cost_wall_s": rate.interval, "start_wall_s": rate.start}
        for rate in rates
    ]  # fmt: skip


def _breaks(found: Sequence[Growth]) -> str:
    broken = sorted((each for each in found if each.factor < FACTOR), key=lambda each: each.factor)
    if not broken:
        return "everything serves."
    listed = ", ".join(f"{each.name} (at {_times(each.factor)}, {each.curve.because})" for each in broken)
    return f"these no longer serve: {listed}."


def _times(factor: float) -> str:
    return "any size" if math.isinf(factor) else f"{factor:.3g} times"


def of_cluster(rates: Sequence[SweepRate], commit: float) -> str:
    """A cluster's work, and what holds it up, by the rates of sweeps and the time [s] of a commit."""
    needed = MACHINES * CORES / MISSION
    far = [rate for rate in rates if rate.delay]
    parts = {"the store's single writer": 1.0 / commit}
    if far:
        parts[f"the scheduler, with workers {DELAYS[-1]:g} s away,"] = max(each.rate for each in far)
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


def _sweep_table(rates: Sequence[SweepRate]) -> Table:
    body = [
        (_place(rate), rate.workers, f"{rate.start:.2f}", f"{1e3 * rate.interval:.2f}", f"{rate.rate:.0f}")
        for rate in rates
    ]
    return Table("Trials that do nothing", ("", "workers", "start [s]", "ms a trial", "trials a second"), body)


def _place(rate: SweepRate) -> str:
    return "processes" if rate.delay is None else f"Dask, {1e3 * rate.delay:g} ms away"


def _figure(found: Sequence[Growth], rates: Sequence[SweepRate]) -> Figure:
    columns = 4
    rows = math.ceil((len(found) + 1) / columns)
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(3.6 * columns, 3.1 * rows), layout="constrained")
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
        for place in dict.fromkeys(_place(rate) for rate in rates):
            group = [rate for rate in rates if _place(rate) == place]
            axes.plot([rate.workers for rate in group], [rate.rate for rate in group], "o-", label=place)
        axes.set(xlabel="workers", ylabel="trials a second", ylim=(0.0, None))
        axes.set_title("sweep")
        axes.legend()
        for unused in drawn[len(found) + 1 :]:
            unused.set_axis_off()
    return page
