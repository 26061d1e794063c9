"""Search for holes in the guarantee: is there a mission that violates it unannounced?

Four directed searches minimise the margin of clearance, separation and deadline, excluding violations that an event
announced. Whether such a search would find a hole is measured on four controllers that have one (``guarantee_holes``),
the mutants: by the number of missions until it is found, compared with random draws. The controller ``flight``, which
has all checks, is searched in the same spaces.

The spaces are in ``hunt_spaces``. In further searches the vehicles have third-party parts that misbehave
(``hostile_parts``, ``hostile_fleet``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from statistics import median
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mathnavi.interfaces.bounds import Count, configuration
from mathnavi.renders.study_report import Table
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.search.directed import directed
from mathnavi.sim.search.evaluation import Evaluation, Evaluator, Objective
from mathnavi.sim.search.samplers import SamplerName
from mathnavi.sim.sweep.execution import Pool, Progress
from mathnavi.studies.flight.hunt_spaces import HOLES, HOSTILE, HUNTS, HoledHunt, Hunt
from mathnavi.studies.framework.drawing import styled_figure
from mathnavi.studies.framework.study import Setup, StudyError, StudyResult

MARGIN = Objective("relative_margin")
FEWEST = 2000  # missions of a hunt from which its claim is judged
FEWEST_OF_STRANGERS = 800  # likewise, of a hunt with plug-ins that misbehave
ENOUGH = 200  # missions within which a search has to find a hole
BATCH = 8  # missions that a search proposes at a time
SAMPLER: SamplerName = "sobol-cmaes"  # of all searches
BELOW = -1e-3  # [m], or tracking bounds, of the margin of clearance, that no rounding explains
COLOURS = ("#2166ac", "#e08214", "#1a9850", "#8a4fd0")


@configuration
class HuntConfig:
    """Sample sizes: missions that are flown."""

    missions: Count = FEWEST
    """number of missions of each of four searches"""
    hostile: Count = FEWEST_OF_STRANGERS
    """number of missions of each search with plug-ins that misbehave"""
    tries: Count = ENOUGH
    """largest number of missions of a search for the hole of a mutant"""
    draws: Count = 400
    """largest number of random draws for the hole of a mutant"""
    repeats: Count = 3
    """number of searches for each hole, and of lots of random draws"""
    compare: tuple[SamplerName, ...] = ()
    """samplers whose searches for each hole are counted as well"""


class HuntStudy:
    """Directed searches for a mission that violates the guarantee without an event that announces it."""

    Config = HuntConfig
    quick = HuntConfig(missions=8, hostile=8, tries=8, draws=8, repeats=1)
    title = "The hunt for holes in the guarantee"
    on_terrain = False

    @staticmethod
    def run(config: HuntConfig, setup: Setup) -> StudyResult:
        with Pool(setup.workers, setup.cluster) as pool:
            search = partial(_searched, setup, pool)
            found = {hunt.name: search(hunt, MARGIN, config.missions) for hunt in HUNTS}
            strangers = {hunt.name: search(hunt, MARGIN, config.hostile) for hunt in HOSTILE}
            holes = [_hole_found(search, holed, config) for holed in HOLES]
        rows = [_row(name, evaluations) for name, evaluations in found.items()]
        strange_rows = [_row(name, evaluations) for name, evaluations in strangers.items()]
        hole_rows = [hole.row for hole in holes]
        return StudyResult(
            summary=(
                f"{config.missions} missions of directed search in each of {len(HUNTS)} scenarios, over noise, "
                "gusts, faults, bounds, heights, seeds and what changes on the way. What is minimised is the least of "
                "the margins of clearance, separation and deadline, each relative to its bound; a violation that an "
                "event has announced counts as none. The mutants are controllers with one check left out each; their "
                "hole is found when a mission comes below h_min. The controller flight is searched in the same "
                "spaces, with as many missions. In further searches planner, tracker and estimator are those of "
                "strangers, in a fleet also coordinator and consensus, which raise, answer nonsense, lie, or change "
                "what they were given, at random instants. An episode of an environment is flown as a run behind the "
                "filter, to which a policy proposes its actions.",
                *_violations({**found, **strangers}),
            ),
            rows=[*rows, *strange_rows, *hole_rows],
            tables=(
                _table("Searches for a silent violation", rows),
                _table("Searches with plug-ins that misbehave", strange_rows),
                _hole_table(hole_rows),
                *([_sampler_table(holes)] if config.compare else []),
            ),
            figure=_figure(found, holes),
            caption="The least margin so far, over the missions of a search; missions until a hole is found, by search "
            "and by random draws, an arrow where none was.",
            claims=[*_claims(rows, holes), _hostile_claim(strange_rows)],
        )  # fmt: skip


# ---- what was found


@dataclass(frozen=True)
class Hole:
    """Missions until the hole of a mutant was found, by each search and lot of random draws; None if it was not."""

    name: str
    searches: tuple[int | None, ...]
    draws: tuple[int | None, ...]
    most_draws: int
    of_product: tuple[int | None, ...]
    """missions until a violation of the product was found, by each search in the same space; None if it was not"""
    compared: Mapping[SamplerName, tuple[int | None, ...]] = field(default_factory=dict)
    """missions until the hole was found, by each search of each of the samplers that are compared"""

    @property
    def median(self) -> float:
        """Missions of the median search; inf if it found nothing."""
        return _median(self.searches)

    @property
    def drawn(self) -> int:
        """Total number of missions in all lots of random draws."""
        return sum(self.most_draws if count is None else count for count in self.draws)

    @property
    def mean_draws(self) -> float:
        """Mean number of random draws until the hole is found, of a geometric distribution; inf without a find."""
        found = sum(count is not None for count in self.draws)
        return self.drawn / found if found else math.inf

    @property
    def shown(self) -> bool:
        """True if a search finds the hole sooner than random draws, and none in the product.

        The median search takes less than ``ENOUGH`` missions, and less than random draws take in the mean.
        """
        return self.median < min(ENOUGH, self.mean_draws) and not any(self.of_product)

    @property
    def row(self) -> dict[str, Any]:
        """Row of the study's table."""
        return {
            "hunt": self.name, "searches": _counts(self.searches), "draws": _counts(self.draws),
            "mean_draws": self.mean_draws if math.isfinite(self.mean_draws) else None,
            "product": _counts(self.of_product),
        }  # fmt: skip

    @property
    def text(self) -> str:
        """All counts as text."""
        row, mean = self.row, self.mean_draws
        drawn = f"{mean:.0f}" if math.isfinite(mean) else f"more than {self.drawn}"
        return f"{self.name}: {row['searches']} against {drawn} draws; product: {row['product']}"


def _median(counts: Sequence[int | None]) -> float:
    """Return the median, in which a search that found nothing counts as infinitely long."""
    return median(math.inf if count is None else float(count) for count in counts)


def _counts(counts: Sequence[int | None]) -> str:
    return ", ".join("not found" if count is None else str(count) for count in counts)


def _flown(found: Sequence[Evaluation]) -> list[tuple[Evaluation, dict[str, Any]]]:
    """Return the missions that were flown, with their summaries."""
    return [(each, each.record.summary) for each in found if each.ending == "flown" and each.record is not None]


def _row(name: str, found: Sequence[Evaluation]) -> dict[str, Any]:
    flown = [summary for _, summary in _flown(found)]
    return {
        "hunt": name,
        "missions": len(found),
        "flown": len(flown),
        "refused": sum(each.ending == "refused" for each in found),
        "failed": sum(each.ending == "failed" for each in found),
        "violated": sum(each["violated"] for each in flown),
        "silently_violated": sum(each["silently_violated"] for each in flown),
        "least_margin": min(each["relative_margin"] for each in flown),
        "least_clearance_m": min(each["clearance_margin_m"] for each in flown),
    }


def _violations(found: dict[str, list[Evaluation]]) -> list[str]:
    """Return a sentence for each hunt with silent violations: their kinds, and the worst mission."""
    sentences = []
    for name, evaluations in found.items():
        flown = _flown(evaluations)
        silent = [(each, summary) for each, summary in flown if summary["silently_violated"]]
        if not silent:
            continue
        worst, summary = min(silent, key=lambda pair: pair[1]["relative_margin"])
        kinds = sorted({str(summary["violation"]) for _, summary in silent})
        fields = ", ".join(f"{field} = {value}" for field, value in worst.values.items())
        sentences.append(
            f"{name}: {rate(len(silent), len(flown)).text()} violate {', '.join(kinds)} without an event before; the "
            f"worst at {summary['violation_s']:.2f} s: {fields}."
        )
    return sentences


def _table(title: str, rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of(title, rows, (
        ("search", "hunt"), ("missions", "missions"), ("refused", "refused"), ("failed", "failed"),
        ("violated", "violated"), ("of them silently", "silently_violated"),
        ("least relative margin", "{least_margin:.3g}"), ("least margin of clearance", "{least_clearance_m:.2f} m"),
    ))  # fmt: skip


def _hole_table(rows: Sequence[dict[str, Any]]) -> Table:
    return Table.of("Missions until the hole of a mutant is found", rows, (
        ("mutant", "hunt"), ("missions of each search", "searches"), ("random draws of each lot", "draws"),
        ("draws in the mean", lambda row: "inf" if row["mean_draws"] is None else f"{row['mean_draws']:.0f}"),
        ("in the product", "product"),
    ))  # fmt: skip


def _sampler_table(holes: Sequence[Hole]) -> Table:
    rows = [
        {"hunt": hole.name, "sampler": sampler, "searches": _counts(counts), "median": _median(counts)}
        for hole in holes
        for sampler, counts in {SAMPLER: hole.searches, **hole.compared}.items()
    ]
    return Table.of("Missions until the hole is found, by sampler", rows, (
        ("mutant", "hunt"), ("sampler", "sampler"), ("missions of each search", "searches"), ("median", "{median:.0f}"),
    ))  # fmt: skip


def _claims(rows: Sequence[dict[str, Any]], holes: Sequence[Hole]) -> list[Claim]:
    total, failed, violated, silent = (
        sum(row[name] for row in rows) for name in ("missions", "failed", "violated", "silently_violated")
    )
    return [
        Claim(
            "search.safe", "target", "A directed search finds no violation that is not announced before it happens.",
            "Propositions A.2 and A.3", f"none in {FEWEST} missions in each of {len(HUNTS)} scenarios",
            f"{silent} silent of {total} missions, {violated} violations in all; {failed} failed; least relative "
            f"margin {min(row['least_margin'] for row in rows):.3g}",
            silent == 0 and failed == 0,
        ),
        Claim(
            "search.power", "target",
            "The search finds the hole of a controller that lacks one check, sooner than random draws do.",
            "beyond the thesis",
            f"median of the searches under {ENOUGH} missions, and under the mean of random draws; none in the product",
            "; ".join(hole.text for hole in holes), all(hole.shown for hole in holes),
        ),
    ]  # fmt: skip


def _hostile_claim(rows: Sequence[dict[str, Any]]) -> Claim:
    flown, refused, failed, violated, silent = (
        sum(row[name] for row in rows) for name in ("flown", "refused", "failed", "violated", "silently_violated")
    )
    return Claim(
        "search.hostile", "target",
        "Whatever a stranger's planner, tracker, estimator, coordinator or consensus answers, no bound is broken that "
        "is said to be kept.",
        "beyond the thesis", f"none of {FEWEST_OF_STRANGERS} missions in each of {len(HOSTILE)} scenarios",
        f"{silent} silent of {flown} missions that were flown, {violated} violations in all; {refused} refused for "
        f"their bounds, {failed} failed",
        silent == 0 and failed == 0,
    )  # fmt: skip


def _figure(found: dict[str, list[Evaluation]], holes: Sequence[Hole]) -> Figure:
    with styled_figure((9.4, 3.6)) as figure:
        left, right = figure.subplots(1, 2)
        for (name, evaluations), colour in zip(found.items(), COLOURS, strict=True):
            margins = np.array([np.nan if each.figure is None else each.figure for each in evaluations])
            best = np.fmin.accumulate(np.clip(margins, -1.0, 1.0))
            left.step(np.arange(1, len(best) + 1), best, where="post", color=colour, label=name)
        left.axhline(0.0, ls=":", color="#5a6876")
        left.set(xlabel="mission", ylabel="least relative margin", title="Searches")
        left.legend(fontsize=8)
        for k, hole in enumerate(holes):
            for counts, most, colour, shift in (
                (hole.searches, ENOUGH, COLOURS[0], -0.12), (hole.draws, hole.most_draws, COLOURS[1], 0.12)
            ):  # fmt: skip
                for count in counts:
                    right.plot(count or most, k + shift, ">" if count is None else "o", color=colour, ms=6.0)
        right.axvline(ENOUGH, ls=":", color="#5a6876")
        right.set_yticks(range(len(holes)), [hole.name for hole in holes])
        right.set(xscale="log", xlabel="missions until the hole is found", title="Holes: search (blue), draws (orange)")
        right.invert_yaxis()
    return figure


# ---- searches


def _searched(
    setup: Setup, pool: Pool, hunt: Hunt, objective: Objective, missions: int, **named: Any
) -> list[Evaluation]:
    """Return the evaluations of one search; StudyError if no mission could be flown.

    ``named`` are ``sampler``, ``seed`` and ``until`` of ``directed``.
    """

    def report(now: Progress) -> None:
        if setup.progress is not None:
            done = len(evaluator.evaluations)
            setup.progress(replace(now, total=missions, found=done, done=done + now.done))

    evaluator = Evaluator(
        hunt.make, objective, setup.store, pool, retry=True, progress=report,
        mix_environments=setup.mix_environments, elsewhere=setup.elsewhere,
    )  # fmt: skip
    found = directed(evaluator, hunt.space, missions, batch=BATCH, **named)
    if not any(each.ending == "flown" for each in found):
        raise StudyError(f"{hunt.name}: none of {len(found)} missions could be flown; the first: {found[0].reason}")
    return found


def _hole_found(search: Callable[..., list[Evaluation]], holed: HoledHunt, config: HuntConfig) -> Hole:
    """Search for a hole, draw missions at random until it is found, and search for one in the product."""
    objective = Objective(holed.figure)

    def counts(hunt: Hunt, sampler: SamplerName, most: int) -> tuple[int | None, ...]:
        """Return the number of missions until the hole is found, of each repetition; None if it is not."""
        lots = [
            search(hunt, objective, most, sampler=sampler, seed=seed, until=BELOW) for seed in range(config.repeats)
        ]
        return tuple(
            next((each.number + 1 for each in lot if objective.reached(each.figure, BELOW)), None) for lot in lots
        )

    return Hole(
        holed.mutant.name,
        counts(holed.mutant, SAMPLER, config.tries),
        counts(holed.mutant, "random", config.draws),
        config.draws,
        counts(holed.product, SAMPLER, config.tries),
        {sampler: counts(holed.mutant, sampler, config.tries) for sampler in config.compare},
    )
