"""Job: a call of a module-level function with plain arguments, for computations without a scenario.

The key of a job is the hash of the function's place, the arguments and the content of files that they name, the seed,
the installed sources and the environment, so a result in a store belongs to exactly this call. A result is plain data,
dataclasses of it, and arrays (``mathnavi.sim.records.encoding``). A duration is returned as a ``MeasuredTime``, which a
store keeps separately.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from mathnavi.interfaces.input_files import argument_digests
from mathnavi.interfaces.reading.files import parsed
from mathnavi.sim.plugin.code_version import code_version
from mathnavi.sim.plugin.trust import trusting
from mathnavi.sim.records.computing_environment import environment, in_environment
from mathnavi.sim.records.encoding import Encoded, at_place, decoded, encoded, place_of
from mathnavi.sim.records.jobs import JobRecord
from mathnavi.sim.records.origins import Origin
from mathnavi.sim.records.store import canonical_json


@dataclass(frozen=True)
class Job:
    """Call that any process can make; ``job`` builds it."""

    function: str  # "package.module:function"
    arguments: str  # JSON of the positional arguments and of those by name
    seed: int = 0

    WALL_TIME: ClassVar[str] = "job_wall_s"

    @property
    def code(self) -> str:
        """Version of the code that it runs."""
        return code_version(at_place(self.function))

    @property
    def content(self) -> str:
        """Hash of function, arguments, content of the files that they name, seed and code."""
        with trusting():  # likewise
            inputs = argument_digests(decoded(Encoded(parsed(self.arguments, self.function, ValueError))))
        called = canonical_json([self.function, self.arguments, inputs, self.seed, self.code])
        return hashlib.sha256(called.encode()).hexdigest()

    @property
    def key(self) -> str:
        """Hash of the content and of the environment of this process."""
        return in_environment(self.content)

    def call(self) -> Any:
        """Call the function in this process, and return what it returns."""
        with trusting():  # the caller that made the job has chosen its arguments
            positional, named = decoded(Encoded(parsed(self.arguments, self.function, ValueError)))
        return at_place(self.function)(*positional, **named)

    def perform(self) -> dict[str, Any]:
        """Call the function; return its result as in a record. Raises TypeError for a result that cannot be stored."""
        coded = encoded(self.call())
        return {"result": _text(coded.tree), "arrays": coded.arrays, "timings": dict(coded.timings)}

    def record(
        self,
        content: str,
        status: str,
        *,
        result: str | None = None,
        arrays: bytes | None = None,
        timings: Mapping[str, float | None] | None = None,
        error: str | None = None,
    ) -> JobRecord:
        """Return the record of how it ended in this process, under the key that it has here."""
        called = (in_environment(content), self.function, self.arguments, self.seed, self.code)
        origin = Origin(content, environment())
        return JobRecord(*called, status, result, arrays, dict(timings or {}), error, origin)


def job(function: Callable[..., Any], *arguments: Any, seed: int = 0, **named: Any) -> Job:
    """Build a call of ``function``, with ``seed`` for the global generators of the process that makes it.

        job(rate_on, RateCase("ring", 8, seed=0))

    Raises ValueError for a function that is not found by its name from another process, and TypeError for arguments
    that are not plain data: numbers, texts, lists, tuples, mappings, and dataclasses of them.
    """
    coded = encoded((arguments, named))
    if coded.arrays is not None or coded.timings:
        raise TypeError(f"{place_of(function)}: an argument is a large array or a timing; allowed: plain data")
    return Job(place_of(function), _text(coded.tree), seed)


def _text(tree: Any) -> str:
    return json.dumps(tree, sort_keys=False, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
