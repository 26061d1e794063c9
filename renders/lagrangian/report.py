"""A run of a Lagrangian system on one page: whether the velocity was found, pictures, errors and signals over time."""

from __future__ import annotations

from mathnavi.renders import page
from mathnavi.renders.lagrangian import figures
from mathnavi.renders.lagrangian.overlay import subject
from mathnavi.renders.lagrangian.run_data import LagrangianRun
from mathnavi.renders.lagrangian.shot_list import amount, highlight, is_good, verdict
from mathnavi.renders.page import Drawn, Markup, quantity
from mathnavi.renders.report import Headline, event_figures, run_page, still_block, why


def report(run: LagrangianRun) -> Markup:
    """Return the report's HTML."""
    config = run.log.config
    title = f"{config['scenario']}, {run.space or run.mechanism}, seed {config['seed']}"
    errors = page.section("Errors", *page.figure_blocks(_errors(run)))
    signals = page.section("Signals", *page.figure_blocks(_signals(run)))
    return run_page(run, _headline(run, title), (*_pictures(run), errors), (signals,))


def _headline(run: LagrangianRun, title: str) -> Headline:
    summary, unit = run.log.summary, run.unit
    tiles: dict[str, object] = {
        f"velocity error, RMS once settled (allowed {run.tolerance:g})": _measured(summary.get("velocity_rms"), unit),
        "at the end": _measured(float(run.velocity_error[-1]), unit),
    }
    if summary.get("efficiency") is not None:
        tiles["over the Cramér-Rao bound"] = page.number(summary["efficiency"])
    if run.has_begun_wrong:
        tiles["at the start"] = _measured(float(run.velocity_error[0]), unit)
        tiles["found to one percent after"] = quantity("found_from_s", summary.get("found_from_s"))
    if "attitude_rms_rad" in summary:
        tiles["angle to the reference, RMS once settled"] = quantity("attitude_rms_rad", summary["attitude_rms_rad"])
        tiles["settled on the reference after"] = quantity("settled_at_s", summary.get("settled_at_s"))
    ending = verdict(run)
    sentence = f"{ending[0].upper()}{ending[1:]}{why(summary)}. What moves: {subject(run)}."
    return Headline(title, sentence, is_good(run), tiles)


def _measured(value: float | None, unit: str) -> str:
    return page.UNKNOWN if value is None else f"{amount(float(value))} {unit}"


def _pictures(run: LagrangianRun) -> list[Markup]:
    moment = sum(highlight(run)) / 2.0
    drawn = f" The errors of its position are drawn {run.magnification:,.0f} times as large as they are."
    note = drawn if run.magnification > 1.0 else ""
    blocks = [
        still_block(
            run.directory, "panel", moment, f"What moves and its estimate, {moment:.2f} s after the start.",
            f"After {moment:.2f} s: truth and estimate, and the velocity up to then.{note}",
        )
    ]  # fmt: skip
    if run.space is not None:
        where = "in Poincaré's disc" if run.space == "hyperbolic-plane" else "on the sphere"
        words = f"Truth and estimate {where}, and the geodesic from one to the other.{note}"
        blocks.append(page.figure_block(figures.path_figure(run), "path", words))
    return blocks


def _errors(run: LagrangianRun) -> list[Drawn]:
    words = "Each component of the velocity, true and estimated."
    drawn = [("velocity", figures.velocity_figure(run), words)]
    words = "The error of the velocity, moved in parallel to where the system is, its components, and the distance."
    if run.space == "body":
        words += " The distance of attitudes is half the angle between them."
    drawn.append(("errors", figures.errors_figure(run), words))
    B = run.lyapunov_gain
    if B is not None:
        words = (
            f"V = |Δv|²/2 + B S and W = |Δv|²/2 + 3/2 B |s|² − √B ⟨s, Δv⟩ with B = {B:g} 1/s²: with constant gains it "
            "is W that shows that the velocity converges too."
        )
        drawn.append(("lyapunov", figures.lyapunov_figure(run, B), words))
    return drawn


def _signals(run: LagrangianRun) -> list[Drawn]:
    words = "What acted on it"
    if run.innovation is not None:
        words += ", and the distance between each reading and its prediction"
    return [("signals", figures.signals_figure(run), f"{words}."), *event_figures(run, run.duration)]
