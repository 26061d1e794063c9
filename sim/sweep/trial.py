"""Trial: the task of a sweep that flies one specification of a run. Its key is the hash of its content.

The computing environment is part of the key. A trial may name a measure, a function at "package.module:function" that
computes figures from the ``RunData``, which holds the whole log. The figures are added to the summary, and the log is
not kept.

A field may be drawn again for every trial, by a generator that is seeded by the trial's seed and the field's name, so
that it does not depend on what else is varied.
"""

from __future__ import annotations

import importlib
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.interfaces.input_files import Digests
from mathnavi.sim.records.computing_environment import environment, in_environment
from mathnavi.sim.records.figure_names import is_wall_clock
from mathnavi.sim.records.origins import Origin
from mathnavi.sim.records.run_spec import Plugin, RunSpec
from mathnavi.sim.records.store import Record, canonical_json

if TYPE_CHECKING:
    from mathnavi.sim.scenarios.closed_loop import ClosedLoop, RunData


@dataclass(frozen=True)
class Uniform:
    """Interval from which a field is drawn again for every trial, both ends included."""

    name: str  # of the field
    low: Any
    high: Any

    def draw(self, seed: int) -> Any:
        rng = np.random.default_rng([seed, zlib.crc32(self.name.encode())])
        if isinstance(self.low, int):
            return int(rng.integers(self.low, self.high, endpoint=True))
        return float(rng.uniform(self.low, self.high))


@dataclass(frozen=True)
class Trial:
    """Run of a specification that any process can repeat, with what is measured of it."""

    spec: RunSpec
    measure: str = ""  # "package.module:function" of the outcome

    WALL_TIME: ClassVar[str] = "trial_wall_s"

    @staticmethod
    def from_document(document: Mapping[str, Any]) -> Trial:
        """Return the trial that a ``document`` holds; errors as of ``RunSpec.from_document``."""
        return Trial(RunSpec.from_document(document), document.get("measure", ""))

    @property
    def document(self) -> dict[str, Any]:
        """All of it as plain data."""
        return self.spec.document | self._measured

    @property
    def seed(self) -> int:
        """Seed of every random draw."""
        return self.spec.seed

    @property
    def parameters(self) -> dict[str, Any]:
        """Return all resolved fields as plain data, and the digests of the files that fields name."""
        return self.spec.parameters() | self._measured

    @property
    def code(self) -> str:
        """Version of the code that it runs."""
        return self.spec.code(*([_function(self.measure)] if self.measure else []))

    @property
    def content(self) -> str:
        """Hash of scenario, parameters, seed and code."""
        return contents([self])[0]

    @property
    def key(self) -> str:
        """Hash of the content and of the environment of this process."""
        return in_environment(self.content)

    def build(self) -> ClosedLoop:
        """Build the closed loop, ready to run; errors as of ``RunSpec.build``."""
        closed_loop: ClosedLoop = self.spec.build()
        return closed_loop

    def flown(self) -> RunData:
        """Run it; return the result with the whole log."""
        closed_loop = self.build()
        with self.spec.failures("a run"):
            return closed_loop.run()

    def run(self) -> tuple[dict[str, Any], bool]:
        """Run it; return the summary with the figures of the measure, and whether the mission succeeded."""
        outcome = self.flown()
        measured = _function(self.measure)(outcome) if self.measure else {}
        return {**outcome.summary, **measured}, bool(outcome.success)

    def perform(self) -> dict[str, Any]:
        """Run it; return success, summary and timings as in a record. Raises TypeError for a summary that cannot be
        stored.
        """
        figures, success = self.run()
        timings = {
            name: None if figures[name] is None else float(figures[name]) for name in filter(is_wall_clock, figures)
        }
        kept = {name: value for name, value in figures.items() if name not in timings and name != "seed"}
        canonical_json(kept)
        return {"success": success, "summary": kept, "timings": timings}

    def record(
        self,
        content: str,
        status: str,
        *,
        success: bool | None = None,
        summary: Mapping[str, Any] | None = None,
        timings: Mapping[str, float | None] | None = None,
        error: str | None = None,
    ) -> Record:
        """Return the record of how it ended in this process, under the key that it has here."""
        named = (in_environment(content), self.spec.scenario, self.parameters, self.seed, self.code)
        origin = Origin(content, environment())
        return Record(*named, status, success, dict(summary or {}), dict(timings or {}), error, origin)

    def renamed(self, record: Record) -> Record:
        """Return the record of a trial of the same key, with the file names of this trial."""
        return replace(record, parameters=self.spec.parameters(record.parameters["inputs"]) | self._measured)

    @property
    def _measured(self) -> dict[str, str]:
        return {"measure": self.measure} if self.measure else {}


def trial(
    scenario: str = "safe-flight",
    seed: int = 0,
    controller: Plugin = None,
    estimator: Plugin = None,
    fields: Mapping[str, Any] | None = None,
    measure: str = "",
    **more: Any,
) -> Trial:
    """Build a trial with some fields set, those that are not at their defaults.

    ``fields`` are those of ``RunSpec.of``, ``more`` are those of the scenario that need no dot; ``measure`` is that of
    a Trial.

        trial(seed=3, terrain="jacksboro", fields={"faults.gust_rms": 1.5, "planner.nodes": 13})

    Raises ValueError for an unknown plug-in or field, and for a value of another type or out of its range.
    """
    return Trial(RunSpec.of(scenario, seed, controller, estimator, {**(fields or {}), **more}), measure)


def keys(trials: Sequence[Trial]) -> list[str]:
    """Return the keys of many trials in the environment of this process; errors as of ``contents``."""
    return [in_environment(content) for content in contents(trials)]


def contents(trials: Sequence[Trial]) -> list[str]:
    """Return the content hashes of many trials without building any of them; each file that they name is read once.

    Raises as the digest of a field does, for example FileNotFoundError for a missing file.
    """
    known: Digests = {}
    return [each.spec.content(known, each.code, **each._measured) for each in trials]


def named_files(trials: Sequence[Trial]) -> dict[tuple[str, str], str]:
    """Return the digest of each file that trials name, by the name of the field and its value; errors as of
    ``contents``.
    """
    known: Digests = {}
    return {(name, str(each.spec[name])): digest for each in trials for name, digest in each.spec.inputs(known).items()}


@cache
def _function(name: str) -> Callable[[Any], Mapping[str, Any]]:
    """Return the function at "package.module:function"."""
    module, _, attribute = name.partition(":")
    try:
        function: Callable[[Any], Mapping[str, Any]] = getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise ArgumentError(f"measure = {name!r}: {error}; allowed: package.module:function") from error
    return function
