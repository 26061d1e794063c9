"""The missile in MuJoCo: performance of its planner, autopilots and estimators (B.4).

The thesis ends with the reference trajectory and assumes an autopilot. Here the plan is flown: open loop, by feedback
linearisation with an integral term, and by a time-varying linear-quadratic regulator; with one plan or with a new one
ten times a second; with more mass than declared, weak thrusters, wind, limits, delay, noise, and a moving target; and
in three dimensions with all parameters drawn at random. The miss is the closest approach to the true target, the aspect
error that of the nose at that time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter
from scipy.stats import binom

from mathnavi.interfaces.bounds import Count, Within, configuration
from mathnavi.interfaces.signals import Array
from mathnavi.models.compilation import compiler
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.statistics import median_band, rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import Trial, trial
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult

CASES = ("SM", "SM2", "SM3", "FAST")
VEHICLE = "missile"
ONCE = 1e3  # [s] replan period: one plan is flown to its end
AUTOPILOTS = {"open-loop": "#6b7785", "feedback-linearisation": "#c2183b", "tvlqr": "#1b7fbd"}
CONFIDENCE = 0.95
STREAM = 20061121  # of the draws, beside the number of the flight


@dataclass(frozen=True)
class Kind:
    """Flights of one kind, with the same fields over cases or seeds."""

    name: str
    fields: Mapping[str, Any] = field(default_factory=dict)
    autopilot: str = "feedback-linearisation"
    period: float | None = ONCE  # [s] None: the planner's own
    estimator: str = "full_state"
    seeded: bool = False  # flown over seeds, in the case SM; otherwise once in every case

    def trials(self, cases: int, seeds: int) -> list[Trial]:
        flights = [("SM", seed) for seed in range(seeds)] if self.seeded else [(case, 0) for case in CASES[:cases]]
        planner: dict[str, Any] = {"planner.autopilot": self.autopilot}
        if self.period is not None:
            planner["planner.replan_period"] = self.period
        return [
            trial("missile-guidance", seed, estimator=self.estimator, fields={"case": case, **planner, **self.fields})
            for case, seed in flights
        ]


HEAVIER = {"mismatch.mass": 1.1, "mismatch.inertia": 1.1}
ROUGH = {**HEAVIER, "mismatch.force": 0.95, "gust.force": (400.0, 0.0, 0.0), "gust.torque": (0.0, 20.0, 0.0)}
NOISY = {"noise.position": 1.0, "noise.velocity": 0.5, "noise.angle": 0.5, "noise.rate": 0.5}
ACROSS = {"dimension": "spatial", "target": (700.0, 150.0, 0.0)}
TURNED = {"dimension": "spatial", "start_heading": 40.0}
JOINT = {"planner.spatial": "joint"}

OPEN_LOOP = Kind("as modelled, open-loop, 1 kHz", {"control_rate": 1000.0}, "open-loop")
HEAVIER_KINDS, ROUGH_KINDS = (
    tuple(Kind(f"{name}, {autopilot}", fields, autopilot) for autopilot in AUTOPILOTS)
    for name, fields in (("mass and inertia +10 %", HEAVIER), ("and force -5 %, gust", ROUGH))
)
APPROACHING = Kind("target at +30 m/s", {"target_velocity": (30.0, 0.0, 0.0)}, period=None)
RECEDING = Kind("target at -30 m/s", {"target_velocity": (-30.0, 0.0, 0.0)}, period=None)
WITHOUT_LEAD = Kind("target at +30 m/s, without lead", {**APPROACHING.fields, "planner.lead": False}, period=None)
CLAIMED = (OPEN_LOOP, *HEAVIER_KINDS, *ROUGH_KINDS, APPROACHING, RECEDING, WITHOUT_LEAD)  # what the claims are about
DECOUPLED = {  # pitch and yaw planners together, and the same flight as one problem in all states
    "target 150 m aside": (
        Kind("in space, target 150 m aside", ACROSS, period=None),
        Kind("in space, target 150 m aside, one problem", {**ACROSS, **JOINT}, period=None),
    ),
    "40° off": (
        Kind("in space, 40° off", TURNED, period=None),
        Kind("in space, 40° off, one problem", {**TURNED, **JOINT}, period=None),
    ),
}
PAIRED = tuple(kind for pair in DECOUPLED.values() for kind in pair)
KINDS = (
    OPEN_LOOP,
    *HEAVIER_KINDS,
    *ROUGH_KINDS,
    Kind("the same, planned again", ROUGH, period=None),
    APPROACHING,
    RECEDING,
    WITHOUT_LEAD,
    Kind("target turns at 2 s, announced 0.5 s late",
         {"target_change": ((2.0, 20.0, 0.0, 0.0),), "target_announcement_delay": 0.5}, period=None),
    Kind("normal force limited to 2.5 kN", {"actuator.normal": 2500.0}, period=None),
    Kind("target 4 km away", {"target": (4000.0, 0.0, 0.0)}, period=None),
    Kind("thrusters 20 ms late, which is not declared", {"actuator.delay": 0.02, "actuator.declared_delay": 0.0},
         period=None),
    Kind("thrusters 150 ms late", {"actuator.delay": 0.15}, period=None),
    Kind("thrusters 150 ms late, 120 ms declared", {"actuator.delay": 0.15, "actuator.declared_delay": 0.12},
         period=None),
    Kind("noise, raw", NOISY, period=None, seeded=True),
    Kind("noise, missile_kalman", NOISY, period=None, estimator="missile_kalman", seeded=True),
    Kind("noise, rough, missile_kalman", {**NOISY, **ROUGH}, period=None, estimator="missile_kalman", seeded=True),
    Kind("in space, 20° off, target at 30 m/s across, rough",
         {**ROUGH, "dimension": "spatial", "start_heading": 20.0, "target_velocity": (0.0, 30.0, 0.0)}, period=None),
    *PAIRED,
    Kind("30 % of the solves fail, rough", {**ROUGH, "faults.solver_failure_rate": 0.3}, period=None, seeded=True),
)  # fmt: skip
OTHERS, PAIRS = len(KINDS) - len(CLAIMED) - len(PAIRED), len(DECOUPLED)
DRAWN = Kind("drawn, in space", period=None, seeded=True)  # its flights are those of ``drawn_trial``
REPLANNED: tuple[Mapping[str, Any], ...] = ({}, ROUGH, APPROACHING.fields)  # flights whose replans are timed


@configuration
class MissileClosedLoopConfig:
    """Sample sizes: missions that are flown."""

    cases: Annotated[Count, Within(Interval(ge=1, le=len(CASES)))] = 4
    """number of cases, of SM, SM2, SM3, FAST"""
    seeds: Count = 20
    """number of flights of each kind with noise or failures"""
    replans: Count = 200
    """least number of replans that are timed with each solver"""
    others: Annotated[Count, Within(Interval(ge=1, le=OTHERS))] = OTHERS
    """number of kinds of flights that no claim is about"""
    pairs: Annotated[Count, Within(Interval(ge=1, le=PAIRS))] = PAIRS
    """number of flights in three dimensions that are planned by separate planners and as one problem"""
    draws: Count = 100
    """number of flights in three dimensions with heading, target, gusts and body drawn"""


class MissileClosedLoop:
    """The missile's planner, autopilots and estimators in MuJoCo (B.4)."""

    Config = MissileClosedLoopConfig
    quick = MissileClosedLoopConfig(cases=1, seeds=2, replans=30, draws=4)
    title = "The dive, flown: planner and autopilots of the missile in MuJoCo"
    on_terrain = False

    @staticmethod
    def run(config: MissileClosedLoopConfig, setup: Setup) -> StudyResult:
        kinds = (*selected_kinds(config.others, config.pairs), DRAWN)
        asked = {kind.name: kind.trials(config.cases, config.seeds) for kind in kinds if kind is not DRAWN}
        asked[DRAWN.name] = [drawn_trial(number) for number in range(config.draws)]
        records = setup.fly_groups(asked)
        solvers = ("fatrop-compiled", "fatrop", "ipopt-compiled", "ipopt") if compiler() else ("fatrop", "ipopt")
        timed = setup.compute(timed_replans, solvers, least=config.replans)
        replans = dict(zip(solvers, timed, strict=True))
        rows = {kind.name: _row(kind, records[kind.name]) for kind in kinds}
        return StudyResult(
            summary=(
                f"Flights in the cases {', '.join(CASES[: config.cases])}, and {config.seeds} seeds of SM where there "
                "is noise or failure. The state is exact where no estimator is named. Times are thread CPU times of "
                "one replan, the first plan of a flight left out.",
            ),
            rows=list(rows.values()),
            tables=(
                _flights([(kind, rows[kind.name]) for kind in kinds if kind is not DRAWN]),
                _drawn(records[DRAWN.name]),
                _decoupling(records, config),
                _times(replans),
            ),
            figure=_figure(
                setup.flown({kind.autopilot: kind.trials(1, 1)[0] for kind in ROUGH_KINDS}),
                [(kind, figures(records[kind.name], "miss_m")) for kind in kinds],
                {name: timed["ms"] for name, timed in replans.items()},
            ),
            caption="(a) The case SM with mass and inertia +10 %, force -5 % and a steady gust, one plan, by autopilot."
            " (b) Miss of every flight. (c) Times of one replan.",
            claims=_claims(rows, replans, figures(records[DRAWN.name], "miss_m")),
        )


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


def _claims(
    rows: Mapping[str, Mapping[str, Any]], replans: Mapping[str, Mapping[str, Any]], drawn_misses: Array
) -> list[Claim]:
    """Evaluate every claim from rows by kind, replans by solver, and misses (n,) [m] of the drawn flights."""

    def largest(figure: str, *kinds: Kind) -> float:
        return float(np.max([rows[kind.name][figure] for kind in kinds]))

    backend = next(iter(replans))
    p95 = {name: np.percentile(timed["ms"], 95) for name, timed in replans.items()}
    ours, ipopt, compiled = p95[backend], p95["ipopt"], backend.endswith("compiled")
    failures, count = replans[backend]["failures"], len(replans[backend]["ms"])
    both = f", {ours / p95['ipopt-compiled']:.2f} of IPOPT compiled" if compiled else ""
    miss, moving = largest("miss_max_m", OPEN_LOOP), largest("miss_max_m", APPROACHING, RECEDING)
    linearised, regulated = (
        [largest(name, *(kind for kind in (*HEAVIER_KINDS, *ROUGH_KINDS) if kind.autopilot == autopilot))
         for name in ("miss_max_m", "aspect_error_max_deg")]
        for autopilot in ("feedback-linearisation", "tvlqr")
    )  # fmt: skip
    drawn, (median, most) = rows[DRAWN.name], _median_and_most(drawn_misses)
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
            "MuJoCo at 1 kHz, every case: miss <= 0.02 m", f"at most {miss:.2g} m", miss <= 0.02,
        ),
        Claim(
            "missile.feedback", "target", "An autopilot makes up for what was not declared.", "B.4, Figure B.3",
            "one plan, +10 % mass and inertia, then also -5 % force, 400 N, 20 N m, every case: feedback linearisation "
            "<= 0.05 m and 0.1°, TVLQR <= 0.15 m and 0.2°",
            f"at most {linearised[0]:.3f} m and {linearised[1]:.3f}°; {regulated[0]:.3f} m and {regulated[1]:.3f}°",
            linearised[0] <= 0.05 and linearised[1] <= 0.1 and regulated[0] <= 0.15 and regulated[1] <= 0.2,
        ),
        Claim(
            "missile.moving-target", "target", "A moving target is met where it will be.", "B.4",
            "target at ±30 m/s, every case: miss <= 0.1 m",
            f"at most {moving:.2g} m; without lead at most {largest('miss_max_m', WITHOUT_LEAD):.1f} m", moving <= 0.1,
        ),
        Claim(
            "missile.drawn", "target", "Whatever the heading, the target's motion, gusts and the body, it is met.",
            "B.4",
            "100 draws in space, any heading, a target of up to 30 m/s that turns once, 10 % of mass and inertia, 5 % "
            "of the thrusters, gusts of 400 N and 20 N m: at least 95 % hit (miss <= 1 m), 90 % within 0.5 m",
            f"{rate(drawn['hits'], drawn['flights']).text()} hit; miss: median {median} m, 90 % {most} m, largest "
            f"{drawn['miss_max_m']:.2g} m",
            bool(drawn["hits"] >= 0.95 * drawn["flights"] and quantile_limits(drawn_misses, 0.9)[0] <= 0.5),
        ),
    ]  # fmt: skip


def _flights(rows: Sequence[tuple[Kind, Mapping[str, Any]]]) -> Table:
    columns = ("flights", "hits", "miss, median [m]", "largest [m]", "aspect error, largest [°]", "cost, mean")
    cells = [
        (kind.name,
         rate(row["hits"], row["flights"]).text() if kind.seeded else f"{row['hits']} of {row['flights']}",
         f"{row['miss_median_m']:.2g}", f"{row['miss_max_m']:.2g}", f"{row['aspect_error_max_deg']:.2g}",
         f"{row['cost_mean']:.1f}" if row["hits"] else "–")
        for kind, row in rows
    ]  # fmt: skip
    return Table("Every kind of flight", columns, cells)


def _drawn(records: Sequence[Record]) -> Table:
    """Return the table of misses and aspect errors of the drawn flights: median and 90 % quantile, with limits."""
    cells = [
        (name, *_median_and_most(values), f"{values.max():.3g}")
        for name, values in (
            ("miss [m]", figures(records, "miss_m")),
            ("aspect error [°]", figures(records, "aspect_error_deg")),
        )
    ]
    hits, grounded = (sum(bool(record.summary[name]) for record in records) for name in ("hit", "hit_ground"))
    cells.append(("hits", rate(hits, len(records)).text(), f"{grounded} hit the ground", ""))
    return Table("Flights in space with everything drawn", ("", "median", "90 %", "largest"), cells)


def _decoupling(records: Mapping[str, Sequence[Record]], config: MissileClosedLoopConfig) -> Table:
    """Return the table of the cost of planning pitch and yaw separately, each with the other's motion given."""
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
        (name, str(len(timed["ms"])), str(timed["failures"]), f"{np.median(timed['ms']):.2f}",
         f"{np.percentile(timed['ms'], 95):.2f}", f"{max(timed['ms']):.2f}")
        for name, timed in replans.items()
    ]  # fmt: skip
    return Table("One replan, N = 25, multiple shooting", columns, rows)


def _median_and_most(values: Array) -> tuple[str, str]:
    """Return the median and the 90 % quantile of values (n,) as text, with their confidence limits, if any."""
    band = median_band(values, np.random.default_rng(0), CONFIDENCE)
    median, most = (
        f"{value:.2g}" if np.isnan([low, high]).any() else f"{value:.2g} [{low:.2g}, {high:.2g}]"
        for value, low, high in ((band.median, band.low, band.high), quantile_limits(values, 0.9))
    )
    return median, most


def quantile_limits(values: Array, share: float, confidence: float = CONFIDENCE) -> tuple[float, float, float]:
    """Return the quantile of a share of values (n,), and order statistics that enclose the population's quantile.

    The k-th smallest of n values is below the quantile if at least k of them are, whose number is binomial. A limit
    without an order statistic is NaN.
    """
    ordered, n = np.sort(values), len(values)
    tail = 0.5 * (1.0 - confidence)
    below, above = int(binom.ppf(tail, n, share)), int(binom.ppf(1.0 - tail, n, share)) + 1
    low = float(ordered[below - 1]) if below >= 1 else float("nan")
    high = float(ordered[above - 1]) if above <= n else float("nan")
    return float(np.quantile(ordered, share)), low, high


def _figure(
    flown: Mapping[str, RunData], misses: Sequence[tuple[Kind, Array]], replans: Mapping[str, Sequence[float]]
) -> Figure:
    """Draw flights by autopilot, misses [m] of each kind of flight, and times [ms] of replans by solver."""
    with styled_figure((10.4, 7.6)) as figure:
        axes = figure.subplot_mosaic([["path", "miss"], ["time", "miss"]], width_ratios=(1.0, 1.15))
        for autopilot, outcome in flown.items():
            x, style = outcome.recording.truths[VEHICLE], "--" if autopilot == "tvlqr" else "-"
            axes["path"].plot(x[:, 0], x[:, 1], color=AUTOPILOTS[autopilot], ls=style, lw=1.6, label=autopilot)
        axes["path"].plot(700.0, 0.0, "x", color="#101824", ms=8, mew=2)
        axes["path"].set(xlabel="x [m]", ylabel="altitude [m]", title="(a) heavier, weaker, gust: one plan")
        axes["path"].legend(fontsize=8)
        _misses(axes["miss"], misses)
        for name, times in replans.items():
            ms: Array = np.sort(times)
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


def _misses(axes: Axes, misses: Sequence[tuple[Kind, Array]]) -> None:
    for k, (kind, values) in enumerate(misses):
        miss = np.maximum(values, 1e-9)
        axes.plot(miss, np.full(len(miss), k), "o", color=AUTOPILOTS[kind.autopilot], ms=4.5, alpha=0.55, mew=0)
    axes.set_yticks(range(len(misses)), [kind.name for kind, _ in misses], fontsize=7.5)
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.axvline(1.0, color="#101824", ls=":", lw=1.2)
    axes.set(xlabel="miss [m]", title="(b) every flight")


def selected_kinds(others: int, pairs: int) -> tuple[Kind, ...]:
    """Return the kinds of flights that the claims need, ``pairs`` of ``DECOUPLED``, and ``others`` other kinds."""
    rest = [kind for kind in KINDS if kind not in (*CLAIMED, *PAIRED)]
    asked = (*CLAIMED, *PAIRED[: 2 * pairs], *rest[:others])
    return tuple(kind for kind in KINDS if kind in asked)


def drawn_trial(number: int) -> Trial:
    """Return the flight of a number: the case SM2 with fields drawn from a separate random stream."""
    rng = np.random.default_rng([STREAM, number])

    def between(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 4)

    def velocity() -> tuple[float, float, float]:
        speed, course = rng.uniform(0.0, 30.0), rng.uniform(-np.pi, np.pi)
        return round(float(speed * np.cos(course)), 4), round(float(speed * np.sin(course)), 4), 0.0

    turn = (between(1.0, 6.0), *velocity())
    fields: dict[str, Any] = {
        "case": "SM2",
        "dimension": "spatial",
        "start_heading": between(-180.0, 180.0),
        "target": (between(600.0, 1200.0), between(-400.0, 400.0), 0.0),
        "target_velocity": velocity(),
        "target_change": (turn,),
        "target_announcement_delay": 0.2,
        "mismatch.mass": between(0.9, 1.1),
        "mismatch.inertia": between(0.9, 1.1),
        "mismatch.force": between(0.95, 1.05),
        "mismatch.moment": between(0.95, 1.05),
        "gust.force_rms": between(0.0, 400.0),
        "gust.torque_rms": between(0.0, 20.0),
    }
    return trial("missile-guidance", number, fields=fields)


def timed_replans(backend: str, least: int) -> dict[str, Any]:
    """A job: times [ms] of at least ``least`` replans with a solver, and the number of failures."""
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
