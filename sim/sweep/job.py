"""A job: a call of a module-level function with plain arguments, for computations that are no scenario.

The key of a job is the content hash of the function's place, the arguments, the seed and the installed sources, so a
result in a store is that of this very call. A result is plain data, dataclasses of it, and arrays
(``mathnavi.sim.records.encoding``). A duration is returned as a ``MeasuredTime``, which a store keeps apart.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from mathnavi.sim.interfaces.reading.files import parsed
from mathnavi.sim.records.encoding import Encoded, at_place, decoded, encoded, place_of
from mathnavi.sim.records.jobs import JobRecord
from mathnavi.sim.records.store import canonical_json
from mathnavi.sim.sweep.code import code_version


@dataclass(frozen=True)
class Job:
    """A call that any process can make; ``job`` builds it."""

    function: str  # "package.module:function"
    arguments: str  # JSON of the positional arguments and of those by name
    seed: int = 0

    WALL_TIME: ClassVar[str] = "job_wall_s"

    @property
    def code(self) -> str:
        """The version of the code that it runs."""
        return code_version(at_place(self.function))

    @property
    def key(self) -> str:
        """The content hash of function, arguments, seed and code."""
        called = canonical_json([self.function, self.arguments, self.seed, self.code])
        return hashlib.sha256(called.encode()).hexdigest()

    def call(self) -> Any:
        """Call the function in this process, and return what it returns."""
        positional, named = decoded(Encoded(parsed(self.arguments, self.function, ValueError)))
        return at_place(self.function)(*positional, **named)

    def perform(self) -> dict[str, Any]:
        """Call the function; its result as a record has it. TypeError for a result that cannot be stored."""
        coded = encoded(self.call())
        return {"result": _text(coded.tree), "arrays": coded.arrays, "timings": dict(coded.timings)}

    def record(
        self,
        key: str,
        status: str,
        *,
        result: str | None = None,
        arrays: bytes | None = None,
        timings: Mapping[str, float | None] | None = None,
        error: str | None = None,
    ) -> JobRecord:
        """The record of how it ended."""
        called = (key, self.function, self.arguments, self.seed, self.code)
        return JobRecord(*called, status, result, arrays, dict(timings or {}), error)


def job(function: Callable[..., Any], *arguments: Any, seed: int = 0, **named: Any) -> Job:
    """A call of ``function``, with ``seed`` for the global generators of the process that makes it.

        job(rate_on, RateCase("ring", 8, seed=0))

    Raises ValueError for a function that is not found by its name from another process, and TypeError for arguments
    that are no plain data: numbers, texts, lists, tuples, mappings, and dataclasses of them.
    """
    coded = encoded((arguments, named))
    if coded.arrays is not None or coded.timings:
        raise TypeError(f"{place_of(function)}: an argument is a large array or a timing; allowed: plain data")
    return Job(place_of(function), _text(coded.tree), seed)


def job_keys(jobs: Sequence[Job]) -> list[str]:
    """The keys of many jobs."""
    return [each.key for each in jobs]


def _text(tree: Any) -> str:
    return json.dumps(tree, sort_keys=False, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
