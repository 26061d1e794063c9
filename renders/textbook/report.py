"""A textbook system's run on one page: whether its observer converged, and its curves."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from mathnavi.renders import page
from mathnavi.renders.figures import STYLE, canvas, thinned
from mathnavi.renders.page import Markup, quantity
from mathnavi.renders.report import Headline, run_page
from mathnavi.renders.textbook.panel import READ, TRUTH, TextbookPanel, shown
from mathnavi.renders.textbook.run_data import TextbookRun


def report(run: TextbookRun) -> Markup:
    """Return the report's HTML."""
    title = f"{run.title}, seed {run.log.config['seed']}"
    signals = page.figure_block(signals_figure(run), "signals", "The readings of the outputs, and the inputs.")
    opening = (
        page.section("Truth and estimate", page.figure_block(panel_figure(run), "board", _caption(run))),
        page.section("What the observer was given", signals),
    )
    return run_page(run, _headline(run, title), opening)


def panel_figure(run: TextbookRun) -> Figure:
    """The panel with all of the run."""
    with matplotlib.rc_context(STYLE):
        panel = TextbookPanel(run, 10.4, 5.2 + 0.5 * max(len(run.states) - 2, 0))
        panel.show(run.duration)
    return panel.figure


def signals_figure(run: TextbookRun) -> Figure:
    """Readings and inputs over time."""
    with matplotlib.rc_context(STYLE):
        rows = [(name, run.y[:, k], READ) for k, name in enumerate(run.outputs)]
        rows += [(name, run.log.u[:, k], TRUTH) for k, name in enumerate(run.inputs)]
        figure = canvas(9.4, 1.3 * len(rows) + 0.5)
        drawn = np.atleast_1d(figure.subplots(len(rows), 1, sharex=True))
        i = thinned(len(run.log.t), 0)
        for axes, (name, values, colour) in zip(drawn, rows, strict=True):
            axes.plot(run.log.t[i], values[i], ".", ms=3, color=colour)
            axes.set_ylabel(shown(name))
        drawn[-1].set(xlabel="time [s]", xlim=(0.0, run.duration))
    return figure


def _caption(run: TextbookRun) -> str:
    left = "the robot in the plane of the flags, with its lines of sight" if run.has_flags else "the first two states"
    return f"Left: {left}. Right: every state and the length of the error over time. Truth dashed, estimate solid."


def _headline(run: TextbookRun, title: str) -> Headline:
    summary = run.log.summary
    converged, escaped = bool(summary.get("converged")), run.escape_time is not None
    verdict = "The estimate converged" if converged else "The estimate did not converge"
    sentence = f"{verdict}{', and the solution escaped' if escaped else ''}."
    allowed = "" if run.tolerance is None else f" (allowed {run.tolerance:g})"
    tiles: dict[str, object] = {
        "error at the start": page.number(summary.get("error_start")),
        f"RMS of the last quarter{allowed}": page.number(summary.get("error_rms")),
        "rate of decay": quantity("decay_rate_per_s", summary.get("decay_rate_per_s")),
        "length of the run": quantity("run_time_s", summary.get("run_time_s")),
    }
    if escaped:
        tiles["escape"] = quantity("escape_time_s", summary.get("escape_time_s"))
    rms = summary.get("error_rms")
    ending = "escaped" if escaped else "converged" if converged else "not converged"
    found = ending if rms is None else f"{ending}; error {page.number(rms)} RMS in the last quarter"
    return Headline(f"{title}: {found}", sentence, converged and not escaped, tiles)
