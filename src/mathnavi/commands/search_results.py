"""Results of a search: print them, draw them on a page, and fly the worst missions again."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mathnavi.commands.trial_command import command_of
from mathnavi.commands.worst_runs import fly_again, report_link
from mathnavi.interfaces.short_tables import counted
from mathnavi.sim.records.figure_names import SHORTFALL, label
from mathnavi.sim.records.sweep_data import format_value
from mathnavi.sim.search.evaluation import Evaluation, Objective
from mathnavi.sim.search.rare import REDRAW, RareEvent
from mathnavi.sim.search.space import Dimension

PRINTED, LISTED = 5, 20  # of the worst missions, in the terminal and on the page


@dataclass(frozen=True)
class SearchResults:
    """Result of a search."""

    scenario: str
    objective: Objective
    space: Sequence[Dimension]
    evaluations: Sequence[Evaluation]
    until: float | None
    rare: RareEvent | None
    importances: Mapping[str, float]
    command: str  # that repeats it

    def worst(self, count: int) -> list[Evaluation]:
        """Return the most extreme missions that were flown, each trial once."""
        once: dict[str, Evaluation] = {}
        for each in self.objective.best(self.evaluations):
            if each.record is not None:
                once.setdefault(each.record.key, each)
        return list(once.values())[:count]

    def number(self, ending: str) -> int:
        """Return the number of evaluations that ended with this outcome."""
        return sum(each.ending == ending for each in self.evaluations)

    @property
    def verdict(self) -> str:
        """Return a sentence: the number of missions, and how they ended."""
        violated = sum(each.violated for each in self.evaluations)
        return (
            f"{counted(len(self.evaluations), 'mission')}: {self.number('flown')} flown, {violated} of them "
            f"unsuccessful, {self.number('refused')} refused, {self.number('failed')} failed"
        )

    @property
    def finding(self) -> str:
        """Return a sentence: the extreme figure, or the probability of the event."""
        name, unit = label(self.objective.key)
        if self.rare is not None:
            return _probability(self.rare, name, unit, self.objective.largest)
        if not (best := self.worst(1)):
            return f"no mission was flown to its end: {name} is not known"
        figure = f"{best[0].figure:.6g} {unit}".strip()
        words = (
            f"{'largest' if self.objective.largest else 'least'} {name} {figure}, found by mission {best[0].number + 1}"
        )
        if self.until is None:
            return words
        first = next((e.number for e in self.evaluations if self.objective.reached(e.figure, self.until)), None)
        reached = "is not reached" if first is None else f"was reached by mission {first + 1}"
        return f"{words}; {self.until:g} {unit}".rstrip() + f" {reached}"


def _probability(rare: RareEvent, name: str, unit: str, largest: bool) -> str:
    p = rare.probability
    event = f"{name} {'>=' if largest else '<='} {rare.level:.6g} {unit}".strip()
    interval = f"[{p.low:.2g}, {p.high:.2g}] ({100.0 * p.confidence:g} %, {p.repetitions} repetitions)"
    if rare.reached:
        return f"P({event}) = {p.value:.3g} {interval}"
    return f"not reached: the nearest level that every repetition came to is P({event}) = {p.value:.3g} {interval}"


def print_results(console: Console, results: SearchResults) -> None:
    """Print the finding, the worst missions, and the importance of the fields."""
    console.print(f"{results.scenario}, {results.verdict}", style="bold", highlight=False, soft_wrap=True)
    console.print(results.finding, highlight=False, soft_wrap=True)
    if worst := results.worst(PRINTED):
        table = Table(box=None, padding=(0, 2, 0, 0))
        name, unit = label(results.objective.key)
        shown = _shown(results)
        for column in ("mission", f"{name} [{unit}]" if unit else name, *shown, SHORTFALL):
            table.add_column(Text(column), overflow="fold")
        for each in worst:
            table.add_row(
                *map(Text, (str(each.number + 1), f"{each.figure:.6g}", *_cells(each, shown), _shortfall(each)))
            )
        console.print()
        console.print(table)
        console.print(
            f"\nagain   {command_of(worst[0].trial)}" if worst[0].trial else "", soft_wrap=True, highlight=False
        )
    if results.importances:
        words = ", ".join(f"{name} {100.0 * share:.0f} %" for name, share in results.importances.items())
        console.print(f"weight  {words}", soft_wrap=True, highlight=False)
    reasons = [each for each in results.evaluations if each.ending == "failed"]
    for each in reasons[:PRINTED]:
        console.print(f"failed  mission {each.number + 1}: {each.reason}", soft_wrap=True, highlight=False)


def write_worst(results: SearchResults, folder: Path, count: int, page: Path | None = None) -> list[Path]:
    """Fly the worst missions again, each into its own folder: worst-1, worst-2, ...

    Each names the search that it belongs to, with its ``page``, if it has one.
    """
    search = f"the search {'' if page is None else page.stem} ({results.scenario}"
    trials = [(f"{search}, mission {each.number + 1})", each.trial) for each in results.worst(count) if each.trial]
    return fly_again(trials, folder, page)


def write_pages(results: SearchResults, store: Path, worst: Sequence[Path] = ()) -> list[Path]:
    """Write the page and the picture next to the store, with links to the reports of the ``worst`` runs."""
    from mathnavi.renders.page import Markup
    from mathnavi.renders.search_report import Point, SearchPage, write_search_report  # slow to import

    def mission(k: int, number: int) -> str | Markup:
        return report_link(store, worst[k], str(number)) if k < len(worst) else str(number)

    points = [
        Point(
            number=each.number,
            values={name: value for name, value in each.values.items() if name != REDRAW},
            ending=each.ending,
            figure=math.nan if each.figure is None else each.figure,
            violated=each.violated,
        )
        for each in results.evaluations
    ]
    known = [each for each in results.worst(LISTED) if each.trial is not None]
    rows = [
        (
            mission(k, each.number + 1),
            f"{each.figure:.6g}",
            *_cells(each, _shown(results)),
            _shortfall(each),
            "" if each.trial is None else command_of(each.trial),
        )
        for k, each in enumerate(known)
    ]
    lines = [
        (str(each.number + 1), each.ending, ", ".join(_cells(each, _shown(results))), each.reason)
        for each in results.evaluations
        if each.ending != "flown"
    ]
    page = SearchPage(
        title=f"{results.scenario}: {results.finding}",
        key=results.objective.key,
        largest=results.objective.largest,
        until=results.until,
        verdict=results.verdict,
        finding=results.finding,
        points=points,
        importances=results.importances,
        curves=[] if results.rare is None else [(each.levels, each.probabilities) for each in results.rare.repetitions],
        varied=_shown(results),
        worst=rows,
        unflown=lines,
        command=results.command,
    )
    return write_search_report(store, page)


def _shown(results: SearchResults) -> list[str]:
    """Return the fields that are shown, the most important first."""
    names = [dimension.name for dimension in results.space]
    return sorted(names, key=lambda name: -results.importances.get(name, 0.0))


def _cells(evaluation: Evaluation, names: Sequence[str]) -> list[str]:
    return [format_value(evaluation.values[name]) for name in names]


def _shortfall(evaluation: Evaluation) -> str:
    return "" if evaluation.record is None else str(evaluation.record.summary.get(SHORTFALL, ""))
