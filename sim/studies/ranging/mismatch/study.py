"""Errors that were not declared: whether the bank of feasible poses finds the pose, or says that it cannot.

More range noise, outliers, odometry of another scale and wheels that slip, none of them declared, and a wall that is
nearly round, beside runs that are as declared.
"""

from __future__ import annotations

from typing import Any

from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.studies.framework.study import Setup, StudyResult
from mathnavi.sim.studies.ranging.mismatch.claims import MismatchResults, claims
from mathnavi.sim.studies.ranging.mismatch.figure import figure
from mathnavi.sim.studies.ranging.mismatch.flights import CASES, flight

FIRST_SEED = 1000  # the bank's constants were chosen on others
_KEPT = (
    "converged",
    "known",
    "ok_and_wrong",
    "sure_and_wrong",
    "nees_known",
    "position_rms_m",
    "heading_rms_deg",
    "touched_wall",
)


@configuration
class MismatchConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 20
    """runs of each case"""
    seconds: Count = 10
    """of a run [s]"""


class Mismatch:
    """The bank of feasible poses with errors that were not declared (Paper C)."""

    Config = MismatchConfig
    quick = MismatchConfig(seeds=2, seconds=5)
    title = "Noise that was not declared: the bank of feasible poses finds the pose, or says that it does not know"
    on_terrain = False

    @staticmethod
    def run(config: MismatchConfig, setup: Setup) -> StudyResult:
        seeds = range(FIRST_SEED, FIRST_SEED + config.seeds)
        asked = {case: [flight(case, seed, float(config.seconds)) for seed in seeds] for case in CASES}
        results = MismatchResults(setup.fly_groups(asked))
        return StudyResult(
            summary=(
                f"{config.seeds} runs of {config.seconds} s of each case by the default inputs, two sensors at ±60° in "
                "the standard ellipse unless the case says otherwise, from a start that is drawn and not known. "
                "Declared: ranges 5 %, odometry .05 per reading and 2 % always, no outliers. Converged: RMS error "
                "below .3 m and .2 rad over the last quarter. Does not know: the status is INITIALISING over most of "
                "the last quarter, no hypothesis being twice as likely as all others.",
            ),
            rows=_rows(results),
            tables=(_table(results),),
            figure=figure(results),
            caption="(a) Runs that converged, that say that they do not know, and others. (b) NEES of each run over "
            "its last quarter where the status is OK, and the average (diamonds, white where the model holds); "
            "3 is that of a consistent filter, 6 the most that is allowed.",
            claims=claims(results),
        )


def _rows(e: MismatchResults) -> list[dict[str, Any]]:
    return [
        {"case": case, "seed": record.seed, **{name: record.summary[name] for name in _KEPT}}
        for case, runs in e.runs.items()
        for record in runs
    ]


def _table(e: MismatchResults) -> Table:
    columns = ("case", "converged", "does not know", "touched the wall", "average NEES where OK")
    rows = []
    for case, runs in e.runs.items():
        nees = e.nees(case)
        rows.append(
            (case, f"{e.converged(case)} of {len(runs)}", e.unknown(case), e.touched(case),
             "–" if nees is None else nees.text())
        )  # fmt: skip
    return Table("What became of the runs", columns, rows)
