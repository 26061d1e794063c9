"""Task, the unit of work of a worker process: a trial or a job; and the reports of a backend."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Protocol

from mathnavi.sim.records.jobs import JobRecord
from mathnavi.sim.records.store import Record

Ended = Record | JobRecord
Message = Ended | BaseException | None  # None: a worker waits until numba has compiled its kernels


class SweepTask(Protocol):
    """Computation that any process can repeat from the content of the task alone."""

    WALL_TIME: ClassVar[str]  # the timing under which the duration of the whole task is recorded

    @property
    def seed(self) -> int: ...

    @property
    def content(self) -> str:
        """Hash of the computation, its arguments, its seed and the installed sources."""
        ...

    @property
    def code(self) -> str:
        """Version of the code that it runs."""
        ...

    def perform(self) -> dict[str, Any]:
        """Compute; return the fields of the record that hold the result, including ``timings``."""
        ...

    @property
    def record(self) -> Callable[..., Any]:
        """Return record of how it ended, from a content hash, a status, and the fields of ``perform`` or ``error``."""
        ...


class Backend(Protocol):
    """Backend that runs tasks, and reports each as it ends, from its own threads."""

    def start(self, tasks: Mapping[str, SweepTask], timeout: float | None, report: Callable[[Message], None]) -> None:
        """Begin to run ``tasks``, given by their content hashes, each for at most ``timeout`` [s]."""
        ...

    def stop(self) -> None:
        """End all tasks at once. Nothing is reported afterwards."""
        ...
