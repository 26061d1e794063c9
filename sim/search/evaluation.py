"""Evaluations: missions flown at values of some fields, each an ordinary trial in an ordinary store.

An evaluation is *flown* if the mission ran to its end and its summary has the figure; *refused* if the mission
cannot be flown: a ``FieldError``, ``MissionError`` or ``TerrainError``, or a ``PluginError`` or another ``ValueError``
while it is built; *failed* if it did not run to its end for another reason, or has no such figure. None is left out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

from mathnavi.interfaces.errors import FieldError, MissionError, PluginError, TerrainError
from mathnavi.sim.records.figure_names import is_wall_clock
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.store import Record, Store
from mathnavi.sim.records.sweep_data import is_number
from mathnavi.sim.search.space import Values
from mathnavi.sim.sweep.execution import Pool, Progress, run_trials
from mathnavi.sim.sweep.trial import Trial

Ending = Literal["flown", "refused", "failed"]
REFUSALS = (FieldError, MissionError, PluginError, TerrainError)
_NAMES = {error: f"{error.__module__}.{error.__qualname__}: " for error in REFUSALS}
_FOUND_LATE = tuple(name for error, name in _NAMES.items() if error is not PluginError)  # some only in flight
_BUILDING = re.compile(r'records/run_spec\.py", line \d+, in build$', re.MULTILINE)  # a line of a traceback


@dataclass(frozen=True)
class Evaluation:
    """Evaluation of a mission at values of the fields, with its figure."""

    number: int  # in the order of the search, from 0
    values: Values
    ending: Ending
    figure: float | None  # None unless flown
    trial: Trial | None = None  # None if the configuration refuses the values
    record: Record | None = None
    reason: str = ""  # why it was refused, or failed

    @property
    def violated(self) -> bool:
        """True for a mission that was flown and did not succeed."""
        return self.record is not None and self.record.success is False


@dataclass(frozen=True)
class Objective:
    """Figure of the summary to minimise or to maximise."""

    key: str
    largest: bool = False

    def cost(self, figure: float) -> float:
        """Cost that is minimised."""
        return -figure if self.largest else figure

    def reached(self, figure: float | None, limit: float | None) -> bool:
        """Return True if a figure is at a limit or beyond it."""
        return figure is not None and limit is not None and self.cost(figure) <= self.cost(limit)

    def best(self, evaluations: Sequence[Evaluation]) -> list[Evaluation]:
        """Return the evaluations that were flown, the extreme ones first, equal ones in their order."""
        known = [(self.cost(each.figure), each) for each in evaluations if each.figure is not None]
        return [each for _, each in sorted(known, key=lambda pair: pair[0])]


class NoSuchFigureError(ValueError):
    """Error for a summary that has no figure with the name of the objective."""


@dataclass
class Evaluator:
    """Evaluator that flies missions and counts them."""

    make: Callable[[Values], Trial]
    objective: Objective
    store: Store
    pool: Pool
    timeout: float | None = None  # [s] of a mission
    retry: bool = False  # run those again that are stored as timed out or crashed
    progress: Callable[[Progress], None] | None = None  # of the missions of one call
    mix_environments: bool = False  # those that are stored from another computing environment count too
    elsewhere: Elsewhere = field(default_factory=Elsewhere)  # counts of those

    def __post_init__(self) -> None:
        if is_wall_clock(self.objective.key):
            raise NoSuchFigureError(
                f"{self.objective.key} is a wall-clock time, never the same; allowed: a figure that a seed repeats"
            )
        self.evaluations: list[Evaluation] = []

    def evaluate(self, points: Sequence[Values]) -> list[Evaluation]:
        """Fly the missions at these values that the store lacks; return the evaluations in the same order.

        Raises NoSuchFigureError if a summary has no figure of the objective's name at all, and as ``run_trials`` does.
        """
        made = [self._made(values) for values in points]
        trials = [each for each in made if isinstance(each, Trial)]
        flown = run_trials(
            trials, self.store, timeout=self.timeout, retry=self.retry, progress=self.progress, pool=self.pool,
            mix_environments=self.mix_environments, elsewhere=self.elsewhere,
        )  # fmt: skip
        records = iter(flown)
        first = len(self.evaluations)
        found = [
            self._judged(number, values, each, next(records))
            if isinstance(each, Trial)
            else Evaluation(number, values, "refused", None, reason=each)
            for number, (values, each) in enumerate(zip(points, made, strict=True), first)
        ]
        self.evaluations += found
        return found

    def count(self, ending: Ending) -> int:
        """Return the number of evaluations so far with this outcome."""
        return sum(each.ending == ending for each in self.evaluations)

    def _made(self, values: Values) -> Trial | str:
        """Return the trial, or why none can be made."""
        try:
            return self.make(values)
        except REFUSALS as error:
            return str(error)

    def _judged(self, number: int, values: Values, trial: Trial, record: Record) -> Evaluation:
        if record.status != "ok":
            error = record.error or record.status
            last = error.strip().splitlines()[-1]
            building = _BUILDING.search(error) is not None and last.startswith(("ValueError: ", *_NAMES.values()))
            refused = record.status == "raised" and (building or last.startswith(_FOUND_LATE))
            reason = last.partition(": ")[2] if refused else f"{record.status}: {last}"
            return Evaluation(number, values, "refused" if refused else "failed", None, trial, record, reason)
        if self.objective.key not in record.summary:
            known = ", ".join(name for name, value in record.summary.items() if is_number(value))
            raise NoSuchFigureError(f"{self.objective.key} is not a figure of {record.scenario}; allowed: {known}")
        figure = record.summary[self.objective.key]
        if not is_number(figure):
            reason = f"its {self.objective.key} is {figure!r}"
            return Evaluation(number, values, "failed", None, trial, record, reason)
        return Evaluation(number, values, "flown", float(figure), trial, record)
