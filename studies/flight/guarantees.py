"""The certified planner compared with other published safety rules, on the same missions under the same faults.

All planners fly from the same starts to the same targets over the same ground, with the same h_min, bounds of speed and
acceleration, tracker and tracking bound, and the same wrapper discards the same share of their answers. A vehicle
arrives when it passes within the arrival radius, at any speed. A *violation* is a flight below h_min; it is *announced*
if the loss of the guarantee was recorded before.

The comparison is of flight times, which the planners weigh differently by default: the optimiser that three of them
share trades a second for beta m^2/s^4 of squared acceleration; the barrier's law does not weigh time, but brakes
towards the target. So every planner is tuned for time, over the same number of settings, on seeds that are not
evaluated: of the settings with the fewest missions lost or violated over all conditions the fastest is flown in all
conditions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.protocols import Planner
from mathnavi.interfaces.signals import Plan, PlanRequest
from mathnavi.models.aerial.mission import FlightMission
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.statistics_figures import SERIES
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.flight import flown_clearance
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.job import job
from mathnavi.sim.sweep.trial import Trial
from mathnavi.studies.flight.guarantee_holes import guaranteed_at
from mathnavi.studies.framework.drawing import paths_on_map, styled_figure
from mathnavi.studies.framework.study import (
    VEHICLE,
    MissionToDraw,
    Row,
    Setup,
    StudyResult,
    chosen,
    ends,
    mission_ends,
    recorded_trial,
    track,
)

OURS = "flight"
PLANNERS = (OURS, "gatekeeper", "faster", "barrier", "as_printed")
COLOURS = dict(zip(PLANNERS, ("#101824", *SERIES[:4]), strict=True))
LOW = (20.0, 80.0)  # [m] above h_min at both ends of a mission
GUSTS = {"faults.gust_rms": 1.5}
IN_GUSTS = {"drawn_heights": LOW, **GUSTS}  # missions whose first plan is certified in gusts too
CONDITIONS: dict[str, dict[str, Any]] = {
    "no failures": {},
    "30 % failures": {"faults.solver_failure_rate": 0.3},
    "90 % failures": {"faults.solver_failure_rate": 0.9},
    "gusts": GUSTS,
}
_FAST: dict[str, Any] = {"planner.beta": 1600.0}
_LATE: dict[str, Any] = {"planner.approach": 0.5}
_FAR: dict[str, Any] = {"planner.horizon": 60.0}
_SETTINGS = 4
SETTINGS: dict[str, tuple[dict[str, Any], ...]] = {  # that are tried, the defaults first
    **dict.fromkeys(
        (OURS, "gatekeeper", "faster"),
        (
            {},
            _FAST,
            {**_FAST, "planner.horizon": 40.0, "planner.stretch": 1.12},
            {**_FAST, **_FAR, "planner.stretch": 1.19},
        ),
    ),
    "barrier": ({}, _LATE, {**_LATE, **_FAR}, {**_FAR, "planner.approach": 1.0}),
    "as_printed": ({}, {"planner.beta": 400.0}, _FAST, {"planner.beta": 6400.0}),
}
TUNING_SEED = 1000  # the first of the tuning
SLOWER = 1.05  # than the fastest peer without a contact or a violation, at most
MEASURE = "mathnavi.studies.flight.guarantees:violations"
_TIMED = 60.0  # [s] of a flight over which the planner's CPU time is taken


@configuration
class GuaranteesConfig:
    """Sample sizes: missions that are flown."""

    missions: Annotated[int, Interval(ge=1, le=TUNING_SEED)] = 100
    """number of missions, each flown by every planner under every condition"""
    conditions: Annotated[int, Interval(ge=1, le=len(CONDITIONS))] = len(CONDITIONS)
    """number of conditions under which the missions are flown"""
    timed: Count = 5
    """number of these missions in which the CPU time of every planner is measured"""
    tuning: Annotated[int, Interval(ge=1, le=100)] = 4
    """number of other missions on which every planner is tuned, under every condition"""
    settings: Annotated[int, Interval(ge=1, le=_SETTINGS)] = _SETTINGS
    """number of settings of each planner that are tried; 1 for the defaults without tuning"""


class Guarantees:
    """The certified planner compared with gatekeeper, a barrier filter, FASTER and the thesis, on the same missions."""

    Config = GuaranteesConfig
    quick = GuaranteesConfig(missions=2, timed=1, tuning=1, settings=2)
    title = "Guarantees beside those of peers"

    @staticmethod
    def run(config: GuaranteesConfig, setup: Setup) -> StudyResult:
        seeds, conditions = range(config.missions), list(CONDITIONS)[: config.conditions]
        tuning = fly_settings(config, setup)
        settings = {planner: SETTINGS[planner][best_setting(tuning[planner])] for planner in PLANNERS}
        flights = _flights(setup, seeds)
        trials = {
            (condition, planner, seed): flights(seed, condition, planner, settings[planner])
            for condition in conditions
            for planner in PLANNERS
            for seed in seeds
        }
        records = setup.fly_each(trials)
        cells = {
            (condition, planner): [records[condition, planner, seed] for seed in seeds]
            for condition in conditions
            for planner in PLANNERS
        }
        first = conditions[0]
        timed = [trials[first, planner, seed] for planner in PLANNERS for seed in seeds[: config.timed]]
        spent = setup.perform(
            [job(planning_ms, mission.document, mission.content, seed=mission.seed) for mission in timed]
        )
        cpu = dict(zip(PLANNERS, np.reshape(spent, (len(PLANNERS), -1)).mean(axis=1).tolist(), strict=True))
        rows = [_row(*cell, records, cpu[cell[1]]) for cell, records in cells.items()]
        tuning_rows = [
            _tuning_row(planner, SETTINGS[planner][k], tried) for planner in tuning
            for k, tried in enumerate(tuning[planner])
        ]  # fmt: skip
        shown = setup.flown({planner: trials[first, planner, 0] for planner in PLANNERS})
        return StudyResult(
            summary=(
                f"{config.missions} missions over {setup.ground.name}, from and to {LOW[0]:g} to {LOW[1]:g} m above "
                "h_min, each by every planner under every condition. Failures: a share of the planner's answers is "
                "lost, after the first. Gusts: 1.5 m/s² rms clipped at 4, which the tracking bound of all allows for. "
                "CPU: the whole call of a planner, with everything it checks.",
                f"Settings{_tuned_on(config)}: "
                + "; ".join(f"{planner} {_named(setting)}" for planner, setting in settings.items())
                + ".",
            ),
            rows=[*rows, *tuning_rows],
            tables=(*(_table(condition, rows) for condition in conditions), _tuning_table(tuning_rows)),
            figure=_figure(rows, shown),
            caption="One mission by all planners; missions that arrived without a violation; mean time of these.",
            claims=(peers_claim(cells, rows),),
            tracks=[track(planner, shown[planner], COLOURS[planner]) for planner in PLANNERS],
            places=ends(shown[OURS]),
        )


# ---- missions and their tuning


def _flights(setup: Setup, seeds: Sequence[int]) -> Callable[[int, str, str, Mapping[str, Any]], Trial]:
    """Return a function that makes the trial of a seed, a condition, a planner and a setting."""
    drawn = dict(
        zip(seeds, setup.compute(mission_ends, [MissionToDraw(setup.place, k, IN_GUSTS) for k in seeds]), strict=True)
    )

    def flight(seed: int, condition: str, planner: str, setting: Mapping[str, Any]) -> Trial:
        fields = {**drawn[seed], **CONDITIONS[condition], **setting}
        return setup.trial(seed, controller=planner, measure=MEASURE, fields=fields)

    return flight


def fly_settings(config: GuaranteesConfig, setup: Setup) -> dict[str, list[Sequence[Record]]]:
    """Fly the missions of the tuning; return the records of each setting by planner, none if there is one setting."""
    if config.settings == 1:
        return {planner: [()] for planner in PLANNERS}
    seeds = range(TUNING_SEED, TUNING_SEED + config.tuning)
    flights = _flights(setup, seeds)
    conditions = list(CONDITIONS)[: config.conditions]
    flown = setup.fly_groups({
        (planner, k): [flights(seed, condition, planner, setting) for condition in conditions for seed in seeds]
        for planner in PLANNERS
        for k, setting in enumerate(SETTINGS[planner][: config.settings])
    })  # fmt: skip
    return {planner: [flown[planner, k] for k in range(config.settings)] for planner in PLANNERS}


def best_setting(tried: Sequence[Sequence[Record]]) -> int:
    """Return the index of the setting with the fewest missions lost or violated, then with the least mean time."""

    def rank(k: int) -> tuple[int, float]:
        return _spoilt(tried[k]), float(figures(tried[k], "flight_time_s").mean())

    return min(range(len(tried)), key=rank) if len(tried) > 1 else 0


def _spoilt(records: Sequence[Record]) -> int:
    """Count the missions that did not arrive, or came below h_min."""
    return int(((figures(records, "arrived") == 0) | (figures(records, "violated") > 0)).sum())


# ---- jobs and measures


def violations(outcome: RunData) -> dict[str, Any]:
    """A measure: whether the vehicle came below h_min, and whether it did so unannounced."""
    mission, recording = outcome.config["mission"], outcome.recording
    terrain = load_terrain(outcome.config["terrain"]["path"])
    flown = FlightMission(terrain, mission["start"], mission["target"])
    low = flown_clearance(recording.t, recording.truths[VEHICLE], flown) < mission["clearance_min"]
    begins = float(recording.t[:-1][low][0]) if low.any() else np.inf
    announced = not guaranteed_at(begins, recording.events)
    return {"violated": bool(low.any()), "unannounced": bool(low.any() and not announced)}


class TimedPlanner:
    """Planner whose calls are timed."""

    def __init__(self, planner: Planner) -> None:
        self.period = planner.period
        self.spent_ms: list[float] = []  # thread CPU time of each call
        self._planner = planner
        monitor: Callable[[PlanRequest], Plan | None] | None = getattr(planner, "monitor", None)
        if monitor is not None:
            self.monitor = monitor

    def plan(self, request: PlanRequest) -> Plan:
        """Return the plan of the timed planner."""
        began = time.thread_time()
        plan = self._planner.plan(request)
        self.spent_ms.append(1e3 * (time.thread_time() - began))
        return plan


def planning_ms(document: Mapping[str, Any], content: str) -> MeasuredTime:
    """A job: mean CPU time [ms] of a planner's calls at the beginning of a mission; ``content`` is its hash."""
    loop = recorded_trial(document, content).build()
    agent = loop.agents[VEHICLE]
    planner = TimedPlanner(agent.planner)
    replace(loop, agents={VEHICLE: replace(agent, planner=planner)}, duration=min(_TIMED, loop.duration)).run()
    return MeasuredTime(np.mean(planner.spent_ms[1:]))  # the first call compiles


# ---- tables, claim and figure


def _row(condition: str, planner: str, records: Sequence[Record], cpu_ms: float) -> dict[str, Any]:
    violated, arrived = figures(records, "violated") > 0, figures(records, "arrived") > 0
    good = arrived & ~violated
    mean = {
        name: float(figures(records, name)[good].mean()) if good.any() else None
        for name in ("flight_time_s", "path_length_m")
    }
    return {
        "condition": condition,
        "planner": planner,
        "missions": len(records),
        "successes": int(good.sum()),
        "contacts": int((figures(records, "ground_contacts") > 0).sum()),
        "violations": int(violated.sum()),
        "unannounced": int((figures(records, "unannounced") > 0).sum()),
        "least_m": float(figures(records, "min_clearance_m").min()),
        "time_s": mean["flight_time_s"],
        "path_m": mean["path_length_m"],
        "cpu_ms": cpu_ms,
    }


def times_over(cells: Mapping[tuple[str, str], Sequence[Record]], condition: str, peer: str) -> float:
    """Return the certified planner's time over that of a peer, on missions in which both arrive; NaN without any."""
    ours, theirs = cells[condition, OURS], cells[condition, peer]
    both = (figures(ours, "arrived") > 0) & (figures(theirs, "arrived") > 0)
    sums = [float(figures(records, "flight_time_s")[both].sum()) for records in (ours, theirs)]
    return sums[0] / sums[1] if both.any() else np.nan


def peers_claim(cells: Mapping[tuple[str, str], Sequence[Record]], rows: Sequence[Mapping[str, Any]]) -> Claim:
    """Evaluate the claim: no contact, no unannounced violation, and hardly slower than the fastest peer without any."""
    ours = [row for row in rows if row["planner"] == OURS]
    contacts, unannounced = (sum(row[name] for row in ours) for name in ("contacts", "unannounced"))
    ratios: dict[str, tuple[float, str]] = {}
    for condition in CONDITIONS:
        compared = [
            (times_over(cells, condition, row["planner"]), row["planner"])
            for row in rows
            if row["condition"] == condition and row["planner"] != OURS and not row["contacts"] + row["unannounced"]
        ]
        known = [each for each in compared if np.isfinite(each[0])]
        if known:
            ratios[condition] = max(known)
    text = ", ".join(f"{condition} {ratio:.3f} ({peer})" for condition, (ratio, peer) in ratios.items())
    return Claim(
        "guarantee.peers", "target",
        "Beside peers on the same missions there is no contact and no unannounced violation, at no more than 5 % more "
        "time than the fastest of those that have none either.",
        "Propositions A.2 and A.3", f"0 and 0, time over the fastest at most {SLOWER:g}",
        f"contacts {contacts}, unannounced {unannounced} of {sum(row['missions'] for row in ours)}; time over the "
        f"fastest: {text or 'nobody else has none'}",
        contacts == unannounced == 0 and all(ratio <= SLOWER for ratio, _ in ratios.values()),
    )  # fmt: skip


def _table(condition: str, rows: Sequence[Row]) -> Table:
    def mean(row: Row, name: str, scale: float, unit: str) -> str:
        return "-" if row[name] is None else f"{scale * row[name]:.1f} {unit}"

    return Table.of(condition.capitalize(), chosen(rows, condition=condition), (
        ("planner", "planner"), ("arrived without a violation", lambda r: rate(r["successes"], r["missions"]).text()),
        ("contacts", "contacts"), ("violations", "violations"), ("unannounced", "unannounced"),
        ("least clearance", "{least_m:.1f} m"), ("mean time", lambda r: mean(r, "time_s", 1.0, "s")),
        ("mean path", lambda r: mean(r, "path_m", 1e-3, "km")), ("CPU of a plan", "{cpu_ms:.2f} ms"),
    ))  # fmt: skip


def _tuned_on(config: GuaranteesConfig) -> str:
    return "" if config.settings == 1 else f", tuned for time on {config.tuning} other missions under every condition"


def _named(setting: Mapping[str, Any]) -> str:
    return ", ".join(f"{name.removeprefix('planner.')} {value:g}" for name, value in setting.items()) or "defaults"


def _tuning_row(planner: str, setting: Mapping[str, Any], records: Sequence[Record]) -> dict[str, Any]:
    row: dict[str, Any] = {"planner": planner, "setting": _named(setting), "missions": len(records)}
    if records:
        row |= {"spoilt": _spoilt(records), "time_s": float(figures(records, "flight_time_s").mean())}
    return row


def _tuning_table(rows: Sequence[Mapping[str, Any]]) -> Table:
    cells = [
        (r["planner"], r["setting"], *((r["missions"], r["spoilt"], f"{r['time_s']:.1f} s") if r["missions"]
                                       else ("-", "-", "-")))
        for r in rows
    ]  # fmt: skip
    columns = ("planner", "setting", "missions", "not arrived, or below h_min", "mean time")
    return Table("Settings that were tried, on other missions", columns, cells)


def _figure(rows: Sequence[Mapping[str, Any]], shown: Mapping[str, RunData]) -> Figure:
    ground = load_terrain(shown[OURS].config["terrain"]["path"])
    with styled_figure((11.0, 4.4)) as figure:
        paths, successes, times = figure.subplots(1, 3, width_ratios=(1.3, 1, 1))
        paths_on_map(paths, ground, {name: (run, COLOURS[name]) for name, run in shown.items()}, "One mission by all")
        _bars(successes, {(r["condition"], r["planner"]): 100.0 * r["successes"] / r["missions"] for r in rows})
        successes.set(title="Arrived without a violation", ylabel="share of the missions [%]", ylim=(0.0, 100.0))
        _bars(times, {(r["condition"], r["planner"]): r["time_s"] or 0.0 for r in rows})
        times.set(title="Mean time of these", ylabel="time [s]")
    return figure


def _bars(axes: Axes, values: Mapping[tuple[str, str], float]) -> None:
    width = 0.8 / len(PLANNERS)
    conditions = list(dict.fromkeys(condition for condition, _ in values))
    places = np.arange(len(conditions))
    for k, planner in enumerate(PLANNERS):
        heights = [values[condition, planner] for condition in conditions]
        axes.bar(places + (k + 0.5) * width - 0.4, heights, width, color=COLOURS[planner], label=planner)
    axes.set_xticks(places, [name.replace(" % ", " %\n").replace("no ", "no\n") for name in conditions], fontsize=8)
