"""Parent's side of a child process that runs tasks (``mathnavi.sim.sweep.serve``): time-outs, crashes, replacement.

A task, a trial or a job, runs in a separate process so that a faulty plug-in ends that process and nothing
else. The process is started as a program, not forked, so it can be started from any thread and inside Dask's workers,
and it leads its own session, so that Ctrl-C does not reach it and processes that a plug-in has started are killed with
it.
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
_INTERVAL = 1.0  # [s] between two checks of whether the result is still needed
_OUTPUT_LINES = 20  # of what a child printed before it died
_OUTPUT_BYTES = 4000
_EXIT_GRACE = 10.0  # [s] between the end of a connection and that of its process


_children: WeakSet[_Child] = WeakSet()  # of this process


class RefusedError(RuntimeError):
    """Refusal of a child process to run a task, because its code or its files differ."""


class OtherEnvironmentError(RefusedError):
    """Difference in the environment of a worker: its results may differ, by rounding and more."""

    @staticmethod
    def from_difference(words: str) -> OtherEnvironmentError:
        """Return the error for a difference between two environments, given in words."""
        return OtherEnvironmentError(
            f"a worker computes in another environment, {words}: its results may differ from those of this one, "
            "by rounding or by the minimum that a solver ends in; allowed: the same environment, or --mix-environments"
        )


class StoppedError(RuntimeError):
    """Signal that the result of the task is no longer needed."""


class OverdueError(RuntimeError):
    """Time-out of a task."""


class DiedError(RuntimeError):
    """End of a child process during a task; the message says how."""


class Worker:
    """Runner of one task after the other in a child process, which is replaced when it has died or had to be killed."""

    def __init__(self, path: Sequence[str], folder: str | None = None) -> None:
        """Set the child's sys.path, ``path``, and its working folder, ``folder``."""
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
        """Run a task that may take ``timeout`` [s], without numba's compilation, and return its record.

        The death or the refusal of a child counts if it had run nothing else before; otherwise the task runs once
        more, in a new one, so that neither leftovers of an earlier task nor outdated sources matter.
        ``compiling`` is called when numba compiles.

        Raises RefusedError, and StoppedError when the worker is stopped meanwhile or ``stopped()``, which is called
        from time to time, returns that the record is no longer needed.
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
        """Kill the child, from any thread; no task can run afterwards."""
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
    """Clock of the time left of a limit [s]; it stands still until it is started."""

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
    """Child process with its connection."""

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
        """Request one task and return its record; OverdueError, DiedError, RefusedError, StoppedError."""
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
    """Kill every child process of this process, and the processes that these have started: no result is needed any
    more.
    """
    for child in list(_children):
        child.kill()


def module_path() -> list[str]:
    """Return the ``sys.path`` of this process."""
    return [entry for entry in sys.path if isinstance(entry, str)]
