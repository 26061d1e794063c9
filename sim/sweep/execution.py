"""Execution of trials and jobs in parallel, into a store.

Tasks that the store lacks are run, each is committed when it ends, and the execution may stop at any time.

    tasks -> hashes -> those that the store lacks -> workers (threads, each with a child process; or Dask) -> one writer

A record does not depend on the order and the number of workers.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from queue import Empty, SimpleQueue

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.records.computing_environment import difference, environment_digest
from mathnavi.sim.records.jobs import JobRecord
from mathnavi.sim.records.origins import Elsewhere
from mathnavi.sim.records.store import TRANSIENT, Ending, Record, Store, StoreWriteError
from mathnavi.sim.sweep.child import OtherEnvironmentError, StoppedError, Worker, module_path
from mathnavi.sim.sweep.cluster import DaskCluster
from mathnavi.sim.sweep.job import Job
from mathnavi.sim.sweep.task import Backend, Ended, Message, SweepTask
from mathnavi.sim.sweep.trial import Trial, contents


@dataclass(frozen=True)
class Progress:
    """Counts of the tasks of a sweep."""

    total: int  # tasks, each counted once
    found: int  # of them, in the store before
    done: int  # and those too
    failed: int  # of those that are done: tasks that did not run to their end
    unsuccessful: int  # ran to their end, but the mission failed
    compiling: bool  # a worker has waited for numba, which happens once on a machine


def run_trials(
    trials: Sequence[Trial],
    store: Store,
    *,
    workers: int = 1,
    cluster: str | None = None,
    timeout: float | None = None,
    retry: bool = False,
    progress: Callable[[Progress], None] | None = None,
    pool: Pool | None = None,
    mix_environments: bool = False,
    elsewhere: Elsewhere | None = None,
) -> list[Record]:
    """Run the trials whose keys the store lacks, store each as it ends, and return the records in the order of
    ``trials``.

    A trial that raises, crashes or takes longer than ``timeout`` [s] is a record too. With ``retry``, trials that the
    store records as crashed or timed out are run again, and their records replaced. ``workers`` processes run on this
    machine, or, with the address of a Dask scheduler for ``cluster``, one for every thread of the cluster's workers;
    with a ``pool``, those of the pool, which stay for the next call.
    Records of another computing environment, with other versions or another kind of processor, may differ from those
    of this one, by rounding and more, so they are ignored, and workers of a cluster in another one are left out. With
    ``mix_environments`` both are accepted; ``elsewhere`` counts the stored ones.
    If the sweep ends early, by Ctrl-C too, everything that has ended is in the store; the same call resumes from there.
    A trial that is requested twice runs once. The returned records name files as ``trials`` do, though the store may
    have their content under other names.

    Raises ValueError for bad arguments and a cluster that does not answer, StoreWriteError if the store can no longer
    be written, RefusedError if the sources or a file have changed since the keys were made, or if no worker of the
    cluster matches, and LostError if the cluster is gone.
    """
    asked = contents(trials)
    tasks: dict[str, SweepTask] = dict(zip(asked, trials, strict=True))
    run = _Run(workers, cluster, timeout, retry, progress, pool, mix_environments)
    keys = run.missing(tasks, store.endings(), store, elsewhere)
    records = store.records(keys[content] for content in asked)
    return [trial.renamed(record) for trial, record in zip(trials, records, strict=True)]


def run_jobs(
    jobs: Sequence[Job],
    store: Store,
    *,
    workers: int = 1,
    cluster: str | None = None,
    timeout: float | None = None,
    retry: bool = False,
    progress: Callable[[Progress], None] | None = None,
    mix_environments: bool = False,
    elsewhere: Elsewhere | None = None,
) -> list[JobRecord]:
    """Run the jobs whose keys the store lacks, store each as it ends, and return the records in the order of ``jobs``.

    Arguments, interruption and exceptions as for ``run_trials``.
    """
    asked = [each.content for each in jobs]
    tasks: dict[str, SweepTask] = dict(zip(asked, jobs, strict=True))
    run = _Run(workers, cluster, timeout, retry, progress, None, mix_environments)
    keys = run.missing(tasks, store.job_endings(), store, elsewhere)
    return store.jobs(keys[content] for content in asked)


@dataclass(frozen=True)
class _Run:
    """Execution of the tasks that a store lacks."""

    workers: int
    cluster: str | None
    timeout: float | None
    retry: bool
    progress: Callable[[Progress], None] | None
    pool: Pool | None
    mix_environments: bool

    def __post_init__(self) -> None:
        if self.workers < 1:
            raise ArgumentError(f"workers = {self.workers!r}; allowed: a whole number >= 1")
        if self.timeout is not None and not (math.isfinite(self.timeout) and self.timeout > 0.0):
            raise ArgumentError(f"timeout = {self.timeout!r}; allowed: a finite number of seconds > 0")

    def missing(
        self,
        tasks: Mapping[str, SweepTask],
        endings: Mapping[str, Ending],
        store: Store,
        elsewhere: Elsewhere | None,
    ) -> dict[str, str]:
        """Run the tasks that the store lacks, with ``retry`` also those that crashed or timed out.

        ``tasks`` are by their content hashes, ``endings`` by keys. Returns the keys of the records of all tasks.
        """
        stored = store.keys_of(tasks, self.mix_environments, elsewhere)
        ended = {content: endings[key] for content, key in stored.items()}
        found = {content: end for content, end in ended.items() if not (self.retry and end.status in TRANSIENT)}
        if missing := {content: task for content, task in tasks.items() if content not in found}:
            backend = self.pool or _backend(self.workers, self.cluster, self.mix_environments)
            sweep = _Sweep(missing, found, store, self.retry, self.progress or (lambda _: None), self.mix_environments)
            sweep.run(backend, self.timeout)
            stored = store.keys_of(tasks, self.mix_environments)
        return stored


def _backend(workers: int, cluster: str | None, mix_environments: bool) -> Backend:
    return LocalWorkers(workers) if cluster is None else DaskCluster(cluster, mix_environments)


class Pool:
    """Pool of workers that stay while several lists of trials are run, so that no child process starts twice.

    with Pool(workers=2) as pool:
        run_trials(some, store, pool=pool)
        run_trials(others, store, pool=pool)
    """

    def __init__(self, workers: int = 1, cluster: str | None = None, mix_environments: bool = False) -> None:
        """Start the pool; with ``mix_environments`` workers of the cluster may compute in another environment.

        Raises ArgumentError for fewer workers than one, and for the address of a cluster that does not answer.
        """
        if workers < 1:
            raise ArgumentError(f"workers = {workers!r}; allowed: a whole number >= 1")
        self._backend = _backend(workers, cluster, mix_environments)
        self._running: set[str] = set()  # content hashes

    def start(self, tasks: Mapping[str, SweepTask], timeout: float | None, report: Callable[[Message], None]) -> None:
        self._running = set(tasks)

        def reported(message: Message) -> None:
            if isinstance(message, Ended):
                self._running.discard(message.origin.content)
            report(message)

        self._backend.start(tasks, timeout, reported)

    def stop(self) -> None:
        """End all running tasks at once; idle workers stay."""
        if self._running:
            self._backend.stop()

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self._backend.stop()


def available_cores() -> int:
    """Return the number of the processor's cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _Sweep:
    """Receiver of the reports of a backend, which stores them."""

    def __init__(
        self,
        tasks: Mapping[str, SweepTask],
        found: Mapping[str, Ending],
        store: Store,
        retry: bool,
        progress: Callable[[Progress], None],
        mix_environments: bool,
    ) -> None:
        self._tasks, self._store, self._retry, self._progress = tasks, store, retry, progress
        self._mix_environments = mix_environments
        self._pending = set(tasks)
        total = len(tasks) + len(found)
        self._now = _counted(Progress(total, len(found), len(found), 0, 0, False), found.values())

    def run(self, backend: Backend, timeout: float | None) -> None:
        messages: list[Message] = []  # and not yet stored
        queue: SimpleQueue[Message] = SimpleQueue()
        self._progress(self._now)
        try:
            backend.start(self._tasks, timeout, queue.put)
            while self._pending:
                messages = [queue.get(), *_rest(queue)]  # commits wait for the disk, so one takes all messages
                self._take(messages)
                fault = next((message for message in messages if isinstance(message, BaseException)), None)
                messages = []
                if fault is not None:
                    raise fault
        except StoreWriteError:
            raise
        except BaseException:
            backend.stop()
            self._take([*messages, *_rest(queue)])
            raise
        finally:
            backend.stop()

    def _take(self, messages: Sequence[Message]) -> None:
        """Commit the tasks that have ended, and count each once though it may be reported twice.

        Raises OtherEnvironmentError for a result from another environment, unless environments are mixed.
        """
        ended = [message for message in messages if isinstance(message, Ended)]
        self._store.add(*ended, retried=self._retry)
        other = next((record.origin for record in ended if record.origin.digest != environment_digest()), None)
        if other is not None and not self._mix_environments:
            raise OtherEnvironmentError.from_difference(difference(other.environment))
        new = [record for record in ended if record.origin.content in self._pending]
        self._pending.difference_update(record.origin.content for record in new)
        now = _counted(self._now, [Ending(record.status, record.success) for record in new])
        self._now = replace(now, done=now.total - len(self._pending), compiling=now.compiling or None in messages)
        self._progress(self._now)


def _counted(before: Progress, endings: Collection[Ending]) -> Progress:
    """Add the endings to the counts of failures."""
    return replace(
        before,
        failed=before.failed + sum(ending.status != "ok" for ending in endings),
        unsuccessful=before.unsuccessful + sum(ending.success is False for ending in endings),
    )


def _rest(queue: SimpleQueue[Message]) -> list[Message]:
    rest: list[Message] = []
    try:
        while True:
            rest.append(queue.get_nowait())
    except Empty:
        return rest


class LocalWorkers:
    """Backend of threads of this process, each with a child process that runs the tasks and stays until ``stop``."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._workers: list[Worker] = []
        self._threads: list[threading.Thread] = []

    def start(self, tasks: Mapping[str, SweepTask], timeout: float | None, report: Callable[[Message], None]) -> None:
        waiting: SimpleQueue[tuple[str, SweepTask]] = SimpleQueue()
        for item in tasks.items():
            waiting.put(item)

        def work(worker: Worker) -> None:
            try:
                while True:
                    content, task = waiting.get_nowait()
                    report(worker.run(task, content, timeout, compiling=lambda: report(None)))
            except (Empty, StoppedError):
                pass
            except BaseException as error:
                report(error)

        needed = min(self._count, len(tasks))
        self._workers += [Worker(module_path()) for _ in range(needed - len(self._workers))]
        for thread in self._threads:  # each has found nothing more to do in the list before
            thread.join()
        self._threads = [threading.Thread(target=work, args=(each,), daemon=True) for each in self._workers[:needed]]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        for worker in self._workers:
            worker.stop()
        for thread in self._threads:
            thread.join()
        for worker in self._workers:
            worker.close()
