"""The run of a scenario without a drawing on one page: summary, charts, two pictures of the scene, events."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from mathnavi.renders import page
from mathnavi.renders.figures import cost_figure
from mathnavi.renders.generic.drawing import highlight, verdict
from mathnavi.renders.generic.figures import (
    MOST_ROWS,
    errors_figure,
    estimates_figure,
    inputs_figure,
    readings_figure,
    states_figure,
)
from mathnavi.renders.generic.run_data import GenericRun, estimates
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.report import Headline, event_figures, run_page, solve_figures, still_block, why
from mathnavi.sim.records.figure_names import SHORTFALL, label

MOST_TILES = 5


def report(run: GenericRun) -> Markup:
    """Return the report's HTML."""
    charts = page.section("Charts", *page.figure_blocks(_figures(run)))
    return run_page(run, _headline(run), (*_pictures(run), charts), by_vehicle=len(run.vehicles) > 1)


def at_a_glance(run: GenericRun) -> Figure:
    """The states over time, with their estimates."""
    return states_figure(run)


def _left_out(run: GenericRun) -> str:
    """Sentence on the states that are not drawn; "" if all are."""
    most = max(map(len, run.states.values()))
    return f" The first {MOST_ROWS} of {most} states are drawn." if most > MOST_ROWS else ""


def _headline(run: GenericRun) -> Headline:
    figures = {key: value for key, value in run.summary.items() if isinstance(value, bool | int | float)}
    figures = {key: value for key, value in figures.items() if key not in ("seed", SHORTFALL)}
    tiles = {label(key)[0]: quantity(key, value) for key, value in list(figures.items())[:MOST_TILES]}
    sentence = verdict(run)
    return Headline(
        run.title, f"{sentence[0].upper()}{sentence[1:]}{why(run.summary)}.", SHORTFALL not in run.summary, tiles
    )


def _pictures(run: GenericRun) -> list[Markup]:
    if run.scene is None:
        return []
    middle = sum(highlight(run)) / 2.0
    return [
        still_block(
            run.directory, "fixed", run.duration, "The whole run.", "Where it went, at the end of the run."
        ),
        still_block(
            run.directory, "track", middle, f"The scene {middle:.1f} s after the start.",
            f"The scene {middle:.1f} s after the start; the estimate is drawn over it where there is one.",
        ),
    ]  # fmt: skip


def _figures(run: GenericRun) -> list[Drawn]:
    estimated = len(run.vehicles) == 1 and estimates(next(iter(run.vehicles.values()))) is not None
    caption = "The states over time, truth and estimate." if estimated else "The states over time."
    drawn: list[Drawn] = [("states", states_figure(run), f"{caption}{_left_out(run)}")]
    if (inputs := inputs_figure(run)) is not None:
        drawn.append(("inputs", inputs, "The commands to the actuators, in their order in the model."))
    whose = f", of {next(iter(run.vehicles))}" if len(run.vehicles) > 1 else ""
    if (others := estimates_figure(run)) is not None:
        drawn.append(("estimates", others, f"The estimate, which is not of the whole state, over time{whose}."))
    if (readings := readings_figure(run)) is not None:
        drawn.append(("readings", readings, f"The readings of each sensor, a line for each number{whose}."))
    if (errors := errors_figure(run)) is not None:
        drawn.append(("errors", errors, "Estimate less truth, state by state."))
    for log in list(run.vehicles.values())[:1]:
        if any(np.isfinite(plan.cost) for plan in log.plans):
            cost = cost_figure(log.plans, log.adopted, run.duration)
            drawn.append(("cost", cost, "The objective of the plan that is followed, over time."))
    return [*drawn, *solve_figures(run.summary), *event_figures(run, run.duration)]
