"""The missile in MuJoCo: what its planner, its autopilots and its estimators are worth (B.4).

The thesis stops at the reference trajectory and assumes an autopilot. Here the plan is flown: open loop, by feedback
linearisation with an integral term, and by a time-varying linear-quadratic regulator; with a plan once and for all or
with a new one ten times a second; against a body that is heavier than declared, weak thrusters, wind, limits, delay,
noise, and a target that moves; and in space with everything drawn at random. The miss is the closest approach to the
true target, the aspect error that of the nose then.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

import matplotlib
import numpy as np
from annotated_types import Interval
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from mathnavi.models.compilation import compiler
from mathnavi.renders.figures import STYLE
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, Within, configuration
from mathnavi.sim.interfaces.signals import Array
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.nodes.missile_closed_loop.flights import (
    APPROACHING,
    AUTOPILOTS,
    CASES,
    DECOUPLED,
    HEAVIER_KINDS,
    OPEN_LOOP,
    OTHERS,
    PAIRS,
    RECEDING,
    ROUGH,
    ROUGH_KINDS,
    VEHICLE,
    WITHOUT_LEAD,
    Kind,
    selected_kinds,
)
from mathnavi.sim.studies.nodes.missile_closed_loop.monte_carlo import NAME as DRAWN
from mathnavi.sim.studies.nodes.missile_closed_loop.monte_carlo import drawn_claim, drawn_table, drawn_trial
from mathnavi.sim.sweep.trial import trial

DRAWN_KIND = Kind(DRAWN, period=None, seeded=True)
REPLANNED: tuple[Mapping[str, Any], ...] = ({}, ROUGH, APPROACHING.fields)  # flights whose replans are timed


@configuration
class MissileClosedLoopConfig:
    """Sample sizes: missions that are flown."""

    cases: Annotated[Count, Within(Interval(ge=1, le=len(CASES)))] = 4
    """how many of SM, SM2, SM3, FAST are flown"""
    seeds: Count = 20
    """flights of each kind with noise or failures"""
    replans: Count = 200
    """at least so many are timed with each solver"""
    others: Annotated[Count, Within(Interval(ge=1, le=OTHERS))] = OTHERS
    """how many of the kinds of flights that no claim is about"""
    pairs: Annotated[Count, Within(Interval(ge=1, le=PAIRS))] = PAIRS
    """how many flights in space are planned apart and as one problem"""
    draws: Count = 100
    """flights in space with heading, target, gusts and body drawn"""


class MissileClosedLoop:
    """The missile's planner, autopilots and estimators in MuJoCo (B.4)."""

    Config = MissileClosedLoopConfig
    quick = MissileClosedLoopConfig(cases=1, seeds=2, replans=30, draws=4)
    title = "The dive, flown: planner and autopilots of the missile in MuJoCo"
    on_terrain = False

    @staticmethod
    def run(config: MissileClosedLoopConfig, setup: Setup) -> StudyResult:
        kinds = selected_kinds(config.others, config.pairs)
        asked = {kind.name: kind.trials(config.cases, config.seeds) for kind in kinds}
        drawn = [drawn_trial(number) for number in range(config.draws)]
        records = setup.fly_groups({**asked, DRAWN: drawn})
        solvers = (
            ("fatrop-compiled", "fatrop", "ipopt-compiled", "ipopt") if compiler() is not None else ("fatrop", "ipopt")
        )
        backend = solvers[0]
        timed = setup.compute(timed_replans, solvers, least=config.replans)
        replans = {name: {**times, "ms": np.array(times["ms"])} for name, times in zip(solvers, timed, strict=True)}
        rough = setup.flown({kind.autopilot: kind.trials(1, 1)[0] for kind in ROUGH_KINDS})
        paths = {autopilot: outcome.recording for autopilot, outcome in rough.items()}
        return StudyResult(
            summary=(
                f"Flights in the cases {', '.join(CASES[: config.cases])}, and {config.seeds} seeds of SM where there "
                "is noise or failure. The state is exact where no estimator is named. Times are thread CPU times of "
                "one replan, the first plan of a flight left out.",
            ),
            rows=[_row(kind, records[kind.name]) for kind in (*kinds, DRAWN_KIND)],
            tables=(
                _flights(kinds, records),
                drawn_table(records[DRAWN]),
                _decoupling(records, config),
                _times(replans),
            ),
            figure=_figure(paths, (*kinds, DRAWN_KIND), records, replans),
            caption="(a) The case SM with mass and inertia +10 %, force -5 % and a steady gust, one plan, by autopilot."
            " (b) Miss of every flight. (c) Times of one replan.",
            claims=[*_claims(records, replans, backend), drawn_claim(records[DRAWN])],
        )


def timed_replans(backend: str, least: int) -> dict[str, Any]:
    """Times [ms] of at least so many replans with a solver, and how many failed; a flight ends when they are there."""
    times: list[MeasuredTime] = []
    failures, flights = 0, 0
    while len(times) < least:
        fields = {"planner.backend": backend, **REPLANNED[flights % len(REPLANNED)]}
        case = CASES[(flights // len(REPLANNED)) % len(CASES)]
        closed_loop = trial("missile-guidance", flights, fields={"case": case, **fields}).build()
        enough = (least - len(times) + 1) * closed_loop.agents[VEHICLE].planner.period  # [s] the first plan is left out
        outcome = replace(closed_loop, duration=min(enough, closed_loop.duration)).run()
        agent = outcome.recording.agents[VEHICLE]
        times += [MeasuredTime(t) for t in agent.solve_ms[1:] if np.isfinite(t)]
        failures += int(outcome.summary["solver_failures"])
        flights += 1
    return {"ms": times, "failures": failures, "flights": flights}


def _row(kind: Kind, records: Sequence[Record]) -> dict[str, Any]:
    miss, aspect = figures(records, "miss_m"), figures(records, "aspect_error_deg")
    return {
        "kind": kind.name,
        "autopilot": kind.autopilot,
        "estimator": kind.estimator,
        "flights": len(records),
        "hits": sum(bool(record.summary["hit"]) for record in records),
        "miss_median_m": float(np.median(miss)),
        "miss_max_m": float(miss.max()),
        "aspect_error_max_deg": float(aspect.max()),
        "cost_mean": float(figures(records, "cost").mean()),
        "saturated_mean_s": float(figures(records, "saturated_s").mean()),
        "solver_failures": int(figures(records, "solver_failures").sum()),
    }


def _worst(records: Mapping[str, Sequence[Record]], *kinds: Kind) -> tuple[float, float]:
    """Largest miss [m] and aspect error [deg] over all flights of some kinds."""
    flights = [record for kind in kinds for record in records[kind.name]]
    return float(figures(flights, "miss_m").max()), float(figures(flights, "aspect_error_deg").max())


def _claims(
    records: Mapping[str, Sequence[Record]], replans: Mapping[str, Mapping[str, Any]], backend: str
) -> list[Claim]:
    ours, ipopt = (np.percentile(replans[name]["ms"], 95) for name in (backend, "ipopt"))
    failures, count = replans[backend]["failures"], len(replans[backend]["ms"])
    compiled = backend.endswith("compiled")
    both = f", {ours / np.percentile(replans['ipopt-compiled']['ms'], 95):.2f} of IPOPT compiled" if compiled else ""
    miss, _ = _worst(records, OPEN_LOOP)
    moving, _ = _worst(records, APPROACHING, RECEDING)
    blind, _ = _worst(records, WITHOUT_LEAD)
    linearised, regulated = (
        _worst(records, *(kind for kind in (*HEAVIER_KINDS, *ROUGH_KINDS) if kind.autopilot == autopilot))
        for autopilot in ("feedback-linearisation", "tvlqr")
    )
    return [
        Claim(
            "missile.replan", "target", "A new plan is made within milliseconds, every time.", "B.3, B.4",
            "N = 25: no failure, and with a C compiler the 95th percentile at most 5 ms and half of IPOPT's",
            f"{failures} of {count} failed; {backend} {ours:.2f} ms, IPOPT {ipopt:.2f} ms (95th percentiles): "
            f"{ours / ipopt:.2f}{both}",
            failures == 0 and (not compiled or bool(ours <= 5.0 and ours <= 0.5 * ipopt)),
        ),
        Claim(
            "missile.open-loop", "target", "Undisturbed, the plan's inputs alone hit the target.", "B.4",
            "MuJoCo at 1 kHz, every case: miss <= .02 m", f"at most {miss:.2g} m", miss <= 0.02,
        ),
        Claim(
            "missile.feedback", "target", "An autopilot makes up for what was not declared.", "B.4, Figure B.3",
            "one plan, +10 % mass and inertia, then also -5 % force, 400 N, 20 N m, every case: feedback linearisation "
            "<= .05 m and .1°, TVLQR <= .15 m and .2°",
            f"at most {linearised[0]:.3f} m and {linearised[1]:.3f}°; {regulated[0]:.3f} m and {regulated[1]:.3f}°",
            linearised[0] <= 0.05 and linearised[1] <= 0.1 and regulated[0] <= 0.15 and regulated[1] <= 0.2,
        ),
        Claim(
            "missile.moving-target", "target", "A moving target is met where it will be.", "B.4",
            "target at ±30 m/s, every case: miss <= .1 m",
            f"at most {moving:.2g} m; without lead at most {blind:.1f} m", moving <= 0.1,
        ),
    ]  # fmt: skip


def _flights(kinds: Sequence[Kind], records: Mapping[str, Sequence[Record]]) -> Table:
    columns = ("flights", "hits", "miss, median [m]", "largest [m]", "aspect error, largest [°]", "cost, mean")
    rows = []
    for kind in kinds:
        row = _row(kind, records[kind.name])
        hits = f"{row['hits']} of {row['flights']}"
        if kind.seeded:
            hits = rate(row["hits"], row["flights"]).text()
        rows.append(
            (kind.name, hits, f"{row['miss_median_m']:.2g}", f"{row['miss_max_m']:.2g}",
             f"{row['aspect_error_max_deg']:.2g}", f"{row['cost_mean']:.1f}" if row["hits"] else "–")
        )  # fmt: skip
    return Table("Every kind of flight", columns, rows)


def _decoupling(records: Mapping[str, Sequence[Record]], config: MissileClosedLoopConfig) -> Table:
    """Table of the cost of planning pitch and yaw apart, each seeing the other's motion only."""
    columns = ("flight", "case", "J planned, apart", "as one", "J flown, apart", "as one", "miss, apart [m]",
               "CPU time of a replan, apart [ms]", "as one [ms]")  # fmt: skip
    rows = []
    for name, (apart, whole) in list(DECOUPLED.items())[: config.pairs]:
        for case, one, other in zip(CASES[: config.cases], records[apart.name], records[whole.name], strict=True):
            planned, flown, ms = (figures((one, other), key) for key in ("planned_cost", "cost", "solve_ms_p50"))
            rows.append(
                (name, case, *(f"{cost:.3f}" for cost in (*planned, *flown)), f"{one.summary['miss_m']:.1e}",
                 *(f"{t:.1f}" for t in ms))
            )  # fmt: skip
    return Table("Pitch and yaw planners together, and one problem in all states", columns, rows)


def _times(replans: Mapping[str, Mapping[str, Any]]) -> Table:
    columns = ("solver", "replans", "failures", "median [ms]", "95th percentile [ms]", "largest [ms]")
    rows = [
        (name, str(len(found["ms"])), str(found["failures"]), f"{np.median(found['ms']):.2f}",
         f"{np.percentile(found['ms'], 95):.2f}", f"{found['ms'].max():.2f}")
        for name, found in replans.items()
    ]  # fmt: skip
    return Table("One replan, N = 25, multiple shooting", columns, rows)


def _figure(
    paths: Mapping[str, Any],
    kinds: Sequence[Kind],
    records: Mapping[str, Sequence[Record]],
    replans: Mapping[str, Mapping[str, Any]],
) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(10.4, 7.6), layout="constrained")
        axes = figure.subplot_mosaic([["path", "miss"], ["time", "miss"]], width_ratios=(1.0, 1.15))
        styles = {"open-loop": "-", "feedback-linearisation": "-", "tvlqr": "--"}
        for autopilot, recording in paths.items():
            x = recording.truths[VEHICLE]
            axes["path"].plot(
                x[:, 0], x[:, 1], color=AUTOPILOTS[autopilot], ls=styles[autopilot], lw=1.6, label=autopilot
            )
        axes["path"].plot(700.0, 0.0, "x", color="#101824", ms=8, mew=2)
        axes["path"].set(xlabel="x [m]", ylabel="altitude [m]", title="(a) heavier, weaker, gust: one plan")
        axes["path"].legend(fontsize=8)
        _misses(axes["miss"], kinds, records)
        for name, found in replans.items():
            ms: Array = np.sort(found["ms"])
            colour = "#c2183b" if name.startswith("fatrop") else "#6b7785"
            style = "-" if name.endswith("compiled") or len(replans) == 2 else "--"
            axes["time"].step(ms, np.arange(1, len(ms) + 1) / len(ms), where="post", color=colour, ls=style, label=name)
        axes["time"].set_xscale("log")
        axes["time"].xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes["time"].xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes["time"].xaxis.set_minor_formatter(NullFormatter())
        axes["time"].axvline(5.0, color="#101824", ls=":", lw=1.2)
        axes["time"].set(xlabel="CPU time [ms]", ylabel="share of the replans", title="(c) one replan, N = 25")
        axes["time"].set_xlim(left=0.05)  # room for the names
        axes["time"].legend(fontsize=8, loc="center left")
    return figure


def _misses(axes: Axes, kinds: Sequence[Kind], records: Mapping[str, Sequence[Record]]) -> None:
    for k, kind in enumerate(kinds):
        miss = np.maximum(figures(records[kind.name], "miss_m"), 1e-9)
        axes.plot(miss, np.full(len(miss), k), "o", color=AUTOPILOTS[kind.autopilot], ms=4.5, alpha=0.55, mew=0)
    axes.set_yticks(range(len(kinds)), [kind.name for kind in kinds], fontsize=7.5)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.axvline(1.0, color="#101824", ls=":", lw=1.2)
    axes.set(xlabel="miss [m]", title="(b) every flight")
