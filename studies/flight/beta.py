"""Table A.4, Figure A.8: beta trades time against effort.

N = 13 and gamma = 2: with a smaller gamma the deadline would exclude the slow flights of a small beta. The thesis
compares beta = 1 and 10^4 and reports an "energy consumption", sum of |u| or a similar measure; here it is
sum h |a|^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

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
from mathnavi.studies.framework.study import VEHICLE, Setup, StudyResult, ends, median, track

BETAS = (1.0, 10.0, 100.0, 1e3, 1e4)
PRINTED = {1.0: (362.5, 0.26), 1e4: (227.5, 1.13)}  # Table A.4: time of flight [s], energy consumption (its own unit)
COLOURS = {1.0: "#2166ac", 1e4: "#c2183b"}
LEAST_TIME_RATIO, LEAST_EFFORT_RATIO = 1.4, 2.0  # of the target


@configuration
class BetaConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 20
    """number of missions for each beta, the same for all"""


class Beta:
    """Time of flight against effort, by the penalty parameter beta (Table A.4, Figure A.8)."""

    Config = BetaConfig
    quick = BetaConfig(seeds=2)
    title = "Time-optimality against energy efficiency"

    @staticmethod
    def run(config: BetaConfig, setup: Setup) -> StudyResult:
        fixed = {"deadline_factor": 2.0, "planner.nodes": 13}
        trials = {
            beta: [setup.trial(seed, fields={**fixed, "planner.beta": beta}) for seed in range(config.seeds)]
            for beta in BETAS
        }
        by_condition = setup.fly_groups(trials)
        rows = [_row(beta, records) for beta, records in by_condition.items()]
        low, high = rows[0], rows[-1]
        time_ratio, effort_ratio = low["time_s"] / high["time_s"], high["effort"] / low["effort"]
        all_arrived = low["arrived"] == high["arrived"] == config.seeds
        shown = setup.flown({beta: trials[beta][0] for beta in COLOURS})
        measured = (
            f"{low['time_s']:.1f} s and {low['effort']:,.0f} m²/s³ at beta = 1, {high['time_s']:.1f} s and "
            f"{high['effort']:,.0f} m²/s³ at 10⁴"
        )
        return StudyResult(
            summary=(
                f"{config.seeds} missions over {setup.ground.name}, N = 13, gamma = 2. Time of flight and effort of "
                "the thesis are those of one mission on its own terrain.",
            ),
            rows=rows,
            tables=(_table(rows),),
            figure=_figure(by_condition, shown, setup.ground),
            caption="The first mission with both values; medians of time and effort with 95 % bootstrap bands.",
            claims=(
                Claim(
                    "A.beta", "printed", "A small beta saves energy, a large one saves time.", "Table A.4, A.7",
                    "362.5 s and 0.26 at beta = 1, 227.5 s and 1.13 at 10⁴", measured,
                    all_arrived and time_ratio > 1.0 and effort_ratio > 1.0,
                ),
                Claim(
                    "flight.beta", "target", "beta trades time against effort over a useful range.", "A.7",
                    f"mean time of flight at beta = 1 over that at 10⁴ at least {LEAST_TIME_RATIO:g}, mean effort at "
                    f"10⁴ over that at 1 at least {LEAST_EFFORT_RATIO:g}",
                    f"{time_ratio:.2f} and {effort_ratio:.2f}",
                    all_arrived and time_ratio >= LEAST_TIME_RATIO and effort_ratio >= LEAST_EFFORT_RATIO,
                ),
            ),
            tracks=[track(f"beta = {beta:g}", shown[beta], COLOURS[beta]) for beta in COLOURS],
            places=ends(shown[1.0]),
        )  # fmt: skip


def _row(beta: float, records: Sequence[Record]) -> dict[str, Any]:
    printed = PRINTED.get(beta, (None, None))
    return {
        "beta": beta,
        "time_s": float(figures(records, "arrival_time_s").mean()),
        "effort": float(figures(records, "control_effort").mean()),
        "path_m": figures(records, "path_length_m").mean(),
        "speed_max_m_s": figures(records, "speed_max_m_s").mean(),
        "arrived": int(figures(records, "arrived").sum()),
        "missions": len(records),
        "printed_time_s": printed[0],
        "printed_effort": printed[1],
    }


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Table A.4", rows, (
        ("β", "{beta:g}"), ("time of flight", "{time_s:.1f} s"),
        ("printed", lambda r: f"{r['printed_time_s']} s" if r["printed_time_s"] else "–"),
        ("Σ h |a|²", "{effort:,.0f} m²/s³"),
        ("printed", lambda r: f"{r['printed_effort']}" if r["printed_effort"] else "–"), ("path", "{path_m:,.0f} m"),
        ("arrived", "{arrived} of {missions}"),
    ))  # fmt: skip


def _figure(by_condition: dict[float, list[Record]], shown: dict[float, RunData], ground: HeightField) -> Figure:
    with styled_figure((9.4, 6.4)) as figure:
        (path, speed), (time, effort) = figure.subplots(2, 2, height_ratios=(1.5, 1))
        flights = {f"β = {beta:g}": (shown[beta], colour) for beta, colour in COLOURS.items()}
        paths_on_map(path, ground, flights, "Figure A.8: the two flights")
        for beta, colour in COLOURS.items():
            recording = shown[beta].recording
            v = np.linalg.norm(recording.truths[VEHICLE][:, 3:], axis=1)
            speed.plot(recording.t, v, color=colour, label=f"β = {beta:g}")
        speed.set(xlabel="time [s]", ylabel="speed [m/s]", title="Their speeds", ylim=(0.0, None))
        speed.legend()
        for axes, key, name in (
            (time, "arrival_time_s", "time of flight [s]"),
            (effort, "control_effort", "Σ h |a|² [m²/s³]"),
        ):
            bands = [median(figures(by_condition[beta], key)) for beta in BETAS]
            spread = np.array([[b.median - b.low, b.high - b.median] for b in bands]).T
            axes.errorbar(BETAS, [b.median for b in bands], np.nan_to_num(spread), fmt="o-", capsize=3, color="#2166ac")
            axes.set(xscale="log", xlabel="β", ylabel=name, ylim=(0.0, None))
        time.set_title("Time")
        effort.set_title("Effort")
    return figure
