"""Claims of the study ``mismatch``, evaluated from its results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mathnavi.sim.metrics.consistency import Consistency, consistency
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.store import Record
from mathnavi.sim.studies.ranging.mismatch.flights import MODEL_HOLDS

CONVERGED = 0.9  # share of the runs of a case
SURE_AND_WRONG = 0.01  # share of the samples by which convergence is judged
MOST_NEES = 6.0  # average under a mismatch; 3 is that of a consistent filter
DEGREES = 3  # of a pose
_KNOWN = 0.5  # share of the samples from which a run says that it knows its pose


@dataclass(frozen=True)
class MismatchResults:
    """Results from which the claims are evaluated."""

    runs: Mapping[str, Sequence[Record]]  # by case

    def converged(self, case: str) -> int:
        """Runs that converged."""
        return sum(bool(record.summary["converged"]) for record in self.runs[case])

    def unknown(self, case: str) -> int:
        """Runs that did not converge and say that they do not know their pose."""
        return sum(not record.summary["converged"] and record.summary["known"] < _KNOWN for record in self.runs[case])

    def touched(self, case: str) -> int:
        """Runs in which the robot touched the wall."""
        return sum(bool(record.summary["touched_wall"]) for record in self.runs[case])

    def share(self, name: str) -> float:
        """Share of the samples of all runs, the last quarter of each: ``sure_and_wrong`` or ``ok_and_wrong``."""
        return float(np.mean([record.summary[name] for runs in self.runs.values() for record in runs]))

    def nees(self, case: str) -> Consistency | None:
        """Average NEES where the status is OK, over the last quarters of the runs; None where it never is."""
        squares = [record.summary["nees_known"] for record in self.runs[case]]
        known = [square for square in squares if square is not None]
        return consistency(known, DEGREES) if known else None


def claims(e: MismatchResults) -> list[Claim]:
    """Evaluate every claim of the study."""
    return [_converged(e), _sure_and_wrong(e), _consistency(e)]


def _converged(e: MismatchResults) -> Claim:
    holds = [
        e.converged(case) >= CONVERGED * len(runs) or e.converged(case) + e.unknown(case) == len(runs)
        for case, runs in e.runs.items()
    ]
    found = (
        f"{case}: {e.converged(case)} of {len(runs)}"
        + (f", {e.unknown(case)} do not know" if e.unknown(case) else "")
        + (f", {e.touched(case)} touched the wall" if e.touched(case) else "")
        for case, runs in e.runs.items()
    )
    return Claim(
        "mismatch.converged", "target",
        "The bank finds the pose where noise, outliers, odometry or grip are not as declared, or says that it does not "
        "know it.", "C.4",
        f"in each case >= {CONVERGED:g} of the runs converged, or each other run says that it does not know",
        "; ".join(found), all(holds),
    )  # fmt: skip


def _sure_and_wrong(e: MismatchResults) -> Claim:
    share = e.share("sure_and_wrong")
    return Claim(
        "mismatch.sure-and-wrong", "target", "The bank is not sure of a wrong pose.", "C.4",
        f"status OK, two standard deviations below .3 m and .2 rad, and an error above either: <= "
        f"{SURE_AND_WRONG:.0%} of the samples of the last quarters",
        f"{share:.2%} of all cases; by the status alone {e.share('ok_and_wrong'):.2%}", share <= SURE_AND_WRONG,
    )  # fmt: skip


def _consistency(e: MismatchResults) -> Claim:
    found = {case: e.nees(case) for case in e.runs}
    holds = [
        nees is None or (nees.holds if case in MODEL_HOLDS else nees.average <= MOST_NEES)
        for case, nees in found.items()
    ]
    texts = {
        case: "never OK" if nees is None else nees.text() if case in MODEL_HOLDS else f"{nees.average:.2f}"
        for case, nees in found.items()
    }
    return Claim(
        "mismatch.consistency", "target", "The bank knows how good its estimate is, whatever was declared.", "C.4",
        f"average NEES where OK: within its 95 % chi-square bounds as declared, <= {MOST_NEES:g} otherwise",
        "; ".join(f"{case}: {text}" for case, text in texts.items()),
        all(holds) and any(nees is not None for nees in found.values()),
    )  # fmt: skip
