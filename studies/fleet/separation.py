"""Fleets under faults hit neither the ground nor each other; the cost of separation.

Solvers fail, messages are lost, late and duplicated, and for a while the halves of the fleet cannot communicate.
Contacts and distances are those of the true states in MuJoCo, between the samples of the log too.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.fleet.arrival import SIZES
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult, TerrainReference

FAULTS: Mapping[str, Any] = {
    "faults.solver_failure_rate": 0.3,
    "radio.loss": 0.2,
    "radio.duplication": 0.1,
    "radio.delay": (0.0, 0.3),
}
CUT_OFF: Mapping[str, Any] = {**FAULTS, "radio.partition": (40.0, 120.0)}
KINDS: Mapping[str, Mapping[str, Any]] = {"30 % failures, 20 % loss": FAULTS, "and cut in two for 80 s": CUT_OFF}
COLOURS = dict(zip(KINDS, ("#0d5fa8", "#d9731a"), strict=True))
GROWN = (4, 16, 64)  # vehicles, of which the cost is measured
SHARE, GROWTH = 0.1, 1.5  # of real time on two cores, and times from 4 to 64 vehicles
CORES = 2


@configuration
class SeparationConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 8
    """number of fleets of each size, under each kind of faults"""
    sizes: Count = len(SIZES)
    """largest number of sizes of fleets"""
    grown: Count = len(GROWN)
    """largest number of sizes whose cost is measured"""
    repetitions: Count = 3
    """number of timed flights of each size"""


@dataclass(frozen=True)
class TimedFleet:
    """A fleet whose planning and communication are timed."""

    place: TerrainReference
    vehicles: int
    seed: int


class SeparationStudy:
    """Fleets under faults hit neither the ground nor each other; cost of separation (A.8)."""

    Config = SeparationConfig
    quick = SeparationConfig(seeds=1, sizes=2, grown=1, repetitions=1)
    title = "Separation of fleets under faults"

    @staticmethod
    def run(config: SeparationConfig, setup: Setup) -> StudyResult:
        sizes = SIZES[: config.sizes]
        by_condition = setup.fly_groups({
            (kind, size): [
                trial("simultaneous-arrival", seed, fields={"terrain": setup.terrain, "vehicles": size, **fields})
                for seed in range(config.seeds)
            ]
            for kind, fields in KINDS.items() for size in sizes
        })  # fmt: skip
        grown = GROWN[: config.grown]
        timed = [TimedFleet(setup.place, size, seed) for size in grown for seed in range(config.repetitions)]
        costs = iter(setup.compute(cpu_share, timed))
        cost_of = {size: [next(costs) for _ in range(config.repetitions)] for size in grown}
        rows = [_row(kind, size, group) for (kind, size), group in by_condition.items()]
        costs_as_rows = [{"cost_vehicles": n, "cpu_share": value} for n, group in cost_of.items() for value in group]
        return StudyResult(
            summary=(
                f"{config.seeds} fleets of each size over {setup.ground.name}, {config.seeds * len(by_condition)} "
                "flights in all. Cost: CPU time of a whole run, physics included, over the time simulated, the first "
                "planning instant included.",
            ),
            rows=[*rows, *costs_as_rows],
            tables=(_table(rows), _cost_table(cost_of)),
            figure=_figure(by_condition, cost_of),
            caption="(a) The least distance between any two vehicles of each fleet; dashed, what they are to keep. (b) "
            "The least clearance. (c) CPU time per vehicle and second of flight.",
            claims=_claims(by_condition, cost_of),
        )  # fmt: skip


def cpu_share(fleet: TimedFleet) -> MeasuredTime:
    """A job: CPU time over simulated time of a whole fleet."""
    fields = {"terrain": fleet.place.terrain, "vehicles": fleet.vehicles}
    closed_loop = trial("simultaneous-arrival", fleet.seed, fields=fields).build()
    began = time.process_time()
    outcome = closed_loop.run()
    return MeasuredTime((time.process_time() - began) / float(outcome.recording.t[-1]))


def _row(kind: str, size: int, records: Sequence[Record]) -> dict[str, Any]:
    return {
        "faults": kind,
        "vehicles": size,
        "fleets": len(records),
        "arrived": int(figures(records, "arrived").sum()),
        "separation_min_m": float(figures(records, "separation_min_m").min()),
        "separation_allowed_m": float(figures(records, "separation_allowed_m").max()),
        "clearance_min_m": float(figures(records, "min_clearance_m").min()),
        "ground_contacts": int(figures(records, "ground_contacts").sum()),
        "spread_max_s": float(np.nanmax(np.append(figures(records, "spread_s").astype(float), -1.0))),
        "not_admitted": int(figures(records, "plans_not_admitted").sum()),
        "guarantee_lost": int(figures(records, "guarantee_lost").sum()),
    }


def _table(rows: Sequence[Mapping[str, Any]]) -> Table:
    return Table.of("Fleets under faults", rows, (
        ("faults", "faults"), ("vehicles", "vehicles"), ("all arrived", "{arrived} of {fleets}"),
        ("least separation [m]", "{separation_min_m:.1f}"), ("least clearance [m]", "{clearance_min_m:.1f}"),
        ("on the ground", "ground_contacts"), ("largest spread [s]", "{spread_max_s:.2f}"),
    ))  # fmt: skip


def _cost_table(cost_of: Mapping[int, Sequence[float]]) -> Table:
    body = [
        (size, f"{np.median(times):.3g}", f"{np.median(times) / CORES:.3g}", f"{1000.0 * np.median(times) / size:.3g}")
        for size, times in cost_of.items()
    ]
    return Table(
        "Cost of a fleet",
        ("vehicles", "CPU s per s", f"share of real time on {CORES} cores", "CPU ms per s each"),
        body,
    )


def _claims(
    by_condition: Mapping[tuple[str, int], Sequence[Record]], cost_of: Mapping[int, Sequence[float]]
) -> list[Claim]:
    every = [record for group in by_condition.values() for record in group]
    contacts = int(figures(every, "ground_contacts").sum())
    close = int((figures(every, "separation_min_m") < figures(every, "separation_allowed_m")).sum())
    least = float(figures(every, "separation_min_m").min())
    each = {size: float(np.median(group)) / size for size, group in cost_of.items()}
    first, last = min(each), max(each)
    sixteen = float(np.median(cost_of[16])) / CORES if 16 in cost_of else None
    growth = each[last] / each[first]
    share = "not measured" if sixteen is None else f"{sixteen:.3f}"
    return [
        Claim(
            "fleet.separation", "target", "Fleets under faults hit neither the ground nor themselves.", "A.8",
            "30 % solver failures and 20 % message loss: no ground contact, no pair closer than the zone",
            f"{rate(contacts + close, len(every)).text()} of {len(every)} fleets: {contacts} contacts, {close} pairs "
            f"too close; least separation {least:.1f} m of {float(figures(every, 'separation_allowed_m').max()):g} m",
            contacts == 0 and close == 0,
        ),
        Claim(
            "fleet.cost", "target", "Planning and separation are cheap.", "A.8",
            f"16 vehicles in at most {SHARE:g} of real time on {CORES} cores; per vehicle at most {GROWTH:g} times as "
            "much from 4 to 64",
            f"16 vehicles {share} of real time, physics included; {growth:.2f} times from {first} to {last}",
            (sixteen is not None and sixteen <= SHARE) and last > first and growth <= GROWTH,
        ),
    ]  # fmt: skip


# ---- what is drawn


def _figure(by_condition: Mapping[tuple[str, int], Sequence[Record]], cost_of: Mapping[int, Sequence[float]]) -> Figure:
    with styled_figure((13.0, 4.3)) as page:
        left, middle, right = page.subplots(1, 3, width_ratios=(1.2, 1.2, 0.8))
        allowed = float(max(figures(group, "separation_allowed_m").max() for group in by_condition.values()))
        _draw_least(left, by_condition, "separation_min_m", allowed, "(a) least separation [m]")
        _draw_least(middle, by_condition, "min_clearance_m", 50.0, "(b) least clearance [m]")
        _draw_cost(right, cost_of)
    return page


def _draw_least(
    axes: Axes, by_condition: Mapping[tuple[str, int], Sequence[Record]], key: str, allowed: float, title: str
) -> None:
    rng = np.random.default_rng(0)
    sizes = sorted({size for _, size in by_condition})
    for (kind, size), group in by_condition.items():
        values = figures(group, key)
        x = sizes.index(size) + (-0.15 if kind == next(iter(KINDS)) else 0.15) + rng.uniform(-0.07, 0.07, len(values))
        axes.plot(x, values, "o", ms=5, alpha=0.75, color=COLOURS[kind], label=kind if size == sizes[0] else None)
    axes.axhline(allowed, color=INK, ls="--", lw=1.0)
    axes.set_xticks(range(len(sizes)), [str(size) for size in sizes])
    axes.set(xlabel="vehicles", ylim=(0.0, None), title=title)
    axes.legend(loc="upper right", fontsize=8.0)


def _draw_cost(axes: Axes, cost_of: Mapping[int, Sequence[float]]) -> None:
    sizes = list(cost_of)
    for size, times in cost_of.items():
        axes.plot([size] * len(times), 1000.0 * np.array(times) / size, "o", color="#0d5fa8", alpha=0.7)
    axes.plot(
        sizes, [1000.0 * float(np.median(times)) / size for size, times in cost_of.items()], color="#0d5fa8", lw=1.2
    )
    axes.set_xscale("log", base=2)
    axes.set_xticks(sizes, [str(size) for size in sizes])
    axes.set(xlabel="vehicles", ylabel="CPU ms per vehicle and second", ylim=(0.0, None), title="(c) cost")
