"""Hundreds of missions with failing solvers, and with noise and gusts: is the guarantee kept?

The guarantee: the clearance over the triangles never falls below h_min, and the vehicle arrives by gamma V_0, for any
answers of the planner. With noise and gusts the guarantee holds as long as the tracker keeps its stated bound; breaches
are counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.renders.statistics_figures import rates_figure_on
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult, track

GROUPS: dict[str, dict[str, Any]] = {
    "no failures": {},
    "30 % failures": {"fields": {"faults.solver_failure_rate": 0.3}},
    "90 % failures": {"fields": {"faults.solver_failure_rate": 0.9}},
    "kalman, gusts": {
        "estimator": "kalman",
        "fields": {"noise.position": 5.0, "noise.position_rate": 10.0, "faults.gust_rms": 1.5},
    },
}
COLOURS = ("#2166ac", "#1a9850", "#e08214", "#c2183b")


@configuration
class SafetyConfig:
    """Sample sizes: missions that are flown."""

    missions: Count = 200
    """number of missions of each group"""


class Safety:
    """Hundreds of missions: clearance and arrival with failing solvers, noise and gusts (A.4, A.7)."""

    Config = SafetyConfig
    quick = SafetyConfig(missions=5)
    title = "Safety and arrival under failures"

    @staticmethod
    def run(config: SafetyConfig, setup: Setup) -> StudyResult:
        trials = {
            name: [setup.trial(k * config.missions + seed, **named) for seed in range(config.missions)]
            for k, (name, named) in enumerate(GROUPS.items())  # each group has missions of its own
        }
        by_condition = setup.fly_groups(trials)
        rows = [_row(name, records) for name, records in by_condition.items()]
        total = sum(row["missions"] for row in rows)
        below, on_ground, late = (sum(row[key] for row in rows) for key in ("below", "on_ground", "late"))
        closest = {
            name: min(by_condition[name], key=lambda record: record.summary["min_clearance_m"]).seed for name in GROUPS
        }
        shown = setup.flown({name: trials[name][seed % config.missions] for name, seed in closest.items()})
        return StudyResult(
            summary=(
                f"{config.missions} missions over {setup.ground.name} in each of {len(GROUPS)} groups. Failures: a "
                "share of the solver's answers is lost. kalman, gusts: position fixes of 5 m at 10 Hz through a "
                "Kalman filter, gusts of 1.5 m/s² rms clipped at 4. Tracking bounds were breached "
                f"{sum(row['breaches'] for row in rows)} times.",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(rows, by_condition),
            caption="Violations with their 95 % intervals; least clearance and time of arrival of every mission.",
            claims=(
                Claim(
                    "flight.safe", "target", "No mission comes below h_min or touches the ground.",
                    "Proposition A.2, in continuous time", f"none of {total}",
                    f"below h_min {rate(below, total).text()}; ground {rate(on_ground, total).text()}; least "
                    f"clearance {min(row['least_m'] for row in rows):.1f} m",
                    below == 0 and on_ground == 0,
                ),
                Claim(
                    "flight.arrives", "target", "Every mission arrives by its deadline.", "Proposition A.3",
                    f"all of {total} by gamma V_0",
                    f"late {rate(late, total).text()}; latest at {max(row['latest'] for row in rows):.3f} of the "
                    "deadline",
                    late == 0,
                ),
            ),
            tracks=[
                track(f"{name}: least clearance, seed {closest[name]}", shown[name], colour)
                for name, colour in zip(GROUPS, COLOURS, strict=True)
            ],
        )  # fmt: skip


def _row(name: str, records: Sequence[Record]) -> dict[str, Any]:
    least = np.array([record.parameters["config"]["clearance_min"] for record in records])
    share = figures(records, "flight_time_s") / figures(records, "deadline_s")
    late = (figures(records, "arrived") == 0) | (share > 1.0)
    below = figures(records, "min_clearance_m") < least
    on_ground = figures(records, "ground_contacts") > 0
    return {
        "group": name,
        "missions": len(records),
        "violations": int((late | below | on_ground).sum()),
        "below": int(below.sum()),
        "on_ground": int(on_ground.sum()),
        "late": int(late.sum()),
        "least_m": figures(records, "min_clearance_m").min(),
        "latest": share.max(),
        "breaches": int(figures(records, "tracking_breaches").sum()),
        "solver_failures": int(figures(records, "solver_failures").sum()),
        "plans_rejected": int(figures(records, "plans_rejected").sum()),
        "replans": int(figures(records, "replans").sum()),
    }


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Missions", rows, (
        ("group", "group"), ("violations", lambda r: rate(r["violations"], r["missions"]).text()),
        ("below h_min", "below"), ("on the ground", "on_ground"), ("late", "late"),
        ("least clearance", "{least_m:.1f} m"), ("latest / deadline", "{latest:.3f}"), ("breaches", "breaches"),
        ("answers lost", lambda r: f"{r['solver_failures'] / r['replans']:.1%}"),
        ("plans refused", lambda r: f"{r['plans_rejected'] / r['replans']:.2%}"),
    ))  # fmt: skip


def _figure(rows: Sequence[dict[str, Any]], by_condition: dict[str, list[Record]]) -> Figure:
    with styled_figure((9.4, 3.4)) as figure:
        violations, clearance, arrival = figure.subplots(1, 3, width_ratios=(1.2, 1, 1))
        rates_figure_on(violations, [r["group"] for r in rows], [rate(r["violations"], r["missions"]) for r in rows])
        violations.set_title("Below h_min, on the ground or late")
        for (name, records), colour in zip(by_condition.items(), COLOURS, strict=True):
            for axes, sample in (
                (clearance, figures(records, "min_clearance_m")),
                (arrival, figures(records, "flight_time_s") / figures(records, "deadline_s")),
            ):
                axes.plot(np.sort(sample), (np.arange(len(sample)) + 1.0) / len(sample), color=colour, label=name)
        clearance.axvline(50.0, ls=":", color="#5a6876")
        clearance.set(xlabel="least clearance [m]", ylabel="share of the missions", title="Clearance", xlim=(0.0, None))
        arrival.axvline(1.0, ls=":", color="#5a6876")
        arrival.set(xlabel="time of arrival over deadline", title="Arrival", xlim=(0.0, 1.08))
        clearance.legend(fontsize=8)
    return figure
