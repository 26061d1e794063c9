"""A task, the unit of work of a worker process: a trial or a job; and what a backend reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol

from mathnavi.sim.records.jobs import JobRecord
from mathnavi.sim.records.store import Record

Ended = Record | JobRecord
Message = Ended | BaseException | None  # None: a worker waits until numba has compiled its kernels


class SweepTask(Protocol):
    """A computation that any process can repeat from what the task itself says."""

    WALL_TIME: ClassVar[str]  # the timing under which the duration of the whole task is recorded

    @property
    def seed(self) -> int: ...

    @property
    def content(self) -> str:
        """The hash of what is computed, its arguments, its seed and the installed sources."""
        ...

    @property
    def code(self) -> str:
        """The version of the code that it runs."""
        ...

    def perform(self) -> dict[str, Any]:
        """Compute; the fields of the record that hold the result, ``timings`` among them."""
        ...

    @property
    def record(self) -> Callable[..., Any]:
        """Makes the record of how it ended: of a content hash, a status, and the fields of ``perform`` or ``error``."""
        ...


class Backend(Protocol):
    """Runs tasks somewhere, and reports each as it ends, from threads of its own."""

    def start(self, tasks: Mapping[str, SweepTask], timeout: float | None, report: Callable[[Message], None]) -> None:
        """Begin; ``tasks`` by their content hashes, each with at most ``timeout`` [s]."""
        ...

    def stop(self) -> None:
        """End at once. Nothing is reported afterwards."""
        ...
