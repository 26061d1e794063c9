"""The run of a scenario without a drawing on one page: summary, charts, two pictures of the scene, events."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mathnavi.renders import page
from mathnavi.renders.figures import cost_figure
from mathnavi.renders.generic.drawing import highlight, verdict
from mathnavi.renders.generic.figures import MOST_ROWS, charts_figure, states_figure
from mathnavi.renders.generic.run_data import GenericRun, RecordedEstimates, estimates
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.report import Headline, event_figures, run_page, solve_figures, still_block, why
from mathnavi.renders.scene.charts import (
    DEVIATIONS,
    difference_charts,
    estimate_charts,
    figure_charts,
    input_charts,
    reading_charts,
    state_charts,
)
from mathnavi.renders.scene.elements import Chart
from mathnavi.sim.records.figure_names import SHORTFALL, label

MOST_TILES = 5


def report(run: GenericRun) -> Markup:
    """Return the report's HTML."""
    charts = page.section("Charts", *page.figure_blocks(_figures(run)))
    return run_page(run, _headline(run), (*_pictures(run), charts), by_vehicle=len(run.vehicles) > 1)


def at_a_glance(run: GenericRun) -> Figure:
    """Estimated quantities and states over time, with the estimates."""
    return states_figure(run)


def _headline(run: GenericRun) -> Headline:
    figures = {key: value for key, value in run.summary.items() if isinstance(value, bool | int | float)}
    figures = {key: value for key, value in figures.items() if key not in ("seed", SHORTFALL)}
    tiles = {label(key)[0]: quantity(key, value) for key, value in list(figures.items())[:MOST_TILES]}
    sentence = verdict(run)
    return Headline(
        f"{run.title}: {found(run)}",
        f"{sentence[0].upper()}{sentence[1:]}{why(run.summary)}.",
        SHORTFALL not in run.summary,
        tiles,
    )


def found(run: GenericRun) -> str:
    """Return the outcome of a run in a few words: why it failed, or when it ended."""
    if SHORTFALL in run.summary:
        return str(run.summary[SHORTFALL])
    return f"{'arrived' if run.summary.get('arrived') else 'succeeded'} after {run.duration:.1f} s"


def _pictures(run: GenericRun) -> list[Markup]:
    if run.scene is None:
        return []
    middle, over = sum(highlight(run)) / 2.0, ", with the estimate over it" if run.scene.has_ghost() else ""
    return [
        still_block(
            run.directory, "fixed", run.duration, "The whole run.", "Where it went, at the end of the run."
        ),
        still_block(
            run.directory, "track", middle, f"The scene {middle:.1f} s after the start.",
            f"The scene {middle:.1f} s after the start{over}.",
        ),
    ]  # fmt: skip


def _figures(run: GenericRun) -> list[Drawn]:
    found = [estimates(log, run.signals[name]) for name, log in run.vehicles.items()]
    single = found[0] if len(found) == 1 else None
    whole = single is not None and single.whole
    parts: list[tuple[str, list[Chart], str]] = [
        ("estimates", estimate_charts(run), _of_estimates(single)),
        ("states", state_charts(run), f"The states over time{', truth and estimate' if whole else ''}"),
        ("figures", figure_charts(run), "Further figures of the estimate over time"),
        ("errors", difference_charts(run), f"Estimate less truth, number by number{_banded(found)}"),
        ("inputs", input_charts(run), "The commands to the actuators over time"),
        ("readings", reading_charts(run), "The readings of each sensor over time"),
    ]
    drawn: list[Drawn] = []
    for name, charts, caption in parts:
        if (figure := charts_figure(charts, run.duration)) is not None:
            more = f" The first {MOST_ROWS} of {len(charts)} charts are drawn." if len(charts) > MOST_ROWS else ""
            drawn.append((name, figure, f"{caption}{_banded(found[:1]) if name == 'states' and whole else ''}.{more}"))
    for log in list(run.vehicles.values())[:1]:
        if any(np.isfinite(plan.cost) for plan in log.plans):
            cost = cost_figure(log.plans, log.adopted, run.duration)
            drawn.append(("cost", cost, "The objective of the plan that is followed, over time."))
    return [*drawn, *solve_figures(run.summary), *event_figures(run, run.duration)]


def _of_estimates(found: RecordedEstimates | None) -> str:
    """Caption of the charts of an estimate that are not charts of states."""
    if found is None or found.whole:
        return ""  # there are no such charts
    known = np.isfinite(found.truth).any(axis=0)
    beside = ", and the truth" if known.all() else ", and the truth where it is declared" if known.any() else ""
    return f"The estimate over time{beside}{_banded([found])}"


def _banded(found: Sequence[RecordedEstimates | None]) -> str:
    """Meaning of the band about a curve; "" where none is drawn."""
    banded = any(each is not None and each.deviation is not None for each in found)
    return f"; the bands are {DEVIATIONS:g} standard deviations of the estimate to either side" if banded else ""
