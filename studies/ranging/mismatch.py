"""Undeclared errors: does the bank of feasible poses find the pose, or report that it cannot?

More range noise, outliers, odometry of another scale and slipping wheels, all undeclared, and a nearly round wall are
compared with runs as declared. The robot drives by the default inputs, ``active``, from an unknown start that is drawn,
with two sensors at ±60° unless a case differs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.interfaces.signals import Status
from mathnavi.models.field.curve import Curve
from mathnavi.models.tolerances import TIME_TOLERANCE
from mathnavi.models.unicycle.mission import RangingMission
from mathnavi.renders.figures import INK
from mathnavi.renders.study_report import Table
from mathnavi.sim.metrics.consistency import consistency
from mathnavi.sim.metrics.ranging import RangingErrors
from mathnavi.sim.metrics.sure_and_wrong import sure_and_wrong
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.scenarios.closed_loop import RunData
from mathnavi.sim.scenarios.range_localisation import VEHICLE
from mathnavi.sim.sweep.trial import trial
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyResult

FIRST_SEED = 1000  # the bank's constants were chosen on others
FOUR = (0.0, 90.0, 180.0, -90.0)  # [deg]
ROUND = ((0.0, 0.0, 0.0, 0.0), (2.2, 0.0, 0.0, 2.16), (0.03, 0.0, 0.0, 0.03))  # [m]
HELD = ("as declared", "as declared, 4 sensors")  # cases in which the model holds
CASES: dict[str, dict[str, Any]] = {  # fields of the scenario
    HELD[0]: {},
    HELD[1]: {"sensors": FOUR},
    "range noise 10 % for 5 %": {"mismatch.range_noise": 2.0},
    "30 % outliers": {"mismatch.outliers": 0.3},
    "odometry 5 % off": {"noise.odometry_bias": 0.0, "mismatch.odometry_bias": 0.05},
    "wheels, friction 0.15": {"drive": "differential", "friction": 0.15},
    "wheels, friction 0.4": {"drive": "differential", "friction": 0.4},
    "wheels, friction 0.15, 4 sensors": {"drive": "differential", "friction": 0.15, "sensors": FOUR},
    "nearly round wall": {"field.shape": "fourier", "field.coefficients": ROUND},
}
KEPT = (
    "converged", "known", "sure_and_wrong", "nees_known", "position_rms_m", "heading_rms_deg",
    "touched_wall",
)  # fmt: skip
CONVERGED, SURE_AND_WRONG, MOST_NEES = 0.9, 0.005, 6.0  # shares of runs and of samples; of a consistent filter it is 3
COLOURS = {"converged": "#0d5fa8", "does not know": "#c9d3dd", "neither": "#c2183b"}


@configuration
class MismatchConfig:
    """Sample sizes: missions that are flown."""

    seeds: Count = 20
    """number of runs of each case"""
    seconds: Count = 10
    """duration of a run [s]"""


class Mismatch:
    """The bank of feasible poses under undeclared errors (Paper C)."""

    Config = MismatchConfig
    quick = MismatchConfig(seeds=2, seconds=5)
    title = "Noise that was not declared: the bank of feasible poses finds the pose, or says that it does not know"
    on_terrain = False

    @staticmethod
    def run(config: MismatchConfig, setup: Setup) -> StudyResult:
        runs = {
            (case, seed): trial(
                "range-localisation", seed, fields={**fields, "duration": float(config.seconds)},
                measure=f"{__name__}:honesty",
            )
            for case, fields in CASES.items() for seed in range(FIRST_SEED, FIRST_SEED + config.seeds)
        }  # fmt: skip
        rows = [
            {"case": case, "seed": seed, **{name: record.summary[name] for name in KEPT}}
            for (case, seed), record in setup.fly_each(runs).items()
        ]
        cases = {case: Case(case, [row for row in rows if row["case"] == case]) for case in CASES}
        return StudyResult(
            summary=(
                f"{config.seeds} runs of {config.seconds} s of each case by the default inputs, two sensors at ±60° in "
                "the standard ellipse unless the case says otherwise, from a start that is drawn and not known. "
                "Declared: ranges 5 %, odometry 0.05 per reading and 2 % always, no outliers. Converged: RMS error "
                "below 0.3 m and 0.2 rad over the last quarter. Does not know: the status is INITIALISING over most of "
                "the last quarter, no hypothesis being twice as likely as all others.",
            ),
            rows=rows,
            tables=(Table(
                "What became of the runs",
                ("case", "converged", "does not know", "touched the wall", "average NEES where OK"),
                [(case, f"{e.converged} of {e.runs}", e.unknown, e.touched, e.nees.text() if e.nees else "–")
                 for case, e in cases.items()],
            ),),
            figure=figure(cases),
            caption="(a) Runs that converged, that say that they do not know, and others. (b) NEES of each run over "
            "its last quarter where the status is OK, and the average (diamonds, white where the model holds); "
            "3 is that of a consistent filter, 6 the most that is allowed.",
            claims=claims(cases, rows),
        )  # fmt: skip


class Case:
    """Outcomes of the runs of a case."""

    def __init__(self, name: str, rows: list[dict[str, Any]]) -> None:
        self.runs, self.declared = len(rows), name in HELD
        self.converged = sum(bool(row["converged"]) for row in rows)
        self.unknown = sum(not row["converged"] and row["known"] < 0.5 for row in rows)
        self.touched = sum(bool(row["touched_wall"]) for row in rows)
        self.squares = [row["nees_known"] for row in rows if row["nees_known"] is not None]
        self.nees = consistency(self.squares, 3) if self.squares else None  # degrees of freedom of a pose

    @property
    def honest(self) -> bool:
        return self.converged >= CONVERGED * self.runs or self.converged + self.unknown == self.runs

    @property
    def consistent(self) -> bool:
        return self.nees is None or (self.nees.holds if self.declared else self.nees.average <= MOST_NEES)

    def text(self) -> str:
        found = f"{self.converged} of {self.runs}"
        found += f", {self.unknown} do not know" * bool(self.unknown)
        return found + f", {self.touched} touched the wall" * bool(self.touched)


def claims(cases: dict[str, Case], rows: list[dict[str, Any]]) -> list[Claim]:
    """Evaluate every claim of the study."""
    sure = {case: float(np.mean([row["sure_and_wrong"] for row in rows if row["case"] == case])) for case in cases}
    worst = max(sure, key=sure.__getitem__)
    nees = {
        case: "never OK" if e.nees is None else e.nees.text() if e.declared else f"{e.nees.average:.2f}"
        for case, e in cases.items()
    }
    return [
        Claim(
            "mismatch.converged", "target",
            "The bank finds the pose where noise, outliers, odometry or grip are not as declared, or says that it does "
            "not know it.", "C.4",
            f"in each case >= {CONVERGED:g} of the runs converged, or each other run says that it does not know",
            "; ".join(f"{case}: {e.text()}" for case, e in cases.items()), all(e.honest for e in cases.values()),
        ),
        Claim(
            "mismatch.sure-and-wrong", "target", "The bank is not sure of a wrong pose.", "C.4",
            f"OK with an error above three deviations for more than a second: <= {SURE_AND_WRONG:.1%} of the time of "
            "each case",
            f"{np.mean(list(sure.values())):.2%} of all cases; at most {sure[worst]:.2%}, {worst}",
            sure[worst] <= SURE_AND_WRONG,
        ),
        Claim(
            "mismatch.consistency", "target", "The bank knows how good its estimate is, whatever was declared.", "C.4",
            f"average NEES where OK: within its 95 % chi-square bounds as declared, <= {MOST_NEES:g} otherwise",
            "; ".join(f"{case}: {text}" for case, text in nees.items()),
            all(e.consistent for e in cases.values()) and any(e.nees for e in cases.values()),
        ),
    ]  # fmt: skip


def figure(cases: dict[str, Case]) -> Figure:
    """Draw two panels: outcomes of the runs, and consistency of the estimates."""
    with styled_figure((11.0, 4.6), ConstrainedLayoutEngine(w_pad=0.08)) as drawn:
        outcomes, nees = drawn.subplots(1, 2, sharey=True)
        for k, e in enumerate(cases.values()):
            shares = (e.converged / e.runs, e.unknown / e.runs)
            for share, left, colour in zip((*shares, 1.0 - sum(shares)), (0.0, shares[0], sum(shares)),
                                           COLOURS.values(), strict=True):  # fmt: skip
                outcomes.barh(k, share, left=left, color=colour, height=0.66)
            nees.plot(e.squares, np.full(len(e.squares), k), "o", ms=4.0, color=COLOURS["converged"], alpha=0.4, mew=0)
            if e.squares:
                nees.plot(np.mean(e.squares), k, "D", ms=6.0, mfc="white" if e.declared else INK, mec=INK)
        for label, colour in COLOURS.items():
            outcomes.barh(0, 0.0, color=colour, label=label)
        outcomes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=8)
        outcomes.set_yticks(range(len(cases)), list(cases))
        outcomes.invert_yaxis()
        outcomes.set(xlim=(0.0, 1.0), xlabel="share of the runs", title="(a) what became of the runs")
        outcomes.grid(visible=False, axis="y")
        nees.axvline(3.0, color=INK, lw=1.0, ls=":")
        nees.axvline(MOST_NEES, color=COLOURS["neither"], lw=1.0, ls="--")
        nees.set_xscale("symlog", linthresh=10.0)
        nees.set(xlabel="NEES of the last quarter where the status is OK", title="(b) how consistent it is")
    return drawn


def honesty(outcome: RunData) -> dict[str, Any]:
    """A measure: how often the estimator was sure, and how accurate it then was.

    ``known`` is the share of samples of the last quarter with the status OK, and ``nees_known`` their mean NEES, None
    without any. ``sure_and_wrong`` is the share of all samples at which position or heading is (see
    ``mathnavi.sim.metrics.sure_and_wrong``).
    """
    recording, record = outcome.recording, outcome.config["mission"]
    mission = RangingMission(Curve(tuple(map(tuple, record["coefficients"])), record["field"]), (0.0,))
    errors, estimates = RangingErrors.from_recording(recording, VEHICLE, mission), recording.agents[VEHICLE].estimates
    newest = np.searchsorted([e.t for e in estimates], recording.t + TIME_TOLERANCE, side="right") - 1
    known = np.array([k >= 0 and estimates[k].status is Status.OK for k in newest], dtype=bool)
    wrong = sure_and_wrong(errors.t, known, errors.difference, errors.covariance)
    nees = errors.nees[errors.last][known[errors.last]]
    return {
        "known": float(known[errors.last].mean()),
        "sure_and_wrong": float(wrong.any(axis=1).mean()),
        "nees_known": float(nees.mean()) if len(nees) else None,
    }
