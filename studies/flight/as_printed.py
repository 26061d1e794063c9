"""The planner as printed, low over the ground: safety when clearance is required at the nodes only.

The thesis imposes the clearance at N sampling instants of a plan, and proves that a feasible sequence of plans never
collides (Propositions A.1 to A.3). For every arc between two instants, in every plan that was flown, this study
computes the exact least clearance, and counts the arcs that come below h_min although both ends are above it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.models.aerial.plan_status import FlightPhase
from mathnavi.models.terrain.library import load_terrain
from mathnavi.renders.statistics_figures import rates_figure_on
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import VEHICLE, Setup, StudyResult, ends, heights, track

LOW = (0.5, 30.0)  # [m] above h_min at both ends of a mission
PLANNERS = ("as_printed", "flight")
COLOURS = {"as_printed": "#c2183b", "flight": "#1a9850"}


@configuration
class AsPrintedStudyConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 60
    """number of low-flying missions for each of the two planners"""


class AsPrintedStudy:
    """The guarantee of the thesis as printed, tested in continuous time (Propositions A.1 to A.3)."""

    Config = AsPrintedStudyConfig
    quick = AsPrintedStudyConfig(seeds=3)
    title = "Safety as printed: clearance at the nodes only"

    @staticmethod
    def run(config: AsPrintedStudyConfig, setup: Setup) -> StudyResult:
        named: dict[str, Any] = {"measure": "mathnavi.studies.flight.as_printed:arcs", "fields": {"drawn_heights": LOW}}
        trials = {
            planner: [setup.trial(seed, controller=planner, **named) for seed in range(config.seeds)]
            for planner in PLANNERS
        }
        by_condition = setup.fly_groups(trials)
        rows = [_row(planner, records) for planner, records in by_condition.items()]
        literal = rows[0]
        crashed = [k for k, record in enumerate(by_condition["as_printed"]) if record.summary["ground_contacts"]]
        shown = setup.flown({planner: trials[planner][crashed[0] if crashed else 0] for planner in PLANNERS})
        collisions = rate(literal["on_ground"], literal["missions"])
        return StudyResult(
            summary=(
                f"{config.seeds} missions over {setup.ground.name} that begin and end {LOW[0]:g} to {LOW[1]:g} m "
                "above h_min, no noise, no failures. The certified planner of this project flies the same missions.",
            ),
            rows=rows,
            tables=(_missions(rows), _arcs(rows)),
            figure=_figure(rows, shown),
            caption="Height above ground on one mission; missions that came below h_min, hit the ground, or were late.",
            claims=(
                Claim(
                    "A.safety-as-printed", "printed", "Feasible plans never lead to a collision.",
                    "Propositions A.1 to A.3", "no collision, no arc below h_min",
                    f"collisions {collisions.text()}; {literal['arcs_dipping']} of {literal['arcs']} arcs below "
                    f"h_min with both ends above, by up to {literal['deepest_m']:.0f} m",
                    literal["on_ground"] == literal["below"] == literal["arcs_dipping"] == 0,
                ),
            ),
            tracks=[track(planner, shown[planner], COLOURS[planner]) for planner in PLANNERS],
            places=ends(shown["as_printed"]),
        )  # fmt: skip


def arcs(outcome: RunData) -> dict[str, Any]:
    """A measure: number of optimised arcs in flown plans, and of those below h_min between two ends above it."""
    mission = outcome.config["mission"]
    terrain, least = load_terrain(outcome.config["terrain"]["path"]), mission["clearance_min"]
    found = {"arcs": 0, "arcs_dipping": 0, "arcs_under_ground": 0, "deepest_m": 0.0}
    for _, plan in outcome.recording.agents[VEHICLE].plans:
        optimised = np.flatnonzero(plan.phase == FlightPhase.OPTIMISED)
        if not len(optimised):
            continue
        x = plan.x[: optimised[-1] + 2]
        ends_clear = x[:, 2] - terrain.height(x[:, 0], x[:, 1]) >= least - 1e-6
        for k in optimised:
            duration = float(plan.t[k + 1] - plan.t[k])
            clearance = terrain.arc_clearance(x[k, :3], x[k, 3:], plan.u[k], duration)
            found["arcs"] += 1
            if ends_clear[k] and ends_clear[k + 1] and clearance < least - 1e-6:
                found["arcs_dipping"] += 1
                found["arcs_under_ground"] += clearance < 0.0
                found["deepest_m"] = max(found["deepest_m"], least - clearance)
    return found


def _row(planner: str, records: Sequence[Record]) -> dict[str, Any]:
    least = np.array([record.parameters["config"]["clearance_min"] for record in records])
    late = figures(records, "flight_time_s") > figures(records, "deadline_s")
    arrived = figures(records, "arrived") > 0
    return {
        "planner": planner,
        "missions": len(records),
        "below": int((figures(records, "min_clearance_m") < least).sum()),
        "on_ground": int((figures(records, "ground_contacts") > 0).sum()),
        "late": int((late | ~arrived).sum()),
        "least_m": figures(records, "min_clearance_m").min(),
        "arcs": int(figures(records, "arcs").sum()),
        "arcs_dipping": int(figures(records, "arcs_dipping").sum()),
        "arcs_under_ground": int(figures(records, "arcs_under_ground").sum()),
        "deepest_m": figures(records, "deepest_m").max(),
    }


def _missions(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Missions", rows, (
        ("planner", "planner"), ("below h_min", lambda r: rate(r["below"], r["missions"]).text()),
        ("hit the ground", lambda r: rate(r["on_ground"], r["missions"]).text()),
        ("late or not arrived", lambda r: rate(r["late"], r["missions"]).text()),
        ("least clearance", "{least_m:.1f} m"),
    ))  # fmt: skip


def _arcs(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Optimised arcs of the plans that were flown", rows, (
        ("planner", "planner"), ("arcs planned", "{arcs}"),
        ("below h_min between two nodes above it", "{arcs_dipping}"), ("under ground", "{arcs_under_ground}"),
        ("deepest below h_min", "{deepest_m:.1f} m"),
    ))  # fmt: skip


def _figure(rows: Sequence[dict[str, Any]], shown: dict[str, RunData]) -> Figure:
    with styled_figure((9.4, 3.2)) as figure:
        height, missions = figure.subplots(1, 2, width_ratios=(1.3, 1))
        for planner in PLANNERS:
            recording = shown[planner].recording
            height.plot(
                recording.t, np.maximum(heights(shown[planner]), 1.0), color=COLOURS[planner], label=planner, lw=1.0
            )
        height.axhline(50.0, ls=":", color="#5a6876", label="h_min")
        height.set(yscale="log", xlabel="time [s]", ylabel="height above ground [m]", title="One mission")
        height.legend()
        names = [f"{row['planner']}: {word}" for word in ("below h_min", "on the ground", "late") for row in rows]
        rates = [rate(row[key], row["missions"]) for key in ("below", "on_ground", "late") for row in rows]
        rates_figure_on(missions, names, rates)
        missions.set_title("Missions")
    return figure
