"""Computations of several kinds, asked for by key and done by one pool of workers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from mathnavi.sim.studies.framework.parallel import computed
from mathnavi.sim.studies.framework.study import Setup


class Jobs:
    """Computations by key, so that one pool of workers does them all."""

    def __init__(self) -> None:
        self._jobs: list[tuple[Any, Callable[[Any], Any], Any]] = []  # key, function, argument

    def add(self, key: Any, function: Callable[[Any], Any], arguments: Sequence[Any]) -> None:
        """Ask for a function of each argument."""
        self._jobs += [(key, function, argument) for argument in arguments]

    def done(self, setup: Setup) -> dict[Any, list[Any]]:
        """What came of them, in their order."""
        results: dict[Any, list[Any]] = {}
        outcomes = computed(setup, _called, [(function, argument) for _, function, argument in self._jobs])
        for (key, _, _), outcome in zip(self._jobs, outcomes, strict=True):
            results.setdefault(key, []).append(outcome)
        return results


def _called(job: tuple[Callable[[Any], Any], Any]) -> Any:
    function, argument = job
    return function(argument)
