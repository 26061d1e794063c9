"""Distribution of tasks over the workers of a cluster, which join and leave: which tasks wait, and which are given out.

A task is given to all workers that are there; the scheduler decides which of them runs it. No more are given out than
run at once and as many again: so no worker waits for the next one, and one that joins soon has its share.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable

AHEAD = 2  # tasks for each thread of a worker
MOST_DEATHS = 3  # of all workers of a task, as many as Dask allows of single ones


class Distribution:
    """Tasks, by their names, and the workers that take part, by their addresses."""

    def __init__(self, tasks: Iterable[str]) -> None:
        self._waiting = deque(tasks)
        self._given: dict[str, frozenset[str]] = {}  # to which workers
        self._threads: dict[str, int] = {}  # of each worker
        self._deaths: Counter[str] = Counter()

    @property
    def workers(self) -> list[str]:
        """Addresses of the workers that take part."""
        return list(self._threads)

    @property
    def done(self) -> bool:
        """True if no task waits or is given out."""
        return not (self._waiting or self._given)

    def join(self, worker: str, threads: int) -> None:
        """Let a worker take part that runs ``threads`` tasks at once."""
        self._threads[worker] = threads

    def leave(self, worker: str) -> tuple[list[str], list[str]]:
        """Let a worker go; return the tasks of which no worker is left: those that wait again, before all others, and
        those to which this has happened too often.
        """
        self._threads.pop(worker, None)
        lost = [task for task, workers in self._given.items() if workers.isdisjoint(self._threads)]
        self._deaths.update(lost)
        fatal = [task for task in lost if self._deaths[task] > MOST_DEATHS]
        for task in lost:
            if task in fatal:
                del self._given[task]
            else:
                self.take_back(task)
        return [task for task in lost if task not in fatal], fatal

    def take_back(self, task: str) -> None:
        """Let a task wait again, before all others."""
        del self._given[task]
        self._waiting.appendleft(task)

    def end(self, task: str) -> None:
        """Count a task that has ended no longer."""
        del self._given[task]

    def give(self) -> list[tuple[str, list[str]]]:
        """Give out as many waiting tasks as there is room for; return each with its workers."""
        room = AHEAD * sum(self._threads.values()) - len(self._given)
        given = [self._waiting.popleft() for _ in range(min(room, len(self._waiting)))]
        self._given.update(dict.fromkeys(given, frozenset(self._threads)))
        return [(task, self.workers) for task in given]
