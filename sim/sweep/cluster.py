"""Backend for trials and jobs on a Dask cluster: the same child processes, one for every thread of its workers.

The workers need the same version of mathnavi, and the files that tasks name under the same names; a worker with others
refuses, and so does one in another computing environment unless environments are mixed. A worker that dies costs
only time: Dask runs its tasks elsewhere, and only a task that has killed several workers is recorded as crashed.
When a sweep ends, the child processes that run no task end too.
"""

from __future__ import annotations

import asyncio
import importlib
import logging
import os
import sys
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from mathnavi.interfaces.errors import ArgumentError
from mathnavi.sim.records.computing_environment import difference, environment
from mathnavi.sim.sweep.child import OtherEnvironmentError, RefusedError, Worker, module_path
from mathnavi.sim.sweep.task import Ended, Message, SweepTask

PATIENCE = 5.0  # [s] for the scheduler to answer
HOW_TO_INSTALL = "a cluster needs the extra `cluster`: pip install -e '.[cluster]'"
_ALLOWED = (
    "allowed: the address of a Dask scheduler that answers, tcp://HOST:8786, or tls://HOST:8786 with the certificates "
    "that Dask is configured with"
)


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
    """Backend with a client, and the futures of the tasks that have not ended."""

    def __init__(self, address: str, mix_environments: bool = False) -> None:
        self._address = address
        self._environment = {} if mix_environments else dict(environment())
        check(address)
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # LostError says what it would say
        self._client = _dask().Client(address, timeout=PATIENCE, set_as_default=False)
        self._futures: list[Any] = []
        self._stopped = False

    def start(self, tasks: Mapping[str, SweepTask], timeout: float | None, report: Callable[[Message], None]) -> None:
        run = partial(execute, timeout=timeout, folder=os.getcwd(), path=own_path(), needed=self._environment)
        self._futures = self._client.map(run, list(tasks.values()), list(tasks), pure=False)
        for (content, task), future in zip(tasks.items(), self._futures, strict=True):
            future.add_done_callback(partial(self._ended, task, content, report))

    def stop(self) -> None:
        if self._stopped:
            return
        self._stopped = True
        closing = threading.Thread(target=self._close, daemon=True)  # a cluster that is gone does not answer
        closing.start()
        closing.join(PATIENCE)
        self._client.close(timeout=PATIENCE)

    def _close(self) -> None:
        with suppress(Exception):  # the cluster may be gone
            self._client.cancel(self._futures)
            self._client.run(close_idle_workers, on_error="ignore")

    def _ended(self, task: SweepTask, content: str, report: Callable[[Message], None], future: Any) -> None:
        if self._stopped:
            return
        try:
            report(future.result())
            future.release()
        except _dask().KilledWorker:
            report(
                task.record(content, "crashed", error="several workers of the cluster died while they ran this task")
            )
        except OtherEnvironmentError as error:
            report(error)
        except RefusedError as error:
            report(RefusedError(f"{error}; after a change of the sources, restart the workers of the cluster"))
        except BaseException as error:
            report(LostError(f"the cluster at {self._address}: {type(error).__name__}: {error}"))


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

    Raises OtherEnvironmentError if the computing environment is not the ``needed`` one, if given.
    """
    if needed and (other := difference(needed)):
        raise OtherEnvironmentError.from_difference(other.replace("(here", "(there"))
    known = module_path()
    place = (folder if os.path.isdir(folder) else None, (*known, *(entry for entry in path if entry not in known)))
    dask_worker = _dask().get_worker()
    running = dask_worker.get_current_task()

    def cancelled() -> bool:  # by the client, or because the client is gone
        state = dask_worker.state.tasks.get(running)
        return state is None or state.state == "cancelled"

    worker = _taken(place)
    try:
        return worker.run(task, content, timeout, cancelled)
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
