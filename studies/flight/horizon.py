"""Tables A.1 and A.2, Figure A.5: benefit and cost of a longer prediction horizon.

The same missions are flown with T_p = 5, 10, 15 and 20 s, N = T_p / h + 1 nodes at h = 5/3 s. The thesis' column
||a||_2 is interpreted as sqrt(sum_k |a_k|^2) over the flown accelerations of the nodes; its unit is unknown, here it is
m/s^2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.models.terrain.height_field import HeightField
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.store import Record
from mathnavi.sim.records.sweep_data import figures
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.studies.framework.drawing import paths_on_map, styled_figure
from mathnavi.studies.framework.study import (
    Row,
    Setup,
    StudyResult,
    effort_norm,
    ends,
    falls,
    median,
    track,
)

H = 5.0 / 3.0  # [s]
NODES = (4, 7, 10, 13)
# Table A.1: path length [m], ||a||_2 (its own unit), mean and largest CPU time [s]
PRINTED = {4: (71_080, 6.07, 0.17, 0.37), 7: (70_382, 4.37, 0.35, 0.74), 10: (69_919, 3.72, 0.62, 1.07),
           13: (69_551, 3.62, 1.01, 1.51)}  # fmt: skip
# Table A.2: relative change of ||a||_2 and of the mean and largest CPU time [%] when T_p is shortened
PRINTED_CHANGES = {(7, 4): (38.9, -52.3, -50.0), (10, 7): (17.4, -43.2, -30.84), (13, 10): (2.9, -38.6, -29.14)}
COLOURS = {4: "#c2183b", 7: "#e08214", 10: "#1a9850", 13: "#2166ac"}


@configuration
class HorizonConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 20
    """number of missions for each horizon, the same for all"""


class Horizon:
    """Benefit and cost of a longer prediction horizon (Tables A.1 and A.2, Figure A.5)."""

    Config = HorizonConfig
    quick = HorizonConfig(seeds=2)
    title = "Prediction horizon: optimality against computational load"

    @staticmethod
    def run(config: HorizonConfig, setup: Setup) -> StudyResult:
        trials = {
            (n, seed): setup.trial(seed, fields={"planner.nodes": n}) for seed in range(config.seeds) for n in NODES
        }
        records = setup.fly_each(trials)
        by_condition = {n: [records[n, seed] for seed in range(config.seeds)] for n in NODES}
        rows = [_row(n, by_condition[n]) for n in NODES]
        mean = {row["N"]: row for row in rows}
        changes = [_change(mean[long], mean[short]) for short, long in pairwise(NODES)]
        last = changes[-1]
        straight = figures(by_condition[NODES[0]], "straight_line_m").mean()
        shown = setup.flown({n: trials[n, 0] for n in NODES})
        claims = (
            Claim(
                "A.path-falls", "printed", "A longer prediction horizon gives shorter trajectories.", "Table A.1",
                "mean path falls from T_p = 5 to 20 s", ", ".join(f"{row['path_m']:,.0f}" for row in rows) + " m",
                falls([row["path_m"] for row in rows]),
            ),
            Claim(
                "A.effort-falls", "printed", "A longer prediction horizon takes less control effort.", "Table A.1",
                "mean ||a||_2 falls from T_p = 5 to 20 s", ", ".join(f"{row['effort']:.1f}" for row in rows) + " m/s²",
                falls([row["effort"] for row in rows]),
            ),
            Claim(
                "A.20-to-15", "printed",
                "Going from T_p = 20 s to 15 s costs less than 3 % of the objective and saves more than 38 % run-time.",
                "Table A.2, A.6", "effort at most +3 %, mean run-time at most -38 %",
                f"effort {last['effort_percent']:+.1f} %, mean run-time {last['mean_percent']:+.1f} %",
                last["effort_percent"] <= 3.0 and last["mean_percent"] <= -38.0,
            ),
        )  # fmt: skip
        return StudyResult(
            summary=(
                f"{config.seeds} missions over {setup.ground.name} (mean straight line {straight:,.0f} m), each "
                "flown with four horizons. The thesis' unit of effort is unknown; what can be compared is how it "
                "changes.",
            ),
            rows=rows,
            tables=(_table(rows), _changes(changes)),
            figure=_figure(rows, by_condition, shown, setup.ground),
            caption="Paths of the first mission for each horizon, the shorter the wider, and medians over the missions "
            "with their 95 % bootstrap bands, where there are six missions or more.",
            claims=claims,
            tracks=[track(f"T_p = {(n - 1) * H:.0f} s", shown[n], COLOURS[n]) for n in NODES],
            places=ends(shown[NODES[0]]),
        )


def _row(n: int, records: Sequence[Record]) -> dict[str, float]:
    ratio = median(figures(records, "path_length_m") / figures(records, "straight_line_m"))
    return {
        "T_p_s": (n - 1) * H,
        "N": n,
        "path_m": float(figures(records, "path_length_m").mean()),
        "path_over_straight": ratio.median,
        "path_over_straight_low": ratio.low,
        "path_over_straight_high": ratio.high,
        "effort": float(effort_norm(records, H).mean()),
        "solve_ms_mean": float(figures(records, "solve_ms_mean").mean()),
        "solve_ms_max": float(figures(records, "solve_ms_max").max()),
        "printed_path_m": PRINTED[n][0],
        "printed_effort": PRINTED[n][1],
        "printed_mean_s": PRINTED[n][2],
        "printed_max_s": PRINTED[n][3],
    }


def _change(long: dict[str, float], short: dict[str, float]) -> dict[str, float]:
    def percent(key: str) -> float:
        return 100.0 * (short[key] / long[key] - 1.0)

    printed = PRINTED_CHANGES[int(long["N"]), int(short["N"])]
    return {
        "from_s": long["T_p_s"],
        "to_s": short["T_p_s"],
        "effort_percent": percent("effort"),
        "mean_percent": percent("solve_ms_mean"),
        "max_percent": percent("solve_ms_max"),
        "printed_effort_percent": printed[0],
        "printed_mean_percent": printed[1],
        "printed_max_percent": printed[2],
    }


def _table(rows: Sequence[dict[str, float]]) -> Table:
    return Table.of("Table A.1", rows, (
        ("T_p", "{T_p_s:.0f}\u00a0s"), ("N", lambda r: int(r["N"])), ("path [m]", "{path_m:,.0f}"),
        ("printed", "{printed_path_m:,.0f}"),
        ("path / straight, median", _path_over_straight),
        ("‖a‖₂ [m/s²]", "{effort:.1f}"), ("printed", "{printed_effort:.2f}"),
        ("mean CPU [ms]", "{solve_ms_mean:.3f}"), ("printed [s]", "{printed_mean_s:.2f}"),
        ("max CPU [ms]", "{solve_ms_max:.2f}"), ("printed [s]", "{printed_max_s:.2f}"),
    ))  # fmt: skip


def _path_over_straight(row: Row) -> str:
    median, low, high = (row[f"path_over_straight{end}"] for end in ("", "_low", "_high"))
    return f"{median:.4f}" if math.isnan(low) else f"{median:.4f} [{low:.4f}, {high:.4f}]"


def _changes(changes: Sequence[dict[str, float]]) -> Table:
    columns = ("T_p", "effort", "printed", "mean CPU", "printed", "max CPU", "printed")
    cells = [
        (
            f"{c['from_s']:.0f} → {c['to_s']:.0f} s",
            *(
                f"{c[f'{prefix}{name}_percent']:+.1f} %"
                for name in ("effort", "mean", "max")
                for prefix in ("", "printed_")
            ),
        )
        for c in changes
    ]  # fmt: skip
    return Table("Table A.2: what a shorter horizon changes", columns, cells)


def _figure(
    rows: Sequence[dict[str, float]],
    by_condition: dict[int, list[Record]],
    shown: dict[int, RunData],
    ground: HeightField,
) -> Figure:
    with styled_figure((9.4, 3.9)) as figure:
        path, bands, load = figure.subplots(1, 3, width_ratios=(1.25, 1, 1))
        flights = {f"T_p = {(n - 1) * H:.0f} s": (shown[n], COLOURS[n]) for n in NODES}
        paths_on_map(path, ground, flights, "Figure A.5: paths")
        horizons = [(n - 1) * H for n in NODES]
        measured = [median(effort_norm(by_condition[n], H)) for n in NODES]
        middle = np.array([band.median for band in measured])
        spread = np.array([[band.median - band.low, band.high - band.median] for band in measured]).T
        bands.errorbar(horizons, middle, np.nan_to_num(spread), fmt="o-", capsize=3, color=COLOURS[13])
        bands.set(xlabel="T_p [s]", ylabel="‖a‖₂ [m/s²]", title="Effort", ylim=(0.0, None))
        for row, (key, name) in zip(
            ("o-", "s--"), (("solve_ms_mean", "mean"), ("solve_ms_max", "largest")), strict=True
        ):
            load.plot(horizons, [r[key] for r in rows], row, label=name, color=COLOURS[7])
        load.set(xlabel="T_p [s]", ylabel="CPU time [ms]", title="Load of one replan", ylim=(0.0, None))
        load.legend()
    return figure
