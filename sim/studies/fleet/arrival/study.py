"""Simultaneous arrival with real vehicles (A.8, Figure A.11).

The thesis flew one vehicle and invented the others. Here whole fleets fly in MuJoCo: what they agree on is the largest
of their least times of arrival, and for comparison the average of (A.12) by the Laplacian protocol, as printed. One
vehicle by itself is asked, as in the thesis, for a time that deviates from its own by up to a given share, and whether
one planning step is enough to comply by (A.13).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.renders.figures import INK, STYLE
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.studies.fleet.arrival import narrow
from mathnavi.sim.studies.fleet.arrival.steps import DEVIATIONS, ArrivalChange, ArrivalStep, one_step
from mathnavi.sim.studies.framework.study import Setup, StudyResult, median
from mathnavi.sim.sweep.trial import Trial, trial

H = 5.0 / 3.0  # [s]
SIZES = (4, 6, 8, 16)
FAILING = 0.1  # of the solver's answers
NOMINAL, FAULTED, PRINTED = "nominal", "10 % solver failures", "average of (A.12)"
CONSTRAINT, PENALTY = "maximum, by (A.13)", "maximum, by its penalty"
PRINTED_SIZE = 4  # of the fleets that agree, or comply, as printed
SHOWN = 6  # of the fleet that is drawn
LEAST_DRAWN = 1e-2  # [s] of a spread
COLOURS = {NOMINAL: "#0d5fa8", FAULTED: "#d9731a", PRINTED: "#c2183b", CONSTRAINT: "#7b3fa0", PENALTY: "#1a9850"}


@configuration
class ArrivalConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 8
    """fleets of each size, and with failures"""
    sizes: Count = len(SIZES)
    """sizes of fleets, at most"""
    steps: Count = 40
    """times that a single vehicle is asked to deviate, at each share"""
    narrow: Count = 31
    """fleets where it is narrow, at most: thirty, and one that swaps places"""


class Arrival:
    """Fleets that agree on one time and arrive at it (Figure A.11)."""

    Config = ArrivalConfig
    quick = ArrivalConfig(seeds=1, sizes=2, steps=4, narrow=4)
    title = "Simultaneous arrival"

    @staticmethod
    def run(config: ArrivalConfig, setup: Setup) -> StudyResult:
        sizes = SIZES[: config.sizes]
        trials = {
            (kind, size, seed): fleet(setup, size, seed, kind)
            for kind in COLOURS
            for size in (sizes if kind in (NOMINAL, FAULTED) else (PRINTED_SIZE,))
            for seed in range(config.seeds)
        }
        tight = narrow.fleets(config.narrow)
        flown = setup.fly([*trials.values(), *tight.values()])
        records, narrowly = dict(zip(trials, flown, strict=False)), dict(zip(tight, flown[len(trials) :], strict=True))
        by_condition = {
            (kind, size): [records[kind, size, seed] for seed in range(config.seeds)]
            for kind, size in dict.fromkeys((kind, size) for kind, size, _ in trials)
        }
        changes = [ArrivalChange(setup.place, share, seed) for share in DEVIATIONS for seed in range(config.steps)]
        steps = [step for step in setup.compute(one_step, changes) if step is not None]
        shown = setup.flown({NOMINAL: fleet(setup, min(SHOWN, max(sizes)), 0, NOMINAL)})[NOMINAL]
        rows = [_row(kind, size, group) for (kind, size), group in by_condition.items()]
        return StudyResult(
            summary=(
                f"{config.seeds} fleets of each size over {setup.ground.name}, without faults and with "
                f"{FAILING:.0%} of the solver's answers lost: they agree on the maximum of the least times of arrival, "
                f"and fly by a schedule. Fleets of {PRINTED_SIZE} that agree on the average of (A.12), as printed, and "
                "such that agree on the maximum and comply by (A.13), as a constraint or by its penalty. "
                f"{len(tight)} fleets where it is narrow, on maps of their own. A single "
                "vehicle that is asked for a time off its own, on the way, and whether its next plan has "
                "that time to .1 s.",
            ),
            rows=[*rows, *narrow.rows(narrowly)],
            tables=(_table(rows), narrow.table(narrowly), _steps_table(steps)),
            figure=_figure(shown, by_condition, steps),
            caption="(a) Distance of each vehicle of a fleet to its own slot; dashed, the arrival of the last. "
            "(b) Spread of the arrivals of every fleet. (c) Share of the changes that one step complies with, with "
            "95 % limits.",
            claims=[*_claims(by_condition, steps), narrow.claim(narrowly, H)],
        )


def fleet(setup: Setup, size: int, seed: int, kind: str) -> Trial:
    """Trial of one fleet's mission."""
    fields: dict[str, Any] = {"terrain": setup.terrain, "vehicles": size}
    if kind == FAULTED:
        fields["faults.solver_failure_rate"] = FAILING
    if kind == PRINTED:
        fields["consensus"] = "laplacian"
    if kind in (CONSTRAINT, PENALTY):
        fields["planner.incorporation"] = "constraint" if kind == CONSTRAINT else "penalty"
    return trial("simultaneous-arrival", seed, fields=fields)


def spreads(records: Sequence[Record]) -> np.ndarray:
    """[s] of each fleet; NaN where not all arrived."""
    return np.asarray(figures(records, "spread_s"), dtype=np.float64)


def _row(kind: str, size: int, records: Sequence[Record]) -> dict[str, Any]:
    spread = spreads(records)
    whole = spread[np.isfinite(spread)]
    return {
        "agreement": kind,
        "vehicles": size,
        "fleets": len(records),
        "arrived": int(figures(records, "arrived").sum()),
        "spread_median_s": float(np.median(whole)) if len(whole) else None,
        "spread_max_s": float(whole.max()) if len(whole) else None,
        "separation_min_m": float(figures(records, "separation_min_m").min()),
        "clearance_min_m": float(figures(records, "min_clearance_m").min()),
        "ground_contacts": int(figures(records, "ground_contacts").sum()),
        "not_admitted": int(figures(records, "plans_not_admitted").sum()),
        "without_plan": float((figures(records, "solver_failures") / figures(records, "replans")).mean()),
        "solve_ms_mean": float(figures(records, "solve_ms_mean").mean()),
    }


def _table(rows: Sequence[Mapping[str, Any]]) -> Table:
    head = ("agreement", "vehicles", "all arrived", "spread, median [s]", "largest [s]", "least separation [m]",
            "least clearance [m]", "answers without a plan")  # fmt: skip
    body = [
        (
            row["agreement"], row["vehicles"], f"{row['arrived']} of {row['fleets']}", _seconds(row["spread_median_s"]),
            _seconds(row["spread_max_s"]), f"{row['separation_min_m']:.0f}", f"{row['clearance_min_m']:.0f}",
            f"{row['without_plan']:.1%}",
        )
        for row in rows
    ]  # fmt: skip
    return Table("Arrivals of whole fleets", head, body)


def _seconds(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


def _steps_table(steps: Sequence[ArrivalStep]) -> Table:
    head = ("at most", "later", "in one step", "sooner", "in one step", "both by (A.14) no outlier")
    body = []
    for share in DEVIATIONS:
        of_share = [step for step in steps if step.share == share]
        later, sooner = ([step for step in of_share if step.later is way] for way in (True, False))
        body.append(
            (
                f"{share:.0%}",
                len(later),
                rate(sum(step.done for step in later), len(later)).text() if later else "–",
                len(sooner),
                rate(sum(step.done for step in sooner), len(sooner)).text() if sooner else "–",
                f"{sum(not step.outlier for step in of_share)} of {len(of_share)}",
            )
        )
    return Table("One vehicle, asked for another time by (A.13)", head, body)


def _claims(by_condition: Mapping[tuple[str, int], Sequence[Record]], steps: Sequence[ArrivalStep]) -> list[Claim]:
    by_kind = {
        kind: np.concatenate([spreads(group) for (k, _), group in by_condition.items() if k == kind])
        for kind in COLOURS
    }
    worst = {kind: float(np.nanmax(group)) if np.isfinite(group).any() else np.inf for kind, group in by_kind.items()}
    whole = all(np.isfinite(by_kind[kind]).all() for kind in (NOMINAL, FAULTED))
    return [
        Claim(
            "fleet.spread", "target", "A fleet arrives at one time.", "A.8",
            f"4, 6, 8, 16 vehicles: spread of arrivals at most h = {H:.2f} s, nominally and with {FAILING:.0%} solver "
            "failures",
            f"of {len(by_kind[NOMINAL])} and {len(by_kind[FAULTED])} fleets all arrived: {'yes' if whole else 'no'}; "
            f"spread at most {worst[NOMINAL]:.2f} s, with failures {worst[FAULTED]:.2f} s",
            whole and max(worst[NOMINAL], worst[FAULTED]) <= H,
        ),
        Claim(
            "A.consensus-by-A12", "printed", "(A.12) is a successful choice of the estimated time of arrival.", "A.8.3",
            f"fleets that agree on the average of (A.12) arrive within h = {H:.2f} s of each other",
            f"spread {median(by_kind[PRINTED]).text()} s, at most {worst[PRINTED]:.1f} s: (A.12) is the least time "
            "possible, so half of a fleet is asked for more than it can",
            worst[PRINTED] <= H,
        ),
        Claim(
            "A.constraint", "printed", "The planner satisfies the consensus by imposing (A.13).", "A.8.3",
            f"fleets that agree on the maximum arrive within h = {H:.2f} s of each other",
            f"spread {median(by_kind[CONSTRAINT]).text()} s, at most {worst[CONSTRAINT]:.2f} s; "
            f"{_without_plan(by_condition, CONSTRAINT):.0%} of the answers no plan: "
            "who is early would have to fly back",
            worst[CONSTRAINT] <= H,
        ),
        Claim(
            "A.penalty", "printed", "Or by penalising deviations from it.", "A.8.3", "likewise",
            f"spread {median(by_kind[PENALTY]).text()} s, at most {worst[PENALTY]:.2f} s; "
            f"{_without_plan(by_condition, PENALTY):.1%} of the answers no plan",
            worst[PENALTY] <= H,
        ),
        Claim(
            "A.one-step", "printed", "In most cases the planner fulfils (A.13) in one single step.", "A.8.4",
            "more than half of the changes of up to 30 %",
            f"{rate(sum(step.done for step in steps), len(steps)).text()} of all; up to {DEVIATIONS[-1]:.0%}: later "
            f"{_share(steps, later=True)}, sooner {_share(steps, later=False)}"
            if steps else "no vehicle was far enough from its target",
            _done(steps, DEVIATIONS[-1]) > 0.5 if steps else None,
        ),
    ]  # fmt: skip


def _without_plan(by_condition: Mapping[tuple[str, int], Sequence[Record]], kind: str) -> float:
    """Share of a planner's answers."""
    group = [record for (k, _), records in by_condition.items() if k == kind for record in records]
    return float((figures(group, "solver_failures") / figures(group, "replans")).mean())


def _done(steps: Sequence[ArrivalStep], share: float) -> float:
    done = [step.done for step in steps if step.share == share]
    return float(np.mean(done)) if done else 0.0


def _share(steps: Sequence[ArrivalStep], *, later: bool) -> str:
    done = [step.done for step in steps if step.share == DEVIATIONS[-1] and step.later is later]
    return f"{np.mean(done):.0%} of {len(done)}" if done else "none tried"


# ---- what is drawn


def _figure(
    shown: RunResult, by_condition: Mapping[tuple[str, int], Sequence[Record]], steps: Sequence[ArrivalStep]
) -> Figure:
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(13.0, 4.4), layout="constrained")
        left, middle, right = page.subplots(1, 3, width_ratios=(1.3, 1.1, 0.9))
        _draw_fleet(left, shown)
        _draw_spreads(middle, by_condition)
        _draw_steps(right, steps)
    return page


def _draw_fleet(axes: Axes, shown: RunResult) -> None:
    """Distance from each vehicle to its slot; that is where one time of arrival is seen."""
    places = shown.config["mission"]["vehicles"]
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(places)))
    t = shown.recording.t
    for (name, place), colour in zip(places.items(), colours, strict=True):
        distance = np.linalg.norm(shown.recording.truths[name][:, :3] - np.array(place["target"]), axis=1)
        axes.plot(t, distance / 1000.0, color=colour, lw=1.3)
    axes.axvline(shown.summary["arrival_time_s"], color=INK, ls="--", lw=1.0)
    axes.set(xlim=(0.0, t[-1]), ylim=(0.0, None), xlabel="time [s]", ylabel="distance to the own slot [km]")
    axes.set_title(f"(a) {len(places)} vehicles, one arrival")


def _draw_spreads(axes: Axes, by_condition: Mapping[tuple[str, int], Sequence[Record]]) -> None:
    rng = np.random.default_rng(0)
    sizes = sorted({size for _, size in by_condition})
    for (kind, size), group in by_condition.items():
        spread = spreads(group)
        offset = 0.14 * (list(COLOURS).index(kind) - 2)
        x = sizes.index(size) + offset + rng.uniform(-0.05, 0.05, len(spread))
        label = kind if size == min(s for k, s in by_condition if k == kind) else None
        axes.plot(x, np.maximum(spread, LEAST_DRAWN), "o", ms=5, alpha=0.75, color=COLOURS[kind], label=label)
    axes.axhline(H, color=INK, ls="--", lw=1.0)
    axes.annotate("h", (len(sizes) - 0.55, H), (0, 3), textcoords="offset points")
    axes.set_yscale("log")
    axes.set_ylim(0.7 * LEAST_DRAWN, None)
    axes.set_xticks(range(len(sizes)), [str(size) for size in sizes])
    axes.set(xlabel="vehicles", ylabel="spread of arrivals [s]")
    axes.set_title("(b) every fleet")
    axes.legend(loc="upper right", fontsize=8.0)


def _draw_steps(axes: Axes, steps: Sequence[ArrivalStep]) -> None:
    for later, colour, label, offset in ((True, "#0d5fa8", "later", -0.1), (False, "#c2183b", "sooner", 0.1)):
        for k, share in enumerate(DEVIATIONS):
            done = [step.done for step in steps if step.share == share and step.later is later]
            if not done:
                continue
            found = rate(sum(done), len(done))
            axes.plot([k + offset, k + offset], [found.low, found.high], color=colour, lw=1.5, alpha=0.6)
            axes.plot(k + offset, found.value, "o", ms=6, color=colour, label=label if k == 0 else None)
    axes.set_xticks(range(len(DEVIATIONS)), [f"{share:.0%}" for share in DEVIATIONS])
    axes.set(ylim=(-0.03, 1.03), xlabel="largest deviation asked for", ylabel="share done in one step")
    axes.set_title("(c) one step by (A.13)")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="lower left")
