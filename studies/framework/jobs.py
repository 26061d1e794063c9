"""Computations of several kinds, asked for by key and done by one pool of workers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from mathnavi.sim.sweep.job import Job
from mathnavi.studies.framework.study import Setup, call


class Jobs:
    """Computations by key, so that one pool of workers does them all."""

    def __init__(self) -> None:
        self._jobs: list[tuple[Any, Job]] = []

    def add(self, key: Any, function: Callable[..., Any], arguments: Iterable[Any], **named: Any) -> None:
        """Ask for a module-level function of each argument; ``named`` are passed on with every one of them."""
        self._jobs += [(key, call(function, argument, **named)) for argument in arguments]

    def done(self, setup: Setup) -> dict[Any, list[Any]]:
        """The results by key, in the order in which they were asked for; StudyError as for ``Setup.perform``."""
        results: dict[Any, list[Any]] = {}
        for (key, _), result in zip(self._jobs, setup.perform([each for _, each in self._jobs]), strict=True):
            results.setdefault(key, []).append(result)
        return results
