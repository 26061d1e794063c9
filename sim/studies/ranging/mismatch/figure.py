"""The picture of the study ``mismatch``."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from mathnavi.renders.figures import INK, STYLE
from mathnavi.sim.studies.ranging.mismatch.claims import MOST_NEES, MismatchResults
from mathnavi.sim.studies.ranging.mismatch.flights import MODEL_HOLDS

CONVERGED, UNKNOWN, WRONG = "#0d5fa8", "#c9d3dd", "#c2183b"


def figure(e: MismatchResults) -> Figure:
    """Two panels: what became of the runs, and how consistent the estimates are."""
    with matplotlib.rc_context(STYLE):
        drawn = Figure(figsize=(11.0, 4.6), layout=ConstrainedLayoutEngine(w_pad=0.08))
        outcomes, nees = drawn.subplots(1, 2, sharey=True)
        for k, (case, runs) in enumerate(e.runs.items()):
            n, left = len(runs), 0.0
            shares = (e.converged(case) / n, e.unknown(case) / n)
            parts = zip((*shares, 1.0 - sum(shares)), (CONVERGED, UNKNOWN, WRONG), strict=True)
            for share, colour in parts:
                outcomes.barh(k, share, left=left, color=colour, height=0.66)
                left += share
            squares = np.array([r.summary["nees_known"] for r in runs if r.summary["nees_known"] is not None])
            nees.plot(squares, np.full(len(squares), k), "o", ms=4.0, color=CONVERGED, alpha=0.4, mew=0)
            if len(squares):
                nees.plot(squares.mean(), k, "D", ms=6.0, mfc="white" if case in MODEL_HOLDS else INK, mec=INK)
        for label, colour in (("converged", CONVERGED), ("does not know", UNKNOWN), ("neither", WRONG)):
            outcomes.barh(0, 0.0, color=colour, label=label)
        outcomes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, fontsize=8)
        outcomes.set_yticks(range(len(e.runs)), list(e.runs))
        outcomes.invert_yaxis()
        outcomes.set(xlim=(0.0, 1.0), xlabel="share of the runs")
        outcomes.set_title("(a) what became of the runs")
        outcomes.grid(visible=False, axis="y")
        nees.axvline(3.0, color=INK, lw=1.0, ls=":")
        nees.axvline(MOST_NEES, color=WRONG, lw=1.0, ls="--")
        nees.set_xscale("symlog", linthresh=10.0)
        nees.set(xlabel="NEES of the last quarter where the status is OK")
        nees.set_title("(b) how consistent it is")
    return drawn
