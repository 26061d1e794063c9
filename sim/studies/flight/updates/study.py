"""Changes on the way: is the guarantee kept, and where it cannot be, is its loss announced?

The thesis allows for information updates by a new terminal cost (A.1, A.5). Here radars appear in the way, drive into
it, and vanish; the target moves; and the ground turns out to be higher than the map, so that the path of the same
mission would lead through a hill, which becomes known to the planner some seconds before it would hit.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from mathnavi.controllers.flight.cost_to_go import factored_cost
from mathnavi.controllers.flight.plugin import FlightConfig
from mathnavi.models.terrain.visibility import Radar
from mathnavi.renders.figures import STYLE
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.encoding import MeasuredTime
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunResult
from mathnavi.sim.studies.flight.updates.runs import RADIUS, WEIGHT, MissionToVary, hill_name, side_of, varied_mission
from mathnavi.sim.studies.framework.drawing import RADAR, paths_on_map
from mathnavi.sim.studies.framework.study import Setup, StudyResult, TerrainReference, ends, median, track

Booleans = NDArray[np.bool_]

NOTICES = (20.0, 10.0, 5.0, 3.0, 2.0, 1.0)  # [s] between when a hill is known and when it would be hit
ENOUGH = 5.0  # [s] that is to be enough
PERIOD = 5.0 / 3.0  # [s] between two plans
_REPETITIONS = 5
COLOURS = {"as it was": "#101824", "radar appears": "#c2183b", "target moves": "#0d5fa8"}


@configuration
class UpdatesConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 20
    """missions, each with every change"""
    notices: Count = len(NOTICES)
    """times of notice of a hill, at most"""


class Updates:
    """Radars, targets and maps that change on the way: is the guarantee kept, or its loss announced?"""

    Config = UpdatesConfig
    quick = UpdatesConfig(seeds=2, notices=3)
    title = "Information updates"

    @staticmethod
    def run(config: UpdatesConfig, setup: Setup) -> StudyResult:
        notices = NOTICES[: config.notices]
        seeds = range(config.seeds)
        varied = setup.compute(varied_mission, [MissionToVary(setup.place, seed, notices) for seed in seeds])
        trials = {(name, seed): mission for seed in seeds for name, mission in varied[seed].items()}
        records = setup.fly_each(trials)
        by_condition = {name: [records[name, seed] for seed in seeds] for name in varied[0]}
        rows = [_row(name, group) for name, group in by_condition.items()]
        (build,) = setup.compute(build_ms, [setup.place])
        shown = setup.flown({name: trials[name, 0] for name in COLOURS})
        (radar,) = trials["radar appears", 0].config.radar
        return StudyResult(
            summary=(
                f"{config.seeds} missions over {setup.ground.name}; the ends of each are those drawn without a change. "
                f"A new terminal cost takes {build:.0f} ms, {build / PERIOD / 10.0:.1f} % of a planning period: the "
                "thesis' took 15.8 s, and 1.5 s for a changed threat (A.5).",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(by_condition, shown, setup, notices),
            caption="(a) One mission, with a radar that appears on the way, and with a target that moves. (b) Time in "
            "sight of a radar, known or not. (c) Flights that stay at h_min or above, of those over a hill that is "
            "not on the map, with 95 % limits, over the time between when it is communicated and when it would be hit.",
            claims=_claims(by_condition, notices),
            tracks=[track(name, shown[name], colour) for name, colour in COLOURS.items()],
            places=ends(shown["as it was"]),
            radars=[(radar[0], radar[1], float(setup.ground.height(radar[0], radar[1])), radar[2])],
        )  # fmt: skip


def announced(outcome: RunResult) -> dict[str, Any]:
    """Count the events that announce a loss of the guarantee (a measure)."""
    kinds = [event.kind for event in outcome.recording.events]
    return {
        name.replace("-", "_"): kinds.count(name)
        for name in ("plan-endangered", "arrival-lost", "arrival-regained", "deadline-moved")
    }


def build_ms(place: TerrainReference) -> MeasuredTime:
    """CPU time [ms] of a new terminal cost, with a threat, of the planner's default grid: the least of some."""
    ground = place.ground
    middle = 0.5 * np.array([ground.width, ground.depth])
    flight = FlightConfig()
    spent = []
    for k in range(_REPETITIONS):
        target = np.array([*(middle + 10.0 * k), float(ground.height(*(middle + 10.0 * k))) + 300.0])
        radar = Radar(float(0.5 * middle[0]), float(0.5 * middle[1]), RADIUS * side_of(ground), WEIGHT)
        began = time.thread_time()
        factored_cost(ground, target, (radar,), flight.grid_nodes, flight.grid_layers)
        spent.append(time.thread_time() - began)
    return MeasuredTime(1e3 * min(spent))


# ---- results


def _row(name: str, records: Sequence[Record]) -> dict[str, Any]:
    return {
        "change": name,
        "missions": len(records),
        "safe": int(_safe(records).sum()),
        "contacts": int(figures(records, "ground_contacts").sum()),
        "unannounced": int(_unannounced(records).sum()),
        "arrived": int(figures(records, "arrived").sum()),
        "late": int((figures(records, "flight_time_s") > figures(records, "deadline_s")).sum()),
        "endangered": int(figures(records, "plan_endangered").sum()),
        "guarantee_lost": int((figures(records, "guarantee_lost") > 0).sum()),
        "arrival_lost": int(figures(records, "arrival_lost").sum()),
        "deadline_moved": int(figures(records, "deadline_moved").sum()),
        "exposure_s": float(figures(records, "radar_exposure_s").mean()),
        "path_m": float(figures(records, "path_length_m").mean()),
    }


def _safe(records: Sequence[Record]) -> Booleans:
    """(n,) whether each stayed at h_min or above."""
    least = np.array([record.parameters["config"]["clearance_min"] for record in records])
    safe: Booleans = (figures(records, "min_clearance_m") >= least) & (figures(records, "ground_contacts") == 0)
    return safe


def _unannounced(records: Sequence[Record]) -> Booleans:
    """(n,) True where a mission came below h_min, or did not arrive, without an announcement."""
    failed = ~_safe(records) | (figures(records, "arrived") == 0)
    announced = sum(figures(records, name) for name in ("guarantee_lost", "deadlines_lost", "arrival_lost"))
    silent: Booleans = failed & (announced == 0)
    return silent


def _table(rows: Sequence[Mapping[str, Any]]) -> Table:
    head = ("change", "at h_min or above", "on the ground", "not announced", "arrived", "late", "endangered plans",
            "guarantee lost", "deadline moved", "in sight", "path")  # fmt: skip
    body = [
        (
            r["change"], f"{r['safe']} of {r['missions']}", r["contacts"], r["unannounced"],
            f"{r['arrived']} of {r['missions']}", r["late"], r["endangered"], r["guarantee_lost"], r["deadline_moved"],
            f"{r['exposure_s']:.1f} s", f"{r['path_m']:,.0f} m",
        )
        for r in rows
    ]  # fmt: skip
    return Table("Missions with a change on the way", head, body)


def _claims(by_condition: Mapping[str, Sequence[Record]], notices: Sequence[float]) -> list[Claim]:
    hills = {notice: by_condition[hill_name(notice)] for notice in notices}
    others = [record for name, group in by_condition.items() if not name.startswith("hill") for record in group]
    over_hills = [record for group in hills.values() for record in group]
    early = [record for notice, group in hills.items() if notice >= ENOUGH for record in group]
    late = figures(others, "flight_time_s") > figures(others, "deadline_s")
    kept = int((_safe(others) & (figures(others, "arrived") > 0) & ~late).sum())
    silent = int(_unannounced([*others, *over_hills]).sum())
    saved = int(_safe(early).sum())
    by_notice = "; ".join(
        f"{notice:g} s {rate(int(_safe(group).sum()), len(group)).text()}" for notice, group in hills.items()
    )
    return [
        Claim(
            "flight.updates", "target", "What is learnt on the way keeps the guarantee, or its loss is announced.",
            "A.1, A.5",
            f"radars and targets that change: all safe, and arrive by the deadline in force; a hill known {ENOUGH:g} s "
            "ahead is cleared; no failure that was not announced",
            f"radars and targets: {kept} of {len(others)}; hill known {ENOUGH:g} s ahead or more: {saved} of "
            f"{len(early)} at h_min or above ({by_notice}); not announced: {silent} of {len(others) + len(over_hills)}",
            kept == len(others) and saved == len(early) and silent == 0,
        ),
    ]  # fmt: skip


# ---- what is drawn


def _figure(
    by_condition: Mapping[str, Sequence[Record]], shown: Mapping[str, RunResult], setup: Setup, notices: Sequence[float]
) -> Figure:
    with matplotlib.rc_context(STYLE):
        page = Figure(figsize=(12.4, 4.2), layout="constrained")
        left, middle, right = page.subplots(1, 3, width_ratios=(1.2, 1.0, 1.0))
        flights = {name: (shown[name], colour) for name, colour in COLOURS.items()}
        paths_on_map(left, setup.ground, flights, "(a) one mission, changed on the way")
        radar = shown["radar appears"].config["mission"]["radars"][0]
        centre = (radar["x"] / 1e3, radar["y"] / 1e3)
        left.add_patch(Circle(centre, radar["radius"] / 1e3, facecolor=RADAR, alpha=0.2, edgecolor=RADAR))
        moved = shown["target moves"].config["mission"]["target_path"][-1]
        left.plot(moved[1] / 1e3, moved[2] / 1e3, "s", ms=6, mfc="#ffd90d", mec="#101824", zorder=4)
        _draw_exposure(middle, by_condition)
        rates = [
            rate(int(_safe(by_condition[hill_name(notice)]).sum()), len(by_condition[hill_name(notice)]))
            for notice in notices
        ]
        for notice, found in zip(notices, rates, strict=True):
            right.plot([notice, notice], [found.low, found.high], color="#0d5fa8", lw=1.6, alpha=0.6)
            right.plot(notice, found.value, "o", ms=6, color="#0d5fa8")
        right.set_xscale("log")
        right.set_xticks(list(notices), [f"{notice:g}" for notice in notices])
        right.minorticks_off()
        right.set(xlabel="known before it would be hit [s]", ylabel="share at h_min or above", ylim=(-0.03, 1.03))
        right.set_title("(c) a hill that is not on the map")
    return page


def _draw_exposure(axes: Axes, by_condition: Mapping[str, Sequence[Record]]) -> None:
    names = [name for name in by_condition if name.startswith("radar ")]
    for k, name in enumerate(names):
        sample = np.sort(figures(by_condition[name], "radar_exposure_s"))
        colour = "#5a6876" if name.endswith("not announced") else "#c2183b"
        axes.plot(np.full(len(sample), k) + np.linspace(-0.2, 0.2, len(sample)), sample, "o", ms=3.5, color=colour)
        axes.hlines(median(sample).median, k - 0.3, k + 0.3, color=colour)
    labels = [name.removeprefix("radar ").replace(", ", ",\n") for name in names]
    axes.set_xticks(range(len(names)), labels, fontsize=8)
    axes.set(ylabel="time in sight [s]")
    axes.set_title("(b) radars")
