"""Distribution of tasks over workers that join, leave and refuse: which task is where, and where the next one goes.

A task waits, or is with one worker. Each worker holds no more than runs at once and as many again, so that it never
waits for the next one, and one that joins soon has its share.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterable

AHEAD = 2  # tasks for each thread of a worker
MOST_DEATHS = 3  # of workers under one task, as Dask has it


class Distribution:
    """Tasks, by their names, and the workers that hold them, by their addresses."""

    def __init__(self, tasks: Iterable[str]) -> None:
        self._waiting = deque(tasks)
        self._held: dict[str, set[str]] = {}
        self._room: dict[str, int] = {}
        self._deaths: Counter[str] = Counter()

    @property
    def workers(self) -> list[str]:
        """Addresses of the workers that take tasks."""
        return list(self._held)

    @property
    def done(self) -> bool:
        """True if no task waits or is with a worker."""
        return not self._waiting and not any(self._held.values())

    def join(self, worker: str, threads: int) -> None:
        """Give tasks to a worker from now on, or to one whose number of threads has changed; to none with 0 threads."""
        self._held.setdefault(worker, set())
        self._room[worker] = AHEAD * threads

    def take_back(self, worker: str, *, died: bool) -> tuple[list[str], list[str]]:
        """Let a worker go; return the tasks that it held: those that wait again, before all others, and, if it
        ``died``, those under which too many workers have.
        """
        held = sorted(self._held.pop(worker, ()))
        self._room.pop(worker, None)
        if died:
            self._deaths.update(held)
        fatal = [task for task in held if self._deaths[task] > MOST_DEATHS]
        back = [task for task in held if task not in fatal]
        self._waiting.extendleft(reversed(back))
        return back, fatal

    def end(self, worker: str, task: str) -> None:
        """Count a task that has ended no longer."""
        self._held.get(worker, set()).discard(task)

    def assign(self) -> list[tuple[str, str]]:
        """Give waiting tasks to the workers with room, the emptiest first; return the pairs of task and worker."""
        given = []
        while self._waiting:
            free = [worker for worker in self._held if len(self._held[worker]) < self._room[worker]]
            if not free:
                break
            worker = min(free, key=lambda each: len(self._held[each]) / self._room[each])
            task = self._waiting.popleft()
            self._held[worker].add(task)
            given.append((task, worker))
        return given
