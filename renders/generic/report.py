"""The run of a scenario without a drawing on one page: summary, charts, two pictures of the scene, events."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mathnavi.renders import page
from mathnavi.renders.figures import cost_figure
from mathnavi.renders.generic.drawing import highlight, verdict
from mathnavi.renders.generic.figures import MOST_ROWS, board_figure, charts_figure
from mathnavi.renders.generic.log_plan import LogPlan, log_plan, plan_figure
from mathnavi.renders.generic.run_data import GenericRun, RecordedEstimates, estimates
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.plan import DEVIATIONS as DEVIATIONS_OF_PLACES
from mathnavi.renders.report import (
    Headline,
    event_figures,
    innovation_figures,
    run_page,
    solve_figures,
    still_block,
    why,
)
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
    """Estimated quantities and states over time, with the estimates; of a log beside its plan."""
    return board_figure(run, MOST_ROWS)[0]


def _headline(run: GenericRun) -> Headline:
    figures = {key: value for key, value in run.summary.items() if isinstance(value, bool | int | float)}
    figures = {key: value for key, value in figures.items() if key not in ("seed", SHORTFALL)}
    tiles = {label(key)[0]: quantity(key, value) for key, value in list(figures.items())[:MOST_TILES]}
    sentence = verdict(run)
    good: bool | None = SHORTFALL not in run.summary
    if run.is_log:
        good = None if run.final_status is None else run.final_status.usable
    return Headline(
        f"{run.title}: {found(run)}", f"{sentence[0].upper()}{sentence[1:]}{why(run.summary)}.", good, tiles
    )


def found(run: GenericRun) -> str:
    """Return the outcome of a run in a few words: why it failed, or when it ended; of a log how much was estimated."""
    if run.is_log:
        recorded = f"{run.duration:.1f} s"
        usable = f"estimate usable for {100.0 * run.usable_share:.3g} % of {recorded}"
        return f"{recorded} recorded" if run.final_status is None else usable
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
    subject = "reference" if run.is_log and not whole else "states"
    parts: list[tuple[str, list[Chart], str]] = [
        ("estimates", estimate_charts(run), _of_estimates(single, run.truth_word)),
        ("states", state_charts(run), f"The {subject} over time{f', {run.truth_word} and estimate' if whole else ''}"),
        ("figures", figure_charts(run), "Further figures of the estimate over time"),
        ("errors", difference_charts(run), f"Estimate less {run.truth_word}, number by number{_banded(found)}"),
        ("inputs", input_charts(run), "The commands to the actuators over time"),
        ("readings", reading_charts(run), "The readings of each sensor over time"),
    ]
    drawn: list[Drawn] = []
    if (plan := log_plan(run)) is not None:
        drawn.append(("path", plan_figure(plan), _of_plan(plan)))
    for name, charts, caption in parts:
        if (figure := charts_figure(charts, run.duration)) is not None:
            more = f" The first {MOST_ROWS} of {len(charts)} charts are drawn." if len(charts) > MOST_ROWS else ""
            drawn.append((name, figure, f"{caption}{_banded(found[:1]) if name == 'states' and whole else ''}.{more}"))
    if len(run.vehicles) == 1:
        (log,) = run.vehicles.values()
        drawn += innovation_figures(log.arrays, run.duration)
    for log in list(run.vehicles.values())[:1]:
        if any(np.isfinite(plan.cost) for plan in log.plans):
            cost = cost_figure(log.plans, log.adopted, run.duration)
            drawn.append(("cost", cost, "The objective of the plan that is followed, over time."))
    return [*drawn, *solve_figures(run.summary), *event_figures(run, run.duration)]


def _of_plan(plan: LogPlan) -> str:
    """Caption of the plan."""
    parts = ["the reference"] * bool(plan.reference.shape[1])
    parts += ["the estimate where it may be used"] * bool(np.isfinite(plan.estimate).any())
    parts += ["the walls"] * (plan.wall is not None) + ["the beacons by their numbers"] * bool(plan.beacons)
    sigmas = f"each with its standard deviation and the ellipse of {DEVIATIONS_OF_PLACES:g} of them"
    parts += [f"beacons as they were found, {sigmas}"] * bool(plan.last_found)
    missing = [str(i) for i in range(plan.places.shape[1]) if not (i in plan.beacons or i in plan.last_found)]
    more = f" Beacons that were not found by the end: {', '.join(missing)}." if missing else ""
    return f"Seen from above: {', '.join(parts)}.{more}"


def _of_estimates(found: RecordedEstimates | None, truth: str) -> str:
    """Caption of the charts of an estimate that are not charts of states."""
    if found is None or found.whole:
        return ""  # there are no such charts
    known = np.isfinite(found.truth).any(axis=0)
    beside = f", and the {truth}" if known.all() else f", and the {truth} where it is declared" if known.any() else ""
    return f"The estimate over time{beside}{_banded([found])}"


def _banded(found: Sequence[RecordedEstimates | None]) -> str:
    """Meaning of the band about a curve; "" where none is drawn."""
    banded = any(each is not None and each.deviation is not None for each in found)
    return f"; the bands are {DEVIATIONS:g} standard deviations of the estimate to either side" if banded else ""
