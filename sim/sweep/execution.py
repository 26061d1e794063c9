"""Trials in parallel, into a store: what it lacks is run, what ends is committed at once, the rest may stop any time.

    trials -> keys -> those that the store lacks -> workers (threads, each with a child process; or Dask) -> one writer

Order and number of workers change nothing in a record.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from queue import Empty, SimpleQueue
from typing import Protocol

from sim.store import Record, Store, StoreError
from sim.sweep.child import StoppedError, Worker, module_path
from sim.sweep.trial import Trial, keys

Told = Record | BaseException | None  # None: a worker waits until numba has compiled its kernels


@dataclass(frozen=True)
class Progress:
    """How far a sweep is."""

    total: int  # trials, each counted once
    found: int  # of them, in the store before
    done: int  # and those too
    failed: int  # of those that were run now: did not run to their end
    unsuccessful: int  # ran to their end, but the mission did not do what it should
    compiling: bool  # a worker has waited for numba, which happens once on a machine


class Backend(Protocol):
    """What runs trials somewhere; it tells of each as it ends, from threads of its own."""

    def start(self, jobs: Mapping[str, Trial], timeout: float | None, tell: Callable[[Told], None]) -> None: ...

    def stop(self) -> None:
        """End at once. Nothing is told afterwards."""
        ...


def run_trials(
    trials: Sequence[Trial],
    store: Store,
    *,
    workers: int = 1,
    cluster: str | None = None,
    timeout: float | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> list[Record]:
    """Run the trials whose keys the store lacks, store each as it ends; the records in the order of ``trials``.

    A trial that raises, crashes or takes longer than ``timeout`` [s] is a record too. ``workers`` processes run on this
    machine, or, with the address of a Dask scheduler for ``cluster``, one for every thread of the cluster's workers.
    Whatever ends the sweep before its time, Ctrl-C too, leaves everything that has ended in the store; the same call
    goes on from there. A trial that is asked for twice runs once.

    Raises ValueError for bad arguments and a cluster that does not answer, StoreError if the store can no longer be
    written, RefusedError if the sources or a file have changed since the keys were made, and LostError if the cluster
    is gone.
    """
    if workers < 1:
        raise ValueError(f"workers = {workers!r}; allowed: a whole number >= 1")
    if timeout is not None and not (math.isfinite(timeout) and timeout > 0.0):
        raise ValueError(f"timeout = {timeout!r}; allowed: a finite number of seconds > 0")
    asked = keys(trials)
    stored = store.keys()
    jobs = {key: trial for key, trial in zip(asked, trials, strict=True) if key not in stored}
    if jobs:
        _run(jobs, store, _backend(workers, cluster), timeout, len(set(asked)), progress or (lambda _: None))
    return store.records(asked)


def _backend(workers: int, cluster: str | None) -> Backend:
    if cluster is None:
        return LocalWorkers(workers)
    from sim.sweep.cluster import DaskCluster  # Dask is an extra

    return DaskCluster(cluster)


def _run(
    jobs: Mapping[str, Trial],
    store: Store,
    backend: Backend,
    timeout: float | None,
    total: int,
    progress: Callable[[Progress], None],
) -> None:
    told: SimpleQueue[Told] = SimpleQueue()
    now = Progress(total, total - len(jobs), total - len(jobs), 0, 0, False)
    progress(now)
    messages: list[Told] = []  # and not yet stored
    try:
        backend.start(jobs, timeout, told.put)
        while now.done < total:
            messages = [told.get(), *_rest(told)]  # commits wait for the disk, so all there is goes into one
            now = _stored(store, messages, now)
            progress(now)
            fault = next((message for message in messages if isinstance(message, BaseException)), None)
            messages = []
            if fault is not None:
                raise fault
    except StoreError:
        raise
    except BaseException:
        backend.stop()
        _stored(store, [*messages, *_rest(told)], now)
        progress(replace(now, done=total - len(jobs.keys() - store.keys())))
        raise
    finally:
        backend.stop()


def _stored(store: Store, messages: Sequence[Told], before: Progress) -> Progress:
    """Commit what has ended, and count it."""
    ended = [message for message in messages if isinstance(message, Record)]
    store.add(*ended)
    return replace(
        before,
        done=before.done + len(ended),
        failed=before.failed + sum(record.status != "ok" for record in ended),
        unsuccessful=before.unsuccessful + sum(record.success is False for record in ended),
        compiling=before.compiling or None in messages,
    )


def _rest(told: SimpleQueue[Told]) -> list[Told]:
    rest: list[Told] = []
    try:
        while True:
            rest.append(told.get_nowait())
    except Empty:
        return rest


class LocalWorkers:
    """Threads of this process, each with a child process that runs the trials."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._workers: list[Worker] = []
        self._threads: list[threading.Thread] = []

    def start(self, jobs: Mapping[str, Trial], timeout: float | None, tell: Callable[[Told], None]) -> None:
        waiting: SimpleQueue[tuple[str, Trial]] = SimpleQueue()
        for job in jobs.items():
            waiting.put(job)

        def work(worker: Worker) -> None:
            try:
                while True:
                    key, trial = waiting.get_nowait()
                    tell(worker.run(trial, key, timeout))
            except (Empty, StoppedError):
                pass
            except BaseException as error:
                tell(error)
            finally:
                worker.close()

        for _ in range(min(self._count, len(jobs))):
            worker = Worker(module_path(), compiling=lambda: tell(None))
            thread = threading.Thread(target=work, args=(worker,), daemon=True)
            self._workers.append(worker)
            self._threads.append(thread)
            thread.start()

    def stop(self) -> None:
        for worker in self._workers:
            worker.stop()
        for thread in self._threads:
            thread.join()
