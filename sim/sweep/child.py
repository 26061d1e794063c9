"""The parent's side of a child process that runs tasks (``mathnavi.sim.sweep.serve``): time-outs, crashes,
replacement.

A task, a trial or a job, runs in a process of its own so that whatever a plug-in does ends that process and nothing
else. The process is started as a program, not forked, so it can be had from any thread and inside Dask's workers, and
it leads a session of its own, so that Ctrl-C does not reach it and what a plug-in has started is killed with it.
"""

from __future__ import annotations

import math
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from multiprocessing import Pipe
from threading import Lock
from weakref import WeakSet

from mathnavi.sim.sweep.serve import comparable
from mathnavi.sim.sweep.task import Ended, SweepTask

START = "import sys; sys.path[:] = sys.argv[2:]; from mathnavi.sim.sweep.serve import main; main(int(sys.argv[1]))"
# One thread each, so that children do not compete and no sum depends on the number of cores; and no order of a set
# that differs from process to process.
ENVIRONMENT = {
    **dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"),
    "PYTHONHASHSEED": "0",
}
_INTERVAL = 1.0  # [s] between two checks of whether somebody still waits
_OUTPUT_LINES = 20  # of what a child printed before it died
_OUTPUT_BYTES = 4000
_EXIT_GRACE = 10.0  # [s] between the end of a connection and that of its process


_children: WeakSet[_Child] = WeakSet()  # of this process


class RefusedError(RuntimeError):
    """A child process does not run what was asked, because its code or its files are others."""


class OtherEnvironmentError(RefusedError):
    """A worker computes in another environment, so that its results agree with those of this one to rounding only."""

    @staticmethod
    def from_difference(words: str) -> OtherEnvironmentError:
        """The error for a difference between two environments in words."""
        return OtherEnvironmentError(
            f"a worker computes in another environment, {words}: its results would agree with those of this one to "
            "rounding, not bit for bit; allowed: the same environment, or --mix-environments"
        )


class StoppedError(RuntimeError):
    """Nobody waits for the task any more."""


class OverdueError(RuntimeError):
    """A task has used up its time."""


class DiedError(RuntimeError):
    """A child process ended in the middle of a task; the message says how."""


class Worker:
    """Runs one task after the other in a child process, which is replaced when it has died or had to be killed."""

    def __init__(self, path: Sequence[str], folder: str | None = None) -> None:
        """``path`` is the child's sys.path, ``folder`` where it works."""
        self._path, self._folder = path, folder
        self._child: _Child | None = None
        self._closed = False
        self._lock = Lock()

    def run(
        self,
        task: SweepTask,
        content: str,
        timeout: float | None = None,
        stopped: Callable[[], bool] = lambda: False,
        compiling: Callable[[], None] = lambda: None,
    ) -> Ended:
        """The record of a task that may take ``timeout`` [s], not counting what numba compiles.

        A child that dies, or refuses, is believed if it had served nothing else before; otherwise the task is run once
        more, in a new one: neither what an earlier task has left behind nor sources that were loaded long ago count.
        ``compiling`` is called when numba compiles.

        Raises RefusedError, and StoppedError when the worker is stopped meanwhile or ``stopped()``, which is asked now
        and then, says that nobody waits for the record.
        """
        request = pickle.dumps((task, content))
        while True:
            child = self._living()
            served = child.served
            try:
                return child.ask(request, timeout, compiling, stopped)
            except OverdueError as error:
                self._replace()
                return self._failed(task, content, "timed-out", error)
            except DiedError as error:
                self._replace()
                if not served:
                    return self._failed(task, content, "crashed", error)
            except RefusedError:
                self._replace()
                if not served:
                    raise
            except StoppedError:
                self._replace()
                raise

    def stop(self) -> None:
        """Kill the child, from any thread; no task runs any more."""
        with self._lock:
            self._closed = True
            if self._child is not None:
                self._child.kill()

    def close(self) -> None:
        """End the child, while it runs no task."""
        with self._lock:
            self._closed = True
            if self._child is not None:
                self._child.discard()
            self._child = None

    @staticmethod
    def _failed(task: SweepTask, content: str, status: str, error: Exception) -> Ended:
        record: Ended = task.record(content, status, error=str(error))
        return record

    def _living(self) -> _Child:
        with self._lock:
            if self._closed:
                raise StoppedError
            if self._child is None:
                self._child = _Child(self._path, self._folder)
            return self._child

    def _replace(self) -> None:
        with self._lock:
            if self._closed:
                raise StoppedError
            if self._child is not None:
                self._child.discard()
            self._child = None


class _Clock:
    """The rest of a limit [s]; it stands until it is started."""

    def __init__(self, limit: float | None) -> None:
        self._left, self._since = math.inf if limit is None else limit, math.nan

    def start(self) -> None:
        self._since = time.monotonic()

    def stop(self) -> None:
        self._left, self._since = self.left(), math.nan

    def left(self) -> float:
        gone = 0.0 if math.isnan(self._since) else time.monotonic() - self._since
        return max(0.0, self._left - gone)


class _Child:
    """One process."""

    def __init__(self, path: Sequence[str], folder: str | None) -> None:
        self.served = 0  # tasks
        with ExitStack() as opened:
            self._connection, theirs = Pipe()
            opened.callback(self._connection.close)
            # Appended to, so that it can be emptied under the child.
            self._output = opened.enter_context(tempfile.TemporaryFile("a+b"))
            with theirs:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-c", START, str(theirs.fileno()), *path],
                    stdin=subprocess.DEVNULL,
                    stdout=self._output,
                    stderr=self._output,
                    pass_fds=(theirs.fileno(),),
                    cwd=folder,
                    env={**os.environ, **ENVIRONMENT},
                    start_new_session=True,
                )
            self._opened = opened.pop_all()
        _children.add(self)

    def ask(
        self, request: bytes, timeout: float | None, compiling: Callable[[], None], stopped: Callable[[], bool]
    ) -> Ended:
        """The record of one task; OverdueError, DiedError, RefusedError, StoppedError."""
        clock = _Clock(timeout)
        self._output.truncate(0)
        try:
            self._connection.send_bytes(request)
            while True:
                left = clock.left()
                if not self._connection.poll(min(left, _INTERVAL)):
                    if left == 0.0:
                        raise OverdueError(f"no end within {timeout:g} s")
                    if stopped():
                        raise StoppedError
                    continue
                what, value = self._connection.recv()
                if what == "refused":
                    raise RefusedError(value)
                if what == "ended":
                    self.served += 1
                    record: Ended = value
                    return record
                if what == "compiling" and value:
                    clock.stop()
                    compiling()
                else:
                    clock.start()
        except (EOFError, OSError) as error:
            raise DiedError(self._cause_of_death()) from error

    def kill(self) -> None:
        with suppress(ProcessLookupError, PermissionError):  # it is gone already
            os.killpg(self._process.pid, signal.SIGKILL)

    def discard(self) -> None:
        """Kill the process and all that it has started."""
        self.kill()
        self._process.wait()
        self._opened.close()

    def _cause_of_death(self) -> str:
        try:
            code = self._process.wait(_EXIT_GRACE)
        except subprocess.TimeoutExpired:
            return self._with_output_tail("the process has closed its connection")
        if code >= 0:
            return self._with_output_tail(f"the process ended itself with exit code {code}")
        hint = ", as it is where memory runs out" if code == -signal.SIGKILL else ""
        return self._with_output_tail(f"the process was killed by {signal.Signals(-code).name}{hint}")

    def _with_output_tail(self, cause: str) -> str:
        size = self._output.seek(0, os.SEEK_END)
        self._output.seek(max(0, size - _OUTPUT_BYTES))
        lines = comparable(self._output.read().decode(errors="replace")).splitlines()[-_OUTPUT_LINES:]
        return "\n".join([cause, *lines])


def kill_children() -> None:
    """Kill every child process of this process, and what these have started: nobody waits for them any more."""
    for child in list(_children):
        child.kill()


def module_path() -> list[str]:
    """The ``sys.path`` of this process."""
    return [entry for entry in sys.path if isinstance(entry, str)]
