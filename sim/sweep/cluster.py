"""Backend for trials and jobs on a Dask cluster: the same child processes, one for every thread of its workers.

The workers need the same version of mathnavi, and the files that tasks name under the same names, and unless
environments are mixed the same computing environment. Workers that differ are left out, by a line of the log that says
how; only where none matches the sweep ends. Workers are looked for all the time, so that one that joins has its share,
and one that dies costs only time: its tasks run elsewhere, and only a task that has killed several workers is recorded
as crashed. When a sweep ends, the child processes that run no task end too.
"""

from __future__ import annotations

import asyncio
import importlib
import logging
import math
import os
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.plugin.code_version import code_version
from mathnavi.sim.records.computing_environment import difference, environment
from mathnavi.sim.sweep.child import RefusedError, Worker, module_path
from mathnavi.sim.sweep.distribution import Distribution
from mathnavi.sim.sweep.task import Ended, Message, SweepTask

PATIENCE = 5.0  # [s] for the scheduler to answer
SURVEY = 1.0  # [s] between two looks for workers
RETURN = 30.0  # [s] for the last worker that matched to be started again, where others are left
MOST_NAMED = 3  # of the workers that differ in the same way
OTHER_ENVIRONMENT = "another computing environment"
HOW_TO_INSTALL = "a cluster needs the extra `cluster`: pip install 'mathnavi[cluster]'"
_ALLOWED = (
    "allowed: the address of a Dask scheduler that answers, tcp://HOST:8786, or tls://HOST:8786 with the certificates "
    "that Dask is configured with"
)


_log = logging.getLogger(__name__)


class RefusingWorkerError(RuntimeError):
    """Refusal of a worker to run a task; the arguments are its address and what differs there."""

    def __init__(self, worker: str, differing: str) -> None:
        super().__init__(worker, differing)
        self.worker, self.differing = worker, differing


class LostError(RuntimeError):
    """Loss of the cluster, or of its ability to run tasks."""


def check(address: str) -> None:
    """Raise ArgumentError if Dask is missing, or if no scheduler answers at ``address``."""
    try:
        with ThreadPoolExecutor(1) as aside:  # this thread may have its own event loop
            kind = aside.submit(asyncio.run, _kind(address, _dask())).result()
    except ModuleNotFoundError as error:
        raise ArgumentError(f"cluster = {address!r}: {HOW_TO_INSTALL}") from error
    except Exception as error:
        raise ArgumentError(f"cluster = {address!r}: {str(error) or type(error).__name__}; {_ALLOWED}") from error
    if kind != "Scheduler":
        raise ArgumentError(f"cluster = {address!r} is a {kind}; {_ALLOWED}")


def _dask() -> Any:
    return importlib.import_module("distributed")


async def _kind(address: str, distributed: Any) -> str:
    """Return the kind of server at an address; a whole client without a scheduler would take long to give up."""
    arguments = distributed.Security().get_connection_args("client")
    async with distributed.rpc(address, timeout=PATIENCE, connection_args=arguments) as other:
        return str((await asyncio.wait_for(other.identity(), 2.0 * PATIENCE))["type"])


class DaskCluster:
    """Backend with a client, the workers that match and those that do not, and the tasks that have not ended."""

    def __init__(self, address: str, mix_environments: bool = False) -> None:
        self._address = address
        self._environment = {} if mix_environments else dict(environment())
        check(address)
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # LostError says what it would say
        self._client = _dask().Client(address, timeout=PATIENCE, set_as_default=False)
        self._guard = threading.RLock()
        self._tasks: Mapping[str, SweepTask] = {}
        self._distribution = Distribution(())
        self._futures: dict[str, Any] = {}  # of the tasks that workers hold
        self._others: dict[str, str] = {}  # workers that do not match, and what differs
        self._left_at = -math.inf  # [s] when a worker that matches was last seen to be gone
        self._run: Callable[..., Ended] = execute
        self._report: Callable[[Message], None] = lambda _: None
        self._stopping = threading.Event()
        self._watch = threading.Thread(target=self._look_again, daemon=True)

    def start(self, tasks: Mapping[str, SweepTask], timeout: float | None, report: Callable[[Message], None]) -> None:
        with self._guard:
            self._run = partial(execute, timeout=timeout, folder=os.getcwd(), path=own_path(), needed=self._environment)
            self._tasks, self._report = tasks, report
            self._distribution = Distribution(tasks)  # whose workers are asked again: others may have their addresses
        self._look()
        if not self._watch.is_alive():
            self._watch.start()

    def stop(self) -> None:
        if self._stopping.is_set():
            return
        self._stopping.set()
        closing = threading.Thread(target=self._close, daemon=True)  # a cluster that is gone does not answer
        closing.start()
        closing.join(PATIENCE)
        self._client.close(timeout=PATIENCE)

    def _close(self) -> None:
        with suppress(Exception):  # the cluster may be gone
            with self._guard:
                futures = list(self._futures.values())
            self._client.cancel(futures)
            self._client.run(close_idle_workers, on_error="ignore")

    def _look_again(self) -> None:
        while not self._stopping.wait(SURVEY):
            if not self._distribution.done:
                self._look()

    def _look(self) -> None:
        """Give tasks to the workers that have joined, and those of workers that are gone to others."""
        try:
            present = self._client.scheduler_info()["workers"]
            with self._guard:
                known = {*self._distribution.workers, *self._others}
            differences = self._differences([worker for worker in present if worker not in known])
            with self._guard:
                for worker in known - present.keys():
                    if self._others.pop(worker, None) is None:
                        self._left_at = time.monotonic()
                        self._leave(worker)
                for worker, differing in differences.items():
                    if not differing:
                        self._distribution.join(worker, present[worker]["nthreads"])
                self._leave_out({worker: differing for worker, differing in differences.items() if differing})
            self._give()
        except Exception as error:
            self._report(self._lost(error))

    def _differences(self, workers: Sequence[str]) -> dict[str, str]:
        """Return by worker what keeps it from taking part, "" if nothing; those that do not answer are not in it."""
        if not workers:
            return {}
        found = {}
        for worker, answer in self._client.run(described, workers=workers, on_error="return").items():
            if isinstance(answer, tuple):
                version, other = answer[0], difference(answer[1]) if self._environment else ""
                found[worker] = f"{OTHER_ENVIRONMENT}, {other}" if other else ""
                if version != code_version():
                    found[worker] = f"other sources, mathnavi {version} (here {code_version()})"
            elif not isinstance(answer, OSError):  # as of one that has just left
                found[worker] = f"mathnavi does not run there, {type(answer).__name__}: {answer}"
        return found

    def _leave_out(self, others: Mapping[str, str]) -> None:
        """Name workers that do not match, and end the sweep where no others are left, or come back."""
        new = {worker: differing for worker, differing in others.items() if worker not in self._others}
        self._others.update(new)
        for worker in new:
            self._leave(worker)
        if self._others and not self._distribution.workers and time.monotonic() - self._left_at > RETURN:
            self._report(_no_worker(self._others))
        elif new:
            _log.warning("the cluster at %s: left out %s", self._address, _listed(new))

    def _give(self) -> None:
        """Submit waiting tasks to workers that have room for them."""
        with self._guard:
            if self._stopping.is_set():
                return
            for content, workers in self._distribution.give():
                future = self._client.submit(
                    self._run, self._tasks[content], content, workers=workers, allow_other_workers=False, pure=False
                )
                self._futures[content] = future
                future.add_done_callback(partial(self._ended, content))

    def _leave(self, worker: str) -> None:
        back, fatal = self._distribution.leave(worker)
        self._client.cancel([self._futures.pop(content) for content in (*back, *fatal)])
        for content in fatal:
            self._report(self._killed(content))

    def _ended(self, content: str, future: Any) -> None:
        with self._guard:
            given = content in self._futures and self._futures[content] is future
            if self._stopping.is_set() or not given:  # it has been given out anew
                return
            self._futures.pop(content)
            try:
                message: Message = future.result()
            except RefusingWorkerError as error:
                self._distribution.take_back(content)
                self._leave_out({error.worker: error.differing})
                message = None
            except _dask().KilledWorker:
                message = self._killed(content)
            except BaseException as error:
                message = self._lost(error)
            future.release()
            if message is not None:
                self._distribution.end(content)
                self._report(message)
        self._give()

    def _killed(self, content: str) -> Ended:
        error = "several workers of the cluster died while they ran this task"
        record: Ended = self._tasks[content].record(content, "crashed", error=error)
        return record

    def _lost(self, error: BaseException) -> LostError:
        return LostError(f"the cluster at {self._address}: {type(error).__name__}: {error}")


def _listed(others: Mapping[str, str]) -> str:
    """Return workers and what differs, those that differ in the same way together."""
    alike: dict[str, list[str]] = {}
    for worker, differing in others.items():
        alike.setdefault(differing, []).append(worker)
    parts = []
    for differing, workers in alike.items():
        more = f" and {len(workers) - MOST_NAMED} more" if len(workers) > MOST_NAMED else ""
        parts.append(f"{', '.join(workers[:MOST_NAMED])}{more} ({differing})")
    return "; ".join(parts)


def _no_worker(others: Mapping[str, str]) -> RefusedError:
    """Return the error for a cluster of workers that all differ."""
    environments = [differing.startswith(OTHER_ENVIRONMENT) for differing in others.values()]
    allowed = ["the same environment, or --mix-environments"] if any(environments) else []
    if not all(environments):
        allowed.append("the same sources and files: after a change of the sources, restart the workers of the cluster")
    return RefusedError(f"no worker of the cluster matches: {_listed(others)}; allowed: {'; '.join(allowed)}")


def described() -> tuple[str, dict[str, str]]:
    """Return the version of the code, and the computing environment, of the process that calls it, a Dask worker."""
    return code_version(), dict(environment())


def own_path() -> list[str]:
    """Return the folders of the user's modules: the part of ``sys.path`` outside the Python installation."""
    folders = [Path(entry).resolve() for entry in module_path()]
    installed = [Path(folder).resolve() for folder in (sys.prefix, sys.base_prefix)]
    return [str(folder) for folder in folders if not any(map(folder.is_relative_to, installed))]


Place = tuple[str | None, tuple[str, ...]]  # where a child process works, and where it finds its modules

_idle: list[tuple[Place, Worker]] = []  # of this Dask worker: what runs no task now
_guard = threading.Lock()


def execute(
    task: SweepTask,
    content: str,
    *,
    timeout: float | None,
    folder: str,
    path: list[str],
    needed: Mapping[str, str],
) -> Ended:
    """Run a task in a child process of this Dask worker, from the client's folder if it is there too.

    Raises RefusingWorkerError if its code or its files are not those of the task, or if the computing environment is
    not the ``needed`` one, if given: the worker was started again since it was asked.
    """
    dask_worker = _dask().get_worker()
    if needed and (other := difference(needed)):
        raise RefusingWorkerError(dask_worker.address, f"{OTHER_ENVIRONMENT}, {other.replace('(here', '(there')}")
    known = module_path()
    place = (folder if os.path.isdir(folder) else None, (*known, *(entry for entry in path if entry not in known)))
    running = dask_worker.get_current_task()

    def cancelled() -> bool:  # by the client, or because the client is gone
        state = dask_worker.state.tasks.get(running)
        return state is None or state.state == "cancelled"

    worker = _taken(place)
    try:
        return worker.run(task, content, timeout, cancelled)
    except RefusedError as error:
        raise RefusingWorkerError(dask_worker.address, str(error).removeprefix("a worker has ")) from error
    finally:
        with _guard:
            _idle.append((place, worker))


def close_idle_workers() -> None:
    """End the child processes of this Dask worker that run no task; those of another sweep go on."""
    with _guard:
        idle = [worker for _, worker in _idle]
        _idle.clear()
    for worker in idle:
        worker.close()


def _taken(place: Place) -> Worker:
    """Return an idle worker of that place, or a new one."""
    with _guard:
        for k, (its_place, worker) in enumerate(_idle):
            if its_place == place:
                del _idle[k]
                return worker
    return Worker(place[1], folder=place[0])
