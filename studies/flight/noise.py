"""Table A.3, Figure A.7: position jumps once a period, p := p + w, w uniform in a cube of half-width w_bar.

T_p = 10 s and N = 6 as in the thesis, whose w_bar of 1 is 3670 m. Nothing prevents a jump into a mountain, so the
missions begin and end 2 to 3 km above ground, and the planner flies them with its usual margin and with one that grows
with the jumps, 25 m + 2.5 w_bar; the planner as printed flies them too. No planner can reach a target more closely than
by a jump, so arrival means within 2 km of the target.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, Within, configuration
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.sweep.trial import Trial
from mathnavi.studies.framework.drawing import paths_on_map, styled_figure
from mathnavi.studies.framework.study import (
    SPACING,
    Setup,
    StudyResult,
    effort_norm,
    ends,
    falls,
    track,
)

H = 2.0  # [s] = 10 s / (6 - 1)
# Table A.3 by the largest offset [m]: w_bar, relative disturbance [%], ||a||_2 (its own unit)
PRINTED = {0: (0.0, None, 4.88), 37: (0.01, 2.5, 4.98), 184: (0.05, 10.8, 7.94), 367: (0.1, 20.3, 15.12),
           734: (0.2, 29.6, 17.32), 1101: (0.3, 36.0, 30.48), 1835: (0.5, 42.4, 48.73)}  # fmt: skip
MARGIN, MARGIN_GROWTH = 25.0, 2.5
PLANNERS = {
    "flight, wide margin": ("flight", MARGIN_GROWTH),
    "flight": ("flight", 0.0),
    "as_printed": ("as_printed", None),
}
MAIN = "flight, wide margin"
HEIGHTS, ARRIVAL = (2000.0, 3000.0), 2000.0  # [m]
COLOURS = {0: "#2f3b46", 184: "#1a9850", 734: "#e08214", 1835: "#c2183b"}


@configuration
class NoiseConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 12
    """number of missions for each half-width and planner, the same for all"""
    offsets: Annotated[Count, Within(Interval(ge=1, le=len(PRINTED)))] = len(PRINTED)
    """number of half-widths, the smallest first"""


class Noise:
    """Control effort against position jumps (Table A.3, Figure A.7)."""

    Config = NoiseConfig
    quick = NoiseConfig(seeds=1)
    title = "Robustness: position jumps once a period"

    @staticmethod
    def run(config: NoiseConfig, setup: Setup) -> StudyResult:
        offsets = tuple(PRINTED)[: config.offsets]
        trials = {
            (planner, offset): [_mission(setup, planner, offset, seed) for seed in range(config.seeds)]
            for planner in PLANNERS
            for offset in offsets
        }
        by_condition = setup.fly_groups(trials)
        rows = [_row(*condition, records) for condition, records in by_condition.items()]
        arrived = np.array([figures(by_condition[MAIN, w], "arrived") > 0 for w in offsets])  # (offsets, seeds)
        paired = arrived.all(axis=0)
        ours = [float(effort_norm(by_condition[MAIN, w], H)[paired].mean()) for w in offsets] if paired.any() else []
        shown = setup.flown({offset: trials[MAIN, offset][0] for offset in COLOURS if offset in offsets})
        return StudyResult(
            summary=(
                f"{config.seeds} missions over {setup.ground.name} for each of {len(offsets)} half-widths, N = 6, "
                "T_p = 10 s. In the tables ‖a‖₂ is the mean of those that arrived. The relative disturbance is the "
                "largest offset over the largest distance between two planning instants (A.8), jump included. The wide "
                "margin is 25 m + 2.5 w̄.",
            ),
            rows=rows,
            tables=[_table(planner, [row for row in rows if row["planner"] == planner]) for planner in PLANNERS],
            figure=_figure(rows, shown, setup.ground),
            caption=f"The first mission under {len(shown)} sizes of jumps, effort and collisions against the size.",
            claims=(
                Claim(
                    "A.effort-grows-with-noise", "printed", "The control effort increases with the disturbance.",
                    "Table A.3, A.7", "mean ||a||_2 grows from each w_bar to the next",
                    ", ".join(f"{effort:.0f}" for effort in ours) + f" m/s² ({MAIN}, the {paired.sum()} missions that "
                    "arrived under every one)", falls(ours[::-1]) if ours else None,
                ),
            ),
            tracks=[track(f"± {offset} m", shown[offset], COLOURS[offset]) for offset in shown],
            places=ends(shown[0]),
        )  # fmt: skip


def _mission(setup: Setup, planner: str, offset: int, seed: int) -> Trial:
    controller, growth = PLANNERS[planner]
    fields: dict[str, Any] = {
        "drawn_heights": HEIGHTS,
        "arrival_radius": ARRIVAL,
        "planner.nodes": 6,
        "planner.horizon": 10.0,
        "faults.position_jump": float(offset),
    }
    if growth is not None:
        fields["planner.margin"] = MARGIN + growth * offset
    return setup.trial(seed, controller=controller, measure=SPACING, fields=fields)


def _row(planner: str, offset: int, records: Sequence[Record]) -> dict[str, Any]:
    distance, arrived = figures(records, "node_spacing_m").max(), figures(records, "arrived") > 0
    return {
        "planner": planner,
        "w_bar": PRINTED[offset][0],
        "offset_m": offset,
        "relative_percent": 100.0 * offset / distance,
        "effort": float(effort_norm(records, H)[arrived].mean()) if arrived.any() else math.nan,
        "path_m": figures(records, "path_length_m").mean(),
        "on_ground": int((figures(records, "ground_contacts") > 0).sum()),
        "arrived": int(arrived.sum()),
        "missions": len(records),
        "printed_relative_percent": PRINTED[offset][1],
        "printed_effort": PRINTED[offset][2],
    }


def _table(planner: str, rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of(f"Table A.3, planner {planner}", rows, (
        ("w̄", "{w_bar:g}"), ("largest offset", "± {offset_m} m"),
        ("relative disturbance", "{relative_percent:.1f} %"),
        ("printed", lambda r: f"{r['printed_relative_percent']} %" if r["offset_m"] else "–"),
        ("‖a‖₂ [m/s²]", lambda r: f"{r['effort']:.1f}" if r["arrived"] else "–"), ("printed", "{printed_effort}"),
        ("hit the ground", lambda r: rate(r["on_ground"], r["missions"]).text()),
        ("arrived", "{arrived} of {missions}"),
    ))  # fmt: skip


def _figure(rows: Sequence[dict[str, Any]], shown: dict[int, RunData], terrain: HeightField) -> Figure:
    with styled_figure((9.4, 3.9)) as figure:
        path, effort, ground = figure.subplots(1, 3, width_ratios=(1.3, 1, 1))
        flights = {f"± {offset} m": (outcome, COLOURS[offset]) for offset, outcome in shown.items()}
        paths_on_map(path, terrain, flights, "Figure A.7: paths")
        for planner, style in zip(PLANNERS, ("o-", "^--", "s:"), strict=True):
            mine = [row for row in rows if row["planner"] == planner]
            offsets = [row["offset_m"] for row in mine]
            effort.plot(offsets, [row["effort"] for row in mine], style, label=planner)
            ground.plot(offsets, [100.0 * row["on_ground"] / row["missions"] for row in mine], style, label=planner)
        effort.set(xlabel="largest offset [m]", ylabel="‖a‖₂ [m/s²]", title="Effort", ylim=(0.0, None))
        ground.set(
            xlabel="largest offset [m]", ylabel="missions on the ground [%]", title="Collisions", ylim=(-3.0, 103.0)
        )
        ground.legend()
    return figure
