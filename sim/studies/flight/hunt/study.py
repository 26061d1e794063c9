"""A hunt for holes in the guarantee: is there a mission that violates it without a word?

Four directed searches look for the least margin of clearance, separation and deadline that no event has announced the
loss of. Whether such a search would find a hole is measured on four controllers that have one (``mutants``): how many
missions it takes, and how many random draws take. The product's controller is searched in the same spaces.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import median
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from mathnavi.renders.figures import STYLE
from mathnavi.renders.study_report import Table
from mathnavi.sim.interfaces.bounds import Count, configuration
from mathnavi.sim.records.claims import Claim
from mathnavi.sim.records.statistics import rate
from mathnavi.sim.search.directed import Sampler, directed
from mathnavi.sim.search.evaluation import Evaluation, Evaluator, Objective
from mathnavi.sim.studies.flight.hunt.spaces import HOLES, HUNTS, HoledHunt, Hunt
from mathnavi.sim.studies.framework.study import Setup, StudyError, StudyResult
from mathnavi.sim.sweep.execution import Pool, Progress

MARGIN = Objective("relative_margin")
FEWEST = 2000  # missions of a hunt from which its claim is judged
ENOUGH = 200  # missions within which a search has to find a hole
SEED, BATCH = 0, 8
COLOURS = ("#2166ac", "#e08214", "#1a9850", "#8a4fd0")


@configuration
class HuntConfig:
    """Sample sizes: missions that are flown."""

    missions: Count = FEWEST
    """of each of four searches"""
    tries: Count = ENOUGH
    """at most, of a search for the hole of a mutant"""
    draws: Count = 400
    """at most, of a lot of random draws for the same"""
    repeats: Count = 3
    """searches for each hole, and as many lots of random draws"""


class HuntStudy:
    """Directed searches for a mission that violates the guarantee without an event that says so."""

    Config = HuntConfig
    quick = HuntConfig(missions=8, tries=8, draws=8, repeats=1)
    title = "The hunt for holes in the guarantee"
    on_terrain = False

    @staticmethod
    def run(config: HuntConfig, setup: Setup) -> StudyResult:
        with Pool(setup.workers, setup.cluster) as pool:
            hunter = Hunter(setup, pool)
            found = {hunt.name: hunter.searched(hunt, MARGIN, config.missions) for hunt in HUNTS}
            holes = [_hole(hunter, hunt, config) for hunt in HOLES]
        rows = [_row(hunt, found[hunt.name]) for hunt in HUNTS]
        silent = sum(row["silently_violated"] for row in rows)
        total, failed = sum(row["missions"] for row in rows), sum(row["failed"] for row in rows)
        return StudyResult(
            summary=(
                f"{config.missions} missions of directed search (TPE) in each of {len(HUNTS)} scenarios, over noise, "
                "gusts, faults, bounds, heights, seeds and what changes on the way. What is minimised is the least of "
                "the margins of clearance, separation and deadline, each relative to its bound; a violation that an "
                "event has announced counts as none. The mutants are controllers with one check left out each; their "
                "hole is found when a mission comes below h_min. The product's controller is searched in the same "
                "spaces, with as many missions.",
                *_violations(found),
            ),
            rows=[*rows, *(hole.row for hole in holes)],
            tables=(_table(rows), _hole_table(holes)),
            figure=_figure(found, holes),
            caption="The least margin so far, over the missions of a search; missions until a hole is found, by search "
            "and by random draws, an arrow where none was.",
            claims=(
                Claim(
                    "search.safe", "target",
                    "A directed search finds no violation that is not announced before it happens.",
                    "Propositions A.2 and A.3", f"none in {FEWEST} missions in each of {len(HUNTS)} scenarios",
                    f"{silent} silent of {total} missions, {sum(row['violated'] for row in rows)} violations in all; "
                    f"{failed} failed; least relative margin {min(row['least_margin'] for row in rows):.3g}",
                    silent == 0 and failed == 0,
                ),
                Claim(
                    "search.power", "target",
                    "The search finds the hole of a controller that lacks one check, sooner than random draws do.",
                    "beyond the thesis",
                    f"in under {ENOUGH} missions each (median of the searches), where random draws need more (mean); "
                    "none in the product",
                    "; ".join(hole.text for hole in holes), all(hole.shown for hole in holes),
                ),
            ),
        )  # fmt: skip


# ---- searches


class Hunter:
    """Searches in the store of a study."""

    def __init__(self, setup: Setup, pool: Pool) -> None:
        self._setup, self._pool = setup, pool

    def searched(
        self,
        hunt: Hunt,
        objective: Objective,
        missions: int,
        *,
        sampler: Sampler = "tpe",
        seed: int = SEED,
        until: float | None = None,
    ) -> list[Evaluation]:
        """The evaluations of one search; StudyError where no mission could be flown."""
        progress = self._setup.progress

        def report(now: Progress) -> None:
            if progress is not None:
                done = len(evaluator.evaluations)
                progress(replace(now, total=missions, found=done, done=done + now.done))

        evaluator = Evaluator(hunt.make, objective, self._setup.store, self._pool, retry=True, progress=report)
        found = directed(evaluator, hunt.space, missions, sampler=sampler, seed=seed, batch=BATCH, until=until)
        if not any(each.ending == "flown" for each in found):
            raise StudyError(f"{hunt.name}: none of {len(found)} missions could be flown; the first: {found[0].reason}")
        return found


@dataclass(frozen=True)
class Hole:
    """Missions until the hole of a mutant was found, by each search and by each lot of random draws; None: not."""

    name: str
    searches: tuple[int | None, ...]
    draws: tuple[int | None, ...]
    most_draws: int
    of_product: tuple[int | None, ...]
    """likewise, by each search in the same space with the product's controller"""

    @property
    def median(self) -> float:
        """Missions of the median search; inf where that found nothing."""
        return median(math.inf if count is None else float(count) for count in self.searches)

    @property
    def drawn(self) -> int:
        """Missions of all lots of random draws."""
        return sum(self.most_draws if count is None else count for count in self.draws)

    @property
    def mean_draws(self) -> float:
        """Missions that random draws take in the mean, the estimate of a geometric distribution; inf without a find."""
        found = sum(count is not None for count in self.draws)
        return self.drawn / found if found else math.inf

    @property
    def shown(self) -> bool:
        """True if the median search found it within ``ENOUGH`` missions, random draws need more, and no search found
        one in the product.
        """
        return self.median < ENOUGH < self.mean_draws and not any(self.of_product)

    @property
    def text(self) -> str:
        """All counts, to be read."""
        mean = f"{self.mean_draws:.0f}" if math.isfinite(self.mean_draws) else f"more than {self.drawn}"
        return f"{self.name}: {_counts(self.searches)} against {mean} draws; product: {_counts(self.of_product)}"

    @property
    def row(self) -> dict[str, Any]:
        """A line of the study's table."""
        return {
            "hunt": self.name, "searches": _counts(self.searches), "draws": _counts(self.draws),
            "mean_draws": self.mean_draws if math.isfinite(self.mean_draws) else None,
            "product": _counts(self.of_product),
        }  # fmt: skip


def _hole(hunter: Hunter, holed: HoledHunt, config: HuntConfig) -> Hole:
    """Search for a hole, draw for it, and search for one in the product."""
    objective = Objective(holed.figure)

    def counts(hunt: Hunt, sampler: Sampler, most: int) -> tuple[int | None, ...]:
        """Missions until the hole, of each repetition."""
        lots = [
            hunter.searched(hunt, objective, most, sampler=sampler, seed=SEED + repeat, until=BELOW)
            for repeat in range(config.repeats)
        ]
        return tuple(
            next((each.number + 1 for each in lot if objective.reached(each.figure, BELOW)), None) for lot in lots
        )

    return Hole(
        holed.mutant.name,
        counts(holed.mutant, "tpe", config.tries),
        counts(holed.mutant, "random", config.draws),
        config.draws,
        counts(holed.product, "tpe", config.tries),
    )


BELOW = -1e-3  # [m], or tracking bounds, of the margin of clearance, that no rounding explains


# ---- what was found


def _row(hunt: Hunt, found: Sequence[Evaluation]) -> dict[str, Any]:
    flown = [each.record.summary for each in found if each.ending == "flown" and each.record is not None]
    return {
        "hunt": hunt.name,
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
    """A sentence for each hunt with silent violations: which, and the first mission that shows it."""
    sentences = []
    for name, evaluations in found.items():
        flown = [(each, each.record.summary) for each in evaluations if each.ending == "flown" and each.record]
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


def _counts(counts: Sequence[int | None]) -> str:
    return ", ".join("not found" if count is None else str(count) for count in counts)


def _table(rows: Sequence[dict[str, Any]]) -> Table:
    columns = ("search", "missions", "refused", "failed", "violated", "of them silently", "least relative margin",
               "least margin of clearance")  # fmt: skip
    cells = [
        (
            row["hunt"], row["missions"], row["refused"], row["failed"], row["violated"], row["silently_violated"],
            f"{row['least_margin']:.3g}", f"{row['least_clearance_m']:.2f} m",
        )
        for row in rows
    ]  # fmt: skip
    return Table("Searches for a silent violation", columns, cells)


def _hole_table(holes: Sequence[Hole]) -> Table:
    columns = ("mutant", "missions of each search", "random draws of each lot", "draws in the mean", "in the product")
    cells = [
        (
            hole.name, _counts(hole.searches), _counts(hole.draws), f"{hole.mean_draws:.0f}", _counts(hole.of_product)
        )
        for hole in holes
    ]  # fmt: skip
    return Table("Missions until the hole of a mutant is found", columns, cells)


def _figure(found: dict[str, list[Evaluation]], holes: Sequence[Hole]) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.4, 3.6), layout="constrained")
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
